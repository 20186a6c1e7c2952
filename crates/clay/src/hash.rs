//! Hashes by which two copies of the clay find out where they differ.
//!
//! A brick's hash depends on its 4096 occupancies alone, never on how they are stored: an empty brick and one that
//! holds 4096 zeros hash alike. Eight lanes of 64 bits take the brick's 512 little-endian words in turn:
//!
//! ```text
//! lane <- (lane ^ word) * ODD;   lane <- lane ^ (lane >> 32)
//! ```
//!
//! which loses nothing, so one changed occupancy always changes its lane. The lanes are then folded by the same step
//! and a finaliser of shifts and multiplications. It guards against accidents, not against an adversary.

use crate::field::{BrickView, SOLID};
use crate::grid::{BRICK_VOXELS, Grid};

/// The multiplier is odd, hence invertible modulo 2^64; its bits are those of the golden ratio.
const ODD: u64 = 0x9E37_79B9_7F4A_7C15;
/// Multiplier of the finaliser: odd, bits of the square root of two.
const ODD_TOO: u64 = 0x6A09_E667_F3BC_C909;
const LANES: usize = 8;

/// Hashes as of when each brick was last looked at.
#[derive(Clone, Debug)]
pub(crate) struct Hashes {
    bricks: Vec<u64>,
    /// Sum of the shares of grid and bricks.
    total: u64,
    empty: u64,
    full: u64,
}

impl Hashes {
    /// Of a grid whose bricks are all still to be looked at.
    pub(crate) fn none(grid: &Grid) -> Self {
        let count = grid.brick_count();
        let mut total = of_grid(grid);
        for brick in 0..count {
            total = total.wrapping_add(share_of_brick(brick, 0));
        }
        Self {
            bricks: vec![0; count],
            total,
            empty: of_uniform(0),
            full: of_uniform(SOLID),
        }
    }

    pub(crate) fn of_brick(&self, brick: usize) -> u64 {
        self.bricks[brick]
    }

    /// Hash of the whole clay.
    pub(crate) const fn total(&self) -> u64 {
        self.total
    }

    /// Looks at a brick again.
    pub(crate) fn refresh(&mut self, brick: usize, view: BrickView<'_>) {
        let now = match view {
            BrickView::Empty => self.empty,
            BrickView::Full => self.full,
            BrickView::Voxels(voxels) => of_voxels(voxels),
        };
        let before = std::mem::replace(&mut self.bricks[brick], now);
        self.total = self
            .total
            .wrapping_sub(share_of_brick(brick, before))
            .wrapping_add(share_of_brick(brick, now));
    }
}

/// Hash of a brick's occupancies.
fn of_voxels(voxels: &[u8; BRICK_VOXELS]) -> u64 {
    let (words, _) = voxels.as_chunks::<8>();
    let (rounds, _) = words.as_chunks::<LANES>();
    of_rounds(rounds.iter().map(|round| round.map(u64::from_le_bytes)))
}

/// Hash of a brick whose occupancies are all the same.
fn of_uniform(occupancy: u8) -> u64 {
    let word = u64::from_le_bytes([occupancy; 8]);
    of_rounds(std::iter::repeat_n([word; LANES], BRICK_VOXELS / 8 / LANES))
}

/// What a brick adds to the hash of the whole clay. Sums of these do not depend on the order of bricks, and one brick's
/// share can be taken out and put back.
fn share_of_brick(brick: usize, brick_hash: u64) -> u64 {
    finish(step(brick_hash, brick as u64))
}

/// What the grid itself adds to the hash of the whole clay.
fn of_grid(grid: &Grid) -> u64 {
    let [x, y, z] = grid.voxels().map(u64::from);
    finish(step(
        step(ODD, x | y << 16 | z << 32),
        grid.voxel_size_m().to_bits(),
    ))
}

/// Folds a value into a running digest, where order matters.
pub(crate) fn fold(digest: u64, value: u64) -> u64 {
    finish(step(digest, value))
}

/// Digest of any bytes, their number included.
pub(crate) fn of_bytes(bytes: &[u8]) -> u64 {
    let (words, rest) = bytes.as_chunks::<8>();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    let lane = words
        .iter()
        .chain([&last])
        .map(|word| u64::from_le_bytes(*word))
        .fold(ODD, step);
    finish(step(lane, bytes.len() as u64))
}

/// Each round gives every lane a word.
fn of_rounds(rounds: impl Iterator<Item = [u64; LANES]>) -> u64 {
    let mut lanes: [u64; LANES] = std::array::from_fn(|lane| ODD_TOO.wrapping_mul(lane as u64 + 1));
    for round in rounds {
        for (lane, word) in lanes.iter_mut().zip(round) {
            *lane = step(*lane, word);
        }
    }
    finish(lanes.into_iter().fold(ODD, step))
}

const fn step(lane: u64, word: u64) -> u64 {
    let mixed = (lane ^ word).wrapping_mul(ODD);
    mixed ^ mixed >> 32
}

const fn finish(digest: u64) -> u64 {
    let mixed = (digest ^ digest >> 29).wrapping_mul(ODD_TOO);
    mixed ^ mixed >> 32
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn a_uniform_brick_hashes_like_its_voxels() {
        for occupancy in [0, 1, 255] {
            assert_eq!(of_uniform(occupancy), of_voxels(&[occupancy; BRICK_VOXELS]));
        }
    }

    /// Every single change of one voxel gives a hash of its own: a hash that skipped voxels or forgot their place would
    /// collide.
    #[test]
    fn every_voxel_and_every_value_counts() {
        let mut voxels = [255; BRICK_VOXELS];
        let mut seen = HashSet::from([of_voxels(&voxels)]);
        for at in 0..BRICK_VOXELS {
            for value in [254, 127, 0] {
                voxels[at] = value;
                assert!(seen.insert(of_voxels(&voxels)), "voxel {at} = {value}");
            }
            voxels[at] = 255;
        }
    }

    #[test]
    fn swapped_bricks_change_the_sum() {
        let (a, b) = (of_uniform(3), of_uniform(4));
        assert_ne!(
            share_of_brick(0, a).wrapping_add(share_of_brick(1, b)),
            share_of_brick(0, b).wrapping_add(share_of_brick(1, a))
        );
    }

    /// Flipping one input bit flips about half of the output bits.
    #[test]
    fn one_bit_avalanches() {
        let mut voxels = [0; BRICK_VOXELS];
        let before = of_voxels(&voxels);
        let mut flipped = 0;
        for at in 0..BRICK_VOXELS {
            voxels[at] = 1;
            flipped += (of_voxels(&voxels) ^ before).count_ones();
            voxels[at] = 0;
        }
        let mean = f64::from(flipped) / BRICK_VOXELS as f64;
        assert!((mean - 32.0).abs() < 1.0, "{mean} bits of 64");
    }
}
