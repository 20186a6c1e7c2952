//! The parallel robot: three actuated arms, six rods, a platform that never turns. Source: [KHMH03] (1)–(15) in
//! docs/papers.md, with the x and y of (7) put right.
//!
//! Arm `j` stands at angle `gamma_j` on a base of radius `r_b`, in the direction `e_j = (cos gamma_j, sin gamma_j, 0)`.
//! Its upper link `l_1` turns by `rho_j` about the horizontal at the base, from `e_j` towards `z`. Two parallel rods of
//! length `l_2` lead from its elbow to the platform of radius `r_p`; that they stay parallel keeps the platform's
//! orientation, so both rods of a pair state the same equation and three equations remain:
//!
//! ```text
//! d_j = P + (r_p - r_b) e_j      |d_j - l_1 (cos rho_j e_j + sin rho_j z)| = l_2
//! ```
//!
//! Pure calculation, no allocation but in [`WorkspaceMap`]. Lengths in m, angles in rad, forces in N, torques in N·m.
//!
//! | to do this | call |
//! |---|---|
//! | all eight joint sets for a position | [`Geometry::inverse`] |
//! | where each arm's parts are, whether or not the others reach | [`Geometry::arms`] |
//! | both positions for a joint set | [`Geometry::forward`] |
//! | velocities, torques, distance to singularity | [`Geometry::posture`], [`Posture`] |
//! | where the robot reaches, and how well | [`Geometry::map`] |

mod angle;
mod arm;
mod branch;
mod error;
mod forward;
mod geometry;
mod inverse;
mod posture;
mod workspace;

pub use arm::{Arm, Bend};
pub use branch::{Assembly, Branch, BranchError};
pub use error::{KinematicsError, Singularity};
pub use geometry::{Dimensions, Geometry, GeometryError};
pub use inverse::Solution;
pub use nalgebra::{Matrix3, Vector3};
pub use posture::Posture;
pub use workspace::{Region, RegionError, WorkspaceMap};
