//! The tool side of the loop: one pure step a tick.
//!
//! ```text
//! frames ─> input check ─> scheme's reference ─> gate ─> G_t^-1 ─v_t─> G_t ─y_t─> clay: cut, contact, reaction ─> frame
//! ```
//!
//! The gate ([`teleclay_link::travel`]) is where motion stops: it follows the scheme's reference step by step while frames come, and holds the tool
//! while they do not, while the session is paused and after a fault. Where the handle has cut a copy of the clay, its sweeps are merged instead
//! ([`teleclay_link::scheme::replica`]).

use std::sync::Arc;

use teleclay_clay::{Clay, ContactState, Material, Motion, Pose};
use teleclay_control::State;
use teleclay_link::Vec3;
use teleclay_link::arrivals::{Arrival, ArrivalCounts, Arrivals};
use teleclay_link::deadband::{Deadband, DeadbandError, DeadbandSettings};
use teleclay_link::replica::{Cut, Workplace};
use teleclay_link::round_trip::RoundTrip;
use teleclay_link::safety::{NotFinite, Watchdog, check};
use teleclay_link::scheme::replica::{Merged, Site, Turn};
use teleclay_link::scheme::{ToolEnd, ToolPort, tool_end};
use teleclay_link::time::Timestamp;
use teleclay_link::travel::{Travel, Wish};
use teleclay_proto::Scheme;
use teleclay_proto::frame::{Engagement, HandleFrame, Header, LoopStatus, ToolFrame};
use teleclay_proto::join::LoopParameters;

use crate::parameters::{LoopModel, ParameterError};
use crate::tool_view::{Seen, ToolView};

/// Cuts that one tick can make: its own or, where sweeps are merged, as many as a tick may merge.
pub(crate) const CUTS_A_TICK: usize = 64;

/// Whether the session lets its tools work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Permission {
    /// Tools work.
    Work,
    /// The session is paused.
    Pause,
    /// The session is in fault.
    Fault,
}

/// What one step did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolStep {
    /// What was removed, in units of 1/255 voxel.
    pub removed_units: u64,
    /// Engaged area, m².
    pub engaged_area_m2: f64,
}

/// The tool side of one tool's loop.
pub struct ToolSide {
    model: LoopModel,
    end: Box<dyn ToolEnd>,
    scheme: Scheme,
    contact: ContactState,
    /// Internal model of the inverse, and the plant itself, axis by axis, both as displacement from `base`.
    inverse: [State; 3],
    plant: [State; 3],
    base: Vec3,
    position: Vec3,
    velocity: Vec3,
    travel: Travel,
    /// Whether the handle's sweeps led in the last tick.
    was_led: bool,
    /// What was cut in the last tick.
    cuts: Vec<Cut>,
    clay_force: Vec3,
    lift: f64,
    watchdog: Watchdog,
    first_step: Option<Timestamp>,
    permission_gain: f64,
    arrivals: Arrivals,
    round_trip: RoundTrip,
    engaged: bool,
    left: bool,
    fault: Option<NotFinite>,
    seen: Seen,
    frame: ToolFrame,
    deadband: Option<Deadband>,
    /// Status, scheme and revision as last sent.
    announced: Option<(LoopStatus, Scheme, u16)>,
    is_due: bool,
}

