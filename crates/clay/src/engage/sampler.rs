//! Reads the clay in front of a tool.

use super::LOOK_AHEAD_VOXELS;
use super::points::{FacePairs, Tool};
use crate::field::{Brick, Field, SOLID};
use crate::grid::BRICK_EDGE;
use crate::lanes::{Floats, LANES};
use crate::pose::Pose;

/// A flat face that slants more than this against the motion is felt nearer than [`LOOK_AHEAD_VOXELS`], so as not to reach far beyond its
/// edge. Little of it counts.
const LEAST_COSINE: f32 = 0.25;

/// Interpolated occupancy from which on clay counts as standing ahead in full, and below which it does not count, as shares of
/// solid. In between lies the edge of clay, at half; but nearly all of it is above, as half is also what the wall of a cut holds beside the
/// tool.
const FULL_FROM: f64 = 0.65;
const NONE_BELOW: f64 = 0.45;

/// Binary places of a sample's position between voxels.
const PLACES: u32 = 12;
/// Occupancies interpolated three times with eight binary places each.
const INTERPOLATED_SOLID: f64 = SOLID as f64 * 16_777_216.0;
const LOWEST: u32 = (NONE_BELOW * INTERPOLATED_SOLID) as u32;
const RANGE: u32 = ((FULL_FROM - NONE_BELOW) * INTERPOLATED_SOLID) as u32;

/// Reads occupancy in front of the faces of a tool. Interpolation is in integers.
pub(super) struct Sampler<'a> {
    field: &'a Field,
    /// Middle of the tool, in voxels, voxel centres at whole numbers.
    middle: [f32; 3],
    per_metre: f32,
    /// Radius of curvature of the tool's faces, in voxels; `None` for flat ones.
    radius: Option<f32>,
    /// Where the brick beyond, and the voxel beyond, is stored along each axis.
    brick_strides: [usize; 3],
    /// Voxels that storage has along each axis.
    voxels: [i32; 3],
}

const VOXEL_STRIDES: [usize; 3] = [1, BRICK_EDGE, BRICK_EDGE * BRICK_EDGE];

impl<'a> Sampler<'a> {
    pub(super) fn new(field: &'a Field, tool: &Tool, pose: Pose) -> Self {
        let per_metre = 1.0 / field.grid().voxel_size_m();
        let position_m = pose.position_m();
        let bricks = field.grid().bricks();
        let [bricks_x, bricks_y, _] = bricks.map(usize::from);
        Self {
            field,
            middle: std::array::from_fn(|axis| {
                ((position_m[axis] + tool.middle_from_pose_m[axis]) * per_metre - 0.5) as f32
            }),
            per_metre: per_metre as f32,
            radius: tool.radius_m.map(|radius_m| (radius_m * per_metre) as f32),
            brick_strides: [1, bricks_x, bricks_x * bricks_y],
            voxels: bricks.map(|count| i32::from(count) * BRICK_EDGE as i32),
        }
    }

    /// Whether no clay is anywhere near the tool.
    pub(super) fn is_in_air(&self, tool: &Tool) -> bool {
        let extents_m = tool.shape().extents_m();
        // Beyond the tool by the farthest that anything is felt, and one more for interpolation.
        let reach = match self.radius {
            Some(radius) => {
                (LOOK_AHEAD_VOXELS as f32 * (2.0 * radius + LOOK_AHEAD_VOXELS as f32)).sqrt()
            }
            None => LOOK_AHEAD_VOXELS as f32 / LEAST_COSINE,
        };
        let corner = |side: f32| {
            std::array::from_fn(|axis| {
                let half = 0.5 * extents_m[axis] as f32 * self.per_metre + reach + 1.0;
                (self.middle[axis] + side * half).clamp(-1000.0, 1000.0) as i32 + side as i32
            })
        };
        self.field.is_air(corner(-1.0), corner(1.0))
    }

    /// Engaged areas in directions close to `ahead`, the direction in which clay is felt, m².
    #[inline(always)]
    pub(super) fn areas_m2<const N: usize>(
        &self,
        tool: &Tool,
        ahead: [f64; 3],
        directions: [[f64; 3]; N],
    ) -> [f64; N] {
        let ahead = ahead.map(|d| d as f32);
        let directions = directions.map(|direction| direction.map(|d| d as f32));
        let none = Floats::splat(0.0);
        let (mut areas_m2, mut whole_m2) = ([none; N], none);
        for pairs in &tool.pairs {
            let cosine = pairs.along(ahead);
            // A face that neither leads nor trails counts for nothing.
            if !(cosine.abs() * Floats::load(&pairs.area_m2)).any_above_0() {
                continue;
            }
            let side = cosine.where_below(none, Floats::splat(-1.0), Floats::splat(1.0));
            let area_m2 = Floats::load(&pairs.area_m2);
            whole_m2 = whole_m2 + cosine.abs() * area_m2;
            let engaged = self.engaged(pairs, side, cosine.abs(), ahead) * area_m2;
            for (area_m2, direction) in areas_m2.iter_mut().zip(directions) {
                *area_m2 = *area_m2 + engaged * (side * pairs.along(direction)).greater(none);
            }
        }
        let sum = |lanes: Floats| lanes.to_array().into_iter().map(f64::from).sum::<f64>();
        // What a ball's points make of its disc is a little off, by as much whether clay is there or not.
        let correction = tool.radius_m.map_or(1.0, |radius_m| {
            std::f64::consts::PI * radius_m * radius_m / sum(whole_m2)
        });
        areas_m2.map(|lanes| sum(lanes) * correction)
    }

