//! The sampled tool follower: `C_h2` and `C_t2` of the live loop.
//!
//! A continuous `G_t^-1` differentiates twice; sampled, it need not. With `G_t(z)` from a zero-order hold, the command
//! that puts the tool at a wanted place *one sample later* is a finite number, so
//!
//! ```text
//! C_h2(z) = - A_h1 · C_h1(z) Tustin · G_h(z) zero-order hold · G_t(z)^-1 zero-order hold        (31), sampled
//! ```
//!
//! is causal, and the tool stands at `A_h1 y_h` at every sample, not nearly so.

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

/// From a force to the tool's command: shared admittance, handle model, inverse of the tool.
///
/// Feed it the net force `f_h - f_t / A_h2` and it is both (31) and (32) in one, for `S_h = S_t = 0`.
#[derive(Clone, Debug, PartialEq)]
pub struct Follower {
    c_h1: DiscreteStateSpace,
    g_h: DiscreteStateSpace,
    inverse: Inverse,
    position_ratio: f64,
}

/// Memory of one [`Follower`] on one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FollowerState {
    /// Of the admittance.
    pub c_h1: State,
    /// Of the handle model.
    pub g_h: State,
    /// Of the tool model inside the inverse.
    pub g_t: State,
}

/// Why a sampled plant cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FollowerError {
    /// The plant jumps with its command (relative degree 0): there is no next sample to aim at.
    #[error("{plant} has a direct term {direct}, need none")]
    DirectTerm {
        /// `G_h` or `G_t`.
        plant: &'static str,
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
    /// `A_h1` must be a positive number.
    #[error("position ratio is {got}, need a finite one above zero")]
    PositionRatio {
        /// As given.
        got: f64,
    },
    /// The parts were sampled at different times.
    #[error("parts are sampled at {c_h1_s}, {g_h_s} and {g_t_s} s, need one sample time")]
    SampleTimes {
        /// Of the admittance.
        c_h1_s: f64,
        /// Of the handle model.
        g_h_s: f64,
        /// Of the tool model.
        g_t_s: f64,
    },
}

impl Inverse {
    /// Inverts a plant whose output answers a command exactly one sample later.
    ///
    /// # Errors
    /// The plant has a direct term, answers later, or its zeros are not inside the unit circle.
    pub fn new(plant: &DiscreteStateSpace) -> Result<Self, FollowerError> {
        require_no_direct_term("G_t", plant)?;
        let gain = plant.next_output_gain();
        let command_per_output = 1.0 / gain;
        if is_exactly_zero(gain) || !command_per_output.is_finite() {
            return Err(FollowerError::Sluggish);
        }
        let radius = plant
            .inverse_dynamics_radius()
            .ok_or(FollowerError::ZerosUnknown)?;
        if radius.is_nan() || 1.0 <= radius {
            return Err(FollowerError::NotInvertible { radius });
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

impl Follower {
    /// Joins the parts. `c_h1` by Tustin, `g_h` and `inverse` by zero-order hold, all at one sample time.
    ///
    /// # Errors
    /// The sample times differ, `g_h` has a direct term, or the ratio is not a positive number.
    pub fn new(
        c_h1: &DiscreteStateSpace,
        g_h: &DiscreteStateSpace,
        inverse: &Inverse,
        position_ratio: f64,
    ) -> Result<Self, FollowerError> {
        if !(position_ratio.is_finite() && 0.0 < position_ratio) {
            return Err(FollowerError::PositionRatio {
                got: position_ratio,
            });
        }
        require_no_direct_term("G_h", g_h)?;
        let (c_h1_s, g_h_s, g_t_s) = (c_h1.dt_s(), g_h.dt_s(), inverse.plant.dt_s());
        if !(is_exactly_zero(c_h1_s - g_h_s) && is_exactly_zero(g_h_s - g_t_s)) {
            return Err(FollowerError::SampleTimes {
                c_h1_s,
                g_h_s,
                g_t_s,
            });
        }
        Ok(Self {
            c_h1: c_h1.clone(),
            g_h: g_h.clone(),
            inverse: inverse.clone(),
            position_ratio,
        })
    }

    /// The tool's command at this sample for a net force in N.
    #[inline]
    pub fn step(&self, state: &mut FollowerState, force_n: f64) -> f64 {
        let handle_command = self.c_h1.step(&mut state.c_h1, force_n);
        self.g_h.advance(&mut state.g_h, handle_command);
        let next_handle_m = self.g_h.output(&state.g_h, 0.0);
        self.inverse
            .step(&mut state.g_t, self.position_ratio * next_handle_m)
    }
}

fn require_no_direct_term(
    plant: &'static str,
    system: &DiscreteStateSpace,
) -> Result<(), FollowerError> {
    let [direct] = system.direct();
    if is_exactly_zero(direct) {
        Ok(())
    } else {
        Err(FollowerError::DirectTerm { plant, direct })
    }
}
