//! The virtual-time rig: operators, handle sides and session in one thread, as fast as the machine goes. Same seed,
//! same bits.
//!
//! Order within a tick, for each operator in turn: the device is sampled, the handle side takes in what the line
//! delivered and steps, the device gets its command; then the session takes in what the lines delivered and steps. So
//! without delay the tool side knows the hand's force of the same tick, and the handle side the clay's force at the
//! present pose: both drive their admittance with the same net force.
//!
//! Snapshots of the clay travel beside the lines, as on a stream that repeats what is lost: asked for at a delay up,
//! taken from the clay then, there after a delay down.

mod ear;
mod halt;
mod hand;
mod own;
mod snapshots;

use std::sync::Arc;
use std::time::Duration;

use teleclay_bilateral::{HandleSide, HandleStep, Lease, ParameterError, ToolSide};
use teleclay_clay::Clay;
use teleclay_device::DeviceSample;
use teleclay_link::conditioner::{Conditioner, Impairment, Stall};
use teleclay_link::deadband::{DeadbandError, DeadbandSettings};
use teleclay_link::scheme::{ClayCopy, Controllers};
use teleclay_link::time::Timestamp;
use teleclay_operator::{Axes, Intent, SimulatedHandle, SimulatedHandleError};
use teleclay_proto::frame::{HandleFrame, ToolFrame};
use teleclay_proto::http::{NewSession, SessionPatch};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Scheme, SessionId};
use teleclay_session::{
    Command, Event, Lines, Operator, Prepared, Refusal, Rules, Session, SessionSetup, Settings,
};

pub use ear::Ear;
pub use halt::Halt;
use halt::{Halted, noticed_since};
use hand::{Clock, Hand};
use own::{OwnScheme, controllers};

/// Most frames that one tick can deliver to a handle.
const INBOX: usize = 8192;

/// What a run is made of.
pub struct Setup {
    /// The loop, the tool, and what the clay resists with.
    pub parameters: LoopParameters,
    /// The block.
    pub clay: Clay,
    /// What the person does.
    pub intent: Intent,
    /// What the network does.
    pub lines: Lines,
}

/// A further operator in the same clay, with a tool and lines of the same kind.
pub struct Further {
    /// Where this one's home maps to, m.
    pub home_m: [f64; 3],
    /// What this one does.
    pub intent: Intent,
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
    /// The session.
    #[error(transparent)]
    Session(#[from] Refusal),
}

/// What went out, counted where it left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Number of frames.
    pub frames: u64,
    /// Their bytes, without what transports add.
    pub bytes: u64,
}

/// Operators, one session, a line to each, on virtual time.
pub struct Rig {
    tick: Duration,
    axes: Axes,
    now: Timestamp,
    hands: Vec<Hand>,
    session: Session,
    lines: Lines,
    /// The block as it was at first.
    block: Clay,
    /// The session's program stands still, and what waits outside of it.
    halt: Option<Halted>,
    outside: Vec<(usize, HandleFrame)>,
    /// What has come to it in this tick.
    came_up: Vec<(usize, HandleFrame)>,
    /// What the session told in this tick.
    events: Vec<Event>,
    /// What stands between the lines and the programs, once a test asks for it.
    wires: Vec<Wires>,
    ear: Option<Box<dyn Ear>>,
    own: Option<OwnScheme>,
}

/// A direction each of a network that only stalls, with room for all that a test holds back.
struct Wires {
    up: Conditioner<HandleFrame>,
    down: Conditioner<ToolFrame>,
}

impl Wires {
    const ROOM: usize = 1 << 15;

    fn new() -> Self {
        Self {
            up: Conditioner::new(Impairment::default(), 0, Self::ROOM),
            down: Conditioner::new(Impairment::default(), 0, Self::ROOM),
        }
    }
}

impl Rig {
    /// One operator, everything at rest at time zero.
    ///
    /// # Errors
    /// Parameters that make no loop.
    pub fn new(setup: Setup) -> Result<Self, RigError> {
        Self::with_further(setup, Vec::new())
    }

    /// Several operators in one clay.
    ///
    /// # Errors
    /// Parameters that make no loop.
    pub fn with_further(setup: Setup, further: Vec<Further>) -> Result<Self, RigError> {
        Self::assemble(setup, further, None)
    }

    /// Several operators in one clay, under a scheme that was made elsewhere. On virtual time nobody reads a scheme's
    /// word: the frames go under that of the setup's parameters, until the rig changes to another scheme.
    ///
    /// # Errors
    /// Parameters that make no loop.
    pub fn with_controllers(
        setup: Setup,
        further: Vec<Further>,
        controllers: Arc<dyn Controllers>,
    ) -> Result<Self, RigError> {
        Self::assemble(setup, further, Some(controllers))
    }

