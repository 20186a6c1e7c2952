//! Threads on virtual time: sessions that move between them, and sessions that rest.

use std::collections::BTreeMap;

use proptest::prelude::*;
use teleclay_proto::frame::{Engagement, HandleFrame, Header, MAX_FRAME};
use teleclay_proto::http::{Axes, ClaySpec, NewSession, ToolDescription};
use teleclay_proto::{Scheme, SessionId};
use teleclay_session::{Command, Event, Operator, Rules, Session, SessionSetup, Settings};
use teleclay_shell::Clock;
use teleclay_shell::realtime::{Ends, Realtime};
use teleclay_shell::ticker::Next;

use super::running::RunningEnds;
use super::*;

/// Threads that are ticked by hand, and the ends of their rings.
struct Bench {
    loops: Vec<Realtime<Engine>>,
    ends: Vec<Ends<Engine>>,
    leaving: Leaving,
    sessions: BTreeMap<u32, Kept>,
}

/// What a test keeps of a session.
struct Kept {
    ends: RunningEnds,
    settings: Settings,
    thread: usize,
    header: Option<Header>,
    /// Bytes of the frames that have left, in their order.
    frames: Vec<Vec<u8>>,
    events: Vec<Event>,
    record: SessionRecord,
    records: usize,
}

fn at(number: u64) -> Timestamp {
    Timestamp::ZERO.after(TICK * number as u32)
}

fn settings(name: &str) -> Settings {
    let new = NewSession {
        scheme: Scheme::ForceExchange,
        axes: Axes::Three,
        clay: ClaySpec {
            shape: ClayShape::Block {
                size_m: [0.032, 0.032, 0.016],
            },
            voxel_size_m: 2e-3,
            layers: Vec::new(),
        },
        tool: ToolDescription::Ball { radius_m: 0.0064 },
        tools: 1,
        ..NewSession::new(SessionId::new(name).unwrap())
    };
    Settings::new(new).unwrap()
}

impl Bench {
    fn new(threads: usize) -> Self {
        let (all, leaving) = Engine::threads(threads, None);
        let clock = Clock::start();
        let (loops, ends) = all
            .into_iter()
            .map(|Threaded { engine, waker }| {
                let (realtime, ends) = Realtime::new(engine, clock, CAPACITIES);
                (realtime.resting(waker), ends)
            })
            .unzip();
        Self {
            loops,
            ends,
            leaving,
            sessions: BTreeMap::new(),
        }
    }

    /// Gives an order to a thread; it is carried out in its next tick.
    fn order(&mut self, thread: usize, task: Task) {
        let (reply, _) = oneshot::channel();
        let order = Box::new(Order {
            claim: Claim::default(),
            task,
            reply,
            answer: Answer::Undone,
        });
        assert!(self.ends[thread].orders.push(order).is_ok());
    }

    fn add(&mut self, number: u32, thread: usize) {
        let settings = settings(&format!("s{number}"));
        let session = Session::new(SessionSetup {
            lines: settings.lines(),
            clay: settings.fresh_block().unwrap(),
            settings: settings.clone(),
            rules: Rules::default(),
            first_lease: 1,
            ownership_epoch: 1,
        });
        let (running, ends) = Running::new(number, session, None);
        let kept = Kept {
            ends,
            settings,
            thread,
            header: None,
            frames: Vec::new(),
            events: Vec::new(),
            record: SessionRecord::default(),
            records: 0,
        };
        self.sessions.insert(number, kept);
        self.order(thread, Task::Add(Some(running)));
    }

    fn join(&mut self, number: u32) {
        let kept = &self.sessions[&number];
        let operator = Operator {
            name: "Ada".to_owned(),
            device: "none".to_owned(),
        };
        let prepared = Prepared::new(&Command::Join { operator }, &kept.settings).unwrap();
        let task = Task::Command {
            session: number,
            prepared,
            mirror: None,
        };
        self.order(kept.thread, task);
    }

    fn move_to(&mut self, number: u32, to: usize) {
        let kept = self.sessions.get_mut(&number).unwrap();
        let from = std::mem::replace(&mut kept.thread, to);
        if from != to {
            let session = number;
            self.order(from, Task::Move { session, to });
        }
    }

