//! Points spread over the surface of a tool, at which it feels clay.

use crate::lanes::{F32x4, LANES};
use crate::tool::{Ball, Blade, ToolShape};

/// Pairs of points on a ball.
const BALL_PAIRS: usize = 128;
/// Pairs of points on the largest pair of faces of a blade, and the least on any.
const FACE_PAIRS: usize = 256;
const LEAST_FACE_PAIRS: usize = 96;
/// The golden ratio less one: the best known step for spreading points evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Cosine and sine of the golden angle, 2 pi (1 - GOLDEN).
const GOLDEN_ANGLE: (f64, f64) = (-0.737_368_878_078_319_9, 0.675_490_294_261_524);

/// A tool ready to feel clay: its shape with points spread over its surface. Built once, used every tick, on clay of
/// any voxel size.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    shape: ToolShape,
    pub(super) middle_from_pose_m: [f64; 3],
    pub(super) pairs: Box<[FacePairs]>,
    /// Radius of a ball; `None` for flat faces.
    pub(super) radius_m: Option<f64>,
}

/// Points, and with each the one opposite through the tool's middle. Whichever way the tool moves, one of the two leads
/// and the other trails.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct FacePairs {
    /// From the tool's middle, along x, y, z, m.
    pub(super) offset_m: [[f32; LANES]; 3],
    pub(super) normal: [[f32; LANES]; 3],
    pub(super) area_m2: [f32; LANES],
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
    pub(super) fn along(&self, direction: [f32; 3]) -> F32x4 {
        let [x, y, z] = &self.normal;
        let [dx, dy, dz] = direction.map(F32x4::splat);
        F32x4::load(x) * dx + F32x4::load(y) * dy + F32x4::load(z) * dz
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
    let half_m = half_extents_m(blade);
    let mut pairs = Vec::new();
    for axis in 0..3 {
        let count = face_pairs(half_m, axis);
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
                area_m2: face_m2(half_m, axis) / count as f64,
            });
        }
    }
    pairs
}

/// Distance between the rows of points along the longer edge of a blade's faces across `axis`, m: clay that ends
/// between two rows is felt to end at one of them.
///
/// # Panics
/// When `axis` is not 0, 1 or 2.
#[must_use]
pub fn row_spacing_m(blade: &Blade, axis: usize) -> f64 {
    assert!(axis < 3, "axis {axis}");
    let half_m = half_extents_m(blade);
    let long_m = half_m[(axis + 1) % 3].max(half_m[(axis + 2) % 3]);
    2.0 * long_m / face_pairs(half_m, axis) as f64
}

fn half_extents_m(blade: &Blade) -> [f64; 3] {
    let extents_m = ToolShape::Blade(*blade).extents_m();
    extents_m.map(|extent_m| 0.5 * extent_m)
}

/// Area of a face of the box across `axis`, m².
fn face_m2(half_m: [f64; 3], axis: usize) -> f64 {
    4.0 * half_m[(axis + 1) % 3] * half_m[(axis + 2) % 3]
}

/// Points on the face across `axis`, in rows along its longer edge.
fn face_pairs(half_m: [f64; 3], axis: usize) -> usize {
    let largest_m2 = (0..3).map(|axis| face_m2(half_m, axis)).fold(0.0, f64::max);
    let count = (face_m2(half_m, axis) / largest_m2 * FACE_PAIRS as f64) as usize;
    count.max(LEAST_FACE_PAIRS)
}
