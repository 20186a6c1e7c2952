//! A ball that moves by a short step: the ball where it is now, as far as that is not behind where it was.

use super::segment::{Segment, nearest_voxel};
use super::{BrickAt, HALF_UNITS, InBrick, RAMP, SLACK, Solid, Tables, TileIndex, UNITS_PER_VOXEL};
use crate::grid::BRICK_EDGE;
use crate::lanes::{F32x4, LANES, Tile};
use crate::tool::Ball;

/// Relative rounding error of a distance in single precision: of coordinates, their squares, the sum and the root, and
/// as much again in reserve.
pub(super) const DISTANCE_ERROR: f64 = 1e-6;

/// The ball in units of what is left over, voxel centres at whole multiples of [`UNITS_PER_VOXEL`].
///
/// A short step leaves what its two balls leave. Between them the capsule about the segment has hardly any more room:
/// at a distance `d` from the segment, its belt is nearer by at most `step^2 / 8 d`, which is a quarter of a unit of
/// what is left, or less ([`BallStep::suits`]). And what a ball leaves is a function of its own place alone, so the
/// ball at the end of one step and the ball at the start of the next are the same to the last bit.
pub(super) struct BallStep {
    centre: Centre,
    /// What is left over is the distance from the centre, plus this.
    at_centre: f32,
    reach_squared: f32,
    /// From the ball at the start, and from the middle of the step, to the ball at the end's origin.
    from: [f32; 3],
    middle: [f32; 3],
    step: [f32; 3],
    /// Square of the radius within which the ball at the start leaves nothing; below zero where there is none.
    clear_squared: f32,
    /// A place is ahead of the middle of the step where its way from there along the step is more than this.
    nowhere: f32,
    bounds: [[i32; 2]; 3],
}

/// A place, and the voxel near it from which coordinates are taken, so that single precision resolves them finely.
#[derive(Clone, Copy)]
pub(super) struct Centre {
    pub(super) origin: [i32; 3],
    /// From the place to the origin, in units.
    pub(super) offset: [f32; 3],
}

impl BallStep {
    /// Whether the step is short enough to be cut as two balls.
    pub(super) fn suits(ball: &Ball, segment: &Segment) -> bool {
        0.5 * UNITS_PER_VOXEL * segment.length_squared()
            <= ball.radius_m() * segment.per_metre - RAMP
    }

    /// The ball where the segment starts.
    pub(super) fn set_down(ball: &Ball, segment: &Segment) -> Self {
        let radius = ball.radius_m() * segment.per_metre;
        let reach = radius * (1.0 + DISTANCE_ERROR) + RAMP + SLACK;
        Self {
            centre: Centre::of(segment.from),
            at_centre: at_centre(radius),
            reach_squared: square_in_units(reach),
            from: [0.0; 3],
            middle: [0.0; 3],
            step: [0.0; 3],
            clear_squared: -1.0,
            nowhere: -1.0,
            bounds: segment.at_its_start().bounds([reach; 3]),
        }
    }

    /// The ball where the segment ends, given that the one where it starts is cut already.
    pub(super) fn new(ball: &Ball, segment: &Segment) -> Self {
        let radius = ball.radius_m() * segment.per_metre;
        let length = segment.length_squared().sqrt();
        // Behind the middle by `b`, the ball at the end is the farther one by `b length / distance`, which must be more
        // than both distances may be off.
        let size = radius + RAMP + SLACK + length;
        let generosity = SLACK * length + 4.0 * DISTANCE_ERROR * size * size;
        let here = Self::set_down(ball, &segment.backwards());
        Self {
            from: here.centre.offset_of(segment.from),
            middle: here.centre.offset_of(segment.middle()),
            step: segment.step().map(|d| d as f32),
            clear_squared: clear_squared(radius * (1.0 - DISTANCE_ERROR) - RAMP - SLACK),
            nowhere: (-generosity * UNITS_PER_VOXEL) as f32,
            ..here
        }
    }
}

impl Centre {
    pub(super) fn of(place: [f64; 3]) -> Self {
        let origin = place.map(nearest_voxel);
        let here = Self {
            origin,
            offset: [0.0; 3],
        };
        Self {
            origin,
            offset: here.offset_of(place),
        }
    }

