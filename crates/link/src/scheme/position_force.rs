//! Position forward, force back: the tool goes where the handle is, the hand feels what the tool feels.
//!
//! ```text
//! y_t(t) = A_h1 y_h(t - D1)                felt(t) = f_t(t - D2) / |A_h2|
//! ```
//!
//! The classical baseline. It assumes that the tool follows any position at once, and a line without delay: then the hand feels the clay
//! exactly. With a round trip `d` the loop is `1 + P (T_h + rho T_t exp(-s d)) = 0`, which dies at a delay that `teleclay_control`
//! gives exactly. In samples the hold of the handle's command and the velocity as a difference each add half a tick to `d`, and the clay's
//! answer to the motion of a tick is felt in the next: one tick more. So what the line itself may take is the margin less two ticks, for clay
//! that answers position instead of velocity less one and a half.
//!
//! It creates energy as soon as there is delay, and has nothing to notice that with. It shows why the other schemes exist.

use teleclay_proto::frame::{HandleFrame, ToolFrame};

use super::{Coupling, HandleEnd, HandlePort, ToolEnd, ToolPort};
use crate::Vec3;
use crate::deadband::Signal;
use crate::time::Timestamp;
use crate::travel::Recovery;

/// The handle's end: what it feels is the clay's force as last received.
#[derive(Clone, Debug)]
pub struct PositionForceHandle {
    coupling: Coupling,
    clay_force: Vec3,
}

impl PositionForceHandle {
    /// At rest: no force received yet.
    pub fn new(coupling: Coupling) -> Self {
        Self {
            coupling,
            clay_force: Vec3::zeros(),
        }
    }
}

impl HandleEnd for PositionForceHandle {
    fn on_frame(&mut self, _now: Timestamp, frame: &ToolFrame) {
        self.clay_force = Vec3::from(frame.force_n);
    }

    fn reaction(&mut self, _now: Timestamp, _port: &HandlePort) -> Vec3 {
        self.coupling.felt(self.clay_force)
    }

    fn fill(&mut self, _frame: &mut HandleFrame) {}

    /// The tool makes a velocity of differences of the positions it gets: a gap would be a jump.
    fn signal(&self, _frame: &HandleFrame) -> Option<Signal> {
        None
    }
}

/// The tool's end: the reference is the image of the handle as last received.
#[derive(Clone, Copy, Debug)]
pub struct PositionForceTool {
    position_ratio: f64,
    handle_position: Vec3,
}

impl PositionForceTool {
    /// At rest with the handle at home.
    pub fn new(coupling: &Coupling) -> Self {
        Self {
            position_ratio: coupling.position_ratio,
            handle_position: Vec3::zeros(),
        }
    }
}

impl ToolEnd for PositionForceTool {
    fn on_frame(&mut self, _now: Timestamp, frame: &HandleFrame) {
        self.handle_position = Vec3::from(frame.position_m);
    }

    fn reference(&mut self, _now: Timestamp, _port: &ToolPort, _remote_gain: f64) -> Vec3 {
        self.handle_position * self.position_ratio
    }

    fn reindex(&mut self, handle_position: Vec3) {
        self.handle_position = handle_position;
    }

    fn recovery(&self) -> Recovery {
        Recovery::Absolute
    }

    fn fill(&mut self, _frame: &mut ToolFrame) {}

    fn signal(&self, frame: &ToolFrame) -> Option<Signal> {
        Some(Signal::force(Vec3::from(frame.force_n)))
    }
}
