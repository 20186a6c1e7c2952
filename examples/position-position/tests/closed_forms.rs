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

/// A hand that pushes with a constant force along a block, from one end of it.
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
    let intent = Intent::constant_force([force_n, 0.0, 0.0]).unwrap();
    rig.device_mut().intend(intent);
    rig
}

/// Ends with the hand at a steady speed: speed, m/s, drift, m, felt force, N, and power that stays in the channel, W.
fn steady(delay: Duration) -> [f64; 4] {
    const SPAN_S: f64 = 0.3;
    let mut rig = pushing(delay, 1.5);
    rig.run_for(Duration::from_millis(2000));
    let (from, from_j) = (rig.device().sample().position_m, rig.energy_j());
    rig.run_for(Duration::from_secs_f64(SPAN_S));
    let (to, to_j) = (rig.device().sample().position_m, rig.energy_j());
    let v_m_s = (to[0] - from[0]) / SPAN_S;
    let off = rig.device().sample().velocity_m_s[0] / v_m_s - 1.0;
    assert!(off.abs() < 2e-3, "not steady: {off}");
    let drift_m = rig.tool().distance_from_m(to);
    [
        v_m_s,
        drift_m,
        -rig.last().felt_force_n[0],
        (to_j - from_j) / SPAN_S,
    ]
}

#[test]
fn drift_force_and_energy_of_a_steady_cut_are_those_of_the_closed_forms() {
    let (k, b) = (SCHEME.stiffness_n_per_m(), SCHEME.damping_n_s_per_m());
    for delay_ms in [0, 20, 80] {
        let delay = Duration::from_millis(delay_ms);
        let [v, drift_m, felt_n, power_w] = steady(delay);
        let d = delay.as_secs_f64();
        let expected = [
            v * (d + (b + CLAY_N_S_PER_M) / k),
            v * (k * 2.0 * d + 2.0 * b + CLAY_N_S_PER_M),
            v * v * (k * 2.0 * d + 2.0 * b),
        ];
        // Two ticks of the loop's own, and what is not quite steady.
        let slack = [2e-3 * v, 2e-3 * k * v, 2e-3 * k * v * v];
        for (number, got) in [drift_m, felt_n, power_w].into_iter().enumerate() {
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
    let rows: Vec<Row> = [0, 25, 100, 250].map(|delay_ms| row(&cell(delay_ms))).into();
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
    let heads = page.lines().filter(|line| line.starts_with("| one way, ms |"));
    let mut count = 0;
    for head in heads {
        assert!(head.ends_with("`replica` | | `position_position` | |"), "{head}");
        count += 1;
    }
    assert_eq!(count, 4);
}
