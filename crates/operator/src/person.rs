//! The person at a handle: an arm that is carried along, and an intent that pushes.

use crate::intent::Intent;
use crate::{Axes, Vec3};

/// The lift of a two-axis handle moves no faster than this, m/s.
pub(crate) const LIFT_SPEED_M_S: f64 = 0.08;

/// What a person wants, and how far in time they are with it.
#[derive(Clone, Debug)]
pub(crate) struct Person {
    axes: Axes,
    tick_s: f64,
    intent: Intent,
    /// Of the arm itself, N/m and N s/m: what a person who moves on purpose has learnt to overcome.
    arm_stiffness_damping: (f64, f64),
    lift_m: f64,
    ticks: u64,
    rounds: u64,
}

impl Person {
    pub(crate) fn new(
        axes: Axes,
        tick_s: f64,
        intent: Intent,
        arm_stiffness_damping: (f64, f64),
    ) -> Self {
        Self {
            axes,
            tick_s,
            intent,
            arm_stiffness_damping,
            lift_m: 0.0,
            ticks: 0,
            rounds: 0,
        }
    }

    pub(crate) fn axes(&self) -> Axes {
        self.axes
    }

    /// Force of the muscles on a handle at `position` that moves at `velocity`, N.
    pub(crate) fn muscle_force_n(&self, position: Vec3, velocity: Vec3) -> Vec3 {
        let arm = self.arm_stiffness_damping;
        self.intent
            .muscle_force(self.time_s(), position, velocity, arm, self.axes)
    }

    /// Force at the sensor where the intent fixes it, whatever the arm does, N.
    pub(crate) fn sensor_force_n(&self) -> Option<Vec3> {
        self.intent.sensor_force_n(self.time_s())
    }

    /// Height at which the person holds the lift of a two-axis handle, m.
    pub(crate) fn lift_m(&self) -> f64 {
        self.lift_m
    }

    /// Lets one tick pass.
    pub(crate) fn pass_tick(&mut self) {
        let step = LIFT_SPEED_M_S * self.tick_s;
        self.lift_m += (self.intent.lift_m(self.time_s()) - self.lift_m).clamp(-step, step);
        self.ticks += 1;
        let round = self
            .intent
            .round_s()
            .map_or(0, |round_s| (self.time_s() / round_s) as u64);
        self.rounds = self.rounds.max(round);
    }

    pub(crate) fn finished_rounds(&self) -> u64 {
        self.rounds
    }

    pub(crate) fn intend(&mut self, intent: Intent) {
        self.intent = intent;
        self.ticks = 0;
        self.rounds = 0;
    }

    /// Time since the intent began, s.
    pub(crate) fn time_s(&self) -> f64 {
        self.ticks as f64 * self.tick_s
    }
}
