//! The example's scheme against its closed forms, and its place in the latency table.

use std::sync::Arc;
use std::time::Duration;

use teleclay_clay::{Clay, Shape};
use teleclay_latency::cell::{Cell, Extent, Profile, SCHEMES, cells_of};
use teleclay_latency::law::Law;
use teleclay_latency::report::{markdown, summary};
use teleclay_latency::run::{Outcome, reference, run};
use teleclay_latency::table::Row;
use teleclay_link::conditioner::Impairment;
use teleclay_operator::Intent;
use teleclay_position_position::SCHEME;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Axes, Material, Scheme, ToolDescription};
use teleclay_session::Lines;
use teleclay_sim::rig::{Rig, Setup};

const OWN: Law = Law::Own(&SCHEME);
/// A blade of 10 mm, 20 mm deep in clay of 2·10⁵ N s/m³.
const CLAY_N_S_PER_M: f64 = 2e5 * 0.010 * 0.020;

/// A hand that pushes the sensor with a constant force along a block, from one end of it.
fn pushing(delay: Duration, force_n: f64) -> Rig {
    let size_m = [0.160, 0.080, 0.040];
    let line = Impairment {
        delay,
        ..Impairment::default()
    };
    let setup = Setup {
        parameters: LoopParameters {
            scheme: Scheme::ForceExchange,
            axes: Axes::Two,
            home_m: [0.020, 0.040, 0.020],
            tool: ToolDescription::Blade {
                width_m: 0.010,
                height_m: 0.040,
                thickness_m: 0.002,
            },
            material: Material {
                viscosity_pa_s_per_m: 2e5,
                yield_stress_pa: 0.0,
                stiffness_pa: 0.0,
            },
            ..LoopParameters::default()
        },
        clay: Clay::new(&Shape::Block { size_m }, 1e-3).unwrap(),
        intent: Intent::Idle,
        lines: Lines {
            up: line,
            up_seed: 2,
            down: line,
            down_seed: 3,
        },
    };
    let mut rig = Rig::with_controllers(setup, Vec::new(), Arc::new(SCHEME)).unwrap();
    rig.run_for(Duration::from_millis(700));
    let intent = Intent::sensor_force([force_n, 0.0, 0.0]).unwrap();
    rig.device_mut().intend(intent);
    rig
}

/// Means over half a second of a hand at a steady speed.
struct Steady {
    speed_m_s: f64,
    drift_m: f64,
    felt_n: f64,
    /// The clay's force on the tool.
    clay_n: f64,
    /// What stays in the channel.
    power_w: f64,
}

fn steady(delay: Duration) -> Steady {
    const TICKS: u32 = 500;
    let mut rig = pushing(delay, 1.5);
    rig.run_for(Duration::from_millis(2500));
    let place = |rig: &Rig| rig.device().sample().position_m;
    let (from, from_j) = (place(&rig), rig.energy_j());
    let (mut drift_m, mut felt_n, mut clay_n, mut halfway) = (0.0, 0.0, 0.0, from);
    for tick in 0..TICKS {
        rig.tick();
        drift_m += rig.tool().distance_from_m(place(&rig)) / f64::from(TICKS);
        felt_n -= rig.last().felt_force_n[0] / f64::from(TICKS);
        clay_n -= rig.tool().view().force_n[0] / f64::from(TICKS);
        if tick + 1 == TICKS / 2 {
            halfway = place(&rig);
        }
    }
    let (to, to_j) = (place(&rig), rig.energy_j());
    let span_s = f64::from(TICKS) * 1e-3;
    let off = 2.0 * (halfway[0] - from[0]) / (to[0] - from[0]) - 1.0;
    assert!(off.abs() < 2e-3, "{delay:?}: not steady: {off}");
    Steady {
        speed_m_s: (to[0] - from[0]) / span_s,
        drift_m,
        felt_n,
        clay_n,
        power_w: (to_j - from_j) / span_s,
    }
}

