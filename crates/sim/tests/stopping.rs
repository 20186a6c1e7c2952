//! What a stop is to the hand: the end of a lease, under every scheme. The force goes to exactly zero within silence
//! and ramp, by the slew; a hand on a copy of the clay needs the server's farewell for that. No clay is cut any more.
#![allow(clippy::float_cmp, reason = "a force that is off is exactly zero")]

mod rigs;

use std::time::Duration;

use rigs::{both_ways, carving, cutting, line, norm, running};
use teleclay_proto::{Material, Scheme};
use teleclay_session::Prepared;
use teleclay_sim::rig::Rig;

fn pressing(scheme: Scheme, delay_ms: u32) -> Rig {
    let lines = both_ways(line(delay_ms, 0.0, 0.0), 7);
    let mut rig = carving(running(scheme), cutting(), Material::default(), lines);
    // A scheme that lets its force go now and then is stopped while it presses.
    rig.run_for(Duration::from_secs(1));
    while norm(rig.last().felt_force_n) < 0.2 {
        assert!(
            rig.now().as_nanos() < 5_000_000_000,
            "{scheme} never presses"
        );
        rig.tick();
    }
    rig
}

fn stop(rig: &mut Rig) {
    let now = rig.now();
    let mut prepared = Prepared::stop("Eve", "a hand in the way");
    let stopped = rig.session_mut().handle_command(now, &mut prepared);
    stopped.unwrap();
}

/// Ticks until the force is zero for good, with the slew looked after on the way.
fn ticks_until_released(rig: &mut Rig, what: &str) -> u32 {
    let parameters = rig.session().settings().parameters;
    let most_n = parameters.slew_limit_n_per_s * parameters.tick_s * (1.0 + 1e-9);
    let removed = rig.session().clay().removed_units();
    let (mut before, mut last) = (rig.last().felt_force_n, 0);
    for tick in 1..=4_000 {
        rig.tick();
        let felt = rig.last().felt_force_n;
        let step = norm(std::array::from_fn(|axis| felt[axis] - before[axis]));
        assert!(step <= most_n, "{what}: a step of {step} N");
        if norm(felt) != 0.0 {
            last = tick;
        }
        before = felt;
    }
    assert_eq!(rig.session().clay().removed_units(), removed, "{what}");
    last
}

#[test]
fn a_stop_lets_go_of_every_hand_within_silence_and_ramp() {
    for scheme in Scheme::ALL {
        for delay_ms in [0, 40] {
            let mut rig = pressing(*scheme, delay_ms);
            stop(&mut rig);
            if *scheme == Scheme::Replica {
                let now = rig.now();
                rig.handle_mut().handle_peer_gone(now);
            }
            let what = format!("{scheme} over {delay_ms} ms");
            let ticks = ticks_until_released(&mut rig, &what);
            // Frames that were on their way are not taken back, nor heard: the line is cleared.
            assert!((1..=151).contains(&ticks), "{what}: {ticks} ms");
        }
    }
}

/// Without a farewell a hand on a copy goes on for as long as on a silent line, and no longer.
#[test]
fn a_stop_that_a_hand_on_a_copy_does_not_hear_of_is_a_silence_to_it() {
    let mut rig = pressing(Scheme::Replica, 0);
    stop(&mut rig);
    let ticks = ticks_until_released(&mut rig, "replica without a farewell");
    assert!((151..=3_151).contains(&ticks), "{ticks} ms");
}
