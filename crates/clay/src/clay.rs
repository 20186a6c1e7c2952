//! The clay: one block that is cut, felt, watched, compared and healed.

mod mesh;

use std::sync::Arc;

use thiserror::Error;

use crate::carve::{self, Cleared, Start, Tables};
use crate::changes::Changes;
use crate::classes::{Classes, ClassesError};
use crate::engage::{self, Faces, Tool};
use crate::field::{self, BrickView, Field};
use crate::grid::{BRICK_EDGE, BrickIndex, Grid};
use crate::hash::Hashes;
use crate::law::{self, ContactState, Engaged, Material, Motion, Response};
use crate::operation::{self, Operation, Smoother};
use crate::pose::Pose;
use crate::shape::{Shape, ShapeError};
use crate::sweep::Sweep;
use crate::tool::{ToolError, ToolShape};

/// Units of occupancy in a full voxel. All counting is in these units, in integers.
pub const UNITS_PER_VOXEL: u64 = field::SOLID as u64;

/// A block of clay.
///
/// It belongs to whoever ticks; watchers keep copies of their own, fed by [`Clay::drain_changed`]. Nothing here
/// allocates after creation except `clone`, and smoothing with a tool larger than any before.
#[derive(Clone, Debug)]
pub struct Clay {
    field: Field,
    initial_units: u64,
    changes: Changes,
    hashes: Hashes,
    cleared: Cleared,
    tables: Tables,
    classes: Option<Arc<Classes>>,
    smoother: Smoother,
}

/// Content that a brick cannot take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ReplaceError {
    /// Clay outside the grid.
    #[error("brick {brick} holds clay at voxel {voxel}, which is outside the grid")]
    OutsideGrid {
        /// The brick's dense number.
        brick: u32,
        /// The voxel's place in the brick.
        voxel: usize,
    },
    /// More clay than the block had when it was fresh.
    #[error(
        "brick {brick} would bring the clay to {got_units} units, it began with {initial_units}"
    )]
    MoreThanInitial {
        /// The brick's dense number.
        brick: u32,
        /// Units that the clay would hold.
        got_units: u64,
        /// Units that it began with.
        initial_units: u64,
    },
}

/// What one tick of a tool did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worked {
    /// What the clay answers.
    pub response: Response,
    /// What was removed, added, or moved by smoothing, in units of 1/255 voxel.
    pub moved_units: u64,
}

impl Clay {
    /// A fresh block. Reserves address space for every brick; memory is committed as bricks are carved, or a little
    /// ahead of that, see [`Clay::commit_ahead`].
    ///
    /// # Errors
    /// When the shape does not fit a grid of voxels of this size.
    pub fn new(shape: &Shape, voxel_size_m: f64) -> Result<Self, ShapeError> {
        let grid = shape.grid(voxel_size_m)?;
        let field = Field::filled(grid, shape);
        let initial_units = field.total();
        let bricks = grid.brick_count();
        let mut hashes = Hashes::none(&grid);
        for brick in 0..bricks {
            hashes.refresh(brick, field.view(brick));
        }
        Ok(Self {
            field,
            initial_units,
            changes: Changes::none(bricks),
            hashes,
            cleared: Cleared::default(),
            tables: Tables::new(),
            classes: None,
            smoother: Smoother::default(),
        })
    }

