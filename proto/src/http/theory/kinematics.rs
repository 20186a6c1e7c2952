//! The parallel robot, (1)–(15).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::check_finite;
use crate::http::schema::{ArmAngles, Branch, Cells, Matrix, Position, Region, Vector};
use crate::validate::{FieldError, Validate, check};

/// Most cells of one workspace map.
pub const MAX_WORKSPACE_CELLS: usize = 100_000;

/// Longest link, m: beyond, squares of lengths would lose the digits of what is left of them.
const MAX_LENGTH_M: f64 = 1e6;
/// Farthest position that is looked at, m.
const MAX_POSITION_M: f64 = 1e9;

/// Dimensions of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotGeometry {
    /// `r_b`, from the centre of the base to the joints, m.
    #[schema(minimum = 0, maximum = 1e6)]
    pub base_radius_m: f64,
    /// `r_p`, from the centre of the platform to the rods, m.
    #[schema(minimum = 0, maximum = 1e6)]
    pub platform_radius_m: f64,
    /// `l_1`, the actuated links, m.
    #[schema(minimum = 1e-6, maximum = 1e6)]
    pub upper_link_m: f64,
    /// `l_2`, the rods, m.
    #[schema(minimum = 1e-6, maximum = 1e6)]
    pub lower_link_m: f64,
    /// Directions of the arms on the base, degrees; no two alike.
    #[schema(value_type = ArmAngles)]
    pub arm_angles_deg: [f64; 3],
}

/// Asks for every joint set that puts the platform at a position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct InverseRequest {
    /// The robot; a desktop one when left out.
    #[serde(default)]
    pub geometry: RobotGeometry,
    /// Where the platform is to be, m.
    #[schema(value_type = Position)]
    pub position_m: [f64; 3],
}

/// All eight solutions of (10)–(12).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct InverseAnswer {
    /// The eight, `[1, 1, 1]` first and `[-1, -1, -1]` last, the third sign changing fastest.
    #[schema(min_items = 8, max_items = 8)]
    pub branches: Vec<BranchJoints>,
}

/// One of the eight solutions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BranchJoints {
    /// The signs `K_j`, each 1 or -1.
    #[schema(value_type = Branch)]
    pub branch: [i64; 3],
    /// `rho_j`, rad, each above -pi and at most pi.
    #[schema(value_type = Vector)]
    pub joints_rad: [f64; 3],
}

/// Asks where joint angles put the platform.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ForwardRequest {
    /// The robot; a desktop one when left out.
    #[serde(default)]
    pub geometry: RobotGeometry,
    /// `rho_j`, rad.
    #[schema(value_type = Vector)]
    pub joints_rad: [f64; 3],
}

/// Both ways to assemble the rods.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ForwardAnswer {
    /// Both positions, m; they mirror each other in the plane of the elbows.
    #[schema(value_type = [Vector; 2], min_items = 2, max_items = 2)]
    pub positions_m: [[f64; 3]; 2],
    /// The elbows of the three arms, m.
    #[schema(value_type = Matrix)]
    pub elbows_m: [[f64; 3]; 3],
}

/// Asks how one branch moves at a position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JacobianRequest {
    /// The robot; a desktop one when left out.
    #[serde(default)]
    pub geometry: RobotGeometry,
    /// Where the platform is, m.
    #[schema(value_type = Position)]
    pub position_m: [f64; 3],
    /// The signs `K_j`, each 1 or -1.
    #[schema(value_type = Branch)]
    pub branch: [i64; 3],
}

/// The robot at one place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JacobianAnswer {
    /// `J = K_r^-1 B_r` (15) by rows: from joint rates in rad/s to platform velocity in m/s.
    #[schema(value_type = Matrix)]
    pub jacobian: [[f64; 3]; 3],
    /// Greatest over least singular value of `J`; 1 is best.
    pub condition_number: f64,
    /// `rho_j`, rad.
    #[schema(value_type = Vector)]
    pub joints_rad: [f64; 3],
    /// The elbows of the three arms, m.
    #[schema(value_type = Matrix)]
    pub elbows_m: [[f64; 3]; 3],
    /// How far each arm is from stretched or folded, from 0 (singular) to 1.
    #[schema(value_type = Vector)]
    pub serial_measures: [f64; 3],
    /// How far the rods are from one plane, from 0 (singular) to 1.
    pub parallel_measure: f64,
}

/// Asks where the robot reaches, and how evenly it moves there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WorkspaceRequest {
    /// The robot; a desktop one when left out.
    #[serde(default)]
    pub geometry: RobotGeometry,
    /// The branch; elbows outwards above the base when left out.
    #[serde(default = "outwards")]
    #[schema(value_type = Branch)]
    pub branch: [i64; 3],
    /// Corners of the box to map, least first, m; a box that holds everything in reach when left out. Flat in one
    /// direction it is a slice.
    #[schema(nullable = false, value_type = Region)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub region_m: Option<[[f64; 3]; 2]>,
    /// Cells along x, y and z, each at least 1 and 100,000 in all.
    #[serde(default = "some_cells")]
    #[schema(value_type = Cells)]
    pub cells: [u32; 3],
}

