//! Fresh blocks of clay: plain, or with the stepped top of the published cutting experiment \[KHMH03\].

use thiserror::Error;

use crate::grid::{Grid, GridError};

/// Steps that the clay of a [`Shape::Stepped`] may have at most.
pub const MAX_STEPS: usize = 64;

/// What the clay looks like before the first cut, in the clay frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A block from the origin to `size_m`.
    Block {
        /// Edges along x, y, z, m.
        size_m: [f64; 3],
    },
    /// A block whose top rises in steps along x, so that a blade moving along x at one height cuts deeper and deeper.
    Stepped(SteppedBlock),
}

/// Clay that rises in steps along x. Invariant: between 2 and [`MAX_STEPS`] + 1 edges, finite and rising, one depth
/// between each two of them, every length finite and above zero (the base may be 0).
#[derive(Clone, Debug, PartialEq)]
pub struct SteppedBlock {
    edges_m: Vec<f64>,
    depths_of_cut_m: Vec<f64>,
    base_m: f64,
    width_m: f64,
}

/// The dimensions of a [`SteppedBlock`], before they are checked.
#[derive(Clone, Debug, PartialEq)]
pub struct SteppedDimensions {
    /// Where the steps begin and end along x, m; ascending, one more than there are depths. Nothing stands outside.
    pub edges_m: Vec<f64>,
    /// Height of each step above the blade's lower edge, m.
    pub depths_of_cut_m: Vec<f64>,
    /// Height of the clay below the blade's lower edge, m: the blade travels at this height.
    pub base_m: f64,
    /// Extent along y, from 0, m.
    pub width_m: f64,
}

/// A block that cannot be shaped.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum ShapeError {
    /// The block does not fit a grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// Edges and depths do not match in number.
    #[error(
        "{edges} edges and {depths} depths, wanted one edge more than depths, 1 to {MAX_STEPS} of them"
    )]
    StepCount {
        /// Edges that came.
        edges: usize,
        /// Depths that came.
        depths: usize,
    },
    /// Edges are not finite, below zero or not ascending.
    #[error(
        "edge {index} is at {got_m} m, wanted finite, not below zero, and above the edge before it"
    )]
    Edge {
        /// Which edge, from 0.
        index: usize,
        /// Its place as it came, m.
        got_m: f64,
    },
    /// A length is not finite or not above zero.
    #[error("{name} is {got_m} m, wanted finite and above zero")]
    Length {
        /// Which length.
        name: &'static str,
        /// Its value as it came, m.
        got_m: f64,
    },
}

impl SteppedBlock {
    /// The block of the published experiment: steps between 3, 6, 9 and 12 cm, 1, 2 and 3 cm deep, on a base of 1 cm,
    /// 64 mm wide as the default block is.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            edges_m: vec![0.03, 0.06, 0.09, 0.12],
            depths_of_cut_m: vec![0.01, 0.02, 0.03],
            base_m: 0.01,
            width_m: 0.064,
        }
    }

    /// A block of these dimensions.
    ///
    /// # Errors
    /// When numbers of edges and depths do not match, edges do not ascend, or a length is not finite or not above zero.
    pub fn new(dimensions: SteppedDimensions) -> Result<Self, ShapeError> {
        let SteppedDimensions {
            edges_m,
            depths_of_cut_m,
            base_m,
            width_m,
        } = dimensions;
        let (edges, depths) = (edges_m.len(), depths_of_cut_m.len());
        if edges != depths + 1 || depths == 0 || MAX_STEPS < depths {
            return Err(ShapeError::StepCount { edges, depths });
        }
        for (index, &got_m) in edges_m.iter().enumerate() {
            let rises = index == 0 || edges_m[index - 1] < got_m;
            let valid = got_m.is_finite() && 0.0 <= got_m && rises;
            if !valid {
                return Err(ShapeError::Edge { index, got_m });
            }
        }
        let lengths = depths_of_cut_m
            .iter()
            .map(|&depth_m| ("depth of cut", depth_m));
        for (name, got_m) in lengths.chain([("width", width_m)]) {
            if !(got_m.is_finite() && 0.0 < got_m) {
                return Err(ShapeError::Length { name, got_m });
            }
        }
        if !(base_m.is_finite() && 0.0 <= base_m) {
            return Err(ShapeError::Length {
                name: "base",
                got_m: base_m,
            });
        }
        Ok(Self {
            edges_m,
            depths_of_cut_m,
            base_m,
            width_m,
        })
    }

    /// Height at which the blade's lower edge travels, m.
    #[must_use]
    pub const fn base_m(&self) -> f64 {
        self.base_m
    }

    /// Where the steps begin and end along x, m.
    #[must_use]
    pub fn edges_m(&self) -> &[f64] {
        &self.edges_m
    }

    /// Height of each step above the blade's lower edge, m.
    #[must_use]
    pub fn depths_of_cut_m(&self) -> &[f64] {
        &self.depths_of_cut_m
    }
}

impl Default for Shape {
    /// 128 x 64 x 64 mm.
    fn default() -> Self {
        Self::Block {
            size_m: [0.128, 0.064, 0.064],
        }
    }
}

