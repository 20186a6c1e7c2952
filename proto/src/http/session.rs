//! A session: what it is told to be, and what it is.

use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use super::schema::Vector;
use super::{
    Axes, ClayHash, ClayShape, ClaySpec, Material, MaterialChoice, Network, Operation, Scheme,
    SessionId, Stop, ToolDescription,
};
use crate::frame::{CopyState, SweepRefusal};
use crate::validate::{FieldError, Validate, check, whole_within};
use crate::word::words;

/// Most operators of one session.
pub const MAX_TOOLS: u8 = 8;

/// Body of `POST /sessions`. Only `id` must be there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewSession {
    /// The session's name.
    pub id: SessionId,
    /// How many axes move.
    #[serde(default)]
    pub axes: Axes,
    /// The law that couples handle and tool.
    #[serde(default)]
    pub scheme: Scheme,
    /// What the clay resists with.
    #[serde(default)]
    #[schema(value_type = MaterialChoice, required = false)]
    pub material: Material,
    /// What happens to packets.
    #[serde(default)]
    pub network: Network,
    /// What the clay starts as.
    #[serde(default)]
    pub clay: ClaySpec,
    /// The tool of every operator.
    #[serde(default)]
    pub tool: ToolDescription,
    /// What every tool does to the clay. Under the `replica` scheme tools cut: it carries nothing else.
    #[serde(default, skip_serializing_if = "Operation::is_cut")]
    #[schema(required = false)]
    pub operation: Operation,
    /// Share of a force or velocity whose change the hand cannot feel: frames that change less are left out. 0 leaves
    /// none out; a hand notices 0.07.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 0.5, default = 0.0)]
    pub deadband: f64,
    /// How many operators may join.
    #[serde(default = "one", deserialize_with = "tools")]
    #[schema(minimum = 1, maximum = 8, default = 1)]
    pub tools: u8,
}

impl NewSession {
    /// A session with every default.
    #[must_use]
    pub fn new(id: SessionId) -> Self {
        Self {
            id,
            axes: Axes::default(),
            scheme: Scheme::default(),
            material: Material::default(),
            network: Network::default(),
            clay: ClaySpec::default(),
            tool: ToolDescription::default(),
            operation: Operation::default(),
            deadband: 0.0,
            tools: one(),
        }
    }
}

impl Validate for NewSession {
    fn validate(&self) -> Result<(), FieldError> {
        self.material.validate_under("/material")?;
        self.network.validate_under("/network")?;
        self.clay.validate_under("/clay")?;
        self.tool.validate_under("/tool")?;
        self.operation.check_under(self.scheme)?;
        check(
            "/deadband",
            self.deadband,
            0.0..=crate::scheme::MAX_DEADBAND,
        )?;
        if !(1..=MAX_TOOLS).contains(&self.tools) {
            return Err(FieldError::new(
                "/tools",
                format!("{} is not a number from 1 to {MAX_TOOLS}", self.tools),
            ));
        }
        Ok(())
    }
}

fn tools<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u8, D::Error> {
    whole_within(deserializer, 1..=MAX_TOOLS)
}

const fn one() -> u8 {
    1
}

/// A session as it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Session {
    /// Its name.
    pub id: SessionId,
    /// Counts the changes of the session. In the answer to a change: the revision that it made.
    pub revision: u64,
    /// The law that couples handle and tool.
    pub scheme: Scheme,
    /// How many axes move.
    pub axes: Axes,
    /// What the loop does.
    pub state: SessionState,
    /// Which tools are in fault, and why; `null` when none is.
    #[schema(required)]
    pub fault: Option<String>,
    /// Who has stopped the session, and why; `null` when nobody has. While it is stopped nobody holds a tool, and
    /// nobody gets one.
    #[schema(required)]
    pub stop: Option<Stop>,
    /// What the clay resists with.
    pub material: Material,
    /// What the link conditioner does to packets.
    pub network: Network,
    /// The clay.
    pub clay: ClayState,
    /// The shape of the tools.
    pub tool: ToolDescription,
    /// What the tools do to the clay.
    pub operation: Operation,
    /// Share of a force or velocity below which its change is not sent; 0 when every tick is.
    pub deadband: f64,
    /// Every tool, held or free, in the order of their `id`.
    pub tools: Vec<ToolState>,
    /// Tool displacement per handle displacement.
    pub position_ratio: f64,
    /// Greatest distance between a tool and where its handle would have it, m: both at the instant at which the handle
    /// sent its newest frame. With a delay that is the way that the hand makes meanwhile, and more.
    pub coordination_m: f64,
    /// What has become of the session's history on disk.
    pub storage: StorageReport,
    /// The loop and its link.
    #[serde(rename = "loop")]
    pub control_loop: LoopState,
}

