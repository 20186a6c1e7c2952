//! What a tool does to the clay that it passes through.
//!
//! Cutting is in [`carve`](crate::carve). The other two neither need nor have its freedom of order: what they do
//! depends on what is there. So whoever keeps copies of one clay has them done in one order everywhere. Both are
//! integers throughout, and give the same bits on every machine.
//!
//! # Adding
//!
//! `field <- max(field, 255 - what the swept solid leaves over)`: the solid stands in the clay as if it had been cut
//! from it. Clay comes from what was removed: a block never holds more than when it was fresh. Where less is left than
//! a sweep wants, voxels get theirs in the order of their bricks and in these of their numbers, until none is left.
//!
//! # Smoothing
//!
//! The tool rubs. Whenever its pose passes a plane of a lattice four times as fine as the voxels, along any axis, clay
//! within the tool goes a quarter of the way to what this makes of it:
//!
//! ```text
//! psi  = mean of the voxel and its neighbours, weighted 1 2 1 along each axis
//! want = clamp(1/2 + 4/3 (psi - 1/2 - theta))
//! ```
//!
//! and where the tool covers a voxel by a part, by that part. The mean flattens what sticks out and fills what is
//! hollow, by a quarter of the mean curvature (in voxels); the slope 4/3 makes a flat face as crisp as it was: a face
//! with the ramp that cutting leaves stays as it is. The level `theta` is the one at which nothing is lost or won. It
//! is found by halving; what whole units leave open goes to the first voxels. A tool that stands does nothing, and how
//! much one does along a way does not depend on its speed, up to a voxel a sweep.

use crate::carve::{Part, Tables, covered, end_bounds};
use crate::changes::Changes;
use crate::field::{BrickView, Field, SOLID};
use crate::grid::{BRICK_EDGE, BRICK_VOXELS};
use crate::pose::{Pose, STEPS_PER_METRE};
use crate::sweep::Sweep;

/// What a tool does to the clay that it passes through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Operation {
    /// Removes it.
    #[default]
    Cut,
    /// Puts clay there, as long as some was removed before.
    Add,
    /// Flattens what sticks out and fills what is hollow; the volume stays.
    Smooth,
}

impl Operation {
    /// Whether sweeps may come in any order and any number of times. Those of other operations must be done in one
    /// order wherever the same clay is kept.
    #[must_use]
    pub const fn commutes(self) -> bool {
        matches!(self, Self::Cut)
    }
}

const EDGE: i32 = BRICK_EDGE as i32;
/// Planes that a tool passes within a voxel, along each axis, when it smooths.
const PLANES_PER_VOXEL: f64 = 4.0;
/// That many planes take a voxel all the way.
const WHOLE_WAY: i32 = 4;

/// Adds what the sweep passes through, of `most` units at most; returns how many that was.
pub(crate) fn add(
    field: &mut Field,
    changes: &mut Changes,
    tables: &mut Tables,
    sweep: &Sweep,
    most: u64,
) -> u64 {
    let revision = changes.upcoming();
    let before = field.total();
    let mut room = most;
    let grid = *field.grid();
    covered(&grid, tables, sweep, Part::All, |brick, _, left| {
        let mut voxels = content(field.view(brick));
        let wanted: u64 = voxels
            .iter()
            .zip(left)
            .map(|(&old, &left)| u64::from((SOLID - left).saturating_sub(old)))
            .sum();
        let mut given = wanted.min(room);
        if wanted == 0 || given == 0 {
            return;
        }
        room -= given;
        let is_enough = given == wanted;
        for (old, &left) in voxels.iter_mut().zip(left) {
            let more = (SOLID - left).saturating_sub(*old);
            if is_enough {
                *old += more;
            } else {
                let more = more.min(given.min(u64::from(SOLID)) as u8);
                given -= u64::from(more);
                *old += more;
            }
        }
        if field.replace(brick, BrickView::Voxels(&voxels)) {
            changes.mark(brick, revision);
        }
    });
    field.total() - before
}

fn content(view: BrickView<'_>) -> [u8; BRICK_VOXELS] {
    match view {
        BrickView::Empty => [0; BRICK_VOXELS],
        BrickView::Full => [SOLID; BRICK_VOXELS],
        BrickView::Voxels(voxels) => *voxels,
    }
}

