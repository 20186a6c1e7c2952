//! The replica on bad lines: the hand feels none of it, the clay on the server becomes the clay that the hand has cut, and what others do to it comes in
//! gently.

#![allow(
    clippy::float_cmp,
    reason = "a force that is off is exactly zero, and equal runs are equal bit for bit"
)]

mod rigs;

use std::time::Duration;

use rigs::{
    BURSTS, OUTAGES, TICK, both_ways, carving, cutting, embedded, line, norm, running, viscous,
};
use teleclay_bilateral::LinkState;
use teleclay_clay::{Clay, Pose, SOLID, Shape, Sweep, ToolShape};
use teleclay_link::Vec3;
use teleclay_link::conditioner::{Impairment, JitterDistribution, Outages};
use teleclay_link::deadband::DeadbandSettings;
use teleclay_operator::{Intent, Waypoint};
use teleclay_proto::frame::{CopyState, Corrections, SweepRecord};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Axes, Material, Scheme, ToolDescription};
use teleclay_sim::rig::{Further, Rig, Setup};

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

/// The authority computes its own answer to each sweep; with one operator it is what was felt, but for the lattice's rounding of the speed.
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

/// How two operators cut.
struct Strokes {
    position_ratio: f64,
    force_ratio: f64,
    /// How much deeper each stroke is than the one before, m.
    deeper_m: f64,
    /// 1 when the second operator goes along with the first, -1 when it comes the other way.
    second: f64,
    material: Material,
}

/// Two operators in one clay, `apart_m` apart, both cutting the same stroke over and over.
fn two_cutting(line: Impairment, seed: u64, apart_m: [f64; 3]) -> Rig {
    let strokes = Strokes {
        position_ratio: 1.0,
        force_ratio: 1.0,
        deeper_m: 0.0,
        second: -1.0,
        material: Material::default(),
    };
    two_stroking(line, seed, apart_m, &strokes)
}

fn two_stroking(line: Impairment, seed: u64, apart_m: [f64; 3], how: &Strokes) -> Rig {
    let home_m = [0.064, 0.032, 0.064 + RADIUS_M];
    let strokes = |first: f64| {
        let legs: Vec<Waypoint> = (0..12_u32)
            .map(|leg| Waypoint {
                position_m: [
                    if leg % 2 == 0 {
                        0.03 / how.position_ratio * first
                    } else {
                        -0.03 / how.position_ratio * first
                    },
                    0.0,
                    -(0.004 + how.deeper_m * f64::from(leg)) / how.position_ratio,
                ],
                speed_m_s: 0.06 / how.position_ratio,
            })
            .collect();
        Intent::trajectory(&legs).unwrap()
    };
    let setup = Setup {
        parameters: LoopParameters {
            home_m,
            tool: ToolDescription::Ball { radius_m: RADIUS_M },
            position_ratio: how.position_ratio,
            force_ratio: how.force_ratio,
            material: how.material,
            ..running(Scheme::Replica)
        },
        clay: Clay::new(
            &Shape::Block {
                size_m: [0.128, 0.064, 0.064],
            },
            1e-3,
        )
        .unwrap(),
        intent: strokes(1.0),
        lines: both_ways(line, seed),
    };
    let further = Further {
        home_m: std::array::from_fn(|axis| home_m[axis] + apart_m[axis]),
        intent: strokes(how.second),
    };
    Rig::with_further(setup, vec![further]).unwrap()
}

/// Both want the same clay: whoever comes a delay later feels it although it is gone, or finds it gone while cutting. Neither may feel a jolt.
#[test]
fn a_second_writer_jolts_nobody_and_brings_no_energy_that_was_not_earned() {
    let limit_n = 0.07 * LoopParameters::default().force_limit_n;
    for (delay_ms, apart_m) in [(1, 0.002), (25, 0.002), (100, 0.0), (250, 0.004)] {
        let mut rig = two_cutting(line(delay_ms, 0.3, 0.1), 3, [0.0, apart_m, 0.0]);
        let (mut steps, mut hidden) = ([0.0_f64; 2], 0.0_f64);
        for _ in 0..8000 {
            rig.tick();
            for slot in 0..2 {
                let replica = rig.handle_of(slot).clay_copy().unwrap();
                let limiter = replica.copy().unwrap().limiter();
                steps[slot] = steps[slot].max(limiter.step_n());
                assert!(limiter.injected_j() <= limiter.earned_j() + 1e-12);
                // What the other one cut comes as cuts. A snapshot would heal it as well, much later and at once.
                assert!(replica.wanted_snapshot().is_none(), "{delay_ms} ms");
            }
            hidden = hidden.max(norm(rig.tool().view().hidden_force_n));
        }
        drain(&mut rig);
        assert_clay_is_one(&rig, "two writers");
        println!("{delay_ms} ms: steps {steps:.3?} N, hid {hidden:.3} N");
        for step in steps {
            assert!(
                0.0 < step,
                "nothing was ever corrected, so nothing is shown"
            );
            assert!(step <= limit_n, "{step} N in a tick");
        }
    }
}

