//! Four voxels at a time, written so that compilers turn the loops into vector instructions.

/// Voxels handled together.
pub(super) const LANES: usize = 4;

/// Adding this to a single of magnitude below `2^22` leaves its value, rounded to nearest with ties to even, in the low bits of
/// the sum: rounding without a conversion instruction or a library call.
const ROUNDER: f32 = 12_582_912.0;

/// The lesser of two numbers that are not NaN, as one instruction.
#[inline(always)]
pub(super) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater of two numbers that are not NaN, as one instruction.
#[inline(always)]
pub(super) fn greater(a: f32, b: f32) -> f32 {
    if a < b { b } else { a }
}

/// Places of four voxels from `x` on, relative to a point at `-offset`.
#[inline(always)]
pub(super) fn places(x: i32, offset: f32) -> [f32; LANES] {
    std::array::from_fn(|lane| (x + lane as i32) as f32 + offset)
}

/// What is left over of voxels at these distances outside a solid, in voxels.
#[inline(always)]
pub(super) fn left_over(distances: [f32; LANES]) -> [u8; LANES] {
    distances.map(|distance| {
        let share = 127.5 + 127.5 * distance;
        (lesser(greater(share, 0.0), 255.0) + ROUNDER).to_bits() as u8
    })
}

/// The whole number nearest to a place along a row, kept within what a grid can have.
#[inline(always)]
pub(super) fn nearest_index(place: f32) -> i32 {
    let kept = lesser(greater(place, -8.0), 1000.0);
    (kept + ROUNDER).to_bits() as i32 - ROUNDER.to_bits() as i32
}

/// Voxels between two places along a row: from the first up to but not including the last.
#[inline(always)]
pub(super) fn span_within(low: f32, high: f32) -> [i32; 2] {
    // The first whole number above `low` is the one nearest to `low + 1/2`; callers draw their spans generously enough
    // for ties.
    [nearest_index(low + 0.5), nearest_index(high + 0.5)]
}
