//! A tool in the shape of a closed mesh.

use std::sync::Arc;

use crate::bake::{Baked, MeshToolError};
use crate::engage::Faces;

/// A closed mesh as a tool: baked once to signed distances on a lattice of 48 cells along its longest extent, at most a
/// megabyte, and to points that feel. A copy shares what was baked.
///
/// It keeps its orientation, as every tool does. What it cuts is a function of the lattice, which is a function of the
/// mesh: the same mesh gives the same bits on every machine ([`digest`](Self::digest)).
///
/// ```
/// use teleclay_clay::{Clay, MeshTool, Pose, Shape};
///
/// // A tetrahedron, its tip downwards at the tool's position.
/// let tip = [0.0, 0.0, 0.0];
/// let top = [[-0.01, -0.006, 0.012], [0.01, -0.006, 0.012], [0.0, 0.012, 0.012]];
/// let mesh = MeshTool::new(&[tip, top[0], top[1], top[2]], &[[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])?;
///
/// let mut clay = Clay::new(&Shape::Block { size_m: [0.04; 3] }, 1e-3)?;
/// let at = Pose::quantise([0.02, 0.02, 0.034])?;
/// assert!(0 < clay.carve_mesh(&mesh, at, at));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct MeshTool {
    baked: Arc<Baked>,
    faces: Arc<Faces>,
}

impl MeshTool {
    /// Bakes a closed mesh that faces outwards, its vertices in metres from the tool's position.
    ///
    /// # Errors
    /// When it has too many triangles, is not closed, lies too far off or encloses nothing.
    pub fn new(vertices_m: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Self, MeshToolError> {
        let baked = Baked::new(vertices_m, triangles)?;
        let faces = Arc::new(Faces::of_mesh(&baked));
        Ok(Self {
            baked: Arc::new(baked),
            faces,
        })
    }

    /// Twice the distance of the deepest point inside from the surface, m.
    #[must_use]
    pub fn thickness_m(&self) -> f64 {
        self.baked.thickness_m
    }

    /// Extents along x, y, z, m.
    #[must_use]
    pub fn extents_m(&self) -> [f64; 3] {
        let [least, most] = self.baked.bounds_m;
        std::array::from_fn(|axis| most[axis] - least[axis])
    }

    /// Depends on every bit of what was baked.
    #[must_use]
    pub fn digest(&self) -> u64 {
        self.baked.digest
    }

    pub(crate) fn baked(&self) -> &Baked {
        &self.baked
    }

    pub(crate) fn faces(&self) -> &Faces {
        &self.faces
    }
}
