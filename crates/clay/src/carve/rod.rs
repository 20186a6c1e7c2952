//! A rod swept along a straight segment: a right circular cylinder along an axis, and everywhere it passes.
//!
//! A rod's distance `S` is the greater of that outside its wall and that outside its ends. A sweep that ends at `p`,
//! with `q` across the axis and `w` along it, both from the middle of the rod at the end of its way, and `s` and `v`
//! the same parts of the way, leaves what the nearest of all rods on the way leaves:
//!
//! ```text
//! g = min over u in [0, 1] of  max(|q + u s| - r, |w + u v| - h)
//! ```
//!
//! Both terms are convex in `u`, so the least of their maximum is where one of them is least, if it is the greater one
//! there, or where they are equal in between: at the root of a quadratic. Cut in one piece or in many, a straight way
//! therefore leaves the same but for rounding, and nothing stands behind it however fast it is.
//!
//! What the rod at the end leaves is a function of its own place alone, and the sweep never leaves more: so a sweep
//! that starts where another one ended need not cut the rod there again.

use super::ball::{Centre, DISTANCE_ERROR};
use super::segment::Segment;
use super::{BrickAt, HALF_UNITS, InBrick, RAMP, SLACK, Solid, Tables, TileIndex, UNITS_PER_VOXEL};
use crate::lanes::{F32x4, Tile};
use crate::tool::{Cylinder, WireLoop};

/// From the middle of a tile, and of a brick, to the farthest of its voxels, in voxels.
const TILE_RADIUS: f64 = 1.5 * std::f64::consts::SQRT_2;
const BRICK_RADIUS: f64 = 7.5 * 1.732_050_807_568_877_2;
/// Up to this many voxels a way is short: what it changes is near the rod at its end.
const SHORT: f64 = 2.0;

/// What a rod is, in metres.
pub(super) struct Rod {
    radius_m: f64,
    half_m: f64,
    /// From the pose to the rod's middle.
    middle_m: [f64; 3],
}

impl Rod {
    /// Along z.
    pub(super) fn upright(cylinder: &Cylinder) -> Self {
        let half_m = 0.5 * cylinder.height_m();
        Self {
            radius_m: cylinder.radius_m(),
            half_m,
            middle_m: [0.0, 0.0, half_m],
        }
    }

    /// The disc that a loop removes, along x.
    pub(super) fn within(wire_loop: &WireLoop) -> Self {
        Self {
            radius_m: wire_loop.disc_radius_m(),
            half_m: 0.5 * wire_loop.wire_diameter_m(),
            middle_m: [0.0; 3],
        }
    }
}

/// A swept rod along `AXIS`, in units of what is left over, as in [`super::ball::BallStep`].
pub(super) struct RodSweep<const AXIS: usize> {
    end: Centre,
    radius: f32,
    half: f32,
    /// The way from the start to the end, and whether there is none.
    step: [f32; 3],
    motion: Motion,
    is_short: bool,
    /// Turn what lies along the way, in squared units across the axis and in units along it, into a share of it.
    share_across: f32,
    share_along: f32,
    /// Of the way across the axis less that along it, squares in units.
    steepness: f32,
    /// Distance of a tile's middle beyond which everything in it is left, and below which nothing is.
    reach: f32,
    clear: f32,
    /// Of a brick's middle likewise.
    brick_reach: f32,
    /// By how much the wall is beyond an end, or an end beyond the wall, at a tile's middle so that it is wherever in
    /// the tile and on the way.
    apart: f32,
    /// A tile has something ahead of the start, across the axis and along it, where its middle's way from the end along
    /// the step is more than this.
    nowhere: [f32; 2],
    bounds: [[i32; 2]; 3],
}

/// How a rod moves.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Motion {
    None,
    Across,
    Along,
    Askew,
}

impl<const AXIS: usize> RodSweep<AXIS> {
    const B: usize = (AXIS + 1) % 3;
    const C: usize = (AXIS + 2) % 3;

    /// The rod where the segment starts.
    pub(super) fn set_down(rod: &Rod, segment: &Segment) -> Self {
        Self {
            clear: f32::MIN,
            nowhere: [f32::MIN; 2],
            ..Self::new(rod, &segment.at_its_start())
        }
    }

