//! What keeps a history on a tick takes no memory and gives none back: cuts, changes of settings, undo.
//!
//! One test alone in its process, since it counts every allocation of its thread.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]

#[path = "../../session/tests/bench/mod.rs"]
mod bench;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use bench::{Bench, Hand, cutting, engaged_at, patch};
use teleclay_history::{Ledger, Recorder, Replay, Whose};
use teleclay_proto::Scheme;
use teleclay_proto::http::SessionPatch;
use teleclay_session::{Command, Event, Exchange, Prepared};

thread_local! {
    static CALLS: Cell<Option<u64>> = const { Cell::new(None) };
}

struct Counting;

fn count() {
    // A thread that is about to end counts nothing.
    let _ = CALLS.try_with(|calls| calls.set(calls.get().map(|count| count + 1)));
}

// SAFETY: every call goes to the system's allocator as it came; counting touches no memory of the caller's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps `alloc`'s contract, which is the same one.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: the pointer came from `alloc` above, so from the system's allocator with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// How often `work` takes memory or gives some back.
fn calls<T>(work: impl FnOnce() -> T) -> (T, u64) {
    CALLS.set(Some(0));
    let result = work();
    let count = CALLS.take().unwrap();
    (result, count)
}

/// A session and what keeps its history, with room for all that they tell.
struct Kept {
    bench: Bench,
    recorder: Recorder,
    ledger: Ledger,
    events: Vec<Event>,
    record: Vec<u8>,
    replay: Replay,
    sequence: u64,
}

impl Kept {
    fn new() -> Self {
        let mut bench = Bench::new(cutting(Scheme::PositionForce));
        bench.session.keep_journal();
        let mut recorder = Recorder::new(1);
        let replay = Replay::begin(recorder.begin(&bench.session, None), Vec::new()).unwrap();
        Self {
            bench,
            recorder,
            ledger: Ledger::new(),
            events: Vec::with_capacity(64),
            record: Vec::with_capacity(1 << 17),
            replay,
            sequence: 1,
        }
    }

    /// A tick with all that belongs to it on the thread that ticks.
    fn tick(&mut self) -> u64 {
        let (session, now) = (&mut self.bench.session, self.bench.now);
        let ((), count) = calls(|| {
            session.tick(now);
            while session.poll_transmit().is_some() {}
            while let Some(event) = session.poll_event() {
                self.events.push(event);
            }
            self.record.clear();
            if let Some(record) = self.recorder.record(session, self.events.iter()) {
                self.record.extend_from_slice(record);
                self.sequence += 1;
                self.ledger.push(self.sequence, session.ticks());
            }
            let durable = self.sequence.saturating_sub(8);
            let tick = self.ledger.durable_tick(durable, session.ticks());
            session.set_durable(tick);
        });
        self.events.clear();
        if !self.record.is_empty() {
            self.replay.apply(&self.record).unwrap();
        }
        self.bench.now = now.after(bench::TICK);
        count
    }

    fn drive(&mut self, hand: &mut Hand, ticks: u32) -> u64 {
        let mut worst = 0;
        for tick in 0..ticks {
            let x_m = 0.008 * (f64::from(tick) * 0.02).sin();
            let frame = hand.frame(self.bench.now, engaged_at([x_m, 0.0, -0.004]));
            let now = self.bench.now;
            self.bench.session.handle_frame(now, hand.slot, &frame);
            worst = worst.max(self.tick());
        }
        worst
    }
}

#[test]
fn a_history_touches_no_heap_on_a_tick() {
    assert!(0 < calls(|| vec![1_u8]).1, "the count counts");
    let mut kept = Kept::new();
    let mut hand = kept.bench.join("Ada").unwrap();
    kept.tick();
    assert_eq!(kept.drive(&mut hand, 1500), 0, "a steady tick");
    assert!(0 < kept.bench.session.clay().removed_units());
    let resting = patch(SessionPatch {
        deadband: Some(0.1),
        ..SessionPatch::default()
    });
    kept.bench.command(&resting).unwrap();
    assert_eq!(kept.drive(&mut hand, 10), 0, "a change of settings");
    let stroke = kept.replay.strokes().to_undo(Whose::Anybodys).unwrap();
    let exchanged = kept.replay.exchanged(Exchange::Undone { stroke }).unwrap();
    let mut prepared = Prepared::exchange(exchanged, kept.bench.session.settings());
    let (session, now) = (&mut kept.bench.session, kept.bench.now);
    let (outcome, count) = calls(|| session.handle_command(now, &mut prepared));
    outcome.unwrap();
    assert_eq!(count, 0, "an undo");
    assert_eq!(kept.drive(&mut hand, 10), 0, "what follows it");

    let eve = || "Eve".to_owned();
    let (tool, lease) = (1, None);
    let by = eve();
    let reason = "enough".to_owned();
    for command in [
        Command::Request {
            tool,
            operator: eve(),
        },
        Command::Grant {
            tool,
            operator: eve(),
            lease,
        },
        bench::join("Eve"),
        Command::Stop { by, reason },
        Command::ClearStop { by: eve() },
    ] {
        let mut prepared = Prepared::new(&command, kept.bench.session.settings()).unwrap();
        let (session, now) = (&mut kept.bench.session, kept.bench.now);
        let (outcome, count) = calls(|| session.handle_command(now, &mut prepared));
        outcome.unwrap();
        assert_eq!(count, 0, "{command:?}");
        assert_eq!(kept.tick(), 0, "the record of {command:?}");
    }
    assert_eq!(kept.replay.session().stop, None);
}