    fn assemble(
        setup: Setup,
        further: Vec<Further>,
        own: Option<Arc<dyn Controllers>>,
    ) -> Result<Self, RigError> {
        let Setup {
            parameters,
            clay,
            intent,
            lines,
        } = setup;
        let others = further.into_iter().map(|further| {
            let parameters = LoopParameters {
                home_m: further.home_m,
                ..parameters
            };
            (parameters, further.intent)
        });
        let operators: Vec<_> = std::iter::once((parameters, intent))
            .chain(others)
            .collect();
        // A stamp of zero means "none" on the wire.
        let now = Timestamp::ZERO.after(Duration::from_secs_f64(parameters.tick_s));
        let mut session = Session::new(SessionSetup {
            settings: settings(&parameters, operators.len()),
            lines,
            clay: clay.clone(),
            rules: Rules::default(),
            first_lease: 1,
            ownership_epoch: 1,
        });
        let own = own.map(|controllers| OwnScheme {
            goes_under: parameters.scheme,
            controllers,
        });
        let mut hands = Vec::with_capacity(operators.len());
        for (number, (parameters, intent)) in operators.into_iter().enumerate() {
            let operator = operator(number);
            let controllers = controllers(own.as_ref(), &parameters.scheme);
            let side = ToolSide::with_controllers(&parameters, 0, controllers)?;
            let outcome =
                session.handle_command(now, &mut Prepared::join(&operator, side, None))?;
            let lease = Lease {
                number: outcome.granted.expect(ATTACHED).lease,
                ownership_epoch: session.ownership_epoch(),
            };
            let parameters = LoopParameters {
                revision: outcome.revision as u32,
                ..parameters
            };
            let handle = HandleSide::with_controllers(&parameters, lease, controllers)?;
            hands.push(Hand::new(&parameters, intent, handle, &clay)?);
        }
        let tick = Duration::from_secs_f64(parameters.tick_s);
        Ok(Self {
            tick,
            axes: axes_of(&parameters),
            now,
            hands,
            session,
            lines,
            block: clay,
            halt: None,
            outside: Vec::new(),
            came_up: Vec::new(),
            events: Vec::new(),
            wires: Vec::new(),
            ear: None,
            own,
        })
    }

    /// One tick.
    pub fn tick(&mut self) {
        let now = self.now;
        self.deliver_snapshots();
        if self.halt.is_some_and(|halt| halt.until <= now) {
            noticed_since(&mut self.halt);
            for (slot, frame) in self.outside.drain(..) {
                self.session.handle_frame(now, slot, &frame);
            }
        }
        let mut before = [None; MAX_TOOLS];
        for (slot, hand) in self.hands.iter_mut().enumerate() {
            before[slot % MAX_TOOLS] = Some(hand.step(now));
            if let Some(frame) = hand.frame_to_send() {
                let frame = frame.clone();
                hand.sent.frames += 1;
                hand.sent.bytes += frame.encoded_len() as u64;
                match self.wires.get_mut(slot) {
                    Some(wires) => wires.up.push(now, frame),
                    None => self.came_up.push((slot, frame)),
                }
            }
            if let Some(wires) = self.wires.get_mut(slot) {
                let due = std::iter::from_fn(|| wires.up.poll(now));
                self.came_up.extend(due.map(|frame| (slot, frame)));
            }
        }
        let is_stopped = self.halt.is_some_and(|halt| halt.how == Halt::Program);
        for (slot, frame) in self.came_up.drain(..) {
            if is_stopped {
                self.outside.push((slot, frame));
            } else {
                self.session.handle_frame(now, slot, &frame);
            }
        }
        if self.halt.is_none() {
            self.tick_session(now);
        }
        for (hand, wires) in self.hands.iter_mut().zip(&mut self.wires) {
            // A handle notices in its next tick what comes in this one.
            let noticed = now.after(self.tick);
            let due = std::iter::from_fn(|| wires.down.poll(now));
            hand.inbox.extend(due.map(|frame| (noticed, frame)));
        }
        let tick_s = self.tick.as_secs_f64();
        for (slot, hand) in self.hands.iter_mut().enumerate() {
            // A stop takes it away.
            let Some(tool) = self.session.side(slot) else {
                continue;
            };
            if let Some(frame) = tool.frame_to_send().filter(|_| self.halt.is_none()) {
                hand.received_from.frames += 1;
                hand.received_from.bytes += frame.encoded_len() as u64;
            }
            if let Some(before) = &before[slot % MAX_TOOLS] {
                // A tool side that stands still has moved no tool.
                let tool_s = if self.halt.is_none() { tick_s } else { 0.0 };
                hand.observe(before, tool, self.axes, tool_s);
            }
        }
        self.now = self.now.after(self.tick);
    }

