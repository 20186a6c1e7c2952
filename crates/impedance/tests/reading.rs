//! What drivers tell of their devices, and when they tell nothing: it is held to, waited for, or not taken at all.

#![allow(
    clippy::float_cmp,
    reason = "no force is zero, and the same bits are the same"
)]

mod rigs;

use rigs::{Chance, PROFILE, TICK_NS, TICK_S, minus, norm, rendering};
use teleclay_impedance::{Coupling, CouplingSetup, GraspState, HandlePlace, Playback, Taken};

/// What rounding may add, over the bound.
const ROUNDING: f64 = 1.0 + 1e-9;

fn pointer() -> CouplingSetup {
    CouplingSetup::without_feedback(60.0, 10.0, TICK_S, PROFILE)
}

fn at(x: f64) -> HandlePlace {
    HandlePlace {
        position_m: [x, 0.0, 0.0],
        ..HandlePlace::default()
    }
}

/// Held with the device at home and the handle at home, since tick 0.
fn held(setup: CouplingSetup) -> Coupling {
    let mut coupling = Coupling::new(setup).unwrap();
    coupling.hold();
    coupling.sample(0, 0, [0.0; 3]);
    assert_eq!(coupling.step(0, &at(0.0)).state, GraspState::Held);
    coupling
}

/// Whatever a driver tells of its device, the force stays within the bounds and is a number.
#[test]
fn no_samples_whatever_pass_the_bounds() {
    for seed in 0..200 {
        let mut chance = Chance(seed);
        let playback = if seed % 2 == 0 {
            Playback::Held
        } else {
            Playback::Interpolated
        };
        let slow = CouplingSetup {
            stiffness_n_per_m: 120.0,
            damping_n_s_per_m: 0.1,
            playback,
            ..rendering()
        };
        let mut coupling = Coupling::new(slow).unwrap();
        let (mut before, mut clock) = ([0.0; 3], 0_u64);
        let mut felt = 0.0_f64;
        let mut place = HandlePlace::default();
        for tick in 0..3000_u64 {
            let now = tick * TICK_NS;
            coupling.hold();
            clock = match chance.below(20) {
                0 => 0,
                1 => u64::MAX,
                2 => clock,
                3 => now.saturating_sub(chance.below(10_000_000)),
                _ => now,
            };
            let mut position = [0.001 * (tick as f64 * 0.02).sin() * 20.0, 0.0, 0.0];
            match chance.below(30) {
                0 => position = [f64::NAN; 3],
                1 => position[1] = f64::INFINITY,
                2 => position[2] = -f64::MAX,
                3 => position[0] += 1.0,
                4 => position = chance.vector(200.0),
                5 => position[0] = 5e-324,
                _ => {}
            }
            for _ in 0..chance.below(4) {
                coupling.sample(now, clock, position);
            }
            match chance.below(200) {
                0 => place.position_m[0] = f64::NAN,
                1 => {
                    place = HandlePlace {
                        position_m: chance.vector(1e3),
                        velocity_m_s: chance.vector(1e4),
                    }
                }
                2..6 => place = HandlePlace::default(),
                _ => {}
            }
            let step = coupling.step(now, &place);
            let (force, device) = (step.hand_force_n, step.device_force_n);
            assert!(
                force
                    .iter()
                    .chain(&device)
                    .chain(&step.target_m)
                    .all(|part| part.is_finite()),
                "{step:?}"
            );
            assert!(norm(force) <= 20.0 * ROUNDING && norm(device) <= 20.0 * ROUNDING);
            assert!(
                norm(minus(force, before)) <= 2.0 * ROUNDING,
                "{seed} {tick}: {before:?}, {force:?}"
            );
            felt = felt.max(norm(force));
            before = force;
        }
        assert!(0.0 < felt, "{seed}: nothing was held at all");
    }
}

/// A finger that is lifted and put down a metre away has not moved the handle; nor has a glitch, there and back.
#[test]
fn a_leap_moves_the_grip_and_not_the_handle() {
    for setup in [
        pointer(),
        CouplingSetup {
            axes: 3,
            ..rendering()
        },
    ] {
        let mut coupling = held(setup);
        let mut leaps = 0;
        let mut before = 0.0;
        for tick in 1..2000_u64 {
            let now = tick * TICK_NS;
            let mut place = [0.002, 0.0, 0.0];
            match tick {
                0..=200 => place = [1e-5 * tick as f64, 0.0, 0.0],
                500..800 => place[0] += 1.0,
                1000 => place[1] -= 1.0,
                1200.. => place[0] += 1e-3 * ((tick - 1200) as f64 / 100.0).min(1.0),
                _ => {}
            }
            leaps += u32::from(coupling.sample(now, now, place) == Taken::Leapt);
            let force = coupling.step(now, &at(0.0)).hand_force_n;
            assert!(
                norm(minus(force, [before, 0.0, 0.0])) < 0.31,
                "at {tick}: {force:?} after {before}"
            );
            if tick == 1199 {
                let wanted = setup.stiffness_n_per_m * 0.002;
                assert!(
                    (force[0] - wanted).abs() < 1e-6,
                    "{force:?}, {wanted} N before the leaps"
                );
            }
            before = force[0];
        }
        assert_eq!(leaps, 4);
        assert!(
            (before - setup.stiffness_n_per_m * 0.003).abs() < 1e-3,
            "{before} N"
        );
    }
}

