//! How stiff a coupling may be, against the condition of [C94] worked out numerically, and against devices that move
//! exactly as their differential equation says between samples, under a force that is held.

mod rigs;

use std::f64::consts::PI;

use rigs::{Body, Chance, PROFILE, norm, plus, rendering};
use teleclay_device::DeviceProfile;
use teleclay_impedance::{
    Coupling, CouplingSetup, DeviceTiming, GraspState, HandlePlace, LoopHandle, Playback, Scale,
    SetupError, max_stiffness, series,
};

const HELD_FAST: f64 = f64::INFINITY;

fn handle(tick_s: f64, damping_n_s_per_m: f64) -> LoopHandle {
    LoopHandle {
        tick_s,
        damping_n_s_per_m,
        latency_s: 0.0,
    }
}

/// `T/2 sup Re{(1 - 1/z) H(z) z^-d} / (1 - cos theta)` of [C94] for `H = K + B (1 - 1/z) / T`: the damping that a
/// device needs. Complex arithmetic by hand, on a grid.
fn needed_damping(k: f64, b: f64, interval_s: f64, delay: u32) -> f64 {
    let times = |a: (f64, f64), b: (f64, f64)| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
    let mut most = 0.0_f64;
    for step in 1..=20_000 {
        let theta = PI * f64::from(step) / 20_000.0;
        let difference = (1.0 - theta.cos(), theta.sin());
        let wall = (
            k + b / interval_s * difference.0,
            b / interval_s * difference.1,
        );
        let lag = (f64::from(delay) * theta).sin_cos();
        let whole = times(times(difference, wall), (lag.1, -lag.0));
        most = most.max(interval_s / 2.0 * whole.0 / (1.0 - theta.cos()));
    }
    most
}

#[test]
fn a_device_at_a_handle_held_fast_may_have_what_colgate_and_schenkel_say() {
    for (interval_s, damping, own, delay) in [
        (1e-3, 2.0, 0.0, 0_u32),
        (1e-3, 2.0, 0.5, 0),
        (0.016, 5.0, 1.0, 0),
        (1e-3, 2.0, 0.0, 1),
        (2e-3, 4.0, 0.0, 5),
    ] {
        let device = DeviceTiming {
            rate_hz: 1.0 / interval_s,
            damping_n_s_per_m: damping,
            latency_s: f64::from(delay) * interval_s,
        };
        let bound = max_stiffness(&device, &handle(interval_s, HELD_FAST), own).unwrap();
        let needed = needed_damping(bound, own, interval_s, delay);
        assert!(
            (needed / damping - 1.0).abs() < 1e-3,
            "{bound} N/m: needs {needed}, has {damping}"
        );
    }
    // With delay and damping together both worst cases are added, though they lie at different frequencies.
    let device = DeviceTiming {
        rate_hz: 1000.0,
        damping_n_s_per_m: 2.0,
        latency_s: 3e-3,
    };
    let bound = max_stiffness(&device, &handle(1e-3, HELD_FAST), 0.5).unwrap();
    assert!((bound - 1.5 / 3.5e-3).abs() < 1e-9, "{bound}");
    assert!(needed_damping(bound, 0.5, 1e-3, 3) <= 2.0);
}

/// Greatest `∫ (x - x_held) x' dt / ∫ x'² dt` over motions that repeat with the samples, in intervals: the largest
/// eigenvalue of the integral's symmetric part, on a grid within the interval.
fn costliest_motion(delay_intervals: f64) -> f64 {
    const STEPS: usize = 60;
    let delay = (delay_intervals * STEPS as f64).round() as usize;
    let mut kernel = vec![[0.0_f64; STEPS]; STEPS];
    for at in 0..STEPS {
        // The value that counts at this step began to count at the last step that is `delay` after a sample.
        let age = delay + (at + STEPS * 8 - delay) % STEPS;
        for back in 0..=age {
            let share = if back == 0 { 0.5 } else { 1.0 };
            kernel[at][(at + STEPS * 8 - back) % STEPS] += share / STEPS as f64;
        }
    }
    let mut motion = [1.0_f64; STEPS];
    let mut largest = 0.0;
    for _ in 0..2000 {
        let next: [f64; STEPS] = std::array::from_fn(|i| {
            (0..STEPS)
                .map(|j| 0.5 * (kernel[i][j] + kernel[j][i]) * motion[j])
                .sum()
        });
        largest = next.iter().map(|part| part * part).sum::<f64>().sqrt();
        motion = next.map(|part| part / largest);
    }
    largest
}

