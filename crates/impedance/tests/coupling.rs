//! What the hand and the handle meet of a coupling: no steps, no leaps, no force out of nothing.

#![allow(
    clippy::float_cmp,
    reason = "no force is zero, and the same bits are the same"
)]

mod rigs;

use rigs::{Body, Chance, PROFILE, TICK_NS, TICK_S, minus, norm, rendering};
use teleclay_device::{DeviceCommand, DeviceProfile};
use teleclay_impedance::{
    Coupling, CouplingSetup, DeviceTiming, GraspState, HandlePlace, ImpedanceHandle, LoopHandle,
    Scale,
};

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

/// A mass on the coupling swings as the textbook says: `omega = sqrt(K/m)`, `zeta = (B + b) / (2 sqrt(K m))`.
#[test]
fn a_mass_on_the_coupling_has_the_frequency_and_damping_of_the_closed_form() {
    for (mass, damping, stiffness, own) in [
        (1.0, 2.0, 300.0, 0.5),
        (0.5, 1.0, 800.0, 0.3),
        (2.0, 4.0, 150.0, 1.5),
    ] {
        let setup = CouplingSetup {
            stiffness_n_per_m: stiffness,
            damping_n_s_per_m: own,
            device: DeviceTiming {
                damping_n_s_per_m: f64::INFINITY,
                ..rendering().device
            },
            handle: LoopHandle {
                damping_n_s_per_m: damping,
                latency_s: 0.0,
                ..rendering().handle
            },
            hold_s: TICK_S,
            ramp_s: 1e-6,
            profile: DeviceProfile {
                slew_n_per_s: 1e8,
                ..PROFILE
            },
            ..rendering()
        };
        let mut coupling = held(setup);
        let mut body = Body::at_rest(mass, damping);
        // The device is carried away by 10 mm within 100 ms and stays.
        let mut peaks = Vec::new();
        let (mut before, mut rising) = (0.0, true);
        for tick in 1..6000_u64 {
            let now = tick * TICK_NS;
            let place = 0.01 * (tick as f64 / 100.0).min(1.0);
            coupling.sample(now, now, [place, 0.0, 0.0]);
            let handle = HandlePlace {
                position_m: body.x,
                velocity_m_s: body.v,
            };
            let step = coupling.step(now, &handle);
            body.pass(step.hand_force_n, TICK_S);
            let excess = body.x[0] - 0.01;
            if rising && excess < before && 0.0 < before && 150 < tick {
                peaks.push((tick as f64 * TICK_S, before));
            }
            rising = before < excess;
            before = excess;
        }
        assert!((body.x[0] - 0.01).abs() < 3e-5, "rests at {} m", body.x[0]);
        let ((t0, a0), (t1, a1)) = (peaks[0], peaks[2]);
        let decrement = (a0 / a1).ln() / 2.0;
        let zeta = decrement / (4.0 * std::f64::consts::PI.powi(2) + decrement.powi(2)).sqrt();
        let omega = 2.0 * std::f64::consts::TAU / (t1 - t0) / (1.0 - zeta * zeta).sqrt();
        // A force that is held is half a tick old, which takes K T/2 of the damping.
        let told_omega = (stiffness / mass).sqrt();
        let told_zeta =
            (own + damping - stiffness * TICK_S / 2.0) / (2.0 * (stiffness * mass).sqrt());
        println!(
            "{mass} kg: {omega:.3} rad/s, theory {told_omega:.3}; damping {zeta:.4}, theory {told_zeta:.4}"
        );
        assert!(
            (omega / told_omega - 1.0).abs() < 0.01,
            "{omega}, theory {told_omega}"
        );
        assert!(
            (zeta / told_zeta - 1.0).abs() < 0.03,
            "{zeta}, theory {told_zeta}"
        );
    }
}

/// One run of a hand that moves and does everything it can at random moments, beside a handle that is pushed about.
struct Life {
    coupling: Coupling,
    chance: Chance,
    handle: Body,
    push: [f64; 3],
    device: [f64; 3],
    speed: [f64; 3],
    tick: u64,
    next_sample: u64,
}

impl Life {
    fn new(setup: CouplingSetup, seed: u64) -> Self {
        let mut chance = Chance(seed);
        Self {
            coupling: Coupling::new(setup).unwrap(),
            handle: Body {
                x: chance.vector(0.1),
                ..Body::at_rest(1.0, 10.0)
            },
            push: [0.0; 3],
            device: chance.vector(0.3),
            speed: [0.0; 3],
            chance,
            tick: 0,
            next_sample: 0,
        }
    }

