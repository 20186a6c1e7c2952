//! One run, and what it shows when it is held against the run without a network.

use std::time::Duration;

use serde::Serialize;
use teleclay_clay::UNITS_PER_VOXEL;
use teleclay_link::replica::CorrectionLimiter;
use teleclay_link::scheme::ClayCopy;
use teleclay_link::time::Timestamp;
use teleclay_sim::rig::{Rig, RigError};

use crate::cell::{self, Cell, Profile};
use crate::law::Law;
use crate::task;

/// The just noticeable difference of a force, a yardstick from the literature.
const JND: f64 = 0.07;
/// Below this a difference of force is not counted as noticed, however weak the force, N.
const JND_FLOOR_N: f64 = 0.02;
/// Swings of a few hertz show most over this many ticks.
const SWING_LAG: usize = 50;
/// A loop whose handle swings this many times as much as without a network is no longer stable. Position-force gets
/// there at a quarter above the delay at which theory has its swings grow; delay alone brings the schemes that are
/// passive to 1.8 times at most.
pub const SWING_MOST: f64 = 2.0;
/// Less than this is rest in any case, m/s.
const AT_REST_M_S: f64 = 0.01;
/// Nobody's hand is this fast, m/s: a run in which the handle is has come apart.
const APART_M_S: f64 = 1.5;

/// What the hand went through, tick by tick, from the first stroke on.
#[derive(Clone, Debug, Default)]
pub struct Track {
    felt_n: Vec<[f64; 2]>,
    handle_m: Vec<[f64; 2]>,
    removed_units: u64,
    /// How much the handle swings while it is pushed, and in the last second with the hands off: root mean squares of
    /// the change of its velocity in [`SWING_LAG`] ticks, m/s.
    swing_m_s: [f64; 2],
}

/// What one run shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Outcome {
    /// Whether the handle never came apart and swings no more than [`SWING_MOST`] times as much as without a network,
    /// while it is pushed and with the hands off.
    pub stable: bool,
    /// Least energy of the channel from hand to clay, J.
    pub min_energy_j: f64,
    /// Force error over the force of the run without a network, both as root mean squares.
    pub force_nrmse: f64,
    /// Position error of the handle against the run without a network, m.
    pub position_rmse_m: f64,
    /// Distance between tool and image of the handle, m.
    pub coordination_rmse_m: f64,
    /// Removed volume off by this share of that of the run without a network.
    pub removed_volume_error: f64,
    /// Share of time in which the force is off by more than a hand can tell.
    pub share_force_error_above_jnd: f64,
    /// Changes of the felt force by corrections, N a tick, of the ticks in which there was one.
    pub correction_steps_n: Vec<f64>,
    /// Energy that the hand has spent on cutting, J: more than that no correction may bring.
    pub earned_j: f64,
    /// Energy that corrections brought into the hand, J.
    pub injected_j: f64,
    /// What the copy hid: felt force less the authority's answer to the same sweep, over the felt force, as root mean
    /// squares.
    pub hidden_force_nrmse: Option<f64>,
    /// Whether every copy of the clay is the server's, bit for bit, once the line is drained.
    pub clay_identical: Option<bool>,
    /// Frames both ways, a second.
    pub packets_per_s: f64,
    /// Their bytes, without what transports add.
    pub bytes_per_s: f64,
}

/// Runs the cell without a network.
///
/// # Errors
/// The rig cannot be set up.
pub fn reference(cell: &Cell, seed: u64) -> Result<Track, RigError> {
    let rig = task::rig(&cell.reference(), seed)?;
    Ok(reference_on(rig, cell, seed))
}

/// Runs the cell without a network, on a rig that somebody has set up so: one whose two sides are coupled otherwise.
pub fn reference_on(rig: Rig, cell: &Cell, seed: u64) -> Track {
    measure(rig, &cell.reference(), seed, None).0
}

/// Runs a cell and holds it against its reference.
///
/// # Errors
/// The rig cannot be set up.
pub fn run(cell: &Cell, seed: u64, reference: &Track) -> Result<Outcome, RigError> {
    Ok(run_on(task::rig(cell, seed)?, cell, seed, reference))
}

