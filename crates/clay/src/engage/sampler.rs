//! Reads the clay in front of a tool.

use super::LOOK_AHEAD_VOXELS;
use super::points::{FacePairs, Tool};
use crate::field::{Field, Reader, SOLID};
use crate::grid::BRICK_EDGE;
use crate::lanes::{Floats, Ints, LANES};
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
const LOWEST: f32 = (NONE_BELOW * SOLID as f64) as f32;
const RANGE: f32 = ((FULL_FROM - NONE_BELOW) * SOLID as f64) as f32;

/// Reads occupancy in front of the faces of a tool.
pub(super) struct Sampler<'a> {
    field: &'a Field,
    reader: Reader<'a>,
    /// Middle of the tool, in voxels, voxel centres at whole numbers.
    middle: [f32; 3],
    per_metre: f32,
    /// Radius of curvature of the tool's faces, in voxels; `None` for flat ones.
    radius: Option<f32>,
    /// Voxels that storage has along each axis.
    voxels: [f32; 3],
}

impl<'a> Sampler<'a> {
    pub(super) fn new(field: &'a Field, tool: &Tool, pose: Pose) -> Self {
        let per_metre = 1.0 / field.grid().voxel_size_m();
        let position_m = pose.position_m();
        Self {
            field,
            reader: field.reader(),
            middle: std::array::from_fn(|axis| {
                ((position_m[axis] + tool.middle_from_pose_m[axis]) * per_metre - 0.5) as f32
            }),
            per_metre: per_metre as f32,
            radius: tool.radius_m.map(|radius_m| (radius_m * per_metre) as f32),
            voxels: field
                .grid()
                .bricks()
                .map(|count| f32::from(count) * BRICK_EDGE as f32),
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
        let place = |axis: usize| {
            let offset = side * Floats::load(&pairs.offset_m[axis]) * Floats::splat(self.per_metre);
            let place =
                Floats::splat(self.middle[axis]) + offset + reach * Floats::splat(ahead[axis]);
            // Kept in the border of air about the grid, from where it is counted.
            let most = self.voxels[axis] + (2 * BRICK_EDGE - 2) as f32;
            ((place + Floats::splat(BRICK_EDGE as f32)) * Floats::splat(scale))
                .nearest_within([0.0, most * scale])
        };
        let ahead = self.interpolated([place(0), place(1), place(2)]) - Floats::splat(LOWEST);
        let kept = ahead
            .greater(Floats::splat(0.0))
            .lesser(Floats::splat(RANGE));
        kept * Floats::splat(1.0 / RANGE)
    }

    /// Occupancy interpolated between the eight voxel centres about places.
    #[inline(always)]
    fn interpolated(&self, places: [Ints; 3]) -> Floats {
        const EDGE: i32 = BRICK_EDGE as i32;
        const EDGE_PLACES: i32 = EDGE.trailing_zeros() as i32;
        let whole = |axis: usize| places[axis].shifted_right::<{ PLACES as i32 }>();
        let (x, y, z) = (whole(0), whole(1), whole(2));
        let [_, stride_y, stride_z] = self.reader.strides;
        // Where the voxel's row is: by bricks, and in its brick.
        let along_y = |y: Ints| {
            let brick = y.shifted_right::<EDGE_PLACES>().times(stride_y as i16);
            (brick, y.masked(EDGE - 1).shifted_left::<EDGE_PLACES>())
        };
        let along_z = |z: Ints| {
            let brick = z.shifted_right::<EDGE_PLACES>().times(stride_z as i16);
            (
                brick,
                z.masked(EDGE - 1).shifted_left::<{ 2 * EDGE_PLACES }>(),
            )
        };
        let x_in_brick = x.masked(EDGE - 1);
        let x_brick = x.shifted_right::<EDGE_PLACES>();
        let one = Ints::splat(1);
        let (ys, zs) = (
            [along_y(y), along_y(y + one)],
            [along_z(z), along_z(z + one)],
        );
        let mut corners = [0; LANES];
        let mut rows = [([0; LANES], [0; LANES]); 4];
        for (row, (bricks, voxels)) in rows.iter_mut().enumerate() {
            let ((y_brick, y), (z_brick, z)) = (ys[row % 2], zs[row / 2]);
            *bricks = (x_brick + (y_brick + z_brick)).to_array();
            *voxels = (x_in_brick + (y + z)).to_array();
        }
        for (lane, corners) in corners.iter_mut().enumerate() {
            let pair = |row: usize| {
                let (bricks, voxels) = &rows[row];
                self.reader.pair(bricks[lane] as u32, voxels[lane] as u32)
            };
            *corners = pair(0) | pair(1) << 16 | pair(2) << 32 | pair(3) << 48;
        }
        if x_in_brick.equals(Ints::splat(EDGE - 1)).bits() != 0 {
            self.step_across(x_in_brick, &rows, &mut corners);
        }
        let share = |axis: usize| {
            let share = places[axis].masked((1 << PLACES) - 1).to_floats();
            share * Floats::splat(1.0 / (1 << PLACES) as f32)
        };
        let (x, y, z) = (share(0), share(1), share(2));
        let between = |a: Floats, b: Floats, share: Floats| a + (b - a) * share;
        let [a, b, c, d, e, f, g, h] = Floats::of_bytes(corners);
        let lower = between(between(a, b, x), between(c, d, x), y);
        let upper = between(between(e, f, x), between(g, h, x), y);
        between(lower, upper, z)
    }

    /// Reads the second voxels of pairs that lie in two bricks.
    #[cold]
    fn step_across(
        &self,
        x_in_brick: Ints,
        rows: &[([i32; LANES], [i32; LANES]); 4],
        corners: &mut [u64; LANES],
    ) {
        const LAST: i32 = BRICK_EDGE as i32 - 1;
        for (lane, x) in x_in_brick.to_array().into_iter().enumerate() {
            if x != LAST {
                continue;
            }
            for (row, (bricks, voxels)) in rows.iter().enumerate() {
                let (brick, voxel) = (bricks[lane] + 1, voxels[lane] - LAST);
                let next = self.reader.pair(brick as u32, voxel as u32) & 0xFF;
                let at = 16 * row + 8;
                corners[lane] = corners[lane] & !(0xFF << at) | next << at;
            }
        }
    }
}
