//! Reads the clay in front of a tool.

use super::LOOK_AHEAD_VOXELS;
use super::points::{FacePairs, Faces};
use super::rod::RodReach;
use crate::field::{Field, Reader, SOLID};
use crate::grid::{BRICK_EDGE, MAX_AXIS_VOXELS};
use crate::lanes::{F32x4, I32x4, LANES};
use crate::pose::Pose;

/// A flat face that slants more than this against the motion is felt nearer than [`LOOK_AHEAD_VOXELS`], so as not to
/// reach far beyond its edge. Little of it counts.
const LEAST_COSINE: f32 = 0.25;

/// Interpolated occupancy from which on clay counts as standing ahead in full, and below which it does not count, as
/// shares of solid. In between lies the edge of clay, at half; but nearly all of it is above, as half is also what the
/// wall of a cut holds beside the tool.
const FULL_FROM: f64 = 0.65;
const NONE_BELOW: f64 = 0.45;

/// Beyond every grid, in voxels.
const FAR: f32 = 2.0 * MAX_AXIS_VOXELS as f32;

/// Binary places of a sample's position between voxels.
const PLACES: u32 = 12;
const SCALE: f32 = (1 << PLACES) as f32;
const LOOK_AHEAD: f32 = LOOK_AHEAD_VOXELS as f32 * SCALE;
const LOWEST: f32 = (NONE_BELOW * SOLID as f64) as f32;
const RANGE: f32 = ((FULL_FROM - NONE_BELOW) * SOLID as f64) as f32;

/// The last place in a brick along an axis, and the binary places of those.
const LAST: i32 = BRICK_EDGE as i32 - 1;
const EDGE_PLACES: i32 = BRICK_EDGE.trailing_zeros() as i32;

/// Reads occupancy in front of the faces of a tool.
#[derive(Clone, Copy)]
pub(super) struct Sampler<'a> {
    field: &'a Field,
    reader: Reader<'a>,
    /// Middle of the tool, in voxels, voxel centres at whole numbers.
    middle: [f32; 3],
    per_metre: f32,
    /// Radius of curvature of the tool's faces, in voxels; `None` for flat ones.
    radius: Option<f32>,
    /// The rod that the tool removes, if it is one.
    rod: Option<RodReach>,
    /// Voxels that storage has along each axis.
    voxels: [f32; 3],
}

impl<'a> Sampler<'a> {
    pub(super) fn new(field: &'a Field, faces: &Faces, pose: Pose) -> Self {
        let per_metre = 1.0 / field.grid().voxel_size_m();
        let position_m = pose.position_m();
        Self {
            field,
            reader: field.reader(),
            middle: std::array::from_fn(|axis| {
                ((position_m[axis] + faces.middle_from_pose_m[axis]) * per_metre - 0.5) as f32
            }),
            per_metre: per_metre as f32,
            radius: faces.radius_m.map(|radius_m| (radius_m * per_metre) as f32),
            rod: faces
                .rod
                .map(|rod| rod.on_grid(per_metre * f64::from(SCALE), LOOK_AHEAD)),
            voxels: field
                .grid()
                .bricks()
                .map(|count| f32::from(count) * BRICK_EDGE as f32),
        }
    }

    /// Whether no clay is anywhere near the tool.
    pub(super) fn is_in_air(&self, faces: &Faces) -> bool {
        let extents_m = faces.extents_m;
        // Beyond the tool by the farthest that anything is felt, and one more for interpolation.
        let reach = match self.radius {
            Some(radius) => {
                (LOOK_AHEAD_VOXELS as f32 * (2.0 * radius + LOOK_AHEAD_VOXELS as f32)).sqrt()
            }
            // Never beyond the rod, grown by what it feels ahead.
            None if self.rod.is_some() => LOOK_AHEAD_VOXELS as f32,
            None => LOOK_AHEAD_VOXELS as f32 / LEAST_COSINE,
        };
        let corner = |side: f32| {
            std::array::from_fn(|axis| {
                let half = 0.5 * extents_m[axis] as f32 * self.per_metre + reach + 1.0;
                (self.middle[axis] + side * half).clamp(-FAR, FAR) as i32 + side as i32
            })
        };
        self.field.is_air(corner(-1.0), corner(1.0))
    }

