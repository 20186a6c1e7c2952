//! What a large block costs before and while it is cut: memory follows what is cut of it.

use std::time::Instant;

use teleclay_clay::{Ball, Clay, Pose, Shape, Sweep, ToolShape};

const VOXEL_M: f64 = 5e-4;
/// A fresh block of the largest size, with what tools may need next.
const FRESH_BYTES: usize = 20_000_000;

/// What this process has of memory, bytes. Every test has a process of its own.
fn resident_bytes() -> usize {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: usize = statm.split(' ').nth(1).unwrap().parse().unwrap();
    pages * 4096
}

#[cfg(target_os = "linux")]
#[test]
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
