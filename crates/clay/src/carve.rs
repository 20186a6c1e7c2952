//! Cutting: field <- min(field, what the swept solid leaves over).
//!
//! A sweep leaves over, in a voxel whose centre is at the signed distance `g` outside the swept solid, the share
//!
//! ```text
//! clamp(1/2 + g / 2h) * 255, rounded to nearest, ties to even
//! ```
//!
//! a ramp two voxels wide with the solid's surface in its middle, so that the surface can be found again between voxels.
//! The share is a function of the sweep and the voxel's index alone. Only additions, multiplications, divisions, square roots
//! and comparisons in IEEE single and double precision go into it, each rounded on its own, so every machine gets the
//! same bits.
//!
//! Which voxels are looked at is bounded row by row, generously: looking at more voxels than necessary never changes the
//! result, and a voxel left out is one whose share is provably not below what is there.

mod ball;
mod blade;
mod lanes;

use crate::changes::Changes;
use crate::field::{Brick, Field, SOLID};
use crate::grid::BRICK_EDGE;
use crate::pose::STEPS_PER_METRE;
use crate::sweep::Sweep;
use crate::tool::ToolShape;

use ball::BallSweep;
use blade::BladeSweep;
use lanes::LANES;

/// Half width of the ramp from air to solid, in voxels.
const RAMP: f64 = 1.0;
/// By how much spans are drawn generously, in voxels, beyond what rounding in single precision asks for.
const SLACK: f64 = 0.01;
/// Relative rounding error of single precision, with room for a handful of operations.
const SINGLE_ERROR: f64 = 1e-6;

const EDGE: i32 = BRICK_EDGE as i32;

/// What is known about the clay before a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    /// Nothing.
    Unknown,
    /// The same solid was carved at the sweep's start and nothing was put back since.
    Clear,
}

/// Removes what the sweep passes through; returns how many 1/255 of a voxel that was. Allocates nothing.
pub(crate) fn carve(field: &mut Field, changes: &mut Changes, sweep: &Sweep, start: Start) -> u64 {
    let way = Way::new(sweep, field.grid().voxel_size_m());
    match &sweep.shape {
        ToolShape::Ball(ball) => carve_solid(field, changes, &BallSweep::new(ball, &way, start)),
        ToolShape::Blade(blade) => {
            carve_solid(field, changes, &BladeSweep::new(blade, &way, start))
        }
    }
}

/// A sweep's poses in voxels, with voxel centres at whole numbers.
struct Way {
    from: [f64; 3],
    to: [f64; 3],
    per_metre: f64,
    /// Bound on the rounding error of single-precision coordinates along this way, in voxels.
    rounding: f64,
}

impl Way {
    fn new(sweep: &Sweep, voxel_size_m: f64) -> Self {
        let per_metre = 1.0 / voxel_size_m;
        let per_step = per_metre / STEPS_PER_METRE;
        let in_voxels = |steps: [i32; 3]| steps.map(|step| f64::from(step) * per_step - 0.5);
        let (from, to) = (in_voxels(sweep.from.steps()), in_voxels(sweep.to.steps()));
        let far = from
            .iter()
            .chain(&to)
            .fold(512.0, |far: f64, at| far.max(at.abs()));
        Self {
            from,
            to,
            per_metre,
            rounding: far * SINGLE_ERROR,
        }
    }

    /// The way of a point of the tool that is this far from its pose, in voxels.
    fn shifted(&self, offset: [f64; 3]) -> Self {
        let shift = |at: [f64; 3]| std::array::from_fn(|axis| at[axis] + offset[axis]);
        Self {
            from: shift(self.from),
            to: shift(self.to),
            ..*self
        }
    }

    fn step(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.to[axis] - self.from[axis])
    }

    fn middle(&self) -> [f64; 3] {
        std::array::from_fn(|axis| 0.5 * (self.from[axis] + self.to[axis]))
    }

    /// Voxels within `reach` of the way along each axis, from the first up to but not including the last.
    fn bounds(&self, reach: [f64; 3]) -> [[i32; 2]; 3] {
        // Grids end far below 1000, so clamping there loses nothing and keeps the conversion exact.
        let index = |at: f64| at.clamp(-1.0, 1000.0) as i32;
        std::array::from_fn(|axis| {
            let (a, b) = (self.from[axis], self.to[axis]);
            [
                index(a.min(b) - reach[axis]),
                index(a.max(b) + reach[axis] + 1.0),
            ]
        })
    }
}

/// A swept solid, ready to cut one grid.
trait Solid {
    type Row: Row;

    /// Voxels that can be affected, along each axis from the first up to but not including the last.
    fn bounds(&self) -> [[i32; 2]; 3];

    /// The row of voxels at `y`, `z`, and which of its voxels may change: two spans, from the first up to but not
    /// including the last. `None` if none may.
    fn row(&self, y: i32, z: i32) -> Option<(Self::Row, [[i32; 2]; 2])>;
}

