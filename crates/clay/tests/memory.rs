//! What a large block costs before and while it is cut: memory follows what is cut of it.

#![allow(clippy::print_stdout)] // what was measured

use std::time::Instant;

use teleclay_clay::{Ball, Clay, Pose, Shape, Sweep, ToolShape};

const VOXEL_M: f64 = 5e-4;
/// A fresh block of 512 voxels along each axis, with what tools may need next.
const FRESH_BYTES: usize = 20_000_000;

/// What this process has of memory, bytes.
fn resident_bytes() -> usize {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: usize = statm.split(' ').nth(1).unwrap().parse().unwrap();
    pages * 4096
}

/// One after the other: they share what is measured.
#[cfg(target_os = "linux")]
#[test]
fn memory_follows_what_is_cut() {
    a_block_takes_memory_as_it_is_cut();
    the_largest_block_takes_little_more();
}

fn a_block_takes_memory_as_it_is_cut() {
    let shape = Shape::Block {
        size_m: [512.0 * VOXEL_M; 3],
    };
    let before = resident_bytes();
    let began = Instant::now();
    let mut clay = Clay::new(&shape, VOXEL_M).unwrap();
    clay.commit_pages();
    let took = began.elapsed();
    let fresh = resident_bytes() - before;
    println!("512^3 voxels: {fresh} bytes, made in {took:?}");
    assert!(fresh < FRESH_BYTES, "{fresh} bytes");

    // A plane of bricks in the middle of it, cut row by row.
    let ball = ToolShape::Ball(Ball::new(0.005).unwrap());
    let at = |x_m: f64, y_m: f64| Pose::quantise([x_m, y_m, 256.0 * VOXEL_M]).unwrap();
    let edge_m = 512.0 * VOXEL_M;
    for row in 0..32 {
        let y_m = (f64::from(row) + 0.5) * 16.0 * VOXEL_M;
        for step in 0..512 {
            let x_m = |step: i32| f64::from(step) * VOXEL_M;
            clay.carve(&Sweep {
                shape: ball,
                from: at(x_m(step), y_m),
                to: at(x_m(step + 1), y_m),
            });
            clay.commit_ahead();
        }
    }
    assert!(edge_m * edge_m * 0.005 < clay.removed_volume_m3());
    // Two layers of 32 x 32 bricks hold a cut of 20 voxels about a border between them.
    let cut = resident_bytes() - before;
    println!("cut across: {cut} bytes");
    assert!(cut < FRESH_BYTES + 2 * 32 * 32 * 4096, "{cut} bytes");
}

fn the_largest_block_takes_little_more() {
    let size_m = [1024.0, 1024.0, 512.0].map(|voxels| voxels * VOXEL_M);
    let before = resident_bytes();
    let began = Instant::now();
    let mut clay = Clay::new(&Shape::Block { size_m }, VOXEL_M).unwrap();
    clay.commit_pages();
    let took = began.elapsed();
    let fresh = resident_bytes() - before;
    println!("1024 x 1024 x 512 voxels: {fresh} bytes, made in {took:?}");
    assert_eq!(clay.initial_units(), (1 << 29) * 255);
    assert!(fresh < 2 * FRESH_BYTES, "{fresh} bytes");

    // At its far corner a ball takes what it takes at the near one, but for rounding.
    let ball = ToolShape::Ball(Ball::new(0.005).unwrap());
    let mut cut = |at_m: [f64; 3]| {
        let at = Pose::quantise(at_m).unwrap();
        let (from, to) = (at, at);
        let shape = ball;
        clay.carve(&Sweep { shape, from, to })
    };
    let near = cut([0.0; 3]);
    assert!(0 < near);
    assert!(cut(size_m).abs_diff(near) < near / 10_000);
}
