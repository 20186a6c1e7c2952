//! A server that says whatever does most harm: the hand meets no more than the device's own profile.

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use teleclay_bilateral::lower;
use teleclay_clay::{BrickView, Clay};
use teleclay_proto::frame::{POSITION_UNIT_M, SweepRecord, Sweeps};
use teleclay_proto::http::Validate;

use super::*;

const CASES: u32 = 2000;
const TICKS: usize = 1000;

/// Often what a loop could mean, and often the end of what may be said.
fn number(least: f64, most: f64) -> impl Strategy<Value = f64> {
    prop_oneof![
        2 => (0.0..=1.0f64).prop_map(move |share| least + share * (most - least)),
        1 => Just(least),
        1 => Just(most),
    ]
}

fn parameters() -> impl Strategy<Value = LoopParameters> {
    let bounds = (
        number(1e-3, 1e3),
        number(0.0, 1e5),
        number(1e-3, 1e3),
        number(1e-3, 1e3),
        number(1e-3, 1e5),
    );
    let limits = (
        number(0.0, 1e3),
        number(0.0, 1e6),
        number(0.0, 10.0),
        number(1e-3, 10.0),
        number(1e-3, 10.0),
    );
    let scheme = proptest::sample::select(Scheme::ALL);
    (bounds, limits, scheme, any::<bool>()).prop_map(|(bounds, limits, scheme, is_usual)| {
        let usual = LoopParameters::default();
        let (mass, damping, position_ratio, force_ratio, impedance) = bounds;
        let (force_limit_n, slew_limit_n_per_s, speed_limit_m_s, silence_s, ramp_s) = limits;
        let limited = LoopParameters {
            scheme,
            force_limit_n,
            slew_limit_n_per_s,
            speed_limit_m_s,
            silence_s,
            ramp_s,
            reach_m: [[-10.0; 3], [10.0; 3]],
            ..usual
        };
        if is_usual {
            return limited;
        }
        LoopParameters {
            virtual_mass_kg: mass,
            virtual_damping_n_s_per_m: damping,
            position_ratio,
            force_ratio,
            wave_impedance_n_s_per_m: impedance,
            ..limited
        }
    })
}

/// How far a frame's sequence is ahead, its scheme, its status, and how large what it says is.
type Words = (u32, Scheme, LoopStatus, [f64; 6]);

/// One frame. A wild one may hold any number, which ends most runs in a fault.
fn words(is_wild: bool) -> BoxedStrategy<Words> {
    let scheme = proptest::sample::select(Scheme::ALL);
    let status = prop_oneof![8 => Just(LoopStatus::Running), 1 => Just(LoopStatus::Paused)];
    if is_wild {
        let ahead = prop_oneof![9 => Just(1_u32), 2 => 0..5_u32, 1 => any::<u32>()];
        let size = prop_oneof![8 => -1e3..1e3f64, 2 => -1e6..1e6f64, 1 => any::<f64>()];
        return (ahead, scheme, status, proptest::array::uniform6(size)).boxed();
    }
    let size = prop_oneof![8 => -30.0..30.0f64, 4 => -1e3..1e3f64, 2 => -1e5..1e5f64];
    let sizes = proptest::array::uniform6(size);
    (1..3_u32, scheme, Just(LoopStatus::Running), sizes).boxed()
}

#[derive(Clone, Debug)]
struct Case {
    parameters: LoopParameters,
    keeps_its_scheme: bool,
    frames: Vec<Words>,
    push_n: [f64; 3],
    lie: Option<Lie>,
}

/// What is said of the clay: another block every so many ticks, by turns full and empty, and cuts of other tools around
/// the hand's.
#[derive(Clone, Copy, Debug)]
struct Lie {
    every: usize,
    /// Whether the blocks are said to be the same one, exchanged: then the copy of the one before is felt until the
    /// next one is there.
    are_exchanged: bool,
}

