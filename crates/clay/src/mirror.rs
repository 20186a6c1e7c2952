//! A copy of clay that lies elsewhere, to be looked at: it takes bricks as they are told, and knows whose surface has
//! to be found again.
//!
//! Bricks that are empty or full throughout cost nothing, so a copy of much clay is as small as what was cut of it.

use std::collections::VecDeque;

use thiserror::Error;

use crate::field::{BrickView, SOLID};
use crate::grid::{BRICK_EDGE, BRICK_VOXELS, MAX_AXIS_VOXELS};
use crate::surface::{BrickMesh, BrickMesher, Bricks, HALO};

/// Most bricks along an axis: no grid has more.
const MAX_AXIS_BRICKS: u16 = (MAX_AXIS_VOXELS / BRICK_EDGE) as u16;
/// Voxels along the edge of a block whose mean [`Mirror::coarse`] tells.
pub const COARSENESS: usize = 4;
/// Blocks of a brick.
pub const COARSE_VOXELS: usize = (BRICK_EDGE / COARSENESS).pow(3);
/// How far a brick's part of the surface looks into its neighbours, voxels.
const REACH: usize = HALO;

/// A grid that cannot be mirrored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{got} bricks along axis {axis}, a grid has at most {MAX_AXIS_BRICKS}")]
pub struct TooManyBricks {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Bricks along it.
    pub got: u16,
}

/// A copy of clay elsewhere.
#[derive(Default)]
pub struct Mirror {
    bricks: BrickStore,
    /// In the order in which they went out of date.
    stale: VecDeque<u32>,
    is_stale: Vec<bool>,
    mesher: BrickMesher,
}

/// Bricks side by side: x fastest, then y, then z.
#[derive(Default)]
struct BrickStore {
    counts: [u16; 3],
    contents: Vec<Content>,
}

#[derive(Clone)]
enum Content {
    Empty,
    Full,
    Voxels(Box<[u8; BRICK_VOXELS]>),
}

/// The box around voxels that differ, in a brick: lowest and highest, both within.
struct Changed {
    low: [usize; 3],
    high: [usize; 3],
}

impl Mirror {
    /// Forgets everything: a grid of so many bricks along x, y, z, all of them air, and all of them stale.
    ///
    /// # Errors
    /// When no grid is as large; everything is as it was then.
    pub fn start_anew(&mut self, counts: [u16; 3]) -> Result<(), TooManyBricks> {
        if let Some(axis) = (0..3).find(|&axis| MAX_AXIS_BRICKS < counts[axis]) {
            let got = counts[axis];
            return Err(TooManyBricks { axis, got });
        }
        let count = counts.map(usize::from).iter().product();
        self.bricks.counts = counts;
        self.bricks.contents = vec![Content::Empty; count];
        self.stale.clear();
        self.is_stale = vec![false; count];
        self.mark_all();
        Ok(())
    }

    /// Bricks along x, y, z.
    #[must_use]
    pub const fn counts(&self) -> [u16; 3] {
        self.bricks.counts
    }

    /// What a brick holds; air beyond the grid.
    #[must_use]
    pub fn brick(&self, at: [u16; 3]) -> BrickView<'_> {
        self.bricks.content(at)
    }

    /// Replaces a brick, by its number in the dense order. Stale are then the brick and those neighbours that see any
    /// of the changed voxels, if voxels changed. A number beyond the grid changes nothing.
    pub fn replace(&mut self, index: u32, content: BrickView<'_>) {
        let Some(before) = self.bricks.contents.get_mut(index as usize) else {
            return;
        };
        let after = Content::from(content);
        let changed = Changed::between(&before.view(), &after.view());
        *before = after;
        if let Some(changed) = changed {
            self.mark_around(index, &changed);
        }
    }

    /// Replaces an eighth of a brick by a whole brick of clay that is twice as fine: each voxel by the mean of eight.
    /// `eighth` is 0 or 1 for the lower or the upper half along x, y, z.
    pub fn replace_eighth(&mut self, index: u32, eighth: [usize; 3], fine: BrickView<'_>) {
        let Some(brick) = self.bricks.contents.get(index as usize) else {
            return;
        };
        let mut voxels = brick.voxels();
        put_halved(&mut voxels, eighth, fine);
        self.replace(index, BrickView::Voxels(&voxels));
    }

    /// Calls every brick stale: somebody needs all of the surface.
    pub fn mark_all(&mut self) {
        for index in 0..self.bricks.contents.len() as u32 {
            self.mark(index);
        }
    }

    /// Bricks whose surface is out of date.
    #[must_use]
    pub fn stale_count(&self) -> usize {
        self.stale.len()
    }

    /// A brick whose surface is out of date, or nothing; it counts as done from here on.
    pub fn take_stale(&mut self) -> Option<u32> {
        let index = self.stale.pop_front()?;
        self.is_stale[index as usize] = false;
        Some(index)
    }

    /// A brick's part of the surface, in place of whatever `mesh` holds.
    pub fn mesh(&mut self, index: u32, mesh: &mut BrickMesh) {
        let at = self.bricks.coordinates(index);
        self.mesher.mesh(&self.bricks, at, mesh);
    }

    /// Mean occupancy of a brick's blocks of 4³ voxels, x fastest, then y, then z; air beyond the grid.
    #[must_use]
    pub fn coarse(&self, index: u32) -> [u8; COARSE_VOXELS] {
        const PER_EDGE: usize = BRICK_EDGE / COARSENESS;
        const VOXELS: u32 = COARSENESS.pow(3) as u32;
        let voxels = match self.bricks.contents.get(index as usize) {
            None | Some(Content::Empty) => return [0; COARSE_VOXELS],
            Some(Content::Full) => return [SOLID; COARSE_VOXELS],
            Some(Content::Voxels(voxels)) => voxels,
        };
        let mut sums = [0_u32; COARSE_VOXELS];
        for (row, four) in voxels.as_chunks::<COARSENESS>().0.iter().enumerate() {
            let [x, y, z] = [row % PER_EDGE, row / 16 % PER_EDGE, row / 256];
            let sum: u32 = four.iter().copied().map(u32::from).sum();
            sums[x + PER_EDGE * (y + PER_EDGE * z)] += sum;
        }
        sums.map(|sum| ((sum + VOXELS / 2) / VOXELS) as u8)
    }

    fn mark(&mut self, index: u32) {
        if !std::mem::replace(&mut self.is_stale[index as usize], true) {
            self.stale.push_back(index);
        }
    }

    fn mark_around(&mut self, index: u32, changed: &Changed) {
        let at = self.bricks.coordinates(index);
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let before = u16::from(changed.low[axis] < REACH);
            let after = u16::from(BRICK_EDGE - REACH <= changed.high[axis]);
            let last = self.bricks.counts[axis] - 1;
            at[axis].saturating_sub(before)..=(at[axis] + after).min(last)
        });
        for k in z {
            for j in y.clone() {
                for i in x.clone() {
                    self.mark(self.bricks.index([i, j, k]));
                }
            }
        }
    }
}