    /// Clay that was kept elsewhere: `content` gives each brick, in dense order. It began with `initial_units` of 1/255
    /// voxel; its revision is that of a fresh block.
    ///
    /// # Errors
    /// When a brick has clay outside the grid, or there is more than it began with.
    pub fn from_bricks<'a>(
        grid: Grid,
        initial_units: u64,
        mut content: impl FnMut(BrickIndex) -> BrickView<'a>,
    ) -> Result<Self, ReplaceError> {
        let bricks = grid.brick_count();
        let mut clay = Self {
            field: Field::empty(grid),
            initial_units,
            changes: Changes::none(bricks),
            hashes: Hashes::none(&grid),
            cleared: Cleared::default(),
            tables: Tables::new(),
            classes: None,
            smoother: Smoother::default(),
        };
        for brick in 0..bricks {
            let index = BrickIndex::new(brick);
            clay.replace_brick(index, content(index))?;
            clay.hashes.refresh(brick, clay.field.view(brick));
        }
        clay.changes = Changes::none(bricks);
        Ok(clay)
    }

    /// Dimensions of the voxel grid.
    #[must_use]
    pub const fn grid(&self) -> &Grid {
        self.field.grid()
    }

    /// Whether a tool is thick enough to cut this clay cleanly.
    ///
    /// # Errors
    /// When the tool is thinner than two voxels: it would leave clay standing in its way.
    pub fn admits(&self, shape: &ToolShape) -> Result<(), ToolError> {
        self.admits_thickness(shape.extents_m().into_iter().fold(f64::INFINITY, f64::min))
    }

    fn admits_thickness(&self, got_m: f64) -> Result<(), ToolError> {
        let need_m = 2.0 * self.grid().voxel_size_m();
        // A tool of exactly two voxels is fine, in spite of how either length was rounded.
        if got_m < need_m * (1.0 - 1e-9) {
            return Err(ToolError::TooThin { got_m, need_m });
        }
        Ok(())
    }

    /// Removes what a sweep passes through; returns how much, in units of 1/255 voxel.
    pub fn carve(&mut self, sweep: &Sweep) -> u64 {
        let start = self.cleared.advance(sweep);
        if start == Start::Clear && sweep.from == sweep.to {
            return 0;
        }
        carve::carve(
            &mut self.field,
            &mut self.changes,
            &mut self.tables,
            sweep,
            start,
        )
    }

    /// Does to the clay what an operation does where a sweep passes through; returns how much was removed, added or
    /// moved, in units of 1/255 voxel.
    pub fn operate(&mut self, operation: Operation, sweep: &Sweep) -> u64 {
        let (field, changes, tables) = (&mut self.field, &mut self.changes, &mut self.tables);
        let moved_units = match operation {
            Operation::Cut => return self.carve(sweep),
            Operation::Add => {
                let most = self.initial_units - field.total();
                operation::add(field, changes, tables, sweep, most)
            }
            Operation::Smooth => self.smoother.smooth(field, changes, tables, sweep),
        };
        if 0 < moved_units {
            // Clay may stand again where a tool had cleared it.
            self.cleared = Cleared::default();
        }
        moved_units
    }

    /// One tick of a tool: cuts the motion's sweep, then feels the clay that is left and answers.
    pub fn work(
        &mut self,
        tool: &Tool,
        material: &Material,
        motion: &Motion,
        contact: &mut ContactState,
    ) -> Worked {
        self.work_as(Operation::Cut, tool, material, motion, contact)
    }

    /// One tick of a tool. One that cuts feels the clay that it leaves; one that adds or smooths feels the clay as it
    /// comes upon it.
    pub fn work_as(
        &mut self,
        operation: Operation,
        tool: &Tool,
        material: &Material,
        motion: &Motion,
        contact: &mut ContactState,
    ) -> Worked {
        let sweep = Sweep {
            shape: *tool.shape(),
            from: motion.from(),
            to: motion.to(),
        };
        let (response, moved_units) = if operation == Operation::Cut {
            let removed_units = self.carve(&sweep);
            (self.feel(tool, material, motion, contact), removed_units)
        } else {
            let response = self.feel(tool, material, motion, contact);
            (response, self.operate(operation, &sweep))
        };
        Worked {
            response,
            moved_units,
        }
    }

    /// What the clay answers to a tool that moves but must not cut. `material` is what the first class resists with:
    /// all of the clay, unless it [has more](Clay::assign_classes).
    pub fn feel(
        &self,
        tool: &Tool,
        material: &Material,
        motion: &Motion,
        contact: &mut ContactState,
    ) -> Response {
        self.feel_with(tool.faces(), material, motion, contact)
    }

    /// What the clay answers to faces that move but do not cut.
    fn feel_with(
        &self,
        faces: &Faces,
        material: &Material,
        motion: &Motion,
        contact: &mut ContactState,
    ) -> Response {
        let Some(classes) = &self.classes else {
            let directions = law::directions(material.springs(), contact, motion);
            let areas_m2 = engage::engaged_areas_m2(&self.field, faces, motion.to(), directions);
            let ahead = areas_m2.map(|area_m2| Engaged::one(material, area_m2, motion));
            return law::respond(contact, motion, ahead);
        };
        let springs = material.springs() || classes.further().iter().any(Material::springs);
        let directions = law::directions(springs, contact, motion);
        let areas_m2 = engage::class_areas_m2(&self.field, classes, faces, motion.to(), directions);
        let ahead = areas_m2.map(|areas_m2| {
            let materials = std::iter::once(material).chain(classes.further());
            Engaged::several(materials.zip(areas_m2), motion)
        });
        law::respond(contact, motion, ahead)
    }

    /// The classes of the block, if there is more than one.
    #[must_use]
    pub const fn classes(&self) -> Option<&Arc<Classes>> {
        self.classes.as_ref()
    }

    /// Gives a block its classes before anybody works on it: what is at a place is then of the class that it has there.
    /// Cutting removes clay, and leaves the class of the place as it was.
    ///
    /// # Errors
    /// The classes are those of another grid; nothing has changed then.
    pub fn assign_classes(&mut self, classes: Option<Arc<Classes>>) -> Result<(), ClassesError> {
        if let Some(classes) = &classes {
            classes.check_grid(self.grid())?;
        }
        self.classes = classes;
        Ok(())
    }

    /// Area of the tool's leading face that has clay ahead of it when the tool moves in a direction, m². The direction
    /// need not be of unit length; a zero or non-finite one engages nothing.
    #[must_use]
    pub fn engaged_area_m2(&self, tool: &Tool, at: Pose, direction: [f64; 3]) -> f64 {
        self.area_of_faces_m2(tool.faces(), at, direction)
    }

    fn area_of_faces_m2(&self, faces: &Faces, at: Pose, direction: [f64; 3]) -> f64 {
        let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
        if !(length.is_finite() && 0.0 < length) {
            return 0.0;
        }
        let direction = direction.map(|d| d / length);
        engage::engaged_areas_m2(&self.field, faces, at, [direction, [0.0; 3]])[0]
    }

    /// Units of 1/255 voxel that the block had when it was fresh.
    #[must_use]
    pub const fn initial_units(&self) -> u64 {
        self.initial_units
    }

    /// Units of 1/255 voxel that are left.
    #[must_use]
    pub const fn remaining_units(&self) -> u64 {
        self.field.total()
    }

    /// Units of 1/255 voxel that were removed: initial less remaining, always.
    #[must_use]
    pub const fn removed_units(&self) -> u64 {
        self.initial_units - self.field.total()
    }

    /// Volume of one unit, m³.
    #[must_use]
    pub fn unit_volume_m3(&self) -> f64 {
        let h = self.grid().voxel_size_m();
        h * h * h / UNITS_PER_VOXEL as f64
    }

    /// Volume that the block had when it was fresh, m³.
    #[must_use]
    pub fn initial_volume_m3(&self) -> f64 {
        self.initial_units as f64 * self.unit_volume_m3()
    }

    /// Volume that is left, m³, rounded so that it and [`Clay::removed_volume_m3`] add up to the initial volume
    /// exactly.
    #[must_use]
    pub fn remaining_volume_m3(&self) -> f64 {
        self.initial_volume_m3() - self.removed_volume_m3()
    }

    /// Volume that was removed, m³.
    #[must_use]
    pub fn removed_volume_m3(&self) -> f64 {
        // Where this difference rounds, the remaining volume is the smaller part, and subtracting again is exact; where
        // it does not round, nothing is lost either. So the two add up without error.
        self.initial_volume_m3() - self.field.total() as f64 * self.unit_volume_m3()
    }

    /// Occupancy of a voxel, 0 to 255; air outside the grid.
    #[must_use]
    pub fn occupancy(&self, voxel: [i32; 3]) -> u8 {
        self.field.occupancy(voxel)
    }

    /// The content of a brick of this clay's grid.
    ///
    /// # Panics
    /// When the index comes from a larger grid.
    #[must_use]
    pub fn brick(&self, index: BrickIndex) -> BrickView<'_> {
        self.field.view(index.dense())
    }

    /// Puts content in a brick, as a mirror does with what it is sent; returns whether anything changed. All counts
    /// stay exact.
    ///
    /// # Errors
    /// When the content has clay outside the grid, or the block would hold more than when it was fresh.
    ///
    /// # Panics
    /// When the index comes from a larger grid.
    pub fn replace_brick(
        &mut self,
        index: BrickIndex,
        view: BrickView<'_>,
    ) -> Result<bool, ReplaceError> {
        let view = field::canonical(view);
        if let Some(voxel) = first_outside(self.grid().brick_extent(index), view) {
            return Err(ReplaceError::OutsideGrid {
                brick: index.as_u32(),
                voxel,
            });
        }
        let brick = index.dense();
        let kept = self.field.total() - u64::from(self.field.brick_sum(brick));
        let got_units = kept + u64::from(field::sum_of(view));
        if self.initial_units < got_units {
            let initial_units = self.initial_units;
            return Err(ReplaceError::MoreThanInitial {
                brick: index.as_u32(),
                got_units,
                initial_units,
            });
        }
        let revision = self.changes.upcoming();
        let changed = self.field.replace(brick, view);
        if changed {
            self.changes.mark(brick, revision);
            // Clay may stand again where a tool had cleared it.
            self.cleared = Cleared::default();
        }
        Ok(changed)
    }

    /// Hands over up to `most` bricks that changed since they were last handed over, each once however often it
    /// changed; returns how many. Takes turns, so that no brick waits for ever.
    pub fn drain_changed(
        &mut self,
        most: usize,
        mut each: impl FnMut(BrickIndex, BrickView<'_>),
    ) -> usize {
        for drained in 0..most {
            let Some(index) = self.changes.take_dirty() else {
                return drained;
            };
            each(index, self.field.view(index.dense()));
        }
        most
    }

    /// Bricks that wait to be drained.
    #[must_use]
    pub const fn changed_count(&self) -> usize {
        self.changes.dirty_count()
    }

    /// Grows with every call that changes the clay; 0 when fresh.
    #[must_use]
    pub const fn revision(&self) -> u64 {
        self.changes.revision()
    }

    /// The clay's revision when a brick last changed; 0 for a fresh one.
    #[must_use]
    pub fn brick_revision(&self, index: BrickIndex) -> u64 {
        self.changes.brick_revision(index.dense())
    }

    /// Bricks that changed after a revision, in dense order.
    pub fn changed_after(&self, revision: u64) -> impl Iterator<Item = BrickIndex> + '_ {
        (0..self.grid().brick_count())
            .map(BrickIndex::new)
            .filter(move |index| revision < self.brick_revision(*index))
    }

    /// Hash of a brick's occupancies: equal for equal content, however it came about.
    pub fn brick_hash(&mut self, index: BrickIndex) -> u64 {
        let brick = index.dense();
        if self.changes.unmark_stale(brick) {
            self.hashes.refresh(brick, self.field.view(brick));
        }
        self.hashes.of_brick(brick)
    }

    /// Hash of the whole clay, grid and classes included. Only bricks changed since the last call are read: about half
    /// a microsecond each.
    pub fn hash(&mut self) -> u64 {
        self.refresh_hashes(usize::MAX);
        let classes = self.classes.as_ref().map_or(0, |classes| classes.digest());
        self.hashes.total().wrapping_add(classes)
    }

    /// Brings up to `most` brick hashes up to date and returns how many are left, to spread the work of [`Clay::hash`]
    /// over ticks.
    pub fn refresh_hashes(&mut self, most: usize) -> usize {
        for _ in 0..most {
            let Some(brick) = self.changes.take_stale() else {
                break;
            };
            self.hashes.refresh(brick, self.field.view(brick));
        }
        self.changes.stale_count()
    }

    /// Has the operating system commit the memory that tools may come to need next, so that no cut waits for it: 8 MiB
    /// beyond what is in use, or all that the block can ever need, if that is less.
    pub fn commit_pages(&mut self) {
        self.field.commit_ahead(usize::MAX);
    }

    /// The same again, as cutting goes on: at most two bricks a call, which is more than a tool at work opens in a
    /// tick.
    pub fn commit_ahead(&mut self) {
        self.field.commit_ahead(2);
    }

    /// Whether [`commit_ahead`](Self::commit_ahead) has nothing to do until the clay changes.
    #[must_use]
    pub fn is_committed_ahead(&self) -> bool {
        self.field.is_committed_ahead()
    }
}

/// The first voxel of a brick that has clay although it lies outside the grid.
fn first_outside(extent: [usize; 3], view: BrickView<'_>) -> Option<usize> {
    if extent == [BRICK_EDGE; 3] {
        return None;
    }
    let outside = |at: usize| {
        let place = [
            at % BRICK_EDGE,
            at / BRICK_EDGE % BRICK_EDGE,
            at / BRICK_EDGE / BRICK_EDGE,
        ];
        (0..3).any(|axis| extent[axis] <= place[axis])
    };
    match view {
        BrickView::Empty => None,
        BrickView::Full => (0..).find(|&at| outside(at)),
        BrickView::Voxels(voxels) => voxels
            .iter()
            .enumerate()
            .find(|&(at, &voxel)| voxel != 0 && outside(at))
            .map(|(at, _)| at),
    }
}