    /// Everywhere from there to where the segment ends, given that the rod where it starts is cut already.
    pub(super) fn new(rod: &Rod, segment: &Segment) -> Self {
        let segment = segment.shifted(rod.middle_m.map(|m| m * segment.per_metre));
        let (radius, half) = (
            rod.radius_m * segment.per_metre,
            rod.half_m * segment.per_metre,
        );
        let length = segment.length_squared().sqrt();
        let is_short = length <= SHORT;
        let size = radius + half + length + BRICK_RADIUS;
        let slack = SLACK + 8.0 * DISTANCE_ERROR * size;
        // A short way takes the rod's distance along by its length at most.
        let moved = if is_short { length } else { 0.0 };
        let step = segment.step().map(|d| d * UNITS_PER_VOXEL);
        let across = step[Self::B] * step[Self::B] + step[Self::C] * step[Self::C];
        let along = step[AXIS];
        let inverse = |of: f64| if of.abs() <= 0.0 { 0.0 } else { 1.0 / of };
        let motion = match (0.0 < across, 0.0 < along.abs()) {
            (false, false) => Motion::None,
            (true, false) => Motion::Across,
            (false, true) => Motion::Along,
            (true, true) => Motion::Askew,
        };
        // A tile lies wholly behind the start where every way from there along the step is back. Of what is behind in
        // both respects the rod at the start leaves as little as any on the way.
        let behind = |squared: f64| {
            let length = squared.sqrt();
            (-length - (TILE_RADIUS + slack) * UNITS_PER_VOXEL) * length
        };
        let reach = RAMP + slack;
        let mut extent = [radius + reach; 3];
        extent[AXIS] = half + reach;
        Self {
            end: Centre::of(segment.to),
            radius: (radius * UNITS_PER_VOXEL) as f32,
            half: (half * UNITS_PER_VOXEL) as f32,
            step: step.map(|d| d as f32),
            motion,
            is_short,
            share_across: -inverse(across) as f32,
            share_along: -inverse(along) as f32,
            steepness: (across - along * along) as f32,
            reach: ((reach + moved + TILE_RADIUS) * UNITS_PER_VOXEL) as f32,
            clear: if is_short {
                (-(reach + moved + TILE_RADIUS) * UNITS_PER_VOXEL) as f32
            } else {
                f32::MIN
            },
            brick_reach: ((reach + BRICK_RADIUS) * UNITS_PER_VOXEL) as f32,
            apart: (2.0 * (TILE_RADIUS + moved + slack) * UNITS_PER_VOXEL) as f32,
            nowhere: [across, along * along].map(|squared| behind(squared) as f32),
            bounds: segment.bounds(extent),
        }
    }

    /// Distance outside the rod at the end, in units.
    #[inline(always)]
    fn outside_end(&self, way: [F32x4; 3]) -> F32x4 {
        let (b, c, w) = (way[Self::B], way[Self::C], way[AXIS]);
        let wall = (b * b + c * c).sqrt() - F32x4::splat(self.radius);
        wall.max(w.abs() - F32x4::splat(self.half))
    }

    /// What is left over.
    #[inline(always)]
    fn left_over(&self, way: [F32x4; 3]) -> F32x4 {
        let at_surface = F32x4::splat(HALF_UNITS as f32);
        let end = self.outside_end(way);
        if self.motion == Motion::None {
            return at_surface + end;
        }
        at_surface + end.min(self.outside_sweep(way))
    }

    /// Distance outside the nearest of all rods on the way, in units.
    #[inline(always)]
    fn outside_sweep(&self, way: [F32x4; 3]) -> F32x4 {
        let (zero, one) = (F32x4::splat(0.0), F32x4::splat(1.0));
        let (radius, half) = (F32x4::splat(self.radius), F32x4::splat(self.half));
        let (b, c, w) = (way[Self::B], way[Self::C], way[AXIS]);
        let step = self.step.map(F32x4::splat);
        let (step_b, step_c, step_w) = (step[Self::B], step[Self::C], step[AXIS]);
        // Where each of the two is least.
        let by_wall = (b * step_b + c * step_c) * F32x4::splat(self.share_across);
        let by_wall = by_wall.max(zero).min(one);
        let by_end = (w * F32x4::splat(self.share_along)).max(zero).min(one);
        let (wall_b, wall_c) = (b + by_wall * step_b, c + by_wall * step_c);
        let from_axis = (wall_b * wall_b + wall_c * wall_c).sqrt();
        let wall = from_axis - radius;
        let end = (w + by_wall * step_w).abs() - half;
        if self.motion == Motion::Across {
            return wall.max(end);
        }
        // Most voxels are next to the wall alone, or to an end.
        if !(end - wall).any_above_0() {
            return wall;
        }
        let least_end = (w + by_end * step_w).abs() - half;
        if self.motion == Motion::Along {
            return wall.max(least_end);
        }
        let (end_b, end_c) = (b + by_end * step_b, c + by_end * step_c);
        let wall_there = (end_b * end_b + end_c * end_c).sqrt() - radius;
        if !(wall_there - least_end).any_above_0() {
            return wall.where_below(end, least_end, wall);
        }
        // From there on the wall recedes and the end comes nearer, until both are as far: after `x` of the way.
        let closing = step_w.abs();
        let gap = end + radius;
        let outward = wall_b * step_b + wall_c * step_c;
        let outward = by_end.where_below(by_wall, zero - outward, outward);
        let linear = outward.max(zero) + gap * closing;
        let constant = (gap - from_axis) * (gap + from_axis);
        let root = (linear * linear + F32x4::splat(self.steepness) * constant)
            .max(zero)
            .sqrt();
        let equal = end - closing * (constant / (linear + root));
        let in_between = least_end.where_below(wall_there, equal, least_end);
        wall.where_below(end, in_between, wall)
    }
}

