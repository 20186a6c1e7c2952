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
//! `e` is read half a voxel ahead of the face along its normal ([`LOOK_AHEAD_VOXELS`]): interpolated between voxel centres and
//! saturated, so that a face which has just cut its way reads full clay wherever between the voxels it stands, and the
//! edge of engaged clay is found between voxels too.

use crate::field::{Brick, Field, SOLID};
use crate::grid::{BRICK_EDGE, BRICK_VOXELS};
use crate::pose::Pose;
use crate::tool::{Ball, Blade, ToolShape};

/// How far ahead of its faces, along their normals, a tool feels for clay, in voxels. A cut leaves the share 3/4 there; nearer,
/// saturation could not tell it from the surface of clay that is not engaged.
pub const LOOK_AHEAD_VOXELS: f64 = 0.5;

/// Interpolated occupancy from which on clay counts as standing ahead in full, and below which it does not count, as shares of solid. The
/// two lie evenly about 1/2, so that a flat boundary of clay is found where it is.
const FULL_FROM: f64 = 0.65;
const NONE_BELOW: f64 = 1.0 - FULL_FROM;

/// Pairs of points on a ball.
const BALL_PAIRS: usize = 256;
/// Pairs of points on the largest pair of faces of a blade, and the least on any.
const FACE_PAIRS: usize = 512;
const LEAST_FACE_PAIRS: usize = 64;
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
    pairs: Box<[FacePair]>,
}

/// Two points opposite each other through the tool's middle. Whichever way the tool moves, one of them leads and the
/// other trails.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FacePair {
    offset_m: [f32; 3],
    normal: [f32; 3],
    area_m2: f32,
}

impl Tool {
    /// Spreads points over the surface of a tool.
    #[must_use]
    pub fn new(shape: ToolShape) -> Self {
        let pairs = match &shape {
            ToolShape::Ball(ball) => ball_pairs(ball),
            ToolShape::Blade(blade) => blade_pairs(blade),
        };
        let middle_from_pose_m = shape.middle_from_pose_m();
        Self {
            shape,
            middle_from_pose_m,
            pairs: pairs.into(),
        }
    }

