//! A cut as a fact: which solid swept through the clay, from where to where.

use crate::pose::Pose;
use crate::tool::ToolShape;

/// A tool that moved straight from one pose to another, removing everything in its way.
///
/// Cutting takes, voxel by voxel, the lesser of what is there and what the sweep leaves over. So sweeps may arrive in
/// any order and any number of times: the clay that results is the same to the last bit, on every machine, as long as
/// shapes and poses are the same to the last bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// The solid that cuts.
    pub shape: ToolShape,
    /// Pose at the start.
    pub from: Pose,
    /// Pose at the end; the same as the start for a tool set down in the clay.
    pub to: Pose,
}
