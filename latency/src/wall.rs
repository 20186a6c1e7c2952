//! The measuring stick: the naive wall turns unstable where theory says, on the conditioner that every cell runs over.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use teleclay_control::wall::{DelayedWall, critical_stiffness};
use teleclay_link::conditioner::Impairment;
use teleclay_sim::wall::{WallSetup, measured_critical_stiffness};

/// One wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WallRow {
    /// Round trip, s.
    pub rtt_s: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Damping, N·s/m.
    pub damping_n_s_per_m: f64,
    /// Tick, s.
    pub tick_s: f64,
    /// By theory, N/m.
    pub critical_stiffness_n_per_m: f64,
    /// On the conditioner, N/m.
    pub measured_stiffness_n_per_m: f64,
}

const TICK_S: f64 = 1e-3;

/// Masses, kg, and dampings, N s/m: a light handle and a heavy one.
const HANDLES: [(f64, f64); 2] = [(0.35, 2.5), (1.0, 10.0)];
/// Round trips, ticks.
const ROUND_TRIPS: [u32; 9] = [0, 1, 2, 5, 10, 20, 50, 100, 200];

/// How many walls there are.
pub const WALLS: usize = HANDLES.len() * ROUND_TRIPS.len();

/// Wall number `number`, below [`WALLS`].
///
/// # Panics
/// Beyond.
pub fn row(number: usize) -> WallRow {
    let (mass_kg, damping_n_s_per_m) = HANDLES[number / ROUND_TRIPS.len()];
    let ticks = ROUND_TRIPS[number % ROUND_TRIPS.len()];
    let rtt_s = f64::from(ticks) * TICK_S;
    let theory = critical_stiffness(&DelayedWall {
        mass_kg,
        damping_n_s_per_m,
        tick_s: TICK_S,
        rtt_s,
    })
    .expect("these masses, dampings and delays are above zero");
    let by = |ticks: u32| Impairment {
        delay: Duration::from_millis(1) * ticks,
        ..Impairment::default()
    };
    let setup = WallSetup {
        mass_kg,
        damping_n_s_per_m,
        tick_s: TICK_S,
        up: by(ticks / 2),
        down: by(ticks - ticks / 2),
    };
    WallRow {
        rtt_s,
        mass_kg,
        damping_n_s_per_m,
        tick_s: TICK_S,
        critical_stiffness_n_per_m: theory,
        measured_stiffness_n_per_m: measured_critical_stiffness(&setup, 0.5 * theory, 2.0 * theory),
    }
}
