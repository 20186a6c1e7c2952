//! Clay below yield, as a hand feels it: it holds without ripple, lets go without sticking, and gives back no more than
//! it stores. For every material that has a name and yields, and every scheme.
//!
//! What a preset is as stiff as, follows from this: the handle of \[KHMH03\] answers late, and a spring of more than
//! some hundred newtons a metre makes it swing, whatever the line (docs/materials.md).

#![allow(clippy::print_stdout, reason = "the figures are the result")]

mod rigs;

use std::f64::consts::PI;
use std::time::Duration;

use rigs::{both_ways, carving, running};
use teleclay_link::conditioner::{Impairment, Outages};
use teleclay_operator::Intent;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Axes, Material, Preset, Scheme};

const BALL_M: f64 = 0.0064;
const AREA_M2: f64 = PI * BALL_M * BALL_M;
/// How hard is pressed, of what the clay bears.
const PRESSED: f64 = 0.4;

struct Felt {
    /// Mean force while it holds, N.
    mean_n: f64,
    /// From the least to the greatest force while it holds, of the mean.
    ripple: f64,
    /// Most energy that the hand had got back more than it had given at any time, J.
    given_back_j: f64,
    /// Force at rest after leaving, N.
    left_n: f64,
}

/// A hand presses a ball into clay, holds, and lifts it off again.
fn press(scheme: Scheme, material: Material, line: Impairment) -> Felt {
    let parameters = LoopParameters {
        axes: Axes::Three,
        ..running(scheme)
    };
    let mut rig = carving(parameters, Intent::Idle, material, both_ways(line, 3));
    // Until the copy is there and the ramps are up.
    rig.run_for(Duration::from_millis(1500));
    let pressed_n = PRESSED * material.yield_stress_pa * AREA_M2;
    let push = |force_n: f64| Intent::constant_force([0.0, 0.0, force_n]).unwrap();
    rig.device_mut().intend(push(-pressed_n));
    rig.run_for(Duration::from_secs(4));
    let held_n: Vec<f64> = (0..2000)
        .map(|_| {
            rig.tick();
            rig.last().felt_force_n[2]
        })
        .collect();
    let least_n = held_n.iter().copied().fold(f64::INFINITY, f64::min);
    let most_n = held_n.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mean_n = held_n.iter().sum::<f64>() / held_n.len() as f64;
    rig.device_mut().intend(push(1.0));
    rig.run_for(Duration::from_millis(500));
    rig.device_mut().intend(Intent::Idle);
    rig.run_for(Duration::from_secs(3));
    Felt {
        mean_n,
        ripple: (most_n - least_n) / mean_n.abs(),
        given_back_j: -rig.least_energy_j(),
        left_n: rig.last().felt_force_n[2],
    }
}

/// Each preset that yields, with what its spring stores at most over the whole ball, J.
fn presets() -> impl Iterator<Item = (Preset, Material, f64)> {
    Preset::ALL.into_iter().filter_map(|preset| {
        let material = preset.material();
        let yield_n = material.yield_stress_pa * AREA_M2;
        let stiffness_n_per_m = 2.0 * material.stiffness_pa * BALL_M;
        let stored_j = 0.5 * yield_n * yield_n / stiffness_n_per_m;
        (0.0 < yield_n).then_some((preset, material, stored_j))
    })
}

fn check(scheme: Scheme, line: Impairment) {
    let mut checked = 0;
    for (preset, material, stored_j) in presets() {
        let felt = press(scheme, material, line);
        let Felt {
            mean_n,
            ripple,
            given_back_j,
            left_n,
        } = felt;
        println!(
            "{scheme:14} {preset:14} {mean_n:.3} N, ripple {ripple:.5}, {given_back_j:.1e} of {stored_j:.1e} J, left {left_n:.4} N"
        );
        let pressed_n = PRESSED * material.yield_stress_pa * AREA_M2;
        assert!(0.5 * pressed_n < mean_n, "{preset}: no contact, {mean_n} N");
        assert!(ripple < 0.05, "{preset}: ripple of {ripple}");
        assert!(
            given_back_j < stored_j,
            "{preset}: {given_back_j} J of {stored_j} J"
        );
        assert!(
            left_n.abs() < 0.02 * pressed_n,
            "{preset}: {left_n} N are left"
        );
        checked += 1;
    }
    assert_eq!(checked, 4);
}

#[test]
fn clay_holds_and_lets_go_under_force_exchange() {
    check(Scheme::ForceExchange, Impairment::default());
}

#[test]
fn clay_holds_and_lets_go_under_position_force() {
    check(Scheme::PositionForce, Impairment::default());
}

#[test]
fn clay_holds_and_lets_go_under_wave() {
    check(Scheme::Wave, Impairment::default());
}

/// Time-domain passivity takes energy out in bursts, so it promises no smooth force; it does promise that the hand gets
/// nothing back that it did not give.
#[test]
fn clay_gives_nothing_back_under_tdpa() {
    for (preset, material, stored_j) in presets() {
        let felt = press(Scheme::Tdpa, material, Impairment::default());
        println!(
            "tdpa {preset:14} {:.3} N, ripple {:.3}, {:.1e} of {stored_j:.1e} J, left {:.4} N",
            felt.mean_n, felt.ripple, felt.given_back_j, felt.left_n
        );
        let pressed_n = PRESSED * material.yield_stress_pa * AREA_M2;
        assert!(0.5 * pressed_n < felt.mean_n, "{preset}: no contact");
        assert!(
            felt.given_back_j <= 0.0,
            "{preset}: {} J",
            felt.given_back_j
        );
        assert!(
            felt.left_n.abs() < 0.1,
            "{preset}: {} N are left",
            felt.left_n
        );
    }
}

#[test]
fn clay_holds_and_lets_go_under_the_replica() {
    check(Scheme::Replica, Impairment::default());
}

/// The copy is stale for a fifth of the time: it holds as it does on a perfect line.
#[test]
fn clay_holds_and_lets_go_on_a_stale_copy() {
    let line = Impairment {
        delay: Duration::from_millis(100),
        jitter: Duration::from_millis(10),
        loss: 0.05,
        outages: Some(Outages {
            every: Duration::from_secs(1),
            length: Duration::from_millis(200),
        }),
        ..Impairment::default()
    };
    check(Scheme::Replica, line);
}
