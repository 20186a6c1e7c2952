//! The handle side of the loop: one pure step a tick.
//!
//! ```text
//! device sample ─> input check ─> scheme's reaction ─> ramps ─> limiter ─> + hand force ─> C_h1 ─> position command v_h
//! ```
//!
//! `v_h = C_h1 (f_h + reaction)`: for force exchange that is [KHMH03] (21) with (30). The command starts at the place where the device stands when
//! the loop takes over, so taking over moves nothing.

use std::sync::Arc;

use teleclay_clay::Clay;
use teleclay_control::State;
use teleclay_device::DeviceSample;
use teleclay_link::Vec3;
use teleclay_link::arrivals::{Arrival, ArrivalCounts, Arrivals};
use teleclay_link::deadband::{Deadband, DeadbandError, DeadbandSettings};
use teleclay_link::replica::ToolSetup;
use teleclay_link::round_trip::RoundTrip;
use teleclay_link::safety::{ForceLimiter, NotFinite, Watchdog, check};
use teleclay_link::scheme::replica::{Snapshot, WantedSnapshot};
use teleclay_link::scheme::{
    ClayCopy, HandleController, HandlePort, SchemeContext, handle_controller,
};
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{
    CopyState, Corrections, Engagement, Gaps, HandleFrame, Header, LoopStatus, Sweeps, ToolFrame,
};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Scheme, is_after};

use crate::parameters::{LoopModel, ParameterError};

/// A change of scheme or status is blended over this time, s: no change steps the force.
const BLEND_S: f64 = 0.05;

/// State of the link: whether the hand feels the far side, and if not, why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkState {
    /// Frames come and the tool works.
    Live,
    /// No frame yet.
    NotYet,
    /// No frame for longer than the allowed silence.
    Silent,
    /// Likewise, but there is a copy of the clay to be felt, and for a while to be cut.
    OnCopy,
    /// The silence lasts: the copy is felt and no longer cut.
    OnStaleCopy,
    /// The tool side has gone: nobody would merge what is cut here, so there is nothing to be felt either.
    Gone,
    /// The session is paused.
    Paused,
    /// The tool side is in fault, or this side is (see [`HandleSide::fault`]).
    Fault,
}

/// Under what a handle's frames are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lease {
    /// The lease's number, as granted.
    pub number: u32,
    /// Counts the servers that have run the session, as granted.
    pub ownership_epoch: u32,
}

/// What a handle side is done with. Large, so not to be dropped on a tick.
pub enum Retired {
    /// A controller of a scheme.
    Controller {
        /// It.
        _controller: Box<dyn HandleController>,
    },
    /// A copy of the clay.
    Clay {
        /// It.
        _clay: Box<Clay>,
    },
}

/// What one step gives the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleStep {
    /// Position command `v_h`, m.
    pub command_m: [f64; 3],
    /// Force on the hand from the far side, N, after all limits.
    pub felt_force_n: [f64; 3],
    /// State of the link: whether that force is live, and if not, why.
    pub link_state: LinkState,
}

