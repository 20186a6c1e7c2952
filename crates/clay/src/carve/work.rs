//! What cutting writes down on its way: which groups of voxels to look at, and what they have in common.

use crate::field::Brick;
use crate::grid::{BRICK_EDGE, MAX_AXIS_VOXELS};
use crate::lanes::{Ints, LANES};

/// Groups of lanes in a row of a brick.
pub(super) const BRICK_GROUPS: usize = BRICK_EDGE / LANES;
/// Rows of voxels in a brick.
pub(super) const ROWS: usize = BRICK_EDGE * BRICK_EDGE;
/// Most groups of lanes and most bricks along x.
pub(super) const MOST_GROUPS: usize = MAX_AXIS_VOXELS / LANES;
pub(super) const MOST_BRICKS: usize = MAX_AXIS_VOXELS / BRICK_EDGE;

/// Memory that cutting needs, made once so that cutting never allocates.
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    pub(super) work: WorkList,
    /// Of these, the groups that need a closer look.
    pub(super) closer: WorkList,
    /// The bricks along x that the rows at hand run through.
    pub(super) along: [Column; MOST_BRICKS],
    pub(super) tables: Tables,
}

/// A brick in the row of bricks at hand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column {
    pub(super) brick: Brick,
    pub(super) removed: u32,
}

/// What a solid found out about rows and columns of groups, so as not to find it out again for each group.
#[derive(Clone, Debug)]
pub(super) struct Tables {
    pub(super) rows: Box<[[f32; ROWS]; 2]>,
    pub(super) columns: Box<[[f32; LANES]; MOST_GROUPS]>,
    pub(super) column_bounds: Box<[f32; MOST_GROUPS]>,
}

impl Scratch {
    pub(crate) fn new() -> Self {
        Self {
            work: WorkList::new(),
            closer: WorkList::new(),
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

/// Groups of voxels to look at within the rows of bricks at one place in y and z.
#[derive(Clone, Debug)]
pub(super) struct WorkList {
    /// Row in the bricks (16 z + y) times 256, plus the group's number along x: sixteen bits each, little-endian, so that
    /// several can be written as one word.
    groups: Box<[u8; GROUP_BYTES * (ROWS * MOST_GROUPS + BATCH)]>,
    /// Bytes in use.
    len: usize,
}

/// A row and a group, as in [`WorkList::groups`].
pub(super) type Entry = [u8; GROUP_BYTES];

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

    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    pub(super) fn entries(&self) -> &[Entry] {
        self.groups[..self.len].as_chunks().0
    }

    /// Adds an entry, or leaves things as they are, without a branch.
    #[inline(always)]
    pub(super) fn push_if(&mut self, wanted: bool, entry: Entry) {
        self.groups[self.len..self.len + GROUP_BYTES].copy_from_slice(&entry);
        self.len += GROUP_BYTES * usize::from(wanted);
    }

    /// Adds groups of several rows, the first of them `row`, each from `start` up to but not including `end`.
    #[inline(always)]
    pub(super) fn push(&mut self, row: usize, start: Ints, end: Ints) {
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
