//! What runs every tick allocates nothing: encoding and decoding of frames, decoding of watch messages.
//!
//! Allocations are counted by thread, since the test harness allocates on threads of its own.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

use teleclay_proto::frame::{HandleFrame, MAX_FRAME, SweepRecord, ToolFrame};
use teleclay_proto::watch::{
    BRICK_VOXELS, BrickContent, BricksHeader, BricksWriter, Message, TelemetryBatch,
    TelemetrySample,
};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator as it came; counting touches no memory of the caller's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread that is about to end has no count any more; nothing is measured there.
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps `alloc`'s contract, which is the same one.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `alloc` above, so from the system's allocator with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn frames_and_messages_are_read_without_allocating() {
    let mut handle = HandleFrame::default();
    while handle
        .sweeps
        .push(SweepRecord {
            sequence: 1,
            from: [1; 3],
            to: [2; 3],
        })
        .is_ok()
    {}
    let mut telemetry = Vec::new();
    TelemetryBatch::default()
        .encode(&[TelemetrySample::default(); 50], &mut telemetry)
        .expect("fifty samples fit");
    let header = BricksHeader {
        bricks_per_axis: [4, 4, 4],
        ..BricksHeader::default()
    };
    let mut writer = BricksWriter::new(header, usize::MAX);
    let noise: [u8; BRICK_VOXELS] = std::array::from_fn(|voxel| (voxel * voxel) as u8);
    for index in 0..64 {
        writer
            .push(index, BrickContent::Voxels(&noise))
            .expect("64 bricks lie in the grid");
    }
    let bricks = writer.finish().remove(0);

    let before = ALLOCATIONS.get();
    let mut buffer = [0; MAX_FRAME];
    let mut voxels = [0; BRICK_VOXELS];
    let mut read = 0;
    for _ in 0..100 {
        let frame = HandleFrame::decode(handle.encode(&mut buffer)).expect("it was encoded");
        read += black_box(frame).sweeps.len();
        let frame = ToolFrame::decode(ToolFrame::default().encode(&mut buffer));
        read += usize::from(black_box(frame).is_ok());
        for message in [&telemetry, &bricks] {
            match Message::decode(message).expect("it was encoded") {
                Message::Telemetry(view) => read += view.iter().map(black_box).count(),
                Message::Classes(view) => read += black_box(view.part).len(),
                Message::Bricks(view) => {
                    for brick in view.iter() {
                        brick.body.unpack(&mut voxels);
                        read += usize::from(black_box(&voxels) == &noise);
                    }
                }
            }
        }
        for cut in [0, 7, 48, 231] {
            read += usize::from(black_box(HandleFrame::decode(&buffer[..cut])).is_err());
        }
    }
    let allocations = ALLOCATIONS.get() - before;

    assert_eq!(read, 100 * (30 + 1 + 50 + 64 + 4), "everything was read");
    assert_eq!(allocations, 0);
    let before = ALLOCATIONS.get();
    black_box(Vec::<u8>::with_capacity(1));
    assert!(before < ALLOCATIONS.get(), "the allocator counts");
}