/// The handle side of one tool's loop.
///
/// Its methods are of four kinds, and are meant to be called in this order, tick by tick:
///
/// 1. `handle_*` takes in what comes from outside: [`handle_frame`](Self::handle_frame), [`handle_snapshot`](Self::handle_snapshot),
///    [`handle_peer_gone`](Self::handle_peer_gone).
/// 2. What changes it between two ticks: [`move_to`](Self::move_to), [`set_deadband`](Self::set_deadband), [`provide`](Self::provide),
///    [`leave`](Self::leave); then [`step`](Self::step), a tick.
/// 3. What the step gives: [`frame_to_send`](Self::frame_to_send), then [`poll_retired`](Self::poll_retired) until it gives nothing more.
/// 4. Everything else is a getter; [`wanted_snapshot`](Self::wanted_snapshot) and [`wanted_controller`](Self::wanted_controller) say what to bring.
///
/// None of these allocates, but for [`code_perceptually`](Self::code_perceptually), [`restock`](Self::restock) and [`new`](Self::new).
pub struct HandleSide {
    model: LoopModel,
    controller: Box<dyn HandleController>,
    scheme: Scheme,
    /// A controller of every other scheme, so that a change takes no more than a tick.
    spares: [Option<Box<dyn HandleController>>; Scheme::ALL.len()],
    /// Frames before this one belong to an earlier scheme.
    scheme_since: u32,
    admittance: [State; 3],
    origin: Option<Vec3>,
    /// Where the handle was at the last step.
    position: Option<Vec3>,
    watchdog: Watchdog,
    /// Of what the scheme makes: the watchdog's, or full where the scheme needs no frames.
    remote_gain: f64,
    needed_frames: bool,
    status_gain: f64,
    /// Ramps up once, from the first step: taking over a handle that is being pushed moves it gently.
    start_gain: f64,
    /// What was felt when the scheme changed, and how much of it is left, 0 to 1.
    fading: Vec3,
    fading_share: f64,
    blend_starts: bool,
    last_reaction: Vec3,
    limiter: ForceLimiter,
    arrivals: Arrivals,
    round_trip: RoundTrip,
    status: LoopStatus,
    /// When the tool side was seen to go, until it is heard of again.
    gone_since: Option<Timestamp>,
    fault: Option<NotFinite>,
    frame: HandleFrame,
    deadband: Option<Deadband>,
    /// Engagement and scheme as last sent.
    announced: Option<(Engagement, Scheme)>,
    is_due: bool,
    /// A controller that is done, to be dropped where that costs no tick.
    retired: Option<Box<dyn HandleController>>,
}

impl HandleSide {
    /// At rest, under `lease`.
    ///
    /// # Errors
    /// The parameters make no loop.
    pub fn new(parameters: &LoopParameters, lease: Lease) -> Result<Self, ParameterError> {
        let model = LoopModel::new(parameters)?;
        let header = Header {
            lease: lease.number,
            ownership_epoch: lease.ownership_epoch,
            scheme: parameters.scheme,
            revision: parameters.revision,
            ..Header::default()
        };
        let mut side = Self {
            controller: handle_controller(parameters.scheme, &model.context),
            scheme: parameters.scheme,
            spares: [const { None }; Scheme::ALL.len()],
            scheme_since: 0,
            admittance: [State::default(); 3],
            origin: None,
            position: None,
            watchdog: Watchdog::new(model.watchdog),
            remote_gain: 0.0,
            needed_frames: true,
            status_gain: 0.0,
            start_gain: 0.0,
            fading: Vec3::zeros(),
            fading_share: 0.0,
            blend_starts: false,
            last_reaction: Vec3::zeros(),
            limiter: ForceLimiter::new(model.limits),
            arrivals: Arrivals::default(),
            round_trip: RoundTrip::default(),
            status: LoopStatus::Idle,
            gone_since: None,
            fault: None,
            frame: HandleFrame {
                header,
                engagement: Engagement::Engaged,
                ..HandleFrame::default()
            },
            deadband: model.deadband(parameters.deadband)?,
            announced: None,
            is_due: false,
            retired: None,
            model,
        };
        side.restock();
        Ok(side)
    }

    /// From now on leaves out frames that the other side would not miss; see [`teleclay_link::deadband`].
    ///
    /// # Errors
    /// The settings are none for this loop; nothing changes.
    pub fn code_perceptually(&mut self, settings: DeadbandSettings) -> Result<(), DeadbandError> {
        self.deadband = Some(Deadband::new(settings, self.model.watchdog.silence)?);
        Ok(())
    }

    /// From now on leaves out the frames whose change is below this share of what is felt; 0 sends every one.
    ///
    /// # Errors
    /// There is no such share; nothing changes.
    pub fn set_deadband(&mut self, fraction: f64) -> Result<(), DeadbandError> {
        self.deadband = self.model.deadband(fraction)?;
        Ok(())
    }

