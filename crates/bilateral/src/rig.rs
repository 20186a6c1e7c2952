//! The virtual-time rig: operator, handle side and session in one thread, as fast as the machine goes. Same seed, same bits.
//!
//! Order within a tick: the device is sampled, the handle side takes in what the line delivered and steps, the device gets its
//! command; then the session takes in what the line delivered and steps. So without delay the tool side knows the hand's force of the same tick, and the
//! handle side the clay's force at the present pose: both drive their admittance with the same net force.

use std::time::Duration;

use teleclay_clay::{Clay, Material, ToolShape};
use teleclay_link::time::Timestamp;
use teleclay_operator::{Axes, Intent, SimulatedHandle, SimulatedHandleError};
use teleclay_proto::frame::ToolFrame;
use teleclay_proto::join::LoopParameters;

use crate::handle_side::{HandleSide, HandleStep};
use crate::parameters::ParameterError;
use crate::session::{Lines, SessionLoop};
use crate::tool_side::ToolSide;

/// Lease of the rig's one operator.
const LEASE: u32 = 1;
/// Most frames that one tick can deliver to the handle.
const INBOX: usize = 8192;

/// What a run is made of.
pub struct Setup {
    /// The loop.
    pub parameters: LoopParameters,
    /// The block.
    pub clay: Clay,
    /// What it is made of.
    pub material: Material,
    /// The tool.
    pub tool: ToolShape,
    /// What the person does.
    pub intent: Intent,
    /// What the network does.
    pub lines: Lines,
}

/// Why a rig cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The loop.
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    /// The handle.
    #[error(transparent)]
    Handle(#[from] SimulatedHandleError),
}

/// One operator, one session, one line, on virtual time.
pub struct Rig {
    tick: Duration,
    now: Timestamp,
    device: SimulatedHandle,
    handle: HandleSide,
    session: SessionLoop,
    inbox: Vec<ToolFrame>,
    last: HandleStep,
}

impl Rig {
    /// Everything at rest at time zero.
    ///
    /// # Errors
    /// Parameters that make no loop.
    pub fn new(setup: Setup) -> Result<Self, RigError> {
        let axes = match setup.parameters.axes {
            teleclay_proto::Axes::Two => Axes::Two,
            teleclay_proto::Axes::Three => Axes::Three,
        };
        let mut session = SessionLoop::new(setup.clay, setup.material, 1, &setup.lines);
        session.seat(
            0,
            Box::new(ToolSide::new(&setup.parameters, LEASE, setup.tool)?),
        );
        let device = SimulatedHandle::new(axes, setup.parameters.tick_s, setup.intent)?;
        let tick = Duration::from_secs_f64(setup.parameters.tick_s);
        Ok(Self {
            tick,
            // A stamp of zero means "none" on the wire.
            now: Timestamp::ZERO.after(tick),
            device,
            handle: HandleSide::new(&setup.parameters, LEASE)?,
            session,
            inbox: Vec::with_capacity(INBOX),
            last: HandleStep {
                command_m: [0.0; 3],
                felt_force_n: [0.0; 3],
                contact: crate::Contact::NotYet,
            },
        })
    }

    /// One tick.
    pub fn tick(&mut self) {
        for frame in self.inbox.drain(..) {
            self.handle.on_frame(self.now, &frame);
        }
        self.last = self.handle.step(self.now, &self.device.sample());
        self.device.command(self.last.command_m);
        self.session
            .on_frame(self.now, 0, self.handle.frame().clone());
        let inbox = &mut self.inbox;
        self.session.step(self.now, |_, frame| inbox.push(*frame));
        self.now = self.now.after(self.tick);
    }

    /// Ticks until `span` has passed.
    pub fn run_for(&mut self, span: Duration) {
        let end = self.now.after(span);
        while self.now < end {
            self.tick();
        }
    }

    /// Virtual time.
    pub fn now(&self) -> Timestamp {
        self.now
    }

    /// What the last step gave the device.
    pub fn last(&self) -> &HandleStep {
        &self.last
    }

    /// The device.
    pub fn device(&self) -> &SimulatedHandle {
        &self.device
    }

    /// The device, to change its intent.
    pub fn device_mut(&mut self) -> &mut SimulatedHandle {
        &mut self.device
    }

    /// The handle side.
    pub fn handle(&self) -> &HandleSide {
        &self.handle
    }

    /// The session.
    pub fn session(&self) -> &SessionLoop {
        &self.session
    }

    /// The session, to change its network, material or clay.
    pub fn session_mut(&mut self) -> &mut SessionLoop {
        &mut self.session
    }

    /// The tool side.
    pub fn tool(&self) -> &ToolSide {
        self.session
            .side(0)
            .expect("the rig never vacates its one place")
    }
}
