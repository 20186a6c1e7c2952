//! A mouse at the loop: samples at 60 to 125 Hz with jitter, in steps of a pixel, hold the handle of the 1 kHz loop
//! through a coupling, and cut clay.

mod rigs;

use rigs::{carving, distance, norm, running, viscous};
use teleclay_device::{DeviceCommand, DeviceProfile, DeviceSample};
use teleclay_impedance::{CouplingSetup, GraspState, ImpedanceHandle};
use teleclay_operator::Intent;
use teleclay_proto::Scheme;
use teleclay_session::Lines;
use teleclay_sim::rig::Rig;

const PROFILE: DeviceProfile = DeviceProfile {
    force_n: 20.0,
    slew_n_per_s: 2000.0,
    speed_m_s: 2.0,
    power_w: 15.0,
    silence_s: 0.1,
    ramp_s: 0.05,
};
/// A pixel of a screen, m.
const PIXEL_M: f64 = 0.25e-3;
/// Longest time between two samples of a page at 60 Hz, ns, and the shortest of one at 125 Hz.
const INTERVALS_NS: [u64; 2] = [8_000_000, 16_600_000];

/// Where the hand is: strokes of 30 mm at 0.6 Hz, 8 mm into the clay after half a second.
fn hand_m(t_s: f64) -> [f64; 3] {
    let swing = (std::f64::consts::TAU * 0.6 * t_s).sin();
    let down = ((t_s - 0.5) / 0.5).clamp(0.0, 1.0);
    [
        0.03 * swing,
        0.006 * (std::f64::consts::TAU * 0.25 * t_s).sin(),
        -0.008 * down,
    ]
}

/// How the hand's path is told.
#[derive(Clone, Copy)]
enum Told {
    /// As a page tells it.
    ByAPage,
    /// Each tick, exactly: what no mouse does.
    EachTick,
}

/// A loop that is held by a mouse.
struct Held {
    rig: Rig,
    mouse: ImpedanceHandle,
    told: Told,
    next_ns: u64,
    chance: u64,
}

impl Held {
    fn new(scheme: Scheme, told: Told) -> Self {
        let rig = carving(
            running(scheme),
            Intent::Idle,
            viscous(2e5),
            Lines::default(),
        );
        let mut mouse =
            ImpedanceHandle::new(CouplingSetup::without_feedback(60.0, 10.0, 1e-3, PROFILE))
                .unwrap();
        mouse.coupling().hold();
        Self {
            rig,
            mouse,
            told,
            next_ns: 0,
            chance: 11,
        }
    }

    fn tick(&mut self) -> DeviceSample {
        let now_ns = self.rig.now().as_nanos();
        let t_s = now_ns as f64 * 1e-9;
        let pixels = |m: f64| (m / PIXEL_M).round() * PIXEL_M;
        match self.told {
            Told::EachTick => {
                self.mouse.coupling().sample(now_ns, now_ns, hand_m(t_s));
            }
            Told::ByAPage if self.next_ns <= now_ns => {
                self.mouse
                    .coupling()
                    .sample(now_ns, now_ns, hand_m(t_s).map(pixels));
                self.chance = self
                    .chance
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                let [least, most] = INTERVALS_NS;
                self.next_ns = now_ns + least + (self.chance >> 33) % (most - least);
            }
            Told::ByAPage => {}
        }
        let sample = self.mouse.sample(now_ns);
        self.rig.hold_handle_at(sample);
        self.rig.tick();
        let step = self.rig.last();
        self.mouse.command(&DeviceCommand {
            position_m: step.command_m,
            force_n: step.felt_force_n,
        });
        sample
    }
}

/// What of `force` is faster than a thirtieth of a second: its distance from the mean over two intervals of a page.
fn ripple(force: &[f64]) -> (f64, f64) {
    const HALF: usize = 17;
    let rough: Vec<f64> = (HALF..force.len() - HALF)
        .map(|at| {
            let around = &force[at - HALF..=at + HALF];
            force[at] - around.iter().sum::<f64>() / around.len() as f64
        })
        .collect();
    let most = rough
        .iter()
        .fold(0.0_f64, |most, part| most.max(part.abs()));
    let square = rough.iter().map(|part| part * part).sum::<f64>() / rough.len() as f64;
    (square.sqrt(), most)
}

