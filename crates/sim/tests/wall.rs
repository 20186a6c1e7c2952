//! The oracle before any other claim about delay: the naive wall across the line turns unstable where theory says.

use std::time::Duration;

use teleclay_link::conditioner::Impairment;
use teleclay_sim::wall::{WallSetup, measured_critical_stiffness};

const TICK_S: f64 = 1e-3;

/// Critical stiffness of a mass of 0.35 kg with 2.5 N s/m at 1 kHz for round trips in ticks: `t_d = T/2 + RTT`, solve
/// `x tan x = b t_d / m`, then `K = (b / t_d) x / sin x`. Worked out by other means than this code.
const KNOWN: [(u32, f64); 7] = [
    (0, 5002.973888361214),
    (2, 1002.9646977690447),
    (5, 457.49642052133095),
    (10, 241.02346426457925),
    (20, 124.8345292528001),
    (50, 52.25822556608554),
    (100, 27.428577006491114),
];

/// The same by bisection, for masses and dampings that the table does not have.
fn critical_stiffness(mass: f64, damping: f64, round_trip_s: f64) -> f64 {
    let t_d = TICK_S / 2.0 + round_trip_s;
    let (mut low, mut high) = (0.0, std::f64::consts::FRAC_PI_2);
    for _ in 0..200 {
        let x: f64 = 0.5 * (low + high);
        if x * x.tan() < damping * t_d / mass {
            low = x
        } else {
            high = x
        }
    }
    (damping / t_d) * low / low.sin()
}

fn line(ticks: u32) -> Impairment {
    Impairment {
        delay: Duration::from_millis(1) * ticks,
        ..Impairment::default()
    }
}

fn measured(mass_kg: f64, damping_n_s_per_m: f64, round_trip: u32, expected: f64) -> f64 {
    let up = round_trip / 2;
    let setup = WallSetup {
        mass_kg,
        damping_n_s_per_m,
        tick_s: TICK_S,
        up: line(up),
        down: line(round_trip - up),
    };
    measured_critical_stiffness(&setup, 0.5 * expected, 2.0 * expected)
}

#[test]
fn the_naive_wall_turns_unstable_within_one_percent_of_theory() {
    for (round_trip, expected) in KNOWN {
        let got = measured(0.35, 2.5, round_trip, expected);
        println!("round trip {round_trip} ms: {got:.2} N/m, theory {expected:.2}");
        assert!(
            (got / expected - 1.0).abs() < 0.01,
            "round trip {round_trip} ms: {got}, theory {expected}"
        );
    }
}

#[test]
fn so_it_does_for_other_masses_dampings_and_uneven_lines() {
    for (mass, damping, round_trip) in [
        (0.1, 1.0, 3),
        (1.0, 10.0, 30),
        (2.0, 0.5, 8),
        (0.05, 4.0, 40),
    ] {
        let expected = critical_stiffness(mass, damping, f64::from(round_trip) * TICK_S);
        let got = measured(mass, damping, round_trip, expected);
        assert!(
            (got / expected - 1.0).abs() < 0.01,
            "{mass} kg, {damping} N s/m, {round_trip} ms: {got}, {expected}"
        );
    }
}

#[test]
fn one_tick_more_of_delay_would_be_noticed() {
    let wrong = measured(0.35, 2.5, 11, KNOWN[3].1);
    assert!(0.05 < (wrong / KNOWN[3].1 - 1.0).abs());
}
