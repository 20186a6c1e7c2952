//! What the tick does with a device takes no memory and gives none back.
//!
//! One test alone in its process, since it counts every allocation of its thread.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use teleclay_device::DeviceCommand;
use teleclay_devices::exchange::{Marks, News, exchange};
use teleclay_devices::{Coupled, Hardware, SessionNeeds};
use teleclay_impedance::GraspState;

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

fn count() {
    // A thread that is about to end counts nothing.
    let _ = CALLS.try_with(|calls| calls.set(calls.get() + 1));
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

/// Two seconds of a hand that takes hold, moves, clutches and lets go.
#[test]
fn two_seconds_of_ticks_allocate_nothing() {
    let needs = SessionNeeds {
        tick_s: 1e-3,
        axes: 3,
        handle_damping_n_s_per_m: 10.0,
        reach_m: [0.05; 3],
    };
    let profile = Hardware::Haply.profile();
    let (mut driver, ends) = exchange(profile.force_n);
    let mut coupled = Coupled::new(Hardware::Haply, &needs, profile, ends).unwrap();
    let before = CALLS.get();
    let mut held = 0;
    let mut rendered_n = 0.0_f64;
    for tick in 0..2000_u64 {
        let now_ns = tick * 1_000_000;
        driver.tell(News {
            at_ns: now_ns,
            position_m: [1e-4 * (tick % 500) as f64, 0.0, 0.0],
            marks: Marks {
                takes_hold: tick % 500 == 10,
                lets_go: tick % 500 == 490,
                clutches: tick % 500 == 300,
                unclutches: tick % 500 == 400,
                wants_clay: tick % 500 == 250,
            },
        });
        coupled.sample(now_ns).unwrap();
        // A handle that stays where it is.
        coupled.command(now_ns, &DeviceCommand::default());
        held += u64::from(coupled.state() == GraspState::Held);
        rendered_n = rendered_n.max(driver.force(now_ns)[0].abs());
        if tick % 700 == 699 {
            coupled.let_go();
        }
    }
    let allocations = CALLS.get() - before;
    assert!(
        500 < held && 0.5 < rendered_n,
        "{held} ticks held, {rendered_n} N"
    );
    assert_eq!(allocations, 0);
}
