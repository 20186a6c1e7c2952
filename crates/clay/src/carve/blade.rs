//! A blade swept along a straight way: the hull of two boxes.
//!
//! The hull of a box and its copy moved by `m` is bounded by the box's own planes, moved apart by `|m|`, and by the planes
//! that contain an edge direction and `m`: three normals `e x m`, one for each axis `e`. The distance outside is the greatest of the
//! distances outside the slabs between opposite planes.

use super::{RAMP, SLACK, Solid, Spans, Start, Tables, Way, left_over};
use crate::lanes::{Bytes, Floats};
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
    /// Distance outside the hull from which on everything is left, and inside it from which on nothing is.
    reach: f32,
    start: Start,
    bounds: [[i32; 2]; 3],
}

/// The slab `|normal . w| <= half` about the hull's middle; one without a normal bounds nothing.
#[derive(Clone, Copy)]
struct Slab {
    normal: [f32; 3],
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
            start,
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

    /// The part of the distance along the normal that y and z make up.
    #[inline(always)]
    fn offset(&self, y: Floats, z: Floats) -> Floats {
        Floats::splat(self.normal[1]) * y + Floats::splat(self.normal[2]) * z
    }
}

/// Distance outside the four planes of a box that run along x.
#[inline(always)]
fn outside_yz(y: Floats, z: Floats, half: &[f32; 3]) -> Floats {
    (y.abs() - Floats::splat(half[1])).greater(z.abs() - Floats::splat(half[2]))
}

/// Distance outside the two planes of a box that run across x.
#[inline(always)]
fn outside_x(x: Floats, half: &[f32; 3]) -> Floats {
    x.abs() - Floats::splat(half[0])
}

impl Solid for BladeSweep {
    fn bounds(&self) -> [[i32; 2]; 3] {
        self.bounds
    }

    fn rows_at(&self, _z: i32, rows: [i32; 2]) -> [i32; 2] {
        rows
    }

    fn prepare(&self, _tables: &mut Tables, _groups: [i32; 2]) {}

    #[inline(always)]
    fn spans(&self, _tables: &mut Tables, y: i32, z: i32, _row: usize) -> Spans {
        let nothing = Floats::splat(f32::NAN);
        let [along_x, ..] = &self.slabs;
        let middle_y = Floats::from(y) + Floats::splat(self.middle[1]);
        let middle_z = Floats::splat(z as f32 + self.middle[2]);
        let reach = self.hull_half[0] + self.reach;
        let (mut low, mut high) = (Floats::splat(-reach), Floats::splat(reach));
        for slab in &self.slabs[1..] {
            // Against a slope this slight, a row would be cut far away, and rounding errors with it.
            if slab.normal[0].abs() < 1e-3 {
                continue;
            }
            let per_slope = 1.0 / slab.normal[0];
            let centre = slab.offset(middle_y, middle_z) * Floats::splat(-per_slope);
            let reach = Floats::splat((slab.half + self.reach) * per_slope.abs());
            low = low.greater(centre - reach);
            high = high.lesser(centre + reach);
        }
        let hull = outside_yz(middle_y, middle_z, &self.hull_half)
            .greater(along_x.offset(middle_y, middle_z).abs() - Floats::splat(along_x.half));
        let middle_x = Floats::splat(-self.middle[0]);
        let low = middle_x + low;
        let high = Floats::splat(self.reach).where_below(hull, nothing, middle_x + high);
        let inside = self.half[0] - self.reach;
        if self.start == Start::Unknown || inside <= 0.0 {
            return Spans {
                first: [low, high],
                second: [nothing; 2],
            };
        }
        let from_x = Floats::splat(-self.from[0]);
        let from_y = Floats::from(y) + Floats::splat(self.from[1]);
        let from_z = Floats::splat(z as f32 + self.from[2]);
        // NaN where the row misses what is clear: the first span is then whole, and leaves nothing to the second.
        let inside = outside_yz(from_y, from_z, &self.half).where_below(
            Floats::splat(-self.reach),
            Floats::splat(inside),
            nothing,
        );
        Spans {
            first: [low, (from_x - inside).lesser(high)],
            second: [(from_x + inside).greater(low), high],
        }
    }

    #[inline(always)]
    fn leaves(&self, _tables: &Tables, [x, y, z]: [i32; 3], _row: usize) -> Bytes {
        let way_from = |offset: &[f32; 3]| {
            (
                Floats::from(x) + Floats::splat(offset[0]),
                Floats::splat(y as f32 + offset[1]),
                Floats::splat(z as f32 + offset[2]),
            )
        };
        let outside = |(x, y, z): (Floats, Floats, Floats), half: &[f32; 3]| {
            outside_x(x, half).greater(outside_yz(y, z, half))
        };
        let middle = way_from(&self.middle);
        let mut hull = outside(middle, &self.hull_half);
        for slab in &self.slabs {
            let along = Floats::splat(slab.normal[0]) * middle.0 + slab.offset(middle.1, middle.2);
            hull = hull.greater(along.abs() - Floats::splat(slab.half));
        }
        let ends = outside(way_from(&self.from), &self.half)
            .lesser(outside(way_from(&self.to), &self.half));
        left_over(hull.lesser(ends))
    }
}
