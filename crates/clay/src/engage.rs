//! Engaged area: how much of the tool's leading face has clay in front of it.
//!
//! ```text
//! A(d) = integral over the tool's surface of  e(x) max(n . d, 0) dS
//! ```
//!
//! with `n` the outward normal, `d` the direction of motion and `e` 1 where clay stands ahead, 0 where air does. A ball
//! wholly in clay has `pi r^2`, a blade its width times the depth of cut. The integral is a sum over points that are fixed in the tool, so
//! what is summed does not depend on the speed, and a removed volume never has to be divided by a small step.
//!
//! `e` is read where, going from a point of the face in the direction of motion, one voxel ([`LOOK_AHEAD_VOXELS`]) lies between
//! the place and the face: straight ahead that is one voxel on, towards the rim of a ball some voxels. Seen along
//! the motion, the place then covers the point it stands for, and clay that ends across the motion is measured without bias.
//! Occupancy there is interpolated between voxel centres and saturated, so that a face which has just cut its way reads
//! full clay wherever between the voxels it stands, the edge of engaged clay is found between voxels too, and the walls of a cut,
//! which hold half at the rim of the tool that made it, do not count.

use crate::field::{Brick, Field, SOLID};
use crate::grid::BRICK_EDGE;
use crate::lanes::{Floats, LANES};
use crate::pose::Pose;
use crate::tool::{Ball, Blade, ToolShape};

/// How far from its faces a tool feels for clay, in voxels: where a cut's ramp ends and the clay ahead is whole.
pub const LOOK_AHEAD_VOXELS: f64 = 1.0;

/// A flat face that slants more than this against the motion is felt nearer than [`LOOK_AHEAD_VOXELS`], so as not to reach far beyond its
/// edge. Little of it counts.
const LEAST_COSINE: f32 = 0.25;

/// Directions whose cosine is above this share the points that are felt.
const NEARLY_PARALLEL: f64 = 0.98;

/// Interpolated occupancy from which on clay counts as standing ahead in full, and below which it does not count, as shares of
/// solid. In between lies the edge of clay, at half; but nearly all of it is above, as half is also what the wall of a cut holds beside the
/// tool.
const FULL_FROM: f64 = 0.65;
const NONE_BELOW: f64 = 0.45;

/// Pairs of points on a ball.
const BALL_PAIRS: usize = 128;
/// Pairs of points on the largest pair of faces of a blade, and the least on any.
const FACE_PAIRS: usize = 256;
const LEAST_FACE_PAIRS: usize = 96;
/// The golden ratio less one: the best known step for spreading points evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Cosine and sine of the golden angle, 2 pi (1 - GOLDEN).
const GOLDEN_ANGLE: (f64, f64) = (-0.737_368_878_078_319_9, 0.675_490_294_261_524);

/// A tool ready to feel clay: its shape with points spread over its surface. Built once, used every tick, on clay of any
/// voxel size.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    shape: ToolShape,
    middle_from_pose_m: [f64; 3],
    pairs: Box<[FacePairs]>,
    /// Radius of a ball; `None` for flat faces.
    radius_m: Option<f64>,
}

/// Points, and with each the one opposite through the tool's middle. Whichever way the tool moves, one of the two leads and the
/// other trails.
#[derive(Clone, Debug, Default, PartialEq)]
struct FacePairs {
    /// From the tool's middle, along x, y, z, m.
    offset_m: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    area_m2: [f32; LANES],
}

/// One pair of points.
#[derive(Clone, Copy)]
struct FacePair {
    offset_m: [f64; 3],
    normal: [f64; 3],
    area_m2: f64,
}

impl Tool {
    /// Spreads points over the surface of a tool.
    #[must_use]
    pub fn new(shape: ToolShape) -> Self {
        let (pairs, radius_m) = match &shape {
            ToolShape::Ball(ball) => (ball_pairs(ball), Some(ball.radius_m())),
            ToolShape::Blade(blade) => (blade_pairs(blade), None),
        };
        let middle_from_pose_m = shape.middle_from_pose_m();
        let pairs = pairs.chunks(LANES).map(FacePairs::of).collect();
        Self {
            shape,
            middle_from_pose_m,
            pairs,
            radius_m,
        }
    }

    /// The solid.
    #[must_use]
    pub const fn shape(&self) -> &ToolShape {
        &self.shape
    }
}

impl FacePairs {
    /// Up to as many pairs as there are lanes; the other lanes have no area.
    fn of(pairs: &[FacePair]) -> Self {
        let mut lanes = Self::default();
        for (lane, pair) in pairs.iter().enumerate() {
            for axis in 0..3 {
                lanes.offset_m[axis][lane] = pair.offset_m[axis] as f32;
                lanes.normal[axis][lane] = pair.normal[axis] as f32;
            }
            lanes.area_m2[lane] = pair.area_m2 as f32;
        }
        lanes
    }

