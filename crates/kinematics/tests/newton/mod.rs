//! Forward kinematics by Newton's method: written for comparison only. It knows the three sphere equations and nothing
//! of their closed solution.

use teleclay_kinematics::{Dimensions, Matrix3, Vector3};

/// Solves `|P - c_j|² = l_2²` from a starting point; `None` where it does not settle or the matrix is singular.
pub(crate) fn forward(
    dimensions: &Dimensions,
    joints_rad: &Vector3<f64>,
    start_m: Vector3<f64>,
) -> Option<Vector3<f64>> {
    const ITERATIONS: usize = 50;
    const SETTLED_M: f64 = 1e-12;
    let offset = dimensions.base_radius_m - dimensions.platform_radius_m;
    let centres: [Vector3<f64>; 3] = std::array::from_fn(|j| {
        let (sine, cosine) = joints_rad[j].sin_cos();
        let (y, x) = dimensions.arm_angles_rad[j].sin_cos();
        let along = offset + dimensions.upper_link_m * cosine;
        Vector3::new(along * x, along * y, dimensions.upper_link_m * sine)
    });
    let mut position = start_m;
    for _ in 0..ITERATIONS {
        let rods = centres.map(|centre| position - centre);
        let rod2 = dimensions.lower_link_m * dimensions.lower_link_m;
        let residual = Vector3::from(rods.map(|rod| rod.norm_squared() - rod2));
        let slope = Matrix3::from_rows(&rods.map(|rod| rod.transpose() * 2.0));
        let step = slope.try_inverse()? * residual;
        position -= step;
        if step.norm() < SETTLED_M {
            return Some(position);
        }
    }
    None
}
