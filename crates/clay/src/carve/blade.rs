//! A blade swept along a straight way: the hull of two boxes.
//!
//! The hull of a box and its copy moved by `m` is bounded by the box's own planes, moved apart by `|m|`, and by the planes
//! that contain an edge direction and `m`: three normals `e x m`, one for each axis `e`. The distance outside is the greatest of the
//! distances outside the slabs between opposite planes.

use super::lanes::{LANES, greater, left_over, lesser, places, span_within};
use super::{RAMP, Row, SLACK, Solid, Start, Way};
use crate::tool::{Blade, ToolShape};

/// The hull in voxel units, voxel centres at whole numbers.
pub(super) struct BladeSweep {
    /// Half extents of the box, and of the hull's bounding box.
    half: [f32; 3],
    hull_half: [f32; 3],
    /// What to add to a voxel's index to get the way to it from the middle of the box at start and end, and of the hull.
    from: [f32; 3],
    to: [f32; 3],
    middle: [f32; 3],
    slabs: [Slab; 3],
    /// Distance outside the hull from which on everything is left.
    reach: f32,
    /// Distance inside the box at the start beyond which nothing can be left; `None` when nothing is known.
    clear: Option<f32>,
    bounds: [[i32; 2]; 3],
}

/// The slab `|normal . w| <= half` about the hull's middle; one without a normal bounds nothing.
#[derive(Clone, Copy)]
struct Slab {
    normal: [f32; 3],
    half: f32,
}

pub(super) struct BladeRow {
    half_x: f32,
    hull_half_x: f32,
    from_x: f32,
    to_x: f32,
    middle_x: f32,
    /// Distances outside the planes that run along the row: of the hull, and of the box at start and end.
    hull_yz: f32,
    from_yz: f32,
    to_yz: f32,
    oblique: [Oblique; 2],
}

/// A slab along one row: `|slope * w + offset| - half`.
#[derive(Clone, Copy)]
struct Oblique {
    slope: f32,
    offset: f32,
    half: f32,
}

impl BladeSweep {
    pub(super) fn new(blade: &Blade, way: &Way, start: Start) -> Self {
        let shape = ToolShape::Blade(*blade);
        let half = shape
            .extents_m()
            .map(|extent_m| 0.5 * extent_m * way.per_metre);
        let lift = shape
            .middle_from_pose_m()
            .map(|offset_m| offset_m * way.per_metre);
        let way = way.shifted(lift);
        let step = way.step();
        let negated = |at: [f64; 3]| at.map(|at| -at as f32);
        let slack = SLACK + 8.0 * way.rounding;
        let reach = RAMP + slack;
        Self {
            half: half.map(|half| half as f32),
            hull_half: std::array::from_fn(|axis| (half[axis] + 0.5 * step[axis].abs()) as f32),
            from: negated(way.from),
            to: negated(way.to),
            middle: negated(way.middle()),
            slabs: std::array::from_fn(|axis| Slab::along(axis, step, half)),
            reach: reach as f32,
            clear: (start == Start::Clear).then_some(reach as f32),
            bounds: way.bounds(half.map(|half| half + reach)),
        }
    }
}

impl Slab {
    /// The slab whose planes contain the axis' direction and the step.
    fn along(axis: usize, step: [f64; 3], half: [f64; 3]) -> Self {
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let length = (step[a] * step[a] + step[b] * step[b]).sqrt();
        let mut normal = [0.0; 3];
        if length <= 0.0 {
            return Self { normal, half: 0.0 };
        }
        let (na, nb) = (step[b] / length, -step[a] / length);
        normal[a] = na as f32;
        normal[b] = nb as f32;
        Self {
            normal,
            half: (na.abs() * half[a] + nb.abs() * half[b]) as f32,
        }
    }

    /// Distance outside for a slab whose planes run along x.
    fn outside(&self, y: f32, z: f32) -> f32 {
        (self.normal[1] * y + self.normal[2] * z).abs() - self.half
    }
}

impl Solid for BladeSweep {
    type Row = BladeRow;

    fn bounds(&self) -> [[i32; 2]; 3] {
        self.bounds
    }

    #[inline]
    fn row(&self, y: i32, z: i32) -> Option<(BladeRow, [[i32; 2]; 2])> {
        let at = |offset: &[f32; 3]| (y as f32 + offset[1], z as f32 + offset[2]);
        let outside =
            |(y, z): (f32, f32), half: &[f32; 3]| greater(y.abs() - half[1], z.abs() - half[2]);
        let middle = at(&self.middle);
        let [along_x, along_y, along_z] = &self.slabs;
        let hull_yz = greater(
            outside(middle, &self.hull_half),
            along_x.outside(middle.0, middle.1),
        );
        if self.reach < hull_yz {
            return None;
        }
        let oblique = [along_y, along_z].map(|slab| Oblique {
            slope: slab.normal[0],
            offset: slab.normal[1] * middle.0 + slab.normal[2] * middle.1,
            half: slab.half,
        });
        let row = BladeRow {
            half_x: self.half[0],
            hull_half_x: self.hull_half[0],
            from_x: self.from[0],
            to_x: self.to[0],
            middle_x: self.middle[0],
            hull_yz,
            from_yz: outside(at(&self.from), &self.half),
            to_yz: outside(at(&self.to), &self.half),
            oblique,
        };
        let half = self.hull_half[0] + self.reach;
        let (mut low, mut high) = (-half, half);
        for Oblique {
            slope,
            offset,
            half,
        } in oblique
        {
            // A slope this slight would divide rounding errors; the slab then bounds the row hardly at all.
            if slope.abs() < 1e-3 {
                continue;
            }
            let (a, b) = (
                (-half - self.reach - offset) / slope,
                (half + self.reach - offset) / slope,
            );
            low = greater(low, lesser(a, b));
            high = lesser(high, greater(a, b));
        }
        if high <= low {
            return None;
        }
        let (low, high) = (low - self.middle[0], high - self.middle[0]);
        let whole = (row, [span_within(low, high), [0, 0]]);
        let Some(clear) = self.clear else {
            return Some(whole);
        };
        let inside = self.half[0] - clear;
        if -clear < whole.0.from_yz || inside <= 0.0 {
            return Some(whole);
        }
        let front = span_within(low, lesser(high, -self.from[0] - inside));
        let back = span_within(greater(low, inside - self.from[0]), high);
        Some((whole.0, [front, [back[0].max(front[1]), back[1]]]))
    }
}

impl Row for BladeRow {
    #[inline]
    fn leaves(&self, x: i32) -> [u8; LANES] {
        let from = places(x, self.from_x);
        let to = places(x, self.to_x);
        let middle = places(x, self.middle_x);
        let [a, b] = self.oblique;
        left_over(std::array::from_fn(|lane| {
            let hull = greater(middle[lane].abs() - self.hull_half_x, self.hull_yz);
            let hull = greater(hull, (a.slope * middle[lane] + a.offset).abs() - a.half);
            let hull = greater(hull, (b.slope * middle[lane] + b.offset).abs() - b.half);
            let start = greater(from[lane].abs() - self.half_x, self.from_yz);
            let end = greater(to[lane].abs() - self.half_x, self.to_yz);
            lesser(hull, lesser(start, end))
        }))
    }
}