    fn tick_session(&mut self, now: Timestamp) {
        match &mut self.ear {
            Some(ear) => self.session.tick_heard(now, |slot, arrived, frame| {
                ear.on_frame(slot, arrived, frame)
            }),
            None => self.session.tick(now),
        }
        // A handle notices in its next tick what a line delivers in this one.
        let noticed = now.after(self.tick);
        while let Some((slot, frame)) = self.session.poll_transmit() {
            match self.wires.get_mut(slot) {
                Some(wires) => wires.down.push(now, *frame),
                None => self.hands[slot].inbox.push((noticed, *frame)),
            }
        }
        self.events.clear();
        while let Some(event) = self.session.poll_event() {
            self.events.push(event);
        }
        if let Some(ear) = &mut self.ear {
            ear.on_tick(&mut self.session, now, &self.events);
        }
        while self.session.poll_retired().is_some() {}
    }

    /// Ticks until `span` has passed.
    pub fn run_for(&mut self, span: Duration) {
        let end = self.now.after(span);
        while self.now < end {
            self.tick();
        }
    }

    /// Both sides of every operator leave out the frames that the other would not miss.
    ///
    /// # Errors
    /// The settings are none for this loop.
    pub fn code_perceptually(&mut self, settings: DeadbandSettings) -> Result<(), DeadbandError> {
        for (slot, hand) in self.hands.iter_mut().enumerate() {
            hand.handle.code_perceptually(settings)?;
            let side = self.session.side_mut(slot).expect(ATTACHED);
            side.code_perceptually(settings)?;
        }
        Ok(())
    }

    /// Every handle is held fast where it is, with no force on its sensor: what is under way on the lines arrives, and
    /// nothing new begins.
    pub fn hold_handles_fast(&mut self) {
        for hand in &mut self.hands {
            hand.held = Some(DeviceSample {
                velocity_m_s: [0.0; 3],
                hand_force_n: [0.0; 3],
                ..hand.device.sample()
            });
        }
    }

    /// The hands go on from where their handles were held.
    pub fn let_handles_go(&mut self) {
        for hand in &mut self.hands {
            hand.held = None;
        }
    }

    /// Holds the first handle at a place of somebody's choice from the next tick on, whatever the loop commands.
    pub fn hold_handle_at(&mut self, sample: DeviceSample) {
        self.hands[0].held = Some(sample);
    }

    /// Beyond the lines, each direction stalls once, whatever they do; what is held back has room.
    pub fn stall(&mut self, up: Option<Stall>, down: Option<Stall>) {
        let stalling = |stall| Impairment {
            stall,
            ..Impairment::default()
        };
        self.wires.resize_with(self.hands.len(), Wires::new);
        for wires in &mut self.wires {
            wires.up.impair(stalling(up));
            wires.down.impair(stalling(down));
        }
    }

    /// The clock of the first handle's program is ahead by this much, and runs this many millionths fast.
    pub fn set_handle_clock(&mut self, ahead: Duration, ppm: f64) {
        self.hands[0].clock = Clock { ahead, ppm };
    }

    /// Changes what the lines do, from the next frame on.
    pub fn impair(&mut self, lines: Lines) {
        self.session.impair(&lines);
        self.lines = lines;
    }

    /// Changes settings of the session, as a new revision.
    ///
    /// # Panics
    /// The session refuses.
    pub fn patch(&mut self, patch: SessionPatch) {
        let scheme = self.session.settings().parameters.scheme;
        if patch.scheme.is_some_and(|other| other != scheme) {
            self.own = None;
        }
        let changed = self.session.carry_out(self.now, &Command::Patch { patch });
        changed.expect("a rig changes to what can be");
    }

    /// Holds every tool, until [`resume`](Self::resume).
    pub fn pause(&mut self) {
        self.patch(SessionPatch {
            paused: Some(true),
            ..SessionPatch::default()
        });
    }

    /// Lets the tools work again.
    pub fn resume(&mut self) {
        self.patch(SessionPatch {
            paused: Some(false),
            ..SessionPatch::default()
        });
    }

    /// Changes the scheme of every operator, as a new revision.
    pub fn change_scheme(&mut self, scheme: Scheme) {
        self.patch(SessionPatch {
            scheme: Some(scheme),
            ..SessionPatch::default()
        });
    }

    /// A fresh block of the shape and size of the first, as a new revision.
    ///
    /// # Panics
    /// The session refuses.
    pub fn fresh_block(&mut self) {
        let settings = Settings::clone(self.session.settings());
        let revision = settings.revision;
        let changed = Prepared::fresh_block(settings, self.block.clone(), revision)
            .and_then(|mut fresh| self.session.handle_command(self.now, &mut fresh));
        changed.expect("a rig changes to what can be");
    }

