//! The simulated person and handle: the paper's identified servo `G_h` and arm `T_h`, and intents that drive them.
//!
//! Source: [KHMH03] (16)–(19), (35)–(37) in docs/papers.md. SI units throughout; a position is the handle's
//! displacement from its home.
//!
//! ```text
//!   intent ──u_h──> (+) ──f_h──> force sensor          f_h = u_h - T_h y_h
//!                    ^ -
//!                   T_h <──y_h── G_h <──v_h── controller
//! ```
//!
//! The handle is not back-drivable: it moves only as its position command `v_h` says, and the hand's force reaches the
//! loop through the sensor alone. [`SimulatedHandle`] is that and no more; [`RobotHandle`] does it with the joints of
//! the parallel robot and their limits.

mod intent;
mod path;
mod person;
mod robot;
mod simulated;
mod track;

pub use intent::{Intent, IntentError, Reach};
pub use path::{Path, PathError, Waypoint};
pub use robot::{RobotError, RobotHandle, RobotSetup, RobotState, ServoLimits};
pub use simulated::{SimulatedHandle, SimulatedHandleError};
pub use teleclay_kinematics::Singularity;
pub use track::{Track, TrackError, TrackPoint};

/// Three-vector in SI units; axes x, y, z of the handle.
pub type Vec3 = nalgebra::Vector3<f64>;

/// How many axes of a handle reflect force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// The paper's x–y handle. The third axis is a lift: the operator sets its height and feels nothing of it.
    Two,
    /// All three.
    Three,
}

impl Axes {
    /// Number of force-reflecting axes.
    pub fn count(self) -> usize {
        match self {
            Self::Two => 2,
            Self::Three => 3,
        }
    }
}