impl BrickStore {
    fn index(&self, at: [u16; 3]) -> u32 {
        let [x, y, z] = at.map(u32::from);
        let [nx, ny, _] = self.counts.map(u32::from);
        x + nx * (y + ny * z)
    }

    fn coordinates(&self, index: u32) -> [u16; 3] {
        let [nx, ny, _] = self.counts.map(|count| u32::from(count).max(1));
        [index % nx, index / nx % ny, index / (nx * ny)].map(|at| at as u16)
    }
}

impl Bricks for BrickStore {
    fn content(&self, at: [u16; 3]) -> BrickView<'_> {
        if (0..3).any(|axis| self.counts[axis] <= at[axis]) {
            return BrickView::Empty;
        }
        self.contents[self.index(at) as usize].view()
    }
}

impl Content {
    fn view(&self) -> BrickView<'_> {
        match self {
            Self::Empty => BrickView::Empty,
            Self::Full => BrickView::Full,
            Self::Voxels(voxels) => BrickView::Voxels(voxels),
        }
    }

    fn voxels(&self) -> Box<[u8; BRICK_VOXELS]> {
        match self {
            Self::Empty => Box::new([0; BRICK_VOXELS]),
            Self::Full => Box::new([SOLID; BRICK_VOXELS]),
            Self::Voxels(voxels) => voxels.clone(),
        }
    }
}

impl From<BrickView<'_>> for Content {
    /// Voxels that are all air or all solid are known again as such.
    fn from(view: BrickView<'_>) -> Self {
        match view {
            BrickView::Empty => Self::Empty,
            BrickView::Full => Self::Full,
            BrickView::Voxels(voxels) if *voxels == [0; BRICK_VOXELS] => Self::Empty,
            BrickView::Voxels(voxels) if *voxels == [SOLID; BRICK_VOXELS] => Self::Full,
            BrickView::Voxels(voxels) => Self::Voxels(Box::new(*voxels)),
        }
    }
}

impl Changed {
    /// Nothing when no voxel differs.
    fn between(before: &BrickView<'_>, after: &BrickView<'_>) -> Option<Self> {
        if let (BrickView::Empty, BrickView::Empty) | (BrickView::Full, BrickView::Full) =
            (before, after)
        {
            return None;
        }
        let mut changed = Self {
            low: [BRICK_EDGE; 3],
            high: [0; 3],
        };
        for row in 0..BRICK_VOXELS / BRICK_EDGE {
            let was = before.row(row);
            let is = after.row(row);
            if was == is {
                continue;
            }
            for x in (0..BRICK_EDGE).filter(|&x| was[x] != is[x]) {
                for (axis, place) in [x, row % BRICK_EDGE, row / BRICK_EDGE]
                    .into_iter()
                    .enumerate()
                {
                    changed.low[axis] = changed.low[axis].min(place);
                    changed.high[axis] = changed.high[axis].max(place);
                }
            }
        }
        (changed.low[0] < BRICK_EDGE).then_some(changed)
    }
}

impl BrickView<'_> {
    /// A row of voxels along x: the rows count along y, then along z.
    fn row(&self, row: usize) -> [u8; BRICK_EDGE] {
        match self {
            Self::Empty => [0; BRICK_EDGE],
            Self::Full => [SOLID; BRICK_EDGE],
            Self::Voxels(voxels) => voxels.as_chunks().0[row],
        }
    }
}

/// Writes the means of a brick's blocks of 2³ voxels into an eighth of another.
fn put_halved(voxels: &mut [u8; BRICK_VOXELS], eighth: [usize; 3], fine: BrickView<'_>) {
    const HALF: usize = BRICK_EDGE / 2;
    let rows = voxels.as_chunks_mut::<BRICK_EDGE>().0;
    let [x, y, z] = eighth.map(|half| HALF * half);
    for k in 0..HALF {
        for j in 0..HALF {
            let four = [0, 1, BRICK_EDGE, BRICK_EDGE + 1]
                .map(|beside| fine.row(2 * (j + BRICK_EDGE * k) + beside));
            let row = &mut rows[y + j + BRICK_EDGE * (z + k)][x..x + HALF];
            for (i, mean) in row.iter_mut().enumerate() {
                let pairs = four.map(|row| u16::from(row[2 * i]) + u16::from(row[2 * i + 1]));
                *mean = ((pairs.iter().sum::<u16>() + 4) / 8) as u8;
            }
        }
    }
}