/// What a handle tells of its corrections, against what the hand and the copy did: what is held back is the felt force less the copy's own, and the
/// steps are those that it took to nothing. With a gear between hand and clay the bounds are the hand's.
#[test]
fn corrections_are_told_as_the_hand_felt_them() {
    for (position_ratio, force_ratio) in [(1.0, 1.0), (1.5, 0.25), (0.5, 2.0)] {
        let case = format!("ratios {position_ratio} and {force_ratio}");
        let outages = Impairment {
            outages: Some(Outages {
                every: Duration::from_secs(3),
                length: Duration::from_secs(1),
            }),
            ..line(25, 0.3, 0.1)
        };
        let strokes = Strokes {
            position_ratio,
            force_ratio,
            deeper_m: 0.003,
            second: 1.0,
            material: viscous(1e6 * force_ratio),
        };
        let mut rig = two_stroking(outages, 3, [0.003, 0.001, 0.0], &strokes);
        let limit_n = 0.07 * LoopParameters::default().force_limit_n;
        rig.run_for(Duration::from_secs(1));
        let start = rig.handle().frame().corrections;
        let (mut held, mut count) = (Vec3::zeros(), start.count);
        let (mut most_held_n, mut moved_n, mut largest_n) = (0.0_f64, 0.0_f64, 0.0_f64);
        for _ in 0..7000 {
            rig.tick();
            let told = rig.handle().frame().corrections;
            let copy = rig.handle().clay_copy().unwrap().copy().unwrap();
            let mut own = copy.answer() / force_ratio;
            own.z = 0.0; // only lifted, so nothing of it is felt
            let before = std::mem::replace(&mut held, Vec3::from(rig.last().felt_force_n) - own);
            // Single precision on the wire.
            let off_n = (held - Vec3::from(told.held_n.map(f64::from))).norm();
            assert!(
                off_n <= 1e-6 * (1.0 + held.norm()),
                "{case}: off by {off_n} N"
            );
            if told.count == count {
                // Nothing was corrected in this tick, so what is held back moved by the limiter's step.
                let step_n = (held - before).norm();
                moved_n += step_n;
                largest_n = largest_n.max(step_n);
            }
            count = told.count;
            most_held_n = most_held_n.max(held.norm());
            assert!(f64::from(told.largest_step_n) <= limit_n, "{case}");
            assert!((0.0..=0.0501).contains(&told.tank_j), "{case}");
        }
        let told = rig.handle().frame().corrections;
        println!("{case}: {told:?}; at most {most_held_n:.3} N held, {moved_n:.3} N moved alone");
        assert!(start.count < told.count, "{case}: nothing was corrected");
        assert!(0.2 < most_held_n, "{case}: nothing was held back");
        assert!(largest_n <= f64::from(told.largest_step_n) + 1e-6, "{case}");
        assert!(0.9 * f64::from(told.largest_step_n) < largest_n, "{case}");
        let since_n = told.moved_n - start.moved_n;
        assert!(0.2 < moved_n && moved_n <= since_n + 1e-6, "{case}");
        let limiter = *rig.handle().clay_copy().unwrap().copy().unwrap().limiter();
        assert!((told.moved_n * force_ratio - limiter.moved_n()).abs() < 1e-9);
        let injected_j = f64::from(told.injected_j) * position_ratio * force_ratio;
        assert!((injected_j - limiter.injected_j()).abs() < 1e-6 * (1.0 + injected_j));
        drain(&mut rig);
        let known = rig.tool().view().corrections;
        assert_eq!(known, rig.handle().frame().corrections, "{case}");
        // Another scheme has no copy, so nothing to correct.
        rig.change_scheme(Scheme::Tdpa);
        rig.run_for(Duration::from_millis(200));
        assert_eq!(rig.handle().frame().corrections, Corrections::default());
        assert_eq!(rig.tool().view().corrections, Corrections::default());
    }
}

/// With two axes the third is lifted by hand and reflects nothing: whoever pushes the tool straight down has felt nothing, so has spent nothing, and
/// corrections may bring nothing in. With three axes it is the hand's own work.
#[test]
fn only_work_that_the_hand_felt_fills_the_tank() {
    let earned_j = |axes| {
        let down = Waypoint {
            position_m: [0.0, 0.0, -0.01],
            speed_m_s: 0.02,
        };
        let parameters = LoopParameters {
            axes,
            ..running(Scheme::Replica)
        };
        let mut rig = carving(
            parameters,
            Intent::trajectory(&[down]).unwrap(),
            Material::default(),
            both_ways(line(5, 0.0, 0.0), 1),
        );
        rig.run_for(Duration::from_secs(2));
        assert!(0 < rig.session().clay().removed_units());
        rig.clay_copy()
            .unwrap()
            .copy()
            .unwrap()
            .limiter()
            .earned_j()
    };
    let [two, three] = [Axes::Two, Axes::Three].map(earned_j);
    println!("{two} J with two axes, {three} J with three");
    assert!(1e-4 < three);
    assert!(two < 1e-3 * three);
}

/// Something cuts the server's clay and tells nobody. The hashes tell, a snapshot heals, and what the hand cut meanwhile stays cut.
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

/// The server judges what it merges: a sweep that no tool can have made in a tick, and one from out of reach, are refused and cut nothing.
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

/// A refusal says that the two differ, in the middle of a cut. One snapshot heals it, for what the hand has cut since it was taken is repeated on it.
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
fn on_a_long_silence_the_copy_is_felt_but_no_longer_cut_and_nothing_is_lost() {
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
    let mut felt = 0.0_f64;
    for _ in 0..2800 {
        rig.tick();
        felt = felt.max(norm(rig.last().felt_force_n));
    }
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
