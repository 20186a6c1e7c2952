//! A ball swept along a segment too long for [`super::ball`]: a capsule.

use super::ball::{Centre, DISTANCE_ERROR, at_centre, clear_squared, square_in_units, ways};
use super::segment::Segment;
use super::{BrickAt, InBrick, RAMP, SLACK, Solid, Tables, TileIndex, UNITS_PER_VOXEL};
use crate::grid::BRICK_EDGE;
use crate::lanes::{F32x4, LANES, Tile};
use crate::tool::Ball;

/// From the middle of a tile to the farthest of its voxels, in voxels.
const TILE_RADIUS: f64 = 1.5 * std::f64::consts::SQRT_2;
/// From the middle of a brick to the farthest of its voxels, in voxels.
const BRICK_RADIUS: f64 = 7.5 * 1.732_050_807_568_877_2;
/// Stands for the square of a distance at which everything is left: far from what overflows an integer once its root is
/// taken.
const BEYOND_SQUARED: f32 = 1e16;

/// The capsule in units of what is left over, as in [`super::ball::BallStep`], given that the ball where it starts is
/// cut already.
///
/// It leaves what the ball at its end leaves, or the cylinder between start and end where that leaves less.
pub(super) struct CapsuleSweep {
    /// The end, as for a ball there.
    end: Centre,
    at_centre: f32,
    /// From the start to the end's origin.
    from: [f32; 3],
    step: [f32; 3],
    /// Turns a way along the step, voxels times units, into a share of it.
    share_per_along: f32,
    /// Squares of the distances of a tile's middle from the segment beyond which everything in it is left, and from the
    /// start below which nothing is.
    reach_squared: f32,
    clear_squared: f32,
    /// A tile has something ahead of the start where its middle's way from there along the step is more than this.
    nowhere: f32,
    segment_from: [f64; 3],
    segment_step: [f64; 3],
    brick_reach: f64,
    bounds: [[i32; 2]; 3],
}

impl CapsuleSweep {
    pub(super) fn new(ball: &Ball, segment: &Segment) -> Self {
        let radius = ball.radius_m() * segment.per_metre;
        let (step, length_squared) = (segment.step(), segment.length_squared());
        let length = length_squared.sqrt();
        let size = radius + length + BRICK_RADIUS;
        let slack = SLACK + 8.0 * DISTANCE_ERROR * size;
        let reach = radius + RAMP + slack;
        let end = Centre::of(segment.to);
        Self {
            from: end.offset_of(segment.from),
            end,
            at_centre: at_centre(radius),
            step: step.map(|d| d as f32),
            share_per_along: (1.0 / (length_squared * UNITS_PER_VOXEL)) as f32,
            reach_squared: square_in_units(reach + TILE_RADIUS),
            clear_squared: clear_squared(radius - RAMP - slack - TILE_RADIUS),
            nowhere: (-(TILE_RADIUS + slack) * length * UNITS_PER_VOXEL) as f32,
            segment_from: segment.from,
            segment_step: step,
            brick_reach: reach + BRICK_RADIUS,
            bounds: segment.bounds([reach; 3]),
        }
    }
}

/// Numbers of voxels: squared ways from the end, and ways from the start.
const SQUARED: usize = 0;
const FROM: usize = 1;
/// Number of fours: ways of their middles from the start.
const MIDDLE_FROM: usize = 0;

impl Solid for CapsuleSweep {
    fn bounds(&self) -> [[i32; 2]; 3] {
        self.bounds
    }

    fn prepare(&self, tables: &mut Tables, bricks: [[i32; 2]; 3]) {
        let half = 0.5 * (LANES - 1) as f32 * UNITS_PER_VOXEL as f32;
        for axis in 0..3 {
            let origin = self.end.origin[axis];
            tables.note_voxels(axis, SQUARED, bricks[axis], |first| {
                let way = self.end.ways(axis, first, 1);
                way * way
            });
            tables.note_voxels(axis, FROM, bricks[axis], |first| {
                ways(first - origin, 1, self.from[axis])
            });
            tables.note_fours(axis, MIDDLE_FROM, bricks[axis], |first| {
                ways(first - origin, LANES as i32, self.from[axis] + half)
            });
        }
    }