/// A copy of clay begins with an empty one.
impl Clone for Smoother {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// Where smoothing keeps what it works with. Allocates when a tool is larger than any before.
#[derive(Debug, Default)]
pub(crate) struct Smoother {
    /// The region: the voxels that the tool may cover, with a border of one voxel.
    field: Vec<u8>,
    /// What the tool leaves over.
    left: Vec<u8>,
    sums: Vec<u16>,
    means: Vec<u16>,
    bricks: Vec<(u32, [u32; 3])>,
    active: Vec<Active>,
}

/// A voxel that smoothing may change.
#[derive(Clone, Copy, Debug)]
struct Active {
    /// In the region.
    at: u32,
    /// 64 times the mean, less 64 times half a voxel, doubled so that this is whole.
    level: i32,
    old: i32,
    /// Of [`WEIGHTS`].
    weight: i32,
}

/// Weight of a voxel that goes all the way.
const WEIGHTS: i32 = SOLID as i32 * WHOLE_WAY;
/// What is wanted is counted in these parts of a unit: `4/3` of 64ths of a unit, doubled.
const PARTS: i32 = 96;
/// Beyond this level nothing, or everything, is wanted of every voxel.
const LAST_LEVEL: i32 = 4 * 64 * SOLID as i32;

impl Active {
    /// Its occupancy where `theta` is the level, in the same units as its own.
    fn new_at(&self, theta: i32) -> i32 {
        let half = PARTS * SOLID as i32 / 2;
        let want = (half + self.level - theta).clamp(0, 2 * half);
        let way = self.weight * (want - PARTS * self.old);
        let whole = PARTS * WEIGHTS;
        // To nearest; a half goes up, here and everywhere.
        self.old + (2 * way + whole).div_euclid(2 * whole)
    }
}

/// How many planes a tool passes on the way, at most as many as take it all the way.
fn planes_passed(from: Pose, to: Pose, voxel_size_m: f64) -> i32 {
    let per_step = PLANES_PER_VOXEL / (voxel_size_m * STEPS_PER_METRE);
    let plane = |step: i32| (f64::from(step) * per_step).floor();
    let passed: f64 = (0..3)
        .map(|axis| (plane(to.steps()[axis]) - plane(from.steps()[axis])).abs())
        .sum();
    passed.min(f64::from(WHOLE_WAY)) as i32
}

impl Smoother {
    /// Smooths where the sweep ends; returns how many units went from one voxel to another.
    pub(crate) fn smooth(
        &mut self,
        field: &mut Field,
        changes: &mut Changes,
        tables: &mut Tables,
        sweep: &Sweep,
    ) -> u64 {
        let planes = planes_passed(sweep.from, sweep.to, field.grid().voxel_size_m());
        if planes == 0 {
            return 0;
        }
        let Some(region) = self.take_in(field, tables, sweep) else {
            return 0;
        };
        self.mean(&region);
        self.find_active(&region, planes);
        let moved = self.level();
        if 0 < moved {
            self.give_back(&region, field, changes);
        }
        moved
    }

    /// Takes in the bricks that the tool reaches, unless there is nothing to smooth.
    fn take_in(&mut self, field: &Field, tables: &mut Tables, sweep: &Sweep) -> Option<Region> {
        let grid = *field.grid();
        self.bricks.clear();
        let region = Region::about(end_bounds(&grid, sweep)?);
        let count = region.count();
        self.field.clear();
        self.field.resize(count, 0);
        self.left.clear();
        self.left.resize(count, SOLID);
        self.sums.resize(count.max(self.sums.len()), 0);
        self.means.resize(count.max(self.means.len()), 0);
        let (left, bricks) = (&mut self.left, &mut self.bricks);
        covered(&grid, tables, sweep, Part::End, |brick, at, voxels| {
            bricks.push((brick as u32, at.map(|at| at as u32)));
            region.for_rows(at, false, |row, place, count| {
                left[place..place + count].copy_from_slice(&voxels[row..row + count]);
            });
        });
        region.read(field, &mut self.field);
        (!self.bricks.is_empty()).then_some(region)
    }

    /// Sums of each voxel and its neighbours, 64 times their mean.
    fn mean(&mut self, region: &Region) {
        let count = region.count();
        let [x, y, _] = region.voxels;
        weigh(&self.field[..count], &mut self.sums[..count], 1);
        weigh(&self.sums[..count], &mut self.means[..count], x);
        weigh(&self.means[..count], &mut self.sums[..count], x * y);
    }

    fn find_active(&mut self, region: &Region, planes: i32) {
        self.active.clear();
        for (_, brick) in &self.bricks {
            let (field, left, sums) = (&self.field, &self.left, &self.sums);
            let active = &mut self.active;
            region.for_rows(brick.map(|at| at as usize), false, |_, place, count| {
                for at in place..place + count {
                    let (old, sum) = (i32::from(field[at]), i32::from(sums[at]));
                    if left[at] == SOLID || sum == 64 * old && (old == 0 || old == SOLID.into()) {
                        continue;
                    }
                    active.push(Active {
                        at: at as u32,
                        level: 2 * sum - 64 * i32::from(SOLID),
                        old,
                        weight: i32::from(SOLID - left[at]) * planes,
                    });
                }
            });
        }
    }

