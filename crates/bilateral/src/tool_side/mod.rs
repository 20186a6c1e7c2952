//! The tool side of the loop: one pure step a tick.
//!
//! ```text
//! frames ─> input check ─> scheme's reference ─> motion limiter ─> G_t^-1 ─v_t─> G_t ─y_t─> clay: cut, contact, reaction ─> frame
//! ```
//!
//! The motion limiter ([`teleclay_link::motion_limiter`]) is where motion stops: it follows the scheme's reference step
//! by step while frames come, and holds the tool while they do not, while the session is paused and after a fault.
//! Where the handle has cut a copy of the clay, its sweeps are merged instead ([`teleclay_link::scheme::replica`]).

mod frames;
mod motion;
mod track;

use std::sync::Arc;
use std::time::Duration;

use teleclay_clay::{Clay, ContactState, Material, Operation};
use teleclay_control::State;
use teleclay_link::Vec3;
use teleclay_link::arrivals::{ArrivalCounts, Arrivals};
use teleclay_link::deadband::{Deadband, DeadbandError, DeadbandSettings};
use teleclay_link::freshness::Freshness;
use teleclay_link::motion_limiter::MotionLimiter;
use teleclay_link::replica::{CorrectionLimiter, Cut, ToolSetup};
use teleclay_link::round_trip::RoundTrip;
use teleclay_link::safety::{Implausible, Persistence, Watchdog};
use teleclay_link::scheme::replica::MergeContext;
use teleclay_link::scheme::{Controllers, Generation, ToolController};
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{Engagement, Header, LoopStatus, ToolFrame};
use teleclay_proto::join::LoopParameters;

use crate::parameters::{LoopModel, ParameterError};
use crate::tool_view::{FarHandle, NearTool, ToolView};
use track::Track;

/// Cuts that one tick can make: its own or, where sweeps are merged, as many as a tick may merge.
pub const CUTS_A_TICK: usize = 64;

/// A holder who says goodbye is waited for so long, until what was cut before has been merged: a few round trips of a
/// long line.
const LAST_SWEEPS_WITHIN: Duration = Duration::from_millis(500);

/// Whether the session lets its tools work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Permission {
    /// Tools work.
    Work,
    /// The session is paused.
    Pause,
}

/// What one step did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolStep {
    /// What was removed, added, or moved by smoothing, in units of 1/255 voxel.
    pub moved_units: u64,
    /// Engaged area, m².
    pub engaged_area_m2: f64,
}

/// The tool side of one tool's loop.
///
/// Its methods are of four kinds, and are meant to be called in this order, tick by tick:
///
/// 1. `handle_*` takes in what comes from outside: [`handle_frame`](Self::handle_frame), [`handle_cut`](Self::handle_cut).
/// 2. What changes it between two ticks: [`attach`](Self::attach), [`change_scheme`](Self::change_scheme),
///    [`start_on_fresh_block`](Self::start_on_fresh_block), [`move_to`](Self::move_to), [`set_revision`](Self::set_revision),
///    [`set_deadband`](Self::set_deadband); then [`step`](Self::step), a tick.
/// 3. What the step gives: [`cuts`](Self::cuts) for the other tools, and [`frame_to_send`](Self::frame_to_send) for the
///    handle.
/// 4. Everything else is a getter.
///
/// None of these allocates, but for [`code_perceptually`](Self::code_perceptually), [`new`](Self::new) and
/// [`with_controllers`](Self::with_controllers).
pub struct ToolSide {
    model: LoopModel,
    controller: Box<dyn ToolController>,
    scheme: Scheme,
    contact: ContactState,
    /// Internal model of the inverse, and the plant itself, axis by axis, both as displacement from `base`.
    inverse: [State; 3],
    plant: [State; 3],
    base: Vec3,
    position: Vec3,
    velocity: Vec3,
    track: Track,
    motion_limiter: MotionLimiter,
    /// Whether the handle's sweeps led in the last tick.
    was_led: bool,
    /// What was cut in the last tick.
    cuts: Vec<Cut>,
    clay_force: Vec3,
    /// Lets clay that was exchanged change the force only slowly.
    limiter: CorrectionLimiter,
    is_in_exchanged_clay: bool,
    lift: f64,
    watchdog: Watchdog,
    freshness: Freshness,
    /// When the last frame came, fresh or stale.
    heard_at: Option<Timestamp>,
    first_step: Option<Timestamp>,
    permission_gain: f64,
    arrivals: Arrivals,
    round_trip: RoundTrip,
    /// Whether a hand has driven the tool since it was attached.
    engaged: bool,
    /// What the handle says it does.
    engagement: Engagement,
    /// When the holder was first heard to leave.
    left_at: Option<Timestamp>,
    /// Whether the newest frame under this lease was meant for an earlier server of the session.
    names_another_owner: bool,
    /// Sweeps up to this number are durable; `None` where nothing is kept.
    durable: Option<u32>,
    fault: Option<Implausible>,
    persistence: Persistence,
    handle: FarHandle,
    frame: ToolFrame,
    deadband: Option<Deadband>,
    /// Status, scheme and revision as last sent.
    announced: Option<(LoopStatus, Scheme, u32)>,
    is_due: bool,
}