    /// From a place near this one to this one's origin, in units.
    pub(super) fn offset_of(&self, place: [f64; 3]) -> [f32; 3] {
        std::array::from_fn(|axis| {
            ((f64::from(self.origin[axis]) - place[axis]) * UNITS_PER_VOXEL) as f32
        })
    }

    /// Notes ways from the place for voxels of these bricks, and for the middles of fours of them, each as its table's
    /// `number`.
    #[inline(always)]
    pub(super) fn note_ways(
        &self,
        tables: &mut Tables,
        bricks: [[i32; 2]; 3],
        [way, middle]: [usize; 2],
    ) {
        let half = F32x4::splat(0.5 * (LANES - 1) as f32 * UNITS_PER_VOXEL as f32);
        for axis in 0..3 {
            let (origin, offset) = (self.origin[axis], self.offset[axis]);
            tables.note_voxels(axis, way, bricks[axis], |first| self.ways(axis, first, 1));
            tables.note_fours(axis, middle, bricks[axis], |first| {
                ways(first - origin, LANES as i32, offset) + half
            });
        }
    }

    /// The way from the place to the middle of a brick, in units.
    pub(super) fn way_to_middle(&self, at: BrickAt) -> [F32x4; 3] {
        std::array::from_fn(|axis| {
            let voxels = at.0[axis] as i32 * BRICK_EDGE as i32 - self.origin[axis];
            let middle = f64::from(voxels) + 0.5 * (BRICK_EDGE - 1) as f64;
            F32x4::splat((middle * UNITS_PER_VOXEL) as f32 + self.offset[axis])
        })
    }

    /// Four voxels' ways from the place along an axis, in units, `step` voxels apart.
    #[inline(always)]
    pub(super) fn ways(&self, axis: usize, first: i32, step: i32) -> F32x4 {
        ways(first - self.origin[axis], step, self.offset[axis])
    }
}

/// Four ways, in units, `step` voxels apart, of which the first is this many voxels from an origin at `offset`.
#[inline(always)]
pub(super) fn ways(first: i32, step: i32, offset: f32) -> F32x4 {
    let units = F32x4::splat(UNITS_PER_VOXEL as f32);
    F32x4::stepping(first, step) * units + F32x4::splat(offset)
}

/// What is left over at the centre of a ball, if that were not cut off at nothing.
pub(super) fn at_centre(radius: f64) -> f32 {
    (HALF_UNITS - UNITS_PER_VOXEL * radius) as f32
}

/// The square of a radius in voxels, in units.
pub(super) fn square_in_units(radius: f64) -> f32 {
    let radius = radius * UNITS_PER_VOXEL;
    (radius * radius) as f32
}

/// The same; below zero for a radius below zero.
pub(super) fn clear_squared(radius: f64) -> f32 {
    if radius < 0.0 {
        return -1.0;
    }
    square_in_units(radius)
}

/// Numbers of voxels: squared ways from the centre; along z also from the ball at the start, and how far they are
/// ahead.
const SQUARED: usize = 0;
const Z_FROM_SQUARED: usize = 1;
const Z_AHEAD: usize = 2;
/// Numbers of fours: the least square of the way from the centre, the greatest from the ball at the start, and how far
/// they are ahead at most.
const NEAREST: usize = 0;
const FARTHEST: usize = 1;
const AHEAD: usize = 2;

impl Solid for BallStep {
    fn bounds(&self) -> [[i32; 2]; 3] {
        self.bounds
    }