/// A map of the workspace.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WorkspaceAnswer {
    /// Corners of the box that was mapped, least first, m.
    #[schema(value_type = Region)]
    pub region_m: [[f64; 3]; 2],
    /// Cells along x, y and z.
    #[schema(value_type = Cells)]
    pub cells: [u32; 3],
    /// The branch.
    #[schema(value_type = Branch)]
    pub branch: [i64; 3],
    /// Inverse condition number at the centre of each cell, x fastest, then y, then z: from 0 at a singularity to 1;
    /// `null` out of reach.
    pub dexterity: Vec<Option<f64>>,
    /// Share of the cells that is reachable.
    pub reachable_share: f64,
    /// Volume of the reachable cells, m³; 0 for a slice.
    pub reachable_volume_m3: f64,
    /// Mean over the reachable cells; `null` where there are none.
    #[schema(required)]
    pub mean_dexterity: Option<f64>,
}

impl Default for RobotGeometry {
    /// A robot that fits on a desk, arms at 0, 120 and 240 degrees: the paper prints no dimensions.
    fn default() -> Self {
        Self {
            base_radius_m: 0.12,
            platform_radius_m: 0.04,
            upper_link_m: 0.10,
            lower_link_m: 0.20,
            arm_angles_deg: [0.0, 120.0, 240.0],
        }
    }
}

impl Validate for RobotGeometry {
    /// # Errors
    /// A length or an angle out of range. Arms that coincide are found out by the calculation.
    fn validate(&self) -> Result<(), FieldError> {
        check("/base_radius_m", self.base_radius_m, 0.0..=MAX_LENGTH_M)?;
        check(
            "/platform_radius_m",
            self.platform_radius_m,
            0.0..=MAX_LENGTH_M,
        )?;
        check("/upper_link_m", self.upper_link_m, 1e-6..=MAX_LENGTH_M)?;
        check("/lower_link_m", self.lower_link_m, 1e-6..=MAX_LENGTH_M)?;
        for (index, &angle) in self.arm_angles_deg.iter().enumerate() {
            check(&format!("/arm_angles_deg/{index}"), angle, -3600.0..=3600.0)?;
        }
        Ok(())
    }
}

impl Validate for InverseRequest {
    fn validate(&self) -> Result<(), FieldError> {
        self.geometry.validate_under("/geometry")?;
        check_position("/position_m", &self.position_m)
    }
}

impl Validate for ForwardRequest {
    fn validate(&self) -> Result<(), FieldError> {
        self.geometry.validate_under("/geometry")?;
        check_finite("/joints_rad", &self.joints_rad)
    }
}

impl Validate for JacobianRequest {
    fn validate(&self) -> Result<(), FieldError> {
        self.geometry.validate_under("/geometry")?;
        check_position("/position_m", &self.position_m)?;
        check_branch(&self.branch)
    }
}

impl Validate for WorkspaceRequest {
    fn validate(&self) -> Result<(), FieldError> {
        self.geometry.validate_under("/geometry")?;
        check_branch(&self.branch)?;
        if let Some([least, greatest]) = &self.region_m {
            check_position("/region_m/0", least)?;
            check_position("/region_m/1", greatest)?;
            for axis in 0..3 {
                let pointer = format!("/region_m/1/{axis}");
                check(&pointer, greatest[axis], least[axis]..=MAX_POSITION_M)?;
            }
        }
        if let Some(axis) = self.cells.iter().position(|count| *count == 0) {
            return Err(FieldError::new(format!("/cells/{axis}"), "no cells"));
        }
        let cells = self.cells.iter().try_fold(1_usize, |product, &count| {
            product.checked_mul(usize::try_from(count).ok()?)
        });
        match cells {
            Some(cells) if cells <= MAX_WORKSPACE_CELLS => Ok(()),
            _ => Err(FieldError::new(
                "/cells",
                format!(
                    "{:?} cells, wanted {MAX_WORKSPACE_CELLS} in all at most",
                    self.cells
                ),
            )),
        }
    }
}

fn check_position(pointer: &str, position_m: &[f64; 3]) -> Result<(), FieldError> {
    for (axis, &at) in position_m.iter().enumerate() {
        check(
            &format!("{pointer}/{axis}"),
            at,
            -MAX_POSITION_M..=MAX_POSITION_M,
        )?;
    }
    Ok(())
}

fn check_branch(branch: &[i64; 3]) -> Result<(), FieldError> {
    match branch.iter().position(|sign| ![1, -1].contains(sign)) {
        Some(arm) => Err(FieldError::new(
            format!("/branch/{arm}"),
            format!("{} is not 1 or -1", branch[arm]),
        )),
        None => Ok(()),
    }
}

fn outwards() -> [i64; 3] {
    [-1; 3]
}

fn some_cells() -> [u32; 3] {
    [32; 3]
}