    /// A frame came from the tool side. Frames under another lease, and those of an earlier server of the session, are not ours; older ones are counted,
    /// and shown to a scheme that plays its samples in order.
    pub fn handle_frame(&mut self, now: Timestamp, frame: &ToolFrame) {
        let header = &frame.header;
        let own = &mut self.frame.header;
        if header.lease != own.lease || is_after(own.ownership_epoch, header.ownership_epoch) {
            return;
        }
        own.ownership_epoch = header.ownership_epoch;
        // What was on its way when the tool side went is no sign of life.
        let silence = self.model.watchdog.silence;
        if self
            .gone_since
            .is_some_and(|since| silence < now.since(since))
        {
            self.gone_since = None;
        }
        let arrival = self.arrivals.on_sequence(header.sequence);
        let outside = [
            ("position_m", &frame.position_m[..]),
            ("velocity_m_s", &frame.velocity_m_s),
            ("force_n", &frame.force_n),
            ("wave", &frame.wave),
            ("wave_integral", &frame.wave_integral),
            ("energy_in_j", &frame.energy_in_j),
        ];
        if let Err(fault) = check(&outside) {
            self.fault = Some(fault);
            return;
        }
        if arrival != Arrival::Newest {
            let is_of_this_scheme =
                header.scheme == self.scheme && !is_after(self.scheme_since, header.sequence);
            if is_of_this_scheme {
                self.controller.on_late_frame(now, frame);
            }
            return;
        }
        self.round_trip
            .on_frame(now, header.sent_ns, header.echo_ns, header.echo_hold_ns);
        self.watchdog.on_frame(now);
        self.status = frame.status;
        self.frame.header.clay_epoch = header.clay_epoch;
        self.frame.header.revision = header.revision;
        let is_mine =
            header.scheme == self.scheme || self.change_scheme(header.scheme, header.sequence);
        if is_mine {
            self.controller.on_frame(now, frame);
        }
    }

    /// One tick.
    pub fn step(&mut self, now: Timestamp, sample: &DeviceSample) -> HandleStep {
        let measured = [
            ("device position_m", &sample.position_m[..]),
            ("device velocity_m_s", &sample.velocity_m_s),
            ("device hand_force_n", &sample.hand_force_n),
        ];
        if let Err(fault) = check(&measured) {
            self.fault = Some(fault);
            return self.hold();
        }
        // Both sides work with the ramped force, so that they stay together from the first tick.
        let position = Vec3::from(sample.position_m);
        let before = self.position.replace(position).unwrap_or(position);
        let port = HandlePort {
            position,
            velocity: Vec3::from(sample.velocity_m_s),
            hand_force: Vec3::from(sample.hand_force_n) * self.start_gain,
            displacement: self.model.reflected(position - before),
            felt_force: self.limiter.last(),
        };
        self.start_gain =
            (self.start_gain + self.model.tick_s() / self.model.setup().ramp_s).min(1.0);
        let felt = self.felt_force(now, &port);
        let command = self.command(&port, felt);
        self.fill_frame(now, &port, felt);
        HandleStep {
            command_m: command.into(),
            felt_force_n: felt.into(),
            link_state: self.link_state(now),
        }
    }

    /// The frame of the last step, whether it goes out or not.
    pub fn frame(&self) -> &HandleFrame {
        &self.frame
    }

    /// The frame to be sent now, if the last step made one that the other side would miss. Without perceptual coding every step does.
    pub fn frame_to_send(&self) -> Option<&HandleFrame> {
        self.is_due.then_some(&self.frame)
    }

    /// The snapshot of the server's clay that is wanted here, if one is; a new number is a new request.
    pub fn wanted_snapshot(&self) -> Option<WantedSnapshot> {
        self.controller.clay_copy()?.wanted_snapshot()
    }

    /// A snapshot of the server's clay. One that no scheme here has a use for waits to be dropped, see [`HandleSide::poll_retired`].
    pub fn handle_snapshot(&mut self, snapshot: Snapshot) -> Option<Snapshot> {
        match self.controller.clay_copy_mut() {
            Some(copy) => {
                copy.handle_snapshot(snapshot);
                None
            }
            None => Some(snapshot),
        }
    }

