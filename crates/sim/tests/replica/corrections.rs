//! Corrections of a copy: what another operator's cuts do to the hand, and how they are told.

use std::time::Duration;

use teleclay_clay::{Clay, Shape};
use teleclay_link::Vec3;
use teleclay_link::conditioner::{Impairment, Outages};
use teleclay_operator::{Intent, Waypoint};
use teleclay_proto::frame::Corrections;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Axes, Material, Scheme, ToolDescription};
use teleclay_sim::rig::{Further, Rig, Setup};

use super::{RADIUS_M, assert_clay_is_one, drain};
use crate::rigs::{both_ways, carving, line, norm, running, viscous};

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
pub(crate) fn two_cutting(line: Impairment, seed: u64, apart_m: [f64; 3]) -> Rig {
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

/// Both want the same clay: whoever comes a delay later feels it although it is gone, or finds it gone while cutting.
/// Neither may feel a jolt.
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

/// What a handle tells of its corrections, against what the hand and the copy did: what is held back is the felt force
/// less the copy's own, and the steps are those that it took to nothing. With a gear between hand and clay the bounds
/// are the hand's.
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

/// With two axes the third is lifted by hand and reflects nothing: whoever pushes the tool straight down has felt
/// nothing, so has spent nothing, and corrections may bring nothing in. With three axes it is the hand's own work.
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
