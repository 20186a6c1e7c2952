//! The operations in SSE2. See the twin on arrays for what they mean.
// Vector instructions are unsafe to name outside functions marked for them, and operators cannot be marked.
#![allow(unsafe_code)]

use std::arch::x86_64::{
    __m128, __m128i, _mm_add_epi32, _mm_add_ps, _mm_and_ps, _mm_and_si128, _mm_andnot_ps,
    _mm_castps_si128, _mm_castsi128_ps, _mm_cmpeq_epi8, _mm_cmpeq_epi32, _mm_cmplt_ps,
    _mm_cvtepi32_ps, _mm_cvtps_epi32, _mm_cvtsi64_si128, _mm_cvtsi128_si32, _mm_div_ps,
    _mm_loadu_ps, _mm_madd_epi16, _mm_max_ps, _mm_min_epu8, _mm_min_ps, _mm_movemask_epi8,
    _mm_movemask_ps, _mm_mul_ps, _mm_or_ps, _mm_packs_epi32, _mm_packus_epi16, _mm_sad_epu8,
    _mm_set_epi32, _mm_set1_epi8, _mm_set1_epi32, _mm_set1_ps, _mm_setzero_ps, _mm_setzero_si128,
    _mm_shuffle_ps, _mm_slli_epi32, _mm_sqrt_ps, _mm_srli_epi32, _mm_storeu_ps, _mm_storeu_si128,
    _mm_sub_ps, _mm_unpackhi_epi8, _mm_unpackhi_epi16, _mm_unpackhi_epi64, _mm_unpacklo_epi8,
    _mm_unpacklo_epi16,
};
use std::ops::{Add, Div, Mul, Sub};

use super::{LANES, four_of};
use crate::grid::BRICK_VOXELS;

/// Allows vector instructions.
macro_rules! sse2 {
    ({ $($body:tt)* }) => {
        // SAFETY: these instructions need a processor with SSE2, which is part of x86-64. Those that touch memory do so
        // through references to four numbers, which is what they read and write.
        unsafe { $($body)* }
    };
}

/// Four singles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F32x4(__m128);

/// Four integers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct I32x4(__m128i);

/// Sixteen occupancies: four along x in each of four rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tile(__m128i);

/// For each lane, whether something holds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mask(__m128);

/// Two sums side by side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Removed(__m128i);

impl F32x4 {
    #[cfg(test)]
    pub(crate) fn from_array(lanes: [f32; LANES]) -> Self {
        Self::load(&lanes)
    }

    #[inline(always)]
    pub(crate) fn to_array(self) -> [f32; LANES] {
        sse2! {{
            I32x4(_mm_castps_si128(self.0))
                .to_array()
                .map(|bits| f32::from_bits(bits as u32))
        }}
    }