/// Number of voxels: ways from the end. Number of fours: those of their middles.
const WAY: usize = 0;
const MIDDLE: usize = 0;

impl<const AXIS: usize> Solid for RodSweep<AXIS> {
    fn bounds(&self) -> [[i32; 2]; 3] {
        self.bounds
    }

    #[inline(always)]
    fn prepare(&self, tables: &mut Tables, bricks: [[i32; 2]; 3]) {
        self.end.note_ways(tables, bricks, [WAY, MIDDLE]);
    }

    /// Whether the rod passes the brick's middle near enough.
    fn reaches(&self, at: BrickAt) -> bool {
        if self.is_short {
            return true;
        }
        let middle = self.end.way_to_middle(at);
        let near = self
            .outside_sweep(middle)
            .is_below(F32x4::splat(self.brick_reach));
        near.bits() != 0
    }

    #[inline(always)]
    fn in_brick<'a>(&'a self, tables: &'a Tables, at: BrickAt) -> impl InBrick + 'a {
        RodInBrick {
            sweep: self,
            tables,
            at,
            reach: F32x4::splat(self.reach),
            clear: F32x4::splat(self.clear),
        }
    }
}

/// The rod in one brick.
struct RodInBrick<'a, const AXIS: usize> {
    sweep: &'a RodSweep<AXIS>,
    tables: &'a Tables,
    at: BrickAt,
    reach: F32x4,
    clear: F32x4,
}

impl<const AXIS: usize> InBrick for RodInBrick<'_, AXIS> {
    #[inline(always)]
    fn bands(&self, _layer: usize) -> u32 {
        0xF
    }

    #[inline(always)]
    fn tiles(&self, layer: usize, band: usize) -> u32 {
        let sweep = self.sweep;
        let way = [
            self.tables.fours(0, MIDDLE, self.at),
            self.tables.band(MIDDLE, self.at, band),
            self.tables.layer(WAY, self.at, layer),
        ];
        if !sweep.is_short {
            return sweep.outside_sweep(way).is_below(self.reach).bits();
        }
        let (b, c, w) = (
            way[RodSweep::<AXIS>::B],
            way[RodSweep::<AXIS>::C],
            way[AXIS],
        );
        let wall = (b * b + c * c).sqrt() - F32x4::splat(sweep.radius);
        let end = w.abs() - F32x4::splat(sweep.half);
        let distance = wall.max(end);
        let near = distance.is_below(self.reach);
        let left = self.clear.is_below(distance);
        let step = sweep.step.map(F32x4::splat);
        let [across, along] = sweep.nowhere.map(F32x4::splat);
        let forth = b * step[RodSweep::<AXIS>::B] + c * step[RodSweep::<AXIS>::C];
        let apart = F32x4::splat(sweep.apart);
        let by_wall = across.is_below(forth).and((end - wall).is_below(apart));
        let by_end = along
            .is_below(w * step[AXIS])
            .and((wall - end).is_below(apart));
        near.and(left).and(by_wall.or(by_end)).bits()
    }

    #[inline(always)]
    fn leaves(&self, tile: TileIndex) -> Tile {
        let x = self.tables.four_voxels(0, WAY, self.at, tile.tile());
        let y = self
            .tables
            .four_voxels(1, WAY, self.at, tile.band())
            .each_splatted();
        let z = self.tables.layer(WAY, self.at, tile.layer());
        // Spelled out, so that each is compiled for the instructions at hand.
        Tile::nearest([
            self.sweep.left_over([x, y[0], z]),
            self.sweep.left_over([x, y[1], z]),
            self.sweep.left_over([x, y[2], z]),
            self.sweep.left_over([x, y[3], z]),
        ])
    }
}
