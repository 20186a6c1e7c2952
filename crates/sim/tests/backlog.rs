//! What queued up while a line or a program stood still is neither driven nor felt, whatever the scheme, the direction
//! and the pace at which it comes.

mod rigs;

use std::time::Duration;

use rigs::{TICK, both_ways, distance, embedded, line, norm, running, viscous};
use teleclay_bilateral::LinkState;
use teleclay_device::DeviceSample;
use teleclay_link::conditioner::{Impairment, Stall};
use teleclay_link::deadband::DeadbandSettings;
use teleclay_link::time::Timestamp;
use teleclay_operator::Intent;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Axes, Scheme};
use teleclay_sim::rig::{Halt, Rig};

/// Every scheme of which the tool follows frames and the hand feels them. The replica's cuts are facts: it has a test
/// of its own.
const SCHEMES: [Scheme; 4] = [
    Scheme::ForceExchange,
    Scheme::PositionForce,
    Scheme::Wave,
    Scheme::Tdpa,
];

/// When the trouble begins, ms.
const BEGINS: u32 = 1000;

fn at(ms: u32) -> Timestamp {
    Timestamp::ZERO.after(TICK * ms)
}

/// What stands still.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Trouble {
    /// The way from the handle to the tool.
    Up,
    /// The way back.
    Down,
    Both,
    /// The session's program is stopped, and continued.
    Server,
    /// The handle's is.
    Handle,
}

use Trouble::{Both, Down, Handle, Server, Up};

/// What happens in a run.
#[derive(Clone, Copy, Debug)]
struct Case {
    trouble: Trouble,
    length_ms: u32,
    drain: f64,
    line: Impairment,
    deadband: bool,
    /// How far the handle's clock is ahead, and how many millionths it runs fast.
    clock: (Duration, f64),
    begins_ms: u32,
}

impl Case {
    fn new(trouble: Trouble, length_ms: u32, drain: f64) -> Self {
        Self {
            trouble,
            length_ms,
            drain,
            line: line(5, 0.0, 0.0),
            deadband: false,
            clock: (Duration::ZERO, 0.0),
            begins_ms: BEGINS,
        }
    }

    fn begin(&self, rig: &mut Rig) {
        let length = TICK * self.length_ms;
        let stall = Some(Stall {
            from: at(self.begins_ms),
            length,
            drain: self.drain,
        });
        match self.trouble {
            Up => rig.stall(stall, None),
            Down => rig.stall(None, stall),
            Both => rig.stall(stall, stall),
            Server => rig.halt_session(Halt::Program, length),
            Handle => rig.halt_handle(Halt::Program, length),
        }
    }

    /// When the last of the queue has come, ms.
    fn caught_up_ms(&self) -> u32 {
        let is_line = matches!(self.trouble, Up | Down | Both);
        let stretch = if is_line && self.drain.is_finite() {
            self.drain / (self.drain - 1.0)
        } else {
            1.0
        };
        self.begins_ms + (f64::from(self.length_ms) * stretch).ceil() as u32
    }
}

/// Somebody holds the handle: at its home, but for a way of 30 mm and back that ends when four fifths of the trouble
/// are over.
fn excursion(case: &Case, ms: u32) -> DeviceSample {
    let length_s = 0.8e-3 * f64::from(case.length_ms);
    let t = (f64::from(ms) - f64::from(case.begins_ms) - 8.0) * 1e-3;
    if !(0.0..length_s).contains(&t) {
        return DeviceSample {
            position_m: [0.0; 3],
            velocity_m_s: [0.0; 3],
            hand_force_n: [0.0; 3],
        };
    }
    // 30 mm, but no faster than 0.3 m/s.
    let way_m = (0.3 * length_s / std::f64::consts::PI).min(0.03);
    let rate = 2.0 * std::f64::consts::PI / length_s;
    let x = -0.5 * way_m * (1.0 - (rate * t).cos());
    let v = -0.5 * way_m * rate * (rate * t).sin();
    DeviceSample {
        position_m: [x, 0.3 * x, 0.0],
        velocity_m_s: [v, 0.3 * v, 0.0],
        hand_force_n: [3.0 * (rate * t).sin(), 0.0, 0.0],
    }
}

