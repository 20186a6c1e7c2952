//! The voxel grid: how many voxels, how large, and how they are grouped into bricks.
//!
//! The clay frame has its origin in the lower corner of the block, z up. Voxel `(i, j, k)` is the cube between
//! `(i, j, k) h` and `(i + 1, j + 1, k + 1) h`; its centre is at `(i + 1/2, j + 1/2, k + 1/2) h`, `h` the voxel size.

use thiserror::Error;

/// Voxels along the edge of a brick. 16 makes a row of a brick one 128-bit word and a brick one 4 KiB page.
pub const BRICK_EDGE: usize = 16;
/// Voxels in a brick.
pub const BRICK_VOXELS: usize = BRICK_EDGE * BRICK_EDGE * BRICK_EDGE;
/// Most voxels along an axis.
pub const MAX_AXIS_VOXELS: usize = 1024;
/// Most voxels of a grid, as in 1024 by 1024 by 512: half a gigabyte if every brick of it is carved, and less for as
/// long as most are not.
pub const MAX_VOXELS: u64 = 1 << 29;
/// Smallest voxel, m: well above the pose lattice, so that a pose resolves a voxel finely.
pub const MIN_VOXEL_SIZE_M: f64 = 1e-5;
/// Largest voxel, m.
pub const MAX_VOXEL_SIZE_M: f64 = 0.1;

/// A remainder of a voxel below this fraction is rounding noise of the division by the voxel size, not clay.
const REMAINDER_NOISE: f64 = 1e-6;

/// Dimensions of a voxel grid. Invariant: 1 to [`MAX_AXIS_VOXELS`] voxels along every axis, [`MAX_VOXELS`] at most in
/// all, a valid voxel size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    voxels: [u16; 3],
    bricks: [u16; 3],
    voxel_size_m: f64,
}

/// A grid that cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum GridError {
    /// The voxel size is not finite or out of range.
    #[error("voxel size is {got_m} m, wanted {MIN_VOXEL_SIZE_M} to {MAX_VOXEL_SIZE_M} m")]
    VoxelSize {
        /// The voxel size as it came, m.
        got_m: f64,
    },
    /// An edge is not finite or not above zero.
    #[error("edge {axis} is {got_m} m long, wanted a finite length above zero")]
    Size {
        /// 0, 1, 2 for x, y, z.
        axis: usize,
        /// The length as it came, m.
        got_m: f64,
    },
    /// An edge needs more voxels than a grid may have.
    #[error("edge {axis} needs {needed} voxels, a grid has at most {MAX_AXIS_VOXELS}")]
    TooManyVoxels {
        /// 0, 1, 2 for x, y, z.
        axis: usize,
        /// Voxels that the edge would need.
        needed: f64,
    },
    /// There are more voxels than a grid may have.
    #[error("{needed} voxels are needed in all, a grid has at most {MAX_VOXELS}")]
    TooManyInAll {
        /// Voxels that would be needed.
        needed: u64,
    },
}

/// A brick's place in the dense order: x fastest, then y, then z. Valid for the grid that made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BrickIndex(u32);

impl BrickIndex {
    /// The dense number.
    #[must_use]
    pub const fn as_u32(self) -> u32 {
        self.0
    }

    pub(crate) const fn new(dense: usize) -> Self {
        Self(dense as u32)
    }

    pub(crate) const fn dense(self) -> usize {
        self.0 as usize
    }
}

impl Grid {
    /// The smallest grid of voxels of the given size that holds a box from the origin to `size_m`.
    ///
    /// # Errors
    /// When the voxel size or an edge is out of range, or there would be too many voxels, along an edge or in all.
    pub fn covering(size_m: [f64; 3], voxel_size_m: f64) -> Result<Self, GridError> {
        if !(MIN_VOXEL_SIZE_M..=MAX_VOXEL_SIZE_M).contains(&voxel_size_m) {
            return Err(GridError::VoxelSize {
                got_m: voxel_size_m,
            });
        }
        let mut voxels = [0; 3];
        for (axis, (&got_m, count)) in size_m.iter().zip(&mut voxels).enumerate() {
            if !(got_m.is_finite() && 0.0 < got_m) {
                return Err(GridError::Size { axis, got_m });
            }
            let needed = (got_m / voxel_size_m - REMAINDER_NOISE).ceil().max(1.0);
            if (MAX_AXIS_VOXELS as f64) < needed {
                return Err(GridError::TooManyVoxels { axis, needed });
            }
            *count = needed as u16;
        }
        let needed = voxels.iter().map(|&count| u64::from(count)).product();
        if MAX_VOXELS < needed {
            return Err(GridError::TooManyInAll { needed });
        }
        let bricks = voxels.map(|count| count.div_ceil(BRICK_EDGE as u16));
        Ok(Self {
            voxels,
            bricks,
            voxel_size_m,
        })
    }

    /// A grid of so many voxels along x, y, z.
    ///
    /// # Errors
    /// When the voxel size is out of range, an axis has no voxel, or there are too many, along an axis or in all.
    pub fn of_voxels(voxels: [u16; 3], voxel_size_m: f64) -> Result<Self, GridError> {
        // Half a voxel less is covered by as many, however it is rounded.
        let size_m = voxels.map(|count| (f64::from(count) - 0.5) * voxel_size_m);
        Self::covering(size_m, voxel_size_m)
    }

