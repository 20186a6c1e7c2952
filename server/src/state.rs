//! The session as JSON shows it, from settings, statistics and mirror.

use std::sync::Mutex;

use teleclay_proto::http::{ClayHash, ClayShape, ClayState, LoopState, Session};

use crate::collector::LoopStats;
use crate::session::{SessionShared, session_state, tools};

/// What the watchers' copy of the clay says at one moment.
struct Mirrored {
    hash: u64,
    unit_volume_m3: f64,
    shape: ClayShape,
    epoch: u32,
    initial_units: u64,
    remaining_units: u64,
}

pub(crate) fn session(
    shared: &SessionShared,
    loop_stats: &Mutex<LoopStats>,
    scheduler: &str,
) -> Session {
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
    let settings = shared.settings().clone();
    let stats = shared.stats.lock().expect("no holder panics");
    let record = &stats.record;
    // The watchers' clay is exchanged a moment before the loop's; until the loop has told of the fresh block, that is whole.
    let (initial_units, remaining_units) = if record.clay_epoch == mirrored.epoch {
        (record.initial_units, record.remaining_units)
    } else {
        (mirrored.initial_units, mirrored.remaining_units)
    };
    let (initial_volume_m3, remaining_volume_m3, removed_volume_m3) =
        volumes(initial_units, remaining_units, mirrored.unit_volume_m3);
    let (packets_up_per_s, packets_down_per_s) = stats.packets_per_s();
    let arrivals = record.tools.iter().flatten().map(|tool| tool.arrivals);
    let (mut lost, mut duplicates, mut reordered) = (0, 0, 0);
    for counts in arrivals {
        lost += counts.missing;
        duplicates += counts.duplicates;
        reordered += counts.reordered;
    }
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
    let loop_stats = loop_stats.lock().expect("no holder panics");
    Session {
        id: shared.id.clone(),
        scheme: settings.spec.scheme,
        axes: settings.spec.axes,
        state: session_state(&settings, &stats),
        fault: record.fault.map(|field| format!("{field} is not finite")),
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
        deadband: settings.parameters.deadband,
        tools: tools(&settings, &stats),
        position_ratio: settings.parameters.position_ratio,
        coordination_m,
        control_loop: LoopState {
            rate_hz: loop_stats.rate_hz,
            ticks: record.ticks,
            late_ticks: loop_stats.late_ticks,
            tick_s: loop_stats.work.tick_quantiles(),
            rtt_s: stats.rtt.quantiles(),
            age_s: stats.age.quantiles(),
            lost,
            duplicates,
            reordered,
            packets_up_per_s,
            packets_down_per_s,
            energy_j,
            scheduler: scheduler.to_owned(),
        },
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