    /// One tick with a hand that stays within its speed, samples at the device's rate with jitter.
    fn pass(&mut self) -> [f64; 3] {
        let chance = &mut self.chance;
        if chance.happens(0.01) {
            self.speed = chance.vector(0.4);
        }
        if chance.happens(0.005) {
            self.push = chance.vector(5.0);
        }
        for axis in 0..3 {
            self.device[axis] += self.speed[axis] * TICK_S;
        }
        match chance.below(400) {
            0 => self.coupling.hold(),
            1 => self.coupling.clutch(),
            2 => self.coupling.release(),
            3 => {
                let scale = Scale {
                    motion: chance.between(0.2, 1.5),
                    force: self.coupling.scale().force.min(1.0),
                };
                let _ = self.coupling.set_scale(scale);
            }
            4 => self.coupling.lock_axes([
                chance.happens(0.3),
                chance.happens(0.3),
                chance.happens(0.3),
            ]),
            5 => self.coupling.hold(),
            6 => self.coupling.hold(),
            _ => {}
        }
        let now = self.tick * TICK_NS;
        if self.next_sample <= self.tick {
            let interval = (1e3 / self.coupling.setup().device.rate_hz).max(1.0);
            self.next_sample =
                self.tick + (interval * self.chance.between(0.4, 1.0)).max(1.0) as u64;
            if !self.chance.happens(0.02) {
                self.coupling.sample(now, now, self.device);
            }
        }
        let place = HandlePlace {
            position_m: self.handle.x,
            velocity_m_s: self.handle.v,
        };
        let step = self.coupling.step(now, &place);
        self.handle
            .pass(rigs::plus(step.hand_force_n, self.push), TICK_S);
        self.tick += 1;
        step.hand_force_n
    }
}

#[test]
fn no_transition_at_any_moment_steps_the_force() {
    for (name, setup) in [
        (
            "pointer",
            CouplingSetup {
                axes: 3,
                ..pointer()
            },
        ),
        ("rendering", rendering()),
    ] {
        let most_n = setup.profile.slew_n_per_s * TICK_S;
        let (mut steepest_n, mut strongest_n, mut grips) = (0.0_f64, 0.0_f64, 0_u32);
        for seed in 0..300 {
            let mut life = Life::new(setup, seed);
            let (mut before, mut was) = ([0.0; 3], GraspState::Released);
            for _ in 0..4000 {
                let force = life.pass();
                let change = norm(minus(force, before));
                strongest_n = strongest_n.max(norm(force));
                assert!(
                    change <= most_n * ROUNDING,
                    "{name} {seed}: {change} N in a tick"
                );
                assert!(norm(force) <= setup.profile.force_n * ROUNDING);
                let state = life.coupling.state();
                if state == GraspState::Held {
                    steepest_n = steepest_n.max(change);
                }
                if state == GraspState::Held && was != GraspState::Held {
                    grips += 1;
                    assert_eq!(force, [0.0; 3], "{name} {seed}: a grip begins with a force");
                    assert_eq!(
                        before, [0.0; 3],
                        "{name} {seed}: a grip begins before the force is gone"
                    );
                }
                (before, was) = (force, state);
            }
        }
        println!(
            "{name}: {grips} grips, at most {steepest_n:.3} N a tick of {most_n} N, {strongest_n:.2} N"
        );
        assert!(
            1000 < grips && 1.0 < strongest_n,
            "{grips} grips, {strongest_n} N"
        );
        // The slew is there for what nobody foresaw: motion within the two speeds does not need it.
        assert!(
            steepest_n < 0.9 * most_n,
            "{name}: the limiter shapes the force"
        );
    }
}

/// What is longer than the cap is shortened: its direction stays that of the stretch.
#[test]
fn the_cap_keeps_the_direction() {
    let mut coupling = held(rendering());
    let mut force = [0.0; 3];
    for tick in 1..=2000_u64 {
        let now = tick * TICK_NS;
        let far = 0.15 * (tick as f64 / 1000.0).min(1.0);
        coupling.sample(
            now,
            now,
            [3.0 / 13.0 * far, -4.0 / 13.0 * far, 12.0 / 13.0 * far],
        );
        force = coupling.step(now, &at(0.0)).hand_force_n;
    }
    let wanted = [60.0 / 13.0, -80.0 / 13.0, 240.0 / 13.0];
    assert!(norm(minus(force, wanted)) < 1e-6, "{force:?}");
}

