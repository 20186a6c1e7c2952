//! Clay that can be cut: a sparse field of voxels, tools that sweep through it, and the force it answers with.
//!
//! Everything here is a pure function of what is passed in: no clock, no threads, no input or output, no randomness.
//! The same sweeps give the same bits on every machine ([`golden`]).
//!
//! ```
//! use teleclay_clay::{Clay, ContactState, Material, Motion, Pose, Shape, Tool, ToolShape};
//!
//! let mut clay = Clay::new(&Shape::default(), 1e-3)?;
//! let tool = Tool::new(ToolShape::ball(0.006)?);
//! let (material, mut contact) = (Material::default(), ContactState::default());
//!
//! let from = Pose::quantise([0.020, 0.032, 0.064])?;
//! let to = Pose::quantise([0.0205, 0.032, 0.064])?;
//! let motion = Motion::new(from, to, [0.5, 0.0, 0.0])?;
//! let worked = clay.work(&tool, &material, &motion, &mut contact);
//!
//! assert!(worked.response.force_n[0] < 0.0, "clay resists");
//! assert_eq!(clay.initial_units(), clay.remaining_units() + worked.moved_units);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bake;
mod carve;
mod changes;
pub mod classes;
mod clay;
mod engage;
mod field;
mod fresh;
pub mod golden;
mod grid;
mod hash;
mod lanes;
mod law;
mod mesh_tool;
pub mod mirror;
mod operation;
mod pose;
mod shape;
pub mod stl;
pub mod surface;
mod sweep;
mod tool;

pub use bake::{MAX_MESH_TRIANGLES, MeshToolError};
pub use classes::{Classes, ClassesError, MAX_CLASSES};
pub use clay::{Clay, ReplaceError, UNITS_PER_VOXEL, Worked};
pub use engage::{LOOK_AHEAD_VOXELS, Tool, row_spacing_m};
pub use field::{BrickView, SOLID};
pub use grid::{
    BRICK_EDGE, BRICK_VOXELS, BrickIndex, Grid, GridError, MAX_AXIS_VOXELS, MAX_VOXEL_SIZE_M,
    MAX_VOXELS, MIN_VOXEL_SIZE_M,
};
pub use law::{
    Coefficients, ContactState, MAX_COEFFICIENT, MAX_SPEED_M_S, Material, MaterialError, Motion,
    MotionError, RIGID_YIELD_SPEED_M_S, Regime, Response,
};
pub use mesh_tool::MeshTool;
pub use mirror::Mirror;
pub use operation::Operation;
pub use pose::{Pose, PoseError, STEPS_PER_METRE};
pub use shape::{MAX_STEPS, Shape, ShapeError, SteppedBlock, SteppedDimensions};
pub use surface::{BrickMesh, Mesh};
pub use sweep::Sweep;
pub use tool::{
    Ball, Blade, BladeDimensions, Cylinder, MAX_TOOL_SIZE_M, ToolError, ToolShape, WireLoop,
};