/// A delay of half an interval needs more than its mean age, and no delay more than it is given.
#[test]
fn a_delay_between_the_samples_costs_more_than_its_mean_age() {
    for delay in [0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0, 1.5, 2.0, 3.4] {
        let device = DeviceTiming {
            rate_hz: 1000.0,
            damping_n_s_per_m: 2.0,
            latency_s: delay * 1e-3,
        };
        let bound = max_stiffness(&device, &handle(1e-3, HELD_FAST), 0.0).unwrap();
        let (needed, given) = (costliest_motion(delay), 2.0 / bound / 1e-3);
        println!("{delay} intervals: needs {needed:.3}, is given {given:.3}");
        assert!(
            needed <= given * 1.001,
            "{delay}: needs {needed}, is given {given}"
        );
    }
    assert!(1.05 < costliest_motion(0.5));
}

/// Two free sides have their dampings in series: the bound lies below each side's own, and a handle that is damped ever
/// more is one held fast.
#[test]
fn a_handle_that_is_free_leaves_less_than_one_held_fast() {
    let device = DeviceTiming {
        rate_hz: 1000.0,
        damping_n_s_per_m: 2.0,
        latency_s: 0.0,
    };
    let bound =
        |damping: f64, own: f64| max_stiffness(&device, &handle(1e-3, damping), own).unwrap();
    let held = bound(HELD_FAST, 0.0);
    assert!((held - 4000.0).abs() < 1e-9);
    let mut before = 0.0;
    for damping in [0.5, 2.0, 10.0, 100.0, 1e4, 1e9] {
        let free = bound(damping, 0.0);
        let in_series = 2.0 * damping / (2.0 + damping);
        assert!(before < free && free <= held, "{damping}: {free}");
        // Two values held alike are one difference held: no more than that allows.
        assert!(
            free <= in_series / 0.5e-3 * (1.0 + 1e-9),
            "{damping}: {free}"
        );
        before = free;
    }
    assert!((before / held - 1.0).abs() < 1e-6, "{before}");
    // A damper that takes what both have in series leaves nothing, though each has more.
    assert!(bound(2.0, 1.0) <= 0.0);
    assert!(0.0 < bound(2.0, 0.99));
    assert!((series(2.0, 2.0) - 1.0).abs() < 1e-15 && (series(3.0, HELD_FAST) - 3.0).abs() < 1e-15);
    // What no force moves leaves the handle's own sampling.
    let mouse = DeviceTiming {
        damping_n_s_per_m: f64::INFINITY,
        rate_hz: 60.0,
        latency_s: 0.1,
    };
    let bound = max_stiffness(
        &mouse,
        &LoopHandle {
            latency_s: 1e-3,
            ..handle(1e-3, 10.0)
        },
        4.0,
    )
    .unwrap();
    assert!((bound - 6.0 / 1.5e-3).abs() < 1e-9);
}

/// A device at a handle that is held fast: sampled, its force held until the next sample.
struct Rig {
    device: Body,
    coupling: Coupling,
    interval_s: f64,
    delay: Vec<[f64; 3]>,
    held_n: [f64; 3],
    now_ns: u64,
}

/// What a rig is drawn from.
#[derive(Clone, Copy, Debug)]
struct Draw {
    interval_s: f64,
    damping: f64,
    own: f64,
    /// `b T / m`.
    lightness: f64,
    delay: u32,
    of_bound: f64,
}

impl Draw {
    fn bound(&self) -> f64 {
        let timing = DeviceTiming {
            rate_hz: 1.0 / self.interval_s,
            damping_n_s_per_m: self.damping,
            latency_s: f64::from(self.delay) * self.interval_s,
        };
        max_stiffness(&timing, &handle(self.interval_s, HELD_FAST), self.own).unwrap()
    }