/// What became of it.
#[derive(Clone, Copy, Debug, Default)]
struct Outcome {
    /// Way of the tool from the beginning of the trouble, m, and what it cut, mm³.
    moved_m: f64,
    cut_mm3: f64,
    /// By how much more than without any trouble the hand felt since things move again, N.
    felt_n: f64,
    /// Most that it felt while the force of before fades, N: that was none.
    fading_n: f64,
    /// How long after the last of the queue both sides had news of each other, ms.
    live_after_ms: Option<u32>,
    /// Stale frames, at the tool's side and at the handle's.
    stale: [u64; 2],
}

fn rig_for(scheme: Scheme, case: &Case) -> Rig {
    let parameters = LoopParameters {
        axes: Axes::Three,
        ..running(scheme)
    };
    let mut rig = embedded(
        parameters,
        Intent::Idle,
        viscous(1e5),
        both_ways(case.line, 1),
    );
    if case.deadband {
        rig.code_perceptually(DeadbandSettings::default()).unwrap();
    }
    rig.set_handle_clock(case.clock.0, case.clock.1);
    rig
}

fn run(scheme: Scheme, case: &Case) -> Outcome {
    let mut rig = rig_for(scheme, case);
    let mut calm = rig_for(scheme, case);
    let mut outcome = Outcome::default();
    let mut rest_m = [0.0; 3];
    let mut removed = 0;
    // What would have been felt of late, N.
    let mut felt_lately_n = 0.0_f64;
    let caught_up_ms = case.caught_up_ms();
    let is_line = matches!(case.trouble, Up | Down | Both);
    if is_line {
        case.begin(&mut rig);
    }
    for ms in 0..caught_up_ms + 1000 {
        if ms == case.begins_ms {
            rest_m = rig.tool().view().position_m;
            removed = rig.session().clay().removed_units();
            if !is_line {
                case.begin(&mut rig);
            }
        }
        let held = excursion(case, ms);
        rig.hold_handle_at(held);
        calm.hold_handle_at(held);
        rig.tick();
        calm.tick();
        felt_lately_n = norm(calm.last().felt_force_n).max(0.97 * felt_lately_n);
        if case.begins_ms < ms {
            let moved_m = distance(rig.tool().view().position_m, rest_m);
            outcome.moved_m = outcome.moved_m.max(moved_m);
        }
        if (case.begins_ms..case.begins_ms + 140).contains(&ms) {
            outcome.fading_n = outcome.fading_n.max(norm(rig.last().felt_force_n));
        }
        if case.begins_ms + case.length_ms.max(160) < ms {
            let felt_n = norm(rig.last().felt_force_n) - felt_lately_n;
            outcome.felt_n = outcome.felt_n.max(felt_n);
        }
        let now = rig.now();
        let is_live =
            rig.handle().link_state(now) == LinkState::Live && rig.tool().is_connected(now);
        if caught_up_ms < ms && is_live {
            outcome.live_after_ms.get_or_insert(ms - caught_up_ms);
        }
    }
    let removed = rig.session().clay().removed_units() - removed;
    outcome.cut_mm3 = removed as f64 / 255.0;
    outcome.stale = [rig.tool().arrivals().stale, rig.handle().arrivals().stale];
    outcome
}