impl ToolSide {
    /// At rest at home, under `lease`.
    ///
    /// # Errors
    /// The parameters make no loop.
    pub fn new(parameters: &LoopParameters, lease: u32) -> Result<Self, ParameterError> {
        Self::with_controllers(parameters, lease, &parameters.scheme)
    }

    /// Likewise, with a controller that was made elsewhere. Its frames go under the word of the parameters' scheme.
    ///
    /// # Errors
    /// The parameters make no loop.
    pub fn with_controllers(
        parameters: &LoopParameters,
        lease: u32,
        controllers: &dyn Controllers,
    ) -> Result<Self, ParameterError> {
        let model = LoopModel::new(parameters)?;
        let header = Header {
            lease,
            scheme: parameters.scheme,
            revision: parameters.revision,
            ..Header::default()
        };
        let mut side = Self {
            controller: controllers.tool(&model.context),
            scheme: parameters.scheme,
            contact: ContactState::default(),
            inverse: [State::default(); 3],
            plant: [State::default(); 3],
            base: Vec3::zeros(),
            position: Vec3::zeros(),
            velocity: Vec3::zeros(),
            track: Track::new(),
            motion_limiter: MotionLimiter::new(model.setup().motion_limits),
            was_led: false,
            cuts: Vec::with_capacity(CUTS_A_TICK),
            clay_force: Vec3::zeros(),
            limiter: CorrectionLimiter::new(model.correction_limits()),
            is_in_exchanged_clay: false,
            lift: 0.0,
            watchdog: Watchdog::new(model.watchdog),
            freshness: Freshness::new(model.watchdog.silence),
            heard_at: None,
            first_step: None,
            permission_gain: 0.0,
            arrivals: Arrivals::default(),
            round_trip: RoundTrip::default(),
            engaged: false,
            engagement: Engagement::Idle,
            left_at: None,
            names_another_owner: false,
            durable: None,
            fault: None,
            persistence: Persistence::default(),
            handle: FarHandle::default(),
            frame: ToolFrame {
                header,
                ..ToolFrame::default()
            },
            deadband: model.deadband(parameters.deadband)?,
            announced: None,
            is_due: false,
            model,
        };
        side.expect_gaps();
        Ok(side)
    }

    /// Another tool has cut the clay.
    pub fn handle_cut(&mut self, cut: Cut) {
        self.controller.relay(cut);
    }

    /// An operator takes hold of the tool under `lease`: frames of this generation and later ones are meant for this
    /// side.
    pub fn attach(&mut self, lease: u32, ownership_epoch: u32, generation: Generation) {
        let header = &mut self.frame.header;
        header.lease = lease;
        header.ownership_epoch = ownership_epoch;
        header.revision = generation.since_revision;
        header.clay_epoch = generation.epoch;
        self.controller.begin(generation);
        self.controller.on_fresh_block(generation.epoch);
    }

    /// Changes the scheme; the tool goes on from where it stands. `generation` says from which revision on frames are
    /// meant for it. The controller is exchanged for the one that is done.
    pub fn change_scheme(
        &mut self,
        scheme: Scheme,
        generation: Generation,
        controller: &mut Box<dyn ToolController>,
    ) {
        if scheme == self.scheme {
            return;
        }
        self.stop_being_led();
        controller.begin(generation);
        controller.move_to(&self.model.context.setup);
        controller.reindex(self.handle.position());
        std::mem::swap(&mut self.controller, controller);
        self.expect_gaps();
        self.scheme = scheme;
        self.motion_limiter.forget_reference();
        let header = self.frame.header;
        self.frame = ToolFrame {
            header: Header {
                revision: generation.since_revision,
                clay_epoch: generation.epoch,
                ..header
            },
            ..ToolFrame::default()
        };
    }

