//! The replica on bad lines: the hand feels none of it, the clay on the server becomes the clay that the hand has cut,
//! and what others do to it comes in gently.

#![allow(
    clippy::float_cmp,
    reason = "a force that is off is exactly zero, and equal runs are equal bit for bit"
)]

mod corrections;
#[path = "../rigs/mod.rs"]
mod rigs;

use std::time::Duration;

use corrections::two_cutting;
use rigs::{
    BURSTS, OUTAGES, TICK, both_ways, carving, cutting, embedded, line, norm, running, viscous,
};
use teleclay_bilateral::LinkState;
use teleclay_clay::{Pose, SOLID, Sweep, ToolShape};
use teleclay_link::conditioner::{Impairment, JitterDistribution};
use teleclay_link::deadband::DeadbandSettings;
use teleclay_operator::Intent;
use teleclay_proto::frame::{CopyState, SweepRecord};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Material, Scheme};
use teleclay_sim::rig::Rig;

const RADIUS_M: f64 = 0.0064;

fn cutting_over(line: Impairment, seed: u64) -> Rig {
    carving(
        running(Scheme::Replica),
        cutting(),
        Material::default(),
        both_ways(line, seed),
    )
}

/// Everything that a run does to the hand and to its copy of the clay, as bits.
fn felt_by_hand(rig: &mut Rig, span: Duration) -> Vec<[u64; 6]> {
    let mut all = Vec::new();
    let end = rig.now().after(span);
    while rig.now() < end {
        rig.tick();
        let (felt, at) = (rig.last().felt_force_n, rig.device().sample().position_m);
        let [fx, fy, fz] = felt.map(f64::to_bits);
        let [x, y, z] = at.map(f64::to_bits);
        all.push([fx, fy, fz, x, y, z]);
    }
    all
}

/// The handle rests, and the line delivers what it still holds.
fn drain(rig: &mut Rig) {
    rig.hold_handles_fast();
    rig.run_for(Duration::from_secs(5));
}

fn hash_at_handle(rig: &Rig, slot: usize) -> u64 {
    let copy = rig.handle_of(slot).clay_copy().unwrap().copy().unwrap();
    copy.clay().clone().hash()
}

fn hash_at_server(rig: &Rig) -> u64 {
    rig.session().clay().clone().hash()
}

fn assert_clay_is_one(rig: &Rig, what: &str) {
    for slot in 0..rig.session().tools() {
        let replica = rig.handle_of(slot).clay_copy().unwrap();
        assert_eq!(
            replica.log().waiting(),
            0,
            "{what}: sweeps of {slot} were never acknowledged"
        );
        assert_eq!(
            hash_at_handle(rig, slot),
            hash_at_server(rig),
            "{what}: the copy of {slot} differs"
        );
    }
}

fn bad_lines() -> Vec<(&'static str, Impairment)> {
    let mut lines = Vec::new();
    for delay_ms in [1, 5, 25, 100, 250] {
        lines.push(("delay", line(delay_ms, 0.0, 0.0)));
        lines.push(("jitter and loss", line(delay_ms, 0.5, 0.3)));
    }
    let steady = line(100, 0.0, 0.0);
    lines.push((
        "bursts",
        Impairment {
            bursts: Some(BURSTS),
            ..steady
        },
    ));
    lines.push((
        "outages",
        Impairment {
            outages: Some(OUTAGES),
            ..steady
        },
    ));
    lines.push((
        "copies and overtaking",
        Impairment {
            duplicate: 0.3,
            reorder: 0.2,
            ..steady
        },
    ));
    lines.push((
        "all at once",
        Impairment {
            jitter: steady.delay / 2,
            distribution: JitterDistribution::HeavyTailed,
            loss: 0.2,
            duplicate: 0.2,
            reorder: 0.1,
            bursts: Some(BURSTS),
            outages: Some(OUTAGES),
            ..steady
        },
    ));
    lines
}