    /// Energy in the channel between the first hand and its clay, J, from true work at both ends.
    pub fn energy_j(&self) -> f64 {
        self.hands[0].observer.energy_j()
    }

    /// The least that this energy has been, J: zero for a channel that never gave more than it got.
    pub fn least_energy_j(&self) -> f64 {
        self.hands[0].observer.least_j()
    }

    /// What the first operator's two sides sent: up, down.
    pub fn traffic(&self) -> [Traffic; 2] {
        [self.hands[0].sent, self.hands[0].received_from]
    }

    /// Frames that left each side: up, down.
    pub fn frames_sent(&self) -> [u64; 2] {
        self.traffic().map(|traffic| traffic.frames)
    }

    /// Virtual time.
    pub fn now(&self) -> Timestamp {
        self.now
    }

    /// What the last step gave the first device.
    pub fn last(&self) -> &HandleStep {
        &self.hands[0].last
    }

    /// The first device.
    pub fn device(&self) -> &SimulatedHandle {
        &self.hands[0].device
    }

    /// The first device, to change its intent.
    pub fn device_mut(&mut self) -> &mut SimulatedHandle {
        &mut self.hands[0].device
    }

    /// The device of an operator, to change its intent.
    pub fn device_of_mut(&mut self, slot: usize) -> &mut SimulatedHandle {
        &mut self.hands[slot].device
    }

    /// The first handle side.
    pub fn handle(&self) -> &HandleSide {
        &self.hands[0].handle
    }

    /// The first handle side, to tell it of other parameters.
    pub fn handle_mut(&mut self) -> &mut HandleSide {
        &mut self.hands[0].handle
    }

    /// The handle side of an operator.
    pub fn handle_of(&self, slot: usize) -> &HandleSide {
        &self.hands[slot].handle
    }

    /// The copy of the clay that the first operator feels, where the scheme keeps one.
    pub fn clay_copy(&self) -> Option<&dyn ClayCopy> {
        self.handle().clay_copy()
    }

    /// What the session told in the last tick.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Another server runs the session from now on. What was on the old one's lines is lost; gives back its session.
    pub fn replace_session(&mut self, session: Session) -> Session {
        self.halt = None;
        self.outside.clear();
        std::mem::replace(&mut self.session, session)
    }

    /// The operator in `slot` asks for the tool again, as after a server was lost, and goes on under the new lease.
    ///
    /// # Errors
    /// The session refuses.
    pub fn renew_lease(&mut self, slot: usize) -> Result<(), Refusal> {
        let operator = operator(slot);
        let parameters = self.session.settings().parameters;
        let controllers = controllers(self.own.as_ref(), &parameters.scheme);
        let side = ToolSide::with_controllers(&parameters, 0, controllers)
            .expect("a session's parameters make a loop");
        let mut prepared = Prepared::join(&operator, side, None);
        let outcome = self.session.handle_command(self.now, &mut prepared)?;
        let granted = outcome.granted.expect(ATTACHED);
        self.hands[granted.slot].handle.renew(Lease {
            number: granted.lease,
            ownership_epoch: self.session.ownership_epoch(),
        });
        Ok(())
    }

    /// The block as it was at first.
    pub fn block(&self) -> &Clay {
        &self.block
    }

    /// The session.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// The session, to change its material or clay.
    pub fn session_mut(&mut self) -> &mut Session {
        &mut self.session
    }

    /// The first operator's tool side.
    pub fn tool(&self) -> &ToolSide {
        self.session.side(0).expect(ATTACHED)
    }
}

const MAX_TOOLS: usize = teleclay_proto::http::MAX_TOOLS as usize;
const ATTACHED: &str = "only a stop takes a tool from the rig";

/// The settings of a session that runs with these parameters. They hold more than a new session can ask for.
fn settings(parameters: &LoopParameters, tools: usize) -> Settings {
    let spec = NewSession {
        axes: parameters.axes,
        scheme: parameters.scheme,
        material: parameters.material,
        tool: parameters.tool,
        deadband: parameters.deadband,
        tools: tools as u8,
        ..NewSession::new(SessionId::new("rig").expect("a constant name is valid"))
    };
    Settings {
        revision: u64::from(parameters.revision),
        spec,
        parameters: *parameters,
        is_paused: false,
    }
}

fn operator(slot: usize) -> Operator {
    Operator {
        name: format!("operator {slot}"),
        device: "simulated".to_owned(),
    }
}

fn axes_of(parameters: &LoopParameters) -> Axes {
    match parameters.axes {
        teleclay_proto::Axes::Two => Axes::Two,
        teleclay_proto::Axes::Three => Axes::Three,
    }
}
