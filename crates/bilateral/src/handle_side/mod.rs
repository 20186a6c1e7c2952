//! The handle side of the loop: one pure step a tick.
//!
//! ```text
//! device sample ─> input check ─> scheme's reaction ─> ramps ─> limiter ─> + hand force ─> C_h1 ─> position command v_h
//! ```
//!
//! `v_h = C_h1 (f_h + reaction)`: for force exchange that is [KHMH03] (21) with (30). The command starts at the place
//! where the device stands when the loop takes over, so taking over moves nothing.

mod felt;
mod frames;

use std::sync::Arc;

use teleclay_clay::Clay;
use teleclay_control::State;
use teleclay_device::DeviceSample;
use teleclay_link::Vec3;
use teleclay_link::arrivals::{ArrivalCounts, Arrivals};
use teleclay_link::deadband::{Deadband, DeadbandError, DeadbandSettings};
use teleclay_link::freshness::Freshness;
use teleclay_link::replica::ToolSetup;
use teleclay_link::round_trip::RoundTrip;
use teleclay_link::safety::{ForceLimiter, Implausible, Measure, Persistence, Watchdog, check};
use teleclay_link::scheme::replica::{Snapshot, WantedSnapshot};
use teleclay_link::scheme::{
    ClayCopy, Controllers, HandleController, HandlePort, SchemeContext, handle_controller,
};
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{CopyState, Engagement, HandleFrame, Header, LoopStatus};
use teleclay_proto::join::LoopParameters;

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
    /// The silence lasts: the copy is no longer cut, and its force fades.
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
        /// The controller that is no longer used.
        _controller: Box<dyn HandleController>,
    },
    /// A copy of the clay.
    Clay {
        /// The copy that is no longer used.
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
///    [`renew`](Self::renew), [`leave`](Self::leave); then [`step`](Self::step), a tick.
/// 3. What the step gives: [`frame_to_send`](Self::frame_to_send), then [`poll_retired`](Self::poll_retired) until it
///    gives nothing more.
/// 4. Everything else is a getter; [`wanted_snapshot`](Self::wanted_snapshot) and
///    [`wanted_controller`](Self::wanted_controller) say what to bring.
///
/// None of these allocates, but for [`code_perceptually`](Self::code_perceptually), [`restock`](Self::restock), [`new`](Self::new)
/// and [`with_controllers`](Self::with_controllers).
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
    freshness: Freshness,
    /// Of what the scheme makes: the watchdog's, or full where the scheme needs no frames.
    remote_gain: f64,
    needed_frames: bool,
    status_gain: f64,
    /// Of what a copy makes that nobody has confirmed for long.
    stale_gain: f64,
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
    /// Frames under another lease are numbered anew.
    is_renewed: bool,
    fault: Option<Implausible>,
    persistence: Persistence,
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
        Self::with_controllers(parameters, lease, &parameters.scheme)
    }

    /// Likewise, with a controller that was made elsewhere. Its frames go under the word of the parameters' scheme, and
    /// it takes in those that come under that word.
    ///
    /// # Errors
    /// The parameters make no loop.
    pub fn with_controllers(
        parameters: &LoopParameters,
        lease: Lease,
        controllers: &dyn Controllers,
    ) -> Result<Self, ParameterError> {
        let model = LoopModel::new(parameters)?;
        let header = Header {
            lease: lease.number,
            ownership_epoch: lease.ownership_epoch,
            scheme: parameters.scheme,
            revision: parameters.revision,
            ..Header::default()
        };
        let mut side = Self {
            controller: controllers.handle(&model.context),
            scheme: parameters.scheme,
            spares: [const { None }; Scheme::ALL.len()],
            scheme_since: 0,
            admittance: [State::default(); 3],
            origin: None,
            position: None,
            watchdog: Watchdog::new(model.watchdog),
            freshness: Freshness::new(model.watchdog.silence),
            remote_gain: 0.0,
            needed_frames: true,
            status_gain: 0.0,
            stale_gain: 1.0,
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
            is_renewed: false,
            fault: None,
            persistence: Persistence::default(),
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

    /// One tick.
    pub fn step(&mut self, now: Timestamp, sample: &DeviceSample) -> HandleStep {
        let measured = [
            (
                "device position_m",
                Measure::Position,
                &sample.position_m[..],
            ),
            (
                "device velocity_m_s",
                Measure::Velocity,
                &sample.velocity_m_s,
            ),
            ("device hand_force_n", Measure::Force, &sample.hand_force_n),
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

    /// The frame to be sent now, if the last step made one that the other side would miss. Without perceptual coding
    /// every step does.
    pub fn frame_to_send(&self) -> Option<&HandleFrame> {
        self.is_due.then_some(&self.frame)
    }

    /// The snapshot of the server's clay that is wanted here, if one is; a new number is a new request.
    pub fn wanted_snapshot(&self) -> Option<WantedSnapshot> {
        self.controller.clay_copy()?.wanted_snapshot()
    }

    /// A snapshot of the server's clay. One that no scheme here has a use for waits to be dropped, see
    /// [`HandleSide::poll_retired`].
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

    /// The tool side is known to have gone, by other means than its silence: the force ramps to zero whatever the
    /// scheme, until a frame that arrives later than `now` by more than the allowed silence shows that it is there.
    pub fn handle_peer_gone(&mut self, now: Timestamp) {
        self.gone_since = Some(now);
    }

    /// Goes on under another lease of the same session, with the copy of the clay and every sweep that is not durable:
    /// after a server was lost, or a lease. The first frame under it already says that nothing is known to have come.
    pub fn renew(&mut self, lease: Lease) {
        self.forget_peer();
        self.frame.header.lease = lease.number;
        self.frame.header.ownership_epoch = lease.ownership_epoch;
        self.is_renewed = true;
        self.gone_since = None;
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
    pub fn fault(&self) -> Option<Implausible> {
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
}