    /// Another tool, another place, or other clay, from now on. Gives back what was, to be dropped elsewhere.
    pub fn move_to(&mut self, setup: Arc<ToolSetup>) -> Arc<ToolSetup> {
        if let Some(copy) = self.controller.clay_copy_mut() {
            copy.move_to(&setup);
        }
        std::mem::replace(&mut self.model.context.setup, setup)
    }

    /// What is done with here, to be dropped where that costs no tick.
    pub fn poll_retired(&mut self) -> Option<Retired> {
        if let Some(controller) = self.retired.take() {
            return Some(Retired::Controller {
                _controller: controller,
            });
        }
        let clay = self.controller.clay_copy_mut()?.poll_retired()?;
        Some(Retired::Clay { _clay: clay })
    }

    /// The copy of the clay that is felt here, where the scheme keeps one.
    pub fn clay_copy(&self) -> Option<&dyn ClayCopy> {
        self.controller.clay_copy()
    }

    /// The scheme of which a controller is missing, should the session change to it: see [`provide`](Self::provide).
    pub fn wanted_controller(&self) -> Option<Scheme> {
        let has_one = |scheme: Scheme| self.spares[usize::from(scheme.byte())].is_some();
        let missing = |scheme: &Scheme| *scheme != self.scheme && !has_one(*scheme);
        Scheme::ALL.iter().copied().find(missing)
    }

    /// Takes a controller for the day when the session changes to its scheme. Gives back the one that it replaces.
    pub fn provide(
        &mut self,
        scheme: Scheme,
        controller: Box<dyn HandleController>,
    ) -> Option<Box<dyn HandleController>> {
        self.spares[usize::from(scheme.byte())].replace(controller)
    }

    /// Makes the controllers that are missing, here and now.
    pub fn restock(&mut self) {
        while let Some(scheme) = self.wanted_controller() {
            self.provide(scheme, handle_controller(scheme, &self.model.context));
        }
    }

    /// What controllers for this side are made from.
    pub fn context(&self) -> &SchemeContext {
        &self.model.context
    }

    /// The tool side is known to have gone, by other means than its silence: the force ramps to zero whatever the scheme, until a frame that arrives
    /// later than `now` by more than the allowed silence shows that it is there.
    pub fn handle_peer_gone(&mut self, now: Timestamp) {
        self.gone_since = Some(now);
    }

    /// Says goodbye in every further frame.
    pub fn leave(&mut self) {
        self.frame.engagement = Engagement::Leaving;
    }

    /// Counts of what came from the tool side.
    pub fn arrivals(&self) -> ArrivalCounts {
        self.arrivals.counts()
    }

    /// Round trip as seen from here.
    pub fn round_trip(&self) -> &RoundTrip {
        &self.round_trip
    }

    /// Revision of the session, as last received.
    pub fn revision(&self) -> u32 {
        self.frame.header.revision
    }

    /// The scheme in force.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// The value that ended this loop, if one did.
    pub fn fault(&self) -> Option<NotFinite> {
        self.fault
    }

    /// State of the link: what the hand feels of the far side, and why not if it does not.
    pub fn link_state(&self, now: Timestamp) -> LinkState {
        if self.fault.is_some() || self.status == LoopStatus::Fault {
            return LinkState::Fault;
        }
        if self.gone_since.is_some() {
            return LinkState::Gone;
        }
        if self.watchdog.age(now).is_none() {
            return LinkState::NotYet;
        }
        if self.watchdog.is_silent(now) {
            return match self.controller.clay_copy().map(ClayCopy::state) {
                None | Some(CopyState::None) => LinkState::Silent,
                Some(CopyState::Stale) => LinkState::OnStaleCopy,
                Some(CopyState::Live | CopyState::Diverged) => LinkState::OnCopy,
            };
        }
        if self.status == LoopStatus::Paused {
            LinkState::Paused
        } else {
            LinkState::Live
        }
    }