/// One operator: bit for bit what it would be without a network, on any line.
#[test]
fn the_hand_feels_no_network_and_the_server_gets_the_same_clay() {
    let span = Duration::from_secs(7);
    let mut ideal = cutting_over(Impairment::default(), 1);
    let felt_ideally = felt_by_hand(&mut ideal, span);
    drain(&mut ideal);
    assert_clay_is_one(&ideal, "no network");
    let strong = felt_ideally
        .iter()
        .filter(|bits| 0.2 < norm([0, 1, 2].map(|at| f64::from_bits(bits[at]))));
    assert!(2000 < strong.count(), "the hand felt nothing to speak of");
    for (seed, (what, line)) in (2..).zip(bad_lines()) {
        let mut rig = cutting_over(line, seed);
        let felt = felt_by_hand(&mut rig, span);
        assert!(felt == felt_ideally, "{what}, {line:?}: the hand felt it");
        drain(&mut rig);
        assert_clay_is_one(&rig, what);
        assert_eq!(
            hash_at_server(&rig),
            hash_at_server(&ideal),
            "{what}, {line:?}: other clay"
        );
        let replica = rig.clay_copy().unwrap();
        assert_eq!(rig.tool().view().sweeps_refused, 0, "{what}");
        assert!(
            replica.wanted_snapshot().is_none() && replica.state() == CopyState::Live,
            "{what}"
        );
    }
}

/// The authority computes its own answer to each sweep; with one operator it is what was felt, but for the lattice's
/// rounding of the speed.
#[test]
fn with_one_operator_the_authority_would_have_answered_the_same() {
    for line in [line(0, 0.0, 0.0), line(100, 0.0, 0.0)] {
        let mut rig = cutting_over(line, 1);
        let (mut worst, mut strongest) = (0.0_f64, 0.0_f64);
        for _ in 0..7000 {
            rig.tick();
            let view = rig.tool().view();
            worst = worst.max(norm(view.hidden_force_n));
            strongest = strongest.max(norm(view.force_n));
        }
        println!("{line:?}: hid {worst:.5} N at most of {strongest:.3} N");
        assert!(0.5 < strongest);
        assert!(worst < 0.01 * strongest, "hid {worst} N");
    }
}

/// Something cuts the server's clay and tells nobody. The hashes tell, a snapshot heals, and what the hand cut
/// meanwhile stays cut.
#[test]
fn clay_that_came_to_differ_is_found_and_healed() {
    let mut rig = cutting_over(line(50, 0.2, 0.1), 5);
    rig.run_for(Duration::from_secs(4));
    let shape = ToolShape::ball(0.005).unwrap();
    let at = |x: f64| Pose::quantise([x, 0.05, 0.02]).unwrap();
    let unseen = Sweep {
        shape,
        from: at(0.02),
        to: at(0.1),
    };
    assert!(0 < rig.session_mut().clay_mut().carve(&unseen));
    let before = rig
        .clay_copy()
        .unwrap()
        .copy()
        .unwrap()
        .clay()
        .removed_units();
    rig.run_for(Duration::from_secs(8));
    let mut steepest = 0.0_f64;
    for _ in 0..2000 {
        rig.tick();
        steepest = steepest.max(rig.clay_copy().unwrap().copy().unwrap().limiter().step_n());
    }
    drain(&mut rig);
    assert_clay_is_one(&rig, "after healing");
    assert!(
        before
            < rig
                .clay_copy()
                .unwrap()
                .copy()
                .unwrap()
                .clay()
                .removed_units()
    );
    assert_eq!(rig.clay_copy().unwrap().state(), CopyState::Live);
    assert!(steepest <= 0.07 * LoopParameters::default().force_limit_n);
}

/// What is sent is what was cut: the tool's way without a gap, on the lattice.
#[test]
fn every_sweep_begins_where_the_last_one_ended() {
    let mut rig = cutting_over(line(5, 0.0, 0.0), 1);
    rig.run_for(Duration::from_secs(4));
    let replica = rig.clay_copy().unwrap();
    let log = replica.log();
    let sweeps: Vec<_> = (1..=log.last())
        .filter_map(|number| log.record(number))
        .collect();
    assert!(1000 < sweeps.len());
    for pair in sweeps.windows(2) {
        assert_eq!(
            pair[0].to, pair[1].from,
            "after number {}",
            pair[0].sequence
        );
    }
    assert_eq!(
        sweeps[sweeps.len() - 1].to,
        replica.copy().unwrap().pose().steps()
    );
}

/// The server judges what it merges: a sweep that no tool can have made in a tick, and one from out of reach, are
/// refused and cut nothing.
#[test]
fn a_sweep_that_cannot_have_been_is_refused() {
    let mut rig = cutting_over(Impairment::default(), 1);
    rig.run_for(Duration::from_secs(4));
    rig.hold_handles_fast();
    rig.run_for(Duration::from_millis(200));
    let removed = rig.session().clay().removed_units();
    let mut forged = rig.handle().frame().clone();
    let next = rig.clay_copy().unwrap().log().last() + 1;
    let at = |x: f64| Pose::quantise([x, 0.032, 0.03]).unwrap().steps();
    forged.header.sequence = forged.header.sequence.wrapping_add(1);
    forged.sweeps.clear();
    for (number, from, to) in [(next, at(0.02), at(0.10)), (next + 1, at(2.0), at(2.0))] {
        let record = SweepRecord {
            sequence: number,
            from,
            to,
        };
        forged.sweeps.push(record).unwrap();
    }
    let now = rig.now();
    rig.session_mut().handle_frame(now, 0, &forged);
    rig.run_for(TICK * 3);
    assert_eq!(rig.tool().view().sweeps_refused, 2);
    assert_eq!(rig.session().clay().removed_units(), removed);
}

