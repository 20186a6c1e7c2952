//! Occupancy of the voxels, stored by bricks.
//!
//! An occupancy is a byte, 0 for air and 255 for solid clay. A brick is empty, full, or has a slot of 4 KiB in one
//! slab. The slab has room for every brick from the start and is asked for zeroed, so that the operating system commits
//! its pages only as they are first written to, a little ahead of their use ([`Field::commit_ahead`]), and carving
//! itself never allocates. Memory follows the surface. Two slots stand for all bricks that are empty and all that are
//! full: whoever reads ([`Field::reader`]) finds a slot for every place, and beyond the grid, too.

use crate::fresh::fresh_voxels;
use crate::grid::{BRICK_EDGE, BRICK_VOXELS, BrickIndex, Grid};
use crate::shape::Shape;

/// Occupancy of solid clay.
pub const SOLID: u8 = 255;
/// Slot of a brick that is air throughout, and of one that is solid throughout. They are only read.
const AIR_SLOT: u32 = 0;
const SOLID_SLOT: u32 = 1;
/// The first slot that a brick may have for itself.
const FIRST_SLOT: u32 = 2;
/// Sum of the occupancies of a full brick.
pub(crate) const FULL_SUM: u32 = BRICK_VOXELS as u32 * SOLID as u32;

/// Slots that are kept ready beyond those in use: what several tools may come to need at once, and what a block of
/// usual size may ever need, in 8 MiB.
const SLOTS_READY: usize = 2048;

/// A brick is looked through again when one part of so many of its clay is gone.
const LOOKED_THROUGH_AFTER: u32 = 8;

/// The content of a brick: x fastest, then y, then z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BrickView<'a> {
    /// Air throughout.
    Empty,
    /// Solid throughout.
    Full,
    /// Occupancies, 0 to 255.
    Voxels(&'a [u8; BRICK_VOXELS]),
}

/// How a brick is stored. Canonical: a slot never holds a brick that is empty or full throughout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Brick {
    Empty,
    Full,
    Slot(u32),
}

/// Tiles of a brick, four rows by four voxels, that may have clay: a word for each layer, of which the first four bits
/// are the tiles of the first four rows, and so on. A tile without its bit is air.
#[derive(Clone, Copy, Debug)]
struct Tiles {
    with_clay: [u16; BRICK_EDGE],
    /// Sum of the brick's occupancies when it was looked through last.
    sum: u32,
}

#[derive(Debug)]
pub(crate) struct Field {
    grid: Grid,
    bricks: Vec<Brick>,
    /// Where in the slab to read each brick, with a border of one empty brick all around the grid.
    places: Vec<u32>,
    /// Sum of occupancies of each brick.
    sums: Vec<u32>,
    /// Which tiles of each brick may have clay.
    tiles: Vec<Tiles>,
    slab: Vec<u8>,
    /// Slots given back; its capacity is that of the slab.
    free: Vec<u32>,
    /// Slots from here on were never used.
    unused_from: u32,
    /// Slots from here on were never written to, so that the operating system has yet to commit their pages.
    uncommitted_from: u32,
    total: u64,
}

/// Where occupancies are kept. Places are counted from the lower corner of a border one brick wide all around the grid;
/// all is air there.
#[derive(Clone, Copy)]
pub(crate) struct Reader<'a> {
    places: &'a [u32],
    slab: &'a [u8],
    /// How far apart neighbours along each axis are in `places`.
    pub(crate) strides: [usize; 3],
}

