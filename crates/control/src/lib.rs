//! Linear control for the two sides of a haptic loop: plants as rational functions of `s`, their sampled forms,
//! and the compensators that tie a tool to a handle.
//!
//! Everything here is a pure calculation: no IO, no clock, no threads. Units are SI; the symbols are those of
//! [KHMH03] in docs/papers.md, and equation numbers in brackets are that paper's.
//!
//! | to do this | start at |
//! |---|---|
//! | describe a plant | [`Polynomial`], [`RationalFunction`], [`paper`] |
//! | run it at 1 kHz | [`StateSpace`] → [`DiscreteStateSpace`] with a [`State`] per axis |
//! | tie the tool to the handle | [`compensators`] and [`Inverse`] |
//! | know whether a loop is stable, and for how long a delay | [`analysis::analyse`], or [`ClosedLoop`] part by part |
//! | know what it does past that delay | [`ClosedLoop::characteristic`], then [`Characteristic::fastest_growth`] |
//! | choose `C_h1` | [`tuning::propose`] |
//! | know what no wall can pass | [`wall`] |

pub mod analysis;
mod axis;
mod balance;
mod characteristic;
mod closed_loop;
pub mod compensators;
mod curves;
mod delay;
mod discrete;
mod frequency;
mod growth;
mod inverse;
mod margins;
pub mod paper;
mod polynomial;
mod rational;
mod roots;
mod state_space;
pub mod tuning;
pub mod wall;

pub use characteristic::{Characteristic, GainAt};
pub use closed_loop::{ClosedLoop, LoopError};
pub use curves::Curve;
pub use delay::{DelayMargin, DelayedScheme, NoMargin, delay_margin};
pub use discrete::{DiscreteStateSpace, DiscretiseError, State};
pub use growth::Growth;
pub use inverse::{Inverse, InverseError};
pub use margins::{ClassicalMargins, GainMargin, Margins, NyquistDistance, PhaseMargin, SmallGain};
pub use nalgebra::Complex;
pub use polynomial::{Polynomial, PolynomialError};
pub use rational::{RationalError, RationalFunction};
pub use roots::RootsError;
pub use state_space::{StateSpace, StateSpaceError};

/// Highest order of anything that is stepped, and of either part of a rational function.
///
/// The paper's largest cascade, `C_h2`, has order 7. Twelve leaves room for an identified plant with a few resonances,
/// while a [`State`] stays below two cache lines and no step ever allocates.
pub const MAX_ORDER: usize = 12;
