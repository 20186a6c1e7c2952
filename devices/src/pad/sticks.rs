//! From the values of axes to a place: dead zones, the session's workspace, and a speed that a handle can follow.

use super::layout::{Lift, X, Y};
use super::port::{AxisInfo, PadState};

/// Share of a stick's way about its middle that counts as the middle. Worn sticks rest up to a tenth off it.
pub const DEAD_ZONE: f64 = 0.12;

/// The axes of a device, as they stand.
#[derive(Clone, Debug, Default)]
pub struct Axes(Vec<AxisInfo>);

impl Axes {
    /// As they were read.
    #[must_use]
    pub fn of(state: &PadState) -> Self {
        Self(state.axes.clone())
    }

    /// An axis has another value.
    pub fn set(&mut self, code: u16, value: i32) {
        if let Some(axis) = self.0.iter_mut().find(|axis| axis.code == code) {
            axis.value = value;
        }
    }

    /// Deflection from -1 to 1 on x, y and lift, right, away and up counting positive. Exactly 0 within the dead zone;
    /// what the device lacks rests.
    #[must_use]
    pub fn deflection(&self, lift: Lift) -> [f64; 3] {
        // Axes count down as positive.
        let [x, y] = round([self.off_middle(X), -self.off_middle(Y)]);
        let up = match lift {
            Lift::Stick(code) => -without_dead_zone(self.off_middle(code)),
            Lift::StickAndTriggers { stick, up, down } => {
                let trigger = |code: u16| without_dead_zone(self.off_rest(code));
                let stick = -without_dead_zone(self.off_middle(stick));
                (stick + trigger(up) - trigger(down)).clamp(-1.0, 1.0)
            }
        };
        [x, y, up]
    }

    /// From -1 to 1.
    fn off_middle(&self, code: u16) -> f64 {
        2.0 * self.share(code, 0.5) - 1.0
    }

    /// From 0 to 1.
    fn off_rest(&self, code: u16) -> f64 {
        self.share(code, 0.0)
    }

    /// Share of the axis's range, 0 to 1; `rest` where there is no such axis, or one without a range.
    fn share(&self, code: u16, rest: f64) -> f64 {
        let Some(axis) = self.0.iter().find(|axis| axis.code == code) else {
            return rest;
        };
        let range = f64::from(axis.most) - f64::from(axis.least);
        if range <= 0.0 {
            return rest;
        }
        ((f64::from(axis.value) - f64::from(axis.least)) / range).clamp(0.0, 1.0)
    }
}

/// A stick's two axes together: a round dead zone, a round rim.
fn round(stick: [f64; 2]) -> [f64; 2] {
    let way = (stick[0] * stick[0] + stick[1] * stick[1]).sqrt();
    if way <= DEAD_ZONE {
        return [0.0; 2];
    }
    let share = without_dead_zone(way.min(1.0));
    stick.map(|part| part / way * share)
}

fn without_dead_zone(deflection: f64) -> f64 {
    let beyond = (deflection.abs() - DEAD_ZONE).max(0.0) / (1.0 - DEAD_ZONE);
    if beyond <= 0.0 {
        0.0
    } else {
        beyond.copysign(deflection)
    }
}

/// A place that follows a stick no faster than a handle could: a stick that is let go of springs back within a few
/// milliseconds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Follower {
    place_m: [f64; 3],
    last_ns: Option<u64>,
}

/// Steps further apart than this count as this far apart, ns: a place does not leap after a stall.
const LONGEST_STEP_NS: u64 = 20_000_000;