fn cases() -> impl Strategy<Value = Case> {
    // Half of them press on with the same words.
    let length = prop_oneof![Just(1_usize), 2..40_usize];
    let frames = (prop::bool::weighted(0.2), length)
        .prop_flat_map(|(is_wild, length)| proptest::collection::vec(words(is_wild), length));
    let push = proptest::array::uniform3(-5.0..5.0f64);
    (parameters(), prop::bool::weighted(0.8), frames, push).prop_map(
        |(parameters, keeps_its_scheme, frames, push_n)| Case {
            parameters,
            keeps_its_scheme,
            frames,
            push_n,
            lie: None,
        },
    )
}

/// The same, by servers that lie about the clay of which the hand holds a copy.
fn lying_cases() -> impl Strategy<Value = Case> {
    let lie = (1..200_usize, any::<bool>(), number(1e3, 1e6));
    (cases(), lie).prop_map(|(case, (every, are_exchanged, viscosity_pa_s_per_m))| {
        let mut parameters = LoopParameters {
            scheme: Scheme::Replica,
            // In the middle of the blocks that are sent.
            home_m: [0.016, 0.008, 0.008],
            ..case.parameters
        };
        parameters.material.viscosity_pa_s_per_m = viscosity_pa_s_per_m;
        Case {
            parameters,
            keeps_its_scheme: true,
            lie: Some(Lie {
                every,
                are_exchanged,
            }),
            ..case
        }
    })
}

/// A block of this epoch, full or empty.
fn block(epoch: u32, is_full: bool) -> Snapshot {
    let full = replaced::snapshot(epoch);
    if is_full {
        return full;
    }
    let (grid, units) = (*full.clay.grid(), full.clay.initial_units());
    let empty = Clay::from_bricks(grid, units, |_| BrickView::Empty);
    Snapshot {
        clay: Box::new(empty.unwrap()),
        epoch,
    }
}

/// Cuts of other tools, across the place of the hand's.
fn cuts(tick: u32, sizes: [f64; 6]) -> Sweeps {
    let mut sweeps = Sweeps::new(tick);
    let place = |at: usize| -> [i32; 3] {
        std::array::from_fn(|axis| {
            let offset_m = sizes[(at + axis) % 6].clamp(-20.0, 20.0) * 1e-3;
            ((0.008 + offset_m) / POSITION_UNIT_M) as i32
        })
    };
    for sequence in tick..tick + 3 {
        let at = sequence as usize;
        let sweep = SweepRecord {
            sequence,
            from: place(at),
            to: place(at + 1),
        };
        // What finds no room is not said.
        let _ = sweeps.push(sweep);
    }
    sweeps
}

