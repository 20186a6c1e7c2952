//! Another scheme on a running loop: neither hand nor tool is jolted.

#![allow(
    clippy::float_cmp,
    reason = "a force that is off is exactly zero, and equal runs are equal bit for bit"
)]

mod rigs;

use std::time::Duration;

use rigs::{TICK, both_ways, carving, cutting, distance, line, running};
use teleclay_bilateral::LinkState;
use teleclay_link::conditioner::Impairment;
use teleclay_proto::Material;
use teleclay_proto::Scheme;
use teleclay_sim::rig::Rig;

const SCHEMES: [Scheme; 5] = [
    Scheme::ForceExchange,
    Scheme::PositionForce,
    Scheme::Wave,
    Scheme::Tdpa,
    Scheme::Replica,
];

/// Strokes at 40 mm/s, returns after a hold at 50 mm/s: a tool that moves by this in a tick has leapt, m.
const LEAP_M: f64 = 0.15e-3;
/// A jolt, N in a tick: a fifth of a newton within a millisecond.
const JOLT_N: f64 = 0.2;

fn at_work(scheme: Scheme, line: Impairment) -> Rig {
    let mut rig = carving(
        running(scheme),
        cutting(),
        Material::default(),
        both_ways(line, 1),
    );
    rig.run_for(Duration::from_secs(6));
    assert!(
        0 < rig.session().clay().removed_units(),
        "{scheme:?} does not cut"
    );
    rig
}

/// Largest change of the felt force and of the tool's place in a tick, over `ticks`.
fn largest_steps(rig: &mut Rig, ticks: u32) -> (f64, f64) {
    let (mut force, mut place) = (rig.last().felt_force_n, rig.tool().view().position_m);
    let (mut force_step, mut place_step) = (0.0_f64, 0.0_f64);
    for _ in 0..ticks {
        rig.tick();
        let (next_force, next_place) = (rig.last().felt_force_n, rig.tool().view().position_m);
        force_step = force_step.max(distance(force, next_force));
        place_step = place_step.max(distance(place, next_place));
        (force, place) = (next_force, next_place);
    }
    (force_step, place_step)
}

#[test]
fn changing_the_scheme_jolts_nobody() {
    for to in SCHEMES {
        // What the scheme does by itself: `tdpa` takes force away when the energy is out.
        let (own, _) = largest_steps(&mut at_work(to, line(20, 0.0, 0.0)), 1500);
        for from in SCHEMES {
            let mut rig = at_work(from, line(20, 0.0, 0.0));
            rig.change_scheme(to);
            let (force_step, place_step) = largest_steps(&mut rig, 1500);
            println!(
                "{from:?} to {to:?}: {force_step:.3} N, {:.3} mm",
                place_step * 1e3
            );
            assert!(
                force_step < JOLT_N.max(1.2 * own),
                "{from:?} to {to:?}: {force_step} N, {own} N by itself"
            );
            // A copy takes the tool over where it was a delay ago. Nothing between the two places is cut.
            if to != Scheme::Replica {
                assert!(place_step < LEAP_M, "{from:?} to {to:?}: {place_step} m");
            }
            assert_eq!(rig.handle().scheme(), to);
            assert_eq!(rig.tool().scheme(), to);
        }
    }
}

/// To another scheme and back before the handle has heard of the first change: the ends that meet are not of one age.
#[test]
fn changing_back_at_once_jolts_nobody_and_goes_on() {
    for scheme in SCHEMES {
        for other in SCHEMES {
            let mut rig = at_work(scheme, line(50, 0.2, 0.1));
            rig.change_scheme(other);
            rig.run_for(TICK * 3);
            rig.change_scheme(scheme);
            let (_, place_step) = largest_steps(&mut rig, 1500);
            // Jitter alone makes `position_force` leap, and a copy takes the tool over where it was.
            if !matches!(scheme, Scheme::PositionForce | Scheme::Replica) {
                assert!(
                    place_step < LEAP_M,
                    "{scheme:?} by {other:?}: {place_step} m"
                );
            }
            let removed = rig.session().clay().removed_units();
            rig.run_for(Duration::from_secs(10));
            assert!(
                removed < rig.session().clay().removed_units(),
                "{scheme:?} by {other:?} stands still"
            );
            assert_eq!(rig.handle().scheme(), scheme);
        }
    }
}

/// Five seconds without a line: nothing that was missed is carried out when it comes back.
#[test]
fn after_an_outage_no_scheme_makes_up_for_what_it_missed() {
    for scheme in SCHEMES {
        let mut rig = at_work(scheme, line(5, 0.0, 0.0));
        rig.impair(both_ways(
            Impairment {
                loss: 1.0,
                ..Impairment::default()
            },
            1,
        ));
        rig.run_for(Duration::from_secs(5));
        if scheme == Scheme::Replica {
            assert_eq!(rig.last().link_state, LinkState::OnStaleCopy);
        } else {
            assert_eq!(rig.last().link_state, LinkState::Silent);
            assert_eq!(rig.last().felt_force_n, [0.0; 3], "{scheme:?}");
        }
        rig.impair(both_ways(line(5, 0.0, 0.0), 1));
        // Later on the operator lifts the tool out of the clay, and that is felt as well.
        let (force_step, place_step) = largest_steps(&mut rig, 1500);
        println!("{scheme:?}: {force_step:.3} N, {:.3} mm", place_step * 1e3);
        assert!(force_step < JOLT_N, "{scheme:?}: {force_step} N");
        // The copy was felt all the time, so its tool has moved on; between where it stopped cutting and where it
        // begins again nothing is cut.
        if scheme != Scheme::Replica {
            assert!(place_step < LEAP_M, "{scheme:?}: {place_step} m");
        }
        assert_eq!(rig.last().link_state, LinkState::Live);
    }
}

/// What a switch leaves in the air must not become energy of the scheme that takes over.
#[test]
fn a_passive_scheme_that_takes_over_stays_passive() {
    for from in SCHEMES {
        for to in [Scheme::Wave, Scheme::Tdpa] {
            let mut rig = at_work(from, line(30, 0.3, 0.1));
            rig.change_scheme(to);
            // The old scheme's force fades within a few tenths of a second, and is not the new one's to answer for.
            rig.run_for(Duration::from_millis(500));
            let at_start = rig.energy_j();
            let mut least = f64::INFINITY;
            for _ in 0..6000 {
                rig.tick();
                least = least.min(rig.energy_j() - at_start);
            }
            // In the line at the start: what its tanks may hold, two axes.
            assert!(-0.1 < least, "{from:?} to {to:?}: {least} J");
        }
    }
}