    /// Every hand that holds a tool sends a frame: a stroke into the clay and out again.
    fn send(&mut self, number: u64) {
        for kept in self.sessions.values_mut() {
            let Some(header) = &mut kept.header else {
                continue;
            };
            header.sequence = header.sequence.wrapping_add(1);
            header.sent_ns = at(number).as_nanos();
            let phase = 0.01 * f64::from(header.sequence);
            let frame = HandleFrame {
                header: *header,
                engagement: Engagement::Engaged,
                position_m: [0.008 * phase.sin(), 0.0, -0.004],
                ..HandleFrame::default()
            };
            let incoming = Incoming {
                slot: 0,
                arrived_ns: at(number).as_nanos(),
                frame,
            };
            assert!(kept.ends.frames.push(incoming).is_ok());
        }
    }

    /// One thread's tick at a deadline.
    fn tick(&mut self, thread: usize, number: u64, rested: u64) -> Next {
        self.tick_due(thread, number, number * 1_000_000, rested)
    }

    /// One whose deadline is not the number's own.
    fn tick_due(&mut self, thread: usize, number: u64, deadline_ns: u64, rested: u64) -> Next {
        let tick = Tick {
            number,
            deadline_ns,
            rested,
            ..Tick::default()
        };
        let now = Timestamp::from_nanos(deadline_ns);
        let next = self.loops[thread].tick_at(now, tick);
        while let Ok(done) = self.ends[thread].done.pop() {
            let Done::Order(order) = done else { continue };
            if let (Task::Command { session, .. }, Answer::Command(Ok(outcome))) =
                (&order.task, &order.answer)
            {
                let kept = self.sessions.get_mut(session).unwrap();
                let granted = outcome.granted.unwrap();
                kept.header = Some(Header {
                    lease: granted.lease,
                    ownership_epoch: 1,
                    revision: outcome.revision as u32,
                    clay_epoch: outcome.clay_epoch,
                    scheme: kept.settings.spec.scheme,
                    ..Header::default()
                });
            } else {
                assert!(matches!(order.answer, Answer::Done), "{:?}", order.answer);
            }
        }
        while self.ends[thread].records.pop().is_ok() {}
        self.take();
        next
    }

    fn take(&mut self) {
        let mut buffer = [0; MAX_FRAME];
        while let Ok(Outgoing { session, frame, .. }) = self.leaving.pop() {
            let kept = self.sessions.get_mut(&session).unwrap();
            kept.frames.push(frame.encode(&mut buffer).to_vec());
        }
        for kept in self.sessions.values_mut() {
            while let Ok(event) = kept.ends.told.events.pop() {
                kept.events.push(event);
            }
            while let Ok(record) = kept.ends.told.records.pop() {
                assert!(kept.record.ticks < record.ticks, "records go on");
                kept.record = record;
                kept.records += 1;
            }
            while kept.ends.told.bricks.pop().is_ok() {}
        }
    }

    fn ticks_of(&self, number: u32) -> u64 {
        let mut all = self.loops.iter().flat_map(|one| &one.machine().running);
        let running = all.find(|running| running.number == number);
        running.map_or(0, |running| running.session.ticks())
    }

    fn overflowed(&self) -> u64 {
        let counters = self.ends.iter().map(|ends| &ends.counters);
        counters
            .map(|counters| {
                counters
                    .overflowed
                    .load(std::sync::atomic::Ordering::Relaxed)
            })
            .sum()
    }
}

/// What a session comes to: its frames, its events, its ticks, and what is left of its clay.
type Outcome = (Vec<Vec<u8>>, Vec<Event>, u64, u64);

