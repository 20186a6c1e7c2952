//! A ball swept along a straight way: a capsule.

use super::way::Way;
use super::work::{MOST_GROUPS, ROWS, Tables};
use super::{Place, RAMP, SLACK, Solid, Spans, Start, left_over};
use crate::lanes::{Bytes, Floats, LANES};
use crate::tool::Ball;

/// Sweeps up to this long, in voxels, are bounded by one ball about their middle; longer ones are worth more thought.
const SHORT: f64 = 2.0;

/// The capsule in voxel units, voxel centres at whole numbers.
///
/// The distance of a voxel is that from the nearest point of the way, or from its end where rounding makes that the nearer one. So
/// a sweep never leaves more over than the ball at its end, and behind its start exactly what the ball there would: to skip a
/// ball already carved changes nothing, not even a last bit.
pub(super) struct BallSweep {
    radius: f32,
    /// What to add to a voxel's index to get the way to it from the start, the end and the middle.
    from: [f32; 3],
    to: [f32; 3],
    middle: [f32; 3],
    step: [f32; 3],
    per_step_squared: f32,
    reach: f64,
    /// Square of the radius about the middle beyond which a short sweep leaves everything; `None` for a long one.
    short_reach_squared: Option<f32>,
    /// Square of the radius about the start within which nothing can be left; `None` when nothing is known.
    clear_squared: Option<f32>,
    /// Generosity, in squared voxels, of comparisons along the way.
    along_slack: f32,
    /// Reciprocal of the step along x; 0 where it is too short to divide by.
    per_along_x: f32,
    /// Most that the way along x adds to the place along the step, where it is not divided by.
    most_along_x: f32,
    /// Most that the ways along x and y add.
    most_along_xy: f32,
    /// Place along the step, in squared voxels, past which only the end matters.
    end_only_from: f32,
    way_from: [f64; 3],
    way_step: [f64; 3],
    bounds: [[i32; 2]; 3],
}

impl BallSweep {
    pub(super) fn new(ball: &Ball, way: &Way, start: Start) -> Self {
        let radius = ball.radius_m() * way.per_metre;
        let step = way.step();
        let length_squared: f64 = step.iter().map(|d| d * d).sum();
        let length = length_squared.sqrt();
        let slack = SLACK + 8.0 * way.rounding;
        let reach = radius + RAMP + slack;
        let size = reach + length;
        let short_reach = reach + 0.5 * length;
        let clear = (radius - RAMP - slack).max(0.0);
        // Squares of distances are off by twice the distance times the coordinates' error, and by their own rounding.
        let along_slack = SLACK * length + size * (6.0 * way.rounding + 1e-6 * size);
        let divisible = along_slack < step[0].abs();
        let negated = |at: [f64; 3]| at.map(|at| -at as f32);
        Self {
            radius: radius as f32,
            from: negated(way.from),
            to: negated(way.to),
            middle: negated(way.middle()),
            step: step.map(|d| d as f32),
            per_step_squared: if 0.0 < length_squared {
                (1.0 / length_squared) as f32
            } else {
                0.0
            },
            reach,
            short_reach_squared: (length <= SHORT).then_some((short_reach * short_reach) as f32),
            clear_squared: (start == Start::Clear).then_some((clear * clear) as f32),
            along_slack: along_slack as f32,
            end_only_from: (length_squared + along_slack) as f32,
            per_along_x: if divisible {
                (1.0 / step[0]) as f32
            } else {
                0.0
            },
            most_along_xy: ((step[0].abs() + step[1].abs()) * size) as f32,
            most_along_x: if divisible {
                0.0
            } else {
                (step[0].abs() * size) as f32
            },
            way_from: way.from,
            way_step: step,
            bounds: way.bounds([reach; 3]),
        }
    }

    /// Where rows are within reach of the capsule; NaN where they are not.
    #[inline(always)]
    fn outer(&self, y: i32, z: i32) -> [Floats; 2] {
        let Some(reach_squared) = self.short_reach_squared else {
            return self.long_outer(y, z);
        };
        let dy = Floats::from(y) + Floats::splat(self.middle[1]);
        let dz = z as f32 + self.middle[2];
        let half = (Floats::splat(reach_squared - dz * dz) - dy * dy).sqrt();
        let middle_x = Floats::splat(-self.middle[0]);
        [middle_x - half, middle_x + half]
    }

