//! How stiff a coupling may be: what the sampling of two sides, their delays and their damping leave.
//!
//! # Derivation
//!
//! The device moves by `x`, the handle by `y`, and the coupling pushes with `f` on the handle and `-f` on the device.
//! It never gives more energy than it got if `∫ f (x' - y') dt` is not below zero from rest on. For the true spring and
//! damper that holds; but what it reckons with is old. Its `x` lags behind the device by `e_x = x - x_read`, its `y` by
//! `e_y`, and
//!
//! ```text
//! ∫ f (x' - y') dt = K/2 (x - y)²  -  K ∫ (e_x - e_y) (x' - y') dt  +  B ∫ (filtered difference) (x' - y') dt
//! ```
//!
//! Let `X² = ∫ x'² dt` and `Y²` likewise. A value that is `tau` old when it begins to count and is then held for `T`
//! has
//!
//! ```text
//! |∫ e_x y' dt| <= N_x X Y     N = 2 T/pi + tau     the norm of an integral over T, 2 T/pi, and that of a delay
//! |∫ e_x x' dt| <= D_x X²      D = T/2 + tau        where tau is a whole number of intervals, and otherwise N
//! ```
//!
//! Half the interval is the mean age of a held value. A delay that is no whole number of intervals is worse than that:
//! a motion in step with the samples meets a value that is older where it is fast. Half an interval of delay needs
//! 1.06 T instead of T. [`Playback::Interpolated`](crate::Playback) delays by one interval and strays from the true
//! way by no more than `T/pi` in the same norm, which is less than what a held value of that delay has: it counts as
//! one.
//!
//! and a filtered velocity, whose gain is nowhere above 1, gives `-B (X + Y)²` at worst. The dampings of the device,
//! `b`, and of the handle, `b_h`, pay `b X² + b_h Y²`. So all is paid for as soon as, with `C = (N_x + N_y) / 2`,
//!
//! ```text
//! (b - |B| - K D_x) (b_h - |B| - K D_y) >= (|B| + K C)²      and neither bracket below zero
//! ```
//!
//! With the handle held fast, `b_h` infinite, this is `b >= K (T/2 + tau) + |B|`: without delay [C94], and with a delay
//! of `d` whole intervals what [C94]'s own condition gives for `H(z) = K z^-d`, where
//! `Re{(1 - 1/z) z^-d} / (1 - cos theta) = sin((d + 1/2) theta) / sin(theta/2)` is at most `2 d + 1`.
//!
//! With both free, the dampings work in series, `b_s = b b_h / (b + b_h)`: a relative motion moves both, and a coupling
//! that a device alone could bear rings between it and a light handle. Only `|B| < b_s` leaves any stiffness at all.

use std::f64::consts::PI;

/// A delay this near to a whole number of intervals, in intervals, is one.
const WHOLE: f64 = 1e-6;

/// A device as the coupling sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceTiming {
    /// Slowest rate at which its place is read and its force renewed, 1/s.
    pub rate_hz: f64,
    /// Its own damping in the lightest grip that counts, N·s/m. Infinite for a device that no force moves, because it
    /// renders none: a mouse, a finger on glass.
    pub damping_n_s_per_m: f64,
    /// Age of a sample when it is reckoned with, beyond its wait for the next one, and of the force when the device
    /// puts it out, together, s.
    pub latency_s: f64,
}

impl DeviceTiming {
    /// Longest time between two samples, s.
    pub fn interval_s(&self) -> f64 {
        1.0 / self.rate_hz
    }
}

/// The loop's handle as the coupling sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopHandle {
    /// Tick of the loop, s.
    pub tick_s: f64,
    /// Damping of the handle's admittance, N·s/m: `B` of `C_h1`. Infinite for a handle that is held fast.
    pub damping_n_s_per_m: f64,
    /// Time from the handle's place to the force's effect on it, beyond the tick for which the force is held, s. A tick
    /// where the handle follows its command one tick later.
    pub latency_s: f64,
}

/// A number that is no timing.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{quantity} is {got}, need a number {need}")]
pub struct TimingError {
    /// Its name, with its unit.
    pub quantity: &'static str,
    /// As given.
    pub got: f64,
    /// Its range, in words.
    pub need: &'static str,
}

