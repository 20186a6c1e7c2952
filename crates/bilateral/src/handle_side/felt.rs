//! What the hand feels in a tick, and where the device is sent.

use teleclay_link::Vec3;
use teleclay_link::safety::capped;
use teleclay_link::scheme::HandlePort;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::LoopStatus;

use super::{BLEND_S, HandleSide, HandleStep, LinkState};

/// A copy that is stale fades out of the hand within this time, s: clay that nobody has confirmed is not pressed on a
/// person for long, and a hand is not dropped from it.
const STALE_FADE_S: f64 = 1.0;

impl HandleSide {
    pub(super) fn felt_force(&mut self, now: Timestamp, port: &HandlePort) -> Vec3 {
        let tick_s = self.model.tick_s();
        let change = tick_s / self.model.setup().ramp_s;
        let watchdog_gain = self.watchdog.step(now, tick_s);
        let needs_frames = self.controller.needs_frames();
        if needs_frames != std::mem::replace(&mut self.needed_frames, needs_frames) {
            // A copy came or went: what the controller gives from now on is of another kind.
            self.blend_starts = true;
        }
        self.remote_gain = if needs_frames {
            watchdog_gain.max(self.remote_gain - change)
        } else {
            (self.remote_gain + change).min(1.0)
        };
        let works = matches!(self.status, LoopStatus::Running | LoopStatus::Idle)
            && self.fault.is_none()
            && self.gone_since.is_none();
        self.status_gain =
            (self.status_gain + if works { change } else { -change }).clamp(0.0, 1.0);

        let fresh = self.controller.reaction(now, port);
        if std::mem::take(&mut self.blend_starts) {
            self.fading = self.last_reaction;
            self.fading_share = 1.0;
        }
        let reaction = fresh + (self.fading - fresh) * self.fading_share;
        self.fading_share -= self.fading_share * (tick_s / BLEND_S);
        self.last_reaction = reaction;
        let is_stale = self.link_state(now) == LinkState::OnStaleCopy;
        let stale_change = if is_stale {
            -tick_s / STALE_FADE_S
        } else {
            change
        };
        self.stale_gain = (self.stale_gain + stale_change).clamp(0.0, 1.0);
        let gain = self.remote_gain * self.status_gain * self.stale_gain;
        // Capped before the ramp: a wish beyond the bound would hold the force at the bound for a part of the ramp, and
        // let go of the hand later than it ends.
        let mut wanted = if gain < 1.0 {
            capped(reaction, self.model.limits.force_n) * gain
        } else {
            reaction
        };
        if self.fault.is_some() {
            wanted = Vec3::zeros();
        }
        for axis in self.model.axes..3 {
            wanted[axis] = 0.0;
        }
        self.limiter.step(wanted, tick_s)
    }

    pub(super) fn command(&mut self, port: &HandlePort, felt: Vec3) -> Vec3 {
        let origin = *self.origin.get_or_insert(port.position);
        let net = port.hand_force + felt;
        let mut command = port.position;
        for axis in 0..self.model.axes {
            let [least, greatest] = self.model.handle_travel(axis);
            let system = &self.model.coupling().admittance;
            let next = origin[axis] + system.output(&self.admittance[axis], net[axis]);
            // At the end of the travel nothing pushes further out: the admittance coasts to a stop against its own
            // damping.
            let pushes_out =
                (greatest < next && 0.0 < net[axis]) || (next < least && net[axis] < 0.0);
            let net = if pushes_out { 0.0 } else { net[axis] };
            let next = origin[axis] + system.step(&mut self.admittance[axis], net);
            command[axis] = next.clamp(least, greatest);
        }
        command
    }

    /// A step without a usable sample: the command stays, the force goes.
    pub(super) fn hold(&mut self) -> HandleStep {
        let felt = self.limiter.step(Vec3::zeros(), self.model.tick_s());
        self.frame.header.sequence = self.frame.header.sequence.wrapping_add(1);
        self.is_due = true;
        HandleStep {
            command_m: self.frame.position_m,
            felt_force_n: felt.into(),
            link_state: LinkState::Fault,
        }
    }
}