impl Reader<'_> {
    /// The occupancies of a voxel and those after it along x, y and z, the first lowest, in this order. All are in one
    /// brick: `brick` by the strides, `voxel` the first one's number in it.
    #[inline(always)]
    pub(crate) fn eight(&self, brick: u32, voxel: u32) -> u64 {
        const Y: usize = BRICK_EDGE;
        const Z: usize = BRICK_EDGE * BRICK_EDGE;
        let at = (self.places[brick as usize] + voxel) as usize;
        let eight = &self.slab[at..at + Z + Y + 2];
        let pair = |at: usize| u64::from(u16::from_le_bytes([eight[at], eight[at + 1]]));
        pair(0) | pair(Y) << 16 | pair(Z) << 32 | pair(Z + Y) << 48
    }

    /// The occupancy of a voxel.
    #[inline(always)]
    pub(crate) fn one(&self, brick: u32, voxel: u32) -> u8 {
        self.slab[(self.places[brick as usize] + voxel) as usize]
    }
}

impl Tiles {
    const NONE: Self = Self {
        with_clay: [0; BRICK_EDGE],
        sum: 0,
    };
    const ALL: Self = Self {
        with_clay: [u16::MAX; BRICK_EDGE],
        sum: FULL_SUM,
    };
}

impl Field {
    /// Every voxel gets the share of it that lies in the shape, rounded to 1/255.
    pub(crate) fn filled(grid: Grid, shape: &Shape) -> Self {
        let mut field = Self::empty(grid);
        let scale = 1.0 / grid.voxel_size_m();
        let boxes: Vec<_> = shape
            .boxes()
            .map(|(lower_m, upper_m)| (lower_m.map(|at| at * scale), upper_m.map(|at| at * scale)))
            .collect();
        for dense in 0..grid.brick_count() {
            match fresh_voxels(&grid, BrickIndex::new(dense), &boxes) {
                Some(voxels) => field.replace(dense, BrickView::Voxels(&voxels)),
                None => field.replace(dense, BrickView::Full),
            };
        }
        field
    }

    /// Air throughout.
    pub(crate) fn empty(grid: Grid) -> Self {
        let count = grid.brick_count();
        let mut slab = vec![0; (count + FIRST_SLOT as usize) * BRICK_VOXELS];
        slab.as_chunks_mut::<BRICK_VOXELS>().0[SOLID_SLOT as usize].fill(SOLID);
        let bordered = grid.bricks().map(|count| usize::from(count) + 2);
        Self {
            grid,
            bricks: vec![Brick::Empty; count],
            places: vec![place_of(AIR_SLOT); bordered.into_iter().product()],
            sums: vec![0; count],
            tiles: vec![Tiles::NONE; count],
            slab,
            free: Vec::with_capacity(count),
            unused_from: FIRST_SLOT,
            uncommitted_from: FIRST_SLOT,
            total: 0,
        }
    }

    pub(crate) const fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Sum of all occupancies.
    pub(crate) const fn total(&self) -> u64 {
        self.total
    }

    pub(crate) fn brick_sum(&self, brick: usize) -> u32 {
        self.sums[brick]
    }

    #[inline]
    pub(crate) fn brick(&self, brick: usize) -> Brick {
        self.bricks[brick]
    }

    /// Changes how a brick is stored.
    fn set(&mut self, brick: usize, stored: Brick) {
        self.bricks[brick] = stored;
        let [x, y, z] = self
            .grid
            .brick_coordinates(BrickIndex::new(brick))
            .map(|at| usize::from(at) + 1);
        let [_, stride_y, stride_z] = self.reader().strides;
        self.places[z * stride_z + y * stride_y + x] = place_of(match stored {
            Brick::Empty => AIR_SLOT,
            Brick::Full => SOLID_SLOT,
            Brick::Slot(slot) => slot,
        });
    }