/// A refusal says that the two differ, in the middle of a cut. One snapshot heals it, for what the hand has cut since
/// it was taken is repeated on it.
#[test]
fn one_snapshot_heals_a_copy_that_is_being_cut() {
    let mut rig = cutting_over(line(50, 0.0, 0.0), 1);
    rig.run_for(Duration::from_secs(4));
    let mut forged = rig.handle().frame().clone();
    // A number that the hand does not come to in this test.
    let number = rig.clay_copy().unwrap().log().last() + 6000;
    let out_of_reach = Pose::quantise([2.0, 0.0, 0.0]).unwrap().steps();
    forged.header.sequence = forged.header.sequence.wrapping_add(1);
    forged.sweeps.clear();
    let record = SweepRecord {
        sequence: number,
        from: out_of_reach,
        to: out_of_reach,
    };
    forged.sweeps.push(record).unwrap();
    let now = rig.now();
    rig.session_mut().handle_frame(now, 0, &forged);
    let mut snapshots = 0;
    for _ in 0..8000 {
        if rig.now() == now.after(Duration::from_secs(3)) {
            rig.hold_handles_fast();
        }
        rig.tick();
        let wanted = rig.clay_copy().unwrap().wanted_snapshot();
        snapshots = snapshots.max(wanted.map_or(0, |wanted| wanted.number));
    }
    assert_eq!(rig.tool().view().sweeps_refused, 1);
    assert_eq!(snapshots, 1);
    assert_clay_is_one(&rig, "healed");
}

/// Five seconds without a line, in the middle of a cut.
#[test]
fn on_a_long_silence_the_copy_is_no_longer_cut_its_force_fades_and_nothing_is_lost() {
    let steady = line(20, 0.0, 0.0);
    let mut rig = embedded(
        running(Scheme::Replica),
        Intent::sinusoid([1.5, 0.5, 0.0], 0.7).unwrap(),
        viscous(2e5),
        both_ways(steady, 1),
    );
    rig.run_for(Duration::from_secs(2));
    rig.impair(both_ways(
        Impairment {
            loss: 1.0,
            ..steady
        },
        1,
    ));
    rig.run_for(Duration::from_millis(300));
    assert_eq!(rig.last().link_state, LinkState::OnCopy);
    rig.run_for(Duration::from_millis(1900));
    assert_eq!(rig.last().link_state, LinkState::OnStaleCopy);
    let cut_by_then = rig
        .clay_copy()
        .unwrap()
        .copy()
        .unwrap()
        .clay()
        .removed_units();
    // A force of the copy is there, and gone a second after the copy became stale.
    let mut felt = 0.0_f64;
    let (mut before, mut step) = (rig.last().felt_force_n, 0.0_f64);
    for millisecond in 0..2800 {
        rig.tick();
        let now = rig.last().felt_force_n;
        step = step.max(rigs::distance(now, before));
        before = now;
        felt = felt.max(norm(now));
        // It became stale in the 200 ms before these.
        if 1000 <= millisecond {
            assert_eq!(now, [0.0; 3], "{millisecond} ms");
        }
    }
    assert!(step <= 2.0, "{step} N in a tick");
    assert_eq!(
        rig.clay_copy()
            .unwrap()
            .copy()
            .unwrap()
            .clay()
            .removed_units(),
        cut_by_then,
        "cut with nobody to merge it"
    );
    assert!(0.3 < felt, "felt only {felt} N");
    rig.impair(both_ways(steady, 1));
    rig.run_for(Duration::from_secs(3));
    assert_eq!(rig.last().link_state, LinkState::Live);
    drain(&mut rig);
    assert_clay_is_one(&rig, "after the silence");
    assert_eq!(rig.tool().view().sweeps_refused, 0);
    assert!(
        cut_by_then < rig.session().clay().removed_units(),
        "never cut again"
    );
}