impl ToolSide {
    /// At rest at home, under `lease`.
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
        let mut side = Self {
            end: tool_end(
                parameters.scheme,
                &model.ground,
                Turn {
                    since_revision: parameters.revision,
                    epoch: 0,
                },
            ),
            scheme: parameters.scheme,
            contact: ContactState::default(),
            inverse: [State::default(); 3],
            plant: [State::default(); 3],
            base: Vec3::zeros(),
            position: Vec3::zeros(),
            velocity: Vec3::zeros(),
            travel: Travel::new(model.workplace().travel),
            was_led: false,
            cuts: Vec::with_capacity(CUTS_A_TICK),
            clay_force: Vec3::zeros(),
            lift: 0.0,
            watchdog: Watchdog::new(model.watchdog),
            first_step: None,
            permission_gain: 0.0,
            arrivals: Arrivals::default(),
            round_trip: RoundTrip::default(),
            engaged: false,
            left: false,
            fault: None,
            seen: Seen::at_rest(model.workplace().home),
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

    /// From now on leaves out frames that the other side would not miss; see [`teleclay_link::deadband`].
    ///
    /// # Errors
    /// The settings are none for this loop; nothing changes.
    pub fn code_perceptually(&mut self, settings: DeadbandSettings) -> Result<(), DeadbandError> {
        self.deadband = Some(Deadband::new(settings, self.model.watchdog.silence)?);
        self.expect_gaps();
        Ok(())
    }

    /// From now on leaves out the frames whose change is below this share of what is felt, and takes it that the handle does so too; 0 sends every one.
    ///
    /// # Errors
    /// There is no such share; nothing changes.
    pub fn set_deadband(&mut self, fraction: f64) -> Result<(), DeadbandError> {
        self.deadband = self.model.deadband(fraction)?;
        self.expect_gaps();
        Ok(())
    }

    fn expect_gaps(&mut self) {
        let longest = self.deadband.as_ref().map(Deadband::heartbeat);
        self.end.expect_gaps(longest, self.seen.handle_velocity());
    }

    /// A frame came from the handle side. Frames under another lease are not ours; older ones are counted, and shown to a scheme that
    /// plays its samples in order.
    pub fn on_frame(&mut self, now: Timestamp, frame: &HandleFrame) {
        let header = &frame.header;
        if header.lease != self.frame.header.lease {
            return;
        }
        let arrival = self.arrivals.on_sequence(header.sequence);
        let corrections = &frame.corrections;
        let scalars = [
            corrections.moved_n,
            corrections.largest_step_n.into(),
            corrections.injected_j.into(),
            corrections.tank_j.into(),
        ];
        let outside = [
            ("position_m", &frame.position_m[..]),
            ("velocity_m_s", &frame.velocity_m_s),
            ("hand_force_n", &frame.hand_force_n),
            ("felt_force_n", &frame.felt_force_n),
            ("wave", &frame.wave),
            ("wave_integral", &frame.wave_integral),
            ("energy_in_j", &frame.energy_in_j),
            ("corrections.held_n", &corrections.held_n.map(f64::from)),
            ("corrections", &scalars),
        ];
        if let Err(fault) = check(&outside) {
            self.fault = Some(fault);
            return;
        }
        if arrival != Arrival::Newest {
            self.end.on_straggler(now, frame);
            return;
        }
        self.round_trip
            .on_frame(now, header.sent_ns, header.echo_ns, header.echo_hold_ns);
        self.watchdog.on_frame(now);
        self.left = frame.engagement == Engagement::Leaving;
        self.seen
            .on_frame(frame, self.model.watchdog.silence.as_secs_f64());
        self.lift = frame.position_m[2];
        if !self.engaged {
            self.engaged = true;
            // The handle's own force ramps up from zero at the start, so nothing here needs to.
            self.watchdog.start_awake(now);
            self.permission_gain = 1.0;
            self.reindex();
        }
        self.end.on_frame(now, frame);
    }

    /// One tick in this clay.
    pub fn step(
        &mut self,
        now: Timestamp,
        clay: &mut Clay,
        material: &Material,
        permission: Permission,
    ) -> ToolStep {
        self.first_step.get_or_insert(now);
        let tick_s = self.model.tick_s();
        let status = self.status(permission);
        let gain = self.gain(now, permission);
        let port = self.port();
        self.cuts.clear();
        let site = Site {
            clay,
            material,
            contact: &mut self.contact,
            status,
            cuts: &mut self.cuts,
        };
        let step = match self.end.merge(now, &port, site) {
            Some(merged) => self.adopt(&merged),
            None => {
                self.stop_being_led();
                let wanted = self.gate(now, &port, gain);
                let before = self.position;
                self.follow(wanted);
                self.velocity = (self.position - before) / tick_s;
                let step = self.work(before, clay, material);
                let port = self.port();
                self.end.moved(&port);
                step
            }
        };
        self.seen.on_step(
            self.model.workplace().home + self.position,
            self.velocity,
            self.clay_force,
            tick_s,
        );
        self.fill_frame(now, status, step);
        step
    }

    /// Whether the handle's sweeps led the tool in the last tick.
    pub fn is_led(&self) -> bool {
        self.was_led
    }

    /// What was cut in the last tick.
    pub fn cuts(&self) -> &[Cut] {
        &self.cuts
    }

    /// Another tool has cut the clay.
    pub fn relay(&mut self, cut: Cut) {
        self.end.relay(cut);
    }

    /// The frame of the last step, whether it goes out or not.
    pub fn frame(&self) -> &ToolFrame {
        &self.frame
    }

    /// The frame to be sent now, if the last step made one that the other side would miss. Without perceptual coding every step does.
    pub fn frame_to_send(&self) -> Option<&ToolFrame> {
        self.is_due.then_some(&self.frame)
    }

    /// The tool and the handle as seen from here.
    pub fn view(&self) -> &ToolView {
        self.seen.view()
    }

    /// Puts the tool where the handle is, at rest, without cutting on the way; for a fresh block, and for the first frame.
    pub fn reindex(&mut self) {
        let handle = self.seen.handle_position();
        self.end.reindex(handle);
        let place = self
            .travel
            .put(handle * self.model.coupling().position_ratio);
        self.base = place;
        self.position = place;
        self.velocity = Vec3::zeros();
        self.was_led = false;
        self.inverse = [State::default(); 3];
        self.plant = [State::default(); 3];
        self.contact = ContactState::default();
        self.clay_force = Vec3::zeros();
    }

    /// Changes the scheme; the tool goes on from where it stands. `turn` says from which revision of the parameters on frames are meant for it.
    pub fn change_scheme(&mut self, scheme: Scheme, turn: Turn) {
        if scheme == self.scheme {
            self.frame.header.revision = turn.since_revision;
            return;
        }
        self.stop_being_led();
        let mut end = tool_end(scheme, &self.model.ground, turn);
        end.reindex(self.seen.handle_position());
        self.end = end;
        self.expect_gaps();
        self.scheme = scheme;
        self.travel.forget_reference();
        let header = self.frame.header;
        self.frame = ToolFrame {
            header: Header {
                revision: turn.since_revision,
                clay_epoch: turn.epoch,
                ..header
            },
            ..ToolFrame::default()
        };
    }

    /// The clay was exchanged for a fresh block: the tool goes to where its handle is, without cutting, and a fault is over.
    pub fn start_on_fresh_block(&mut self, turn: Turn) {
        self.fault = None;
        self.frame.header.revision = turn.since_revision;
        self.frame.header.clay_epoch = turn.epoch;
        self.end.on_fresh_block(turn.epoch);
        self.reindex();
    }

    /// Another place or tool, from the fresh block on that follows. Gives back what was, to be dropped elsewhere.
    pub fn move_to(&mut self, workplace: Arc<Workplace>) -> Arc<Workplace> {
        self.travel.limit(workplace.travel);
        self.end.move_to(&workplace);
        std::mem::replace(&mut self.model.ground.workplace, workplace)
    }

    /// The parameters have this revision now, and the scheme works on this block; for a tool that was just seated.
    pub fn take_up(&mut self, turn: Turn) {
        self.frame.header.revision = turn.since_revision;
        self.frame.header.clay_epoch = turn.epoch;
        self.end.on_fresh_block(turn.epoch);
    }

    /// The parameters have this revision now.
    pub fn set_revision(&mut self, revision: u16) {
        self.frame.header.revision = revision;
    }

    /// Whether frames come.
    pub fn is_connected(&self, now: Timestamp) -> bool {
        self.engaged && !self.left && !self.watchdog.is_silent(now)
    }

    /// Whether the operator said goodbye.
    pub fn has_left(&self) -> bool {
        self.left
    }

    /// Time since the last frame, or since the first tick if none came.
    pub fn silence_s(&self, now: Timestamp) -> f64 {
        let since_start = || self.first_step.map(|first| now.since(first));
        let silence = self.watchdog.age(now).or_else(since_start);
        silence.unwrap_or_default().as_secs_f64()
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
    pub fn fault(&self) -> Option<NotFinite> {
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

    /// Distance between the tool and the image of the handle as last received, over the axes that reflect force, m.
    pub fn coordination_m(&self) -> f64 {
        self.distance_from_m(self.seen.view().handle_position_m)
    }

    /// Distance between the tool and the image of a handle position, over the axes that reflect force, m.
    pub fn distance_from_m(&self, handle_position_m: [f64; 3]) -> f64 {
        let wanted = Vec3::from(handle_position_m) * self.model.coupling().position_ratio;
        let error = wanted - self.position;
        (0..self.model.axes)
            .map(|axis| error[axis] * error[axis])
            .sum::<f64>()
            .sqrt()
    }

    /// The port after the last displacement and the clay's answer to it.
    fn port(&self) -> ToolPort {
        ToolPort {
            position: self.position,
            velocity: self.model.reflected(self.velocity),
            clay_force: self.model.reflected(self.clay_force),
            spring_force: self.model.reflected(self.contact.force_n().into()),
            displacement: self.model.reflected(self.velocity * self.model.tick_s()),
        }
    }

    /// How far the gate stands open, 0 to 1.
    fn gain(&mut self, now: Timestamp, permission: Permission) -> f64 {
        let tick_s = self.model.tick_s();
        let change = tick_s / self.model.workplace().ramp_s;
        let may_work = permission == Permission::Work && self.fault.is_none();
        self.permission_gain =
            (self.permission_gain + if may_work { change } else { -change }).clamp(0.0, 1.0);
        self.watchdog.step(now, tick_s) * self.permission_gain
    }

    /// Where the tool may go in this tick.
    fn gate(&mut self, now: Timestamp, port: &ToolPort, gain: f64) -> Vec3 {
        let ratio = self.model.coupling().position_ratio;
        let wish = Wish {
            reference: self.end.reference(now, port, gain),
            recovery: self.end.recovery(),
            lift_m: self
                .model
                .workplace()
                .is_lifted
                .then_some(self.lift * ratio),
        };
        self.travel.step(wish, gain)
    }

    /// The handle's sweeps lead: the tool is where they put it.
    fn adopt(&mut self, merged: &Merged) -> ToolStep {
        self.was_led = true;
        self.position = merged.displacement;
        self.velocity = merged.velocity;
        self.clay_force = merged.force;
        if merged.newest.is_some() {
            let felt = self
                .model
                .coupling()
                .felt(self.model.reflected(merged.force));
            self.seen.answers(felt);
        }
        ToolStep {
            removed_units: merged.removed_units,
            engaged_area_m2: merged.engaged_area_m2,
        }
    }

    /// From here on the tool moves by itself again, from where it stands.
    fn stop_being_led(&mut self) {
        if !std::mem::take(&mut self.was_led) {
            return;
        }
        self.base = self.travel.put(self.position);
        self.position = self.base;
        self.velocity = Vec3::zeros();
        self.inverse = [State::default(); 3];
        self.plant = [State::default(); 3];
        self.seen.hides_nothing();
        self.end.reindex(self.seen.handle_position());
    }

    /// Drives the tool's plant to `wanted` by way of its inverse: the `G_t^-1` of [KHMH03] (31) and (32).
    fn follow(&mut self, wanted: Vec3) {
        let inverse = &self.model.tool_inverse;
        for axis in 0..self.model.axes {
            let command = inverse.step(&mut self.inverse[axis], wanted[axis] - self.base[axis]);
            inverse.plant().advance(&mut self.plant[axis], command);
            self.position[axis] = self.base[axis] + inverse.plant().output(&self.plant[axis], 0.0);
        }
        if self.model.axes < 3 {
            self.position.z = wanted.z;
        }
    }

    fn work(&mut self, before: Vec3, clay: &mut Clay, material: &Material) -> ToolStep {
        let pose = |displacement: Vec3| {
            Pose::quantise((self.model.workplace().home + displacement).into())
        };
        let motion = pose(before).and_then(|from| Ok((from, pose(self.position)?)));
        let motion = motion
            .ok()
            .and_then(|(from, to)| Motion::new(from, to, self.velocity.into()).ok());
        // Reach and speed limit keep every motion within bounds; one that is not would be a plant that ran away.
        let Some(motion) = motion else {
            self.fault = Some(NotFinite {
                field: "tool position_m",
            });
            return ToolStep::default();
        };
        let worked = clay.work(
            &self.model.workplace().tool,
            material,
            &motion,
            &mut self.contact,
        );
        self.clay_force = Vec3::from(worked.response.force_n);
        if motion.from() != motion.to() || 0 < worked.removed_units {
            self.cuts.push(Cut {
                from: motion.from(),
                to: motion.to(),
            });
        }
        ToolStep {
            removed_units: worked.removed_units,
            engaged_area_m2: worked.response.engaged_area_m2,
        }
    }

    fn status(&self, permission: Permission) -> LoopStatus {
        match permission {
            _ if self.fault.is_some() => LoopStatus::Fault,
            Permission::Fault => LoopStatus::Fault,
            Permission::Pause => LoopStatus::Paused,
            Permission::Work if self.engaged => LoopStatus::Running,
            Permission::Work => LoopStatus::Idle,
        }
    }

    fn fill_frame(&mut self, now: Timestamp, status: LoopStatus, step: ToolStep) {
        let (echo_ns, echo_hold_ns) = self.round_trip.echo(now);
        let header = &mut self.frame.header;
        header.sent_ns = now.as_nanos();
        header.echo_ns = echo_ns;
        header.echo_hold_ns = echo_hold_ns;
        header.scheme = self.scheme;
        // A fault that this very tick brought is told at once.
        self.frame.status = if self.fault.is_some() {
            LoopStatus::Fault
        } else {
            status
        };
        self.frame.position_m = self.seen.view().position_m;
        self.frame.velocity_m_s = self.seen.view().velocity_m_s;
        self.frame.force_n = self.seen.view().force_n;
        self.frame.engaged_area_m2 = step.engaged_area_m2;
        self.end.fill(&mut self.frame);
        self.seen.refused(self.frame.sweeps_refused);
        self.number_frame(now);
    }

    /// Decides whether the frame goes out. Numbers count the frames that do.
    fn number_frame(&mut self, now: Timestamp) {
        let announcement = (self.frame.status, self.scheme, self.frame.header.revision);
        self.is_due = match &mut self.deadband {
            Some(deadband) => {
                if self.announced != Some(announcement) {
                    deadband.insist();
                }
                if self.end.has_urgent_news() {
                    deadband.insist();
                }
                deadband.should_send(now, self.end.signal(&self.frame))
            }
            None => true,
        };
        if self.is_due {
            self.end.on_sent(&self.frame);
            self.announced = Some(announcement);
            self.frame.header.sequence = self.frame.header.sequence.wrapping_add(1);
        }
    }
}
