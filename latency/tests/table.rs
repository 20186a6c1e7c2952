//! What must come out of the table, on a part of it that runs in seconds. The whole is run by the program.

use teleclay_latency::cell::{Cell, Profile, SCHEMES};
use teleclay_latency::run::{Outcome, reference, run};
use teleclay_latency::table::Row;
use teleclay_latency::wall;
use teleclay_proto::Scheme;
use teleclay_proto::join::LoopParameters;

const SEEDS: [u64; 2] = [1, 2];

fn cell(scheme: Scheme, delay_ms: u32) -> Cell {
    Cell {
        scheme: scheme.into(),
        delay_ms,
        jitter_ratio: 0.0,
        loss: 0.0,
        profile: Profile::Iid,
    }
}

/// The same delay as it is, with jitter and loss, with bursts, with an outage.
fn bad_lines(scheme: Scheme, delay_ms: u32) -> [Cell; 4] {
    let steady = cell(scheme, delay_ms);
    [
        steady,
        Cell {
            jitter_ratio: 0.5,
            loss: 0.3,
            ..steady
        },
        Cell {
            jitter_ratio: 0.2,
            profile: Profile::Bursts,
            ..steady
        },
        Cell {
            jitter_ratio: 0.2,
            profile: Profile::Outage,
            ..steady
        },
    ]
}

fn outcomes(cell: &Cell) -> Vec<Outcome> {
    let of_seed = |seed| run(cell, seed, &reference(cell, seed).unwrap()).unwrap();
    SEEDS.into_iter().map(of_seed).collect()
}

fn row(cell: &Cell) -> Row {
    Row::of(cell, SEEDS[0], &outcomes(cell))
}

#[test]
fn the_hand_with_a_replica_feels_nothing_of_any_line_and_removes_the_same_clay() {
    for delay_ms in [1, 25, 250] {
        for cell in bad_lines(Scheme::Replica, delay_ms) {
            let row = row(&cell);
            assert!(row.stable, "{cell:?}");
            assert!(
                row.force_nrmse_worst <= 0.0,
                "{cell:?}: {}",
                row.force_nrmse_worst
            );
            assert!(row.removed_volume_error_worst <= 0.0, "{cell:?}");
            assert_eq!(row.clay_identical, Some(true), "{cell:?}");
            assert!(row.hidden_force_nrmse.unwrap() < 0.01, "{cell:?}: {row:?}");
        }
    }
}

#[test]
fn a_second_writer_is_felt_gently_and_the_price_is_told() {
    let limit_n = 0.07 * LoopParameters::default().force_limit_n;
    for delay_ms in [25, 250] {
        let cell = Cell {
            jitter_ratio: 0.2,
            profile: Profile::SecondWriter,
            ..cell(Scheme::Replica, delay_ms)
        };
        let row = row(&cell);
        assert_eq!(row.clay_identical, Some(true), "{delay_ms} ms");
        let most = row.correction_step_n.max;
        assert!(0.0 < most && most <= limit_n, "{delay_ms} ms: {most} N");
        // The two meet in the middle of every push: a copy that hides nothing then would not be one.
        assert!(
            0.01 < row.hidden_force_nrmse.unwrap(),
            "{delay_ms} ms: {row:?}"
        );
        assert!(0.0 < row.force_nrmse, "{delay_ms} ms");
    }
}

#[test]
fn passive_schemes_give_nothing_that_they_did_not_get() {
    for scheme in [Scheme::Wave, Scheme::Tdpa] {
        for delay_ms in [0, 5, 100] {
            for cell in bad_lines(scheme, delay_ms) {
                let row = row(&cell);
                assert!(
                    -1e-6 <= row.min_energy_j,
                    "{cell:?}: {} J",
                    row.min_energy_j
                );
            }
        }
    }
}

/// The margin of position-force in 40 N s/m is 38 ms of round trip, and two ticks of it are the loop's own.
#[test]
fn position_force_dies_on_the_way_and_the_paper_s_scheme_drifts_apart_instead() {
    assert!(row(&cell(Scheme::PositionForce, 10)).stable);
    let beyond = row(&cell(Scheme::PositionForce, 50));
    assert!(!beyond.stable && beyond.min_energy_j < -0.01, "{beyond:?}");
    let [near, far] = [10, 250].map(|delay_ms| row(&cell(Scheme::ForceExchange, delay_ms)));
    assert!(near.stable && far.stable);
    assert!(
        0.01 < far.coordination_rmse_m && 5.0 * near.coordination_rmse_m < far.coordination_rmse_m
    );
}

#[test]
fn without_a_network_nothing_is_off() {
    for scheme in SCHEMES {
        for outcome in outcomes(&cell(scheme, 0)) {
            assert!(outcome.stable, "{scheme}");
            assert!(
                outcome.force_nrmse <= 0.0 && outcome.removed_volume_error <= 0.0,
                "{scheme}"
            );
            assert!(0.0 < outcome.packets_per_s);
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_figures_and_another_one_others() {
    let cell = Cell {
        jitter_ratio: 0.5,
        loss: 0.1,
        ..cell(Scheme::Wave, 25)
    };
    let once = outcomes(&cell);
    assert_eq!(once, outcomes(&cell));
    assert_ne!(once[0], once[1]);
}

#[test]
fn every_wall_turns_unstable_within_one_percent_of_theory() {
    for number in 0..wall::WALLS {
        let row = wall::row(number);
        let off = row.measured_stiffness_n_per_m / row.critical_stiffness_n_per_m - 1.0;
        assert!(off.abs() < 0.01, "{row:?}");
    }
}