    #[cold]
    fn long_outer(&self, y: i32, z: i32) -> [Floats; 2] {
        let (mut low, mut high) = ([f32::NAN; LANES], [f32::NAN; LANES]);
        for lane in 0..LANES {
            let y = f64::from(y + lane as i32);
            if let Some(span) = self.long_outer_of_row(y, f64::from(z)) {
                (low[lane], high[lane]) = span;
            }
        }
        [low, high].map(Floats::from_array)
    }

    /// The same for a long capsule: hull of what its end balls and its cylinder cover of the row.
    fn long_outer_of_row(&self, y: f64, z: f64) -> Option<(f32, f32)> {
        let [mx, my, mz] = self.way_step;
        let length_squared = mx * mx + my * my + mz * mz;
        let (wy, wz) = (y - self.way_from[1], z - self.way_from[2]);
        let reach_squared = self.reach * self.reach;
        let mut hull = (f64::INFINITY, f64::NEG_INFINITY);
        let mut include = |low: f64, high: f64| {
            if low <= high {
                hull = (hull.0.min(low), hull.1.max(high));
            }
        };
        for end in [0.0, 1.0] {
            let (dy, dz) = (wy - end * my, wz - end * mz);
            let rest = reach_squared - dy * dy - dz * dz;
            if 0.0 <= rest {
                include(end * mx - rest.sqrt(), end * mx + rest.sqrt());
            }
        }
        // Cylinder: |w|^2 - (w.m)^2 / |m|^2 <= reach^2 is a x^2 + 2 b x + c <= 0 along the row.
        let along_yz = wy * my + wz * mz;
        let a = (my * my + mz * mz) / length_squared;
        let b = -mx * along_yz / length_squared;
        let c = wy * wy + wz * wz - along_yz * along_yz / length_squared - reach_squared;
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        // A row nearly along the way: the distance hardly depends on x, and the slab below bounds it.
        if 1e-9 < a {
            let root = b * b - a * c;
            if root < 0.0 {
                (low, high) = (f64::INFINITY, f64::NEG_INFINITY);
            } else {
                (low, high) = ((-b - root.sqrt()) / a, (-b + root.sqrt()) / a);
            }
        }
        // Slab: 0 <= w.m <= |m|^2.
        if 1e-9 * length_squared < mx * mx {
            let ends = [-along_yz / mx, (length_squared - along_yz) / mx];
            low = low.max(ends[0].min(ends[1]));
            high = high.min(ends[0].max(ends[1]));
        }
        include(low, high);
        let (low, high) = hull;
        let from_x = self.way_from[0];
        (low <= high).then_some(((low + from_x) as f32, (high + from_x) as f32))
    }
}

impl Solid for BallSweep {
    fn bounds(&self) -> [[i32; 2]; 3] {
        self.bounds
    }

    #[inline(always)]
    fn skips_layer(&self, z: i32) -> bool {
        // All of it is behind the start, however far x and y reach ahead.
        let ahead = self.step[2] * (z as f32 + self.from[2]);
        self.clear_squared.is_some() && ahead + self.along_slack + self.most_along_xy < 0.0
    }

    fn prepare(&self, tables: &mut Tables, [start, end]: [i32; 2]) {
        for group in start..end {
            let first = group * LANES as i32;
            let last = first + LANES as i32 - 1;
            let to_x = Floats::from(first) + Floats::splat(self.to[0]);
            (to_x * to_x).store(&mut tables.columns[group as usize]);
            let [first, last] = [first, last].map(|x| self.step[0] * (x as f32 + self.from[0]));
            tables.column_bounds[group as usize] = if first < last { first } else { last };
        }
    }