#[test]
fn a_mouse_cuts_clay_within_the_bounds_and_its_samples_are_hardly_felt() {
    for scheme in [
        Scheme::ForceExchange,
        Scheme::PositionForce,
        Scheme::Replica,
    ] {
        let mut rough = Vec::new();
        for told in [Told::ByAPage, Told::EachTick] {
            let mut held = Held::new(scheme, told);
            let before = held.rig.session().clay().remaining_units();
            let (mut forces, mut felt) = (Vec::new(), 0.0_f64);
            let mut last = [0.0; 3];
            for tick in 0..6000 {
                let sample = held.tick();
                let force = sample.hand_force_n;
                assert!(norm(force) <= PROFILE.force_n && distance(force, last) <= 2.0 + 1e-9);
                assert!(norm(sample.velocity_m_s) < 1.0, "{sample:?}");
                last = force;
                felt = felt.max(norm(held.rig.last().felt_force_n));
                if 1500 < tick {
                    assert_eq!(held.mouse.last().unwrap().state, GraspState::Held);
                    forces.push(force[0]);
                }
            }
            let cut = before - held.rig.session().clay().remaining_units();
            assert!(
                0 < cut && 0.3 < felt,
                "{scheme:?}: nothing was cut: {felt} N"
            );
            let most = forces
                .iter()
                .fold(0.0_f64, |most, part| most.max(part.abs()));
            let (rms, peak) = ripple(&forces);
            println!(
                "{scheme:?}: hand {most:.2} N, felt {felt:.2} N, ripple {rms:.4} N rms, {peak:.3} N at most"
            );
            rough.push((rms, peak));
        }
        let [page, exact] = rough[..] else {
            panic!("two runs")
        };
        // A hand feels a change of a tenth of the force; of 2 N that is 0.2.
        assert!(
            page.0 < 0.03 && page.1 < 0.1,
            "{scheme:?}: {page:?} N, {exact:?} N from exact samples"
        );
    }
}

/// One interval of the playback, and what the spring and the handle's own damping lag behind in steady motion.
#[test]
fn a_mouse_costs_one_interval_beside_the_lag_of_spring_and_handle() {
    let mut held = Held::new(Scheme::ForceExchange, Told::EachTick);
    // Over the clay, in the air: the handle's damping alone is pulled through.
    let speed = 0.02;
    let mut gap = 0.0;
    for tick in 0..3000_u64 {
        let now_ns = held.rig.now().as_nanos();
        let place = speed * tick as f64 * 1e-3;
        held.mouse
            .coupling()
            .sample(now_ns, now_ns, [place, 0.0, 0.01]);
        let sample = held.mouse.sample(now_ns);
        held.rig.hold_handle_at(sample);
        held.rig.tick();
        let step = held.rig.last();
        held.mouse.command(&DeviceCommand {
            position_m: step.command_m,
            force_n: step.felt_force_n,
        });
        gap = place - sample.position_m[0];
    }
    // f = 10 N s/m v = K s in steady motion; the damper sees no difference.
    let told_s = 1.0 / 60.0 + 10.0 / 150.0;
    println!(
        "lag {:.1} ms, theory {:.1} ms",
        gap / speed * 1e3,
        told_s * 1e3
    );
    assert!(
        (gap / speed / told_s - 1.0).abs() < 0.02,
        "{} s, theory {told_s} s",
        gap / speed
    );
}

/// The pointer leaves the page in the middle of a stroke: the loop is let go of, gently, and taken up again.
#[test]
fn a_pointer_that_is_gone_lets_go_of_the_loop_and_comes_back_without_a_blow() {
    let mut held = Held::new(Scheme::Replica, Told::ByAPage);
    let mut last = [0.0; 3];
    for tick in 0..4000_u64 {
        if tick == 2000 {
            held.next_ns = held.rig.now().as_nanos() + 700_000_000;
        }
        let force = held.tick().hand_force_n;
        assert!(
            distance(force, last) < 1.0,
            "{force:?} after {last:?} at {tick}"
        );
        // 42 ms from the last sample, 50 ms of ramp.
        if 2000 + 16 + 93 < tick && tick < 2650 {
            assert!(norm(force) <= 0.0, "{force:?} at {tick}");
        }
        last = force;
    }
    assert_eq!(held.mouse.last().unwrap().state, GraspState::Held);
}
