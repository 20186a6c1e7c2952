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

use crate::changes::Changes;
use crate::field::{Brick, Field, SOLID};
use crate::grid::{BRICK_EDGE, MAX_AXIS_VOXELS};
use crate::lanes::{Bytes, Floats, Ints, LANES, lesser_bytes};
use crate::pose::STEPS_PER_METRE;
use crate::sweep::Sweep;
use crate::tool::ToolShape;

use ball::BallSweep;
use blade::BladeSweep;

/// Half width of the ramp from air to solid, in voxels.
const RAMP: f64 = 1.0;
/// By how much spans are drawn generously, in voxels, beyond what rounding in single precision asks for.
const SLACK: f64 = 0.01;
/// Rounding error of a coordinate in single precision, relative to the largest that occurs: half a unit in the last place for the
/// offset and for the sum, and as much again in reserve.
const COORDINATE_ERROR: f64 = 2.4e-7;

const EDGE: i32 = BRICK_EDGE as i32;
/// Groups of lanes in a row of a brick.
const BRICK_GROUPS: usize = BRICK_EDGE / LANES;
/// Rows of voxels in a brick.
const ROWS: usize = BRICK_EDGE * BRICK_EDGE;
/// Most groups of lanes and most bricks along x.
const MOST_GROUPS: usize = MAX_AXIS_VOXELS / LANES;
const MOST_BRICKS: usize = MAX_AXIS_VOXELS / BRICK_EDGE;

/// What is known about the clay before a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    /// Nothing.
    Unknown,
    /// The same solid was carved at the sweep's start and nothing was put back since.
    Clear,
}

/// Memory that cutting needs, made once so that cutting never allocates.
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    work: WorkList,
    /// The bricks along x that the rows at hand run through.
    along: [Column; MOST_BRICKS],
    tables: Tables,
}

/// A brick in the row of bricks at hand.
#[derive(Clone, Copy, Debug)]
struct Column {
    brick: Brick,
    removed: u32,
}

/// What a solid found out about rows and columns of groups, so as not to find it out again for each group.
#[derive(Clone, Debug)]
struct Tables {
    rows: Box<[[f32; ROWS]; 2]>,
    columns: Box<[[f32; LANES]; MOST_GROUPS]>,
    column_bounds: Box<[f32; MOST_GROUPS]>,
}

impl Scratch {
    pub(crate) fn new() -> Self {
        Self {
            work: WorkList::new(),
            along: [Column {
                brick: Brick::Empty,
                removed: 0,
            }; MOST_BRICKS],
            tables: Tables {
                rows: Box::new([[0.0; ROWS]; 2]),
                columns: Box::new([[0.0; LANES]; MOST_GROUPS]),
                column_bounds: Box::new([0.0; MOST_GROUPS]),
            },
        }
    }
}

/// Removes what the sweep passes through; returns how many 1/255 of a voxel that was. Allocates nothing.
pub(crate) fn carve(
    field: &mut Field,
    changes: &mut Changes,
    scratch: &mut Scratch,
    sweep: &Sweep,
    start: Start,
) -> u64 {
    let way = Way::new(sweep, field.grid().voxel_size_m());
    match &sweep.shape {
        ToolShape::Ball(ball) => {
            carve_solid(field, changes, scratch, &BallSweep::new(ball, &way, start))
        }
        ToolShape::Blade(blade) => carve_solid(
            field,
            changes,
            scratch,
            &BladeSweep::new(blade, &way, start),
        ),
    }
}

/// A sweep's poses in voxels, with voxel centres at whole numbers.
struct Way {
    from: [f64; 3],
    to: [f64; 3],
    per_metre: f64,
    /// Bound on the rounding error of single-precision coordinates about this way, in voxels.
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
            rounding: far * COORDINATE_ERROR,
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
    /// Voxels that can be affected, along each axis from the first up to but not including the last.
    fn bounds(&self) -> [[i32; 2]; 3];

    /// Whether no voxel at `z` can change.
    fn skips_layer(&self, z: i32) -> bool;

    /// Finds out what is the same for all rows about these columns of groups.
    fn prepare(&self, tables: &mut Tables, groups: [i32; 2]);

    /// Which voxels may change in the rows `y` to `y + LANES` at `z`, of which the first has this number in its bricks.
    fn spans(&self, tables: &mut Tables, y: i32, z: i32, row: usize) -> Spans;

