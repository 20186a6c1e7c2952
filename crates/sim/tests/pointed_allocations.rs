//! What a pointer does in a wake takes no memory and gives none back.
//!
//! One test alone in its process, since it counts every allocation of its thread.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]
#![allow(clippy::print_stdout, reason = "the counts are a result")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use teleclay_bilateral::LinkState;
use teleclay_pointer::{MadePath, Pointer, PointerSetup};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Scheme, ToolDescription};
use teleclay_session::Lines;
use teleclay_sim::pointed::{Pointed, PointedSetup, bricks_of, keys};

thread_local! {
    static CALLS: Cell<Option<u64>> = const { Cell::new(None) };
}

struct Counting;

fn count() {
    // A thread that is about to end counts nothing.
    let _ = CALLS.try_with(|calls| {
        if let Some(count) = calls.get() {
            calls.set(Some(count + 1));
        }
    });
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

/// Two seconds of a pointer that cuts, as they came to it, given to another one that is counted.
#[test]
fn a_wake_of_a_pointer_takes_no_memory() {
    for scheme in Scheme::ALL.iter().copied() {
        let mut pointed = Pointed::new(PointedSetup {
            parameters: LoopParameters {
                scheme,
                home_m: [0.064, 0.032, 0.032 + 0.0064],
                tool: ToolDescription::Ball { radius_m: 0.0064 },
                ..LoopParameters::default()
            },
            size_m: [0.128, 0.064, 0.032],
            voxel_size_m: 1e-3,
            lines: Lines::default(),
            wakes_every: 4,
        })
        .unwrap();
        let granted = pointed.granted().to_vec();
        let mut pointer = Pointer::new(0, PointerSetup::default(), &granted, &keys()).unwrap();
        if scheme.keeps_a_copy() {
            let grant: serde_json::Value = serde_json::from_slice(&granted).unwrap();
            let clay = serde_json::to_vec(&grant["clay"]).unwrap();
            pointer.begin_snapshot(&clay).unwrap();
            for message in bricks_of(pointed.session().clay(), 1) {
                pointer.handle_bricks(&message).unwrap();
            }
            pointer.finish_snapshot().unwrap();
        }
        pointer.hold();
        let (mut worst, mut sent) = (0, 0);
        for tick in 1..=2000_u64 {
            let now_ns = tick * 1_000_000;
            let messages = pointed.on_their_way_in().to_vec();
            pointed.tick();
            if !tick.is_multiple_of(4) {
                continue;
            }
            let ((), count) = calls(|| {
                pointer.handle_sample(now_ns, now_ns, MadePath::at(now_ns));
                for message in &messages {
                    pointer.handle_frames(now_ns, message).unwrap();
                }
                pointer.advance(now_ns);
                pointer.tidy();
                sent += pointer.outgoing().map_or(0, <[u8]>::len);
            });
            worst = worst.max(count);
        }
        println!("{scheme:?}: {worst} at most, {sent} bytes");
        assert!(500_000 < sent && pointer.view().link_state == LinkState::Live);
        assert_eq!(worst, 0, "{scheme:?}");
    }
    let (_, count) = calls(|| Vec::<u8>::with_capacity(1));
    assert!(0 < count, "the allocator counts");
}
