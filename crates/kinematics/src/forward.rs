//! From joint angles to a position, in closed form.
//!
//! The platform's centre lies on three spheres of radius `l_2` about `c_j = elbow_j - r_p e_j`. With `u = c_2 - c_1`,
//! `v = c_3 - c_1` and `n = u x v`, every point of the axis through the circumcentre along `n` is equally far from all
//! three:
//!
//! ```text
//! m = c_1 + (|u|² v - |v|² u) x n / (2 |n|²)        P = m +- n/|n| sqrt(l_2² - |m - c_1|²)
//! ```

use crate::branch::Assembly;
use crate::error::KinematicsError;
use crate::geometry::{Geometry, require_finite};
use nalgebra::Vector3;

/// Centres count as in line when their triangle has less than this share of the area that the arms can span: rounding
/// then says where it faces.
const IN_LINE: f64 = 1e-12;
/// `l_2²` this far below the circumradius squared is rounding: spheres that touch, not spheres that miss.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

impl Geometry {
    /// Both positions that fit the joint angles: [`Assembly::Front`], then [`Assembly::Back`].
    ///
    /// # Errors
    /// An angle is not finite, the elbows are in line, or the rods are too short to meet.
    #[inline]
    pub fn forward(&self, joints_rad: &Vector3<f64>) -> Result<[Vector3<f64>; 2], KinematicsError> {
        require_finite("joints_rad", joints_rad)?;
        let [c1, c2, c3] = self.sphere_centres(joints_rad);
        let (u, v) = (c2 - c1, c3 - c1);
        let n = u.cross(&v);
        let (u2, v2, n2) = (u.norm_squared(), v.norm_squared(), n.norm_squared());
        let span = self.offset_m.abs() + self.upper_m;
        let least_area = IN_LINE * span * span;
        if n2 <= least_area * least_area {
            return Err(KinematicsError::ElbowsInLine);
        }
        let to_middle = (v * u2 - u * v2).cross(&n) * (0.5 / n2);
        let circumradius2 = to_middle.norm_squared();
        let rod2 = self.lower_m * self.lower_m;
        let height2 = rod2 - circumradius2;
        if height2 < -ROUNDING * rod2 {
            return Err(KinematicsError::SpheresDoNotMeet {
                gap_m: circumradius2.sqrt() - self.lower_m,
            });
        }
        let middle = c1 + to_middle;
        let lift = n * (height2.max(0.0) / n2).sqrt();
        Ok([middle + lift, middle - lift])
    }

    /// One of the two positions.
    ///
    /// # Errors
    /// As [`Geometry::forward`].
    #[inline]
    pub fn forward_on(
        &self,
        joints_rad: &Vector3<f64>,
        assembly: Assembly,
    ) -> Result<Vector3<f64>, KinematicsError> {
        let [front, back] = self.forward(joints_rad)?;
        Ok(match assembly {
            Assembly::Front => front,
            Assembly::Back => back,
        })
    }

    /// Elbows of the three arms, m.
    ///
    /// # Errors
    /// An angle is not finite.
    pub fn elbows(&self, joints_rad: &Vector3<f64>) -> Result<[Vector3<f64>; 3], KinematicsError> {
        require_finite("joints_rad", joints_rad)?;
        let centres = self.sphere_centres(joints_rad);
        Ok(std::array::from_fn(|j| {
            centres[j] + self.direction(j) * self.dimensions().platform_radius_m
        }))
    }

    #[inline]
    fn sphere_centres(&self, joints_rad: &Vector3<f64>) -> [Vector3<f64>; 3] {
        std::array::from_fn(|j| {
            let (sine, cosine) = joints_rad[j].sin_cos();
            let along = self.upper_m * cosine - self.offset_m;
            let [x, y] = self.directions[j];
            Vector3::new(along * x, along * y, self.upper_m * sine)
        })
    }
}