/// Stiffest spring, N/m, that stays passive between this device and this handle beside a damper of
/// `coupling_damping_n_s_per_m`: the `K` at which the condition of this module holds with equality. 0 where the
/// coupling's damper alone uses up what the two sides have, infinite where neither side is moved by a force.
///
/// All of it in the handle's coordinates: see [`Scale::at_handle`](crate::Scale::at_handle) for a device behind a
/// scale. Source: [C94], and the derivation of this module for a handle that is free.
///
/// # Errors
/// A rate or a tick that is not above zero, or a damping or latency below it.
pub fn max_stiffness(
    device: &DeviceTiming,
    handle: &LoopHandle,
    coupling_damping_n_s_per_m: f64,
) -> Result<f64, TimingError> {
    check(device, handle, coupling_damping_n_s_per_m)?;
    let own = coupling_damping_n_s_per_m.abs();
    let interval_s = device.interval_s();
    let d_x = age_s(interval_s, device.latency_s);
    let d_y = age_s(handle.tick_s, handle.latency_s);
    let c = (interval_s + handle.tick_s) / PI + (device.latency_s + handle.latency_s) / 2.0;
    let p = device.damping_n_s_per_m - own;
    let q = handle.damping_n_s_per_m - own;
    let bound = match (p.is_infinite(), q.is_infinite()) {
        (true, true) => f64::INFINITY,
        (false, true) => p / d_x,
        (true, false) => q / d_y,
        (false, false) => {
            // alpha K² - beta K + gamma = 0: its least root, in the form that no sign of alpha spoils.
            let alpha = d_x * d_y - c * c;
            let beta = p * d_y + q * d_x + 2.0 * own * c;
            let gamma = p * q - own * own;
            if p <= 0.0 || q <= 0.0 || gamma <= 0.0 {
                0.0
            } else {
                2.0 * gamma / (beta + (beta * beta - 4.0 * alpha * gamma).max(0.0).sqrt())
            }
        }
    };
    Ok(bound.max(0.0))
}

/// `D`: what a value costs that is `latency_s` old when it begins to count and is held for `interval_s`, s.
fn age_s(interval_s: f64, latency_s: f64) -> f64 {
    let intervals = latency_s / interval_s;
    if (intervals - intervals.round()).abs() < WHOLE {
        interval_s / 2.0 + latency_s
    } else {
        2.0 * interval_s / PI + latency_s
    }
}

/// Damping of two dampers in series, N·s/m; either may be infinite.
pub fn series(a_n_s_per_m: f64, b_n_s_per_m: f64) -> f64 {
    let (least, most) = (a_n_s_per_m.min(b_n_s_per_m), a_n_s_per_m.max(b_n_s_per_m));
    if most.is_infinite() || least <= 0.0 {
        least
    } else {
        least / (1.0 + least / most)
    }
}

fn check(device: &DeviceTiming, handle: &LoopHandle, own: f64) -> Result<(), TimingError> {
    let finite_above_zero = |got: f64| got.is_finite() && 0.0 < got;
    let finite_not_below = |got: f64| got.is_finite() && 0.0 <= got;
    let not_below = |got: f64| 0.0 <= got;
    let wanted = [
        (
            "rate_hz",
            device.rate_hz,
            finite_above_zero(device.rate_hz),
            "above zero",
        ),
        (
            "damping_n_s_per_m of the device",
            device.damping_n_s_per_m,
            not_below(device.damping_n_s_per_m),
            "not below zero",
        ),
        (
            "latency_s of the device",
            device.latency_s,
            finite_not_below(device.latency_s),
            "not below zero, finite",
        ),
        (
            "tick_s",
            handle.tick_s,
            finite_above_zero(handle.tick_s),
            "above zero",
        ),
        (
            "damping_n_s_per_m of the handle",
            handle.damping_n_s_per_m,
            not_below(handle.damping_n_s_per_m),
            "not below zero",
        ),
        (
            "latency_s of the handle",
            handle.latency_s,
            finite_not_below(handle.latency_s),
            "not below zero, finite",
        ),
        (
            "damping_n_s_per_m of the coupling",
            own,
            own.is_finite(),
            "that is finite",
        ),
    ];
    wanted
        .into_iter()
        .try_for_each(|(quantity, got, is_good, need)| {
            is_good.then_some(()).ok_or(TimingError {
                quantity,
                got,
                need,
            })
        })
}