impl Follower {
    /// The place at `now_ns`, on its way to `target_m` at `speed_m_s` at most.
    pub fn step(&mut self, now_ns: u64, target_m: [f64; 3], speed_m_s: f64) -> [f64; 3] {
        let last_ns = self.last_ns.replace(now_ns).unwrap_or(now_ns);
        let passed_ns = now_ns.saturating_sub(last_ns).min(LONGEST_STEP_NS);
        let most_m = speed_m_s * passed_ns as f64 * 1e-9;
        let way: [f64; 3] = std::array::from_fn(|axis| target_m[axis] - self.place_m[axis]);
        let length_m = way.iter().map(|part| part * part).sum::<f64>().sqrt();
        let share = if length_m <= most_m {
            1.0
        } else {
            most_m / length_m
        };
        self.place_m = std::array::from_fn(|axis| self.place_m[axis] + share * way[axis]);
        self.place_m
    }
}

#[cfg(test)]
mod tests {
    use super::super::layout::{RY, RZ, Z};
    use super::*;

    const LIFT: Lift = Lift::StickAndTriggers {
        stick: RY,
        up: Z,
        down: RZ,
    };

    fn axes(values: &[(u16, i32)]) -> Axes {
        let stick = |code: u16, value: i32| AxisInfo {
            code,
            least: -32768,
            most: 32767,
            value,
        };
        let trigger = |code: u16, value: i32| AxisInfo {
            code,
            least: 0,
            most: 255,
            value,
        };
        let mut axes = Axes(vec![
            stick(X, 0),
            stick(Y, 0),
            stick(RY, 0),
            trigger(Z, 0),
            trigger(RZ, 0),
        ]);
        for &(code, value) in values {
            axes.set(code, value);
        }
        axes
    }

    #[test]
    fn a_stick_that_rests_off_its_middle_moves_nothing() {
        for (x, y) in [(2500, -2500), (-3800, 0), (0, 3900)] {
            let at = axes(&[(X, x), (Y, y), (RY, 3000), (Z, 20)]).deflection(LIFT);
            assert!(at.iter().all(|part| part.abs() <= 0.0), "{at:?}");
        }
    }

    #[test]
    fn the_rim_is_one_and_away_and_up_are_positive() {
        let close = |got: [f64; 3], want: [f64; 3]| {
            for axis in 0..3 {
                assert!(
                    (got[axis] - want[axis]).abs() < 1e-3,
                    "{got:?}, want {want:?}"
                );
            }
        };
        close(axes(&[(X, 32767)]).deflection(LIFT), [1.0, 0.0, 0.0]);
        close(axes(&[(Y, -32768)]).deflection(LIFT), [0.0, 1.0, 0.0]);
        close(axes(&[(RY, -32768)]).deflection(LIFT), [0.0, 0.0, 1.0]);
        close(axes(&[(RZ, 255)]).deflection(LIFT), [0.0, 0.0, -1.0]);
        close(axes(&[(Z, 255), (RZ, 255)]).deflection(LIFT), [0.0; 3]);
        let corner = axes(&[(X, 32767), (Y, -32768)]).deflection(LIFT);
        close(corner, [0.5_f64.sqrt(), 0.5_f64.sqrt(), 0.0]);
    }

    #[test]
    fn a_place_follows_at_its_speed_and_arrives() {
        let mut follower = Follower::default();
        let target = [0.03, -0.04, 0.0];
        let mut last = follower.step(0, target, 0.4);
        for step in 1..=40_u64 {
            let at = follower.step(step * 4_000_000, target, 0.4);
            let way: f64 = (0..3).map(|axis| (at[axis] - last[axis]).powi(2)).sum();
            assert!(way.sqrt() <= 0.4 * 0.004 + 1e-12);
            last = at;
        }
        assert!(
            (0..3).all(|axis| (last[axis] - target[axis]).abs() < 1e-12),
            "{last:?}"
        );
        let after_a_stall = follower.step(10_000_000_000, [0.0; 3], 0.4);
        let way: f64 = (0..3)
            .map(|axis| (after_a_stall[axis] - last[axis]).powi(2))
            .sum();
        assert!(way.sqrt() <= 0.4 * 0.02 + 1e-12);
    }
}