/// Runs a cell on a rig that somebody has set up for it, and holds it against its reference.
pub fn run_on(rig: Rig, cell: &Cell, seed: u64, reference: &Track) -> Outcome {
    measure(rig, cell, seed, Some(reference)).1
}

fn measure(mut rig: Rig, cell: &Cell, seed: u64, reference: Option<&Track>) -> (Track, Outcome) {
    rig.run_for(task::START);
    let began = rig.traffic();
    let mut probe = Probe::default();
    for force_n in task::pushes(seed) {
        task::push(&mut rig, force_n);
        probe.watch(&mut rig, task::PUSH);
        let is_outage_over = Timestamp::ZERO.after(cell::OUTAGE_OVER) < rig.now();
        if cell.profile == Profile::Outage && is_outage_over {
            rig.impair(cell.lines_after_outage(seed));
        }
    }
    task::let_go(&mut rig);
    let calm_from = probe.track.felt_n.len();
    probe.watch(&mut rig, task::CALM);
    let span_s = (task::WORK + task::CALM).as_secs_f64();
    let [packets, bytes] = [0, 1].map(|what| {
        let total: u64 = rig
            .traffic()
            .iter()
            .zip(began)
            .map(|(now, before)| match what {
                0 => now.frames - before.frames,
                _ => now.bytes - before.bytes,
            })
            .sum();
        total as f64 / span_s
    });
    let min_energy_j = rig.least_energy_j();
    drain(&mut rig, cell.scheme);
    probe.track.removed_units = rig.session().clay().removed_units();
    let last_second = probe.velocity_m_s.len().saturating_sub(1000);
    probe.track.swing_m_s = [
        swing_m_s(&probe.velocity_m_s[..calm_from]),
        swing_m_s(&probe.velocity_m_s[last_second..]),
    ];
    let is_calm = reference.is_none_or(|reference| {
        let swings = probe.track.swing_m_s.iter().zip(reference.swing_m_s);
        swings.fold(true, |is_calm, (swing, ideal)| {
            is_calm && *swing <= (SWING_MOST * ideal).max(AT_REST_M_S)
        })
    });
    let copy = rig.clay_copy().and_then(ClayCopy::copy);
    let limiter = copy.map(teleclay_link::replica::Copy::limiter);
    let outcome = Outcome {
        stable: is_calm && !probe.is_apart,
        min_energy_j,
        coordination_rmse_m: probe.coordination_rmse_m(),
        correction_steps_n: std::mem::take(&mut probe.correction_steps_n),
        earned_j: limiter.map_or(0.0, CorrectionLimiter::earned_j),
        injected_j: limiter.map_or(0.0, CorrectionLimiter::injected_j),
        hidden_force_nrmse: (cell.scheme.keeps_a_copy()).then(|| probe.hidden_force_nrmse()),
        clay_identical: (cell.scheme.keeps_a_copy()).then(|| is_one_clay(&rig)),
        packets_per_s: packets,
        bytes_per_s: bytes,
        ..reference.map_or_else(Outcome::default, |reference| probe.track.against(reference))
    };
    (probe.track, outcome)
}

/// Handles rest until everything under way has arrived.
fn drain(rig: &mut Rig, scheme: Law) {
    rig.hold_handles_fast();
    // The copy's sweeps may have to be sent several times over; elsewhere the last frame is all there is.
    rig.run_for(if scheme.keeps_a_copy() {
        Duration::from_secs(5)
    } else {
        Duration::from_secs(1)
    });
}

fn is_one_clay(rig: &Rig) -> bool {
    let authority = rig.session().clay().clone().hash();
    (0..rig.session().tools()).all(|slot| {
        let copy = rig.handle_of(slot).clay_copy().and_then(ClayCopy::copy);
        copy.is_some_and(|copy| copy.clay().clone().hash() == authority)
    })
}

#[derive(Default)]
struct Probe {
    track: Track,
    velocity_m_s: Vec<[f64; 2]>,
    coordination_m2: f64,
    correction_steps_n: Vec<f64>,
    hidden_n2: f64,
    felt_n2: f64,
    is_apart: bool,
}

