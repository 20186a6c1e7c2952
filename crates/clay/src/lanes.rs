//! Four numbers at a time.
//!
//! Compilers find vectors in scalar code by luck, and the luck turns with every change. So the few operations that
//! cutting and feeling spend their time in are spelled out: for x86-64 with the vector instructions that every such
//! processor has, elsewhere with arrays. Both give the same bits, NaN included, and a test holds them to it.

#[cfg(any(test, not(target_arch = "x86_64")))]
mod arrays;
#[cfg(target_arch = "x86_64")]
mod sse2;
mod wide;

use crate::grid::BRICK_EDGE;

#[cfg(not(target_arch = "x86_64"))]
pub(crate) use arrays::{F32x4, I32x4, Removed, Tile};
#[cfg(target_arch = "x86_64")]
pub(crate) use sse2::{F32x4, I32x4, Removed, Tile};

pub(crate) use wide::{Work, widely};

/// Voxels, rows or points handled together.
pub(crate) const LANES: usize = 4;

/// Where a brick keeps the four voxels of a row of a tile, counted in fours.
#[inline(always)]
fn four_of(tile: u8, row: usize) -> usize {
    let fours = BRICK_EDGE / LANES;
    // Tiles count along x first, then bands of rows, then layers.
    usize::from(tile / fours as u8) * LANES * fours + usize::from(tile % fours as u8) + row * fours
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::{LANES, arrays, sse2};
    use crate::grid::{BRICK_EDGE, BRICK_VOXELS};
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
        fn both_ways_give_the_same_bits(a in lanes(), b in lanes(), c in any_float(), at in -600_i32..600, step in 0_i32..5) {
            macro_rules! for_both {
                (|$a:ident, $b:ident| $result:expr) => {
                    prop_assert_eq!(
                        {
                            let ($a, $b) = (arrays::F32x4::from_array(a), arrays::F32x4::from_array(b));
                            bits(($result).to_array())
                        },
                        {
                            let ($a, $b) = (sse2::F32x4::from_array(a), sse2::F32x4::from_array(b));
                            bits(($result).to_array())
                        }
                    );
                };
            }
            for_both!(|a, b| a + b);
            for_both!(|a, b| a - b);
            for_both!(|a, b| a * b);
            for_both!(|a, b| a / b);
            for_both!(|a, b| a.min(b));
            for_both!(|a, b| a.max(b));
            for_both!(|a, _b| a.sqrt());
            for_both!(|a, _b| a.abs());
            for_both!(|a, b| a.where_below(b, b, a));
            for lane in 0..LANES {
                for_both!(|a, _b| a.each_splatted()[lane]);
                prop_assert_eq!(bits(sse2::F32x4::from_array(a).each_splatted()[lane].to_array()), bits([a[lane]; LANES]));
            }
            prop_assert_eq!(
                arrays::F32x4::from_array(a).any_above_0(),
                sse2::F32x4::from_array(a).any_above_0()
            );
            let (mut by_arrays, mut by_vectors) = ([0.0; LANES], [0.0; LANES]);
            arrays::F32x4::load(&a).store(&mut by_arrays);
            sse2::F32x4::load(&a).store(&mut by_vectors);
            prop_assert_eq!(bits(by_arrays), bits(a));
            prop_assert_eq!(bits(by_vectors), bits(a));
            prop_assert_eq!(
                bits(arrays::F32x4::splat(c).to_array()),
                bits(sse2::F32x4::splat(c).to_array())
            );
            prop_assert_eq!(
                bits(arrays::F32x4::stepping(at, step).to_array()),
                bits(sse2::F32x4::stepping(at, step).to_array())
            );
            prop_assert_eq!(
                arrays::F32x4::from_array(a).is_below(arrays::F32x4::from_array(b)).bits(),
                sse2::F32x4::from_array(a).is_below(sse2::F32x4::from_array(b)).bits()
            );
            let lanes = |of: &dyn Fn(f32, f32) -> bool| {
                (0..LANES).map(|lane| u32::from(of(a[lane], b[lane])) << lane).sum::<u32>()
            };
            macro_rules! below_b_and_1 {
                ($room:ident) => {{
                    let here = $room::F32x4::from_array(a);
                    let one = $room::F32x4::splat(1.0);
                    (here.is_below($room::F32x4::from_array(b)), here.is_below(one))
                }};
            }
            let (first, second) = below_b_and_1!(sse2);
            prop_assert_eq!(first.and(second).bits(), lanes(&|a, b| a < b && a < 1.0));
            prop_assert_eq!(first.or(second).bits(), lanes(&|a, b| a < b || a < 1.0));
            let (first, second) = below_b_and_1!(arrays);
            prop_assert_eq!(first.and(second).bits(), lanes(&|a, b| a < b && a < 1.0));
            prop_assert_eq!(first.or(second).bits(), lanes(&|a, b| a < b || a < 1.0));
        }

        #[test]
        fn both_ways_spread_the_same_bytes(lanes in any::<[u64; LANES]>()) {
            let by_arrays = arrays::F32x4::of_bytes(lanes).map(arrays::F32x4::to_array);
            let by_vectors = sse2::F32x4::of_bytes(lanes).map(sse2::F32x4::to_array);
            prop_assert_eq!(by_arrays.map(bits), by_vectors.map(bits));
            for (lane, bytes) in lanes.into_iter().enumerate() {
                for (at, byte) in bytes.to_le_bytes().into_iter().enumerate() {
                    prop_assert_eq!(by_vectors[at][lane].to_bits(), f32::from(byte).to_bits());
                }
            }
        }

        #[test]
        fn both_ways_count_alike(
            places in prop::array::uniform4(0.0_f32..4e6),
            others in prop::array::uniform4(0.0_f32..3.0),
            factor in 0_i16..=1200,
        ) {
            let of_arrays = |lanes| arrays::F32x4::from_array(lanes).nearest_within([0.0, 4e6]);
            let of_vectors = |lanes| sse2::F32x4::from_array(lanes).nearest_within([0.0, 4e6]);
            let ((a, b), (c, d)) = ((of_arrays(places), of_arrays(others)), (of_vectors(places), of_vectors(others)));
            prop_assert_eq!((a + b).to_array(), (c + d).to_array());
            prop_assert_eq!(a.masked(4095).to_array(), c.masked(4095).to_array());
            prop_assert_eq!(a.shifted_right::<12>().to_array(), c.shifted_right::<12>().to_array());
            prop_assert_eq!(b.shifted_left::<8>().to_array(), d.shifted_left::<8>().to_array());
            prop_assert_eq!(bits(a.to_f32().to_array()), bits(c.to_f32().to_array()));
            prop_assert_eq!(
                b.equals(arrays::I32x4::splat(1)).bits(),
                d.equals(sse2::I32x4::splat(1)).bits()
            );
            let products = c.shifted_right::<12>().times(factor).to_array();
            prop_assert_eq!(a.shifted_right::<12>().times(factor).to_array(), products);
            for (product, place) in products.into_iter().zip(places) {
                prop_assert_eq!(product, (place.round_ties_even() as i32 >> 12) * i32::from(factor));
            }
        }

        #[test]
        fn both_ways_find_the_same_extremes(of in prop::array::uniform4(-1e8_f32..1e8)) {
            let (by_arrays, by_vectors) = (arrays::F32x4::from_array(of), sse2::F32x4::from_array(of));
            let least = of.into_iter().fold(f32::INFINITY, f32::min);
            let most = of.into_iter().fold(f32::NEG_INFINITY, f32::max);
            prop_assert_eq!(bits(by_vectors.least().to_array()), [least.to_bits(); LANES]);
            prop_assert_eq!(bits(by_vectors.most().to_array()), [most.to_bits(); LANES]);
            prop_assert_eq!(bits(by_arrays.least().to_array()), bits(by_vectors.least().to_array()));
            prop_assert_eq!(bits(by_arrays.most().to_array()), bits(by_vectors.most().to_array()));
        }

        #[test]
        fn both_ways_cut_the_same_tile(
            shares in prop::array::uniform4(prop::array::uniform4(prop_oneof![
                -300.0_f32..600.0,
                -2e9_f32..2e9,
                -0.5_f32..1.0,
                254.0_f32..256.0,
                (-3_i32..520).prop_map(|halves| halves as f32 * 0.5),
            ])),
            seed in any::<u64>(),
            tile in any::<u8>(),
        ) {
            let mut old = [0; BRICK_VOXELS];
            let mut state = seed;
            for cell in &mut old {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                *cell = (state >> 56) as u8;
            }
            let by_arrays = arrays::Tile::nearest(shares.map(arrays::F32x4::from_array));
            let by_vectors = sse2::Tile::nearest(shares.map(sse2::F32x4::from_array));
            prop_assert_eq!(by_arrays.is_solid(), by_vectors.is_solid());
            prop_assert_eq!(by_vectors.is_solid(), shares.as_flattened().iter().all(|share| 254.5 <= *share));
            let (mut after, mut after_too) = (old, old);
            let (mut removed, mut removed_too) = (sse2::Removed::nothing(), arrays::Removed::nothing());
            for _ in 0..2 {
                by_vectors.cut(&mut after, tile, &mut removed);
                by_arrays.cut(&mut after_too, tile, &mut removed_too);
            }
            prop_assert_eq!(after, after_too);
            let sum = |cells: &[u8]| cells.iter().map(|&cell| u32::from(cell)).sum::<u32>();
            prop_assert_eq!([removed.sum(), removed_too.sum()], [sum(&old) - sum(&after); 2]);
            let [tile_x, band, layer] = [tile % 4, tile / 4 % 4, tile / 16].map(usize::from);
            for (at, (old, new)) in old.into_iter().zip(after).enumerate() {
                let [x, y, z] = [at % BRICK_EDGE, at / BRICK_EDGE % BRICK_EDGE, at / BRICK_EDGE / BRICK_EDGE];
                let left = if [x / LANES, y / LANES, z] == [tile_x, band, layer] {
                    shares[y % LANES][x % LANES].clamp(0.0, 255.0).round_ties_even() as u8
                } else {
                    u8::MAX
                };
                prop_assert_eq!(new, old.min(left));
            }
        }

        #[test]
        fn both_ways_find_the_same_integers(a in lanes(), least in -1000_i32..100, extent in 0_i32..1000) {
            let bounds = [least as f32, (least + extent) as f32];
            let by_arrays = arrays::F32x4::from_array(a).nearest_within(bounds);
            let by_vectors = sse2::F32x4::from_array(a).nearest_within(bounds);
            prop_assert_eq!(by_arrays.to_array(), by_vectors.to_array());
            for (nearest, a) in by_vectors.to_array().into_iter().zip(a) {
                let want = if a.is_nan() { bounds[0] } else { a.max(bounds[0]).min(bounds[1]) };
                prop_assert_eq!(nearest, want.round_ties_even() as i32);
            }
        }
    }
}