/// What a swept solid leaves over along one row of voxels.
trait Row {
    /// Occupancies left over in the voxels `x` to `x + LANES`.
    fn leaves(&self, x: i32) -> [u8; LANES];
}

fn carve_solid<S: Solid>(field: &mut Field, changes: &mut Changes, solid: &S) -> u64 {
    let voxels = field.grid().voxels().map(i32::from);
    let bounds = solid.bounds();
    let [xs, ys, zs]: [[i32; 2]; 3] =
        std::array::from_fn(|axis| [bounds[axis][0].max(0), bounds[axis][1].min(voxels[axis])]);
    if xs[1] <= xs[0] || ys[1] <= ys[0] || zs[1] <= zs[0] {
        return 0;
    }
    let [bricks_x, bricks_y, _] = field.grid().bricks().map(usize::from);
    let revision = changes.upcoming();
    let before = field.total();
    let last_brick = |end: i32| (end - 1) / EDGE;
    for brick_z in zs[0] / EDGE..=last_brick(zs[1]) {
        for brick_y in ys[0] / EDGE..=last_brick(ys[1]) {
            let first = (brick_z as usize * bricks_y + brick_y as usize) * bricks_x;
            let along = first + (xs[0] / EDGE) as usize..=first + last_brick(xs[1]) as usize;
            if along
                .into_iter()
                .all(|brick| field.brick(brick) == Brick::Empty)
            {
                continue;
            }
            for z in zs[0].max(brick_z * EDGE)..zs[1].min((brick_z + 1) * EDGE) {
                for y in ys[0].max(brick_y * EDGE)..ys[1].min((brick_y + 1) * EDGE) {
                    let Some((row, spans)) = solid.row(y, z) else {
                        continue;
                    };
                    let at = RowAt {
                        first,
                        offset: ((z % EDGE * EDGE + y % EDGE) * EDGE) as usize,
                    };
                    for span in spans {
                        let span = [span[0].max(xs[0]), span[1].min(xs[1])];
                        carve_span(field, changes, revision, &row, at, span);
                    }
                }
            }
        }
    }
    before - field.total()
}

/// Where a row of voxels is stored: the first of the bricks it runs through, and its place in each of them.
#[derive(Clone, Copy)]
struct RowAt {
    first: usize,
    offset: usize,
}

#[inline]
fn carve_span<R: Row>(
    field: &mut Field,
    changes: &mut Changes,
    revision: u64,
    row: &R,
    at: RowAt,
    span: [i32; 2],
) {
    let mut x = span[0];
    while x < span[1] {
        let brick_x = x / EDGE;
        let end = span[1].min((brick_x + 1) * EDGE);
        let brick = at.first + brick_x as usize;
        let removed = carve_row(field, brick, row, at.offset, [x, end]);
        if 0 < removed {
            field.book_removal(brick, removed);
            changes.mark(brick, revision);
        }
        x = end;
    }
}

/// Cuts one row of one brick and returns what was removed.
#[inline]
fn carve_row<R: Row>(
    field: &mut Field,
    brick: usize,
    row: &R,
    offset: usize,
    span: [i32; 2],
) -> u32 {
    let slot = match field.brick(brick) {
        Brick::Empty => return 0,
        Brick::Full => {
            let left = leaves_over(row, span);
            if left == [SOLID; BRICK_EDGE] {
                return 0;
            }
            field.materialise(brick)
        }
        Brick::Slot(slot) => slot,
    };
    let (rows, _) = field.slot_mut(slot).as_chunks_mut::<BRICK_EDGE>();
    let cells = &mut rows[offset / BRICK_EDGE];
    let old = u128::from_le_bytes(*cells);
    if old == 0 {
        return 0;
    }
    let left = leaves_over(row, span);
    for (cell, left) in cells.iter_mut().zip(left) {
        *cell = (*cell).min(left);
    }
    // No byte grew, so the difference of the words is the difference of their bytes.
    byte_sum(old - u128::from_le_bytes(*cells))
}

/// What the sweep leaves over in a row of a brick; solid outside the span's groups of lanes.
#[inline]
fn leaves_over<R: Row>(row: &R, span: [i32; 2]) -> [u8; BRICK_EDGE] {
    let mut left = [SOLID; BRICK_EDGE];
    let (groups, _) = left.as_chunks_mut::<LANES>();
    let lanes = LANES as i32;
    let mut x = span[0] - span[0] % lanes;
    while x < span[1] {
        groups[(x % EDGE / lanes) as usize] = row.leaves(x);
        x += lanes;
    }
    left
}

/// Sum of the sixteen bytes of a word.
#[inline]
fn byte_sum(word: u128) -> u32 {
    const EVEN: u128 = 0x00FF_00FF_00FF_00FF_00FF_00FF_00FF_00FF;
    let pairs = (word & EVEN) + ((word >> 8) & EVEN);
    // Eight sums of at most 510: folding two halves of 64 bits keeps them below 1021, and the product below gathers four.
    let folded = (pairs >> 64) as u64 + pairs as u64;
    (folded.wrapping_mul(0x0001_0001_0001_0001) >> 48) as u32
}
