//! The robot: requests to `teleclay_kinematics` and back.

use teleclay_kinematics::{
    Branch, Dimensions, Geometry, GeometryError, KinematicsError, Matrix3, Region, RegionError,
    Vector3, WorkspaceMap,
};
use teleclay_proto::http::theory::{
    BranchJoints, ForwardAnswer, ForwardRequest, InverseAnswer, InverseRequest, JacobianAnswer,
    JacobianRequest, RobotGeometry, WorkspaceAnswer, WorkspaceRequest,
};
use teleclay_proto::http::{FieldError, Validate};

use super::Unanswered;

/// All eight joint sets for a position.
///
/// # Errors
/// A field out of range, or a position out of reach.
pub fn inverse(request: &InverseRequest) -> Result<InverseAnswer, Unanswered> {
    request.validate()?;
    let solutions = geometry(&request.geometry)?
        .inverse(&Vector3::from(request.position_m))
        .map_err(unanswered)?;
    let branches = solutions.iter().map(|solution| BranchJoints {
        branch: solution.branch.signs(),
        joints_rad: solution.joints_rad.into(),
    });
    Ok(InverseAnswer {
        branches: branches.collect(),
    })
}

/// Both positions for a joint set.
///
/// # Errors
/// A field out of range, or rods that do not meet.
pub fn forward(request: &ForwardRequest) -> Result<ForwardAnswer, Unanswered> {
    request.validate()?;
    let geometry = geometry(&request.geometry)?;
    let joints = Vector3::from(request.joints_rad);
    let positions = geometry.forward(&joints).map_err(unanswered)?;
    let elbows = geometry.elbows(&joints).map_err(unanswered)?;
    Ok(ForwardAnswer {
        positions_m: positions.map(Into::into),
        elbows_m: elbows.map(Into::into),
    })
}

/// The Jacobian of one branch at a position, and how far it is from singular.
///
/// # Errors
/// A field out of range, a position out of reach, or a singular one.
pub fn jacobian(request: &JacobianRequest) -> Result<JacobianAnswer, Unanswered> {
    request.validate()?;
    let geometry = geometry(&request.geometry)?;
    let posture = geometry
        .posture(&Vector3::from(request.position_m), branch(request.branch)?)
        .map_err(unanswered)?;
    let jacobian = posture.jacobian().map_err(unanswered)?;
    let joints = posture.joints_rad();
    Ok(JacobianAnswer {
        jacobian: rows(&jacobian),
        condition_number: posture.condition_number().map_err(unanswered)?,
        joints_rad: joints.into(),
        elbows_m: geometry
            .elbows(&joints)
            .map_err(unanswered)?
            .map(Into::into),
        serial_measures: posture.serial_measures().into(),
        parallel_measure: posture.parallel_measure(),
    })
}

/// A map of where the robot reaches.
///
/// # Errors
/// A field out of range.
pub fn workspace(request: &WorkspaceRequest) -> Result<WorkspaceAnswer, Unanswered> {
    workspace_by_layers(request, |_| ())
}

/// The same, layer by layer from below; `progress` is told the share that is done.
///
/// # Errors
/// A field out of range.
pub fn workspace_by_layers(
    request: &WorkspaceRequest,
    mut progress: impl FnMut(f64),
) -> Result<WorkspaceAnswer, Unanswered> {
    request.validate()?;
    let geometry = geometry(&request.geometry)?;
    let branch = branch(request.branch)?;
    let counts = request.cells.map(|count| count as usize);
    let region = match request.region_m {
        Some([low, high]) => Region::new(Vector3::from(low), Vector3::from(high), counts),
        None => geometry.reachable_region(counts),
    }
    .map_err(region_error)?;
    let [x_count, y_count, z_count] = counts;
    let mut dexterity = Vec::with_capacity(x_count * y_count * z_count);
    for (layer, slice) in region.layers().enumerate() {
        let map: WorkspaceMap = geometry.map(&slice, branch);
        dexterity.extend_from_slice(map.dexterity());
        progress((layer + 1) as f64 / z_count as f64);
    }
    let reachable: Vec<f64> = dexterity.iter().copied().flatten().collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    Ok(WorkspaceAnswer {
        region_m: region.corners_m().map(Into::into),
        cells: request.cells,
        branch: branch.signs(),
        reachable_share: reachable.len() as f64 / dexterity.len() as f64,
        reachable_volume_m3: reachable.len() as f64 * region.cell_volume_m3(),
        mean_dexterity: (!reachable.is_empty()).then(|| mean(&reachable)),
        dexterity,
    })
}

fn geometry(raw: &RobotGeometry) -> Result<Geometry, Unanswered> {
    let dimensions = Dimensions {
        base_radius_m: raw.base_radius_m,
        platform_radius_m: raw.platform_radius_m,
        upper_link_m: raw.upper_link_m,
        lower_link_m: raw.lower_link_m,
        arm_angles_rad: raw.arm_angles_deg.map(f64::to_radians),
    };
    Geometry::new(dimensions).map_err(|error| {
        let field = match error {
            GeometryError::Length { quantity, .. } => quantity.to_owned(),
            GeometryError::Angle { arm, .. } => format!("arm_angles_deg/{}", arm - 1),
            GeometryError::ArmsCoincide { second, .. } => format!("arm_angles_deg/{}", second - 1),
        };
        FieldError::new(format!("/geometry/{field}"), error.to_string()).into()
    })
}

fn branch(signs: [i64; 3]) -> Result<Branch, Unanswered> {
    Branch::from_signs(signs).map_err(|error| {
        FieldError::new(format!("/branch/{}", error.arm - 1), error.to_string()).into()
    })
}

fn region_error(error: RegionError) -> Unanswered {
    let field = match error {
        RegionError::Edges { axis, .. } => format!("/region_m/1/{axis}"),
        RegionError::Cells { .. } => "/cells".to_owned(),
    };
    FieldError::new(field, error.to_string()).into()
}

fn unanswered(error: KinematicsError) -> Unanswered {
    let detail = error.to_string();
    match error {
        KinematicsError::NonFinite {
            quantity, index, ..
        } => FieldError::new(format!("/{quantity}/{index}"), detail).into(),
        KinematicsError::Unreachable { .. } => Unanswered::Unreachable(detail),
        KinematicsError::SpheresDoNotMeet { .. } => Unanswered::NoAssembly(detail),
        KinematicsError::Indeterminate { .. }
        | KinematicsError::ElbowsInLine
        | KinematicsError::Singular(_) => Unanswered::Singular(detail),
    }
}

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}