#[test]
fn a_clutch_moves_the_device_without_the_handle() {
    let mut coupling = held(rendering());
    let mut tick = 0;
    let mut carry = |coupling: &mut Coupling, ticks: u64, by: f64, from: &mut f64| {
        let mut step = None;
        for _ in 0..ticks {
            tick += 1;
            *from += by / ticks as f64;
            coupling.sample(tick * TICK_NS, tick * TICK_NS, [*from, 0.0, 0.0]);
            step = Some(coupling.step(tick * TICK_NS, &at(0.0)));
        }
        step.unwrap()
    };
    let mut device = 0.0;
    let step = carry(&mut coupling, 100, 0.01, &mut device);
    assert!((step.hand_force_n[0] - 3.0).abs() < 0.1, "{step:?}");
    assert!((step.device_force_n[0] + step.hand_force_n[0]).abs() < 1e-12);
    coupling.clutch();
    let step = carry(&mut coupling, 200, -0.1, &mut device);
    assert_eq!(
        (step.state, step.hand_force_n),
        (GraspState::Clutched, [0.0; 3])
    );
    coupling.hold();
    let step = carry(&mut coupling, 200, 0.01, &mut device);
    assert!((step.hand_force_n[0] - 3.0).abs() < 0.1, "{step:?}");
    // Half the motion, half the force.
    coupling
        .set_scale(Scale {
            motion: 0.5,
            force: 0.5,
        })
        .unwrap();
    carry(&mut coupling, 20, 0.0, &mut device);
    let step = carry(&mut coupling, 200, 0.01, &mut device);
    assert!((step.hand_force_n[0] - 1.5).abs() < 0.05, "{step:?}");
    assert!((step.device_force_n[0] + 0.75).abs() < 0.025, "{step:?}");
    // A clutch without a hold is nothing to take out.
    coupling.release();
    carry(&mut coupling, 50, 0.0, &mut device);
    coupling.clutch();
    assert_eq!(
        carry(&mut coupling, 5, 0.0, &mut device).state,
        GraspState::Released
    );
}

/// Along a locked axis the handle is held where it was, and the device feels nothing.
#[test]
fn a_locked_axis_holds_the_handle_and_lets_the_device_go() {
    let mut coupling = held(rendering());
    coupling.lock_axes([false, true, false]);
    let mut step = None;
    for tick in 1..=400_u64 {
        let now = tick * TICK_NS;
        let along = 1e-5 * tick as f64;
        coupling.sample(now, now, [along, 10.0 * along, 0.0]);
        // The handle gives way across by a millimetre.
        let handle = HandlePlace {
            position_m: [0.0, 1e-3 * (tick as f64 / 400.0), 0.0],
            ..HandlePlace::default()
        };
        step = Some(coupling.step(now, &handle));
    }
    let step = step.unwrap();
    assert!(0.9 < step.hand_force_n[0], "{step:?}");
    assert!((step.hand_force_n[1] + 0.3).abs() < 0.02, "{step:?}");
    assert!(
        step.device_force_n[1] == 0.0 && step.device_force_n[0] < -0.9,
        "{step:?}"
    );
}

/// Letting go takes the ramp, in proportion to the force: no blow, and no lingering.
#[test]
fn letting_go_takes_its_share_of_the_ramp() {
    let setup = pointer();
    let mut coupling = held(setup);
    for tick in 1..=1000_u64 {
        let now = tick * TICK_NS;
        coupling.sample(now, now, [2e-5 * tick as f64, 0.0, 0.0]);
        coupling.step(now, &at(0.0));
    }
    let (mut before, mut ticks) = (3.0_f64, 0);
    coupling.release();
    for tick in 1001..1100_u64 {
        let force = coupling.step(tick * TICK_NS, &at(0.0)).hand_force_n[0];
        assert!(
            before - force <= 20.0 * TICK_S / setup.ramp_s + 0.1,
            "{force} N after {before} N"
        );
        ticks += u32::from(0.0 < force);
        before = force;
    }
    // 3 of 20 N in 3/20 of 50 ms.
    assert!((6..=8).contains(&ticks), "{ticks} ms");
    assert_eq!(coupling.state(), GraspState::Released);
}

