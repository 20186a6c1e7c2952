//! Where a tool may go in a tick: the one limiter that every motion passes, on the server and on the handle's
//! copy of the clay alike.
//!
//! It follows a reference step by step while its gain is above zero, and holds the tool while it is zero. Nothing that
//! was asked for during a hold is made up for: afterwards the tool goes on from where it stands, and where the
//! reference is a place rather than a sum of increments, it returns there at [`RECOVERY_SPEED_M_S`].

use crate::Vec3;
use crate::safety::capped;

/// After a hold the tool returns to the handle's place at this speed at most, m/s: seen coming, and slow enough for any
/// clay here.
pub const RECOVERY_SPEED_M_S: f64 = 0.05;
/// On the last millimetres the return slows down in proportion to what is left, 1/s. A tool that stopped dead there
/// would jolt the hand.
const RECOVERY_PER_S: f64 = 20.0;
/// The return takes this long to come to speed, s, for the same reason.
const RECOVERY_RISE_S: f64 = 0.1;
/// The lift of a two-axis session moves the tool no faster than this, m/s.
const LIFT_SPEED_M_S: f64 = 0.1;

/// What a reference means after a pause or a silence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recovery {
    /// It is where the handle is: the tool goes there, slowly.
    Absolute,
    /// It is a sum of increments: where it stands is as good as anywhere, so the tool goes on from where it was held.
    Incremental,
}

/// Bounds of a tool's motion. Positions are displacements from the image of the handle's home, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionLimits {
    /// Tick, s.
    pub tick_s: f64,
    /// Least and greatest displacement, m.
    pub reach: [Vec3; 2],
    /// Greatest speed, m/s.
    pub speed_m_s: f64,
}

impl MotionLimits {
    /// The nearest displacement within reach, m.
    pub fn within_reach(&self, displacement: Vec3) -> Vec3 {
        let [least, greatest] = self.reach;
        Vec3::from_fn(|axis, _| displacement[axis].clamp(least[axis], greatest[axis]))
    }
}

/// What a tick asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Where the tool should be, m.
    pub reference: Vec3,
    /// What that means after a hold.
    pub recovery: Recovery,
    /// Height that takes the place of the reference's, in sessions whose third axis is only lifted, m.
    pub lift_m: Option<f64>,
}

/// The motion limiter of one tool.
#[derive(Clone, Copy, Debug)]
pub struct MotionLimiter {
    limits: MotionLimits,
    at: Vec3,
    reference: Option<Vec3>,
    /// How far the reference last moved in a tick, m.
    increment: Vec3,
    /// How far the return has come to speed, 0 to 1.
    rise: f64,
}

impl MotionLimiter {
    /// A tool at the image of the handle's home.
    pub fn new(limits: MotionLimits) -> Self {
        Self {
            limits,
            at: Vec3::zeros(),
            reference: None,
            increment: Vec3::zeros(),
            rise: 0.0,
        }
    }

    /// Where the tool stands, m.
    pub fn at(&self) -> Vec3 {
        self.at
    }

    /// The bounds.
    pub fn limits(&self) -> &MotionLimits {
        &self.limits
    }

    /// Other bounds from now on.
    pub fn limit(&mut self, limits: MotionLimits) {
        self.limits = limits;
    }

    /// Puts the tool somewhere, at rest; returns where, for what is out of reach is not to be had.
    pub fn put(&mut self, place: Vec3) -> Vec3 {
        self.at = self.limits.within_reach(place);
        self.forget_reference();
        self.increment = Vec3::zeros();
        self.at
    }

    /// The next reference is the first of its kind: what it differs by from the last is no motion. For one tick the
    /// tool goes on as it went.
    pub fn forget_reference(&mut self) {
        self.reference = None;
        self.rise = 0.0;
    }