/// What does not come is waited for, then let go of: within `hold_s` and `ramp_s` the force is exactly zero, and no
/// force ever points to where nobody has been.
#[test]
fn a_device_that_falls_silent_is_let_go_of_within_hold_and_ramp() {
    let lives = [pointer(), rendering()].map(|setup| [299, 300, 301].map(|end| (setup, end)));
    for (setup, end) in lives.into_iter().flatten() {
        let mut coupling = held(setup);
        let mut last = 0;
        for tick in 1..=end {
            let now = tick * TICK_NS;
            // On the move at 0.2 m/s when it is lost.
            coupling.sample(now, now, [0.2 * tick as f64 * TICK_S, 0.0, 0.0]);
            coupling.step(now, &at(0.0));
            last = tick;
        }
        let place = 0.2 * last as f64 * TICK_S;
        let (mut most, mut rested, mut reached) = (0.0_f64, None, 0.0);
        for tick in last + 1..last + 400 {
            let step = coupling.step(tick * TICK_NS, &at(0.0));
            most = most.max(step.hand_force_n[0]);
            assert!(
                step.target_m[0] <= place * ROUNDING,
                "drawn beyond where the device was seen"
            );
            reached = step.target_m[0];
            if step.hand_force_n == [0.0; 3] {
                rested = rested.or(Some((tick - last) as f64 * TICK_S));
                assert_eq!(step.state, GraspState::Waiting);
            } else {
                assert!(rested.is_none(), "a force comes back from nothing");
            }
        }
        let bound_s = setup.hold_s + setup.ramp_s;
        assert!(
            (reached - place).abs() < 1e-12,
            "the last sample is not played: {reached}, {place}"
        );
        let rested = rested.unwrap();
        assert!(rested <= bound_s + 2.0 * TICK_S, "{rested} s, {bound_s} s");
        assert!(
            setup.hold_s < rested,
            "{rested} s: let go of before it was missed"
        );
        let steady = setup.stiffness_n_per_m * place + setup.damping_n_s_per_m * 0.2;
        assert!(most <= steady * ROUNDING, "{most} N of {steady} N");
        // It is taken hold of again by itself, where both are then.
        let now = (last + 400) * TICK_NS;
        coupling.sample(now, now, [0.9, 0.4, 0.0]);
        let step = coupling.step(now, &at(0.0));
        assert_eq!(
            (step.state, step.hand_force_n),
            (GraspState::Held, [0.0; 3])
        );
        // And nothing of where it was is made up for.
        for tick in last + 401..last + 500 {
            let now = tick * TICK_NS;
            coupling.sample(now, now, [0.9, 0.4, 0.0]);
            assert!(norm(coupling.step(now, &at(0.0)).hand_force_n) < 1e-12);
        }
    }
}

/// A sample that is late is caught up with at the speed that a hand has, not at once.
#[test]
fn a_late_sample_moves_the_handle_no_faster_than_a_hand() {
    let setup = pointer();
    let mut coupling = held(setup);
    let mut before = 0.0;
    for tick in 1..200_u64 {
        let now = tick * TICK_NS;
        if tick < 50 || 80 <= tick {
            coupling.sample(now, now, [if tick < 50 { 0.0 } else { 0.028 }, 0.0, 0.0]);
        }
        let target = coupling.step(now, &at(0.0)).target_m[0];
        assert!(
            target - before <= setup.device_speed_m_s * TICK_S * ROUNDING,
            "{target} after {before}"
        );
        before = target;
    }
    assert!((before - 0.028).abs() < 1e-12, "{before}");
}

#[test]
fn a_sample_counts_once_in_order_and_not_when_it_waited() {
    let mut coupling = held(rendering());
    let ms = TICK_NS;
    assert_eq!(
        coupling.sample(5 * ms, 2 * ms, [1e-4, 0.0, 0.0]),
        Taken::Used
    );
    assert_eq!(
        coupling.sample(5 * ms, 2 * ms, [2e-4, 0.0, 0.0]),
        Taken::Old
    );
    assert_eq!(coupling.sample(5 * ms, ms, [2e-4, 0.0, 0.0]), Taken::Stale);
    assert_eq!(
        coupling.sample(5 * ms, 5 * ms, [2e-4, f64::NAN, 0.0]),
        Taken::Implausible
    );
    assert_eq!(
        coupling.sample(5 * ms, 5 * ms, [2e-4, 101.0, 0.0]),
        Taken::Implausible
    );
    // A stamp of the future is one of now, and does not shut out what follows.
    assert_eq!(
        coupling.sample(5 * ms, u64::MAX, [2e-4, 0.0, 0.0]),
        Taken::Used
    );
    assert_eq!(
        coupling.sample(6 * ms, 6 * ms, [3e-4, 0.0, 0.0]),
        Taken::Used
    );
    assert_eq!(
        coupling.sample(7 * ms, 7 * ms, [0.5, 0.0, 0.0]),
        Taken::Leapt
    );
}
