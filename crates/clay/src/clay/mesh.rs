//! Clay under a tool in the shape of a mesh.

use super::{Clay, Worked};
use crate::carve::{self, Start};
use crate::law::{ContactState, Material, Motion};
use crate::mesh_tool::MeshTool;
use crate::pose::Pose;
use crate::tool::ToolError;

impl Clay {
    /// Whether a mesh is thick enough to cut this clay cleanly where it is thickest. Its edges cut less than all in
    /// their way, as far as they are thinner.
    ///
    /// # Errors
    /// When the largest ball within it is thinner than two voxels.
    pub fn admits_mesh(&self, mesh: &MeshTool) -> Result<(), ToolError> {
        self.admits_thickness(mesh.thickness_m())
    }

    /// Removes what a mesh passes through on a straight way; returns how much, in units of 1/255 voxel. Like any
    /// [sweep](crate::Sweep), it may come in any order and any number of times.
    pub fn carve_mesh(&mut self, mesh: &MeshTool, from: Pose, to: Pose) -> u64 {
        let start = self.cleared.advance_mesh(mesh.digest(), from, to);
        if start == Start::Clear && from == to {
            return 0;
        }
        carve::carve_mesh(
            &mut self.field,
            &mut self.changes,
            &mut self.tables,
            mesh.baked(),
            [from, to],
            start,
        )
    }

    /// One tick of a mesh: cuts the motion's sweep, then feels the clay that is left and answers.
    pub fn work_mesh(
        &mut self,
        mesh: &MeshTool,
        material: &Material,
        motion: &Motion,
        contact: &mut ContactState,
    ) -> Worked {
        let moved_units = self.carve_mesh(mesh, motion.from(), motion.to());
        Worked {
            response: self.feel_with(mesh.faces(), material, motion, contact),
            moved_units,
        }
    }

    /// Area of the mesh's leading faces that has clay ahead of it when it moves in a direction, m². As
    /// [`Clay::engaged_area_m2`] otherwise.
    #[must_use]
    pub fn engaged_area_of_mesh_m2(&self, mesh: &MeshTool, at: Pose, direction: [f64; 3]) -> f64 {
        self.area_of_faces_m2(mesh.faces(), at, direction)
    }
}
