//! The session as JSON shows it, from snapshot, statistics and mirror.

use std::sync::Mutex;

use teleclay_keeping::Storage;
use teleclay_proto::frame::Corrections;
use teleclay_proto::http::{
    ClayHash, ClayShape, ClayState, CorrectionsState, LoopState, Session, SessionState, Stop,
    StorageReport, StorageState, ToolState,
};
use teleclay_session::Snapshot;

use crate::engine::SessionRecord;
use crate::session::{SessionShared, tool_id};
use crate::statistics::LoopStats;

/// What the watchers' copy of the clay says at one moment.
struct Mirrored {
    hash: u64,
    unit_volume_m3: f64,
    shape: ClayShape,
    epoch: u32,
    initial_units: u64,
    remaining_units: u64,
}

/// The thread that a session lives on.
pub(crate) struct ThreadState<'a> {
    pub(crate) stats: &'a Mutex<LoopStats>,
    /// What it was granted.
    pub(crate) scheduler: &'a str,
    /// What sessions may take of its tick, s.
    pub(crate) budget_s: f64,
}

pub(crate) fn session(shared: &SessionShared, thread: &ThreadState<'_>) -> Session {
    let mirrored = {
        let mut mirror = shared.mirror.lock().expect("no holder panics");
        Mirrored {
            hash: mirror.clay.hash(),
            unit_volume_m3: mirror.clay.unit_volume_m3(),
            shape: mirror.shape.clone(),
            epoch: mirror.epoch,
            initial_units: mirror.clay.initial_units(),
            remaining_units: mirror.clay.remaining_units(),
        }
    };
    let snapshot = shared.snapshot().clone();
    let settings = &snapshot.settings;
    let stats = shared.stats.lock().expect("no holder panics");
    let record = &stats.record;
    // The watchers' clay is exchanged a moment before or after the loop's; until both are the same block, the watchers'
    // is told.
    let (initial_units, remaining_units) = if record.clay_epoch == mirrored.epoch {
        (record.initial_units, record.remaining_units)
    } else {
        (mirrored.initial_units, mirrored.remaining_units)
    };
    let (initial_volume_m3, remaining_volume_m3, removed_volume_m3) =
        volumes(initial_units, remaining_units, mirrored.unit_volume_m3);
    let (packets_up_per_s, packets_down_per_s) = stats.packets_per_s();
    let energy_j = record
        .tools
        .iter()
        .flatten()
        .map(|tool| tool.view.energy_handle_j - tool.view.energy_tool_j)
        .sum();
    let coordination_m = record
        .tools
        .iter()
        .flatten()
        .map(|tool| tool.coordination_m)
        .fold(0.0, f64::max);
    let own_tick_s = stats.work.tick_quantiles();
    let loop_stats = thread.stats.lock().expect("no holder panics");
    Session {
        id: shared.id.clone(),
        revision: snapshot.revision,
        scheme: settings.spec.scheme,
        axes: settings.spec.axes,
        state: state(&snapshot),
        fault: fault(&snapshot),
        stop: snapshot.stop.as_ref().map(|stop| Stop {
            by: stop.by.to_string(),
            reason: stop.reason.to_string(),
        }),
        material: settings.spec.material,
        network: settings.spec.network,
        clay: ClayState {
            voxel_size_m: settings.spec.clay.voxel_size_m,
            initial_volume_m3,
            remaining_volume_m3,
            removed_volume_m3,
            initial_units,
            remaining_units,
            removed_units: initial_units - remaining_units,
            unit_volume_m3: mirrored.unit_volume_m3,
            hash: ClayHash(mirrored.hash),
            shape: mirrored.shape,
            epoch: mirrored.epoch,
        },
        tool: settings.spec.tool,
        operation: settings.spec.operation,
        deadband: settings.parameters.deadband,
        tools: tools(&snapshot, record),
        storage: storage(shared, snapshot.revision),
        position_ratio: settings.parameters.position_ratio,
        coordination_m,
        control_loop: LoopState {
            rate_hz: loop_stats.rate_hz,
            ticks: record.ticks,
            late_ticks: record.late_ticks,
            tick_s: loop_stats.work.tick_quantiles(),
            thread: record.thread as u32,
            own_tick_s,
            budget_share: own_tick_s.p99 / thread.budget_s,
            rtt_s: stats.rtt.quantiles(),
            age_s: stats.age.quantiles(),
            lost: record.arrivals.lost,
            duplicates: record.arrivals.duplicates,
            reordered: record.arrivals.reordered,
            unheard: shared.channels.unheard(),
            packets_up_per_s,
            packets_down_per_s,
            energy_j,
            scheduler: thread.scheduler.to_owned(),
        },
    }
}