/// A pause that the handle hears of late: what it cut meanwhile is a fact, what it would cut afterwards is not.
#[test]
fn a_pause_loses_no_cut_and_stops_all_further_ones() {
    let mut rig = cutting_over(line(100, 0.2, 0.1), 2);
    rig.run_for(Duration::from_secs(4));
    rig.pause();
    rig.run_for(Duration::from_secs(3));
    assert_eq!(rig.last().link_state, LinkState::Paused);
    let removed = rig.session().clay().removed_units();
    rig.run_for(Duration::from_secs(2));
    assert_eq!(rig.session().clay().removed_units(), removed);
    assert_eq!(rig.last().felt_force_n, [0.0; 3]);
    rig.resume();
    rig.run_for(Duration::from_secs(4));
    assert!(removed < rig.session().clay().removed_units());
    drain(&mut rig);
    assert_clay_is_one(&rig, "resumed");
    assert_eq!(rig.tool().view().sweeps_refused, 0);
}

/// A fresh block while sweeps of the old one are under way: none of them may show in it.
#[test]
fn sweeps_of_a_block_that_is_gone_do_not_cut_the_fresh_one() {
    let mut rig = cutting_over(line(100, 0.5, 0.3), 2);
    rig.run_for(Duration::from_secs(5));
    // The handle rests from here on; the line is full of its sweeps.
    let began = [21, 14, 62];
    assert_eq!(rig.session().clay().occupancy(began), 0);
    rig.hold_handles_fast();
    rig.run_for(TICK * 20);
    assert!(0 < rig.clay_copy().unwrap().log().waiting());
    rig.fresh_block();
    rig.run_for(Duration::from_secs(6));
    // The tool clears the place where it stands, and that is all: where the first stroke began there is clay again.
    assert_eq!(rig.session().clay().occupancy(began), SOLID);
    let removed = rig.session().clay().removed_units();
    let ball_m3 = 4.0 / 3.0 * std::f64::consts::PI * RADIUS_M.powi(3);
    let removed_m3 = removed as f64 * rig.session().clay().unit_volume_m3();
    assert!(removed_m3 < 2.0 * ball_m3, "{removed_m3} m³");
    assert_clay_is_one(&rig, "fresh");
    rig.let_handles_go();
    rig.device_mut().intend(cutting());
    rig.run_for(Duration::from_secs(6));
    assert!(
        removed < rig.session().clay().removed_units(),
        "the fresh block is never cut"
    );
    drain(&mut rig);
    assert_clay_is_one(&rig, "cut again");
}

/// To replica on a running loop, on a bad line: the copy comes, and is the server's.
#[test]
fn a_copy_that_comes_late_is_the_clay_as_it_is() {
    for from in [Scheme::ForceExchange, Scheme::Tdpa] {
        let mut rig = carving(
            running(from),
            cutting(),
            Material::default(),
            both_ways(line(40, 0.2, 0.1), 3),
        );
        rig.run_for(Duration::from_secs(5));
        assert!(0 < rig.session().clay().removed_units());
        rig.change_scheme(Scheme::Replica);
        rig.run_for(Duration::from_secs(4));
        assert_eq!(rig.clay_copy().unwrap().state(), CopyState::Live);
        drain(&mut rig);
        assert_clay_is_one(&rig, "late copy");
        rig.let_handles_go();
        rig.change_scheme(from);
        rig.device_mut().intend(cutting());
        rig.run_for(Duration::from_secs(4));
        assert!(rig.clay_copy().is_none());
    }
}

#[test]
fn packets_left_out_change_neither_clay_nor_feeling() {
    let mut whole = cutting_over(line(50, 0.2, 0.1), 4);
    let mut sparse = cutting_over(line(50, 0.2, 0.1), 4);
    sparse
        .code_perceptually(DeadbandSettings::default())
        .unwrap();
    let span = Duration::from_secs(7);
    assert!(felt_by_hand(&mut whole, span) == felt_by_hand(&mut sparse, span));
    let [up, down] = sparse.frames_sent();
    println!("{up} up, {down} down of 7000 each");
    assert!(up + down < 14_000 / 5, "{up} up, {down} down");
    for rig in [&mut whole, &mut sparse] {
        drain(rig);
        assert_clay_is_one(rig, "sparse or not");
    }
    assert_eq!(hash_at_server(&whole), hash_at_server(&sparse));
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    let run = || {
        let mut rig = two_cutting(line(30, 0.5, 0.2), 11, [0.0, 0.003, 0.0]);
        let felt = felt_by_hand(&mut rig, Duration::from_secs(4));
        (felt, hash_at_server(&rig))
    };
    assert!(run() == run());
}
