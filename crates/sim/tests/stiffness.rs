//! A line is a spring: `1 / K_displayed = 1 / K_clay + D / b`, with `D` the mean one-way delay, play-out, filter and
//! tick included.
//!
//! Stiffness is a ratio at rest, so rest is judged too: what the echoes leave dies out, and after that neither end
//! moves any more and both ends carry one force.

mod rigs;

use std::time::Duration;

use rigs::{TICK, TICK_S, embedded, material, running};
use teleclay_link::conditioner::Impairment;
use teleclay_link::scheme::wave::FILTER_RAD_S;
use teleclay_operator::Intent;
use teleclay_proto::Scheme;
use teleclay_proto::join::LoopParameters;
use teleclay_session::Lines;

/// An echo goes round the slowest line here in 0.25 s, filters included, and comes back with 0.74 of what it was: it
/// decays with a time constant of 0.84 s. This is fourteen of them, so 50 mm/s are down to 50 nm/s.
const ECHOES_DIE_IN: Duration = Duration::from_secs(12);
/// Then this long nothing may happen. A tool that the line holds up somewhere off its balance lets go within it.
const AT_REST_FOR: Duration = Duration::from_secs(12);
/// What is left at rest at most, m/s: a step of the lattice (60 nm) every tenth of a second.
const REST_M_S: f64 = 6e-7;
/// Forces that balance differ by this at most, N: two steps of the lattice on the stiffest clay here, 1860 N/m.
const BALANCE_N: f64 = 2.2e-4;

#[test]
fn the_wave_line_shows_the_stiffness_that_theory_says() {
    // A wave formed at the end of a tick acts in the next, and the filter holds a steady wave back by (1 - a) / a
    // ticks.
    let filter_share = 1.0 - (-FILTER_RAD_S * TICK_S).exp();
    let built_in_s = TICK_S * (1.0 + (1.0 - filter_share) / filter_share);
    for (up_ticks, down_ticks, modulus_pa, impedance) in [
        (0, 0, 5e4, 20.0),
        (20, 20, 5e4, 20.0),
        (60, 20, 5e4, 20.0),
        (100, 100, 2e4, 20.0),
        (50, 50, 1e4, 10.0),
        (0, 0, 1e5, 20.0),
    ] {
        let by = |ticks| Impairment {
            delay: TICK * ticks,
            ..Impairment::default()
        };
        let lines = Lines {
            up: by(up_ticks),
            up_seed: 1,
            down: by(down_ticks),
            down_seed: 2,
        };
        let parameters = LoopParameters {
            wave_impedance_n_s_per_m: impedance,
            ..running(Scheme::Wave)
        };
        let mut rig = embedded(
            parameters,
            Intent::Idle,
            material(1e4, 1e6, modulus_pa),
            lines,
        );
        // Until the first frames are there and the ramps are up, hand and tool are not coupled.
        rig.run_for(Duration::from_millis(500));
        rig.device_mut()
            .intend(Intent::constant_force([1.5, 0.0, 0.0]).unwrap());
        rig.run_for(ECHOES_DIE_IN);
        let (mut fastest_m_s, mut unbalanced_n) = (0.0_f64, 0.0_f64);
        let end = rig.now().after(AT_REST_FOR);
        while rig.now() < end {
            rig.tick();
            let ends_m_s = [
                rig.device().sample().velocity_m_s[0],
                rig.tool().view().velocity_m_s[0],
            ];
            fastest_m_s = ends_m_s
                .map(f64::abs)
                .into_iter()
                .fold(fastest_m_s, f64::max);
            let difference_n = rig.tool().view().force_n[0] - rig.last().felt_force_n[0];
            unbalanced_n = unbalanced_n.max(difference_n.abs());
        }

        let felt = -rig.last().felt_force_n[0];
        let displayed = felt / rig.device().sample().position_m[0];
        let view = rig.tool().view();
        let clay = -view.force_n[0] / (view.position_m[0] - 0.064);
        let delay_s = built_in_s + 0.5 * f64::from(up_ticks + down_ticks) * TICK_S;
        let expected = 1.0 / (1.0 / clay + delay_s / impedance);
        println!(
            "{up_ticks} + {down_ticks} ticks, clay {clay:.0} N/m: {displayed:.1}, theory {expected:.1} N/m; at most {fastest_m_s:.1e} m/s, {unbalanced_n:.1e} N apart"
        );
        assert!(fastest_m_s < REST_M_S, "not at rest: {fastest_m_s} m/s");
        assert!(
            unbalanced_n < BALANCE_N,
            "{unbalanced_n} N more at one end than at the other"
        );
        assert!(0.5 < felt, "no contact: {felt} N");
        assert!(
            (displayed / expected - 1.0).abs() < 0.005,
            "{displayed} N/m, theory {expected} N/m"
        );
    }
}

/// In steady motion a line shows the clay's damping and nothing of its own, at any ratios: `v = f / (B + rho B_clay)`.
#[test]
fn the_wave_line_in_steady_cutting_shows_the_clays_damping() {
    for (position_ratio, force_ratio, force_n) in [
        (1.0, 1.0, 0.9),
        (0.5, 3.0, 1.0),
        (2.0, 0.7, 1.2),
        (0.5, 0.8, 1.5),
    ] {
        let parameters = LoopParameters {
            position_ratio,
            force_ratio,
            ..running(Scheme::Wave)
        };
        let by = Impairment {
            delay: TICK * 10,
            ..Impairment::default()
        };
        let lines = Lines {
            up: by,
            up_seed: 1,
            down: by,
            down_seed: 2,
        };
        // 3 cm² of the blade's face in it: 30 N s/m.
        let push = Intent::sensor_force([force_n, 0.0, 0.0]).unwrap();
        let mut rig = embedded(parameters, push, material(1e5, 0.0, 0.0), lines);
        rig.run_for(Duration::from_millis(1000));
        let from_m = rig.device().sample().position_m[0];
        rig.run_for(Duration::from_millis(200));
        let speed_m_s = (rig.device().sample().position_m[0] - from_m) / 0.2;
        let damping = LoopParameters::default().virtual_damping_n_s_per_m;
        let expected = force_n / (damping + 30.0 * position_ratio / force_ratio);
        println!("{position_ratio}, {force_ratio}: {speed_m_s:.5} m/s, theory {expected:.5} m/s");
        assert!(rig.tool().view().position_m[0] < 0.124, "out of the clay");
        assert!(
            (speed_m_s / expected - 1.0).abs() < 0.02,
            "{speed_m_s} m/s, theory {expected}"
        );
    }
}
