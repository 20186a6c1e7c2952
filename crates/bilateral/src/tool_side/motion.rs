//! Where the tool goes in a tick, and what it does to the clay.

use teleclay_clay::{Clay, ContactState, Material, Motion, Operation, Pose};
use teleclay_control::State;
use teleclay_link::Vec3;
use teleclay_link::motion_limiter::Setpoint;
use teleclay_link::replica::{CorrectionLimiter, Cut};
use teleclay_link::safety::{Flaw, Implausible};
use teleclay_link::scheme::ToolPort;
use teleclay_link::scheme::replica::Merged;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::Engagement;

use super::{Permission, ToolSide, ToolStep};

impl ToolSide {
    /// Puts the tool where the handle is, at rest, without cutting on the way; for a fresh block, and for the first
    /// frame.
    pub fn reindex(&mut self) {
        let handle = self.handle.position();
        self.controller.reindex(handle);
        let place = self
            .motion_limiter
            .put(handle * self.model.coupling().position_ratio);
        self.base = place;
        self.position = place;
        self.track.forget();
        self.velocity = Vec3::zeros();
        self.was_led = false;
        self.inverse = [State::default(); 3];
        self.plant = [State::default(); 3];
        self.contact = ContactState::default();
        self.clay_force = Vec3::zeros();
        self.limiter = CorrectionLimiter::new(self.model.correction_limits());
        self.is_in_exchanged_clay = false;
    }

    /// The port after the last displacement and the clay's answer to it.
    pub(super) fn port(&self) -> ToolPort {
        ToolPort {
            position: self.position,
            velocity: self.model.reflected(self.velocity),
            clay_force: self.model.reflected(self.clay_force),
            spring_force: self.model.reflected(self.contact.force_n().into()),
            displacement: self.model.reflected(self.velocity * self.model.tick_s()),
        }
    }

    /// Gain of the motion limiter, 0 to 1: at 0 the tool is held, at 1 it follows.
    pub(super) fn gain(&mut self, now: Timestamp, permission: Permission) -> f64 {
        let tick_s = self.model.tick_s();
        let change = tick_s / self.model.setup().ramp_s;
        let may_work = permission == Permission::Work
            && self.fault.is_none()
            && self.engagement == Engagement::Engaged;
        self.permission_gain =
            (self.permission_gain + if may_work { change } else { -change }).clamp(0.0, 1.0);
        self.watchdog.step(now, tick_s) * self.permission_gain
    }

    /// Where the tool may go in this tick.
    pub(super) fn limited_motion(&mut self, now: Timestamp, port: &ToolPort, gain: f64) -> Vec3 {
        let ratio = self.model.coupling().position_ratio;
        let setpoint = Setpoint {
            reference: self.controller.reference(now, port, gain),
            recovery: self.controller.recovery(),
            lift_m: self.model.setup().is_lifted.then_some(self.lift * ratio),
        };
        self.motion_limiter.step(setpoint, gain)
    }

    /// The handle's sweeps lead: the tool is where they put it.
    pub(super) fn adopt(&mut self, merged: &Merged) -> ToolStep {
        self.was_led = true;
        self.position = merged.displacement;
        self.velocity = merged.velocity;
        self.clay_force = merged.force;
        if merged.newest.is_some() {
            let felt = self
                .model
                .coupling()
                .felt(self.model.reflected(merged.force));
            self.handle.answers(felt);
        }
        ToolStep {
            moved_units: merged.removed_units,
            engaged_area_m2: merged.engaged_area_m2,
        }
    }

    /// From here on the tool moves by itself again, from where it stands.
    pub(super) fn stop_being_led(&mut self) {
        if !std::mem::take(&mut self.was_led) {
            return;
        }
        self.base = self.motion_limiter.put(self.position);
        self.position = self.base;
        self.velocity = Vec3::zeros();
        self.inverse = [State::default(); 3];
        self.plant = [State::default(); 3];
        self.handle.hides_nothing();
        self.controller.reindex(self.handle.position());
    }

    /// Drives the tool's plant to `wanted` by way of its inverse: the `G_t^-1` of [KHMH03] (31) and (32).
    pub(super) fn follow(&mut self, wanted: Vec3) {
        let inverse = &self.model.tool_inverse;
        for axis in 0..self.model.axes {
            let command = inverse.step(&mut self.inverse[axis], wanted[axis] - self.base[axis]);
            inverse.plant().advance(&mut self.plant[axis], command);
            self.position[axis] = self.base[axis] + inverse.plant().output(&self.plant[axis], 0.0);
        }
        if self.model.axes < 3 {
            self.position.z = wanted.z;
        }
    }

    /// The clay's answer, and on top of it what the answer of clay that was exchanged is still held back by.
    fn limited_force(&mut self, answer: Vec3) -> Vec3 {
        if std::mem::take(&mut self.is_in_exchanged_clay) {
            // What the old clay answered a tick ago stands for what it would answer now.
            let before = self.model.reflected(self.clay_force - self.limiter.held());
            self.limiter
                .on_correction(before, self.model.reflected(answer));
        }
        let velocity = self.model.reflected(self.velocity);
        let limited = self.limiter.step(answer, velocity, self.model.tick_s());
        // Nothing is added to most answers, not even a zero.
        if self.limiter.held() == Vec3::zeros() {
            answer
        } else {
            limited
        }
    }

    pub(super) fn work(
        &mut self,
        before: Vec3,
        clay: &mut Clay,
        material: &Material,
        operation: Operation,
    ) -> ToolStep {
        let pose =
            |displacement: Vec3| Pose::quantise((self.model.setup().home + displacement).into());
        let motion = pose(before).and_then(|from| Ok((from, pose(self.position)?)));
        let motion = motion
            .ok()
            .and_then(|(from, to)| Motion::new(from, to, self.velocity.into()).ok());
        // Reach and speed limit keep every motion within bounds; one that is not would be a plant that ran away.
        let Some(motion) = motion else {
            self.fault = Some(Implausible {
                field: "tool position_m",
                flaw: Flaw::TooLarge,
            });
            return ToolStep::default();
        };
        let worked = clay.work_as(
            operation,
            &self.model.setup().tool,
            material,
            &motion,
            &mut self.contact,
        );
        self.clay_force = self.limited_force(worked.response.force_n.into());
        if motion.from() != motion.to() || 0 < worked.moved_units {
            self.cuts.push(Cut {
                from: motion.from(),
                to: motion.to(),
            });
        }
        ToolStep {
            moved_units: worked.moved_units,
            engaged_area_m2: worked.response.engaged_area_m2,
        }
    }
}