    /// Writes the new occupancies; returns how many units went from one voxel to another.
    fn level(&mut self) -> u64 {
        let won = |theta: i32| -> i64 {
            let more = |voxel: &Active| i64::from(voxel.new_at(theta) - voxel.old);
            self.active.iter().map(more).sum()
        };
        // The higher the level, the less is won: at `most` nothing, below it something, or nothing there either.
        let mut reach = 64;
        while reach < LAST_LEVEL && (won(-reach) < 0 || 0 < won(reach)) {
            reach *= 4;
        }
        let (mut least, mut most) = (-reach.min(LAST_LEVEL), reach.min(LAST_LEVEL));
        while least + 1 < most {
            let middle = least + (most - least) / 2;
            if 0 < won(middle) {
                least = middle;
            } else {
                most = middle;
            }
        }
        let mut open = -won(most);
        let mut moved = 0;
        for voxel in &self.active {
            let new = i64::from(voxel.new_at(most));
            let more = open.min(i64::from(voxel.new_at(least)) - new);
            open -= more;
            let new = new + more;
            moved += new.abs_diff(i64::from(voxel.old));
            self.field[voxel.at as usize] = new as u8;
        }
        debug_assert_eq!(open, 0, "at the lower level as much is won as is open");
        moved / 2
    }

    fn give_back(&self, region: &Region, field: &mut Field, changes: &mut Changes) {
        let revision = changes.upcoming();
        for &(brick, at) in &self.bricks {
            let mut voxels = content(field.view(brick as usize));
            region.for_rows(at.map(|at| at as usize), false, |row, place, count| {
                voxels[row..row + count].copy_from_slice(&self.field[place..place + count]);
            });
            if field.replace(brick as usize, BrickView::Voxels(&voxels)) {
                changes.mark(brick as usize, revision);
            }
        }
    }
}

/// Of each number and those `apart` before and behind it the sum, weighted 1 2 1. Those at either end stay.
fn weigh<T: Copy + Into<u16>>(of: &[T], into: &mut [u16], apart: usize) {
    let (before, here, after) = (of, &of[apart..], &of[2 * apart..]);
    let three = before.iter().zip(here).zip(after);
    for (sum, ((&a, &b), &c)) in into[apart..].iter_mut().zip(three) {
        *sum = a.into() + 2 * b.into() + c.into();
    }
}

/// The voxels that a tool may cover, with a border of one voxel all around.
struct Region {
    /// The border's first voxel.
    first: [i32; 3],
    voxels: [usize; 3],
}

/// What a region and a brick have in common along an axis.
struct Common {
    /// In the region.
    from: usize,
    count: usize,
    /// In the brick.
    within: usize,
}

impl Region {
    fn about(bounds: [[i32; 2]; 3]) -> Self {
        Self {
            first: bounds.map(|[first, _]| first - 1),
            voxels: bounds.map(|[first, end]| (end - first) as usize + 2),
        }
    }

    fn count(&self) -> usize {
        self.voxels.iter().product()
    }

    /// With the border, or without.
    fn common(&self, axis: usize, brick: usize, border: bool) -> Common {
        let edge = i32::from(!border);
        let (first, begins) = (self.first[axis], brick as i32 * EDGE);
        let end = (first + self.voxels[axis] as i32 - edge).min(begins + EDGE);
        let from = (first + edge).max(begins);
        Common {
            from: (from - first) as usize,
            count: (end - from).max(0) as usize,
            within: (from - begins) as usize,
        }
    }

    /// For each row that a brick and the region have in common, where it begins in the brick, where in the region, and
    /// how long it is.
    fn for_rows(&self, brick: [usize; 3], border: bool, mut each: impl FnMut(usize, usize, usize)) {
        let [x, y, z] = std::array::from_fn(|axis| self.common(axis, brick[axis], border));
        if x.count == 0 {
            return;
        }
        for layer in 0..z.count {
            for row in 0..y.count {
                let in_brick = (z.within + layer) * BRICK_EDGE + y.within + row;
                let in_region = (z.from + layer) * self.voxels[1] + y.from + row;
                each(
                    in_brick * BRICK_EDGE + x.within,
                    in_region * self.voxels[0] + x.from,
                    x.count,
                );
            }
        }
    }

    /// Reads all of it; air outside the grid.
    fn read(&self, field: &Field, into: &mut [u8]) {
        let bricks = field.grid().bricks().map(usize::from);
        let [along_x, along_y, along_z]: [std::ops::Range<usize>; 3] =
            std::array::from_fn(|axis| {
                let (first, end) = (
                    self.first[axis],
                    self.first[axis] + self.voxels[axis] as i32,
                );
                let end = ((end - 1).div_euclid(EDGE) + 1).max(0) as usize;
                first.div_euclid(EDGE).max(0) as usize..end.min(bricks[axis])
            });
        for z in along_z {
            for y in along_y.clone() {
                for x in along_x.clone() {
                    let view = field.view((z * bricks[1] + y) * bricks[0] + x);
                    if view == BrickView::Empty {
                        continue;
                    }
                    self.for_rows([x, y, z], true, |row, place, count| {
                        let to = &mut into[place..place + count];
                        match view {
                            BrickView::Empty => {}
                            BrickView::Full => to.fill(SOLID),
                            BrickView::Voxels(voxels) => {
                                to.copy_from_slice(&voxels[row..row + count]);
                            }
                        }
                    });
                }
            }
        }
    }
}