    #[inline(always)]
    pub(crate) fn splat(value: f32) -> Self {
        sse2! {{
            Self(_mm_set1_ps(value))
        }}
    }

    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        sse2! {{
            Self(_mm_min_ps(self.0, other.0))
        }}
    }

    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        sse2! {{
            Self(_mm_max_ps(self.0, other.0))
        }}
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        sse2! {{
            Self(_mm_sqrt_ps(self.0))
        }}
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        sse2! {{
            Self(_mm_andnot_ps(_mm_set1_ps(-0.0), self.0))
        }}
    }

    #[inline(always)]
    pub(crate) fn any_above_0(self) -> bool {
        sse2! {{ _mm_movemask_ps(_mm_cmplt_ps(_mm_setzero_ps(), self.0)) != 0 }}
    }

    #[inline(always)]
    pub(crate) fn where_below(self, bound: Self, below: Self, otherwise: Self) -> Self {
        sse2! {{
            select(_mm_cmplt_ps(self.0, bound.0), below, otherwise)
        }}
    }

    #[inline(always)]
    pub(crate) fn nearest_within(self, [least, most]: [f32; 2]) -> I32x4 {
        let kept = self.max(Self::splat(least)).min(Self::splat(most));
        sse2! {{ I32x4(_mm_cvtps_epi32(kept.0)) }}
    }

    #[inline(always)]
    pub(crate) fn each_splatted(self) -> [Self; LANES] {
        sse2! {{
            [
                Self(_mm_shuffle_ps::<0b00_00_00_00>(self.0, self.0)),
                Self(_mm_shuffle_ps::<0b01_01_01_01>(self.0, self.0)),
                Self(_mm_shuffle_ps::<0b10_10_10_10>(self.0, self.0)),
                Self(_mm_shuffle_ps::<0b11_11_11_11>(self.0, self.0)),
            ]
        }}
    }

    #[inline(always)]
    pub(crate) fn least(self) -> Self {
        sse2! {{
            let pairs = _mm_min_ps(self.0, _mm_shuffle_ps::<0b10_11_00_01>(self.0, self.0));
            Self(_mm_min_ps(pairs, _mm_shuffle_ps::<0b01_00_11_10>(pairs, pairs)))
        }}
    }

    #[inline(always)]
    pub(crate) fn most(self) -> Self {
        sse2! {{
            let pairs = _mm_max_ps(self.0, _mm_shuffle_ps::<0b10_11_00_01>(self.0, self.0));
            Self(_mm_max_ps(pairs, _mm_shuffle_ps::<0b01_00_11_10>(pairs, pairs)))
        }}
    }

    #[inline(always)]
    pub(crate) fn is_below(self, bound: Self) -> Mask {
        sse2! {{ Mask(_mm_cmplt_ps(self.0, bound.0)) }}
    }

    #[inline(always)]
    pub(crate) fn stepping(first: i32, step: i32) -> Self {
        sse2! {{
            let lanes = _mm_add_epi32(
                _mm_set1_epi32(first),
                _mm_set_epi32(3 * step, 2 * step, step, 0),
            );
            Self(_mm_cvtepi32_ps(lanes))
        }}
    }

    #[inline(always)]
    pub(crate) fn of_bytes([a, b, c, d]: [u64; LANES]) -> [Self; 8] {
        sse2! {{
            let [a, b, c, d] = [a, b, c, d].map(|bytes| _mm_cvtsi64_si128(bytes as i64));
            let (ac, bd) = (_mm_unpacklo_epi8(a, c), _mm_unpacklo_epi8(b, d));
            let zero = _mm_setzero_si128();
            let floats = |bytes: __m128i| {
                let (low, high) = (_mm_unpacklo_epi8(bytes, zero), _mm_unpackhi_epi8(bytes, zero));
                [
                    _mm_unpacklo_epi16(low, zero),
                    _mm_unpackhi_epi16(low, zero),
                    _mm_unpacklo_epi16(high, zero),
                    _mm_unpackhi_epi16(high, zero),
                ]
                .map(|ints| Self(_mm_cvtepi32_ps(ints)))
            };
            let [a, b, c, d] = floats(_mm_unpacklo_epi8(ac, bd));
            let [e, f, g, h] = floats(_mm_unpackhi_epi8(ac, bd));
            [a, b, c, d, e, f, g, h]
        }}
    }

    #[inline(always)]
    pub(crate) fn load(lanes: &[f32; LANES]) -> Self {
        sse2! {{ Self(_mm_loadu_ps(lanes.as_ptr())) }}
    }

    #[inline(always)]
    pub(crate) fn store(self, lanes: &mut [f32; LANES]) {
        sse2! {{ _mm_storeu_ps(lanes.as_mut_ptr(), self.0) }}
    }
}

#[inline(always)]
fn select(mask: __m128, chosen: F32x4, otherwise: F32x4) -> F32x4 {
    sse2! {{
        F32x4(_mm_or_ps(
            _mm_and_ps(mask, chosen.0),
            _mm_andnot_ps(mask, otherwise.0),
        ))
    }}
}

impl Add for F32x4 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        sse2! {{
            Self(_mm_add_ps(self.0, other.0))
        }}
    }
}

impl Sub for F32x4 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        sse2! {{
            Self(_mm_sub_ps(self.0, other.0))
        }}
    }
}

impl Mul for F32x4 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        sse2! {{
            Self(_mm_mul_ps(self.0, other.0))
        }}
    }
}

impl Div for F32x4 {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        sse2! {{ Self(_mm_div_ps(self.0, other.0)) }}
    }
}