    /// Engaged area in the direction `ahead`, m².
    #[inline(always)]
    pub(super) fn area_m2(&self, faces: &Faces, ahead: [f64; 3]) -> f64 {
        let [area_m2] = self.areas_m2(faces, ahead, |_, _, cosine| [cosine]);
        area_m2
    }

    /// Engaged areas in directions close to `ahead`, the direction in which clay is felt, m².
    #[inline(always)]
    pub(super) fn areas_close_m2<const N: usize>(
        &self,
        faces: &Faces,
        ahead: [f64; 3],
        directions: [[f64; 3]; N],
    ) -> [f64; N] {
        let directions = directions.map(|direction| direction.map(|d| d as f32));
        let none = F32x4::splat(0.0);
        self.areas_m2(faces, ahead, |pairs, side, _| {
            directions.map(|direction| (side * pairs.along(direction)).max(none))
        })
    }

    /// Sums over the leading points what clay stands ahead of each, times its area, times each of some numbers of it.
    #[inline(always)]
    fn areas_m2<const N: usize>(
        &self,
        faces: &Faces,
        ahead: [f64; 3],
        numbers: impl Fn(&FacePairs, F32x4, F32x4) -> [F32x4; N],
    ) -> [f64; N] {
        let ahead = ahead.map(|d| d as f32);
        let none = F32x4::splat(0.0);
        let (mut areas_m2, mut whole_m2) = ([none; N], none);
        for pairs in &faces.pairs {
            let (cosine, area_m2) = (pairs.along(ahead), F32x4::load(&pairs.area_m2));
            let (side, cosine) = if faces.are_mirrored {
                let side = cosine.where_below(none, F32x4::splat(-1.0), F32x4::splat(1.0));
                (side, cosine.abs())
            } else {
                (F32x4::splat(1.0), cosine.max(none))
            };
            let seen_m2 = cosine * area_m2;
            // A face that neither leads nor trails counts for nothing.
            if !seen_m2.any_above_0() {
                continue;
            }
            whole_m2 = whole_m2 + seen_m2;
            let places = self.places(pairs, side, cosine, ahead);
            let engaged_m2 = engaged(places, self.corners(places)) * area_m2;
            for (area_m2, number) in areas_m2.iter_mut().zip(numbers(pairs, side, cosine)) {
                *area_m2 = *area_m2 + engaged_m2 * number;
            }
        }
        let sum = |lanes: F32x4| lanes.to_array().into_iter().map(f64::from).sum::<f64>();
        // What the points of a round tool make of its outline is a little off, by as much whether clay is there or not.
        let seen_m2 = match (faces.radius_m, &faces.rod) {
            (Some(radius_m), _) => Some(std::f64::consts::PI * radius_m * radius_m),
            (None, Some(rod)) => rod.seen_m2(ahead),
            (None, None) => None,
        };
        let correction = seen_m2.map_or(1.0, |seen_m2| seen_m2 / sum(whole_m2));
        areas_m2.map(|lanes| sum(lanes) * (correction / f64::from(RANGE)))
    }

