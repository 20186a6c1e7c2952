//! The calls of the theory, from a request to an answer, without HTTP: the server's interface and its command line both
//! use them.
//!
//! The mathematics is in `teleclay_kinematics`, `teleclay_control` and `teleclay_sim::experiment`; here requests become
//! their inputs, and their errors say which field of the request is at fault. What takes long is told now and then to
//! go on, and ends when it is not: whoever calls brings the clock.
//!
//! | call | function |
//! |---|---|
//! | the parallel robot | [`inverse`], [`forward`], [`jacobian`], [`workspace()`] |
//! | a loop: poles, margins, delay margins, curves | [`analyse`] |
//! | the lightest handle that keeps a margin | [`tune`] |
//! | the cutting experiment through the clay | [`cutting()`] |

mod cutting;
mod robot;
mod stability;
mod tuning;

use teleclay_proto::http::FieldError;

pub use cutting::cutting;
pub use robot::{forward, inverse, jacobian, workspace, workspace_by_layers};
pub use stability::{analyse, loop_input};
pub use tuning::tune;

/// Why a request has no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unanswered {
    /// A field does not hold what it should.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The robot does not reach so far.
    #[error("{0}")]
    Unreachable(String),
    /// The rods do not meet.
    #[error("{0}")]
    NoAssembly(String),
    /// The robot has no answer at this very place.
    #[error("{0}")]
    Singular(String),
    /// The parts make no loop that could be analysed.
    #[error("{0}")]
    NoLoop(String),
    /// No handle meets the target.
    #[error("{0}")]
    Untunable(String),
    /// The experiment would come to no end that means something, or came to none.
    #[error("{0}")]
    Infeasible(String),
    /// Whoever asked called it off, or it took too long.
    #[error("{0}")]
    CalledOff(String),
}