impl I32x4 {
    #[inline(always)]
    pub(crate) fn to_array(self) -> [i32; LANES] {
        let mut lanes = [0; LANES];
        sse2! {{ _mm_storeu_si128(lanes.as_mut_ptr().cast(), self.0) }}
        lanes
    }
}

impl I32x4 {
    #[inline(always)]
    pub(crate) fn splat(value: i32) -> Self {
        sse2! {{ Self(_mm_set1_epi32(value)) }}
    }

    #[inline(always)]
    pub(crate) fn to_f32(self) -> F32x4 {
        sse2! {{ F32x4(_mm_cvtepi32_ps(self.0)) }}
    }

    #[inline(always)]
    pub(crate) fn masked(self, mask: i32) -> Self {
        sse2! {{ Self(_mm_and_si128(self.0, _mm_set1_epi32(mask))) }}
    }

    #[inline(always)]
    pub(crate) fn shifted_right<const BITS: i32>(self) -> Self {
        sse2! {{ Self(_mm_srli_epi32::<BITS>(self.0)) }}
    }

    #[inline(always)]
    pub(crate) fn shifted_left<const BITS: i32>(self) -> Self {
        sse2! {{ Self(_mm_slli_epi32::<BITS>(self.0)) }}
    }

    #[inline(always)]
    pub(crate) fn equals(self, other: Self) -> Mask {
        sse2! {{ Mask(_mm_castsi128_ps(_mm_cmpeq_epi32(self.0, other.0))) }}
    }

    #[inline(always)]
    pub(crate) fn times(self, factor: i16) -> Self {
        // Products of the lower halves, and of the upper halves with nothing.
        sse2! {{ Self(_mm_madd_epi16(self.0, _mm_set1_epi32(i32::from(factor)))) }}
    }
}

impl Add for I32x4 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        sse2! {{ Self(_mm_add_epi32(self.0, other.0)) }}
    }
}

impl Tile {
    #[inline(always)]
    pub(crate) fn nearest(rows: [F32x4; LANES]) -> Self {
        sse2! {{
            let [a, b, c, d] = rows.map(|row| _mm_cvtps_epi32(row.0));
            // Packing keeps numbers between 0 and 255 by itself.
            Self(_mm_packus_epi16(_mm_packs_epi32(a, b), _mm_packs_epi32(c, d)))
        }}
    }

    #[inline(always)]
    pub(crate) fn is_solid(self) -> bool {
        sse2! {{ _mm_movemask_epi8(_mm_cmpeq_epi8(self.0, _mm_set1_epi8(-1))) == 0xFFFF }}
    }

    #[inline(always)]
    pub(crate) fn cut(self, voxels: &mut [u8; BRICK_VOXELS], tile: u8, removed: &mut Removed) {
        let (fours, _) = voxels.as_chunks_mut::<LANES>();
        let at = [0, 1, 2, 3].map(|row| four_of(tile, row));
        let [a, b, c, d] = at.map(|at| i32::from_le_bytes(fours[at]));
        sse2! {{
            let old = _mm_set_epi32(d, c, b, a);
            let new = _mm_min_epu8(self.0, old);
            for (at, left) in at.into_iter().zip(I32x4(new).to_array()) {
                fours[at] = left.to_le_bytes();
            }
            removed.0 = _mm_add_epi32(removed.0, _mm_sad_epu8(old, new));
        }}
    }
}

impl Mask {
    #[inline(always)]
    pub(crate) fn or(self, other: Self) -> Self {
        sse2! {{ Self(_mm_or_ps(self.0, other.0)) }}
    }

    #[inline(always)]
    pub(crate) fn and(self, other: Self) -> Self {
        sse2! {{ Self(_mm_and_ps(self.0, other.0)) }}
    }

    #[inline(always)]
    pub(crate) fn bits(self) -> u32 {
        sse2! {{ _mm_movemask_ps(self.0) as u32 }}
    }
}

impl Removed {
    #[inline(always)]
    pub(crate) fn nothing() -> Self {
        sse2! {{ Self(_mm_setzero_si128()) }}
    }

    #[inline(always)]
    pub(crate) fn sum(self) -> u32 {
        sse2! {{ _mm_cvtsi128_si32(_mm_add_epi32(self.0, _mm_unpackhi_epi64(self.0, self.0))) as u32 }}
    }
}