/// Neither driven nor felt, and it goes on soon.
fn assert_harmless(scheme: Scheme, case: &Case) {
    let outcome = run(scheme, case);
    let what = format!("{scheme}, {case:?}: {outcome:?}");
    let is_steady = case.line.jitter.is_zero();
    if case.trouble != Down {
        // With the way up alive the tool follows the hand, as it should.
        assert!(outcome.moved_m < 2e-5, "{what}");
        assert!(outcome.cut_mm3 <= 1.0, "{what}");
    }
    let feels_frames_alone = matches!(scheme, Scheme::ForceExchange | Scheme::PositionForce);
    if feels_frames_alone && matches!(case.trouble, Down | Both) && is_steady {
        assert!(outcome.fading_n < 0.05, "{what}");
    }
    // Both ends answer each other there: a tool that went otherwise than in the calm run is live, and felt otherwise
    // for a moment.
    let is_otherwise = matches!(scheme, Scheme::Wave | Scheme::Tdpa) && case.trouble == Down;
    let most_n = if is_otherwise { 0.6 } else { 0.05 };
    assert!(outcome.felt_n < most_n, "{what}");
    let soon_ms = if is_steady { 80 } else { 300 };
    let soon_ms = soon_ms + case.line.delay.as_millis() as u32;
    assert!(
        outcome.live_after_ms.is_some_and(|ms| ms <= soon_ms),
        "{what}"
    );
    if !case.deadband && is_steady {
        // The session's own line holds so many frames of a program that is stopped; the last of a queue are in time.
        let queued = u64::from(case.length_ms).min(4096) - 25;
        assert!(queued <= outcome.stale[0].max(outcome.stale[1]), "{what}");
    }
}

/// As it was found: the hand rests in clay, nothing comes for a second, then the thousand frames of that second, twenty
/// a millisecond.
#[test]
fn a_second_that_comes_twentyfold_moves_no_tool() {
    let case = Case {
        line: line(0, 0.0, 0.0),
        ..Case::new(Up, 1000, 20.0)
    };
    for scheme in SCHEMES {
        assert_harmless(scheme, &case);
    }
}

#[test]
fn no_queue_of_a_line_is_driven_or_felt() {
    for scheme in SCHEMES {
        for trouble in [Up, Down, Both] {
            for length_ms in [120, 150, 300, 1000, 3000] {
                for drain in [1.2, 2.0, 20.0, f64::INFINITY] {
                    assert_harmless(scheme, &Case::new(trouble, length_ms, drain));
                }
            }
            assert_harmless(scheme, &Case::new(trouble, 10_000, 5.0));
            assert_harmless(scheme, &Case::new(trouble, 10_000, f64::INFINITY));
        }
    }
}

/// Stopped and continued: what came meanwhile waits outside, and is there all at once.
#[test]
fn a_program_that_was_stopped_drives_and_feels_nothing_of_what_waited() {
    for scheme in SCHEMES {
        for trouble in [Server, Handle] {
            for length_ms in [120, 300, 1000, 3000, 10_000] {
                assert_harmless(scheme, &Case::new(trouble, length_ms, f64::INFINITY));
            }
        }
    }
}

#[test]
fn no_queue_is_driven_or_felt_with_frames_left_out_on_clocks_apart_or_on_a_bad_line() {
    let jittering = Impairment {
        reorder: 0.05,
        duplicate: 0.05,
        ..line(25, 0.2, 0.05)
    };
    for scheme in SCHEMES {
        for trouble in [Up, Down, Both, Server, Handle] {
            for drain in [1.5, 20.0, f64::INFINITY] {
                let plain = Case::new(trouble, 1000, drain);
                let sparing = Case {
                    deadband: true,
                    ..plain
                };
                let drifting = Case {
                    clock: (Duration::from_secs(5000), 100.0),
                    begins_ms: 9000,
                    ..plain
                };
                let bad = Case {
                    line: jittering,
                    begins_ms: 4000,
                    ..plain
                };
                let distant = Case {
                    line: line(150, 0.0, 0.0),
                    ..plain
                };
                for case in [sparing, drifting, bad, distant] {
                    assert_harmless(scheme, &case);
                }
            }
        }
    }
}

