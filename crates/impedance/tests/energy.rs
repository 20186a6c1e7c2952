//! A coupling gives no more than it got, whatever a hand does: counted here from the true motion of both sides, which
//! the coupling does not see.
//!
//! Joules are the handle's: the device's work is its force times its way over the power ratio of the scale. The
//! dampings of both sides are counted as what they dissipate at least, `b |d|² / T`; a sampled spring without any
//! gives energy.

mod rigs;

use rigs::{Body, Chance, PROFILE, TICK_NS, TICK_S, minus, norm, plus, rendering};
use teleclay_impedance::{
    Coupling, CouplingSetup, DeviceTiming, GraspState, HandlePlace, LoopHandle, Observer, Playback,
    Scale,
};

/// What a hand does for a while.
struct Wandering {
    from: [f64; 3],
    to: [f64; 3],
    begins_s: f64,
    lasts_s: f64,
}

impl Wandering {
    /// A smooth way, at rest at both ends.
    fn at(&self, t_s: f64) -> [f64; 3] {
        let u = ((t_s - self.begins_s) / self.lasts_s).clamp(0.0, 1.0);
        let share = u * u * u * (10.0 + u * (6.0 * u - 15.0));
        std::array::from_fn(|axis| self.from[axis] + share * (self.to[axis] - self.from[axis]))
    }
}