    /// What is left over in the voxels `x` to `x + LANES` of a row.
    fn leaves(&self, tables: &Tables, voxel: [i32; 3], row: usize) -> Bytes;
}

/// Two spans along x in each of several rows, as places: all voxels between them, and some about them, may be looked at. A span with a
/// NaN is empty. The second begins where the first ends, or later.
struct Spans {
    first: [Floats; 2],
    second: [Floats; 2],
}

/// Groups of voxels to look at within the rows of bricks at one place in y and z.
#[derive(Clone, Debug)]
struct WorkList {
    /// Row in the bricks (16 z + y) times 256, plus the group's number along x: sixteen bits each, little-endian, so that
    /// several can be written as one word.
    groups: Box<[u8; GROUP_BYTES * (ROWS * MOST_GROUPS + BATCH)]>,
    /// Bytes in use.
    len: usize,
}

const GROUP_BYTES: usize = 2;
/// Groups are written in batches of this many, counted or not.
const BATCH: usize = 4;

impl WorkList {
    fn new() -> Self {
        let groups = vec![0; GROUP_BYTES * (ROWS * MOST_GROUPS + BATCH)].into_boxed_slice();
        Self {
            groups: groups
                .try_into()
                .expect("the vector has the array's length"),
            len: 0,
        }
    }

    fn groups(&self) -> &[[u8; GROUP_BYTES]] {
        self.groups[..self.len].as_chunks().0
    }

    /// Adds groups of several rows, the first of them `row`, each from `start` up to but not including `end`.
    #[inline(always)]
    fn push(&mut self, row: usize, start: Ints, end: Ints) {
        let counts = (end - start).not_below_0();
        if !counts.any_above_0() {
            return;
        }
        let numbers = start + Ints::stepping((row << 8) as i32, 1 << 8);
        let mut len = self.len;
        for packed in (numbers + counts.in_upper_half()).to_array() {
            let (next, count) = (packed as u32 & 0xFFFF, (packed as u32 >> 16) as usize);
            self.write(len, next);
            if BATCH < count {
                self.write_long(len, next, count);
            }
            len += GROUP_BYTES * count;
        }
        self.len = len;
    }

    /// Writes a batch of groups from `next` on. Most spans are shorter than a batch: writing one whole costs less than a branch
    /// that cannot be foreseen.
    #[inline(always)]
    fn write(&mut self, at: usize, next: u32) {
        // What overflows from one number into the next does so past the last group that counts.
        let batch = u64::from(next)
            .wrapping_mul(0x0001_0001_0001_0001)
            .wrapping_add(0x0003_0002_0001_0000);
        self.groups[at..at + GROUP_BYTES * BATCH].copy_from_slice(&batch.to_le_bytes());
    }

    #[cold]
    fn write_long(&mut self, at: usize, next: u32, count: usize) {
        for done in (0..count).step_by(BATCH) {
            self.write(at + GROUP_BYTES * done, next + done as u32);
        }
    }
}

fn carve_solid<S: Solid>(
    field: &mut Field,
    changes: &mut Changes,
    scratch: &mut Scratch,
    solid: &S,
) -> u64 {
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
    // Groups that exist: a span may reach past the grid.
    let groups = [xs[0] / LANES as i32, (xs[1] - 1) / LANES as i32 + 1];
    solid.prepare(&mut scratch.tables, groups);
    let bricks_along = |[start, end]: [i32; 2]| start / EDGE..(end - 1) / EDGE + 1;
    for brick_z in bricks_along(zs) {
        for brick_y in bricks_along(ys) {
            let first = (brick_z as usize * bricks_y + brick_y as usize) * bricks_x;
            let mut anything = false;
            for brick_x in bricks_along(xs) {
                let brick = field.brick(first + brick_x as usize);
                scratch.along[brick_x as usize] = Column { brick, removed: 0 };
                anything |= brick != Brick::Empty;
            }
            if !anything {
                continue;
            }
            let corner = [brick_y * EDGE, brick_z * EDGE];
            let within = |[start, end]: [i32; 2], corner: i32| {
                [start.max(corner) - corner, end.min(corner + EDGE) - corner]
            };
            let rows = [within(ys, corner[0]), within(zs, corner[1])];
            list_work(scratch, solid, corner, rows, groups);
            carve_groups(field, scratch, solid, corner, first);
            for brick_x in bricks_along(xs) {
                let removed = scratch.along[brick_x as usize].removed;
                if 0 < removed {
                    field.book_removal(first + brick_x as usize, removed);
                    changes.mark(first + brick_x as usize, revision);
                }
            }
        }
    }
    before - field.total()
}