    fn rig(&self) -> Rig {
        let stiffness = self.of_bound * self.bound();
        // What is asked for here is what `Coupling::new` refuses, so it is told of a device that is better than this.
        let told = DeviceTiming {
            rate_hz: 1.0 / self.interval_s,
            damping_n_s_per_m: 1e9,
            latency_s: 0.0,
        };
        let setup = CouplingSetup {
            stiffness_n_per_m: stiffness,
            damping_n_s_per_m: self.own,
            filter_s: self.interval_s,
            device: told,
            device_speed_m_s: 10.0,
            handle: handle(self.interval_s, HELD_FAST),
            profile: DeviceProfile {
                force_n: 1e4,
                slew_n_per_s: 1e12,
                ..PROFILE
            },
            hold_s: 2.0 * self.interval_s,
            ramp_s: 2.0 * self.interval_s,
            ..rendering()
        };
        let mut coupling = Coupling::new(setup).unwrap();
        coupling.hold();
        Rig {
            device: Body::at_rest(
                self.damping * self.interval_s / self.lightness,
                self.damping,
            ),
            coupling,
            interval_s: self.interval_s,
            delay: vec![[0.0; 3]; self.delay as usize],
            held_n: [0.0; 3],
            now_ns: 0,
        }
    }
}

impl Rig {
    fn pass(&mut self, hand_n: [f64; 3]) {
        self.now_ns += (self.interval_s * 1e9) as u64;
        self.delay.insert(0, self.device.x);
        let seen = self.delay.pop().unwrap();
        self.coupling.sample(self.now_ns, self.now_ns, seen);
        let step = self.coupling.step(self.now_ns, &HandlePlace::default());
        assert_eq!(step.state, GraspState::Held);
        self.held_n = step.device_force_n;
        self.device.pass(plus(self.held_n, hand_n), self.interval_s);
    }

    /// How far from rest, in metres.
    fn swing(&self) -> f64 {
        norm(self.device.x).max(norm(self.device.v) * self.interval_s)
    }
}

#[test]
fn at_nine_tenths_of_the_bound_ten_thousand_devices_are_calm() {
    let mut chance = Chance(1);
    let mut largest = 0.0_f64;
    for case in 0..10_000 {
        let damping = chance.scale(0.2, 20.0);
        let draw = Draw {
            interval_s: 1e-3 * chance.scale(0.25, 17.0),
            damping,
            own: damping * chance.between(0.0, 0.4),
            lightness: chance.scale(0.1, 50.0),
            delay: chance.below(4) as u32,
            of_bound: 0.9,
        };
        let mut rig = draw.rig();
        let mut most = 0.0_f64;
        for part in 0..20 {
            // No push that a device of this damping would leave its speed with.
            let push = chance.vector(damping * if part % 5 == 4 { 0.0 } else { 0.5 });
            for _ in 0..10 {
                rig.pass(push);
                most = most.max(rig.swing());
            }
        }
        let still = draw.bound() * draw.of_bound;
        // A spring that is held off by no more than the pushes stays as near as they could push it in all that time.
        assert!(
            most < damping * 0.5 * 3.0 / still * 20.0 + 2.0 * draw.interval_s,
            "{case}: {most} m, {draw:?}"
        );
        // What is nearly critical fades slowly: a tenth of the damping is left, on the largest mass here.
        for _ in 0..1500 {
            rig.pass([0.0; 3]);
        }
        let left = rig.swing() / most;
        largest = largest.max(left);
        assert!(left < 0.01, "{case}: {left} of {most} m is left, {draw:?}");
    }
    println!("of 10 000 swings at 0.9 of the bound at most {largest:.1e} is left");
}

#[test]
fn at_thirteen_tenths_of_the_bound_heavy_and_very_light_devices_ring() {
    let mut chance = Chance(2);
    for case in 0..2_000 {
        let damping = chance.scale(0.2, 20.0);
        let is_heavy = chance.happens(0.5);
        let draw = Draw {
            interval_s: 1e-3 * chance.scale(0.25, 17.0),
            damping,
            own: damping * chance.between(0.0, 0.04),
            lightness: if is_heavy {
                chance.scale(0.02, 0.1)
            } else {
                chance.scale(40.0, 200.0)
            },
            delay: if is_heavy { chance.below(3) as u32 } else { 0 },
            of_bound: 1.3,
        };
        let mut rig = draw.rig();
        // A breath, then nobody touches it.
        rig.device.v = [1e-7, 0.0, 0.0];
        rig.device.x = [1e-9, 0.0, 0.0];
        let mut grew = false;
        for _ in 0..20_000 {
            rig.pass([0.0; 3]);
            if 1e-4 < rig.swing() {
                grew = true;
                break;
            }
        }
        assert!(grew, "{case}: {} m, {draw:?}", rig.swing());
    }
}

