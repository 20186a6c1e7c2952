//! A ball swept along a straight way: a capsule.

use super::lanes::{LANES, greater, left_over, lesser, places, span_within};
use super::{RAMP, Row, SLACK, Solid, Start, Way};
use crate::tool::Ball;

/// Sweeps up to this long, in voxels, are bounded by one ball about their middle; longer ones are worth more thought.
const SHORT: f64 = 2.0;

/// The capsule in voxel units, voxel centres at whole numbers.
///
/// The distance of a voxel is the least of three: to the ball at the start, to the ball at the end and, between them, to
/// the cylinder. With the least taken literally, rounding can never make a sweep leave more over than either of its end
/// balls would, which is what makes skipping a ball already carved exact.
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
    way_from: [f64; 3],
    way_step: [f64; 3],
    bounds: [[i32; 2]; 3],
}

pub(super) struct BallRow {
    radius: f32,
    from_x: f32,
    to_x: f32,
    /// Squared distances of the row from the start and the end.
    from_squared: f32,
    to_squared: f32,
    from_yz: [f32; 2],
    step: [f32; 3],
    /// The part of the place along the way that is the same for the whole row.
    along_yz: f32,
    per_step_squared: f32,
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
            along_slack: (SLACK * length + size * (8.0 * way.rounding + 2e-6 * size)) as f32,
            way_from: way.from,
            way_step: step,
            bounds: way.bounds([reach; 3]),
        }
    }

    /// Where the row is within reach of the capsule.
    fn outer(&self, y: i32, z: i32) -> Option<(f32, f32)> {
        let Some(reach_squared) = self.short_reach_squared else {
            return self.long_outer(f64::from(y), f64::from(z));
        };
        let (dy, dz) = (y as f32 + self.middle[1], z as f32 + self.middle[2]);
        let rest = reach_squared - (dy * dy + dz * dz);
        if rest <= 0.0 {
            return None;
        }
        let half = rest.sqrt();
        Some((-self.middle[0] - half, half - self.middle[0]))
    }

    /// The same for a long capsule: hull of what its end balls and its cylinder cover of the row.
    fn long_outer(&self, y: f64, z: f64) -> Option<(f32, f32)> {
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
    type Row = BallRow;

    fn bounds(&self) -> [[i32; 2]; 3] {
        self.bounds
    }

    #[inline]
    fn row(&self, y: i32, z: i32) -> Option<(BallRow, [[i32; 2]; 2])> {
        let (mut low, mut high) = self.outer(y, z)?;
        let from_yz = [y as f32 + self.from[1], z as f32 + self.from[2]];
        let to_yz = [y as f32 + self.to[1], z as f32 + self.to[2]];
        let along_yz = from_yz[0] * self.step[1] + from_yz[1] * self.step[2];
        let row = BallRow {
            radius: self.radius,
            from_x: self.from[0],
            to_x: self.to[0],
            from_squared: from_yz[0] * from_yz[0] + from_yz[1] * from_yz[1],
            to_squared: to_yz[0] * to_yz[0] + to_yz[1] * to_yz[1],
            from_yz,
            step: self.step,
            along_yz,
            per_step_squared: self.per_step_squared,
        };
        let Some(clear_squared) = self.clear_squared else {
            return Some((row, [span_within(low, high), [0, 0]]));
        };
        // Behind the start, the end is farther than the start, whose ball is carved already.
        let [mx, ..] = self.step;
        let reach_along = self.along_slack + along_yz;
        if self.along_slack < mx.abs() {
            let edge = -reach_along / mx - self.from[0];
            if 0.0 < mx {
                low = greater(low, edge);
            } else {
                high = lesser(high, edge);
            }
        } else {
            let (a, b) = (mx * (low + self.from[0]), mx * (high + self.from[0]));
            if reach_along + greater(a, b) < 0.0 {
                return None;
            }
        }
        if high <= low {
            return None;
        }
        let rest = clear_squared - row.from_squared;
        if rest <= 0.0 {
            return Some((row, [span_within(low, high), [0, 0]]));
        }
        let half = rest.sqrt();
        let (clear_low, clear_high) = (-self.from[0] - half, half - self.from[0]);
        let front = span_within(low, lesser(high, clear_low));
        let back = span_within(greater(low, clear_high), high);
        Some((row, [front, [back[0].max(front[1]), back[1]]]))
    }
}

impl Row for BallRow {
    #[inline]
    fn leaves(&self, x: i32) -> [u8; LANES] {
        let from = places(x, self.from_x);
        let to = places(x, self.to_x);
        let distances = std::array::from_fn(|lane| {
            let ends = lesser(
                from[lane] * from[lane] + self.from_squared,
                to[lane] * to[lane] + self.to_squared,
            );
            let along = (from[lane] * self.step[0] + self.along_yz) * self.per_step_squared;
            let across = [
                from[lane] - along * self.step[0],
                self.from_yz[0] - along * self.step[1],
                self.from_yz[1] - along * self.step[2],
            ];
            let side = across[0] * across[0] + across[1] * across[1] + across[2] * across[2];
            let beside = 0.0 < along && along < 1.0;
            let nearest = lesser(if beside { side } else { ends }, ends);
            nearest.sqrt() - self.radius
        });
        left_over(distances)
    }
}