struct Outcome {
    least_j: f64,
    /// Without the dampings, and in the device's joules without them.
    bare_j: f64,
    seen_least_j: f64,
    strongest_n: f64,
    grips: u32,
    given_j: f64,
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A life of four seconds: random ways, samples with jitter that are dropped in runs, clutching, scales, locks, and a
/// handle that is pushed about. With `whole_bound` the spring is as stiff as the setup may be.
fn live(setup: CouplingSetup, seed: u64, deeds: u64) -> Outcome {
    let mut chance = Chance(seed);
    let mut coupling = Coupling::new(setup).unwrap();
    let mut handle = Body::at_rest(chance.scale(0.05, 2.0), setup.handle.damping_n_s_per_m);
    let mut way = Wandering {
        from: [0.0; 3],
        to: [0.0; 3],
        begins_s: 0.0,
        lasts_s: 0.1,
    };
    let (mut device, mut push) = ([0.0; 3], [0.0; 3]);
    let (mut energy, mut bare) = (0.0_f64, 0.0_f64);
    let mut outcome = Outcome {
        least_j: 0.0,
        bare_j: 0.0,
        seen_least_j: 0.0,
        strongest_n: 0.0,
        grips: 0,
        given_j: 0.0,
    };
    let (mut next_sample, mut silent_until) = (0.0, 0.0);
    let mut was = GraspState::Released;
    coupling.hold();
    for tick in 0..4000_u64 {
        let (now, t_s) = (tick * TICK_NS, tick as f64 * TICK_S);
        if way.begins_s + way.lasts_s <= t_s {
            let to = plus(device, chance.vector(0.06));
            // The greatest speed of such a way is 1.875 times the mean.
            let least_s = 1.875 * norm(minus(to, device)) / (0.9 * setup.device_speed_m_s);
            way = Wandering {
                from: device,
                to,
                begins_s: t_s,
                lasts_s: least_s * chance.scale(1.0, 30.0) + 0.01,
            };
        }
        match chance.below(deeds) {
            0 => coupling.clutch(),
            1 => coupling.release(),
            2 => {
                let scale = Scale {
                    motion: chance.scale(0.3, 2.0),
                    force: chance.between(0.1, 1.0),
                };
                let _ = coupling.set_scale(scale);
            }
            3 => coupling.lock_axes([
                chance.happens(0.3),
                chance.happens(0.3),
                chance.happens(0.3),
            ]),
            4 => silent_until = t_s + chance.scale(0.002, 0.3),
            5..12 => coupling.hold(),
            _ => {}
        }
        if chance.happens(0.005) {
            let most_n = if chance.happens(0.5) { 6.0 } else { 0.0 };
            push = chance.vector(most_n);
        }
        if next_sample <= t_s {
            next_sample = t_s + setup.device.interval_s() * chance.between(0.5, 1.0);
            if silent_until <= t_s {
                coupling.sample(now, now, device);
            }
        }
        let step = coupling.step(
            now,
            &HandlePlace {
                position_m: handle.x,
                velocity_m_s: handle.v,
            },
        );
        if step.state == GraspState::Held && was != GraspState::Held {
            outcome.grips += 1;
        }
        was = step.state;
        // One tick passes: the true ways of both.
        let (device_was, handle_was) = (device, handle.x);
        handle.pass(plus(step.hand_force_n, push), TICK_S);
        device = way.at(t_s + TICK_S);
        let (dx, dy) = (minus(device, device_was), minus(handle.x, handle_was));
        let scale = coupling.scale();
        let at_handle = scale.at_handle(&setup.device);
        let taken =
            -dot(step.device_force_n, dx) / scale.power_ratio() - dot(step.hand_force_n, dy);
        let moved = dx.map(|part| part * scale.motion);
        bare += taken;
        energy += taken
            + (at_handle.damping_n_s_per_m * dot(moved, moved)
                + setup.handle.damping_n_s_per_m * dot(dy, dy))
                / TICK_S;
        outcome.least_j = outcome.least_j.min(energy);
        outcome.bare_j = outcome.bare_j.min(bare);
        outcome.given_j += dot(step.hand_force_n, dy).abs();
        outcome.strongest_n = outcome.strongest_n.max(norm(step.hand_force_n));
    }
    outcome.seen_least_j = coupling.observer().least_j();
    outcome
}

/// The stiffest spring that `Coupling::new` takes with all else as it is.
fn stiffest(setup: CouplingSetup) -> CouplingSetup {
    let (mut least, mut most) = (1e-3_f64, 1e6_f64);
    while least * 1.0001 < most {
        let middle = (least * most).sqrt();
        let tried = CouplingSetup {
            stiffness_n_per_m: middle,
            ..setup
        };
        if Coupling::new(tried).is_ok() {
            least = middle
        } else {
            most = middle
        }
    }
    CouplingSetup {
        stiffness_n_per_m: least,
        ..setup
    }
}

/// A device and a handle of any damping, rate and latency that a coupling is to be had for.
fn drawn(chance: &mut Chance, playback: Playback) -> CouplingSetup {
    let rate_hz = if playback == Playback::Held {
        1000.0
    } else {
        chance.scale(50.0, 900.0)
    };
    let (device, handle) = (chance.scale(0.5, 20.0), chance.scale(0.5, 20.0));
    let in_series = device * handle / (device + handle);
    let profile = teleclay_device::DeviceProfile {
        slew_n_per_s: 1e5,
        ..PROFILE
    };
    stiffest(CouplingSetup {
        damping_n_s_per_m: in_series * chance.between(0.0, 0.5),
        filter_s: chance.scale(0.002, 0.02),
        device: DeviceTiming {
            rate_hz,
            damping_n_s_per_m: device,
            latency_s: 0.0,
        },
        playback,
        handle: LoopHandle {
            tick_s: TICK_S,
            damping_n_s_per_m: handle,
            latency_s: 0.0,
        },
        hold_s: 1.5 / rate_hz,
        ramp_s: chance.scale(0.0005, 0.02),
        profile,
        ..rendering()
    })
}

#[test]
fn no_life_of_a_coupling_gives_more_than_it_got() {
    for playback in [Playback::Held, Playback::Interpolated] {
        let mut chance = Chance(7);
        let (mut least, mut bare, mut strongest, mut grips, mut given) =
            (0.0_f64, 0.0_f64, 0.0_f64, 0, 0.0);
        for seed in 0..2_000 {
            let setup = drawn(&mut chance, playback);
            let outcome = live(setup, seed, 300);
            assert!(
                -1e-9 <= outcome.least_j,
                "{playback:?} {seed}: {} J, {setup:?}",
                outcome.least_j
            );
            least = least.min(outcome.least_j);
            bare = bare.min(outcome.bare_j);
            strongest = strongest.max(outcome.strongest_n);
            grips += outcome.grips;
            given += outcome.given_j;
        }
        println!(
            "{playback:?}: least {least:.1e} J, without the dampings {bare:.1e} J; {grips} grips, {given:.0} J passed, {strongest:.1} N"
        );
        assert!(
            10_000 < grips && 10.0 < strongest && 100.0 < given,
            "hardly anything was held"
        );
        assert!(
            bare < -1e-3,
            "the dampings had nothing to pay: the test is blind"
        );
    }
}

/// What the coupling counts from samples agrees with the truth where each tick has a sample, behind any scale.
#[test]
fn what_is_observed_is_what_happens_where_each_tick_has_a_sample() {
    for scale in [
        Scale::default(),
        Scale {
            motion: 0.5,
            force: 0.4,
        },
    ] {
        let handle = LoopHandle {
            latency_s: 0.0,
            ..rendering().handle
        };
        let mut coupling = Coupling::new(CouplingSetup {
            handle,
            ..rendering()
        })
        .unwrap();
        coupling.set_scale(scale).unwrap();
        coupling.hold();
        let mut body = Body::at_rest(1.0, 10.0);
        let (mut energy, mut least) = (0.0_f64, 0.0_f64);
        let mut before = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for tick in 0..3000_u64 {
            let now = tick * TICK_NS;
            let device = [
                0.03 * (tick as f64 * 0.004).sin(),
                0.01 * (tick as f64 * 0.03).sin(),
                0.0,
            ];
            coupling.sample(now, now, device);
            let place = HandlePlace {
                position_m: body.x,
                velocity_m_s: body.v,
            };
            let step = coupling.step(now, &place);
            // Of the first tick nothing is seen: where the device was before it is not known.
            if 0 < tick {
                let (dx, dy) = (minus(device, before.1), minus(body.x, before.2));
                let force_on_device = before.0.map(|part| -scale.force * part);
                // At the device, in its own joules: 2 N s/m over a millisecond; at the handle 10.
                let device_j = -dot(force_on_device, dx) + 2e3 * dot(dx, dx);
                energy +=
                    device_j * scale.motion / scale.force - dot(before.0, dy) + 1e4 * dot(dy, dy);
                least = least.min(energy);
            }
            before = (step.hand_force_n, device, body.x);
            body.pass(step.hand_force_n, TICK_S);
        }
        let seen = coupling.observer();
        assert!(
            (energy - seen.energy_j()).abs() < 1e-12,
            "{energy} J, counted {} J",
            seen.energy_j()
        );
        assert!((least - seen.least_j()).abs() < 1e-12 && 1e-3 < energy);
    }
}

/// The count sees what is not passive: a spring far beyond the bound, told that its device is damped.
#[test]
fn an_active_spring_is_seen_to_be_one() {
    let told = DeviceTiming {
        damping_n_s_per_m: 1e6,
        ..rendering().device
    };
    let setup = stiffest(CouplingSetup {
        damping_n_s_per_m: 0.0,
        device: told,
        handle: LoopHandle {
            damping_n_s_per_m: 1e6,
            latency_s: 0.0,
            ..rendering().handle
        },
        profile: teleclay_device::DeviceProfile {
            slew_n_per_s: 2e4,
            ..PROFILE
        },
        ..rendering()
    });
    let mut coupling = Coupling::new(setup).unwrap();
    coupling.hold();
    let mut truth = Observer::new(&rendering().device, &rendering().handle);
    let mut before = ([0.0; 3], [0.0; 3]);
    for tick in 0..2000_u64 {
        let now = tick * TICK_NS;
        let device = [1e-4 * (tick as f64 * 2.0).sin(), 0.0, 0.0];
        coupling.sample(now, now, device);
        let step = coupling.step(now, &HandlePlace::default());
        truth.on_tick(before.0, minus(device, before.1), [0.0; 3]);
        before = (step.hand_force_n, device);
    }
    assert!(
        truth.least_j() < -1e-3,
        "{} J of a spring of {} N/m",
        truth.least_j(),
        setup.stiffness_n_per_m
    );
}
