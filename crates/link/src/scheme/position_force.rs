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
//! With perceptual coding the handle sends a frame only when its velocity has changed by more than a hand can tell, and the tool's end bridges what is
//! left out.
//!
//! It creates energy as soon as there is delay, and has nothing to notice that with. It shows why the other schemes exist.

use std::time::Duration;

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

    /// The tool goes on at the speed it was told last, see [`Bridge`].
    fn signal(&self, frame: &HandleFrame) -> Option<Signal> {
        Some(Signal::velocity(Vec3::from(frame.velocity_m_s)))
    }
}

/// The tool's end: the reference is the image of the handle as last received.
#[derive(Clone, Copy, Debug)]
pub struct PositionForceTool {
    position_ratio: f64,
    tick_s: f64,
    handle_position: Vec3,
    bridge: Option<Bridge>,
}

impl PositionForceTool {
    /// At rest with the handle at home.
    pub fn new(coupling: &Coupling) -> Self {
        Self {
            position_ratio: coupling.position_ratio,
            tick_s: coupling.tick_s,
            handle_position: Vec3::zeros(),
            bridge: None,
        }
    }
}

impl ToolEnd for PositionForceTool {
    fn on_frame(&mut self, _now: Timestamp, frame: &HandleFrame) {
        self.handle_position = Vec3::from(frame.position_m);
        if let Some(bridge) = &mut self.bridge {
            bridge.told = self.handle_position;
            bridge.velocity = Vec3::from(frame.velocity_m_s);
            bridge.age_s = 0.0;
        }
    }

    fn expect_gaps(&mut self, longest: Option<Duration>) {
        self.bridge = longest.map(|longest| Bridge {
            gap_s: longest.as_secs_f64().max(self.tick_s),
            ..Bridge::at(self.handle_position)
        });
    }

    fn reference(&mut self, _now: Timestamp, _port: &ToolPort, _remote_gain: f64) -> Vec3 {
        if let Some(bridge) = &mut self.bridge {
            self.handle_position = bridge.step(self.tick_s);
        }
        self.handle_position * self.position_ratio
    }

    fn reindex(&mut self, handle_position: Vec3) {
        self.handle_position = handle_position;
        if let Some(bridge) = &mut self.bridge {
            *bridge = Bridge {
                gap_s: bridge.gap_s,
                ..Bridge::at(handle_position)
            };
        }
    }

    fn recovery(&self) -> Recovery {
        Recovery::Absolute
    }

    fn fill(&mut self, _frame: &mut ToolFrame) {}

    fn signal(&self, frame: &ToolFrame) -> Option<Signal> {
        Some(Signal::force(Vec3::from(frame.force_n)))
    }
}

/// The handle's way while its frames are left out. It goes on at the velocity told last, which is within the band of the true one. Where the next
/// frame says otherwise, the difference is made up over one gap: a jump of position would be a blow of force, for the clay answers velocity.
#[derive(Clone, Copy, Debug)]
struct Bridge {
    /// The longest that frames are left out, s.
    gap_s: f64,
    told: Vec3,
    velocity: Vec3,
    /// Of what was told, s.
    age_s: f64,
    at: Vec3,
}

impl Bridge {
    /// At rest.
    fn at(position: Vec3) -> Self {
        Self {
            gap_s: 0.0,
            told: position,
            velocity: Vec3::zeros(),
            age_s: 0.0,
            at: position,
        }
    }

    /// Where the handle is taken to be in this tick.
    fn step(&mut self, tick_s: f64) -> Vec3 {
        // A frame that was sent and lost is one more gap, and further than that nothing is known.
        let goes_on = self.age_s < 2.0 * self.gap_s;
        if goes_on {
            self.at += self.velocity * tick_s;
        }
        let foreseen = self.told + self.velocity * self.age_s;
        self.at += (foreseen - self.at) * (tick_s / self.gap_s);
        if goes_on {
            self.age_s += tick_s;
        }
        self.at
    }
}