    fn felt_force(&mut self, now: Timestamp, port: &HandlePort) -> Vec3 {
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
        let mut wanted = reaction * (self.remote_gain * self.status_gain);
        if self.fault.is_some() {
            wanted = Vec3::zeros();
        }
        for axis in self.model.axes..3 {
            wanted[axis] = 0.0;
        }
        self.limiter.step(wanted, tick_s)
    }

    fn command(&mut self, port: &HandlePort, felt: Vec3) -> Vec3 {
        let origin = *self.origin.get_or_insert(port.position);
        let net = port.hand_force + felt;
        let mut command = port.position;
        for axis in 0..self.model.axes {
            let [least, greatest] = self.model.handle_travel(axis);
            let system = &self.model.coupling().admittance;
            let next = origin[axis] + system.output(&self.admittance[axis], net[axis]);
            // At the end of the travel nothing pushes further out: the admittance coasts to a stop against its own damping.
            let pushes_out =
                (greatest < next && 0.0 < net[axis]) || (next < least && net[axis] < 0.0);
            let net = if pushes_out { 0.0 } else { net[axis] };
            let next = origin[axis] + system.step(&mut self.admittance[axis], net);
            command[axis] = next.clamp(least, greatest);
        }
        command
    }

    fn fill_frame(&mut self, now: Timestamp, port: &HandlePort, felt: Vec3) {
        let (echo_ns, echo_hold_ns) = self.round_trip.echo(now);
        let header = &mut self.frame.header;
        header.sent_ns = now.as_nanos();
        header.echo_ns = echo_ns;
        header.echo_hold_ns = echo_hold_ns;
        header.scheme = self.scheme;
        self.frame.position_m = port.position.into();
        self.frame.velocity_m_s = port.velocity.into();
        self.frame.hand_force_n = port.hand_force.into();
        self.frame.felt_force_n = felt.into();
        self.controller.fill(&mut self.frame);
        self.number_frame(now);
    }

    /// Decides whether the frame goes out. Numbers count the frames that do.
    fn number_frame(&mut self, now: Timestamp) {
        let announcement = (self.frame.engagement, self.scheme);
        self.is_due = match &mut self.deadband {
            Some(deadband) => {
                if self.announced != Some(announcement) {
                    deadband.insist();
                }
                if self.controller.has_urgent_news() {
                    deadband.insist();
                }
                deadband.should_send(now, self.controller.signal(&self.frame))
            }
            None => true,
        };
        if self.is_due {
            self.controller.on_sent(&self.frame);
            self.announced = Some(announcement);
            self.frame.header.sequence = self.frame.header.sequence.wrapping_add(1);
        }
    }

    /// Whether the controller of `scheme` has taken over. Without one that waits, or without room for the one that is done, the present one goes on
    /// with what it heard last.
    fn change_scheme(&mut self, scheme: Scheme, since: u32) -> bool {
        let has_room = self.retired.is_none();
        let spare = &mut self.spares[usize::from(scheme.byte())];
        let Some(mut controller) = spare.take_if(|_| has_room) else {
            return false;
        };
        if let Some(copy) = controller.clay_copy_mut() {
            copy.move_to(&self.model.context.setup);
        }
        self.retired = Some(std::mem::replace(&mut self.controller, controller));
        self.scheme = scheme;
        self.scheme_since = since;
        self.frame.wave = [0.0; 3];
        self.frame.wave_integral = [0.0; 3];
        self.frame.energy_in_j = [0.0; 3];
        self.frame.copy = CopyState::None;
        self.frame.corrections = Corrections::default();
        self.frame.clay_hash = 0;
        self.frame.relayed_acknowledged = 0;
        self.frame.relayed_gaps = Gaps::default();
        self.frame.sweeps = Sweeps::default();
        // What was felt fades into what the new controller gives, instead of stepping there.
        self.blend_starts = true;
        true
    }

    /// A step without a usable sample: the command stays, the force goes.
    fn hold(&mut self) -> HandleStep {
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
