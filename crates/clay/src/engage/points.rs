//! Points spread over the surface of a tool, at which it feels clay.

use super::rod::RodFaces;
use crate::bake::Baked;
use crate::lanes::{F32x4, LANES};
use crate::tool::{Ball, Blade, Cylinder, ToolShape, WireLoop};

/// Pairs of points on a ball.
const BALL_PAIRS: usize = 128;
/// Pairs of points on the largest pair of faces of a blade, and the least on any.
const FACE_PAIRS: usize = 256;
const LEAST_FACE_PAIRS: usize = 96;
/// Rows of points along one half of a cylinder's wall, and points in each: a quarter of the way around apart, so that a
/// row counts for nearly the same whichever way the cylinder moves.
const WALL_ROWS: usize = 64;
const WALL_POINTS: usize = 4;
/// Pairs of points on a cylinder's ends.
const END_PAIRS: usize = 128;
/// Places along one half of a loop's ring, and points around the wire at each.
const RING_PLACES: usize = 32;
const WIRE_POINTS: usize = 8;
/// The golden ratio less one: the best known step for spreading points evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Cosine and sine of the golden angle, 2 pi (1 - GOLDEN).
const GOLDEN_ANGLE: (f64, f64) = (-0.737_368_878_078_319_9, 0.675_490_294_261_524);
/// Cosine and sine of half the step between places along a ring, pi / 64; of the step between points around a wire, an
/// eighth of a turn; and of the golden share of that, pi / 4 GOLDEN.
const HALF_RING_STEP: (f64, f64) = (0.9987954562051724, 0.049067674327418015);
const EIGHTH: (f64, f64) = (
    std::f64::consts::FRAC_1_SQRT_2,
    std::f64::consts::FRAC_1_SQRT_2,
);
const GOLDEN_EIGHTH: (f64, f64) = (0.8844871074293708, 0.4665646330265774);

/// A tool ready to feel clay: its shape with points spread over its surface. Built once, used every tick, on clay of
/// any voxel size.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    shape: ToolShape,
    faces: Faces,
}

/// Points spread over the surface of a solid.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Faces {
    pub(super) extents_m: [f64; 3],
    pub(super) middle_from_pose_m: [f64; 3],
    pub(super) pairs: Box<[FacePairs]>,
    /// Radius of a ball; `None` for other faces.
    pub(super) radius_m: Option<f64>,
    /// The rod that a cylinder or a loop removes.
    pub(super) rod: Option<RodFaces>,
    /// Whether each point has one opposite; if not, points that trail count for nothing.
    pub(super) are_mirrored: bool,
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
        let (pairs, radius_m, rod) = match &shape {
            ToolShape::Ball(ball) => (ball_pairs(ball), Some(ball.radius_m()), None),
            ToolShape::Blade(blade) => (blade_pairs(blade), None, None),
            ToolShape::Cylinder(cylinder) => {
                let rod = RodFaces::of_cylinder(cylinder);
                (cylinder_pairs(cylinder), None, Some(rod))
            }
            ToolShape::Loop(wire_loop) => {
                let rod = RodFaces::of_loop(wire_loop);
                (loop_pairs(wire_loop), None, Some(rod))
            }
        };
        let middle_from_pose_m = shape.middle_from_pose_m();
        let pairs = pairs.chunks(LANES).map(FacePairs::of).collect();
        let faces = Faces {
            extents_m: shape.extents_m(),
            middle_from_pose_m,
            pairs,
            radius_m,
            rod,
            are_mirrored: true,
        };
        Self { shape, faces }
    }

    pub(crate) const fn faces(&self) -> &Faces {
        &self.faces
    }

    /// The solid.
    #[must_use]
    pub const fn shape(&self) -> &ToolShape {
        &self.shape
    }
}