    /// The clay was exchanged for a fresh block: the tool goes to where its handle is, without cutting, and a fault is
    /// over.
    pub fn start_on_fresh_block(&mut self, generation: Generation) {
        self.fault = None;
        self.frame.header.revision = generation.since_revision;
        self.frame.header.clay_epoch = generation.epoch;
        self.controller.on_fresh_block(generation.epoch);
        self.reindex();
    }

    /// The clay was exchanged for another one in the same place, under a new epoch: the tool stays where it is, in
    /// whatever is there now. What that changes in the force shows no faster than a
    /// [correction](teleclay_link::replica::CorrectionLimiter) may, and brings no energy that was not earned.
    pub fn go_on_in_exchanged_clay(&mut self, generation: Generation) {
        self.frame.header.revision = generation.since_revision;
        self.frame.header.clay_epoch = generation.epoch;
        self.controller.on_exchanged_clay(generation.epoch);
        self.is_in_exchanged_clay = true;
    }

    /// Frames say from now on that sweeps are durable up to this number, and not up to all that were merged.
    pub fn set_durable(&mut self, sweeps: u32) {
        self.durable = Some(sweeps);
    }

    /// Goes on where the tool of an earlier server has ended: every sweep up to `decided` was merged or refused there.
    pub fn resume(&mut self, decided: u32, fault: Option<Implausible>) {
        self.controller.resume(decided);
        self.fault = fault;
    }

    /// Another place or tool, from the fresh block on that follows. Gives back what was, to be dropped elsewhere.
    pub fn move_to(&mut self, setup: Arc<ToolSetup>) -> Arc<ToolSetup> {
        self.motion_limiter.limit(setup.motion_limits);
        self.controller.move_to(&setup);
        std::mem::replace(&mut self.model.context.setup, setup)
    }

    /// The session is at this revision now.
    pub fn set_revision(&mut self, revision: u32) {
        self.frame.header.revision = revision;
    }

    /// From now on leaves out the frames whose change is below this share of what is felt, and takes it that the handle
    /// does so too; 0 sends every one.
    ///
    /// # Errors
    /// There is no such share; nothing changes.
    pub fn set_deadband(&mut self, fraction: f64) -> Result<(), DeadbandError> {
        self.deadband = self.model.deadband(fraction)?;
        self.expect_gaps();
        Ok(())
    }

    /// From now on leaves out frames that the other side would not miss; see [`teleclay_link::deadband`].
    ///
    /// # Errors
    /// The settings are none for this loop; nothing changes.
    pub fn code_perceptually(&mut self, settings: DeadbandSettings) -> Result<(), DeadbandError> {
        self.deadband = Some(Deadband::new(settings, self.model.watchdog.silence)?);
        self.expect_gaps();
        Ok(())
    }

    /// One tick in this clay. Sweeps of the handle cut, whatever the operation.
    pub fn step(
        &mut self,
        now: Timestamp,
        clay: &mut Clay,
        material: &Material,
        operation: Operation,
        permission: Permission,
    ) -> ToolStep {
        self.first_step.get_or_insert(now);
        let tick_s = self.model.tick_s();
        let status = self.status(permission);
        let gain = self.gain(now, permission);
        let port = self.port();
        self.cuts.clear();
        let context = MergeContext {
            clay,
            material,
            contact: &mut self.contact,
            status,
            cuts: &mut self.cuts,
        };
        let step = match self.controller.merge(now, &port, context) {
            Some(merged) => self.adopt(&merged),
            None => {
                self.stop_being_led();
                let wanted = self.limited_motion(now, &port, gain);
                let before = self.position;
                self.follow(wanted);
                self.velocity = (self.position - before) / tick_s;
                let step = self.work(before, clay, material, operation);
                let port = self.port();
                self.controller.moved(&port);
                step
            }
        };
        self.track.push(now, self.position);
        self.handle.on_step(self.velocity, self.clay_force, tick_s);
        self.fill_frame(now, status, step);
        step
    }

