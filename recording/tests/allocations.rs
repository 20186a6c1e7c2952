//! What records a tick takes no memory and gives none back.
//!
//! One test alone in its process, since it counts every allocation of its thread.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]

#[path = "../../crates/session/tests/bench/mod.rs"]
mod bench;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use bench::{Bench, cutting, patch, stroke};
use teleclay_proto::Scheme;
use teleclay_proto::http::SessionPatch;
use teleclay_recording::{About, Scribe, Tap};

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

/// A block that is copied, cuts, changes of settings, and the end.
#[test]
fn a_tap_takes_no_memory() {
    let mut bench = Bench::new(cutting(Scheme::PositionForce));
    let mut hand = bench.join("Ada").unwrap();
    let (mut tap, mut feed) = Tap::new(bench.session.tools(), 1);
    let about = About {
        session: "bench".to_owned(),
        offset_ns: 0,
        topics: None,
        diagnose: None,
    };
    let mut scribe = Scribe::new(std::io::sink(), about).unwrap();
    for tick in 0..3000 {
        if tick % 500 == 250 {
            let deadband = Some(f64::from(tick % 1000) * 1e-4);
            let change = SessionPatch {
                deadband,
                ..SessionPatch::default()
            };
            bench.command(&patch(change)).unwrap();
        }
        let frame = hand.frame(bench.now, stroke(tick));
        bench.session.handle_frame(bench.now, hand.slot, &frame);
        let now = bench.now;
        let mut heard = Vec::new();
        bench.session.tick_heard(now, |slot, arrived, frame| {
            heard.push((slot, arrived, frame.clone()));
        });
        let events = bench.take_events();
        CALLS.set(Some(0));
        for (slot, arrived, frame) in &heard {
            tap.on_frame(*slot, *arrived, frame);
        }
        tap.on_tick(&mut bench.session, now, events.iter());
        if tick == 2999 {
            tap.end(&mut bench.session);
        }
        assert_eq!(CALLS.take(), Some(0), "in tick {tick}");
        scribe.take_from(&mut feed, 1000).unwrap();
        bench.now = now.after(bench::TICK);
    }
    assert!(scribe.has_begun());
    assert!(2900 < scribe.counts().ticks, "{:?}", scribe.counts());
}