#[test]
fn what_is_stiffer_than_the_bound_is_refused_in_words() {
    let setup = rendering();
    let bound = setup.stiffness_bound_n_per_m(&Scale::default()).unwrap();
    let with = |stiffness_n_per_m| {
        let long = DeviceProfile {
            slew_n_per_s: 1e9,
            ..PROFILE
        };
        CouplingSetup {
            stiffness_n_per_m,
            hold_s: 1e-3,
            ramp_s: 1e-7,
            profile: long,
            ..setup
        }
    };
    assert!(Coupling::new(with(bound * (1.0 - 1e-9))).is_ok());
    let refused = Coupling::new(with(bound * 1.001)).unwrap_err();
    assert!(matches!(refused, SetupError::TooStiff { .. }), "{refused}");
    let words = refused.to_string();
    assert!(
        words.contains("rings with this device, need") && words.contains("sample it faster"),
        "{words}"
    );
    // Playing one interval late costs an interval.
    let late = CouplingSetup {
        playback: Playback::Interpolated,
        ..setup
    };
    assert!(late.stiffness_bound_n_per_m(&Scale::default()).unwrap() < 0.6 * bound);
    // A gear makes what the device feels stiffer.
    let geared = Scale {
        motion: 3.0,
        force: 1.0,
    };
    assert!(setup.stiffness_bound_n_per_m(&geared).unwrap() < 0.4 * bound);
    let mut coupling = Coupling::new(CouplingSetup {
        stiffness_n_per_m: 0.5 * bound,
        ..with(0.0)
    })
    .unwrap();
    assert!(matches!(
        coupling.set_scale(geared),
        Err(SetupError::TooStiff { .. })
    ));
    assert!(matches!(
        coupling.set_scale(Scale {
            motion: f64::NAN,
            force: 1.0
        }),
        Err(SetupError::OutOfRange { .. })
    ));
    assert!(matches!(
        coupling.set_scale(Scale {
            motion: 1.0,
            force: 1.1
        }),
        Err(SetupError::OutOfRange { .. })
    ));
    assert_eq!(coupling.scale(), Scale::default());
}

#[test]
fn each_number_that_is_none_is_refused_by_name() {
    let good = rendering();
    let device = |device| CouplingSetup { device, ..good };
    let cases = [
        (
            "stiffness_n_per_m",
            CouplingSetup {
                stiffness_n_per_m: f64::NAN,
                ..good
            },
        ),
        (
            "damping_n_s_per_m",
            CouplingSetup {
                damping_n_s_per_m: -1.0,
                ..good
            },
        ),
        ("axes", CouplingSetup { axes: 4, ..good }),
        (
            "filter_s",
            CouplingSetup {
                filter_s: 0.0,
                ..good
            },
        ),
        (
            "hold_s",
            CouplingSetup {
                hold_s: 0.5e-3,
                ..good
            },
        ),
        (
            "ramp_s",
            CouplingSetup {
                ramp_s: 0.009,
                ..good
            },
        ),
        (
            "stop_force_n",
            CouplingSetup {
                stop_force_n: f64::NAN,
                ..good
            },
        ),
        (
            "damping_n_s_per_m of the device",
            device(DeviceTiming {
                damping_n_s_per_m: f64::NAN,
                ..good.device
            }),
        ),
        (
            "latency_s of the device",
            device(DeviceTiming {
                latency_s: -1e-3,
                ..good.device
            }),
        ),
        (
            "gives away",
            CouplingSetup {
                hold_s: 0.1,
                ..good
            },
        ),
        (
            "the device bears",
            CouplingSetup {
                device_speed_m_s: 100.0,
                ..good
            },
        ),
    ];
    for (word, setup) in cases {
        let refused = Coupling::new(setup).unwrap_err().to_string();
        assert!(refused.contains(word), "{refused}");
    }
    assert!(Coupling::new(good).is_ok());
}
