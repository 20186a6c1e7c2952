//! The handle side of the loop: one pure step a tick.
//!
//! ```text
//! device sample ─> input check ─> scheme's reaction ─> ramps ─> limiter ─> + hand force ─> C_h1 ─> position command v_h
//! ```
//!
//! `v_h = C_h1 (f_h + reaction)`: for force exchange that is [KHMH03] (21) with (30). The command starts at the place where the device stands when
//! the loop takes over, so taking over moves nothing.

use teleclay_control::State;
use teleclay_link::Vec3;
use teleclay_link::arrivals::{Arrival, ArrivalCounts, Arrivals};
use teleclay_link::round_trip::RoundTrip;
use teleclay_link::safety::{ForceLimiter, NotFinite, Watchdog, check};
use teleclay_link::scheme::{HandleEnd, HandlePort, handle_end};
use teleclay_link::time::Timestamp;
use teleclay_operator::DeviceSample;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{Engagement, HandleFrame, Header, LoopStatus, ToolFrame};
use teleclay_proto::join::LoopParameters;

use crate::parameters::{LoopModel, ParameterError};

/// A change of scheme or status is blended over this time, s: no change steps the force.
const BLEND_S: f64 = 0.05;

/// Why the hand feels nothing remote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// Frames come and the tool works.
    Live,
    /// No frame yet.
    NotYet,
    /// No frame for longer than the allowed silence.
    Silent,
    /// The session is paused.
    Paused,
    /// The tool side is in fault, or this side is (see [`HandleSide::fault`]).
    Fault,
}

/// What one step gives the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleStep {
    /// Position command `v_h`, m.
    pub command_m: [f64; 3],
    /// Force on the hand from the far side, N, after all limits.
    pub felt_force_n: [f64; 3],
    /// Whether that force is live, and if not, why.
    pub contact: Contact,
}

/// The handle side of one tool's loop.
pub struct HandleSide {
    model: LoopModel,
    end: Box<dyn HandleEnd>,
    scheme: Scheme,
    admittance: [State; 3],
    origin: Option<Vec3>,
    watchdog: Watchdog,
    status_gain: f64,
    /// Ramps up once, from the first step: taking over a handle that is being pushed moves it gently.
    start_gain: f64,
    blend: Vec3,
    blend_starts: bool,
    last_reaction: Vec3,
    limiter: ForceLimiter,
    arrivals: Arrivals,
    round_trip: RoundTrip,
    status: LoopStatus,
    fault: Option<NotFinite>,
    frame: HandleFrame,
}

impl HandleSide {
    /// At rest, under `lease`.
    ///
    /// # Errors
    /// The parameters make no loop.
    pub fn new(parameters: &LoopParameters, lease: u32) -> Result<Self, ParameterError> {
        let model = LoopModel::new(parameters)?;
        let header = Header {
            lease,
            scheme: parameters.scheme,
            revision: parameters.revision,
            ..Header::default()
        };
        Ok(Self {
            end: handle_end(parameters.scheme, &model.coupling)?,
            scheme: parameters.scheme,
            admittance: [State::default(); 3],
            origin: None,
            watchdog: Watchdog::new(model.watchdog),
            status_gain: 0.0,
            start_gain: 0.0,
            blend: Vec3::zeros(),
            blend_starts: false,
            last_reaction: Vec3::zeros(),
            limiter: ForceLimiter::new(model.limits),
            arrivals: Arrivals::default(),
            round_trip: RoundTrip::default(),
            status: LoopStatus::Idle,
            fault: None,
            frame: HandleFrame {
                header,
                engagement: Engagement::Engaged,
                ..HandleFrame::default()
            },
            model,
        })
    }