    /// What was cut in the last tick.
    pub fn cuts(&self) -> &[Cut] {
        &self.cuts
    }

    /// Every sweep of the handle up to this number has been merged or refused; 0 under a scheme without sweeps.
    pub fn sweeps_decided(&self) -> u32 {
        self.controller.sweeps_decided()
    }

    /// The frame to be sent now, if the last step made one that the other side would miss. Without perceptual coding
    /// every step does.
    pub fn frame_to_send(&self) -> Option<&ToolFrame> {
        self.is_due.then_some(&self.frame)
    }

    /// The frame of the last step, whether it goes out or not.
    pub fn frame(&self) -> &ToolFrame {
        &self.frame
    }

    /// The tool and the handle as seen from here.
    pub fn view(&self) -> ToolView {
        self.handle.view(&NearTool {
            position: self.model.setup().home + self.position,
            velocity: self.velocity,
            clay_force: self.clay_force,
            sweeps_refused: self.frame.sweeps_refused,
            refusal: self.frame.refusal,
        })
    }

    /// Whether the handle's sweeps led the tool in the last tick.
    pub fn is_led(&self) -> bool {
        self.was_led
    }

    /// Whether any frame has come.
    pub fn is_heard(&self) -> bool {
        self.heard_at.is_some()
    }

    /// Whether frames come, and the holder has not said goodbye.
    pub fn is_connected(&self, now: Timestamp) -> bool {
        self.left_at.is_none() && !self.watchdog.is_silent(now)
    }

    /// Whether the holder has said goodbye, and what was cut before that has been merged, or has had its time to come.
    pub fn has_left(&self, now: Timestamp) -> bool {
        self.left_at.is_some_and(|at| {
            self.controller.has_merged_all() || LAST_SWEEPS_WITHIN < now.since(at)
        })
    }

    /// How old the news of the handle are: time since the last fresh frame, or since the first tick if none came.
    pub fn silence_s(&self, now: Timestamp) -> f64 {
        self.since_s(now, self.watchdog.age(now))
    }

    /// Time since the last frame, be it stale, or since the first tick if none came: what a lease lives on.
    pub fn unheard_s(&self, now: Timestamp) -> f64 {
        self.since_s(now, self.heard_at.map(|at| now.since(at)))
    }

    fn since_s(&self, now: Timestamp, age: Option<Duration>) -> f64 {
        let since_start = || self.first_step.map(|first| now.since(first));
        age.or_else(since_start).unwrap_or_default().as_secs_f64()
    }

    /// Lease under which this tool works.
    pub fn lease(&self) -> u32 {
        self.frame.header.lease
    }

    /// The scheme in force.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// The value that ended this loop, if one did.
    pub fn fault(&self) -> Option<Implausible> {
        self.fault
    }

    /// Counts of what came from the handle side.
    pub fn arrivals(&self) -> ArrivalCounts {
        self.arrivals.counts()
    }

    /// Round trip as seen from here.
    pub fn round_trip(&self) -> &RoundTrip {
        &self.round_trip
    }

    /// Distance between the tool and the image of the handle at one instant, over the axes that reflect force, m: when
    /// the handle's newest frame was sent, by the handle's own stamp and what is known of the offset of the clocks.
    /// Where that is nothing yet, the tool as it is now.
    pub fn coordination_m(&self) -> f64 {
        let sent_ns = self.handle.sent_ns();
        let then = self.round_trip.ours_ns(sent_ns);
        let tool = then.and_then(|instant_ns| self.track.at(instant_ns));
        self.apart_m(self.handle.position(), tool.unwrap_or(self.position))
    }

    /// Distance between the tool as it is now and the image of a handle position, over the axes that reflect force, m.
    pub fn distance_from_m(&self, handle_position_m: [f64; 3]) -> f64 {
        self.apart_m(handle_position_m.into(), self.position)
    }

    fn apart_m(&self, handle: Vec3, tool: Vec3) -> f64 {
        let error = handle * self.model.coupling().position_ratio - tool;
        (0..self.model.axes)
            .map(|axis| error[axis] * error[axis])
            .sum::<f64>()
            .sqrt()
    }

    fn expect_gaps(&mut self) {
        let longest = self.deadband.as_ref().map(Deadband::heartbeat);
        self.controller.expect_gaps(longest, self.handle.velocity());
    }
}
