//! The tool side of the loop: one pure step a tick.
//!
//! ```text
//! frames ─> input check ─> scheme's reference ─> gate ─> G_t^-1 ─v_t─> G_t ─y_t─> clay: cut, contact, reaction ─> frame
//! ```
//!
//! The gate is where motion stops: it follows the scheme's reference step by step while frames come, and holds the tool while they do
//! not, while the session is paused and after a fault. Nothing that arrives late is made up for: after a hold the tool goes on from where
//! it stands, and where the scheme's reference is a place rather than a sum of increments, it returns there at [`RECOVERY_SPEED_M_S`].

use teleclay_clay::{Clay, ContactState, Material, Motion, Pose, Tool, ToolShape};
use teleclay_control::State;
use teleclay_link::Vec3;
use teleclay_link::arrivals::{Arrival, ArrivalCounts, Arrivals};
use teleclay_link::round_trip::RoundTrip;
use teleclay_link::safety::{NotFinite, Watchdog, capped, check};
use teleclay_link::scheme::{Recovery, ToolEnd, ToolPort, tool_end};
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{Engagement, HandleFrame, Header, LoopStatus, ToolFrame};
use teleclay_proto::join::LoopParameters;

use crate::parameters::{LoopModel, ParameterError};

/// After a hold the tool returns to the handle's place at this speed, m/s: seen coming, and slow enough for any clay here.
pub const RECOVERY_SPEED_M_S: f64 = 0.05;
/// The lift of a two-axis session moves the tool no faster than this, m/s.
const LIFT_SPEED_M_S: f64 = 0.1;

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

/// What a watcher may want to know of a tool; all at the last step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolView {
    /// Tool in the clay frame, m.
    pub position_m: [f64; 3],
    /// Its velocity, m/s.
    pub velocity_m_s: [f64; 3],
    /// Force of the clay on it, N.
    pub force_n: [f64; 3],
    /// Handle as last received: displacement from home, m.
    pub handle_position_m: [f64; 3],
    /// Handle's velocity as last received, m/s.
    pub handle_velocity_m_s: [f64; 3],
    /// Hand's force as last received, N.
    pub hand_force_n: [f64; 3],
    /// Force felt by the hand as last received, N.
    pub felt_force_n: [f64; 3],
    /// Energy that the hand put into the channel, from the frames received, J.
    pub energy_handle_j: f64,
    /// Energy that the tool put into the clay, J.
    pub energy_tool_j: f64,
}

/// The tool side of one tool's loop.
pub struct ToolSide {
    model: LoopModel,
    end: Box<dyn ToolEnd>,
    scheme: Scheme,
    tool: Tool,
    contact: ContactState,
    /// Internal model of the inverse, and the plant itself, axis by axis, both as displacement from `base`.
    inverse: [State; 3],
    plant: [State; 3],
    base: Vec3,
    position: Vec3,
    velocity: Vec3,
    gated: Vec3,
    reference: Option<Vec3>,
    clay_force: Vec3,
    lift: f64,
    watchdog: Watchdog,
    permission_gain: f64,
    arrivals: Arrivals,
    round_trip: RoundTrip,
    engaged: bool,
    left: bool,
    fault: Option<NotFinite>,
    view: ToolView,
    frame: ToolFrame,
}

impl ToolSide {
    /// At rest at home, under `lease`.
    ///
    /// # Errors
    /// The parameters make no loop.
    pub fn new(
        parameters: &LoopParameters,
        lease: u32,
        shape: ToolShape,
    ) -> Result<Self, ParameterError> {
        let model = LoopModel::new(parameters)?;
        let header = Header {
            lease,
            scheme: parameters.scheme,
            revision: parameters.revision,
            ..Header::default()
        };
        let mut side = Self {
            end: tool_end(parameters.scheme, &model.coupling)?,
            scheme: parameters.scheme,
            tool: Tool::new(shape),
            contact: ContactState::default(),
            inverse: [State::default(); 3],
            plant: [State::default(); 3],
            base: Vec3::zeros(),
            position: Vec3::zeros(),
            velocity: Vec3::zeros(),
            gated: Vec3::zeros(),
            reference: None,
            clay_force: Vec3::zeros(),
            lift: 0.0,
            watchdog: Watchdog::new(model.watchdog),
            permission_gain: 0.0,
            arrivals: Arrivals::default(),
            round_trip: RoundTrip::default(),
            engaged: false,
            left: false,
            fault: None,
            view: ToolView::default(),
            frame: ToolFrame {
                header,
                ..ToolFrame::default()
            },
            model,
        };
        side.view.position_m = side.model.home.into();
        Ok(side)
    }