    /// Reads places, in the grid and about it.
    #[inline]
    pub(crate) fn reader(&self) -> Reader<'_> {
        let [x, y, _] = self.grid.bricks().map(|count| usize::from(count) + 2);
        Reader {
            places: &self.places,
            slab: &self.slab,
            strides: [1, x, x * y],
        }
    }

    pub(crate) fn view(&self, brick: usize) -> BrickView<'_> {
        match self.bricks[brick] {
            Brick::Empty => BrickView::Empty,
            Brick::Full => BrickView::Full,
            Brick::Slot(slot) => BrickView::Voxels(self.slot(slot)),
        }
    }

    #[inline]
    pub(crate) fn slot(&self, slot: u32) -> &[u8; BRICK_VOXELS] {
        &self.slab.as_chunks::<BRICK_VOXELS>().0[slot as usize]
    }

    #[inline]
    pub(crate) fn slot_mut(&mut self, slot: u32) -> &mut [u8; BRICK_VOXELS] {
        &mut self.slab.as_chunks_mut::<BRICK_VOXELS>().0[slot as usize]
    }

    /// Occupancy of a voxel; air outside the grid.
    pub(crate) fn occupancy(&self, voxel: [i32; 3]) -> u8 {
        let bricks = self.grid.bricks().map(usize::from);
        let edge = BRICK_EDGE as i32;
        let outside =
            (0..3).any(|axis| voxel[axis] < 0 || bricks[axis] <= (voxel[axis] / edge) as usize);
        if outside {
            return 0;
        }
        let [x, y, z] = voxel.map(|at| at as usize);
        let dense = ((z / BRICK_EDGE) * bricks[1] + y / BRICK_EDGE) * bricks[0] + x / BRICK_EDGE;
        match self.bricks[dense] {
            Brick::Empty => 0,
            Brick::Full => SOLID,
            Brick::Slot(slot) => {
                let (x, y, z) = (x % BRICK_EDGE, y % BRICK_EDGE, z % BRICK_EDGE);
                self.slot(slot)[(z * BRICK_EDGE + y) * BRICK_EDGE + x]
            }
        }
    }

    /// Whether all voxels from one up to and including another, and all between, are in bricks without clay or outside
    /// the grid.
    pub(crate) fn is_air(&self, lowest: [i32; 3], highest: [i32; 3]) -> bool {
        let counts = self.grid.bricks().map(i32::from);
        let edge = BRICK_EDGE as i32;
        let range = |axis: usize| {
            lowest[axis].div_euclid(edge).max(0)
                ..(highest[axis].div_euclid(edge) + 1).min(counts[axis])
        };
        range(2).all(|z| {
            range(1).all(|y| {
                let row = (z * counts[1] + y) * counts[0];
                range(0).all(|x| self.bricks[(row + x) as usize] == Brick::Empty)
            })
        })
    }

    /// Which tiles of a brick may have clay: a word for each layer, a bit for each tile, along x first. All others are
    /// air.
    #[inline]
    pub(crate) fn tiles_with_clay(&self, brick: usize) -> [u16; BRICK_EDGE] {
        self.tiles[brick].with_clay
    }

    /// Gives a full brick a slot of its own, so that part of it can be removed.
    pub(crate) fn materialise(&mut self, brick: usize) -> u32 {
        let slot = self.take_slot();
        self.slot_mut(slot).fill(SOLID);
        self.set(brick, Brick::Slot(slot));
        slot
    }

    /// Takes what was removed from a brick that has a slot into the balance, and gives the slot back when nothing is
    /// left.
    #[inline]
    pub(crate) fn count_removal(&mut self, brick: usize, removed: u32) {
        self.total -= u64::from(removed);
        self.sums[brick] -= removed;
        let sum = self.sums[brick];
        if sum == 0 {
            self.release(brick);
            self.set(brick, Brick::Empty);
            self.tiles[brick] = Tiles::NONE;
        } else if self.tiles[brick].sum / LOOKED_THROUGH_AFTER < self.tiles[brick].sum - sum {
            self.look_through(brick);
        }
    }

    /// Finds out which tiles of a brick have clay.
    fn look_through(&mut self, brick: usize) {
        let mut tiles = Tiles {
            sum: self.sums[brick],
            ..Tiles::NONE
        };
        match self.view(brick) {
            BrickView::Empty => {}
            BrickView::Full => tiles = Tiles::ALL,
            BrickView::Voxels(voxels) => {
                let (layers, _) = voxels.as_chunks::<{ BRICK_EDGE * BRICK_EDGE }>();
                for (with_clay, layer) in tiles.with_clay.iter_mut().zip(layers) {
                    let (rows, _) = layer.as_chunks::<BRICK_EDGE>();
                    for (band, rows) in rows.as_chunks::<4>().0.iter().enumerate() {
                        let any = rows
                            .map(u128::from_le_bytes)
                            .into_iter()
                            .fold(0, |any, row| any | row);
                        for tile in 0..4 {
                            let has_clay = (any >> (32 * tile)) as u32 != 0;
                            *with_clay |= u16::from(has_clay) << (4 * band + tile);
                        }
                    }
                }
            }
        }
        self.tiles[brick] = tiles;
    }

    /// Puts new content in a brick and returns whether anything changed. Allocates nothing.
    pub(crate) fn replace(&mut self, brick: usize, view: BrickView<'_>) -> bool {
        if self.view(brick) == canonical(view) {
            return false;
        }
        let view = canonical(view);
        let sum = sum_of(view);
        match view {
            BrickView::Empty | BrickView::Full => {
                self.release(brick);
                let full = view == BrickView::Full;
                self.set(brick, if full { Brick::Full } else { Brick::Empty });
            }
            BrickView::Voxels(voxels) => {
                let slot = match self.bricks[brick] {
                    Brick::Slot(slot) => slot,
                    Brick::Empty | Brick::Full => self.take_slot(),
                };
                *self.slot_mut(slot) = *voxels;
                self.set(brick, Brick::Slot(slot));
            }
        }
        self.total = self.total - u64::from(self.sums[brick]) + u64::from(sum);
        self.sums[brick] = sum;
        self.look_through(brick);
        true
    }

    /// Has the operating system commit the pages of up to `most` slots ahead of their use, until as many are ready as
    /// tools may come to need at once.
    pub(crate) fn commit_ahead(&mut self, most: usize) {
        let slots = self.slab.len() / BRICK_VOXELS;
        let ready =
            self.free.len() + self.uncommitted_from.saturating_sub(self.unused_from) as usize;
        let first = self.uncommitted_from.max(self.unused_from) as usize;
        let end = slots.min(first + most.min(SLOTS_READY.saturating_sub(ready)));
        for slot in first..end {
            // The last byte: a slot may begin in a page of the slot before, whose last byte was written to.
            self.slab[(slot + 1) * BRICK_VOXELS - 1] = 0;
        }
        self.uncommitted_from = end as u32;
    }

    /// Whether that is done.
    pub(crate) fn is_committed_ahead(&self) -> bool {
        let slots = self.slab.len() / BRICK_VOXELS;
        let first = self.uncommitted_from.max(self.unused_from);
        let ready = self.free.len() + (first - self.unused_from) as usize;
        SLOTS_READY <= ready || slots <= first as usize
    }

    fn release(&mut self, brick: usize) {
        if let Brick::Slot(slot) = self.bricks[brick] {
            self.free.push(slot);
        }
    }

    fn take_slot(&mut self) -> u32 {
        self.free.pop().unwrap_or_else(|| {
            let slot = self.unused_from;
            self.unused_from += 1;
            slot
        })
    }
}