/// Lists the groups of voxels that may change, within a range of the rows of bricks at a corner.
#[inline(always)]
fn list_work<S: Solid>(
    scratch: &mut Scratch,
    solid: &S,
    corner: [i32; 2],
    [ys, zs]: [[i32; 2]; 2],
    groups: [i32; 2],
) {
    let Scratch { work, tables, .. } = scratch;
    work.len = 0;
    for z in zs[0]..zs[1] {
        if solid.skips_layer(corner[1] + z) {
            continue;
        }
        // Rows are taken in whole lanes; those beyond the solid have no span.
        let mut y = ys[0] & -(LANES as i32);
        while y < ys[1] {
            let row = (z * EDGE + y) as usize;
            let spans = solid.spans(tables, corner[0] + y, corner[1] + z, row);
            let first_end = group_to(spans.first[1], groups);
            work.push(row, group_from(spans.first[0], groups), first_end);
            // A group in both spans is done already.
            let start = group_from(spans.second[0], groups).greater(first_end);
            work.push(row, start, group_to(spans.second[1], groups));
            y += LANES as i32;
        }
    }
}

/// The groups that hold the first voxels at or above these places along rows, kept between two groups.
#[inline(always)]
fn group_from(low: Floats, [least, most]: [i32; 2]) -> Ints {
    let bounds = [least, most].map(|group| (group * LANES as i32) as f32);
    // The first whole number at or above a place is the one nearest to half above it, but for ties, which spans are drawn
    // generously enough to lose.
    (low + Floats::splat(0.5))
        .nearest_within(bounds)
        .quartered()
}

/// The groups after those that hold the last voxels at or below these places along rows, kept between two groups.
#[inline(always)]
fn group_to(high: Floats, [least, most]: [i32; 2]) -> Ints {
    let bounds = [least, most].map(|group| (group * LANES as i32 + LANES as i32 - 1) as f32);
    (high + Floats::splat(LANES as f32 - 0.5))
        .nearest_within(bounds)
        .quartered()
}

/// Cuts the listed groups and counts what was removed from each brick.
#[inline(always)]
fn carve_groups<S: Solid>(
    field: &mut Field,
    scratch: &mut Scratch,
    solid: &S,
    corner: [i32; 2],
    first_brick: usize,
) {
    const ALL_SOLID: Bytes = Bytes::from_le_bytes([SOLID; LANES]);
    let Scratch {
        work,
        along,
        tables,
    } = scratch;
    for &item in work.groups() {
        let item = u16::from_le_bytes(item);
        let (row, group) = (usize::from(item >> 8), usize::from(item & 0xFF));
        let column = &mut along[group / BRICK_GROUPS % MOST_BRICKS];
        if column.brick == Brick::Empty {
            continue;
        }
        let (y, z) = ((row % BRICK_EDGE) as i32, (row / BRICK_EDGE) as i32);
        let left = solid.leaves(
            tables,
            [(group * LANES) as i32, corner[0] + y, corner[1] + z],
            row,
        );
        let slot = match column.brick {
            Brick::Slot(slot) => slot,
            _ if left == ALL_SOLID => continue,
            _ => {
                let slot = field.materialise(first_brick + group / BRICK_GROUPS);
                column.brick = Brick::Slot(slot);
                slot
            }
        };
        let (groups, _) = field.slot_mut(slot).as_chunks_mut::<LANES>();
        let cells = &mut groups[row * BRICK_GROUPS + group % BRICK_GROUPS];
        let (new, removed) = lesser_bytes(left, Bytes::from_le_bytes(*cells));
        *cells = new.to_le_bytes();
        column.removed += removed;
    }
}

/// What is left over of voxels at these distances outside a solid, in voxels.
#[inline(always)]
fn left_over(distance: Floats) -> Bytes {
    let half = Floats::splat(127.5);
    (half + half * distance).to_bytes()
}