/// Of the line hardly anything is known then.
#[test]
fn no_queue_is_driven_or_felt_right_after_joining() {
    for scheme in SCHEMES {
        for trouble in [Up, Down, Both, Server, Handle] {
            for begins_ms in [20, 60, 200] {
                let case = Case {
                    begins_ms,
                    ..Case::new(trouble, 500, 20.0)
                };
                assert_harmless(scheme, &case);
            }
        }
    }
}

#[test]
fn what_queued_up_for_a_paused_session_is_not_driven_when_it_goes_on() {
    for scheme in SCHEMES {
        for resumed_ms in [1500, 2020, 2300] {
            let case = Case::new(Up, 1000, 20.0);
            let mut rig = rig_for(scheme, &case);
            case.begin(&mut rig);
            let mut removed = 0;
            for ms in 0..4000 {
                match ms {
                    500 => rig.pause(),
                    1000 => removed = rig.session().clay().removed_units(),
                    _ if ms == resumed_ms => rig.resume(),
                    _ => (),
                }
                rig.hold_handle_at(excursion(&case, ms));
                rig.tick();
            }
            let cut = rig.session().clay().removed_units() - removed;
            assert!(
                cut <= 255,
                "{scheme}, resumed at {resumed_ms} ms: {cut} units"
            );
        }
    }
}

/// A line that is longer from now on is no queue: the loop stands still for the longer way and not for a second.
#[test]
fn a_line_that_becomes_longer_for_good_freezes_nothing_for_long() {
    for scheme in SCHEMES {
        for added_ms in [60, 250] {
            let case = Case {
                line: line(0, 0.0, 0.0),
                ..Case::new(Up, 0, 20.0)
            };
            let mut rig = rig_for(scheme, &case);
            rig.run_for(Duration::from_secs(2));
            rig.impair(both_ways(line(added_ms, 0.0, 0.0), 1));
            let mut live_ms = None;
            for ms in 0..2000 {
                rig.tick();
                let now = rig.now();
                let is_live =
                    rig.handle().link_state(now) == LinkState::Live && rig.tool().is_connected(now);
                if added_ms < ms && is_live {
                    live_ms.get_or_insert(ms);
                } else if added_ms < ms && 100 < ms {
                    live_ms = None;
                }
            }
            let live_ms = live_ms.expect("never alive again");
            assert!(live_ms <= added_ms + 600, "{scheme}: {live_ms} ms");
        }
    }
}

/// The replica's cuts are facts: each counts, whenever it comes, and the hand feels the copy meanwhile.
#[test]
fn cuts_that_queued_up_all_count_and_are_not_felt_twice() {
    for trouble in [Up, Down, Both, Server, Handle] {
        for (length_ms, drain) in [
            (120, 20.0),
            (1000, 20.0),
            (1000, f64::INFINITY),
            (3000, 2.0),
        ] {
            let case = Case::new(trouble, length_ms, drain);
            let mut rig = rig_for(Scheme::Replica, &case);
            if matches!(trouble, Up | Down | Both) {
                case.begin(&mut rig);
            }
            let mut late_n = 0.0_f64;
            for ms in 0..case.caught_up_ms() + 4000 {
                if ms == case.begins_ms && matches!(trouble, Server | Handle) {
                    case.begin(&mut rig);
                }
                rig.hold_handle_at(excursion(&case, ms));
                rig.tick();
                if case.begins_ms + length_ms < ms {
                    late_n = late_n.max(norm(rig.last().felt_force_n));
                }
            }
            let copy = rig
                .clay_copy()
                .and_then(|copy| copy.copy())
                .expect("a copy");
            assert_eq!(
                copy.clay().removed_units(),
                rig.session().clay().removed_units(),
                "{case:?}"
            );
            assert_eq!(rig.tool().view().sweeps_refused, 0, "{case:?}");
            assert!(late_n < 0.05, "{case:?}: {late_n} N");
        }
    }
}