impl Shape {
    /// Upper corner of the shape's bounding box, whose lower corner is the origin, m.
    #[must_use]
    pub fn size_m(&self) -> [f64; 3] {
        match self {
            Self::Block { size_m } => *size_m,
            Self::Stepped(stepped) => {
                let deepest_m = stepped
                    .depths_of_cut_m
                    .iter()
                    .fold(0.0, |a: f64, &b| a.max(b));
                let far_m = stepped.edges_m.last().copied().unwrap_or(0.0);
                [far_m, stepped.width_m, stepped.base_m + deepest_m]
            }
        }
    }

    /// Volume of the ideal shape, m³.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        self.boxes()
            .map(|(lower_m, upper_m)| {
                (0..3)
                    .map(|axis| upper_m[axis] - lower_m[axis])
                    .product::<f64>()
            })
            .sum()
    }

    /// The grid of voxels of this size that the shape stands in.
    ///
    /// # Errors
    /// It has too many of them, or the size is none.
    pub fn grid(&self, voxel_size_m: f64) -> Result<Grid, GridError> {
        Grid::covering(self.size_m(), voxel_size_m)
    }

    /// The disjoint boxes, as lower and upper corners in m, that the shape is made of.
    pub(crate) fn boxes(&self) -> impl Iterator<Item = ([f64; 3], [f64; 3])> + '_ {
        let (block, stepped) = match self {
            Self::Block { size_m } => (Some(([0.0; 3], *size_m)), None),
            Self::Stepped(stepped) => (None, Some(stepped)),
        };
        block
            .into_iter()
            .chain(stepped.into_iter().flat_map(|stepped| {
                stepped
                    .edges_m
                    .windows(2)
                    .zip(&stepped.depths_of_cut_m)
                    .map(|(edges, depth_m)| {
                        (
                            [edges[0], 0.0, 0.0],
                            [edges[1], stepped.width_m, stepped.base_m + depth_m],
                        )
                    })
            }))
    }
}

/// Share of the voxel interval `[index, index + 1]` that lies between two places, all in voxels.
pub(crate) fn covered_share(index: usize, lower: f64, upper: f64) -> f64 {
    let (start, end) = (index as f64, index as f64 + 1.0);
    (upper.min(end) - lower.max(start)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_block_has_its_volume() {
        let shape = Shape::Stepped(SteppedBlock::paper());
        for (got_m, want_m) in shape.size_m().into_iter().zip([0.12, 0.064, 0.04]) {
            assert!((got_m - want_m).abs() < 1e-15);
        }
        let expected_m3 = 0.03 * 0.064 * (0.02 + 0.03 + 0.04);
        assert!((shape.volume_m3() - expected_m3).abs() < 1e-12);
    }

    #[test]
    fn broken_steps_are_refused() {
        let sound = SteppedDimensions {
            edges_m: vec![0.0, 0.1],
            depths_of_cut_m: vec![0.01],
            base_m: 0.0,
            width_m: 0.05,
        };
        assert!(SteppedBlock::new(sound.clone()).is_ok());
        let broken = SteppedDimensions {
            edges_m: vec![0.0],
            ..sound.clone()
        };
        assert_eq!(
            SteppedBlock::new(broken),
            Err(ShapeError::StepCount {
                edges: 1,
                depths: 1
            })
        );
        let broken = SteppedDimensions {
            edges_m: vec![0.1, 0.1],
            ..sound.clone()
        };
        assert_eq!(
            SteppedBlock::new(broken),
            Err(ShapeError::Edge {
                index: 1,
                got_m: 0.1
            })
        );
        let broken = SteppedDimensions {
            edges_m: vec![-0.1, 0.1],
            ..sound.clone()
        };
        assert!(matches!(
            SteppedBlock::new(broken),
            Err(ShapeError::Edge { index: 0, .. })
        ));
        let broken = SteppedDimensions {
            depths_of_cut_m: vec![f64::NAN],
            ..sound.clone()
        };
        assert!(matches!(
            SteppedBlock::new(broken),
            Err(ShapeError::Length {
                name: "depth of cut",
                ..
            })
        ));
        let broken = SteppedDimensions {
            base_m: f64::INFINITY,
            ..sound.clone()
        };
        assert!(matches!(
            SteppedBlock::new(broken),
            Err(ShapeError::Length { name: "base", .. })
        ));
        let broken = SteppedDimensions {
            width_m: 0.0,
            ..sound
        };
        assert!(matches!(
            SteppedBlock::new(broken),
            Err(ShapeError::Length { name: "width", .. })
        ));
    }

    #[test]
    fn shares_of_a_voxel_add_up() {
        let shares: f64 = (0..10).map(|index| covered_share(index, 2.25, 7.125)).sum();
        assert!((shares - 4.875).abs() < 1e-12);
        assert!((covered_share(2, 2.25, 7.125) - 0.75).abs() < 1e-12);
        assert!((covered_share(3, 2.25, 7.125) - 1.0).abs() < 1e-12);
    }
}