/// What three sessions with hands come to after so many deadlines, the threads ticked in `orders`, with these moves: at
/// which deadline, whose, where to.
fn run(
    threads: usize,
    deadlines: u64,
    moves: &[(u64, u32, usize)],
    turn: impl Fn(u64) -> usize,
) -> Vec<Outcome> {
    let mut bench = Bench::new(threads);
    for number in 1..=3 {
        bench.add(number, number as usize % threads);
    }
    for deadline in 1..=deadlines {
        if deadline == 10 {
            (1..=3).for_each(|number| bench.join(number));
        }
        for number in 1..=3 {
            // Whoever moves a session waits until it has come before it moves it again.
            let mut own = moves
                .iter()
                .filter(|(when, whose, _)| (*when, *whose) == (deadline, number));
            if let Some(&(_, _, to)) = own.next() {
                bench.move_to(number, to % threads);
            }
        }
        bench.send(deadline);
        for thread in 0..threads {
            bench.tick((thread + turn(deadline)) % threads, deadline, 0);
        }
    }
    // Whoever is between two threads arrives.
    for thread in 0..threads {
        bench.tick(thread, deadlines + 1, 0);
    }
    for thread in 0..threads {
        bench.tick(thread, deadlines + 1, 0);
    }
    assert_eq!(bench.overflowed(), 0);
    let ticks: Vec<u64> = (1..=3).map(|number| bench.ticks_of(number)).collect();
    let all = bench.sessions.into_values().zip(ticks);
    all.map(|(kept, ticks)| {
        let remaining = kept.record.remaining_units;
        (kept.frames, kept.events, ticks, remaining)
    })
    .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Bits do not know on which thread they are made: frames, events, ticks and clay are those of sessions that stay
    /// where they are, however often one moves, and whichever thread comes first in a deadline. So a hand that holds a
    /// tool feels no step.
    #[test]
    fn a_move_changes_no_bit_misses_no_tick_and_makes_none_twice(
        moves in prop::collection::vec((1..500_u64, 1..=3_u32, 0..3_usize), 0..40),
        turns in prop::collection::vec(0..3_usize, 500),
    ) {
        let stayed = run(1, 500, &[], |_| 0);
        let moved = run(3, 500, &moves, |deadline| turns[deadline as usize % 500]);
        for ((stayed, moved), number) in stayed.iter().zip(&moved).zip(1..) {
            prop_assert_eq!(stayed.2, 501, "ticks of {}", number);
            prop_assert_eq!(moved.2, 501, "ticks of {}", number);
            prop_assert!(400 < stayed.0.len());
            prop_assert!(stayed.0 == moved.0, "frames of session {}", number);
            prop_assert_eq!(&stayed.1, &moved.1);
            prop_assert_eq!(stayed.3, moved.3);
        }
    }

    /// Threads that are up to five deadlines apart, as on a machine that has no time: no tick is lost, and none is made
    /// before its time or twice.
    #[test]
    fn threads_that_are_apart_lose_no_tick(
        moves in prop::collection::vec((1..200_usize, 1..=3_u32, 0..3_usize), 0..20),
        steps in prop::collection::vec(0..3_usize, 600),
    ) {
        let mut bench = Bench::new(3);
        for number in 1..=3 {
            bench.add(number, number as usize % 3);
        }
        let mut numbers = [0_u64; 3];
        let least = |numbers: &[u64; 3]| *numbers.iter().min().unwrap();
        let mut joined = false;
        for (step, &thread) in steps.iter().enumerate() {
            if !joined && 10 <= least(&numbers) {
                (1..=3).for_each(|number| bench.join(number));
                joined = true;
            }
            // One order at a time: whoever moves a session waits until it has come.
            for &(_, number, to) in moves.iter().filter(|(when, ..)| *when == step) {
                let kept = &bench.sessions[&number];
                if joined && kept.record.thread == kept.thread && 0 < kept.record.ticks {
                    bench.move_to(number, to);
                }
            }
            if numbers[thread] < least(&numbers) + 5 {
                numbers[thread] += 1;
                bench.tick(thread, numbers[thread], 0);
                for number in 1..=3 {
                    let most = numbers.iter().max().unwrap();
                    prop_assert!(bench.ticks_of(number) <= *most);
                }
            }
        }
        let last = numbers.iter().max().unwrap() + 1;
        for _ in 0..3 {
            for (thread, number) in numbers.iter_mut().enumerate() {
                while *number < last {
                    *number += 1;
                    bench.tick(thread, *number, 0);
                }
                bench.tick(thread, last, 0);
            }
        }
        for number in 1..=3 {
            // Sessions were added in the first tick of their thread.
            prop_assert_eq!(bench.ticks_of(number), last);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Threads follow the frames of their own sessions, so their deadlines lie apart, and drift: a session that moves
    /// has its next tick at most half a tick sooner or later, and every other one in its time.
    #[test]
    fn threads_with_deadlines_of_their_own_lose_no_tick(
        moves in prop::collection::vec((10..300_u64, 0..3_usize), 0..60),
        apart_ns in prop::collection::vec(0..1_000_000_u64, 3),
        drift_ns in prop::collection::vec(-500..=500_i64, 3),
    ) {
        let mut bench = Bench::new(3);
        bench.add(1, 0);
        // Whose deadline is next, and when.
        let mut deadlines: Vec<u64> = apart_ns.iter().map(|apart_ns| 1_000_000 + apart_ns).collect();
        let mut numbers = [0_u64, 70, 1_000_000];
        let mut ticked_ns = Vec::new();
        for _ in 0..3 * 300 {
            let thread = (0..3).min_by_key(|&thread| deadlines[thread]).unwrap();
            let deadline_ns = deadlines[thread];
            if (thread, numbers[0]) == (0, 2) {
                bench.join(1);
            }
            for &(_, to) in moves.iter().filter(|(when, _)| *when == numbers[0]) {
                let kept = &bench.sessions[&1];
                if thread == 0 && kept.record.thread == kept.thread {
                    bench.move_to(1, to);
                }
            }
            bench.tick_due(thread, numbers[thread], deadline_ns, 0);
            // A frame leaves in each tick of a session that somebody holds.
            ticked_ns.resize(bench.sessions[&1].frames.len(), deadline_ns);
            numbers[thread] += 1;
            deadlines[thread] = deadline_ns + 1_000_000_u64.saturating_add_signed(drift_ns[thread]);
        }
        let gaps: Vec<u64> = ticked_ns.windows(2).map(|pair| pair[1] - pair[0]).collect();
        prop_assert!(280 < gaps.len());
        for (tick, gap_ns) in gaps.iter().enumerate() {
            prop_assert!(
                (499_000..=1_501_000).contains(gap_ns),
                "{} us after tick {}", gap_ns / 1000, tick
            );
        }
        let moved = gaps.iter().filter(|gap_ns| 1_000 < gap_ns.abs_diff(1_000_000));
        prop_assert!(moved.count() <= moves.len());
    }
}

/// A thread with nothing to do asks to sleep, and an order finds the session at the tick at which it would have been:
/// what the journal is told has the same number as without any rest.
#[test]
fn a_thread_at_rest_sleeps_and_its_sessions_keep_the_time() {
    let mut bench = Bench::new(1);
    assert_eq!(bench.tick(0, 1, 0), Next::Rest(50), "nobody is there");
    bench.add(1, 0);
    let mut number = 1;
    loop {
        number += 1;
        if bench.tick(0, number, 0) == Next::Rest(50) {
            break;
        }
        assert!(number < 1000, "it comes to rest");
    }
    assert_eq!(bench.ticks_of(1), number - 1);
    let records = bench.sessions[&1].records;
    // Asleep for as long as that, four times, and each time that is told once.
    for _ in 0..4 {
        number += 51;
        assert_eq!(bench.tick(0, number, 50), Next::Rest(50));
        assert_eq!(bench.ticks_of(1), number - 1);
        assert_eq!(bench.sessions[&1].record.ticks, number - 1);
    }
    assert_eq!(bench.sessions[&1].records, records + 4);
    // Woken after seven more.
    bench.join(1);
    number += 8;
    assert_eq!(bench.tick(0, number, 7), Next::Continue);
    let kept = &bench.sessions[&1];
    assert_eq!(kept.events[0].tick, number - 2, "between two ticks");
    assert_eq!(bench.ticks_of(1), number - 1);
}

/// Beside a session that works, one at rest is looked at twenty times a second.
#[test]
fn a_session_at_rest_costs_no_tick_beside_one_that_works() {
    let mut bench = Bench::new(1);
    bench.add(1, 0);
    bench.add(2, 0);
    for number in 1..=1000 {
        bench.tick(0, number, 0);
    }
    bench.join(1);
    let records = bench.sessions[&2].records;
    for number in 1001..=2000 {
        bench.send(number);
        assert!(!matches!(bench.tick(0, number, 0), Next::Rest(_)));
    }
    assert_eq!(bench.sessions[&2].records - records, 20);
    assert_eq!(bench.ticks_of(1), 2000);
    assert!(1950 < bench.ticks_of(2));
}

/// What a stall gives up is not made up for by a session that works, and is time like any other for one at rest.
#[test]
fn what_a_stall_gives_up_is_given_up_by_those_who_work() {
    let mut bench = Bench::new(1);
    bench.add(1, 0);
    bench.add(2, 0);
    for number in 1..=500 {
        bench.tick(0, number, 0);
    }
    bench.join(1);
    bench.tick(0, 501, 0);
    bench.tick(0, 801, 0);
    assert_eq!((bench.ticks_of(1), bench.ticks_of(2)), (502, 801));
}

#[test]
fn a_session_goes_nowhere_but_to_another_thread_that_there_is() {
    let mut bench = Bench::new(2);
    bench.add(1, 0);
    bench.tick(0, 1, 0);
    for to in [0, 2, 99] {
        let (reply, _) = oneshot::channel();
        let mut order = Box::new(Order {
            claim: Claim::default(),
            task: Task::Move { session: 1, to },
            reply,
            answer: Answer::Done,
        });
        order.claim = Claim::default();
        assert!(bench.ends[0].orders.push(order).is_ok());
        bench.loops[0].tick_at(
            at(2),
            Tick {
                number: 2,
                ..Tick::default()
            },
        );
        let Ok(Done::Order(order)) = bench.ends[0].done.pop() else {
            panic!("it was carried out");
        };
        assert!(matches!(order.answer, Answer::Undone), "to {to}");
    }
}
