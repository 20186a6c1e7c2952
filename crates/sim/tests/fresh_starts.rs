//! What was before is not carried out later: after a fresh block, and after an outage.

mod rigs;

use std::time::Duration;

use rigs::{both_ways, distance, embedded, line, running, viscous};
use teleclay_operator::Intent;
use teleclay_proto::Scheme;
use teleclay_sim::rig::Rig;

const SCHEMES: [Scheme; 5] = [
    Scheme::ForceExchange,
    Scheme::PositionForce,
    Scheme::Wave,
    Scheme::Tdpa,
    Scheme::Replica,
];

/// Whatever has drifted apart, and whatever was under way: on a fresh block a tool begins at the image of its handle.
#[test]
fn on_a_fresh_block_the_tool_begins_where_its_handle_is() {
    for scheme in SCHEMES {
        let push = Intent::constant_force([1.5, 0.5, 0.0]).unwrap();
        let lines = both_ways(line(10, 0.0, 0.0), 1);
        let mut rig = embedded(running(scheme), push, viscous(1e5), lines);
        rig.run_for(Duration::from_millis(1500));
        let handle_m = rig.device().sample().position_m;
        assert!(
            0.01 < handle_m[0],
            "{scheme}: the handle is at {handle_m:?}"
        );
        rig.hold_handles_fast();
        rig.run_for(Duration::from_millis(500));
        rig.fresh_block();
        rig.run_for(Duration::from_secs(3));
        let apart_m = rig.tool().distance_from_m(rig.device().sample().position_m);
        assert!(apart_m < 1e-4, "{scheme}: {apart_m} m apart");
    }
}

/// The hand pushes, the line dies, the hand lets go, the line comes back. The push that was the last word for a second
/// is over: whatever of it a model of the handle still has must have come to rest meanwhile.
#[test]
fn a_push_from_before_an_outage_is_not_carried_out_after_it() {
    let push = |force_n| Intent::sensor_force([force_n, 0.0, 0.0]).unwrap();
    let alive = both_ways(line(5, 0.0, 0.0), 1);
    let mut rig = embedded(
        running(Scheme::ForceExchange),
        push(2.0),
        viscous(1e5),
        alive,
    );
    rig.run_for(Duration::from_secs(1));
    assert!(0.01 < rig.tool().view().velocity_m_s[0]);
    rig.impair(both_ways(line(5, 0.0, 1.0), 1));
    rig.device_mut().intend(push(0.0));
    rig.run_for(Duration::from_secs(1));
    let before_m = rig.tool().view().position_m[0];
    rig.impair(alive);
    rig.run_for(Duration::from_millis(500));
    let moved_m = rig.tool().view().position_m[0] - before_m;
    assert!(moved_m.abs() < 2e-5, "the tool went on by {moved_m} m");
}

/// A scheme that takes over while nothing is heard begins where the handle was last known to be, and stays there.
#[test]
fn a_scheme_that_takes_over_unheard_moves_nothing() {
    for scheme in SCHEMES {
        let before = if scheme == Scheme::PositionForce {
            Scheme::Replica
        } else {
            Scheme::PositionForce
        };
        let push = Intent::constant_force([1.5, 0.5, 0.0]).unwrap();
        let lines = both_ways(line(2, 0.0, 0.0), 1);
        let mut rig = embedded(running(before), push, viscous(1e5), lines);
        rig.run_for(Duration::from_millis(1500));
        rig.hold_handles_fast();
        rig.run_for(Duration::from_secs(1));
        let stands_m = rig.tool().view().position_m;
        assert!(0.07 < stands_m[0], "{scheme}: the tool is at {stands_m:?}");
        rig.impair(both_ways(line(2, 0.0, 1.0), 1));
        rig.run_for(Duration::from_millis(5));
        rig.change_scheme(scheme);
        // Silence is noticed after 100 ms; until then the tool follows.
        rig.run_for(Duration::from_millis(90));
        let moved_m = distance(rig.tool().view().position_m, stands_m);
        assert!(moved_m < 1e-4, "{before} to {scheme}: {moved_m} m");
    }
}

/// Where the reference is a place and not a motion, a tool that was held gets back to it.
#[test]
fn after_an_outage_position_force_gets_back_to_its_handle() {
    let push = Intent::constant_force([0.4, 0.1, 0.0]).unwrap();
    let alive = both_ways(line(2, 0.0, 0.0), 1);
    let mut rig = embedded(running(Scheme::PositionForce), push, viscous(5e4), alive);
    rig.run_for(Duration::from_secs(1));
    rig.impair(both_ways(line(2, 0.0, 1.0), 1));
    rig.run_for(Duration::from_secs(1));
    let apart_m = |rig: &Rig| rig.tool().distance_from_m(rig.device().sample().position_m);
    assert!(5e-3 < apart_m(&rig), "the hand has not moved on");
    rig.hold_handles_fast();
    rig.impair(alive);
    rig.run_for(Duration::from_secs(3));
    assert!(apart_m(&rig) < 1e-4, "{} m apart", apart_m(&rig));
}