impl Clone for Field {
    /// Copies the slots in use, and commits those that were; pages never carved stay uncommitted in the copy too.
    fn clone(&self) -> Self {
        let mut free = Vec::with_capacity(self.bricks.len());
        free.extend_from_slice(&self.free);
        let mut slab = vec![0; self.slab.len()];
        slab.as_chunks_mut::<BRICK_VOXELS>().0[SOLID_SLOT as usize].fill(SOLID);
        for brick in &self.bricks {
            if let Brick::Slot(slot) = *brick {
                let at = slot as usize * BRICK_VOXELS;
                slab[at..at + BRICK_VOXELS].copy_from_slice(self.slot(slot));
            }
        }
        for &slot in &free {
            slab[(slot as usize + 1) * BRICK_VOXELS - 1] = 0;
        }
        Self {
            grid: self.grid,
            bricks: self.bricks.clone(),
            places: self.places.clone(),
            sums: self.sums.clone(),
            tiles: self.tiles.clone(),
            slab,
            free,
            unused_from: self.unused_from,
            uncommitted_from: self.unused_from,
            total: self.total,
        }
    }
}

/// Where a slot begins in the slab.
const fn place_of(slot: u32) -> u32 {
    slot * BRICK_VOXELS as u32
}

/// Sum of the occupancies of a brick.
pub(crate) fn sum_of(view: BrickView<'_>) -> u32 {
    match view {
        BrickView::Empty => 0,
        BrickView::Full => FULL_SUM,
        BrickView::Voxels(voxels) => voxels.iter().map(|&occupancy| u32::from(occupancy)).sum(),
    }
}

