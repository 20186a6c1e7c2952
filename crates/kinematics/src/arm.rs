//! Each arm by itself, as a picture of the robot needs it: also beside one that does not reach.

use crate::branch::Branch;
use crate::error::KinematicsError;
use crate::geometry::Geometry;
use nalgebra::Vector3;

/// One arm of a robot whose platform is at some position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// `e_j`: along the arm in the base's plane, of unit length.
    pub direction: Vector3<f64>,
    /// Its joint on the base, m.
    pub shoulder_m: Vector3<f64>,
    /// Where its rods end on the platform, m.
    pub wrist_m: Vector3<f64>,
    /// How it bends to get there, or why it does not.
    pub bend: Result<Bend, KinematicsError>,
}

/// How an arm bends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bend {
    /// `rho_j`, in (-pi, pi], rad.
    pub joint_rad: f64,
    /// Where the upper link meets the rods, m.
    pub elbow_m: Vector3<f64>,
}

impl Geometry {
    /// The three arms with the platform at `position_m`, on a branch.
    #[must_use]
    pub fn arms(&self, position_m: &Vector3<f64>, branch: Branch) -> [Arm; 3] {
        let dimensions = self.dimensions();
        std::array::from_fn(|j| {
            let direction = self.direction(j);
            let shoulder_m = direction * dimensions.base_radius_m;
            let bend = self.joint_on(position_m, branch, j).map(|joint_rad| {
                let (sine, cosine) = joint_rad.sin_cos();
                let link = direction * cosine + Vector3::z() * sine;
                Bend {
                    joint_rad,
                    elbow_m: shoulder_m + link * self.upper_m,
                }
            });
            Arm {
                direction,
                shoulder_m,
                wrist_m: position_m + direction * dimensions.platform_radius_m,
                bend,
            }
        })
    }
}