/// What has become of its history.
fn storage(shared: &SessionShared, revision: u64) -> StorageReport {
    let Some(archive) = &shared.archive else {
        return StorageReport {
            state: StorageState::Ephemeral,
            durable_revision: 0,
            bytes: 0,
            reason: None,
        };
    };
    let durable_revision = archive.durable_revision().min(revision);
    let (state, reason) = match archive.storage() {
        Storage::Failed { reason } => (StorageState::Failed, Some(reason)),
        Storage::Durable if durable_revision == revision => (StorageState::Durable, None),
        Storage::Durable | Storage::Behind => (StorageState::Behind, None),
    };
    StorageReport {
        state,
        durable_revision,
        bytes: archive.bytes(),
        reason,
    }
}

/// A session that was stopped is that and nothing else. One whose tools all rest for a fault is in fault; one where
/// somebody works on is not.
fn state(snapshot: &Snapshot) -> SessionState {
    if snapshot.stop.is_some() {
        return SessionState::Stopped;
    }
    let holders = || snapshot.tools.iter().flat_map(|tool| &tool.holder);
    let somebody_works = holders().any(|holder| holder.is_connected && holder.fault.is_none());
    let is_any_in_fault = holders().any(|holder| holder.fault.is_some());
    match (somebody_works, snapshot.settings.is_paused) {
        (false, _) if is_any_in_fault => SessionState::Fault,
        (_, true) => SessionState::Paused,
        (true, false) => SessionState::Running,
        (false, false) => SessionState::Idle,
    }
}

/// The tools that are in fault, and why.
fn fault(snapshot: &Snapshot) -> Option<String> {
    let faults: Vec<String> = (0..)
        .zip(&snapshot.tools)
        .filter_map(|(slot, tool)| {
            let fault = tool.holder.as_ref()?.fault?;
            Some(format!("tool {}: {fault}", tool_id(slot)))
        })
        .collect();
    (!faults.is_empty()).then(|| faults.join("; "))
}

/// Every tool, held or free.
fn tools(snapshot: &Snapshot, record: &SessionRecord) -> Vec<ToolState> {
    let home_m = snapshot.settings.parameters.home_m;
    let tools = snapshot.tools.iter().enumerate();
    tools
        .map(|(slot, tool)| {
            let holder = tool.holder.as_ref();
            let lease = holder.map(|holder| holder.lease);
            let told = record.tools[slot].filter(|told| Some(told.lease) == lease);
            let view = told.map(|told| told.view).unwrap_or_default();
            let [sweeps_acknowledged, sweeps_durable] = told.map_or([0; 2], |told| told.sweeps);
            ToolState {
                id: tool_id(slot),
                operator: holder.map_or_else(String::new, |holder| holder.operator.name.clone()),
                connected: holder.is_some_and(|holder| holder.is_connected),
                requests: tool.requests.iter().map(ToString::to_string).collect(),
                reserved_for: tool.reserved_for.as_deref().map(str::to_owned),
                position_m: told.map_or(home_m, |told| told.view.position_m),
                force_n: view.force_n,
                handle_position_m: view.handle_position_m,
                felt_force_n: view.felt_force_n,
                hand_force_n: view.hand_force_n,
                home_m,
                copy: view.copy,
                hidden_force_n: view.hidden_force_n,
                sweeps_refused: view.sweeps_refused,
                refusal: view.refusal,
                sweeps_acknowledged,
                sweeps_durable,
                corrections: corrections(&view.corrections),
            }
        })
        .collect()
}

fn corrections(told: &Corrections) -> CorrectionsState {
    CorrectionsState {
        count: told.count,
        moved_n: told.moved_n,
        held_n: told.held_n.map(f64::from),
        largest_step_n: told.largest_step_n.into(),
        injected_j: told.injected_j.into(),
        tank_j: told.tank_j.into(),
    }
}

/// Initial, remaining and removed volume, m³, such that the first is the sum of the others in floating point too.
fn volumes(initial_units: u64, remaining_units: u64, unit_m3: f64) -> (f64, f64, f64) {
    let initial = initial_units as f64 * unit_m3;
    let remaining = remaining_units as f64 * unit_m3;
    let removed = initial - remaining;
    // The difference is rounded once; if the sum then misses by a bit, the remainder takes it.
    let remaining = if (remaining + removed).to_bits() == initial.to_bits() {
        remaining
    } else {
        initial - removed
    };
    (initial, remaining, removed)
}

#[cfg(test)]
mod tests {
    use super::volumes;

    #[test]
    fn the_volumes_add_up_to_the_last_bit() {
        let initial_units = 255 * 256 * 128 * 128;
        let unit_m3 = 5e-4_f64.powi(3) / 255.0;
        let mut remaining = initial_units;
        while 0 < remaining {
            let (initial, left, gone) = volumes(initial_units, remaining, unit_m3);
            assert_eq!((left + gone).to_bits(), initial.to_bits(), "at {remaining}");
            remaining -= remaining / 97 + 1;
        }
    }
}
