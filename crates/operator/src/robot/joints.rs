//! Three joints with servos: what they are asked, what they can, and how the arms move under it.
//!
//! ```text
//! I rho_ddot = tau + J^T f          f = f_0 - m X_ddot          X_ddot = J rho_ddot + (the rest of (13), differentiated)
//! ```
//!
//! `I` is what turns with a joint, `f` the hand's force on the platform, `m` the arm's mass behind it. A servo knows
//! where its joint should be one tick later; it asks for the torque that brings it there against the hand's pull,
//! `-J^T f`, and gets what its limit leaves. Speed is bounded in all joints alike, so that a handle that cannot keep up
//! still moves the right way.

use nalgebra::Matrix3;
use teleclay_kinematics::{Assembly, Posture};

use super::ServoLimits;
use super::fence::{Fence, clearance};
use crate::Vec3;

/// The arms rest on their stops at this share of the fence's clearance.
const STOPS: f64 = 0.5;

/// The hand on the platform during a tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grip {
    /// Its force while the platform does not accelerate, N.
    pub(super) force: Vec3,
    /// What it adds to the platform's mass, kg.
    pub(super) mass_kg: f64,
}

/// Where the joints are and what moved them there.
#[derive(Clone, Debug)]
pub(super) struct Joints {
    pub(super) posture: Posture,
    assembly: Assembly,
    pub(super) rates: Vec3,
    /// In the last tick.
    pub(super) torques: Vec3,
    /// Platform, in the last tick, m/s².
    pub(super) acceleration: Vec3,
    /// Where the servos were sent.
    sent_to: Vec3,
    pub(super) is_slowed: bool,
    pub(super) is_overpowered: bool,
    pub(super) is_stopped: bool,
}

impl Joints {
    /// At rest in a posture of the given assembly.
    pub(super) fn at_rest(posture: Posture, assembly: Assembly) -> Self {
        Self {
            posture,
            assembly,
            rates: Vec3::zeros(),
            torques: Vec3::zeros(),
            acceleration: Vec3::zeros(),
            sent_to: posture.joints_rad(),
            is_slowed: false,
            is_overpowered: false,
            is_stopped: false,
        }
    }

    /// One tick towards joint angles `target`.
    pub(super) fn step(
        &mut self,
        target: Vec3,
        grip: &Grip,
        limits: &ServoLimits,
        fence: &Fence,
        tick_s: f64,
    ) {
        let angles = self.posture.joints_rad();
        let wanted = self.wanted_rates(angles, target, limits, tick_s);
        let fastest = wanted.amax();
        self.is_slowed = limits.speed_rad_s < fastest;
        let asked = if self.is_slowed {
            wanted * (limits.speed_rad_s / fastest)
        } else {
            wanted
        };
        self.sent_to = target;

        let jacobian = self
            .posture
            .jacobian()
            .expect("the stops keep the posture regular");
        let drift = self
            .posture
            .acceleration_m_s2(&self.rates, &Vec3::zeros())
            .expect("rates are finite and the posture regular");
        // Inertia as the joints see it, and the hand's pull on them at rest.
        let inertia = Matrix3::identity() * limits.inertia_kg_m2
            + jacobian.transpose() * jacobian * grip.mass_kg;
        let pull = jacobian.tr_mul(&(grip.force - drift * grip.mass_kg));

        let mut turning = (asked - self.rates) / tick_s;
        let needed = inertia * turning - pull;
        let limit = limits.torque_n_m;
        self.torques = needed.map(|torque| torque.clamp(-limit, limit));
        self.is_overpowered = self.torques != needed;
        if self.is_overpowered {
            let inverse = inertia
                .try_inverse()
                .expect("an inertia is positive definite");
            turning = inverse * (self.torques + pull);
        }
        let before = self.rates;
        self.settle(angles, before + turning * tick_s, limits, fence, tick_s);
        self.acceleration = jacobian * ((self.rates - before) / tick_s) + drift;
    }

    /// The rates that lead to the target, slow enough to stop there.
    fn wanted_rates(&self, angles: Vec3, target: Vec3, limits: &ServoLimits, tick_s: f64) -> Vec3 {
        Vec3::from_fn(|j, _| {
            let following = turn(self.sent_to[j], target[j]) / tick_s;
            let behind = turn(angles[j], self.sent_to[j]);
            let stopping = (2.0 * limits.braking_rad_s2 * behind.abs()).sqrt();
            following + (behind / tick_s).clamp(-stopping, stopping)
        })
    }

    /// Takes the next posture. A brake on each joint holds what a servo cannot: no joint turns faster than it may, and
    /// beyond the fence, where only a hand stronger than the servos leads, ever slower, until the arms rest on their
    /// stops.
    fn settle(
        &mut self,
        angles: Vec3,
        rates: Vec3,
        limits: &ServoLimits,
        fence: &Fence,
        tick_s: f64,
    ) {
        let here = clearance(&self.posture);
        let stop = STOPS * fence.clearance;
        let next = |rates: Vec3| {
            let angles = angles + rates * tick_s;
            let posture = fence.geometry.posture_of(&angles, self.assembly).ok()?;
            let clear = clearance(&posture);
            Some((posture, clear, rates))
        };
        let braked = |speed: f64| rates.map(|rate| rate.clamp(-speed, speed));
        let mut taken = next(braked(limits.speed_rad_s));
        if here < fence.clearance && taken.as_ref().is_none_or(|(_, clear, _)| *clear < here) {
            let room = ((here - stop) / (fence.clearance - stop)).max(0.0);
            taken = next(braked(limits.speed_rad_s * room));
        }
        let taken = taken.filter(|(_, clear, _)| stop <= *clear);
        self.is_stopped = taken.is_none();
        self.rates = Vec3::zeros();
        if let Some((posture, _, rates)) = taken {
            (self.posture, self.rates) = (posture, rates);
        }
    }
}

/// From one angle to another the short way round, rad.
fn turn(from: f64, to: f64) -> f64 {
    let full = std::f64::consts::TAU;
    let turn = to - from;
    turn - full * (turn / full).round()
}