impl Faces {
    /// The points of a mesh, each by itself.
    pub(crate) fn of_mesh(baked: &Baked) -> Self {
        let [least, most] = baked.bounds_m;
        let middle_from_pose_m = std::array::from_fn(|axis| 0.5 * (least[axis] + most[axis]));
        let points: Vec<FacePair> = baked
            .samples
            .iter()
            .map(|sample| FacePair {
                offset_m: std::array::from_fn(|axis| {
                    sample.place_m[axis] - middle_from_pose_m[axis]
                }),
                normal: sample.normal,
                area_m2: sample.area_m2,
            })
            .collect();
        Self {
            extents_m: std::array::from_fn(|axis| most[axis] - least[axis]),
            middle_from_pose_m,
            pairs: points.chunks(LANES).map(FacePairs::of).collect(),
            radius_m: None,
            rod: None,
            are_mirrored: false,
        }
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
        (cosine, sine) = turned((cosine, sine), GOLDEN_ANGLE);
    }
    pairs
}

/// Points on the upper half of the wall and on the upper end; their opposites make up the rest.
fn cylinder_pairs(cylinder: &Cylinder) -> Vec<FacePair> {
    let (radius_m, half_m) = (cylinder.radius_m(), 0.5 * cylinder.height_m());
    let mut pairs = Vec::with_capacity(WALL_ROWS * WALL_POINTS + END_PAIRS);
    let (mut row, mut direction) = ((1.0, 0.0), (1.0, 0.0));
    let wall_m2 = 2.0 * std::f64::consts::PI * radius_m * half_m;
    for at in 0..WALL_ROWS {
        let z_m = half_m * (at as f64 + 0.5) / WALL_ROWS as f64;
        let (c, s) = row;
        for (x, y) in [(c, s), (-s, c), (-c, -s), (s, -c)] {
            pairs.push(FacePair {
                offset_m: [radius_m * x, radius_m * y, z_m],
                normal: [x, y, 0.0],
                area_m2: wall_m2 / (WALL_ROWS * WALL_POINTS) as f64,
            });
        }
        row = turned(row, GOLDEN_ANGLE);
    }
    // On a spiral of equal areas.
    let end_m2 = std::f64::consts::PI * radius_m * radius_m;
    for at in 0..END_PAIRS {
        let from_axis_m = radius_m * ((at as f64 + 0.5) / END_PAIRS as f64).sqrt();
        let (c, s) = direction;
        pairs.push(FacePair {
            offset_m: [from_axis_m * c, from_axis_m * s, half_m],
            normal: [0.0, 0.0, 1.0],
            area_m2: end_m2 / END_PAIRS as f64,
        });
        direction = turned(direction, GOLDEN_ANGLE);
    }
    pairs
}

/// Points about the wire along one half of the ring; their opposites make up the other half.
fn loop_pairs(wire_loop: &WireLoop) -> Vec<FacePair> {
    let (ring_m, wire_m) = (wire_loop.ring_radius_m(), 0.5 * wire_loop.wire_diameter_m());
    let mut pairs = Vec::with_capacity(RING_PLACES * WIRE_POINTS);
    // Places half a step from the y axis on, and points around the wire, turned by a golden step from place to place
    // so that together they are spread evenly around it.
    let mut place = turned((1.0, 0.0), HALF_RING_STEP);
    let mut about = (1.0, 0.0);
    let each = 2.0 * std::f64::consts::PI / WIRE_POINTS as f64;
    let step = std::f64::consts::PI / RING_PLACES as f64;
    for _ in 0..RING_PLACES {
        let mut around = about;
        for _ in 0..WIRE_POINTS {
            let (along_x, outward) = around;
            let from_axis_m = ring_m + wire_m * outward;
            pairs.push(FacePair {
                offset_m: [
                    wire_m * along_x,
                    from_axis_m * place.0,
                    from_axis_m * place.1,
                ],
                normal: [along_x, outward * place.0, outward * place.1],
                area_m2: from_axis_m * step * wire_m * each,
            });
            around = turned(around, EIGHTH);
        }
        place = turned(turned(place, HALF_RING_STEP), HALF_RING_STEP);
        about = turned(about, GOLDEN_EIGHTH);
    }
    pairs
}

/// A direction in a plane, by cosine and sine, turned by an angle.
fn turned((cosine, sine): (f64, f64), (c, s): (f64, f64)) -> (f64, f64) {
    let (cosine, sine) = (cosine * c - sine * s, sine * c + cosine * s);
    let length = (cosine * cosine + sine * sine).sqrt();
    (cosine / length, sine / length)
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
