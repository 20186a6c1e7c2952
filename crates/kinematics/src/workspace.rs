//! Where the robot reaches, and how evenly it moves there.
//!
//! Dexterity is the inverse of the condition number of `J`: 1 where the platform moves alike in all directions, 0 at a
//! singularity.

use crate::branch::Branch;
use crate::geometry::Geometry;
use nalgebra::Vector3;

/// A box of cells. A box flat in one direction is a slice: one cell there, at that very height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    low_m: Vector3<f64>,
    high_m: Vector3<f64>,
    counts: [usize; 3],
}

/// Why a box cannot be mapped.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RegionError {
    /// An edge is not finite, or the upper one is below the lower.
    #[error("axis {axis} runs from {low_m} m to {high_m} m, need finite ends in order")]
    Edges {
        /// Axis, from 0.
        axis: usize,
        /// Lower end.
        low_m: f64,
        /// Upper end.
        high_m: f64,
    },
    /// No cells along an axis, or more than can be mapped at once.
    #[error("{counts:?} cells, need at least one per axis and at most {most} in all")]
    Cells {
        /// As given.
        counts: [usize; 3],
        /// The cap.
        most: usize,
    },
}

/// Dexterity over a region.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkspaceMap {
    region: Region,
    /// x fastest, then y, then z.
    dexterity: Vec<Option<f64>>,
}

impl Region {
    /// The most cells of one map, which takes well under a second; larger ones are made of several.
    pub const MOST_CELLS: usize = 1_000_000;

    /// A box from `low_m` to `high_m` with this many cells along x, y and z.
    ///
    /// # Errors
    /// The edges are not finite or not in order, or there are no cells or too many.
    pub fn new(
        low_m: Vector3<f64>,
        high_m: Vector3<f64>,
        counts: [usize; 3],
    ) -> Result<Self, RegionError> {
        for axis in 0..3 {
            let (low_m, high_m) = (low_m[axis], high_m[axis]);
            if !(low_m.is_finite() && high_m.is_finite() && low_m <= high_m) {
                return Err(RegionError::Edges {
                    axis,
                    low_m,
                    high_m,
                });
            }
        }
        let cells = counts
            .iter()
            .try_fold(1_usize, |product, count| product.checked_mul(*count));
        match cells {
            Some(cells) if 0 < cells && cells <= Self::MOST_CELLS => Ok(Self {
                low_m,
                high_m,
                counts,
            }),
            _ => Err(RegionError::Cells {
                counts,
                most: Self::MOST_CELLS,
            }),
        }
    }

    /// Cells along x, y and z.
    #[must_use]
    pub fn counts(&self) -> [usize; 3] {
        self.counts
    }

    /// Lower and upper corner, m.
    #[must_use]
    pub fn corners_m(&self) -> [Vector3<f64>; 2] {
        [self.low_m, self.high_m]
    }

    /// Centre of a cell, m.
    #[must_use]
    pub fn centre_m(&self, cell: [usize; 3]) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| {
            let share = (cell[axis] as f64 + 0.5) / self.counts[axis] as f64;
            self.low_m[axis] + (self.high_m[axis] - self.low_m[axis]) * share
        })
    }

    /// Volume of one cell, m³; 0 for a slice.
    #[must_use]
    pub fn cell_volume_m3(&self) -> f64 {
        (0..3)
            .map(|axis| (self.high_m[axis] - self.low_m[axis]) / self.counts[axis] as f64)
            .product()
    }

    /// The region cut into its layers along z, each flat at its cells' centres: a caller may map them one by one and
    /// show how far it is.
    pub fn layers(&self) -> impl Iterator<Item = Self> + '_ {
        (0..self.counts[2]).map(|k| {
            let z = self.centre_m([0, 0, k]).z;
            let [x_count, y_count, _] = self.counts;
            Self {
                low_m: Vector3::new(self.low_m.x, self.low_m.y, z),
                high_m: Vector3::new(self.high_m.x, self.high_m.y, z),
                counts: [x_count, y_count, 1],
            }
        })
    }
}

impl Geometry {
    /// A box that holds every reachable position: each arm reaches at most `l_1 + l_2` from its own centre.
    ///
    /// # Errors
    /// No cells, or too many.
    pub fn reachable_region(&self, counts: [usize; 3]) -> Result<Region, RegionError> {
        let reach_m = self.upper_m + self.lower_m;
        let (mut low_m, mut high_m) = (
            Vector3::repeat(f64::NEG_INFINITY),
            Vector3::repeat(f64::INFINITY),
        );
        for j in 0..3 {
            let centre = self.direction(j) * -self.offset_m;
            low_m = low_m.sup(&centre.add_scalar(-reach_m));
            high_m = high_m.inf(&centre.add_scalar(reach_m));
        }
        // Arms too short to meet anywhere leave an empty box: no reach, and one point to say so.
        Region::new(low_m.inf(&high_m), high_m, counts)
    }

    /// Dexterity of one branch at the centre of each cell.
    #[must_use]
    pub fn map(&self, region: &Region, branch: Branch) -> WorkspaceMap {
        let [x_count, y_count, z_count] = region.counts;
        let mut dexterity = Vec::with_capacity(x_count * y_count * z_count);
        for z in 0..z_count {
            for y in 0..y_count {
                for x in 0..x_count {
                    dexterity.push(self.dexterity(&region.centre_m([x, y, z]), branch));
                }
            }
        }
        WorkspaceMap {
            region: *region,
            dexterity,
        }
    }

    /// Inverse condition number of `J` at a position: from 0 at a singularity to 1; `None` out of reach.
    #[must_use]
    pub fn dexterity(&self, position_m: &Vector3<f64>, branch: Branch) -> Option<f64> {
        let posture = self.posture(position_m, branch).ok()?;
        Some(posture.condition_number().map_or(0.0, f64::recip))
    }
}

impl WorkspaceMap {
    /// What was mapped.
    #[must_use]
    pub fn region(&self) -> &Region {
        &self.region
    }

    /// One value per cell, x fastest, then y, then z; `None` out of reach.
    #[must_use]
    pub fn dexterity(&self) -> &[Option<f64>] {
        &self.dexterity
    }

    /// Volume of the reachable cells, m³.
    #[must_use]
    pub fn reachable_volume_m3(&self) -> f64 {
        self.reachable().count() as f64 * self.region.cell_volume_m3()
    }

    /// Mean dexterity over the reachable cells, the global conditioning index; `None` where there are none.
    #[must_use]
    pub fn mean_dexterity(&self) -> Option<f64> {
        let (sum, count) = self
            .reachable()
            .fold((0.0, 0_usize), |(sum, count), value| {
                (sum + value, count + 1)
            });
        (0 < count).then(|| sum / count as f64)
    }

    fn reachable(&self) -> impl Iterator<Item = f64> + '_ {
        self.dexterity.iter().filter_map(|value| *value)
    }
}