impl Probe {
    fn watch(&mut self, rig: &mut Rig, span: Duration) {
        let end = rig.now().after(span);
        while rig.now() < end {
            rig.tick();
            let sample = rig.device().sample();
            let [fx, fy, _] = rig.last().felt_force_n;
            let [x, y, _] = sample.position_m;
            let [vx, vy, _] = sample.velocity_m_s;
            self.track.felt_n.push([fx, fy]);
            self.track.handle_m.push([x, y]);
            self.velocity_m_s.push([vx, vy]);
            let speed_m_s = vx.abs().max(vy.abs());
            self.is_apart |= speed_m_s.is_nan() || APART_M_S <= speed_m_s;
            let apart_m = rig.tool().distance_from_m(sample.position_m);
            self.coordination_m2 += apart_m * apart_m;
            let copy = rig.clay_copy().and_then(ClayCopy::copy);
            if let Some(step_n) = copy
                .map(|copy| copy.limiter().step_n())
                .filter(|n| 0.0 < *n)
            {
                self.correction_steps_n.push(step_n);
            }
            let [hx, hy, _] = rig.tool().view().hidden_force_n;
            self.hidden_n2 += hx * hx + hy * hy;
            self.felt_n2 += fx * fx + fy * fy;
        }
    }

    fn coordination_rmse_m(&self) -> f64 {
        (self.coordination_m2 / self.track.felt_n.len().max(1) as f64).sqrt()
    }

    fn hidden_force_nrmse(&self) -> f64 {
        ratio(self.hidden_n2.sqrt(), self.felt_n2.sqrt())
    }
}

impl Track {
    fn against(&self, reference: &Self) -> Outcome {
        let ticks = self.felt_n.len().min(reference.felt_n.len());
        let (mut error_n2, mut force_n2, mut error_m2, mut noticed) = (0.0, 0.0, 0.0, 0_u64);
        for tick in 0..ticks {
            let (felt, ideal) = (self.felt_n[tick], reference.felt_n[tick]);
            let error_n = (felt[0] - ideal[0]).hypot(felt[1] - ideal[1]);
            let ideal_n = ideal[0].hypot(ideal[1]);
            error_n2 += error_n * error_n;
            force_n2 += ideal_n * ideal_n;
            noticed += u64::from((JND * ideal_n).max(JND_FLOOR_N) < error_n);
            let (at, there) = (self.handle_m[tick], reference.handle_m[tick]);
            error_m2 += (at[0] - there[0]).powi(2) + (at[1] - there[1]).powi(2);
        }
        let count = ticks.max(1) as f64;
        Outcome {
            force_nrmse: ratio(error_n2.sqrt(), force_n2.sqrt()),
            position_rmse_m: (error_m2 / count).sqrt(),
            share_force_error_above_jnd: noticed as f64 / count,
            removed_volume_error: ratio(
                self.removed_units.abs_diff(reference.removed_units) as f64,
                reference.removed_units as f64,
            ),
            ..Outcome::default()
        }
    }

    /// What was removed, in voxels.
    pub fn removed_voxels(&self) -> f64 {
        self.removed_units as f64 / UNITS_PER_VOXEL as f64
    }

    /// The felt force at its strongest, N.
    pub fn strongest_n(&self) -> f64 {
        let norms = self.felt_n.iter().map(|force| force[0].hypot(force[1]));
        norms.fold(0.0, f64::max)
    }
}

fn swing_m_s(velocities_m_s: &[[f64; 2]]) -> f64 {
    let lagged = velocities_m_s
        .iter()
        .zip(velocities_m_s.iter().skip(SWING_LAG));
    let (count, sum) = lagged.fold((0_u32, 0.0), |(count, sum), (a, b)| {
        (
            count + 1,
            sum + (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2),
        )
    });
    (sum / f64::from(count.max(1))).sqrt()
}

fn ratio(part: f64, whole: f64) -> f64 {
    if 0.0 < whole { part / whole } else { 0.0 }
}