/// What has become of a session's history on disk.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StorageReport {
    /// In a word.
    pub state: StorageState,
    /// Changes up to this revision outlive the process.
    pub durable_revision: u64,
    /// What the history takes on disk, bytes, as of a moment ago.
    pub bytes: u64,
    /// Why the disk does not take it; `null` where it does.
    #[schema(required)]
    pub reason: Option<String>,
}

words! {
    /// What has become of a session's history, in a word.
    #[derive(ToSchema)]
    #[schema(rename_all = "snake_case")]
    pub enum StorageState: "storage state" {
        /// All of it is on disk.
        Durable "durable",
        /// The last moments are on their way.
        Behind "behind",
        /// The disk does not take it: nothing is cut until it does.
        Failed "failed",
        /// The server keeps nothing.
        Ephemeral "ephemeral",
    }
}

words! {
    /// What a session's loop does.
    #[derive(Default, ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum SessionState: "session state" {
        /// No operator is engaged.
        #[default]
        Idle "idle",
        /// A tool works.
        Running "running",
        /// Somebody has paused the session.
        Paused "paused",
        /// No tool works, and one rests because a value came that it cannot work with; see [`Session::fault`].
        Fault "fault",
        /// Somebody has stopped it: every tool was taken away, and none is given; see [`Session::stop`].
        Stopped "stopped",
    }
}

/// The clay of a session. `initial = remaining + removed` holds exactly, in units and in m³.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ClayState {
    /// Edge of a voxel, m.
    pub voxel_size_m: f64,
    /// Volume of the fresh block, m³.
    pub initial_volume_m3: f64,
    /// Volume that is left, m³.
    pub remaining_volume_m3: f64,
    /// Volume that was cut, m³.
    pub removed_volume_m3: f64,
    /// Volume of the fresh block, in units.
    pub initial_units: u64,
    /// Volume that is left, in units.
    pub remaining_units: u64,
    /// Volume that was cut, in units.
    pub removed_units: u64,
    /// Volume of one unit, a 255th of a voxel, m³.
    pub unit_volume_m3: f64,
    /// Hash of all voxels.
    pub hash: ClayHash,
    /// What the block started as.
    pub shape: ClayShape,
    /// Counts the fresh blocks.
    pub epoch: u32,
}

