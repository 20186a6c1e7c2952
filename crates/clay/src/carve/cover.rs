//! What a sweep passes through, without cutting it.

use super::{BrickAt, EDGE, InBrick, Segment, Solid, Start, Tables, Take, TileIndex, take_solids};
use crate::field::SOLID;
use crate::grid::{BRICK_EDGE, BRICK_VOXELS, Grid};
use crate::lanes::Removed;
use crate::sweep::Sweep;

/// Which part of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// All of it.
    All,
    /// The tool where it ends.
    End,
}

/// Tells brick by brick what that part of a sweep would leave of solid clay: the brick's dense number, its place in
/// bricks, and its voxels. A brick may come twice, with what each of two solids leaves; the lesser counts. Voxels that
/// a brick has outside the grid are told as solid: nothing is covered there.
pub(crate) fn covered(
    grid: &Grid,
    tables: &mut Tables,
    sweep: &Sweep,
    part: Part,
    each: impl FnMut(usize, [usize; 3], &[u8; BRICK_VOXELS]),
) {
    let sweep = match part {
        Part::All => *sweep,
        Part::End => Sweep {
            from: sweep.to,
            ..*sweep
        },
    };
    let segment = Segment::new(&sweep, grid.voxel_size_m());
    let mut cover = Cover { grid, tables, each };
    take_solids(&sweep, &segment, Start::Unknown, &mut cover);
}

/// Voxels of a grid that the tool may cover where the sweep ends, along each axis from the first up to but not
/// including the last; `None` where there are none.
pub(crate) fn end_bounds(grid: &Grid, sweep: &Sweep) -> Option<[[i32; 2]; 3]> {
    let sweep = Sweep {
        from: sweep.to,
        ..*sweep
    };
    let segment = Segment::new(&sweep, grid.voxel_size_m());
    let mut bounds = Bounds { grid, within: None };
    take_solids(&sweep, &segment, Start::Unknown, &mut bounds);
    bounds.within
}

struct Bounds<'a> {
    grid: &'a Grid,
    within: Option<[[i32; 2]; 3]>,
}

impl Take for Bounds<'_> {
    fn take<S: Solid>(&mut self, solid: &S) {
        self.within = within(self.grid, solid);
    }
}

/// Voxels of the grid that a solid may change, if there are any.
fn within(grid: &Grid, solid: &impl Solid) -> Option<[[i32; 2]; 3]> {
    let (voxels, bounds) = (grid.voxels().map(i32::from), solid.bounds());
    let within: [[i32; 2]; 3] =
        std::array::from_fn(|axis| [bounds[axis][0].max(0), bounds[axis][1].min(voxels[axis])]);
    within
        .iter()
        .all(|[first, end]| first < end)
        .then_some(within)
}

struct Cover<'a, F> {
    grid: &'a Grid,
    tables: &'a mut Tables,
    each: F,
}

impl<F: FnMut(usize, [usize; 3], &[u8; BRICK_VOXELS])> Take for Cover<'_, F> {
    fn take<S: Solid>(&mut self, solid: &S) {
        let voxels = self.grid.voxels().map(i32::from);
        let Some(within) = within(self.grid, solid) else {
            return;
        };
        let bricks = within.map(|[first, end]| [first / EDGE, (end - 1) / EDGE + 1]);
        let [along_x, along_y, along_z] = bricks.map(|[first, end]| first as usize..end as usize);
        let [bricks_x, bricks_y, _] = self.grid.bricks().map(usize::from);
        solid.prepare(self.tables, bricks);
        for z in along_z {
            for y in along_y.clone() {
                for x in along_x.clone() {
                    if !solid.reaches(BrickAt([x, y, z])) {
                        continue;
                    }
                    let mut left = [SOLID; BRICK_VOXELS];
                    if 0 < leave(&solid.in_brick(self.tables, BrickAt([x, y, z])), &mut left) {
                        let extent = std::array::from_fn(|axis| {
                            (voxels[axis] as usize - [x, y, z][axis] * BRICK_EDGE).min(BRICK_EDGE)
                        });
                        forget_outside(&mut left, extent);
                        (self.each)((z * bricks_y + y) * bricks_x + x, [x, y, z], &left);
                    }
                }
            }
        }
    }
}

/// Leaves in a brick what a solid leaves; returns how much that was less than all.
fn leave(solid: &impl InBrick, left: &mut [u8; BRICK_VOXELS]) -> u32 {
    let mut removed = Removed::nothing();
    for layer in 0..BRICK_EDGE {
        let bands = solid.bands(layer) & 0xF;
        for band in (0..4).filter(|band| bands >> band & 1 != 0) {
            let tiles = solid.tiles(layer, band);
            for tile in (0..4).filter(|tile| tiles >> tile & 1 != 0) {
                let at = TileIndex((layer << 4 | band << 2 | tile) as u8);
                solid.leaves(at).cut(left, at.0, &mut removed);
            }
        }
    }
    removed.sum()
}

fn forget_outside(left: &mut [u8; BRICK_VOXELS], extent: [usize; 3]) {
    if extent == [BRICK_EDGE; 3] {
        return;
    }
    let [x, y, z] = extent;
    let (rows, _) = left.as_chunks_mut::<BRICK_EDGE>();
    for (number, row) in rows.iter_mut().enumerate() {
        let inside = number % BRICK_EDGE < y && number / BRICK_EDGE < z;
        row[if inside { x } else { 0 }..].fill(SOLID);
    }
}
