//! The operations on arrays: what they mean, and what runs where there is nothing faster.

use std::ops::{Add, Div, Mul, Sub};

use super::{LANES, four_of};
use crate::grid::BRICK_VOXELS;

/// Four floats.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F32x4([f32; LANES]);

/// Four integers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct I32x4([i32; LANES]);

/// Sixteen occupancies: four along x in each of four rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tile([[u8; LANES]; LANES]);

/// For each lane, whether something holds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mask([bool; LANES]);

/// How much was removed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Removed(u32);

impl F32x4 {
    #[cfg(test)]
    pub(crate) fn from_array(lanes: [f32; LANES]) -> Self {
        Self(lanes)
    }

    pub(crate) fn to_array(self) -> [f32; LANES] {
        self.0
    }

    pub(crate) fn load(lanes: &[f32; LANES]) -> Self {
        Self(*lanes)
    }

    pub(crate) fn store(self, lanes: &mut [f32; LANES]) {
        *lanes = self.0;
    }

    /// Eight bytes of each lane, from the lowest on: the first of all lanes, the second of all lanes, and so on.
    pub(crate) fn of_bytes(lanes: [u64; LANES]) -> [Self; 8] {
        let lanes = lanes.map(u64::to_le_bytes);
        std::array::from_fn(|at| Self(lanes.map(|bytes| f32::from(bytes[at]))))
    }

    /// The same number in every lane.
    pub(crate) fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    /// The minimum of two; `other` where either is NaN.
    pub(crate) fn min(self, other: Self) -> Self {
        self.with(other, |a, b| if a < b { a } else { b })
    }

    /// The maximum of two; `other` where either is NaN.
    pub(crate) fn max(self, other: Self) -> Self {
        self.with(other, |a, b| if b < a { a } else { b })
    }

    pub(crate) fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    pub(crate) fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }

    /// `below` where these are less than `bound`, `otherwise` elsewhere and where either is NaN.
    pub(crate) fn where_below(self, bound: Self, below: Self, otherwise: Self) -> Self {
        Self(std::array::from_fn(|lane| {
            if self.0[lane] < bound.0[lane] {
                below.0[lane]
            } else {
                otherwise.0[lane]
            }
        }))
    }

    /// Whether any is above 0.
    pub(crate) fn any_above_0(self) -> bool {
        self.0.iter().any(|&at| 0.0 < at)
    }

    /// The whole numbers nearest to these, ties to even, kept between two small whole numbers; the lower one for NaN.
    pub(crate) fn nearest_within(self, [least, most]: [f32; 2]) -> I32x4 {
        let kept = self.max(Self::splat(least)).min(Self::splat(most));
        I32x4(kept.0.map(nearest))
    }

    /// Each lane in all lanes of one of its own.
    pub(crate) fn each_splatted(self) -> [Self; LANES] {
        self.0.map(Self::splat)
    }

    /// The least of all lanes, in each. None may be NaN.
    pub(crate) fn least(self) -> Self {
        let [a, b, c, d] = self.each_splatted();
        a.min(b).min(c.min(d))
    }

    /// The greatest of all lanes, in each. None may be NaN.
    pub(crate) fn most(self) -> Self {
        let [a, b, c, d] = self.each_splatted();
        a.max(b).max(c.max(d))
    }

    /// Where these are less than `bound`; not where either is NaN.
    pub(crate) fn is_below(self, bound: Self) -> Mask {
        Mask(std::array::from_fn(|lane| self.0[lane] < bound.0[lane]))
    }

    /// `first` in the first lane, and `step` more in each that follows.
    pub(crate) fn stepping(first: i32, step: i32) -> Self {
        Self(std::array::from_fn(|lane| {
            (first + lane as i32 * step) as f32
        }))
    }

    fn with(self, other: Self, each: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|lane| {
            each(self.0[lane], other.0[lane])
        }))
    }
}

/// Adding this to a single of magnitude below `2^22` leaves its value, rounded to nearest with ties to even, in the low
/// bits of the sum: rounding without a library call whose result could differ from machine to machine.
const ROUNDER: f32 = 12_582_912.0;

fn nearest(at: f32) -> i32 {
    (at + ROUNDER).to_bits() as i32 - ROUNDER.to_bits() as i32
}

impl Add for F32x4 {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
}

impl Sub for F32x4 {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
}

impl Mul for F32x4 {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.with(other, |a, b| a * b)
    }
}

impl Div for F32x4 {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        self.with(other, |a, b| a / b)
    }
}

impl I32x4 {
    pub(crate) fn splat(value: i32) -> Self {
        Self([value; LANES])
    }

    pub(crate) fn to_array(self) -> [i32; LANES] {
        self.0
    }

    /// The same numbers, of magnitude below `2^24`.
    pub(crate) fn to_f32(self) -> F32x4 {
        F32x4(self.0.map(|at| at as f32))
    }

    pub(crate) fn masked(self, mask: i32) -> Self {
        Self(self.0.map(|at| at & mask))
    }

    /// Numbers not below zero, divided by a power of two and rounded down.
    pub(crate) fn shifted_right<const BITS: i32>(self) -> Self {
        Self(self.0.map(|at| at >> BITS))
    }

    pub(crate) fn shifted_left<const BITS: i32>(self) -> Self {
        Self(self.0.map(|at| at << BITS))
    }

    pub(crate) fn equals(self, other: Self) -> Mask {
        Mask(std::array::from_fn(|lane| self.0[lane] == other.0[lane]))
    }

    /// Numbers from zero to below `2^15`, times a factor.
    pub(crate) fn times(self, factor: i16) -> Self {
        Self(self.0.map(|at| at * i32::from(factor)))
    }
}

impl Add for I32x4 {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| {
            self.0[lane].wrapping_add(other.0[lane])
        }))
    }
}

impl Tile {
    /// The whole numbers nearest to these, ties to even, and kept between 0 and 255. None may be NaN, nor anywhere near
    /// what overflows an integer.
    pub(crate) fn nearest(rows: [F32x4; LANES]) -> Self {
        let kept = |at: f32| at.clamp(0.0, 255.0);
        Self(rows.map(|row| row.0.map(|at| nearest(kept(at)) as u8)))
    }

    /// Whether all are solid.
    pub(crate) fn is_solid(self) -> bool {
        self.0.as_flattened().iter().all(|&at| at == u8::MAX)
    }

    /// Leaves at most this in a tile of a brick, and adds what that removed.
    pub(crate) fn cut(self, voxels: &mut [u8; BRICK_VOXELS], tile: u8, removed: &mut Removed) {
        let (fours, _) = voxels.as_chunks_mut::<LANES>();
        for (row, left) in self.0.iter().enumerate() {
            for (cell, left) in fours[four_of(tile, row)].iter_mut().zip(left) {
                removed.0 += u32::from(*cell - (*cell).min(*left));
                *cell = (*cell).min(*left);
            }
        }
    }
}

impl Mask {
    pub(crate) fn or(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane] | other.0[lane]))
    }

    pub(crate) fn and(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane] & other.0[lane]))
    }

    /// A bit for each lane, the first lowest.
    pub(crate) fn bits(self) -> u32 {
        (0..LANES).map(|lane| u32::from(self.0[lane]) << lane).sum()
    }
}

impl Removed {
    pub(crate) fn nothing() -> Self {
        Self(0)
    }

    pub(crate) fn sum(self) -> u32 {
        self.0
    }
}