    /// The solid.
    #[must_use]
    pub const fn shape(&self) -> &ToolShape {
        &self.shape
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
            offset_m: normal.map(|n| (n * radius_m) as f32),
            normal: normal.map(|n| n as f32),
            area_m2: area_m2 as f32,
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
            offset_m[axis] = half_m[axis] as f32;
            offset_m[long] = (half_m[long] * (2.0 * even - 1.0)) as f32;
            offset_m[short] = (half_m[short] * (2.0 * spread - 1.0)) as f32;
            let mut normal = [0.0; 3];
            normal[axis] = 1.0;
            pairs.push(FacePair {
                offset_m,
                normal,
                area_m2: (face_m2(axis) / count as f64) as f32,
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
    let [first, second] = directions.map(|direction| direction.map(|d| d as f32));
    let mut areas_m2 = [0.0; 2];
    for pair in &tool.pairs {
        let (along_first, along_second) = (dot(pair.normal, first), dot(pair.normal, second));
        if along_first.abs() + along_second.abs() <= 1e-6 {
            continue;
        }
        let leads = along_first + along_second;
        let engaged = sampler.engaged(pair, leads.is_sign_negative());
        let other = if along_first * along_second < 0.0 {
            sampler.engaged(pair, !leads.is_sign_negative())
        } else {
            engaged
        };
        for (area_m2, along) in areas_m2.iter_mut().zip([along_first, along_second]) {
            let same = along.is_sign_negative() == leads.is_sign_negative();
            *area_m2 +=
                f64::from((if same { engaged } else { other }) * along.abs() * pair.area_m2);
        }
    }
    areas_m2
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Binary places of a sample's position between voxels.
const PLACES: u32 = 12;
/// Adding this to a single below 1024 in magnitude leaves its value in units of `2^-12` in the low bits of the sum.
const FIXER: f32 = 3072.0;
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
    bricks: [usize; 2],
    /// Voxels that storage has along each axis, less one.
    last: [u32; 3],
}

impl<'a> Sampler<'a> {
    fn new(field: &'a Field, tool: &Tool, pose: Pose) -> Self {
        let per_metre = 1.0 / field.grid().voxel_size_m();
        let position_m = pose.position_m();
        let bricks = field.grid().bricks();
        Self {
            field,
            middle: std::array::from_fn(|axis| {
                ((position_m[axis] + tool.middle_from_pose_m[axis]) * per_metre - 0.5) as f32
            }),
            per_metre: per_metre as f32,
            bricks: [usize::from(bricks[0]), usize::from(bricks[1])],
            last: bricks.map(|count| u32::from(count) * BRICK_EDGE as u32 - 1),
        }
    }

    /// Whether clay stands ahead of a point, or of its opposite: 0 to 1.
    #[inline]
    fn engaged(&self, pair: &FacePair, opposite: bool) -> f32 {
        let sign = if opposite { -1.0 } else { 1.0 };
        let at: [i32; 3] = std::array::from_fn(|axis| {
            let offset =
                pair.offset_m[axis] * self.per_metre + pair.normal[axis] * LOOK_AHEAD_VOXELS as f32;
            let place = self.middle[axis] + sign * offset;
            // Grids end far below 1000: a place clamped there is in air as it was before.
            let place = if place < -1000.0 { -1000.0 } else { place };
            let place = if 1000.0 < place { 1000.0 } else { place };
            (place + FIXER).to_bits() as i32 - FIXER.to_bits() as i32
        });
        let occupancy = self.interpolated(at);
        (occupancy.max(LOWEST) - LOWEST).min(RANGE) as f32 * (1.0 / RANGE as f32)
    }

    /// Occupancy interpolated between the eight voxel centres about a place.
    #[inline]
    fn interpolated(&self, at: [i32; 3]) -> u32 {
        let base = at.map(|at| at >> PLACES);
        let share = at.map(|at| (at >> (PLACES - 8)) as u32 & 0xFF);
        let edge = BRICK_EDGE as i32;
        let within = (0..3)
            .all(|axis| (base[axis] as u32) < self.last[axis] && base[axis] % edge < edge - 1);
        if !within {
            return self.interpolated_across_bricks(base, share);
        }
        let [x, y, z] = base.map(|at| at as usize);
        let brick =
            ((z / BRICK_EDGE) * self.bricks[1] + y / BRICK_EDGE) * self.bricks[0] + x / BRICK_EDGE;
        match self.field.brick(brick) {
            Brick::Empty => 0,
            Brick::Full => u32::from(SOLID) << 24,
            Brick::Slot(slot) => {
                const ROW: usize = BRICK_EDGE;
                const LAYER: usize = BRICK_EDGE * BRICK_EDGE;
                let (x, y, z) = (x % BRICK_EDGE, y % BRICK_EDGE, z % BRICK_EDGE);
                let voxels: &[u8; BRICK_VOXELS] = self.field.slot(slot);
                let first = z * LAYER + y * ROW + x;
                let corner = &voxels[first..first + LAYER + ROW + 2];
                trilinear(
                    [
                        0,
                        1,
                        ROW,
                        ROW + 1,
                        LAYER,
                        LAYER + 1,
                        LAYER + ROW,
                        LAYER + ROW + 1,
                    ]
                    .map(|at| corner[at]),
                    share,
                )
            }
        }
    }

    #[cold]
    fn interpolated_across_bricks(&self, base: [i32; 3], share: [u32; 3]) -> u32 {
        let corners = std::array::from_fn(|corner| {
            self.field.occupancy(std::array::from_fn(|axis| {
                base[axis] + (corner >> axis & 1) as i32
            }))
        });
        trilinear(corners, share)
    }
}

/// Interpolates between corners in the order x fastest, then y, then z; shares are of 256.
#[inline]
fn trilinear(corners: [u8; 8], share: [u32; 3]) -> u32 {
    let between = |a: u32, b: u32, share: u32| a * (256 - share) + b * share;
    let [a, b, c, d, e, f, g, h] = corners.map(u32::from);
    let [x, y, z] = share;
    let lower = between(between(a, b, x), between(c, d, x), y);
    let upper = between(between(e, f, x), between(g, h, x), y);
    between(lower, upper, z)
}