    #[inline(always)]
    fn spans(&self, tables: &mut Tables, y: i32, z: i32, row: usize) -> Spans {
        let [mut low, mut high] = self.outer(y, z);
        let [_, along_y, along_z] = self.step;
        let from_y = Floats::from(y) + Floats::splat(self.from[1]);
        let from_z = z as f32 + self.from[2];
        let to_y = Floats::from(y) + Floats::splat(self.to[1]);
        let to_z = z as f32 + self.to[2];
        let ahead = from_y * Floats::splat(along_y) + Floats::splat(from_z * along_z);
        let to_squared = to_y * to_y + Floats::splat(to_z * to_z);
        let [row_ahead, row_squared] = &mut *tables.rows;
        ahead.store(&mut row_ahead.as_chunks_mut().0[row / LANES]);
        to_squared.store(&mut row_squared.as_chunks_mut().0[row / LANES]);
        let Some(clear_squared) = self.clear_squared else {
            return Spans {
                first: [low, high],
                second: [Floats::splat(f32::NAN); 2],
            };
        };
        // Behind the start, the end is farther than the start, whose ball is carved already: what is ahead has
        // along_x (x - from_x) + ahead > 0.
        let from_x = Floats::splat(-self.from[0]);
        let generous = ahead + Floats::splat(self.along_slack);
        if self.per_along_x < 0.0 {
            high = (from_x - generous * Floats::splat(self.per_along_x)).lesser(high);
        } else if 0.0 < self.per_along_x {
            low = (from_x - generous * Floats::splat(self.per_along_x)).greater(low);
        } else {
            let nowhere = Floats::splat(-self.most_along_x);
            high = generous.where_below(nowhere, Floats::splat(f32::NAN), high);
        }
        // NaN where the row misses what is clear: the first span is then whole, and leaves nothing to the second.
        let half = (Floats::splat(clear_squared - from_z * from_z) - from_y * from_y).sqrt();
        Spans {
            first: [low, (from_x - half).lesser(high)],
            second: [(from_x + half).greater(low), high],
        }
    }

    /// Past the end, by enough that rounding cannot say otherwise, only the end matters.
    #[inline(always)]
    fn leaves_at_most(&self, tables: &Tables, at: Place) -> (Bytes, bool) {
        let [ahead, _] = &*tables.rows;
        let place = tables.column_bounds[at.group % MOST_GROUPS] + ahead[at.row % ROWS];
        (
            self.left_over(from_end_squared(tables, at)),
            place < self.end_only_from,
        )
    }

    #[inline(always)]
    fn leaves(&self, tables: &Tables, at: Place) -> Bytes {
        let [ahead, _] = &*tables.rows;
        let nearest = self.nearest_squared(at.voxel, ahead[at.row % ROWS]);
        self.left_over(nearest.lesser(from_end_squared(tables, at)))
    }
}

/// Squared distances from the end of the way.
#[inline(always)]
fn from_end_squared(tables: &Tables, at: Place) -> Floats {
    let [_, row] = &*tables.rows;
    Floats::load(&tables.columns[at.group % MOST_GROUPS]) + Floats::splat(row[at.row % ROWS])
}

impl BallSweep {
    /// Squared distance from the nearest point of the way; from its end too, but for rounding.
    #[inline(always)]
    fn nearest_squared(&self, [x, y, z]: [i32; 3], ahead: f32) -> Floats {
        let from_x = Floats::from(x) + Floats::splat(self.from[0]);
        let (from_y, from_z) = (y as f32 + self.from[1], z as f32 + self.from[2]);
        let [along_x, along_y, along_z] = self.step;
        let along = from_x * Floats::splat(along_x) + Floats::splat(ahead);
        // Before the start this is the start itself, without rounding.
        let share = along * Floats::splat(self.per_step_squared);
        let share = share.greater(Floats::splat(0.0)).lesser(Floats::splat(1.0));
        let x = from_x - share * Floats::splat(along_x);
        let y = Floats::splat(from_y) - share * Floats::splat(along_y);
        let z = Floats::splat(from_z) - share * Floats::splat(along_z);
        x * x + (y * y + z * z)
    }

    /// What is left over at these squared distances from the way.
    #[inline(always)]
    fn left_over(&self, squared: Floats) -> Bytes {
        left_over(squared.sqrt() - Floats::splat(self.radius))
    }
}