    /// A frame came from the handle side. Frames under another lease are not ours; older ones are only counted.
    pub fn on_frame(&mut self, now: Timestamp, frame: &HandleFrame) {
        let header = &frame.header;
        if header.lease != self.frame.header.lease
            || self.arrivals.on_sequence(header.sequence) != Arrival::Newest
        {
            return;
        }
        let outside = [
            ("position_m", &frame.position_m[..]),
            ("velocity_m_s", &frame.velocity_m_s),
            ("hand_force_n", &frame.hand_force_n),
            ("felt_force_n", &frame.felt_force_n),
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
        self.left = frame.engagement == Engagement::Leaving;
        self.view_handle(frame);
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
        let tick_s = self.model.tick_s();
        let wanted = self.gate(now, permission);
        let before = self.position;
        self.follow(wanted);
        self.velocity = (self.position - before) / tick_s;
        let step = self.work(before, clay, material);
        self.view_tool(tick_s);
        self.fill_frame(now, clay, permission, step);
        step
    }

    /// The frame of the last step, to be sent now.
    pub fn frame(&self) -> &ToolFrame {
        &self.frame
    }

    /// The tool and the handle as seen from here.
    pub fn view(&self) -> &ToolView {
        &self.view
    }

    /// Puts the tool where the handle is, at rest, without cutting on the way; for a fresh block, and for the first frame.
    pub fn reindex(&mut self) {
        let handle = Vec3::from(self.view.handle_position_m);
        self.end.reindex(handle);
        let mut place = handle * self.model.coupling.position_ratio;
        for axis in 0..3 {
            place[axis] = self.within_reach(axis, place[axis]);
        }
        self.base = place;
        self.position = place;
        self.gated = place;
        self.velocity = Vec3::zeros();
        self.reference = None;
        self.inverse = [State::default(); 3];
        self.plant = [State::default(); 3];
        self.contact = ContactState::default();
        self.clay_force = Vec3::zeros();
    }

    /// Changes the scheme; the tool goes on from where it stands.
    ///
    /// # Errors
    /// The scheme is not available; nothing changes.
    pub fn change_scheme(&mut self, scheme: Scheme) -> Result<(), ParameterError> {
        let mut end = tool_end(scheme, &self.model.coupling)?;
        end.reindex(Vec3::from(self.view.handle_position_m));
        self.end = end;
        self.scheme = scheme;
        self.reference = None;
        Ok(())
    }

    /// Whether frames come.
    pub fn is_connected(&self, now: Timestamp) -> bool {
        self.engaged && !self.left && !self.watchdog.is_silent(now)
    }

    /// Whether the operator said goodbye.
    pub fn has_left(&self) -> bool {
        self.left
    }

    /// Time since the last frame, or since the start if none came.
    pub fn silence_s(&self, now: Timestamp) -> f64 {
        self.watchdog
            .age(now)
            .map_or(now.as_secs_f64(), |age| age.as_secs_f64())
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

    /// Starts afresh after a fault, with a fresh block.
    pub(crate) fn clear_fault(&mut self) {
        self.fault = None;
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
        let wanted = Vec3::from(self.view.handle_position_m) * self.model.coupling.position_ratio;
        let error = wanted - self.position;
        (0..self.model.axes)
            .map(|axis| error[axis] * error[axis])
            .sum::<f64>()
            .sqrt()
    }

    /// Where the tool may go in this tick.
    fn gate(&mut self, now: Timestamp, permission: Permission) -> Vec3 {
        let tick_s = self.model.tick_s();
        let change = tick_s / self.model.ramp_s;
        let may_work = permission == Permission::Work && self.fault.is_none();
        self.permission_gain =
            (self.permission_gain + if may_work { change } else { -change }).clamp(0.0, 1.0);
        let gain = self.watchdog.step(now, tick_s) * self.permission_gain;

        let port = ToolPort {
            position: self.position,
            velocity: self.velocity,
            clay_force: self.clay_force,
        };
        let reference = self.end.reference(now, &port, gain);
        let increment = self
            .reference
            .map_or_else(Vec3::zeros, |before| reference - before);
        self.reference = Some(reference);

        let mut next = self.gated + increment * gain;
        if self.end.recovery() == Recovery::Absolute {
            next += capped(reference - next, RECOVERY_SPEED_M_S * tick_s) * gain;
        }
        if self.model.axes < 3 {
            let lift = self.lift * self.model.coupling.position_ratio;
            let most = LIFT_SPEED_M_S * tick_s * gain;
            next.z = self.gated.z + (lift - self.gated.z).clamp(-most, most);
        }
        next = self.gated + capped(next - self.gated, self.model.speed_limit_m_s * tick_s);
        for axis in 0..3 {
            next[axis] = self.within_reach(axis, next[axis]);
        }
        self.gated = next;
        next
    }

    /// Drives the tool's plant to `wanted` by way of its inverse: [KHMH03] (31)–(32) end here.
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
        let pose = |displacement: Vec3| Pose::quantise((self.model.home + displacement).into());
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
        let worked = clay.work(&self.tool, material, &motion, &mut self.contact);
        self.clay_force = Vec3::from(worked.response.force_n);
        ToolStep {
            removed_units: worked.removed_units,
            engaged_area_m2: worked.response.engaged_area_m2,
        }
    }

    fn within_reach(&self, axis: usize, displacement: f64) -> f64 {
        let [least, greatest] = self
            .model
            .reach
            .map(|bound| bound[axis] - self.model.home[axis]);
        displacement.clamp(least, greatest)
    }

    fn view_handle(&mut self, frame: &HandleFrame) {
        let felt = Vec3::from(frame.felt_force_n);
        let velocity = Vec3::from(frame.velocity_m_s);
        let view = &mut self.view;
        view.energy_handle_j -= felt.dot(&velocity) * self.model.coupling.tick_s;
        view.handle_position_m = frame.position_m;
        view.handle_velocity_m_s = frame.velocity_m_s;
        view.hand_force_n = frame.hand_force_n;
        view.felt_force_n = frame.felt_force_n;
        self.lift = frame.position_m[2];
    }

    fn view_tool(&mut self, tick_s: f64) {
        self.view.position_m = (self.model.home + self.position).into();
        self.view.velocity_m_s = self.velocity.into();
        self.view.force_n = self.clay_force.into();
        self.view.energy_tool_j -= self.clay_force.dot(&self.velocity) * tick_s;
    }

    fn fill_frame(&mut self, now: Timestamp, clay: &Clay, permission: Permission, step: ToolStep) {
        let (echo_ns, echo_hold_ns) = self.round_trip.echo(now);
        let header = &mut self.frame.header;
        header.sequence = header.sequence.wrapping_add(1);
        header.sent_ns = now.as_nanos();
        header.echo_ns = echo_ns;
        header.echo_hold_ns = echo_hold_ns;
        header.scheme = self.scheme;
        self.frame.status = match permission {
            _ if self.fault.is_some() => LoopStatus::Fault,
            Permission::Fault => LoopStatus::Fault,
            Permission::Pause => LoopStatus::Paused,
            Permission::Work if self.engaged => LoopStatus::Running,
            Permission::Work => LoopStatus::Idle,
        };
        self.frame.position_m = self.view.position_m;
        self.frame.velocity_m_s = self.view.velocity_m_s;
        self.frame.force_n = self.view.force_n;
        self.frame.engaged_area_m2 = step.engaged_area_m2;
        let _ = clay;
        self.end.fill(&mut self.frame);
    }
}
