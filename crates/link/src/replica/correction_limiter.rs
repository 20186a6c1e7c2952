//! The correction limiter: how a correction of the copy may show in the hand.
//!
//! A correction changes the clay under the tool and with it, at the same pose and speed, the force. The limiter keeps
//! the difference and lets it go a step a tick, so that the felt force never jumps. While it is held, what is felt is
//! not what the copy says; where that difference pushes the hand along its own motion it would bring energy into the
//! hand that nobody put in. So it may do so only out of a tank, and the tank fills with what the hand has spent on
//! cutting. Where the tank is empty the energy counts more than the step: the force then shows the correction at once.
//!
//! In this clay a correction stores no energy by itself: viscous and plastic resistance store none, and the elastic
//! stretch is measured from where the clay last gave way, not from a wall that a correction could move under the tool.
//! A spring wall would need the penetration to be limited instead.

use crate::Vec3;
use crate::safety::capped;

/// Bounds of what a correction may do to the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrectionLimits {
    /// Greatest change of the force by a correction in one tick, N.
    pub step_n: f64,
    /// Most that the tank holds, J.
    pub tank_j: f64,
}

impl CorrectionLimits {
    /// For a device of this force range, N: a step of 2 % of it a tick, a third of what a hand can just tell; a tank of
    /// 50 mJ, what a centimetre of cutting at 5 N spends.
    pub fn for_range(force_n: f64) -> Self {
        Self {
            step_n: 0.02 * force_n,
            tank_j: 0.05,
        }
    }
}

/// The correction limiter of one tool.
#[derive(Clone, Copy, Debug)]
pub struct CorrectionLimiter {
    limits: CorrectionLimits,
    /// Felt force less the copy's, N.
    held: Vec3,
    tank_j: f64,
    injected_j: f64,
    earned_j: f64,
    step_n: f64,
    largest_step_n: f64,
    moved_n: f64,
    corrections: u32,
}

impl CorrectionLimiter {
    /// Nothing held, an empty tank.
    pub fn new(limits: CorrectionLimits) -> Self {
        Self {
            limits,
            held: Vec3::zeros(),
            tank_j: 0.0,
            injected_j: 0.0,
            earned_j: 0.0,
            step_n: 0.0,
            largest_step_n: 0.0,
            moved_n: 0.0,
            corrections: 0,
        }
    }

    /// A correction has changed the copy's force from `before` to `after`, N, at the same pose and speed.
    pub fn on_correction(&mut self, before: Vec3, after: Vec3) {
        if before != after {
            self.corrections = self.corrections.wrapping_add(1);
        }
        self.held += before - after;
    }

    /// The force to feel for one tick of `tick_s` when the copy gives `force` and the hand moves at `velocity`;
    /// energies in J.
    pub fn step(&mut self, force: Vec3, velocity: Vec3, tick_s: f64) -> Vec3 {
        let earned = (-force.dot(&velocity) * tick_s).max(0.0);
        self.earned_j += earned;
        self.tank_j = (self.tank_j + earned).min(self.limits.tank_j);

        let before = self.held;
        self.held -= capped(self.held, self.limits.step_n);
        let injected = self.held.dot(&velocity) * tick_s;
        if 0.0 < injected {
            if self.tank_j < injected {
                // Only the part along the motion brings energy; it shrinks to what the tank has.
                let along = velocity * (self.held.dot(&velocity) / velocity.norm_squared());
                self.held -= along * (1.0 - self.tank_j / injected);
            }
            let drawn = (self.held.dot(&velocity) * tick_s).clamp(0.0, self.tank_j);
            self.tank_j -= drawn;
            self.injected_j += drawn;
        }
        self.step_n = (self.held - before).norm();
        self.largest_step_n = self.largest_step_n.max(self.step_n);
        self.moved_n += self.step_n;
        force + self.held
    }

    /// By how much the last tick changed the felt force on account of corrections, N.
    pub fn step_n(&self) -> f64 {
        self.step_n
    }

