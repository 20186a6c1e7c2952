//! Brings a handle to rest before its loop is exchanged or ends.
//!
//! A handle that follows position commands stops as abruptly as its commands do, and one that renders force drops what
//! it held when the commands end. So the last command coasts to a stop and the force fades, and only then another loop
//! takes over, from where the handle stands.

use crate::{DeviceCommand, DeviceSample};

/// Time constant of the stop, s: from a fast stroke (0.1 m/s) to rest within 3 mm, at a third of gravity.
const STOP_TAU_S: f64 = 0.03;
/// Slower than this is at rest, m/s: no hand notices when 1 um a tick ends.
const REST_M_S: f64 = 1e-3;
/// A handle that is slow to follow, or that somebody pushes, is waited for no longer than this, s.
const LONGEST_S: f64 = 0.3;

/// A stop under way.
#[derive(Clone, Copy, Debug)]
pub struct Brake {
    tick_s: f64,
    ramp_s: f64,
    position_m: [f64; 3],
    step_m: [f64; 3],
    /// Share of a speed that is left a tick later: of `v' = -v / tau`, by the implicit Euler step, which every machine
    /// rounds alike.
    keep: f64,
    gain: f64,
    ticks: u32,
}

impl Brake {
    /// From a command at `position_m` that moved by `step_m` in its last tick. The force fades within `ramp_s`.
    #[must_use]
    pub fn new(position_m: [f64; 3], step_m: [f64; 3], tick_s: f64, ramp_s: f64) -> Self {
        Self {
            tick_s,
            ramp_s,
            position_m,
            step_m,
            keep: STOP_TAU_S / (STOP_TAU_S + tick_s),
            gain: 1.0,
            ticks: 0,
        }
    }

    /// The command of the next tick; `force_n` is what the loop would have given.
    pub fn step(&mut self, force_n: [f64; 3]) -> DeviceCommand {
        for (position_m, step_m) in self.position_m.iter_mut().zip(&mut self.step_m) {
            *step_m *= self.keep;
            *position_m += *step_m;
        }
        self.gain = (self.gain - self.tick_s / self.ramp_s).max(0.0);
        self.ticks = self.ticks.saturating_add(1);
        DeviceCommand {
            position_m: self.position_m,
            force_n: force_n.map(|force| force * self.gain),
        }
    }

    /// Whether command and handle are at rest and no force is left, or waiting for it took too long.
    #[must_use]
    pub fn is_done(&self, sample: &DeviceSample) -> bool {
        if self.gain > 0.0 {
            return false;
        }
        let is_slow = |speed: f64| speed.abs() < REST_M_S;
        let command_rests = self.step_m.iter().all(|step| is_slow(step / self.tick_s));
        let handle_rests = sample.velocity_m_s.iter().copied().all(is_slow);
        (command_rests && handle_rests) || LONGEST_S <= f64::from(self.ticks) * self.tick_s
    }
}

#[cfg(test)]
#[allow(
    clippy::float_cmp,
    reason = "zero and one are meant exactly: a ramp ends, a gain is full"
)]
mod tests {
    use super::*;

    const TICK_S: f64 = 1e-3;

    #[test]
    fn a_moving_command_comes_to_rest_without_a_jolt() {
        let speed_m_s = 0.1;
        let mut brake = Brake::new([0.0; 3], [speed_m_s * TICK_S, 0.0, 0.0], TICK_S, 0.05);
        let still = DeviceSample::default();
        let (mut at, mut speed, mut force, mut ticks) = (0.0, speed_m_s, 5.0, 0);
        while !brake.is_done(&still) {
            let command = brake.step([5.0, 0.0, 0.0]);
            let now = (command.position_m[0] - at) / TICK_S;
            assert!(
                0.0 <= now && speed - now < 5.0 * TICK_S,
                "{speed} to {now} m/s in a tick"
            );
            assert!(
                (0.0..=0.1 + 1e-12).contains(&(force - command.force_n[0])),
                "{}",
                command.force_n[0]
            );
            (at, speed, force, ticks) = (command.position_m[0], now, command.force_n[0], ticks + 1);
        }
        assert!(at < 0.0031, "{at} m");
        assert!(f64::from(ticks) * TICK_S < 0.2, "{ticks} ticks");
        assert_eq!(force, 0.0);
    }

    #[test]
    fn a_handle_that_never_rests_is_not_waited_for() {
        let mut brake = Brake::new([0.0; 3], [0.0; 3], TICK_S, 0.05);
        let pushed = DeviceSample {
            velocity_m_s: [0.02, 0.0, 0.0],
            ..DeviceSample::default()
        };
        let ticks = (1..).find(|_| {
            brake.step([0.0; 3]);
            brake.is_done(&pushed)
        });
        assert_eq!(ticks, Some(300));
    }
}
