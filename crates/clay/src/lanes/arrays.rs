//! The operations on arrays: what they mean, and what runs where there is nothing faster.

use std::ops::{Add, Div, Mul, Sub};

use super::{Bytes, LANES};

/// Four singles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Floats([f32; LANES]);

/// Four integers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ints([i32; LANES]);

impl Floats {
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

    /// The same number in every lane.
    pub(crate) fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    /// The lesser of two; `other` where either is NaN.
    pub(crate) fn lesser(self, other: Self) -> Self {
        self.with(other, |a, b| if a < b { a } else { b })
    }

    /// The greater of two; `other` where either is NaN.
    pub(crate) fn greater(self, other: Self) -> Self {
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
    pub(crate) fn nearest_within(self, [least, most]: [f32; 2]) -> Ints {
        let kept = self.greater(Self::splat(least)).lesser(Self::splat(most));
        Ints(kept.0.map(nearest))
    }

    /// The whole numbers nearest to these, ties to even, and kept between 0 and 255. None may be NaN.
    pub(crate) fn to_bytes(self) -> Bytes {
        let kept = self.greater(Self::splat(0.0)).lesser(Self::splat(255.0));
        u32::from_le_bytes(kept.0.map(|at| nearest(at) as u8))
    }

    fn with(self, other: Self, each: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|lane| {
            each(self.0[lane], other.0[lane])
        }))
    }
}

/// Adding this to a single of magnitude below `2^22` leaves its value, rounded to nearest with ties to even, in the low bits of
/// the sum: rounding without a library call whose result could differ from machine to machine.
const ROUNDER: f32 = 12_582_912.0;

fn nearest(at: f32) -> i32 {
    (at + ROUNDER).to_bits() as i32 - ROUNDER.to_bits() as i32
}

impl From<i32> for Floats {
    /// This number and the next ones.
    fn from(first: i32) -> Self {
        Self(std::array::from_fn(|lane| (first + lane as i32) as f32))
    }
}

impl Add for Floats {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
}

impl Sub for Floats {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
}

impl Mul for Floats {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.with(other, |a, b| a * b)
    }
}

impl Div for Floats {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        self.with(other, |a, b| a / b)
    }
}

impl Ints {
    #[cfg(test)]
    pub(crate) fn from_array(lanes: [i32; LANES]) -> Self {
        Self(lanes)
    }

    pub(crate) fn to_array(self) -> [i32; LANES] {
        self.0
    }

    /// `first` in the first lane, and `step` more in each that follows.
    pub(crate) fn stepping(first: i32, step: i32) -> Self {
        Self(std::array::from_fn(|lane| first + lane as i32 * step))
    }

    /// A fourth, rounded down.
    pub(crate) fn quartered(self) -> Self {
        Self(self.0.map(|at| at >> 2))
    }

    /// Times `2^16`.
    pub(crate) fn in_upper_half(self) -> Self {
        Self(self.0.map(|at| at << 16))
    }

    /// Whether any is above 0.
    pub(crate) fn any_above_0(self) -> bool {
        self.0.iter().any(|&at| 0 < at)
    }

    pub(crate) fn greater(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane].max(other.0[lane])))
    }

    pub(crate) fn not_below_0(self) -> Self {
        Self(self.0.map(|at| at.max(0)))
    }
}

impl Add for Ints {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| {
            self.0[lane].wrapping_add(other.0[lane])
        }))
    }
}

impl Sub for Ints {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| {
            self.0[lane].wrapping_sub(other.0[lane])
        }))
    }
}

/// The lesser byte of each lane, and by how much they are less than the second in sum.
pub(crate) fn lesser_bytes(left: Bytes, old: Bytes) -> (Bytes, u32) {
    let (left, old) = (left.to_le_bytes(), old.to_le_bytes());
    let new = std::array::from_fn(|lane| left[lane].min(old[lane]));
    let removed = (0..LANES)
        .map(|lane| u32::from(old[lane] - new[lane]))
        .sum();
    (u32::from_le_bytes(new), removed)
}