    /// Where clay is looked for ahead of points, or of their opposites where `side` is -1.
    #[inline(always)]
    fn places(&self, pairs: &FacePairs, side: F32x4, cosine: F32x4, ahead: [f32; 3]) -> [I32x4; 3] {
        let to_place = side * F32x4::splat(self.per_metre * SCALE);
        let offset = |axis: usize| to_place * F32x4::load(&pairs.offset_m[axis]);
        let reach = match (self.radius, &self.rod) {
            // Where the ray leaves the ball of radius r + a: s^2 + 2 r c s = 2 r a + a^2.
            (Some(radius), _) => {
                let radius = radius * SCALE;
                let across = F32x4::splat(radius) * cosine;
                let rest = F32x4::splat(LOOK_AHEAD * (2.0 * radius + LOOK_AHEAD));
                (across * across + rest).sqrt() - across
            }
            (None, Some(rod)) => rod.reach([offset(0), offset(1), offset(2)], pairs, side, ahead),
            (None, None) => F32x4::splat(LOOK_AHEAD) / cosine.max(F32x4::splat(LEAST_COSINE)),
        };
        let place = |axis: usize| {
            // Counted from the border of air about the grid, and kept in it.
            let middle = (self.middle[axis] + BRICK_EDGE as f32) * SCALE;
            let most = (self.voxels[axis] + (2 * BRICK_EDGE - 2) as f32) * SCALE;
            (F32x4::splat(middle) + offset(axis) + reach * F32x4::splat(ahead[axis]))
                .nearest_within([0.0, most])
        };
        [place(0), place(1), place(2)]
    }

    /// The occupancies of the eight voxels about each place.
    #[inline(always)]
    fn corners(&self, places: [I32x4; 3]) -> [u64; LANES] {
        let whole = |axis: usize| places[axis].shifted_right::<{ PLACES as i32 }>();
        let voxels = [whole(0), whole(1), whole(2)];
        let in_brick = |axis: usize| voxels[axis].masked(LAST);
        let (x, y, z) = (in_brick(0), in_brick(1), in_brick(2));
        let astride = |at: I32x4| at.equals(I32x4::splat(LAST));
        let astride = astride(x).or(astride(y)).or(astride(z)).bits();

        let [_, stride_y, stride_z] = self.reader.strides;
        let brick = |axis: usize| voxels[axis].shifted_right::<EDGE_PLACES>();
        let bricks = brick(0) + (brick(1).times(stride_y as i16) + brick(2).times(stride_z as i16));
        let first = x + (y.shifted_left::<EDGE_PLACES>() + z.shifted_left::<{ 2 * EDGE_PLACES }>());
        let (bricks, first) = (bricks.to_array(), first.to_array());
        let mut corners = [0; LANES];
        for lane in 0..LANES {
            corners[lane] = if astride >> lane & 1 == 0 {
                self.reader.eight(bricks[lane] as u32, first[lane] as u32)
            } else {
                self.eight_astride(voxels.map(|at| at.to_array()[lane] as u32))
            };
        }
        corners
    }

    /// The eight voxels about a place that are not all in one brick.
    #[inline(never)]
    fn eight_astride(&self, [x, y, z]: [u32; 3]) -> u64 {
        const LAST: u32 = BRICK_EDGE as u32 - 1;
        let [_, stride_y, stride_z] = self.reader.strides.map(|stride| stride as u32);
        let mut eight = 0;
        for corner in 0..8 {
            let (x, y, z) = (x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2));
            let brick =
                (x >> EDGE_PLACES) + (y >> EDGE_PLACES) * stride_y + (z >> EDGE_PLACES) * stride_z;
            let voxel =
                (x & LAST) + ((y & LAST) << EDGE_PLACES) + ((z & LAST) << (2 * EDGE_PLACES));
            eight |= u64::from(self.reader.one(brick, voxel)) << (8 * corner);
        }
        eight
    }
}

/// Occupancy interpolated between the eight voxel centres about places, above what does not count and up to [`RANGE`].
#[inline(always)]
fn engaged(places: [I32x4; 3], corners: [u64; LANES]) -> F32x4 {
    let share = |axis: usize| {
        let share = places[axis].masked((1 << PLACES) - 1).to_f32();
        share * F32x4::splat(1.0 / SCALE)
    };
    let (x, y, z) = (share(0), share(1), share(2));
    let between = |a: F32x4, b: F32x4, share: F32x4| a + (b - a) * share;
    let [a, b, c, d, e, f, g, h] = F32x4::of_bytes(corners);
    let lower = between(between(a, b, x), between(c, d, x), y);
    let upper = between(between(e, f, x), between(g, h, x), y);
    (between(lower, upper, z) - F32x4::splat(LOWEST))
        .max(F32x4::splat(0.0))
        .min(F32x4::splat(RANGE))
}