/// Says empty or full of voxels that are all air or all solid.
pub(crate) fn canonical(view: BrickView<'_>) -> BrickView<'_> {
    match view {
        BrickView::Voxels(voxels) if voxels.iter().all(|&occupancy| occupancy == 0) => {
            BrickView::Empty
        }
        BrickView::Voxels(voxels) if voxels.iter().all(|&occupancy| occupancy == SOLID) => {
            BrickView::Full
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{SteppedBlock, SteppedDimensions};

    fn field(size_m: [f64; 3]) -> Field {
        let shape = Shape::Block { size_m };
        Field::filled(shape.grid(1e-3).unwrap(), &shape)
    }

    #[test]
    fn a_fresh_block_is_crisp_and_full_bricks_take_no_slot() {
        let field = field([0.040, 0.032, 0.016]);
        assert_eq!(field.total(), 40 * 32 * 16 * 255);
        assert_eq!(field.brick(0), Brick::Full);
        assert_eq!(
            field.unused_from,
            FIRST_SLOT + 2,
            "only the two bricks at the odd end hold voxels"
        );
        assert_eq!(field.occupancy([39, 31, 15]), 255);
        for outside in [
            [40, 0, 0],
            [47, 0, 0],
            [48, 0, 0],
            [0, 32, 0],
            [-1, 0, 0],
            [0, 0, i32::MAX],
        ] {
            assert_eq!(field.occupancy(outside), 0);
        }
    }

    #[test]
    fn a_voxel_cut_by_the_blocks_face_holds_its_share() {
        let field = field([0.0105, 0.010, 0.010]);
        assert_eq!(field.occupancy([9, 5, 5]), 255);
        assert_eq!(field.occupancy([10, 5, 5]), 128);
        let volume = field.total() as f64 / 255.0;
        assert!((volume - 1050.0).abs() < 0.25);
    }

    #[test]
    fn the_steps_stand_where_they_should_even_inside_a_voxel() {
        let shape = Shape::Stepped(
            SteppedBlock::new(SteppedDimensions {
                edges_m: vec![0.0105, 0.020, 0.030],
                depths_of_cut_m: vec![0.004, 0.008],
                base_m: 0.002,
                width_m: 0.010,
            })
            .unwrap(),
        );
        let field = Field::filled(shape.grid(1e-3).unwrap(), &shape);
        assert_eq!(field.occupancy([9, 4, 0]), 0);
        assert_eq!(field.occupancy([10, 4, 0]), 128);
        assert_eq!(field.occupancy([19, 4, 5]), 255);
        assert_eq!(field.occupancy([19, 4, 6]), 0);
        assert_eq!(field.occupancy([20, 4, 9]), 255);
        assert_eq!(field.occupancy([29, 9, 9]), 255);
        let volume_m3 = field.total() as f64 / 255.0 * 1e-9;
        assert!((volume_m3 / shape.volume_m3() - 1.0).abs() < 1e-3);
    }

    #[test]
    fn air_is_where_no_brick_with_clay_is() {
        let mut field = field([0.040, 0.032, 0.016]);
        assert!(field.is_air([-9, -9, -9], [-1, 90, 90]));
        assert!(field.is_air([0, 0, 16], [90, 90, 90]));
        assert!(!field.is_air([-9, -9, -9], [0, 0, 0]));
        assert!(!field.is_air([-9, -9, -9], [90, 90, 90]));
        assert!(!field.is_air([33, 17, 3], [33, 17, 3]));
        assert!(field.replace(0, BrickView::Empty));
        assert!(field.is_air([-5, -5, -5], [15, 15, 15]));
        assert!(!field.is_air([-5, -5, -5], [16, 15, 15]));
    }

    #[test]
    fn replacing_keeps_sums_and_gives_slots_back() {
        let mut field = field([0.032, 0.016, 0.016]);
        let mut voxels = [0; BRICK_VOXELS];
        voxels[17] = 9;
        assert!(field.replace(1, BrickView::Voxels(&voxels)));
        assert_eq!(field.total(), u64::from(FULL_SUM) + 9);
        assert!(
            !field.replace(1, BrickView::Voxels(&voxels)),
            "the same again changes nothing"
        );
        let unused = field.unused_from;
        assert!(field.replace(1, BrickView::Empty));
        assert_eq!(field.total(), u64::from(FULL_SUM));
        assert!(
            !field.replace(0, BrickView::Voxels(&[255; BRICK_VOXELS])),
            "full is full"
        );
        assert!(field.replace(0, BrickView::Voxels(&voxels)));
        assert_eq!(field.unused_from, unused, "the slot is used again");
        assert_eq!(field.total(), 9);
    }

    #[test]
    fn a_removal_to_nothing_empties_the_brick() {
        let mut field = field([0.016; 3]);
        let slot = field.materialise(0);
        field.slot_mut(slot).fill(0);
        field.count_removal(0, FULL_SUM);
        assert_eq!((field.brick(0), field.total()), (Brick::Empty, 0));
        assert_eq!(field.free, [slot]);
    }

    #[test]
    fn slots_are_committed_ahead_of_their_use_and_no_more_than_may_be_needed() {
        let mut small = field([0.064; 3]);
        small.commit_ahead(usize::MAX);
        assert_eq!(small.uncommitted_from, FIRST_SLOT + 64, "all there are");

        let mut large = field([0.512, 0.512, 0.064]);
        large.commit_ahead(usize::MAX);
        let ready = FIRST_SLOT + SLOTS_READY as u32;
        assert_eq!(large.uncommitted_from, ready);
        large.commit_ahead(2);
        assert_eq!(large.uncommitted_from, ready, "enough is enough");
        for brick in 0..5 {
            large.materialise(brick);
        }
        for (call, want) in [2, 4, 5, 5].into_iter().enumerate() {
            large.commit_ahead(2);
            assert_eq!(large.uncommitted_from, ready + want, "call {call}");
        }
        large.replace(0, BrickView::Empty);
        large.materialise(9);
        large.commit_ahead(2);
        assert_eq!(large.uncommitted_from, ready + 5, "a slot is used again");
    }

    #[test]
    fn a_clone_is_equal_and_apart() {
        let mut original = field([0.040, 0.016, 0.016]);
        let voxels = std::array::from_fn(|at| at as u8);
        original.replace(0, BrickView::Voxels(&voxels));
        let mut copy = original.clone();
        for brick in 0..3 {
            assert_eq!(copy.view(brick), original.view(brick));
        }
        assert!(copy.replace(0, BrickView::Empty));
        assert_eq!(original.view(0), BrickView::Voxels(&voxels));
        assert!(
            original.bricks.len() <= copy.free.capacity(),
            "a copy never allocates either"
        );
    }
}