    #[inline(always)]
    fn prepare(&self, tables: &mut Tables, bricks: [[i32; 2]; 3]) {
        let square = |way: F32x4| way * way;
        for axis in 0..3 {
            let way = |first| self.centre.ways(axis, first, 1);
            tables.note_voxels(axis, SQUARED, bricks[axis], |first| square(way(first)));
        }
        let way = |offset: &[f32; 3], first: i32| ways(first - self.centre.origin[2], 1, offset[2]);
        let step_z = F32x4::splat(self.step[2]);
        tables.note_voxels(2, Z_FROM_SQUARED, bricks[2], |first| {
            square(way(&self.from, first))
        });
        tables.note_voxels(2, Z_AHEAD, bricks[2], |first| {
            way(&self.middle, first) * step_z
        });
        for axis in 0..2 {
            let ends = |offset: &[f32; 3], first: i32| {
                let first = first - self.centre.origin[axis];
                let last = first + LANES as i32 - 1;
                [first, last].map(|at| ways(at, LANES as i32, offset[axis]))
            };
            let zero = F32x4::splat(0.0);
            tables.note_fours(axis, NEAREST, bricks[axis], |first| {
                let [first, last] = ends(&self.centre.offset, first);
                square(first.max(zero - last).max(zero))
            });
            tables.note_fours(axis, FARTHEST, bricks[axis], |first| {
                let [first, last] = ends(&self.from, first);
                square(last.max(zero - first))
            });
            let step = F32x4::splat(self.step[axis]);
            tables.note_fours(axis, AHEAD, bricks[axis], |first| {
                let [first, last] = ends(&self.middle, first);
                (first * step).max(last * step)
            });
        }
    }

    fn reaches(&self, _at: BrickAt) -> bool {
        true
    }

    #[inline(always)]
    fn in_brick<'a>(&'a self, tables: &'a Tables, at: BrickAt) -> impl InBrick + 'a {
        let [nearest, farthest, ahead] =
            [NEAREST, FARTHEST, AHEAD].map(|number| tables.fours(0, number, at));
        let bands = [NEAREST, FARTHEST, AHEAD].map(|number| tables.fours(1, number, at));
        BallInBrick {
            tables,
            at,
            tiles: [nearest, farthest, ahead],
            any_tile: [
                bands[0] + nearest.least(),
                bands[1] + farthest.most(),
                bands[2] + ahead.most(),
            ],
            reach_squared: F32x4::splat(self.reach_squared),
            clear_squared: F32x4::splat(self.clear_squared),
            nowhere: F32x4::splat(self.nowhere),
            at_centre: F32x4::splat(self.at_centre),
        }
    }
}

/// The ball in one brick. Squares of distances are sums over the axes, and so are ways along the step.
struct BallInBrick<'a> {
    tables: &'a Tables,
    at: BrickAt,
    /// As in the tables: of tiles, and of bands together with the extremes over all tiles.
    tiles: [F32x4; 3],
    any_tile: [F32x4; 3],
    reach_squared: F32x4,
    clear_squared: F32x4,
    nowhere: F32x4,
    at_centre: F32x4,
}

impl BallInBrick<'_> {
    /// Within reach of the end, not wholly where nothing is left, and not wholly behind.
    #[inline(always)]
    fn may_change(&self, layer: usize, [nearest, farthest, ahead]: [F32x4; 3]) -> u32 {
        let of_layer = |number| self.tables.layer(number, self.at, layer);
        let near = (nearest + of_layer(SQUARED)).is_below(self.reach_squared);
        let left = self
            .clear_squared
            .is_below(farthest + of_layer(Z_FROM_SQUARED));
        let ahead = self.nowhere.is_below(ahead + of_layer(Z_AHEAD));
        near.and(left).and(ahead).bits()
    }
}

impl InBrick for BallInBrick<'_> {
    #[inline(always)]
    fn bands(&self, layer: usize) -> u32 {
        self.may_change(layer, self.any_tile)
    }

    #[inline(always)]
    fn tiles(&self, layer: usize, band: usize) -> u32 {
        let of_band = |number| self.tables.band(number, self.at, band);
        let [nearest, farthest, ahead] = self.tiles;
        let sums = [
            nearest + of_band(NEAREST),
            farthest + of_band(FARTHEST),
            ahead + of_band(AHEAD),
        ];
        self.may_change(layer, sums)
    }

    #[inline(always)]
    fn leaves(&self, tile: TileIndex) -> Tile {
        let along = self.tables.four_voxels(0, SQUARED, self.at, tile.tile());
        let across = self.tables.four_voxels(1, SQUARED, self.at, tile.band())
            + self.tables.layer(SQUARED, self.at, tile.layer());
        let [a, b, c, d] = across.each_splatted();
        let leaves = |across: F32x4| (along + across).sqrt() + self.at_centre;
        Tile::nearest([leaves(a), leaves(b), leaves(c), leaves(d)])
    }
}
