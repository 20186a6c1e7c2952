//! The clay's surface as a closed two-manifold, by surface nets \[G98\].
//!
//! A *cell* lies between eight voxel centres. A voxel counts as clay from half occupancy on, and beyond the grid there
//! is air, so the mesh closes around the block. Where an edge of a cell leads from clay to air, the surface crosses it.
//! On a face of a cell the crossings are joined by *segments*, and in a cell the segments form *loops* ([`cell`]).
//! Every loop gets one vertex, in the mean of its crossings; every crossing gets a quadrilateral of the four loops
//! through it, cut into two triangles.
//!
//! # Every edge belongs to exactly two triangles
//!
//! This holds for any occupancies, at the border of the block and between bricks as everywhere else, because it follows
//! from nothing but which voxels count as clay:
//!
//! 1. *Segments are the same from both sides.* A face of a cell has 0, 2 or 4 crossings on its four edges. Two are one
//!    segment. Four are two segments, which either cut off the two voxels of clay, each one, or the two of air; which
//!    of these is decided for the face, from the voxels of both its cells.
//! 2. *Segments form loops.* A crossing of a cell lies on two of its faces, and on each of them at the end of one
//!    segment.
//! 3. *A side of a quadrilateral belongs to two quadrilaterals.* It joins loops of two neighbouring cells and stands
//!    for a segment on the face between them; the two quadrilaterals are those of the segment's two ends. They pass the
//!    side in opposite directions, since clay lies on opposite sides of the two crossings as one goes around the face.
//! 4. *No two segments make the same side.* They would be on the same face, as two cells share only one, and belong to
//!    one loop in both cells. So the rule is: on a face with four crossings the segments cut off clay, unless this
//!    would put both into one loop in both cells; then they cut off air, which parts the loop in both
//!    ([`cell::Configuration`]).
//! 5. *A diagonal belongs to one quadrilateral.* It joins loops of two cells that share nothing but the edge which the
//!    quadrilateral is about, so it is different from all sides and from all other diagonals.
//! 6. *Different vertices are different points, also as `f32` in millimetres.* A vertex keeps [`MARGIN`] away from the
//!    sides of its cell, and two loops of one cell stay in different halves of it, as far from the middle.
//! 7. *Every triangle has an area.* Seen along its edge, the corners of a quadrilateral lie in the four quadrants about
//!    the edge, so it is a star around it. At least one diagonal cuts such a star into two triangles that face the same
//!    way, and it is taken.
//!
//! The triangles around a vertex follow its loop, so they form one fan: the surface is a manifold at its vertices, too.
//!
//! # The mesh encloses what is left
//!
//! A crossing lies where the clay of its two voxels would end if it filled the axis from one side ([`cell`]), so a
//! plane across voxels is where it should be. A cell between voxels that are all full or empty has its vertex in the
//! middle, where they meet: a voxel by itself is a cube, and a fresh block of whole voxels has sharp edges. (On a
//! slanted plane there is no such cell, as the eight voxels' centres span exactly the width over which occupancy goes
//! from full to empty.) What bevels along other edges take away, and clay that is too thin to have a surface of its
//! own, is made up for by a shift of all vertices along their normals, the same for all ([`volume`]). It moves vertices
//! within their halves of their cells only, so everything above still holds.

mod cell;
mod draft;
mod facing;
mod shown;
mod volume;
mod window;

use crate::clay::Clay;
use crate::grid::BrickIndex;
use draft::Draft;

pub use shown::BrickMesh;
pub(crate) use shown::BrickMesher;
pub(crate) use window::{Bricks, HALO};

/// How far a vertex stays from the sides of its cell, voxels. So small that clay of the least occupancy, one of 255,
/// has room for its volume between its vertices. So large that vertices are told apart: coordinates are rounded to
/// `f32` twice, each time by 2^-14 voxels at most at the far end of a grid of 1024, and 2^-13 is an eighth of it.
const MARGIN: f32 = 1.0 / 1024.0;

/// A triangle mesh in the clay frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertices, m.
    pub positions_m: Vec<[f32; 3]>,
    /// Vertex numbers of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The surface of the clay: a closed manifold that encloses the volume that is left. Empty for clay that is all
    /// gone.
    ///
    /// The volume is right to a thousandth wherever moving the surface within its cells can make it so, which is the
    /// case for what tools leave behind. Of clay that is porous throughout the mesh encloses more than is left;
    /// [`Mesh::volume_m3`] says how much.
    #[must_use]
    pub fn of(clay: &Clay) -> Self {
        volume::fitted(clay).map_or_else(Self::default, |(draft, shift)| {
            draft.finish(clay.grid().voxel_size_m(), shift)
        })
    }

    /// The part of the surface that belongs to a brick: around the edges of cells that begin in its voxels, and at the
    /// lower sides of the grid around those that begin in the air before it.
    ///
    /// Parts of neighbouring bricks have the vertices along their seam in common, bit by bit. The parts of all bricks
    /// are the whole surface before the shift that makes its volume right. A part depends on the brick's voxels and on
    /// two layers around them.
    ///
    /// # Panics
    /// When the index comes from a larger grid.
    #[must_use]
    pub fn of_brick(clay: &Clay, index: BrickIndex) -> Self {
        let draft = Draft::of_brick(clay, index, volume::HALF_SOLID);
        draft.finish(clay.grid().voxel_size_m(), 0.0)
    }

    /// Volume that the mesh encloses, m³, by the divergence theorem.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        let six_volumes: f64 = self
            .triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|at| self.positions_m[at as usize].map(f64::from));
                a[0] * (b[1] * c[2] - b[2] * c[1])
                    + a[1] * (b[2] * c[0] - b[0] * c[2])
                    + a[2] * (b[0] * c[1] - b[1] * c[0])
            })
            .sum();
        six_volumes / 6.0
    }
}