/// A tool, and the operator who holds it if anybody does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolState {
    /// Its number within the session, from 1.
    pub id: u32,
    /// Who holds it; empty when it is free.
    pub operator: String,
    /// Whether frames come in.
    pub connected: bool,
    /// Who has asked the holder for it, the first one first.
    pub requests: Vec<String>,
    /// For whom it is kept for a moment, since its holder has handed it over; `null` when it is for nobody.
    #[schema(required)]
    pub reserved_for: Option<String>,
    /// Tool position in the clay's frame, m.
    #[schema(value_type = Vector)]
    pub position_m: [f64; 3],
    /// Force of the clay on the tool, N.
    #[schema(value_type = Vector)]
    pub force_n: [f64; 3],
    /// Handle position in the handle's frame, m.
    #[schema(value_type = Vector)]
    pub handle_position_m: [f64; 3],
    /// Reaction that the handle renders to the hand, N.
    #[schema(value_type = Vector)]
    pub felt_force_n: [f64; 3],
    /// Force of the hand on the handle, N.
    #[schema(value_type = Vector)]
    pub hand_force_n: [f64; 3],
    /// Tool position in the clay's frame when the handle is at its origin, m.
    #[schema(value_type = Vector)]
    pub home_m: [f64; 3],
    /// What the handle's copy of the clay is good for; `none` in schemes without one.
    pub copy: CopyState,
    /// Felt force less what the hand would feel of this clay's answer to the same motion, N: what a copy hid. Zero in
    /// schemes without one.
    #[schema(value_type = Vector)]
    pub hidden_force_n: [f64; 3],
    /// Cuts of this operator that the server did not take, since joining.
    pub sweeps_refused: u32,
    /// Why the newest of these was not taken; `none` where every one was.
    pub refusal: SweepRefusal,
    /// Number of the operator's newest sweep that is in the clay with all before it; 0 in schemes without a copy.
    pub sweeps_acknowledged: u32,
    /// Likewise, and on disk: the handle need not remember those.
    pub sweeps_durable: u32,
    /// What corrections of the copy have done to the hand.
    pub corrections: CorrectionsState,
}

/// What corrections of a handle's copy of the clay have done to the hand, since the copy was made; zeros without one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CorrectionsState {
    /// Corrections that changed the force on the tool.
    pub count: u32,
    /// How far they have moved the felt force, tick by tick and all told, N.
    pub moved_n: f64,
    /// Felt force less the force that the corrected copy gives, N: what is still to be let in.
    #[schema(value_type = Vector)]
    pub held_n: [f64; 3],
    /// Largest change of the felt force in one tick on account of corrections, N.
    pub largest_step_n: f64,
    /// Energy that corrections have brought into the hand, J.
    pub injected_j: f64,
    /// Energy that they may bring into it yet, J.
    pub tank_j: f64,
}

/// How the loop and its link do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LoopState {
    /// Ticks per second of the session's thread, counted over the last second or two; the loop aims at 1000. Ticks in
    /// which nothing could happen, since nobody held a tool, count whether or not they were made one by one.
    pub rate_hz: f64,
    /// Ticks since the session began.
    pub ticks: u64,
    /// Ticks of the session that started more than a whole tick after their time, since the server runs it.
    pub late_ticks: u64,
    /// What a tick of all sessions on the same thread together takes to compute, s.
    pub tick_s: TickQuantiles,
    /// The server's tick thread that the session lives on, from 0. Sessions move from thread to thread as their costs
    /// have it; hands feel nothing of it.
    pub thread: u32,
    /// What a tick of this session alone takes of its processor, s; of every fifth tick, and of none while it rests.
    pub own_tick_s: TickQuantiles,
    /// The 99th percentile of that, in parts of what all sessions on a thread may take of a tick.
    pub budget_share: f64,
    /// Round trip, s.
    pub rtt_s: Quantiles,
    /// Age of the newest frame whenever a tick used it, s.
    pub age_s: Quantiles,
    /// Frames from handles that had not come 128 frames later, since the session began.
    pub lost: u64,
    /// Frames from handles that came more than once.
    pub duplicates: u64,
    /// Frames from handles that came after a later one.
    pub reordered: u64,
    /// Messages on Zenoh for the session's tools that no holder of one wrote, or that had come before. None of them
    /// was acted on.
    pub unheard: u64,
    /// Frames from handles, per second.
    pub packets_up_per_s: f64,
    /// Frames to handles, per second.
    pub packets_down_per_s: f64,
    /// Energy that entered the link at both ends less what left it, J; below zero the link has made energy.
    pub energy_j: f64,
    /// What the operating system granted the loop's thread.
    pub scheduler: String,
}

/// Quantiles of the last 5 to 10 seconds; zeros before the first sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Quantiles {
    /// The median, s.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
}

/// Quantiles of the last 5 to 10 seconds; zeros before the first sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TickQuantiles {
    /// The median, s.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p999: f64,
    /// The greatest value, s.
    pub max: f64,
}