    /// Where the tool goes in this tick, m. `gain`, 0 to 1, scales every step; at 0 the tool is held.
    pub fn step(&mut self, setpoint: Setpoint, gain: f64) -> Vec3 {
        let MotionLimits {
            tick_s, speed_m_s, ..
        } = self.limits;
        let reference = setpoint.reference;
        if gain <= 0.0 {
            // Held: whatever the reference does meanwhile is not made up for.
            self.put(self.at);
            return self.at;
        }
        if let Some(before) = self.reference.replace(reference) {
            self.increment = reference - before;
        }
        let mut next = self.at + self.increment * gain;
        if setpoint.recovery == Recovery::Absolute {
            self.rise = (self.rise + tick_s / RECOVERY_RISE_S).min(1.0);
            let most = RECOVERY_SPEED_M_S * tick_s * self.rise;
            next += capped((reference - next) * (RECOVERY_PER_S * tick_s), most) * gain;
        }
        if let Some(lift_m) = setpoint.lift_m {
            let most = LIFT_SPEED_M_S * tick_s * gain;
            next.z = self.at.z + (lift_m - self.at.z).clamp(-most, most);
        }
        next = self.at + capped(next - self.at, speed_m_s * tick_s);
        self.at = self.limits.within_reach(next);
        self.at
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TICK_S: f64 = 1e-3;

    fn limiter() -> MotionLimiter {
        MotionLimiter::new(MotionLimits {
            tick_s: TICK_S,
            reach: [Vec3::repeat(-0.1), Vec3::repeat(0.1)],
            speed_m_s: 2.0,
        })
    }

    fn to(reference: Vec3, recovery: Recovery) -> Setpoint {
        Setpoint {
            reference,
            recovery,
            lift_m: None,
        }
    }

    proptest! {
        /// Whatever is asked for, no tick moves the tool faster than the limit, nor out of reach.
        #[test]
        fn no_setpoint_moves_the_tool_too_fast_or_too_far(
            setpoints in prop::collection::vec((-1.0..1.0, -1.0..1.0, -1.0..1.0, 0.0..=1.0), 1..100),
            is_absolute in any::<bool>(),
        ) {
            let recovery = if is_absolute { Recovery::Absolute } else { Recovery::Incremental };
            let mut limiter = limiter();
            for (x, y, z, gain) in setpoints {
                let before = limiter.at();
                let after = limiter.step(to(Vec3::new(x, y, z), recovery), gain);
                prop_assert!((after - before).norm() <= 2.0 * TICK_S * (1.0 + 1e-12));
                prop_assert!(after.amax() <= 0.1);
            }
        }
    }

    #[test]
    fn what_was_asked_for_during_a_hold_is_not_made_up_for() {
        let mut limiter = limiter();
        limiter.step(to(Vec3::zeros(), Recovery::Incremental), 1.0);
        for k in 1..=100 {
            limiter.step(
                to(Vec3::x() * (1e-4 * f64::from(k)), Recovery::Incremental),
                0.0,
            );
        }
        let after = limiter.step(to(Vec3::x() * 0.03, Recovery::Incremental), 1.0);
        assert_eq!(
            after,
            Vec3::zeros(),
            "the first reference after a hold is where counting starts"
        );
        let after = limiter.step(to(Vec3::x() * 0.0301, Recovery::Incremental), 1.0);
        assert!((after - Vec3::x() * 1e-4).norm() < 1e-15);
    }

    #[test]
    fn an_absolute_reference_is_returned_to_slowly() {
        let mut limiter = limiter();
        let there = to(Vec3::x() * 0.01, Recovery::Absolute);
        limiter.step(there, 0.0);
        let (mut before, mut speed_before) = (limiter.at(), 0.0);
        let ticks = (1..2000).find(|_| {
            let after = limiter.step(there, 1.0);
            let speed = (after - before).norm() / TICK_S;
            assert!(speed <= RECOVERY_SPEED_M_S * (1.0 + 1e-9));
            assert!(
                (speed - speed_before).abs() < 1.1e-3,
                "a jerk: {speed_before} to {speed} m/s"
            );
            (before, speed_before) = (after, speed);
            (after - there.reference).norm() < 1e-4
        });
        // 10 mm at 0.05 m/s take 200 ticks; coming to speed and slowing down take their part.
        assert!((250..500).contains(&ticks.unwrap()), "{ticks:?} ticks");
    }
}
