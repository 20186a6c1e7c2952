//! What a brick holds before anybody has cut it.

use crate::grid::{BRICK_EDGE, BRICK_VOXELS, BrickIndex, Grid};
use crate::shape::covered_share;

/// Occupancy of solid clay, as in [`field`](crate::field).
const SOLID: u8 = u8::MAX;

/// Occupancies of a brick of disjoint boxes, in voxels; `None` if one box fills it.
pub(crate) fn fresh_voxels(
    grid: &Grid,
    index: BrickIndex,
    boxes: &[([f64; 3], [f64; 3])],
) -> Option<[u8; BRICK_VOXELS]> {
    let first = grid
        .brick_coordinates(index)
        .map(|at| usize::from(at) * BRICK_EDGE);
    let along = |(lower, upper): &([f64; 3], [f64; 3])| -> [[f64; BRICK_EDGE]; 3] {
        std::array::from_fn(|axis| {
            std::array::from_fn(|at| covered_share(first[axis] + at, lower[axis], upper[axis]))
        })
    };
    let fills = |shares: [[f64; BRICK_EDGE]; 3]| shares.iter().flatten().all(|&share| 1.0 <= share);
    if boxes.iter().map(along).any(fills) {
        return None;
    }
    let mut shares = vec![0.0; BRICK_VOXELS];
    for along in boxes.iter().map(along) {
        if along
            .iter()
            .any(|shares| shares.iter().all(|&share| share <= 0.0))
        {
            continue;
        }
        for (at, share) in shares.iter_mut().enumerate() {
            let (x, y, z) = (
                at % BRICK_EDGE,
                at / BRICK_EDGE % BRICK_EDGE,
                at / BRICK_EDGE / BRICK_EDGE,
            );
            *share += along[0][x] * along[1][y] * along[2][z];
        }
    }
    let mut voxels = [0; BRICK_VOXELS];
    for (voxel, share) in voxels.iter_mut().zip(shares) {
        *voxel = (share * f64::from(SOLID) + 0.5).min(f64::from(SOLID)) as u8;
    }
    Some(voxels)
}