    /// Cosines of the angles between the normals and a direction.
    #[inline(always)]
    fn along(&self, direction: [f32; 3]) -> Floats {
        let [x, y, z] = &self.normal;
        let [dx, dy, dz] = direction.map(Floats::splat);
        Floats::load(x) * dx + Floats::load(y) * dy + Floats::load(z) * dz
    }
}

/// Points evenly spread on a hemisphere, on a spiral of equal areas; their opposites make up the other half.
fn ball_pairs(ball: &Ball) -> Vec<FacePair> {
    let radius_m = ball.radius_m();
    let area_m2 = 2.0 * std::f64::consts::PI * radius_m * radius_m / BALL_PAIRS as f64;
    let (mut cosine, mut sine) = (1.0, 0.0);
    let mut pairs = Vec::with_capacity(BALL_PAIRS);
    for at in 0..BALL_PAIRS {
        let z = (at as f64 + 0.5) / BALL_PAIRS as f64;
        let across = (1.0 - z * z).sqrt();
        let normal = [across * cosine, across * sine, z];
        pairs.push(FacePair {
            offset_m: normal.map(|n| n * radius_m),
            normal,
            area_m2,
        });
        let (c, s) = GOLDEN_ANGLE;
        (cosine, sine) = (cosine * c - sine * s, sine * c + cosine * s);
        let length = (cosine * cosine + sine * sine).sqrt();
        (cosine, sine) = (cosine / length, sine / length);
    }
    pairs
}

/// Points evenly spread on three faces of the box; their opposites make up the other three.
fn blade_pairs(blade: &Blade) -> Vec<FacePair> {
    let half_m = ToolShape::Blade(*blade)
        .extents_m()
        .map(|extent_m| 0.5 * extent_m);
    let face_m2 = |axis: usize| 4.0 * half_m[(axis + 1) % 3] * half_m[(axis + 2) % 3];
    let largest_m2 = (0..3).map(face_m2).fold(0.0, f64::max);
    let mut pairs = Vec::new();
    for axis in 0..3 {
        let count = (face_m2(axis) / largest_m2 * FACE_PAIRS as f64) as usize;
        let count = count.max(LEAST_FACE_PAIRS);
        // In even steps along the longer edge, so that clay which ends across it is measured finely.
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let (long, short) = if half_m[a] < half_m[b] {
            (b, a)
        } else {
            (a, b)
        };
        for at in 0..count {
            let even = (at as f64 + 0.5) / count as f64;
            let spread = (at as f64 + 0.5) * GOLDEN;
            let spread = spread - (spread as u32) as f64;
            let mut offset_m = [0.0; 3];
            offset_m[axis] = half_m[axis];
            offset_m[long] = half_m[long] * (2.0 * even - 1.0);
            offset_m[short] = half_m[short] * (2.0 * spread - 1.0);
            let mut normal = [0.0; 3];
            normal[axis] = 1.0;
            pairs.push(FacePair {
                offset_m,
                normal,
                area_m2: face_m2(axis) / count as f64,
            });
        }
    }
    pairs
}

/// Engaged areas of a tool at a pose for two unit directions, m². A zero direction engages nothing.
pub(crate) fn engaged_areas_m2(
    field: &Field,
    tool: &Tool,
    pose: Pose,
    directions: [[f64; 3]; 2],
) -> [f64; 2] {
    let sampler = Sampler::new(field, tool, pose);
    let [a, b] = directions;
    let cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    if NEARLY_PARALLEL < cosine {
        let sum = std::array::from_fn(|axis| a[axis] + b[axis]);
        let length = (2.0 + 2.0 * cosine).sqrt();
        return sampler.areas_m2(tool, sum.map(|d: f64| d / length), directions);
    }
    let area_m2 = |direction: [f64; 3]| {
        if direction.iter().all(|d| d.abs() <= 0.0) {
            return 0.0;
        }
        sampler.areas_m2(tool, direction, [direction])[0]
    };
    [area_m2(a), area_m2(b)]
}

/// Binary places of a sample's position between voxels.
const PLACES: u32 = 12;
/// Occupancies interpolated three times with eight binary places each.
const INTERPOLATED_SOLID: f64 = SOLID as f64 * 16_777_216.0;
const LOWEST: u32 = (NONE_BELOW * INTERPOLATED_SOLID) as u32;
const RANGE: u32 = ((FULL_FROM - NONE_BELOW) * INTERPOLATED_SOLID) as u32;

/// Reads occupancy in front of the faces of a tool. Interpolation is in integers.
struct Sampler<'a> {
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
    fn new(field: &'a Field, tool: &Tool, pose: Pose) -> Self {
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

    /// Engaged areas in directions close to `ahead`, the direction in which clay is felt, m².
    #[inline(always)]
    fn areas_m2<const N: usize>(
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
