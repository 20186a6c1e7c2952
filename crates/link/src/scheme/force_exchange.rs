//! Force exchange, the paper's own coupling. Source: [KHMH03] (21)–(22), (30)–(32) in docs/papers.md.
//!
//! ```text
//! v_h =  C_h1 f_h - C_t1 f_t           C_t1 = C_h1 / A_h2                          (30), S_h = 0
//! v_t = -C_h2 f_h + C_t2 f_t           C_h2 = -G_t^-1 A_h1 G_h C_h1                (31), S_h = 0
//!                                      C_t2 = -G_t^-1 A_h1 A_h2^-1 G_h C_h1        (32), S_h = S_t = 0
//! ```
//!
//! so both sides drive one admittance `P = G_h C_h1` with the same net force, each with its own force fresh and the
//! other's as last received: `y_h = P (f_h - f_t / A_h2)` and `y_t = A_h1 P (f_h - f_t / A_h2)`.
//!
//! Assumes identified plants on both sides and no force path around the commands (`S_h = S_t = 0`: lead screws that
//! cannot be driven back). Cannot hold the two positions together: only forces travel, so whatever is late, lost or
//! doubled stays in the difference of the two integrals for good.

use teleclay_control::State;
use teleclay_proto::frame::{HandleFrame, ToolFrame};

use super::{Coupling, HandleController, HandlePort, ToolController, ToolPort};
use crate::Vec3;
use crate::deadband::Signal;
use crate::motion_limiter::Recovery;
use crate::time::Timestamp;

/// The handle's controller: what it feels is the clay's force as last received.
#[derive(Clone, Debug)]
pub struct ForceExchangeHandle {
    coupling: Coupling,
    clay_force: Vec3,
}

impl ForceExchangeHandle {
    /// At rest: no force received yet.
    pub fn new(coupling: Coupling) -> Self {
        Self {
            coupling,
            clay_force: Vec3::zeros(),
        }
    }
}

impl HandleController for ForceExchangeHandle {
    fn on_frame(&mut self, _now: Timestamp, frame: &ToolFrame) {
        self.clay_force = Vec3::from(frame.force_n);
    }

    fn reaction(&mut self, _now: Timestamp, _port: &HandlePort) -> Vec3 {
        self.coupling.felt(self.clay_force)
    }

    fn fill(&mut self, _frame: &mut HandleFrame) {}

    fn signal(&self, frame: &HandleFrame) -> Option<Signal> {
        Some(Signal::force(Vec3::from(frame.hand_force_n)))
    }
}

/// The tool's controller: a model of the handle's admittance, driven by the hand's force as last received and the
/// clay's own.
#[derive(Clone, Debug)]
pub struct ForceExchangeTool {
    coupling: Coupling,
    hand_force: Vec3,
    origin: Vec3,
    admittance: [State; 3],
    servo: [State; 3],
}

impl ForceExchangeTool {
    /// At rest with the handle at home.
    pub fn new(coupling: Coupling) -> Self {
        Self {
            coupling,
            hand_force: Vec3::zeros(),
            origin: Vec3::zeros(),
            admittance: [State::default(); 3],
            servo: [State::default(); 3],
        }
    }
}

impl ToolController for ForceExchangeTool {
    fn on_frame(&mut self, _now: Timestamp, frame: &HandleFrame) {
        self.hand_force = Vec3::from(frame.hand_force_n);
    }

    fn reference(&mut self, _now: Timestamp, port: &ToolPort, remote_gain: f64) -> Vec3 {
        let net = self.hand_force * remote_gain + self.coupling.felt(port.clay_force);
        let handle = Vec3::from_fn(|axis, _| {
            let command = self
                .coupling
                .admittance
                .step(&mut self.admittance[axis], net[axis]);
            self.coupling.servo[axis].advance(&mut self.servo[axis], command);
            self.coupling.servo[axis].output(&self.servo[axis], 0.0)
        });
        (self.origin + handle) * self.coupling.position_ratio
    }

    fn reindex(&mut self, handle_position: Vec3) {
        self.origin = handle_position;
        self.admittance = [State::default(); 3];
        self.servo = [State::default(); 3];
    }

    fn recovery(&self) -> Recovery {
        Recovery::Incremental
    }

    fn fill(&mut self, _frame: &mut ToolFrame) {}

    fn signal(&self, frame: &ToolFrame) -> Option<Signal> {
        Some(Signal::force(Vec3::from(frame.force_n)))
    }
}
