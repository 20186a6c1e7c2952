//! What a session tells of itself to whoever counts and watches: records of its motion, and bricks of its clay.

use rtrb::Producer;
use teleclay_bilateral::ToolView;
use teleclay_clay::BrickView;
use teleclay_link::arrivals::ArrivalCounts;
use teleclay_link::time::Timestamp;
use teleclay_proto::watch::BRICK_VOXELS;
use teleclay_session::Session;

use super::TOOLS;

/// Every how many ticks tools are recorded: 250 Hz is beyond any screen, and a quarter of the bytes.
pub(crate) const RECORD_EVERY: u64 = 4;
/// Every how many ticks changed bricks are handed over, and how many at most: 1000 a second, so the 27 around a ball
/// renew at 37 Hz.
pub(super) const BRICKS_EVERY: u64 = 4;
const BRICKS_AT_ONCE: usize = 4;

/// One session at one tick.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SessionRecord {
    /// The thread that made the tick.
    pub(crate) thread: usize,
    pub(crate) ticks: u64,
    /// Ticks since the session began that started more than a whole tick late.
    pub(crate) late_ticks: u64,
    /// What a tick since the last record took of its processor, if one was measured, ns.
    pub(crate) work_ns: Option<u64>,
    pub(crate) clay_epoch: u32,
    pub(crate) initial_units: u64,
    pub(crate) remaining_units: u64,
    /// Frames that left for handles since the session began.
    pub(crate) frames_sent: u64,
    /// What came from handles since then, those who have left included.
    pub(crate) arrivals: ArrivalCounts,
    pub(crate) tools: [Option<ToolRecord>; TOOLS],
}

/// One tool at one tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ToolRecord {
    pub(crate) lease: u32,
    pub(crate) is_connected: bool,
    pub(crate) silence_s: f64,
    pub(crate) view: ToolView,
    pub(crate) coordination_m: f64,
    pub(crate) rtt_s: Option<f64>,
    /// Sweeps that are in the clay, and of these on disk.
    pub(crate) sweeps: [u32; 2],
}

/// A changed brick on its way to the mirror.
pub(crate) struct BrickUpdate {
    pub(crate) clay_epoch: u32,
    pub(crate) index: u32,
    pub(crate) content: BrickContent,
}

/// What a brick holds now.
#[allow(
    clippy::large_enum_variant,
    reason = "it lies in a ring whose slots have one size; a box would allocate on the tick"
)]
pub(crate) enum BrickContent {
    Empty,
    Full,
    Voxels([u8; BRICK_VOXELS]),
}

/// The session's own part of a record.
pub(super) fn record(session: &Session, now: Timestamp) -> SessionRecord {
    let mut record = SessionRecord {
        ticks: session.ticks(),
        clay_epoch: session.clay_epoch(),
        initial_units: session.clay().initial_units(),
        remaining_units: session.clay().remaining_units(),
        arrivals: session.arrivals(),
        ..SessionRecord::default()
    };
    for (slot, tool) in record.tools.iter_mut().enumerate() {
        *tool = session.side(slot).map(|side| ToolRecord {
            lease: side.lease(),
            is_connected: side.is_connected(now),
            silence_s: side.silence_s(now),
            view: side.view(),
            coordination_m: side.coordination_m(),
            rtt_s: side.round_trip().last().map(|rtt| rtt.as_secs_f64()),
            sweeps: [
                side.frame().sweeps_acknowledged,
                side.frame().sweeps_durable,
            ],
        });
    }
    record
}

pub(super) fn hand_over_bricks(session: &mut Session, bricks: &mut Producer<BrickUpdate>) {
    let most = bricks.slots().min(BRICKS_AT_ONCE);
    let clay_epoch = session.clay_epoch();
    session.clay_mut().drain_changed(most, |index, view| {
        let content = match view {
            BrickView::Empty => BrickContent::Empty,
            BrickView::Full => BrickContent::Full,
            BrickView::Voxels(voxels) => BrickContent::Voxels(*voxels),
        };
        // There is room, see `most`.
        let _ = bricks.push(BrickUpdate {
            clay_epoch,
            index: index.as_u32(),
            content,
        });
    });
}