    /// Whether the segment passes the brick's middle near enough.
    fn reaches(&self, at: BrickAt) -> bool {
        let middle =
            at.0.map(|at| (at * BRICK_EDGE) as f64 + 0.5 * (BRICK_EDGE - 1) as f64);
        let off: [f64; 3] = std::array::from_fn(|axis| middle[axis] - self.segment_from[axis]);
        let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let share = dot(&off, &self.segment_step) / dot(&self.segment_step, &self.segment_step);
        let share = share.clamp(0.0, 1.0);
        let off: [f64; 3] = std::array::from_fn(|axis| off[axis] - share * self.segment_step[axis]);
        dot(&off, &off) <= self.brick_reach * self.brick_reach
    }

    #[inline(always)]
    fn in_brick<'a>(&'a self, tables: &'a Tables, at: BrickAt) -> impl InBrick + 'a {
        CapsuleInBrick {
            tables,
            at,
            step: self.step.map(F32x4::splat),
            share_per_along: F32x4::splat(self.share_per_along),
            reach_squared: F32x4::splat(self.reach_squared),
            clear_squared: F32x4::splat(self.clear_squared),
            nowhere: F32x4::splat(self.nowhere),
            at_centre: F32x4::splat(self.at_centre),
        }
    }
}

/// The capsule in one brick.
struct CapsuleInBrick<'a> {
    tables: &'a Tables,
    at: BrickAt,
    step: [F32x4; 3],
    share_per_along: F32x4,
    reach_squared: F32x4,
    clear_squared: F32x4,
    nowhere: F32x4,
    at_centre: F32x4,
}

impl CapsuleInBrick<'_> {
    #[inline(always)]
    fn along(&self, [x, y, z]: [F32x4; 3]) -> F32x4 {
        let [step_x, step_y, step_z] = self.step;
        x * step_x + (y * step_y + z * step_z)
    }

    /// Squared distances from the segment's point at a share of it.
    #[inline(always)]
    fn squared(&self, [x, y, z]: [F32x4; 3], share: F32x4) -> F32x4 {
        let [step_x, step_y, step_z] = self.step;
        let share = share * F32x4::splat(UNITS_PER_VOXEL as f32);
        let (x, y, z) = (x - share * step_x, y - share * step_y, z - share * step_z);
        x * x + (y * y + z * z)
    }
}

impl InBrick for CapsuleInBrick<'_> {
    #[inline(always)]
    fn bands(&self, _layer: usize) -> u32 {
        0xF
    }

    #[inline(always)]
    fn tiles(&self, layer: usize, band: usize) -> u32 {
        let (zero, one) = (F32x4::splat(0.0), F32x4::splat(1.0));
        let at = [
            self.tables.fours(0, MIDDLE_FROM, self.at),
            self.tables.band(MIDDLE_FROM, self.at, band),
            self.tables.layer(FROM, self.at, layer),
        ];
        let along = self.along(at);
        let share = (along * self.share_per_along).max(zero).min(one);
        let near = self.squared(at, share).is_below(self.reach_squared);
        let left = self.clear_squared.is_below(self.squared(at, zero));
        let ahead = self.nowhere.is_below(along);
        near.and(left).and(ahead).bits()
    }

    #[inline(always)]
    fn leaves(&self, tile: TileIndex) -> Tile {
        let x = |number| self.tables.four_voxels(0, number, self.at, tile.tile());
        let y = |number| self.tables.four_voxels(1, number, self.at, tile.band());
        let z = |number| self.tables.layer(number, self.at, tile.layer());
        let (zero, one) = (F32x4::splat(0.0), F32x4::splat(1.0));
        let beyond = F32x4::splat(BEYOND_SQUARED);
        let across = (y(SQUARED) + z(SQUARED)).each_splatted();
        let from_y = y(FROM).each_splatted();
        Tile::nearest(std::array::from_fn(|row| {
            let place = [x(FROM), from_y[row], z(FROM)];
            let share = self.along(place) * self.share_per_along;
            let squared = share.where_below(one, self.squared(place, share), beyond);
            let from_segment = zero.where_below(share, squared, beyond);
            (x(SQUARED) + across[row]).min(from_segment).sqrt() + self.at_centre
        }))
    }
}