    /// Edge of a voxel, m.
    #[must_use]
    pub const fn voxel_size_m(&self) -> f64 {
        self.voxel_size_m
    }

    /// Voxels along x, y, z.
    #[must_use]
    pub const fn voxels(&self) -> [u16; 3] {
        self.voxels
    }

    /// Bricks along x, y, z.
    #[must_use]
    pub const fn bricks(&self) -> [u16; 3] {
        self.bricks
    }

    /// All bricks of the grid.
    #[must_use]
    pub const fn brick_count(&self) -> usize {
        self.bricks[0] as usize * self.bricks[1] as usize * self.bricks[2] as usize
    }

    /// The index with this dense number, if the grid has it: the way in for numbers from a network.
    #[must_use]
    pub fn brick_index(&self, dense: u32) -> Option<BrickIndex> {
        ((dense as usize) < self.brick_count()).then_some(BrickIndex(dense))
    }

    /// The brick at these brick coordinates, if the grid has it.
    #[must_use]
    pub fn brick_at(&self, at: [u16; 3]) -> Option<BrickIndex> {
        let inside = at.iter().zip(&self.bricks).all(|(at, count)| at < count);
        inside.then(|| {
            let [x, y, z] = at.map(usize::from);
            let [nx, ny, _] = self.bricks.map(usize::from);
            BrickIndex::new((z * ny + y) * nx + x)
        })
    }

    /// Brick coordinates of a brick of this grid; its first voxel is at 16 times these.
    #[must_use]
    pub fn brick_coordinates(&self, index: BrickIndex) -> [u16; 3] {
        let [nx, ny, _] = self.bricks.map(u32::from);
        let dense = index.0;
        [dense % nx, dense / nx % ny, dense / nx / ny].map(|at| at as u16)
    }

    /// Voxels of a brick that lie inside the grid, along x, y, z: fewer than 16 in the last bricks of an odd grid.
    #[must_use]
    pub fn brick_extent(&self, index: BrickIndex) -> [usize; 3] {
        let at = self.brick_coordinates(index);
        std::array::from_fn(|axis| {
            (usize::from(self.voxels[axis]) - usize::from(at[axis]) * BRICK_EDGE).min(BRICK_EDGE)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_block_has_whole_voxels_in_spite_of_rounding() {
        let grid = Grid::covering([0.128, 0.064, 0.064], 5e-4).unwrap();
        assert_eq!(grid.voxels(), [256, 128, 128]);
        assert_eq!(grid.bricks(), [16, 8, 8]);
    }

    #[test]
    fn a_remainder_gets_a_voxel_of_its_own() {
        let grid = Grid::covering([0.0101, 0.0001, 0.016], 1e-3).unwrap();
        assert_eq!(grid.voxels(), [11, 1, 16]);
        assert_eq!(grid.bricks(), [1, 1, 1]);
    }

    #[test]
    fn indices_and_coordinates_are_inverse() {
        let grid = Grid::covering([0.050, 0.040, 0.090], 1e-3).unwrap();
        assert_eq!(grid.bricks(), [4, 3, 6]);
        for dense in 0..grid.brick_count() as u32 {
            let index = grid.brick_index(dense).unwrap();
            assert_eq!(grid.brick_at(grid.brick_coordinates(index)), Some(index));
        }
        assert_eq!(grid.brick_index(72), None);
        assert_eq!(grid.brick_at([4, 0, 0]), None);
        let last = grid.brick_at([3, 2, 5]).unwrap();
        assert_eq!(grid.brick_extent(last), [2, 8, 10]);
    }

    #[test]
    fn the_largest_grid_is_allowed_and_one_more_voxel_is_not() {
        assert!(Grid::covering([1.024, 1.024, 0.512], 1e-3).is_ok());
        assert!(Grid::covering([0.512, 1.024, 1.024], 1e-3).is_ok());
        assert!(matches!(
            Grid::covering([0.512, 1.025, 0.1], 1e-3),
            Err(GridError::TooManyVoxels { axis: 1, .. })
        ));
        assert_eq!(
            Grid::covering([1.024, 1.024, 0.513], 1e-3),
            Err(GridError::TooManyInAll {
                needed: 1024 * 1024 * 513
            })
        );
        assert!(matches!(
            Grid::covering([1e300, 1.0, 1.0], 1e-3),
            Err(GridError::TooManyVoxels { axis: 0, .. })
        ));
    }

    #[test]
    fn nonsense_is_refused() {
        for voxel_size_m in [0.0, -1e-3, f64::NAN, f64::INFINITY, 1e-9, 1.0] {
            assert!(matches!(
                Grid::covering([0.1; 3], voxel_size_m),
                Err(GridError::VoxelSize { .. })
            ));
        }
        for length_m in [0.0, -0.1, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                Grid::covering([0.1, 0.1, length_m], 1e-3),
                Err(GridError::Size { axis: 2, .. })
            ));
        }
    }
}