    /// A frame came from the tool side. Frames under another lease are not ours; older ones are only counted.
    pub fn on_frame(&mut self, now: Timestamp, frame: &ToolFrame) {
        let header = &frame.header;
        if header.lease != self.frame.header.lease
            || self.arrivals.on_sequence(header.sequence) != Arrival::Newest
        {
            return;
        }
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
        self.round_trip
            .on_frame(now, header.sent_ns, header.echo_ns, header.echo_hold_ns);
        self.watchdog.on_frame(now);
        self.status = frame.status;
        self.frame.header.clay_epoch = header.clay_epoch;
        self.frame.header.revision = header.revision;
        if header.scheme != self.scheme {
            self.change_scheme(header.scheme);
        }
        self.end.on_frame(now, frame);
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
        let port = HandlePort {
            position: Vec3::from(sample.position_m),
            velocity: Vec3::from(sample.velocity_m_s),
            hand_force: Vec3::from(sample.hand_force_n) * self.start_gain,
        };
        self.start_gain = (self.start_gain + self.model.tick_s() / self.model.ramp_s).min(1.0);
        let felt = self.felt_force(now, &port);
        let command = self.command(&port, felt);
        self.fill_frame(now, &port, felt);
        HandleStep {
            command_m: command.into(),
            felt_force_n: felt.into(),
            contact: self.contact(now),
        }
    }

    /// The frame of the last step, to be sent now.
    pub fn frame(&self) -> &HandleFrame {
        &self.frame
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

    /// The scheme in force.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// The value that ended this loop, if one did.
    pub fn fault(&self) -> Option<NotFinite> {
        self.fault
    }

    /// What the hand feels of the far side, and why not if it does not.
    pub fn contact(&self, now: Timestamp) -> Contact {
        if self.fault.is_some() || self.status == LoopStatus::Fault {
            return Contact::Fault;
        }
        if self.watchdog.age(now).is_none() {
            return Contact::NotYet;
        }
        if self.watchdog.is_silent(now) {
            return Contact::Silent;
        }
        if self.status == LoopStatus::Paused {
            Contact::Paused
        } else {
            Contact::Live
        }
    }

    fn felt_force(&mut self, now: Timestamp, port: &HandlePort) -> Vec3 {
        let tick_s = self.model.tick_s();
        let remote_gain = self.watchdog.step(now, tick_s);
        let change = tick_s / self.model.ramp_s;
        let works =
            matches!(self.status, LoopStatus::Running | LoopStatus::Idle) && self.fault.is_none();
        self.status_gain =
            (self.status_gain + if works { change } else { -change }).clamp(0.0, 1.0);

        let fresh = self.end.reaction(now, port);
        if std::mem::take(&mut self.blend_starts) {
            self.blend = self.last_reaction - fresh;
        }
        let reaction = fresh + self.blend;
        self.blend -= self.blend * (tick_s / BLEND_S);
        self.last_reaction = reaction;
        let mut wanted = reaction * (remote_gain * self.status_gain);
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
            let system = &self.model.coupling.admittance;
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
        header.sequence = header.sequence.wrapping_add(1);
        header.sent_ns = now.as_nanos();
        header.echo_ns = echo_ns;
        header.echo_hold_ns = echo_hold_ns;
        header.scheme = self.scheme;
        self.frame.position_m = port.position.into();
        self.frame.velocity_m_s = port.velocity.into();
        self.frame.hand_force_n = port.hand_force.into();
        self.frame.felt_force_n = felt.into();
        self.end.fill(&mut self.frame);
    }

    fn change_scheme(&mut self, scheme: Scheme) {
        // A scheme this side does not have: stay with the old one; the tool side sees which from the header and says so.
        let Ok(end) = handle_end(scheme, &self.model.coupling) else {
            return;
        };
        self.end = end;
        self.scheme = scheme;
        // What was felt fades into what the new end gives, instead of stepping there.
        self.blend_starts = true;
    }

    /// A step without a usable sample: the command stays, the force goes.
    fn hold(&mut self) -> HandleStep {
        let felt = self.limiter.step(Vec3::zeros(), self.model.tick_s());
        let header = &mut self.frame.header;
        header.sequence = header.sequence.wrapping_add(1);
        HandleStep {
            command_m: self.frame.position_m,
            felt_force_n: felt.into(),
            contact: Contact::Fault,
        }
    }
}
