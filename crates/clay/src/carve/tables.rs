//! What a sweep finds out once about the voxels of each axis, so as not to find it out again in every brick.

use crate::grid::{BRICK_EDGE, MAX_AXIS_VOXELS};
use crate::lanes::{F32x4, LANES};

/// Most numbers that a solid keeps of each voxel, and of each four of them: those of a blade on a segment askew.
const VOXEL_NUMBERS: usize = 9;
const FOUR_NUMBERS: usize = 7;
const MOST_FOURS: usize = MAX_AXIS_VOXELS / LANES;

/// Numbers of the voxels along x, y and z. Made once, so that cutting never allocates.
#[derive(Clone, Debug)]
pub(crate) struct Tables {
    axes: Box<[Axis; 3]>,
}

/// Numbers of the voxels along one axis, and of each four of them, which are a tile along x and a band along y.
#[derive(Clone, Debug)]
struct Axis {
    voxels: [[[f32; LANES]; MOST_FOURS]; VOXEL_NUMBERS],
    fours: [[[f32; LANES]; MOST_FOURS / LANES]; FOUR_NUMBERS],
}

/// Where a brick is: its place along each axis, in bricks.
#[derive(Clone, Copy)]
pub(super) struct BrickAt(pub(super) [usize; 3]);

impl Tables {
    pub(crate) fn new() -> Self {
        const NOTHING: Axis = Axis {
            voxels: [[[0.0; LANES]; MOST_FOURS]; VOXEL_NUMBERS],
            fours: [[[0.0; LANES]; MOST_FOURS / LANES]; FOUR_NUMBERS],
        };
        let axes = vec![NOTHING; 3].into_boxed_slice();
        Self {
            axes: axes.try_into().expect("there are three"),
        }
    }

    /// Notes a number of each voxel of an axis in these bricks, given the first of every four.
    #[inline(always)]
    pub(super) fn note_voxels(
        &mut self,
        axis: usize,
        number: usize,
        [first, end]: [i32; 2],
        of: impl Fn(i32) -> F32x4,
    ) {
        let fours = BRICK_EDGE / LANES;
        for four in first as usize * fours..end as usize * fours {
            of((four * LANES) as i32).store(&mut self.axes[axis].voxels[number][four % MOST_FOURS]);
        }
    }

    /// Notes a number of every four voxels of an axis in these bricks, given the brick's first voxel.
    #[inline(always)]
    pub(super) fn note_fours(
        &mut self,
        axis: usize,
        number: usize,
        [first, end]: [i32; 2],
        of: impl Fn(i32) -> F32x4,
    ) {
        for brick in first..end {
            let fours = &mut self.axes[axis].fours[number];
            of(brick * BRICK_EDGE as i32).store(&mut fours[brick as usize % (MOST_FOURS / LANES)]);
        }
    }

    /// A number of the voxels of a tile along x, or of a band along y.
    #[inline(always)]
    pub(super) fn four_voxels(
        &self,
        axis: usize,
        number: usize,
        at: BrickAt,
        four: usize,
    ) -> F32x4 {
        let four = at.0[axis] * (BRICK_EDGE / LANES) + four;
        F32x4::load(&self.axes[axis].voxels[number][four % MOST_FOURS])
    }

    /// A number of the voxels of a layer.
    #[inline(always)]
    pub(super) fn layer(&self, number: usize, at: BrickAt, layer: usize) -> F32x4 {
        let voxels = self.axes[2].voxels[number].as_flattened();
        F32x4::splat(voxels[(at.0[2] * BRICK_EDGE + layer) % MAX_AXIS_VOXELS])
    }

    /// A number of each of a brick's tiles along x, or of its bands along y.
    #[inline(always)]
    pub(super) fn fours(&self, axis: usize, number: usize, at: BrickAt) -> F32x4 {
        F32x4::load(&self.axes[axis].fours[number][at.0[axis] % (MOST_FOURS / LANES)])
    }

    /// A number of one of a brick's bands.
    #[inline(always)]
    pub(super) fn band(&self, number: usize, at: BrickAt, band: usize) -> F32x4 {
        let bands = self.axes[1].fours[number].as_flattened();
        F32x4::splat(bands[(at.0[1] * LANES + band) % MOST_FOURS])
    }
}
