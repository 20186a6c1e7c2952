//! The inverse of a sampled plant: the `G_t^-1` of [KHMH03] (31) and (32), without a differentiator.
//!
//! A continuous `G_t^-1` differentiates twice; sampled, it need not. With `G_t(z)` from a zero-order hold, the command
//! that puts the tool at a wanted place *one sample later* is a finite number, so the inverse is causal, and the tool
//! stands at the wanted place at every sample, not nearly so.

use crate::discrete::{DiscreteStateSpace, State};
use crate::polynomial::is_exactly_zero;

/// Exact inverse of a sampled plant, one sample ahead.
///
/// The memory is a copy of the plant's state, which the same commands keep equal to the plant's own.
#[derive(Clone, Debug, PartialEq)]
pub struct Inverse {
    plant: DiscreteStateSpace,
    /// `1 / (c b)`.
    command_per_output: f64,
}

/// Why a sampled plant cannot be inverted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InverseError {
    /// The plant jumps with its command (relative degree 0): there is no next sample to aim at.
    #[error("G_t has a direct term {direct}, need none")]
    DirectTerm {
        /// The direct term.
        direct: f64,
    },
    /// A command does not show in the next output (relative degree 2 or more in z).
    #[error("G_t does not answer within one sample")]
    Sluggish,
    /// The inverse would ring without end.
    #[error(
        "a zero of the sampled G_t has magnitude {radius}, need below 1: give the tool some damping"
    )]
    NotInvertible {
        /// Largest magnitude among the zeros.
        radius: f64,
    },
    /// The zeros could not be found.
    #[error("zeros of the sampled G_t could not be found")]
    ZerosUnknown,
}

impl Inverse {
    /// Inverts a plant whose output answers a command exactly one sample later.
    ///
    /// # Errors
    /// The plant has a direct term, answers later, or its zeros are not inside the unit circle.
    pub fn new(plant: &DiscreteStateSpace) -> Result<Self, InverseError> {
        let [direct] = plant.direct();
        if !is_exactly_zero(direct) {
            return Err(InverseError::DirectTerm { direct });
        }
        let gain = plant.next_output_gain();
        let command_per_output = 1.0 / gain;
        if is_exactly_zero(gain) || !command_per_output.is_finite() {
            return Err(InverseError::Sluggish);
        }
        let radius = plant
            .inverse_dynamics_radius()
            .ok_or(InverseError::ZerosUnknown)?;
        if radius.is_nan() || 1.0 <= radius {
            return Err(InverseError::NotInvertible { radius });
        }
        Ok(Self {
            plant: plant.clone(),
            command_per_output,
        })
    }

    /// The command now that makes the plant's *next* output equal `next_reference`.
    #[inline]
    pub fn step(&self, state: &mut State, next_reference: f64) -> f64 {
        let command =
            (next_reference - self.plant.free_next_output(state)) * self.command_per_output;
        self.plant.advance(state, command);
        command
    }

    /// The plant that is inverted.
    #[must_use]
    pub fn plant(&self) -> &DiscreteStateSpace {
        &self.plant
    }
}