#[test]
fn drift_force_and_energy_of_a_steady_cut_are_those_of_the_closed_forms() {
    let (k, b) = (SCHEME.stiffness_n_per_m(), SCHEME.damping_n_s_per_m());
    for delay_ms in [0, 20, 80] {
        let delay = Duration::from_millis(delay_ms);
        let found = steady(delay);
        let (d, v) = (delay.as_secs_f64(), found.speed_m_s);
        // The blade takes a voxel more than its own depth with it.
        let clay = found.clay_n / v;
        assert!((clay / CLAY_N_S_PER_M - 1.0).abs() < 0.06, "{clay} N s/m");
        let expected = [
            v * (d + (b + clay) / k),
            v * (k * 2.0 * d + 2.0 * b + clay),
            v * v * (k * 2.0 * d + 2.0 * b),
        ];
        // Two ticks of the loop's own, and what is not quite steady.
        let slack = [2e-3 * v, 2e-3 * k * v, 2e-3 * k * v * v];
        let got = [found.drift_m, found.felt_n, found.power_w];
        for (number, got) in got.into_iter().enumerate() {
            let (want, slack) = (expected[number], slack[number]);
            assert!(
                (got - want).abs() <= slack + 5e-3 * want,
                "{delay_ms} ms, figure {number}: {got}, wanted {want}"
            );
        }
        assert!(0.01 < v, "{delay_ms} ms: the hand hardly moves, {v} m/s");
    }
}

fn cell(delay_ms: u32) -> Cell {
    Cell {
        scheme: OWN,
        delay_ms,
        jitter_ratio: 0.0,
        loss: 0.0,
        profile: Profile::Iid,
    }
}

fn row(cell: &Cell) -> Row {
    let of_seed = |seed| run(cell, seed, &reference(cell, seed).unwrap()).unwrap();
    Row::of(cell, 1, &[1, 2].map(of_seed))
}

/// Jitter of half a delay may double it, and lost frames lengthen it by some ticks.
#[test]
fn the_channel_gives_nothing_that_it_did_not_get_on_lines_that_its_gains_are_for() {
    for delay_ms in [0, 5, 25] {
        for (jitter_ratio, loss, profile) in [
            (0.0, 0.0, Profile::Iid),
            (0.5, 0.3, Profile::Iid),
            (0.2, 0.0, Profile::Bursts),
            (0.2, 0.0, Profile::Outage),
        ] {
            let row = row(&Cell {
                jitter_ratio,
                loss,
                profile,
                ..cell(delay_ms)
            });
            assert!(row.stable, "{row:?}");
            assert!(-1e-6 <= row.min_energy_j, "{row:?}");
        }
    }
}

/// Whoever drags on a longer spring feels more and removes less; without a network nothing is off.
#[test]
fn its_cells_are_in_the_table_and_grow_worse_with_the_delay() {
    let cells = cells_of(OWN, Extent::Quick);
    let others = cells_of(Scheme::Wave.into(), Extent::Quick);
    let lines = |cells: &[Cell]| -> Vec<_> {
        let line = |cell: &Cell| (cell.delay_ms, cell.profile);
        cells.iter().map(line).collect()
    };
    assert_eq!(lines(&cells), lines(&others));
    let rows: Vec<Row> = [0, 25, 100, 250]
        .map(|delay_ms| row(&cell(delay_ms)))
        .into();
    let [none, near, far, farthest] = &rows[..] else {
        panic!("four rows");
    };
    assert!(none.force_nrmse <= 0.0 && none.removed_volume_error <= 0.0);
    for (less, more) in [(none, near), (near, far), (far, farthest)] {
        assert!(less.force_nrmse < more.force_nrmse, "{less:?} {more:?}");
        assert!(less.removed_volume_error < more.removed_volume_error);
    }
    assert!(none.clay_identical.is_none() && 0.0 < none.packets_per_s);
}

#[test]
fn its_column_stands_behind_those_of_the_schemes_that_sessions_have() {
    let laws = SCHEMES.map(Law::from).into_iter().chain([OWN]);
    let rows: Vec<Row> = laws
        .flat_map(|law| cells_of(law, Extent::Quick))
        .map(|cell| Row::of(&cell, 1, &[Outcome::default()]))
        .collect();
    let table = markdown(&[], &rows);
    assert_eq!(table.matches("\n## `").count(), SCHEMES.len());
    assert!(table.starts_with("## `force_exchange`"), "{table}");
    assert!(table.contains("\n## `position_position`"));
    let page = summary(&[], &rows, 20.0);
    let heads = page
        .lines()
        .filter(|line| line.starts_with("| one way, ms |"));
    let mut count = 0;
    for head in heads {
        assert!(
            head.ends_with("`replica` | | `position_position` | |"),
            "{head}"
        );
        count += 1;
    }
    assert_eq!(count, 4);
}