fn harm(case: &Case) -> (usize, f64) {
    let profile = DeviceKind::Simulated.profile();
    let mut granted = granted(1);
    granted.parameters = case.parameters;
    granted
        .parameters
        .validate()
        .expect("what a handle would take");
    lower(&mut granted.parameters, profile);

    let (told, commands) = mpsc::channel();
    let (_trouble, troubles) = mpsc::channel();
    let push = Intent::constant_force(case.push_n).unwrap();
    let probe = Probe {
        handle: SimulatedHandle::new(Axes::Three, TICK_S, push).unwrap(),
        told,
        last: DeviceSample::default(),
        is_blind: false,
        is_lost: false,
        wants_clay: false,
        trouble: troubles,
    };
    let (outbox, _sender) = Sender::spawn(Clock::start(), |_| true).unwrap();
    // Parameters that make no loop are refused before any loop runs.
    let (line, mut arriving) = LineEnds::new(&granted, outbox);
    let Ok(attachment) = Attachment::new(&granted.parameters, line) else {
        return (0, 0.0);
    };
    let mut now = Timestamp::ZERO.after(TICK);
    let engine = Engine::new(now, TICK_S, Box::new(probe), profile, attachment);
    let (mut realtime, mut ends) = Realtime::new(engine, Clock::start(), CAPACITIES);
    let mut sequence = 0_u32;
    let mut epoch = 0_u32;
    for tick in 0..TICKS {
        let (ahead, scheme, status, sizes) = case.frames[tick % case.frames.len()];
        sequence = sequence.wrapping_add(ahead);
        let vector = |at: usize| [sizes[at % 6], sizes[(at + 1) % 6], sizes[(at + 2) % 6]];
        let mut frame = ToolFrame {
            status,
            position_m: vector(0).map(|part| part * 1e-3),
            velocity_m_s: vector(1),
            force_n: vector(2),
            wave: vector(3),
            wave_integral: vector(4),
            energy_in_j: vector(5),
            ..ToolFrame::default()
        };
        frame.header.lease = 1;
        frame.header.ownership_epoch = 1;
        frame.header.sequence = sequence;
        frame.header.sent_ns = now.as_nanos();
        frame.header.scheme = if case.keeps_its_scheme {
            case.parameters.scheme
        } else {
            scheme
        };
        if let Some(lie) = &case.lie {
            if tick % lie.every == 0 {
                epoch += 1;
                let snapshot = block(epoch, (tick / lie.every).is_multiple_of(2));
                // A full ring is a block less.
                let _ = ends.orders.push(Order::LoadSnapshot { lease: 1, snapshot });
            }
            frame.header.clay_epoch = epoch;
            frame.epochs_kept = u8::from(lie.are_exchanged);
            frame.clay_hash = sizes[0].to_bits();
            frame.sweeps_acknowledged = sizes[1] as u32;
            frame.sweeps_durable = sizes[2] as u32;
            frame.relayed = cuts(tick as u32 + 1, sizes);
        }
        // A full ring is a frame less.
        let _ = arriving.push(Arrived { at: now, frame });
        let _ = realtime.tick_at(now, IN_TIME);
        while ends.records.pop().is_ok() {}
        while ends.done.pop().is_ok() {}
        now = now.after(TICK);
    }

    let mut last = DeviceCommand::default();
    let mut greatest_n = 0.0_f64;
    let told: Vec<(DeviceSample, DeviceCommand)> = commands.try_iter().collect();
    let norm = |v: [f64; 3]| v.iter().map(|part| part * part).sum::<f64>().sqrt();
    for (index, (sample, command)) in told.iter().enumerate() {
        if index == 0 {
            last.position_m = sample.position_m;
        }
        let way_m = minus(command.position_m, last.position_m);
        let change_n = norm(minus(command.force_n, last.force_n));
        let parts = command.force_n.iter().zip(way_m);
        let power_w = parts.map(|(force, way)| force * way).sum::<f64>() / TICK_S;
        assert!(
            norm(command.force_n) <= profile.force_n + 1e-9,
            "{command:?}"
        );
        assert!(
            change_n <= profile.slew_n_per_s * TICK_S + 1e-9,
            "{change_n} N in a tick"
        );
        assert!(
            norm(way_m) <= profile.speed_m_s * TICK_S + 1e-9,
            "{way_m:?} in a tick"
        );
        assert!(power_w <= profile.power_w + 1e-6, "{power_w} W");
        greatest_n = greatest_n.max(norm(command.force_n));
        last = *command;
    }
    (told.len(), greatest_n)
}

#[test]
fn no_server_makes_the_hand_meet_more_than_the_devices_own_profile() {
    let (ticks, pressed) = run(CASES, &cases(), 10.0);
    // Nothing is shown by servers that do nothing.
    assert!(50 < pressed, "only {pressed} servers pressed at all");
    assert!(1_000_000 < ticks, "only {ticks} commands");
}

#[test]
fn no_server_that_lies_about_the_clay_makes_the_hand_meet_more_either() {
    let (ticks, pressed) = run(CASES / 4, &lying_cases(), 1.0);
    assert!(50 < pressed, "only {pressed} servers pressed at all");
    assert!(300_000 < ticks, "only {ticks} commands");
}

/// Ticks in which the device was told something, and servers under which the hand felt more than `presses_n`, N.
fn run(count: u32, cases: &impl Strategy<Value = Case>, presses_n: f64) -> (usize, u32) {
    let mut runner = TestRunner::new(Config {
        cases: count,
        failure_persistence: None,
        ..Config::default()
    });
    let ticks = std::cell::Cell::new(0);
    let pressed = std::cell::Cell::new(0);
    let outcome = runner.run(cases, |case| {
        let (told, greatest_n) = harm(&case);
        ticks.set(ticks.get() + told);
        pressed.set(pressed.get() + u32::from(presses_n < greatest_n));
        Ok(())
    });
    outcome.unwrap();
    (ticks.get(), pressed.get())
}