    /// Most by which any tick changed the felt force on account of corrections, N.
    pub fn largest_step_n(&self) -> f64 {
        self.largest_step_n
    }

    /// How far corrections have moved the felt force, tick by tick and all told, N.
    pub fn moved_n(&self) -> f64 {
        self.moved_n
    }

    /// How many corrections changed the force; wraps.
    pub fn corrections(&self) -> u32 {
        self.corrections
    }

    /// Felt force less the copy's, N.
    pub fn held(&self) -> Vec3 {
        self.held
    }

    /// Energy that corrections have brought into the hand so far, J.
    pub fn injected_j(&self) -> f64 {
        self.injected_j
    }

    /// Energy in the tank, J.
    pub fn tank_j(&self) -> f64 {
        self.tank_j
    }

    /// Energy that the hand has spent on cutting so far, J.
    pub fn earned_j(&self) -> f64 {
        self.earned_j
    }
}

#[cfg(test)]
#[allow(
    clippy::float_cmp,
    reason = "zero and one are meant exactly: a ramp ends, a gain is full"
)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TICK_S: f64 = 1e-3;
    const LIMITS: CorrectionLimits = CorrectionLimits {
        step_n: 0.4,
        tank_j: 0.05,
    };

    #[test]
    fn without_corrections_the_copys_force_passes_unchanged() {
        let mut limiter = CorrectionLimiter::new(LIMITS);
        let force = Vec3::new(-1.0, 0.3, 0.0);
        assert_eq!(
            limiter.step(force, Vec3::new(0.04, 0.0, 0.0), TICK_S),
            force
        );
    }

    #[test]
    fn clay_that_vanishes_under_the_tool_fades_and_does_not_drop() {
        let mut limiter = CorrectionLimiter::new(LIMITS);
        let velocity = Vec3::new(0.04, 0.0, 0.0);
        let before = Vec3::new(-4.0, 0.0, 0.0);
        limiter.step(before, velocity, TICK_S);
        limiter.on_correction(before, Vec3::zeros());
        limiter.on_correction(Vec3::zeros(), Vec3::zeros());
        let mut felt = before;
        for _ in 0..10 {
            let next = limiter.step(Vec3::zeros(), velocity, TICK_S);
            assert!((next - felt).norm() <= LIMITS.step_n + 1e-12);
            felt = next;
        }
        assert!(felt.norm() < 1e-12);
        assert_eq!(
            limiter.corrections(),
            1,
            "one of the two changed nothing that is felt"
        );
        for _ in 0..10 {
            limiter.step(Vec3::zeros(), velocity, TICK_S);
        }
        assert_eq!(limiter.step_n(), 0.0);
        assert!((limiter.largest_step_n() - LIMITS.step_n).abs() < 1e-12);
        assert!((limiter.moved_n() - before.norm()).abs() < 1e-12);
        assert_eq!(
            limiter.injected_j(),
            0.0,
            "holding back a moving hand brings no energy"
        );
    }

    proptest! {
        /// Whatever corrections come and however the hand moves, the hand never gets more than the tank was given.
        #[test]
        fn injected_energy_never_exceeds_what_was_earned(
            ticks in prop::collection::vec((-8.0..8.0, -8.0..8.0, -0.5..0.5, -0.5..0.5, prop::bool::weighted(0.2)), 1..400)
        ) {
            let mut limiter = CorrectionLimiter::new(LIMITS);
            let (mut injected, mut earned) = (0.0, 0.0);
            for (fx, fy, vx, vy, corrects) in ticks {
                let (velocity, drag) = (Vec3::new(vx, vy, 0.0), -2.0 * Vec3::new(vx, vy, 0.0));
                if corrects {
                    limiter.on_correction(Vec3::new(fx, fy, 0.0), drag);
                }
                let felt = limiter.step(drag, velocity, TICK_S);
                earned += -drag.dot(&velocity) * TICK_S;
                injected += ((felt - drag).dot(&velocity) * TICK_S).max(0.0);
                prop_assert!(injected <= earned + 1e-9, "{injected} J of {earned} J");
            }
        }
    }
}
