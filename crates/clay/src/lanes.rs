//! Four numbers at a time.
//!
//! Compilers find vectors in scalar code by luck, and the luck turns with every change. So the few operations that cutting and feeling
//! spend their time in are spelled out: for x86-64 with the vector instructions that every such processor has, elsewhere with
//! arrays. Both give the same bits, NaN included, and a test holds them to it.

#[cfg(any(test, not(target_arch = "x86_64")))]
mod arrays;
#[cfg(target_arch = "x86_64")]
mod sse2;

#[cfg(not(target_arch = "x86_64"))]
pub(crate) use arrays::{Floats, Ints, lesser_bytes};
#[cfg(target_arch = "x86_64")]
pub(crate) use sse2::{Floats, Ints, lesser_bytes};

/// Voxels, rows or points handled together.
pub(crate) const LANES: usize = 4;

/// Four occupancies as a little-endian word, the first lane lowest.
pub(crate) type Bytes = u32;

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::{arrays, sse2};
    use proptest::prelude::*;

    fn any_float() -> impl Strategy<Value = f32> {
        prop_oneof![
            -2000.0_f32..2000.0,
            -1.0_f32..1.0,
            Just(f32::NAN),
            Just(0.0),
            Just(-0.0),
            Just(f32::INFINITY),
            Just(f32::NEG_INFINITY),
            (-300_i32..300).prop_map(|halves| halves as f32 * 0.5),
        ]
    }

    fn lanes() -> impl Strategy<Value = [f32; 4]> {
        [any_float(), any_float(), any_float(), any_float()]
    }

    /// Bits, but for NaN, of which there are many and none is ever told from another.
    fn bits(lanes: [f32; 4]) -> [u32; 4] {
        lanes.map(|lane| {
            if lane.is_nan() {
                u32::MAX
            } else {
                lane.to_bits()
            }
        })
    }

    proptest! {
            #[test]
            fn both_ways_give_the_same_bits(a in lanes(), b in lanes(), c in any_float(), at in -600_i32..600) {
                macro_rules! for_both {
                    (|$a:ident, $b:ident| $result:expr) => {
                        prop_assert_eq!(
                            { let ($a, $b) = (arrays::Floats::from_array(a), arrays::Floats::from_array(b)); bits(($result).to_array()) },
                            { let ($a, $b) = (sse2::Floats::from_array(a), sse2::Floats::from_array(b)); bits(($result).to_array()) }
                        );
                    };
                }
                for_both!(|a, b| a + b);
                for_both!(|a, b| a - b);
                for_both!(|a, b| a * b);
                for_both!(|a, b| a.lesser(b));
                for_both!(|a, b| a.greater(b));
                for_both!(|a, _b| a.sqrt());
                for_both!(|a, _b| a.abs());
                for_both!(|a, b| a / b);
            prop_assert_eq!(arrays::Floats::from_array(a).any_above_0(), sse2::Floats::from_array(a).any_above_0());
                for_both!(|a, b| a.where_below(b, b, a));
                let (mut by_arrays, mut by_vectors) = ([0.0; 4], [0.0; 4]);
                arrays::Floats::load(&a).store(&mut by_arrays);
                sse2::Floats::load(&a).store(&mut by_vectors);
                prop_assert_eq!(bits(by_arrays), bits(a));
                prop_assert_eq!(bits(by_vectors), bits(a));
                prop_assert_eq!(arrays::Floats::splat(c).to_array().map(f32::to_bits), sse2::Floats::splat(c).to_array().map(f32::to_bits));
                prop_assert_eq!(bits(arrays::Floats::from(at).to_array()), bits(sse2::Floats::from(at).to_array()));
            }

            #[test]
            fn both_ways_cut_the_same_bytes(shares in [-300.0_f32..600.0, -1e30_f32..1e30, 0.0_f32..255.0, -0.5_f32..1.0], old in any::<u32>()) {
                let by_arrays = arrays::Floats::from_array(shares).to_bytes();
                let by_vectors = sse2::Floats::from_array(shares).to_bytes();
                prop_assert_eq!(by_arrays, by_vectors);
                let (new, removed) = sse2::lesser_bytes(by_vectors, old);
                prop_assert_eq!(arrays::lesser_bytes(by_arrays, old), (new, removed));
                let sum = |word: u32| word.to_le_bytes().into_iter().map(u32::from).sum::<u32>();
                prop_assert_eq!(removed, sum(old) - sum(new));
                for (lane, share) in shares.into_iter().enumerate() {
                    let left = by_vectors.to_le_bytes()[lane];
                    prop_assert_eq!(left, share.clamp(0.0, 255.0).round_ties_even() as u8);
                    prop_assert_eq!(new.to_le_bytes()[lane], old.to_le_bytes()[lane].min(left));
                }
            }

            #[test]
            fn both_ways_find_the_same_integers(a in lanes(), b in any::<[i32; 4]>(), least in -5_i32..100, extent in 0_i32..100) {
                let bounds = [least as f32, (least + extent) as f32];
                let by_arrays = arrays::Floats::from_array(a).nearest_within(bounds);
                let by_vectors = sse2::Floats::from_array(a).nearest_within(bounds);
                prop_assert_eq!(by_arrays.to_array(), by_vectors.to_array());
                for (lane, nearest) in by_vectors.to_array().into_iter().enumerate() {
                    let want = if a[lane].is_nan() { bounds[0] } else { a[lane].max(bounds[0]).min(bounds[1]) };
                    prop_assert_eq!(nearest, want.round_ties_even() as i32);
                }
                let (x, y) = (arrays::Ints::from_array(b), sse2::Ints::from_array(b));
                prop_assert_eq!(x.quartered().to_array(), y.quartered().to_array());
                prop_assert_eq!(y.quartered().to_array(), b.map(|b| b.div_euclid(4)));
                prop_assert_eq!(x.greater(by_arrays).to_array(), y.greater(by_vectors).to_array());
                prop_assert_eq!((x.quartered() - by_arrays).not_below_0().to_array(), (y.quartered() - by_vectors).not_below_0().to_array());
    prop_assert_eq!(x.in_upper_half().to_array(), y.in_upper_half().to_array());
                prop_assert_eq!(x.any_above_0(), y.any_above_0());
                prop_assert_eq!(y.any_above_0(), b.iter().any(|&b| 0 < b));
                prop_assert_eq!(
                    (arrays::Ints::stepping(least, extent) + x.quartered()).to_array(),
                    (sse2::Ints::stepping(least, extent) + y.quartered()).to_array()
                );
            }
        }
}