    /// How much clay stands ahead, 0 to 1, of points, or of their opposites where `side` is -1.
    #[inline(always)]
    fn engaged(&self, pairs: &FacePairs, side: Floats, cosine: Floats, ahead: [f32; 3]) -> Floats {
        let look_ahead = LOOK_AHEAD_VOXELS as f32;
        let reach = match self.radius {
            // Where the ray leaves the ball of radius r + a: s^2 + 2 r c s = 2 r a + a^2.
            Some(radius) => {
                let across = Floats::splat(radius) * cosine;
                let rest = Floats::splat(look_ahead * (2.0 * radius + look_ahead));
                (across * across + rest).sqrt() - across
            }
            None => Floats::splat(look_ahead) / cosine.greater(Floats::splat(LEAST_COSINE)),
        };
        let scale = (1 << PLACES) as f32;
        let mut places = [[0; LANES]; 3];
        for axis in 0..3 {
            let offset = side * Floats::load(&pairs.offset_m[axis]) * Floats::splat(self.per_metre);
            let place =
                Floats::splat(self.middle[axis]) + offset + reach * Floats::splat(ahead[axis]);
            // Grids end far below 1000: a place kept there is in air as it was before.
            places[axis] = (place * Floats::splat(scale))
                .nearest_within([-1000.0 * scale, 1000.0 * scale])
                .to_array();
        }
        let [x, y, z] = places;
        let mut engaged = [0.0; LANES];
        for lane in 0..LANES {
            let occupancy = self.interpolated([x[lane], y[lane], z[lane]]);
            engaged[lane] = (occupancy.max(LOWEST) - LOWEST).min(RANGE) as f32;
        }
        Floats::from_array(engaged) * Floats::splat(1.0 / RANGE as f32)
    }

    /// Occupancy interpolated between the eight voxel centres about a place.
    #[inline(always)]
    fn interpolated(&self, at: [i32; 3]) -> u32 {
        let [x, y, z] = [at[0] >> PLACES, at[1] >> PLACES, at[2] >> PLACES];
        let share = [
            eight_places(at[0]),
            eight_places(at[1]),
            eight_places(at[2]),
        ];
        let last = BRICK_EDGE as i32 - 1;
        let outside = (self.voxels[0] as u32 <= x as u32)
            | (self.voxels[1] as u32 <= y as u32)
            | (self.voxels[2] as u32 <= z as u32);
        let astride = (x & last == last) | (y & last == last) | (z & last == last);
        if outside | astride {
            return self.interpolated_across_bricks([x, y, z], share);
        }
        let [x, y, z] = [x as usize, y as usize, z as usize];
        let [_, stride_y, stride_z] = self.brick_strides;
        let brick = x / BRICK_EDGE + y / BRICK_EDGE * stride_y + z / BRICK_EDGE * stride_z;
        match self.field.brick(brick) {
            Brick::Empty => 0,
            Brick::Full => u32::from(SOLID) << 24,
            Brick::Slot(slot) => {
                const ROW: usize = VOXEL_STRIDES[1];
                const LAYER: usize = VOXEL_STRIDES[2];
                let (x, y, z) = (x % BRICK_EDGE, y % BRICK_EDGE, z % BRICK_EDGE);
                let first = z * LAYER + y * ROW + x;
                let corner = &self.field.slot(slot)[first..first + LAYER + ROW + 2];
                trilinear(
                    [
                        corner[0],
                        corner[1],
                        corner[ROW],
                        corner[ROW + 1],
                        corner[LAYER],
                        corner[LAYER + 1],
                        corner[LAYER + ROW],
                        corner[LAYER + ROW + 1],
                    ],
                    share,
                )
            }
        }
    }

    /// The same where the eight are not in one brick.
    fn interpolated_across_bricks(&self, base: [i32; 3], share: [u32; 3]) -> u32 {
        // Along each axis, for the two voxels about the place: which brick and which voxel in it; nothing outside.
        let mut bricks = [[0; 2]; 3];
        let mut voxels = [[0; 2]; 3];
        let mut inside = [[true; 2]; 3];
        for axis in 0..3 {
            for side in 0..2 {
                let at = base[axis] + side as i32;
                inside[axis][side] = 0 <= at && at < self.voxels[axis];
                let at = if inside[axis][side] { at as usize } else { 0 };
                bricks[axis][side] = at / BRICK_EDGE * self.brick_strides[axis];
                voxels[axis][side] = at % BRICK_EDGE * VOXEL_STRIDES[axis];
            }
        }
        let mut corners = [0; 8];
        for (corner, occupancy) in corners.iter_mut().enumerate() {
            let [x, y, z] = [corner & 1, corner >> 1 & 1, corner >> 2];
            if !(inside[0][x] & inside[1][y] & inside[2][z]) {
                continue;
            }
            *occupancy = match self.field.brick(bricks[0][x] + bricks[1][y] + bricks[2][z]) {
                Brick::Empty => 0,
                Brick::Full => SOLID,
                Brick::Slot(slot) => {
                    self.field.slot(slot)[voxels[0][x] + voxels[1][y] + voxels[2][z]]
                }
            };
        }
        trilinear(corners, share)
    }
}

/// Where a place is between two voxels, in 256ths.
#[inline(always)]
fn eight_places(at: i32) -> u32 {
    (at >> (PLACES - 8)) as u32 & 0xFF
}

/// Interpolates between corners in the order x fastest, then y, then z; shares are of 256.
#[inline(always)]
fn trilinear(corners: [u8; 8], [x, y, z]: [u32; 3]) -> u32 {
    let between = |a: u32, b: u32, share: u32| a * (256 - share) + b * share;
    let row = |first: usize| between(u32::from(corners[first]), u32::from(corners[first + 1]), x);
    let lower = between(row(0), row(2), y);
    let upper = between(row(4), row(6), y);
    between(lower, upper, z)
}
