//! A blade swept along a straight way: the hull of two boxes.
//!
//! The hull of a box and its copy moved by `m` is bounded by the box's own six planes, each where its box is farther out, and by the
//! planes that contain an edge direction and `m`: three normals `e x m`, one for each axis `e`. The distance outside the hull is the greatest of
//! the distances outside these planes, that outside a box the greatest outside its six; a voxel counts by the least of hull and boxes,
//! which differ only outside the edges of the boxes.

use super::way::Way;
use super::work::{MOST_GROUPS, ROWS, Tables};
use super::{Place, RAMP, SLACK, Solid, Spans, Start, left_over};
use crate::lanes::{Bytes, Floats, LANES};
use crate::tool::{Blade, ToolShape};

/// The hull in voxel units, voxel centres at whole numbers.
///
/// Where a plane that does not advance decides, the distance is that of the box at the start to the last bit, which is what
/// makes it exact to look only at what the blade pushes ahead of itself.
pub(super) struct BladeSweep {
    half: [f32; 3],
    /// What to add to a voxel's index to get the way to it from the middle of the box at start and end, and of the hull.
    from: [f32; 3],
    to: [f32; 3],
    middle: [f32; 3],
    /// The same for the box whose lower, and whose upper plane bounds the hull along each axis.
    lower: [f32; 3],
    upper: [f32; 3],
    step: [f32; 3],
    /// The planes askew to the axes; none for a way along an axis.
    slabs: Option<[Slab; 3]>,
    /// Distance outside the hull from which on everything is left, and inside it from which on nothing is.
    reach: f32,
    slack: f32,
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
        let (from, to) = (negated(way.from), negated(way.to));
        let slack = SLACK + 8.0 * way.rounding;
        let reach = RAMP + slack;
        let along_axes = step.iter().filter(|&&d| d.abs() <= 0.0).count();
        Self {
            half: half.map(|half| half as f32),
            from,
            to,
            middle: negated(way.middle()),
            lower: std::array::from_fn(|axis| {
                if step[axis] < 0.0 {
                    to[axis]
                } else {
                    from[axis]
                }
            }),
            upper: std::array::from_fn(|axis| {
                if 0.0 < step[axis] {
                    to[axis]
                } else {
                    from[axis]
                }
            }),
            step: step.map(|d| d as f32),
            slabs: (along_axes < 2)
                .then(|| std::array::from_fn(|axis| Slab::along(axis, step, half))),
            reach: reach as f32,
            slack: slack as f32,
            start,
            bounds: way.bounds(half.map(|half| half + reach)),
        }
    }

    /// Distance outside the hull's two planes across an axis.
    #[inline(always)]
    fn outside(&self, axis: usize, at: Floats) -> Floats {
        let half = Floats::splat(self.half[axis]);
        let above = at + Floats::splat(self.upper[axis]) - half;
        let below = Floats::splat(0.0) - (at + Floats::splat(self.lower[axis])) - half;
        above.greater(below)
    }

    /// Distances outside the planes of the box at the start across an axis: those that advance, and those that do not.
    #[inline(always)]
    fn advancing(&self, axis: usize, at: Floats) -> [Floats; 2] {
        let way = at + Floats::splat(self.from[axis]);
        let half = Floats::splat(self.half[axis]);
        let (above, below) = (way - half, Floats::splat(0.0) - way - half);
        if self.step[axis] < 0.0 {
            [below, above]
        } else if 0.0 < self.step[axis] {
            [above, below]
        } else {
            [Floats::splat(f32::NEG_INFINITY), above.greater(below)]
        }
    }

    /// Distance outside the box whose middle is at `-offset`.
    #[inline(always)]
    fn outside_box(&self, offset: &[f32; 3], [x, y, z]: [Floats; 3]) -> Floats {
        let outside = |at: Floats, axis: usize| {
            (at + Floats::splat(offset[axis])).abs() - Floats::splat(self.half[axis])
        };
        outside(x, 0).greater(outside(y, 1)).greater(outside(z, 2))
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

    /// Place along the normal.
    #[inline(always)]
    fn along_normal(&self, [x, y, z]: [Floats; 3]) -> Floats {
        let [nx, ny, nz] = self.normal.map(Floats::splat);
        nx * x + (ny * y + nz * z)
    }
}

impl Solid for BladeSweep {
    fn bounds(&self) -> [[i32; 2]; 3] {
        self.bounds
    }

    fn skips_layer(&self, _z: i32) -> bool {
        false
    }

