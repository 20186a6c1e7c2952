//! Stiffness limits of a virtual wall: what no scheme passes, and what a simulator must reproduce.
//!
//! A handle of mass `m` and damping `b` presses a wall of stiffness `K` that answers after `t_d`: half a tick, the mean
//! age of a held sample, and the round trip. On the verge of instability `m s² + b s + K exp(-s t_d)` has a root at
//! `j omega`; with `x = omega t_d` its imaginary and real parts read
//!
//! ```text
//! b omega = K sin x        m omega² = K cos x        so        x tan x = b t_d / m,   K = (b / t_d) x / sin x
//! ```
//!
//! The sampled wall without a network obeys a condition of its own, [C94]: `b > K T/2 + |B|`.

use crate::polynomial::is_exactly_zero;
use std::f64::consts::FRAC_PI_2;

/// A handle against a wall across a network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DelayedWall {
    /// Mass of the handle, kg; above zero.
    pub mass_kg: f64,
    /// Damping of the handle, N·s/m; not below zero.
    pub damping_n_s_per_m: f64,
    /// Round trip of the network, s; not below zero.
    pub rtt_s: f64,
    /// Sample time of the wall, s; above zero.
    pub tick_s: f64,
}

/// A number that describes no wall.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{quantity} is {got}, need a finite number {need}")]
pub struct WallError {
    /// Its name, with its unit.
    pub quantity: &'static str,
    /// As given.
    pub got: f64,
    /// Its range, in words.
    pub need: &'static str,
}

/// Stiffness at which the wall begins to oscillate, N/m. 0 for a handle without damping.
///
/// # Errors
/// A quantity is not finite or out of its range.
pub fn critical_stiffness(wall: &DelayedWall) -> Result<f64, WallError> {
    require_positive("mass_kg", wall.mass_kg)?;
    require_not_negative("damping_n_s_per_m", wall.damping_n_s_per_m)?;
    require_not_negative("rtt_s", wall.rtt_s)?;
    require_positive("tick_s", wall.tick_s)?;
    let delay_s = wall.tick_s / 2.0 + wall.rtt_s;
    let wanted = wall.damping_n_s_per_m * delay_s / wall.mass_kg;
    let x = phase_at_the_verge(wanted);
    let over_sine = if is_exactly_zero(x) { 1.0 } else { x / x.sin() };
    Ok(wall.damping_n_s_per_m / delay_s * over_sine)
}

/// Greatest stiffness of a sampled wall with damping of its own that stays passive, N/m: `2 (b - |B|) / T`, and 0 where
/// the wall's damping uses up the handle's. Source: [C94].
///
/// # Errors
/// A quantity is not finite or out of its range.
pub fn passive_stiffness(
    damping_n_s_per_m: f64,
    wall_damping_n_s_per_m: f64,
    tick_s: f64,
) -> Result<f64, WallError> {
    require_not_negative("damping_n_s_per_m", damping_n_s_per_m)?;
    require_positive("tick_s", tick_s)?;
    if !wall_damping_n_s_per_m.is_finite() {
        return Err(WallError {
            quantity: "wall_damping_n_s_per_m",
            got: wall_damping_n_s_per_m,
            need: "of either sign",
        });
    }
    Ok((2.0 * (damping_n_s_per_m - wall_damping_n_s_per_m.abs()) / tick_s).max(0.0))
}

/// Solves `x tan x = wanted` between 0 and a quarter turn, where the left side grows from 0 without bound.
fn phase_at_the_verge(wanted: f64) -> f64 {
    /// Halvings until neighbouring numbers; the interval shrinks below rounding well before.
    const HALVINGS: usize = 80;
    let (mut low, mut high) = (0.0, FRAC_PI_2);
    for _ in 0..HALVINGS {
        let x: f64 = low + (high - low) / 2.0;
        // Without the pole of the tangent: x sin x against wanted cos x.
        if x * x.sin() < wanted * x.cos() {
            low = x;
        } else {
            high = x;
        }
    }
    low + (high - low) / 2.0
}

fn require_positive(quantity: &'static str, got: f64) -> Result<(), WallError> {
    if got.is_finite() && 0.0 < got {
        Ok(())
    } else {
        Err(WallError {
            quantity,
            got,
            need: "above zero",
        })
    }
}

fn require_not_negative(quantity: &'static str, got: f64) -> Result<(), WallError> {
    if got.is_finite() && 0.0 <= got {
        Ok(())
    } else {
        Err(WallError {
            quantity,
            got,
            need: "not below zero",
        })
    }
}