/// A handle that is on the move is not braked at once by a hand that takes hold of it at rest: the damper comes in with
/// its filter.
#[test]
fn a_moving_handle_is_taken_hold_of_without_a_blow() {
    let mut coupling = Coupling::new(pointer()).unwrap();
    let mut before = 0.0;
    for tick in 0..200_u64 {
        if tick == 50 {
            coupling.hold();
        }
        let now = tick * TICK_NS;
        coupling.sample(now, now, [0.0; 3]);
        let handle = HandlePlace {
            position_m: [3e-4 * tick as f64, 0.0, 0.0],
            velocity_m_s: [0.3, 0.0, 0.0],
        };
        let force = coupling.step(now, &handle).hand_force_n[0];
        // The spring's 0.045 N, and a seventeenth of the damper's 1.5 N.
        assert!((force - before).abs() < 0.15, "{force} N after {before} N");
        before = force;
    }
    assert!(before < -7.0, "{before} N");
}

/// A force beyond the stop lets go, and stays away until somebody takes hold.
#[test]
fn at_the_stop_force_the_coupling_lets_go_until_it_is_taken_hold_of() {
    let mut coupling = held(CouplingSetup {
        stop_force_n: 6.0,
        ..rendering()
    });
    let mut states = Vec::new();
    for tick in 1..=1000_u64 {
        let now = tick * TICK_NS;
        coupling.sample(now, now, [5e-5 * tick as f64, 0.0, 0.0]);
        let step = coupling.step(now, &at(0.0));
        assert!(step.hand_force_n[0] <= 6.0 + 0.1, "{step:?}");
        if states.last() != Some(&step.state) {
            states.push(step.state);
        }
    }
    assert_eq!(
        states,
        [GraspState::Held, GraspState::LettingGo, GraspState::Stopped]
    );
    coupling.hold();
    let step = coupling.step(1000 * TICK_NS, &at(0.0));
    assert_eq!(
        (step.state, step.hand_force_n),
        (GraspState::Held, [0.0; 3])
    );
}

/// A handle that is put elsewhere from one tick to the next is let go of, and taken hold of where it is.
#[test]
fn a_handle_that_leaps_is_taken_hold_of_anew() {
    let mut coupling = held(rendering());
    let mut before = [0.0; 3];
    for tick in 1..=300_u64 {
        let now = tick * TICK_NS;
        coupling.sample(now, now, [2e-5 * (tick as f64).min(100.0), 0.0, 0.0]);
        let force = coupling
            .step(now, &at(if tick < 200 { 0.0 } else { 0.5 }))
            .hand_force_n;
        assert!(norm(minus(force, before)) <= 2.0 * ROUNDING);
        assert!(
            -1e-9 < force[0],
            "at {tick}: drawn to where the handle was: {force:?}"
        );
        before = force;
    }
    assert!(norm(before) < 1e-12 && coupling.state() == GraspState::Held);
}

/// The third axis of a two-axis handle goes where the device goes, at the device's speed at most, without force.
#[test]
fn the_lift_of_a_two_axis_handle_follows_without_force() {
    let mut handle = ImpedanceHandle::new(pointer()).unwrap();
    handle.coupling().hold();
    let mut before = 0.0;
    for tick in 0..1000_u64 {
        let now = tick * TICK_NS;
        let lift = -0.05 * (tick as f64 / 500.0).min(1.0);
        if tick % 16 == 0 {
            handle.coupling().sample(now, now, [0.0, 0.0, lift]);
        }
        let sample = handle.sample(now);
        assert_eq!(sample.hand_force_n[2], 0.0);
        assert!((sample.position_m[2] - before).abs() <= 1e-3 * ROUNDING);
        before = sample.position_m[2];
        handle.command(&DeviceCommand {
            position_m: [0.0, 0.0, 7.0],
            ..DeviceCommand::default()
        });
    }
    assert!((before + 0.05).abs() < 1e-9, "{before}");
    assert_eq!(handle.last().unwrap().state, GraspState::Held);
}

#[test]
fn the_same_life_has_the_same_bits() {
    let digest = |seed: u64| {
        let mut life = Life::new(rendering(), seed);
        let mut digest = 0_u64;
        for _ in 0..20_000 {
            for part in life.pass() {
                digest = digest.rotate_left(7) ^ part.to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15);
            }
        }
        digest
    };
    assert_eq!(digest(5), digest(5));
    assert_ne!(digest(5), digest(6));
}