    fn prepare(&self, tables: &mut Tables, [start, end]: [i32; 2]) {
        for group in start..end {
            let x = Floats::from(group * LANES as i32);
            self.outside(0, x)
                .store(&mut tables.columns[group as usize]);
        }
    }

    #[inline(always)]
    fn spans(&self, tables: &mut Tables, y: i32, z: i32, row: usize) -> Spans {
        let nothing = Floats::splat(f32::NAN);
        let (reach, slack) = (Floats::splat(self.reach), Floats::splat(self.slack));
        let (y, z) = (Floats::from(y), Floats::splat(z as f32));
        let hull_yz = self.outside(1, y).greater(self.outside(2, z));
        hull_yz.store(&mut tables.rows[0].as_chunks_mut().0[row / LANES]);

        let (lower_x, upper_x) = (Floats::splat(-self.lower[0]), Floats::splat(-self.upper[0]));
        let half_x = Floats::splat(self.half[0]);
        let mut low = lower_x - half_x - reach;
        let mut high = upper_x + half_x + reach;
        for slab in self.slabs.iter().flatten() {
            // Against a slope this slight, a row would be cut far away, and rounding errors with it.
            if slab.normal[0].abs() < 1e-3 {
                continue;
            }
            let middle = [
                Floats::splat(0.0),
                y + Floats::splat(self.middle[1]),
                z + Floats::splat(self.middle[2]),
            ];
            let per_slope = 1.0 / slab.normal[0];
            let centre = slab.along_normal(middle) * Floats::splat(-per_slope)
                - Floats::splat(self.middle[0]);
            // A voxel within reach of an end box's planes may be this much farther from a plane through its edge.
            let within = slab.half + std::f32::consts::SQRT_2 * self.reach;
            let within = Floats::splat(within * per_slope.abs());
            low = low.greater(centre - within);
            high = high.lesser(centre + within);
        }
        high = reach.where_below(hull_yz, nothing, high);
        if self.start == Start::Unknown {
            return Spans {
                first: [low, high],
                second: [nothing; 2],
            };
        }

        // A voxel changes only if, seen from the box at the start, a plane that advances is the farthest.
        let [[ahead_y, still_y], [ahead_z, still_z]] = [self.advancing(1, y), self.advancing(2, z)];
        let (ahead, still) = (ahead_y.greater(ahead_z), still_y.greater(still_z));
        let zero = Floats::splat(0.0);
        // Along x, in the direction of the step: past the middle or where y and z have it over the trailing plane...
        let past = (zero - half_x - ahead).lesser(zero);
        // ...and where y and z are behind, as far as the leading plane needs to have it over them.
        let past = ahead.where_below(still - slack, past.greater(half_x + still), past) - slack;
        let from_x = Floats::splat(-self.from[0]);
        if self.step[0] < 0.0 {
            high = (from_x - past).lesser(high);
        } else if 0.0 < self.step[0] {
            low = (from_x + past).greater(low);
        } else {
            high = ahead.where_below(still - slack, nothing, high);
        }
        // Deep inside the box at the start nothing is left. NaN where the row misses that: the first span is then
        // whole, and leaves nothing to the second.
        let deep = ahead
            .greater(still)
            .where_below(zero - reach, half_x - reach, nothing);
        let deep = zero.where_below(deep, deep, nothing);
        Spans {
            first: [low, (from_x - deep).lesser(high)],
            second: [(from_x + deep).greater(low), high],
        }
    }

    #[inline(always)]
    fn leaves_at_most(&self, tables: &Tables, at: Place) -> (Bytes, bool) {
        (self.leaves(tables, at), false)
    }

    #[inline(always)]
    fn leaves(
        &self,
        tables: &Tables,
        Place {
            voxel: [x, y, z],
            row,
            group,
        }: Place,
    ) -> Bytes {
        let hull = Floats::load(&tables.columns[group % MOST_GROUPS])
            .greater(Floats::splat(tables.rows[0][row % ROWS]));
        let Some(slabs) = &self.slabs else {
            return left_over(hull);
        };
        let at = [
            Floats::from(x),
            Floats::splat(y as f32),
            Floats::splat(z as f32),
        ];
        let middle = std::array::from_fn(|axis| at[axis] + Floats::splat(self.middle[axis]));
        let mut hull = hull;
        for slab in slabs {
            hull = hull.greater(slab.along_normal(middle).abs() - Floats::splat(slab.half));
        }
        // The hull lies about both boxes, but for rounding and outside their edges.
        let ends = self
            .outside_box(&self.from, at)
            .lesser(self.outside_box(&self.to, at));
        left_over(hull.lesser(ends))
    }
}
