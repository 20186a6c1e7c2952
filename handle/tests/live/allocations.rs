//! The steady tick allocates nothing: counted on its own thread, from one sample of the device to the next, so that all
//! of the tick, its rings and its timer are in it.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use teleclay_device::DeviceSample;
use teleclay_handle::device::{Device, DeviceCommand, DeviceError, DeviceRequest, SimulatedDevice};
use teleclay_handle::intent::Intent;
use teleclay_handle::status::Status;

use super::holder::Holder;
use super::server::{Server, Speech, free_endpoint};

struct Counting;

thread_local! {
    static TOUCHED: Cell<u64> = const { Cell::new(0) };
}

fn count() {
    // A thread that is about to end has no count any more; nothing is measured there.
    let _ = TOUCHED.try_with(|touched| touched.set(touched.get() + 1));
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

/// Ticks until everything that happens once has happened: the first frames, the ramps.
const WARM_UP: u64 = 300;
/// Ticks that are counted.
const STEADY: u64 = 1000;

/// A cutting hand that reads its thread's count of allocations each tick.
struct Counter {
    device: SimulatedDevice,
    ticks: u64,
    at_start: u64,
    /// The tick that is no longer counted.
    end: Arc<AtomicU64>,
    /// Allocations over the ticks that are counted, once they are over.
    result: Arc<AtomicU64>,
}

impl Counter {
    fn start(endpoint: &str, end: &Arc<AtomicU64>, result: &Arc<AtomicU64>) -> Holder {
        let (end, result) = (Arc::clone(end), Arc::clone(result));
        Holder::start_with(
            endpoint,
            Box::new(move |setup| {
                Ok(Box::new(Self {
                    device: SimulatedDevice::new(&Intent::Cutting, setup)?,
                    ticks: 0,
                    at_start: 0,
                    end: Arc::clone(&end),
                    result: Arc::clone(&result),
                }))
            }),
        )
    }
}

const NOT_YET: u64 = u64::MAX;

impl Device for Counter {
    fn name(&self) -> &str {
        "counter"
    }

    fn sample(&mut self) -> Result<DeviceSample, DeviceError> {
        let touched = TOUCHED.with(Cell::get);
        self.ticks += 1;
        if self.ticks == WARM_UP {
            self.at_start = touched;
        }
        let is_over = self.end.load(Ordering::Acquire) <= self.ticks;
        if is_over && self.result.load(Ordering::Relaxed) == NOT_YET {
            self.result
                .store(touched - self.at_start, Ordering::Release);
        }
        self.device.sample()
    }

    fn command(&mut self, command: &DeviceCommand) -> Result<(), DeviceError> {
        self.device.command(command)
    }

    fn poll_request(&mut self) -> Option<DeviceRequest> {
        self.device.poll_request()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_steady_tick_allocates_nothing() {
    let endpoint = free_endpoint();
    let _server = Server::start(&endpoint, &["lab"], 1).await;
    let result = Arc::new(AtomicU64::new(NOT_YET));
    let end = Arc::new(AtomicU64::new(WARM_UP + STEADY));
    let mut holder = Counter::start(&endpoint, &end, &result);
    holder
        .feels("enough ticks", |status| WARM_UP + STEADY < status.ticks)
        .await;
    let ending = holder.ends().await;
    ending.outcome.unwrap();
    assert!(
        STEADY / 2 < ending.summary.received,
        "the ticks that were counted had frames to take in"
    );
    assert_eq!(
        result.load(Ordering::Acquire),
        0,
        "allocations in {STEADY} ticks"
    );
}

/// The server falls silent, another lease follows, and the same handle side goes on under it.
#[tokio::test(flavor = "multi_thread")]
async fn going_on_under_another_lease_allocates_nothing_on_the_tick() {
    let endpoint = free_endpoint();
    let server = Server::start(&endpoint, &["lab"], 1).await;
    let result = Arc::new(AtomicU64::new(NOT_YET));
    let end = Arc::new(AtomicU64::new(u64::MAX));
    let mut holder = Counter::start(&endpoint, &end, &result);
    let warm = |status: &Status| 2 * WARM_UP < status.ticks && WARM_UP < status.received;
    holder.feels("enough ticks", warm).await;
    let [_, before] = *server.mood.numbers.lock().unwrap();
    server.speak(Speech::Silence);
    assert_eq!(holder.joins().await, 2);
    server.speak(Speech::Frames);
    holder.goes_live().await;
    let [first, _] = *server.mood.numbers.lock().unwrap();
    assert!(before < first, "the same handle side");
    end.store(0, Ordering::Release);
    let so_far = holder.feels("one more tick", |_| true).await.ticks;
    holder
        .feels("the next", |status| so_far < status.ticks)
        .await;
    holder.ends().await.outcome.unwrap();
    assert_eq!(result.load(Ordering::Acquire), 0, "allocations");
}

/// The count counts: a device that allocates is found out.
#[test]
fn an_allocation_is_seen() {
    let before = TOUCHED.with(Cell::get);
    drop(std::hint::black_box(vec![1_u8]));
    assert_eq!(TOUCHED.with(Cell::get) - before, 2);
}
