//! The operations in SSE2. See the twin on arrays for what they mean.
// Vector instructions are unsafe to name outside functions marked for them, and operators cannot be marked.
#![allow(unsafe_code)]

use std::arch::x86_64::{
    __m128, __m128i, _mm_add_epi32, _mm_add_ps, _mm_and_ps, _mm_and_si128, _mm_andnot_ps,
    _mm_andnot_si128, _mm_castps_si128, _mm_cmpgt_epi32, _mm_cmplt_ps, _mm_cvtepi32_ps,
    _mm_cvtps_epi32, _mm_cvtsi32_si128, _mm_cvtsi128_si32, _mm_cvtsi128_si64, _mm_div_ps,
    _mm_loadu_ps, _mm_max_ps, _mm_min_epu8, _mm_min_ps, _mm_movemask_epi8, _mm_movemask_ps,
    _mm_mul_ps, _mm_or_ps, _mm_or_si128, _mm_packs_epi32, _mm_packus_epi16, _mm_sad_epu8,
    _mm_set_epi32, _mm_set_ps, _mm_set1_epi32, _mm_set1_ps, _mm_setzero_ps, _mm_setzero_si128,
    _mm_slli_epi32, _mm_sqrt_ps, _mm_srai_epi32, _mm_storeu_ps, _mm_sub_epi32, _mm_sub_ps,
    _mm_unpackhi_epi64,
};
use std::ops::{Add, Div, Mul, Sub};

use super::{Bytes, LANES};

/// Allows vector instructions.
macro_rules! sse2 {
    ({ $($body:tt)* }) => {
        // SAFETY: these instructions need a processor with SSE2, which is part of x86-64. The two that touch memory do so
        // through references to four singles, which is what they read and write.
        unsafe { $($body)* }
    };
}

/// Four singles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Floats(__m128);

/// Four integers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ints(__m128i);

impl Floats {
    #[inline(always)]
    pub(crate) fn from_array([a, b, c, d]: [f32; LANES]) -> Self {
        sse2! {{
            Self(_mm_set_ps(d, c, b, a))
        }}
    }

    #[inline(always)]
    pub(crate) fn to_array(self) -> [f32; LANES] {
        sse2! {{
            Ints(_mm_castps_si128(self.0))
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
    pub(crate) fn lesser(self, other: Self) -> Self {
        sse2! {{
            Self(_mm_min_ps(self.0, other.0))
        }}
    }

    #[inline(always)]
    pub(crate) fn greater(self, other: Self) -> Self {
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
    pub(crate) fn nearest_within(self, [least, most]: [f32; 2]) -> Ints {
        let kept = self.greater(Self::splat(least)).lesser(Self::splat(most));
        sse2! {{ Ints(_mm_cvtps_epi32(kept.0)) }}
    }

    #[inline(always)]
    pub(crate) fn to_bytes(self) -> Bytes {
        // Packing keeps numbers between 0 and 255 by itself, if they are integers before.
        let kept = self
            .lesser(Self::splat(1000.0))
            .greater(Self::splat(-1000.0));
        sse2! {{
            let rounded = _mm_cvtps_epi32(kept.0);
            let words = _mm_packs_epi32(rounded, rounded);
            _mm_cvtsi128_si32(_mm_packus_epi16(words, words)) as u32
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
fn select(mask: __m128, chosen: Floats, otherwise: Floats) -> Floats {
    sse2! {{
        Floats(_mm_or_ps(
            _mm_and_ps(mask, chosen.0),
            _mm_andnot_ps(mask, otherwise.0),
        ))
    }}
}

impl From<i32> for Floats {
    #[inline(always)]
    fn from(first: i32) -> Self {
        sse2! {{
            let lanes = _mm_add_epi32(_mm_set1_epi32(first), _mm_set_epi32(3, 2, 1, 0));
            Self(_mm_cvtepi32_ps(lanes))
        }}
    }
}

impl Add for Floats {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        sse2! {{
            Self(_mm_add_ps(self.0, other.0))
        }}
    }
}

impl Sub for Floats {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        sse2! {{
            Self(_mm_sub_ps(self.0, other.0))
        }}
    }
}

impl Mul for Floats {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        sse2! {{
            Self(_mm_mul_ps(self.0, other.0))
        }}
    }
}

impl Div for Floats {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        sse2! {{ Self(_mm_div_ps(self.0, other.0)) }}
    }
}

impl Ints {
    #[cfg(test)]
    pub(crate) fn from_array([a, b, c, d]: [i32; LANES]) -> Self {
        sse2! {{
            Self(_mm_set_epi32(d, c, b, a))
        }}
    }

    #[inline(always)]
    pub(crate) fn to_array(self) -> [i32; LANES] {
        sse2! {{
            let low = _mm_cvtsi128_si64(self.0);
            let high = _mm_cvtsi128_si64(_mm_unpackhi_epi64(self.0, self.0));
            [
                low as i32,
                (low >> 32) as i32,
                high as i32,
                (high >> 32) as i32,
            ]
        }}
    }

    #[inline(always)]
    pub(crate) fn stepping(first: i32, step: i32) -> Self {
        sse2! {{ Self(_mm_add_epi32(_mm_set1_epi32(first), _mm_set_epi32(3 * step, 2 * step, step, 0))) }}
    }

    #[inline(always)]
    pub(crate) fn in_upper_half(self) -> Self {
        sse2! {{ Self(_mm_slli_epi32::<16>(self.0)) }}
    }

    #[inline(always)]
    pub(crate) fn any_above_0(self) -> bool {
        sse2! {{ _mm_movemask_epi8(_mm_cmpgt_epi32(self.0, _mm_setzero_si128())) != 0 }}
    }

    #[inline(always)]
    pub(crate) fn quartered(self) -> Self {
        sse2! {{
            Self(_mm_srai_epi32::<2>(self.0))
        }}
    }

    #[inline(always)]
    pub(crate) fn greater(self, other: Self) -> Self {
        sse2! {{
            let mask = _mm_cmpgt_epi32(self.0, other.0);
            Self(_mm_or_si128(
                _mm_and_si128(mask, self.0),
                _mm_andnot_si128(mask, other.0),
            ))
        }}
    }

    #[inline(always)]
    pub(crate) fn not_below_0(self) -> Self {
        sse2! {{
            Self(_mm_andnot_si128(_mm_srai_epi32::<31>(self.0), self.0))
        }}
    }
}

impl Add for Ints {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        sse2! {{
            Self(_mm_add_epi32(self.0, other.0))
        }}
    }
}

impl Sub for Ints {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        sse2! {{
            Self(_mm_sub_epi32(self.0, other.0))
        }}
    }
}

#[inline(always)]
pub(crate) fn lesser_bytes(left: Bytes, old: Bytes) -> (Bytes, u32) {
    sse2! {{
        let (left, old) = (
            _mm_cvtsi32_si128(left as i32),
            _mm_cvtsi32_si128(old as i32),
        );
        let new = _mm_min_epu8(left, old);
        let removed = _mm_cvtsi128_si32(_mm_sad_epu8(old, new)) as u32;
        (_mm_cvtsi128_si32(new) as u32, removed)
    }}
}
