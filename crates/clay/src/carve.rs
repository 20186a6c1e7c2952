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
mod cleared;
mod way;
mod work;

use crate::changes::Changes;
use crate::field::{Brick, Field, SOLID};
use crate::grid::BRICK_EDGE;
use crate::lanes::{Bytes, Floats, Ints, LANES, lesser_bytes};
use crate::sweep::Sweep;
use crate::tool::ToolShape;

use ball::BallSweep;
use blade::BladeSweep;
use way::Way;
use work::{BRICK_GROUPS, Column, Entry, MOST_BRICKS, Tables};

pub(crate) use cleared::{Cleared, Start};
pub(crate) use work::Scratch;

/// Half width of the ramp from air to solid, in voxels.
const RAMP: f64 = 1.0;
/// By how much spans are drawn generously, in voxels, beyond what rounding in single precision asks for.
const SLACK: f64 = 0.01;
const EDGE: i32 = BRICK_EDGE as i32;
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

    /// What is left over in a group of voxels at most, and whether it needs a closer look.
    fn leaves_at_most(&self, tables: &Tables, at: Place) -> (Bytes, bool);

    /// What is left over in a group of voxels.
    fn leaves(&self, tables: &Tables, at: Place) -> Bytes;
}

/// Where a group of voxels is: its first voxel, and the numbers of its row in its bricks and of the group along x.
#[derive(Clone, Copy)]
struct Place {
    voxel: [i32; 3],
    row: usize,
    group: usize,
}

impl Place {
    #[inline(always)]
    fn of(entry: Entry, corner: [i32; 2]) -> Self {
        let [group, row] = entry.map(usize::from);
        let (y, z) = ((row % BRICK_EDGE) as i32, (row / BRICK_EDGE) as i32);
        Self {
            voxel: [(group * LANES) as i32, corner[0] + y, corner[1] + z],
            row,
            group,
        }
    }
}

/// Two spans along x in each of several rows, as places: all voxels between them, and some about them, may be looked at. A span with a
/// NaN is empty. The second begins where the first ends, or later.
struct Spans {
    first: [Floats; 2],
    second: [Floats; 2],
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
    work.clear();
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
///
/// Whether a group needs a closer look cannot be foreseen by a processor, so the few that do are put off: to cut with less than the whole
/// sweep first changes nothing in the end.
#[inline(always)]
fn carve_groups<S: Solid>(
    field: &mut Field,
    scratch: &mut Scratch,
    solid: &S,
    corner: [i32; 2],
    first_brick: usize,
) {
    let Scratch {
        work,
        closer,
        along,
        tables,
    } = scratch;
    closer.clear();
    for &entry in work.entries() {
        let at = Place::of(entry, corner);
        let column = &mut along[at.group / BRICK_GROUPS % MOST_BRICKS];
        if column.brick == Brick::Empty {
            continue;
        }
        let (left, look_closer) = solid.leaves_at_most(tables, at);
        closer.push_if(look_closer, entry);
        carve_group(field, column, first_brick, at, left);
    }
    for &entry in closer.entries() {
        let at = Place::of(entry, corner);
        let column = &mut along[at.group / BRICK_GROUPS % MOST_BRICKS];
        carve_group(field, column, first_brick, at, solid.leaves(tables, at));
    }
}

#[inline(always)]
fn carve_group(field: &mut Field, column: &mut Column, first_brick: usize, at: Place, left: Bytes) {
    const ALL_SOLID: Bytes = Bytes::from_le_bytes([SOLID; LANES]);
    let slot = match column.brick {
        Brick::Slot(slot) => slot,
        _ if left == ALL_SOLID => return,
        _ => {
            let slot = field.materialise(first_brick + at.group / BRICK_GROUPS);
            column.brick = Brick::Slot(slot);
            slot
        }
    };
    let (groups, _) = field.slot_mut(slot).as_chunks_mut::<LANES>();
    let cells = &mut groups[at.row * BRICK_GROUPS + at.group % BRICK_GROUPS];
    let (new, removed) = lesser_bytes(left, Bytes::from_le_bytes(*cells));
    *cells = new.to_le_bytes();
    column.removed += removed;
}

/// What is left over of voxels at these distances outside a solid, in voxels.
#[inline(always)]
fn left_over(distance: Floats) -> Bytes {
    let half = Floats::splat(127.5);
    (half + half * distance).to_bytes()
}
