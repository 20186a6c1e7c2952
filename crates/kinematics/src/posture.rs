//! Velocities and forces at one posture: (13)–(15).
//!
//! ```text
//! B_r rho_dot = K_r X_dot                                                        (13)
//! row j of K_r = k_j = P + r_p e_j - elbow_j          the rod
//! B_r = diag(k_j . l_1 (-sin rho_j e_j + cos rho_j z))
//! X_dot = K_r^-1 B_r rho_dot                                                     (14)
//! J = K_r^-1 B_r       tau = J^T F                                               (15)
//! ```
//!
//! `B_r` vanishes with `V_j`: its entries are `-K_j l_1 sqrt V_j`.

use crate::branch::{Assembly, Branch};
use crate::error::{KinematicsError, Singularity};
use crate::geometry::{Geometry, require_finite};
use crate::inverse::sign;
use nalgebra::{Matrix3, SVD, Vector3};

/// The robot at one place with one set of joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posture {
    position_m: Vector3<f64>,
    /// `cos rho_j`, `sin rho_j`.
    joints: [[f64; 2]; 3],
    /// `k_j`, m.
    rods_m: [Vector3<f64>; 3],
    /// The upper link and, as long as it, the direction in which its end moves, m.
    links_m: [[Vector3<f64>; 2]; 3],
    /// Diagonal of `B_r`, m².
    b_r_m2: Vector3<f64>,
    upper_m: f64,
    lower_m: f64,
}

/// A measure below this is a singularity. The serial one goes with the square root of the distance to the edge of
/// reach, so rounding of a position at the very edge alone gives 2e-8 or so; a posture that is 1e-7 away is 1e-15 m
/// from it.
const SINGULAR: f64 = 1e-7;

impl Geometry {
    /// The posture of one branch at a position.
    ///
    /// # Errors
    /// As [`Geometry::inverse`].
    pub fn posture(
        &self,
        position_m: &Vector3<f64>,
        branch: Branch,
    ) -> Result<Posture, KinematicsError> {
        let reaches = self.reaches(position_m)?;
        let joints = std::array::from_fn(|j| {
            let [sine, cosine] = reaches[j].sine_cosine(sign(branch, j));
            let scale = 1.0 / sine.hypot(cosine);
            [cosine * scale, sine * scale]
        });
        Ok(self.posture_with(position_m, joints))
    }

    /// The posture that measured joint angles put the robot into.
    ///
    /// # Errors
    /// As [`Geometry::forward`].
    pub fn posture_of(
        &self,
        joints_rad: &Vector3<f64>,
        assembly: Assembly,
    ) -> Result<Posture, KinematicsError> {
        let position_m = self.forward_on(joints_rad, assembly)?;
        let joints = std::array::from_fn(|j| {
            let (sine, cosine) = joints_rad[j].sin_cos();
            [cosine, sine]
        });
        Ok(self.posture_with(&position_m, joints))
    }

    fn posture_with(&self, position_m: &Vector3<f64>, joints: [[f64; 2]; 3]) -> Posture {
        let mut posture = Posture {
            position_m: *position_m,
            joints,
            rods_m: [Vector3::zeros(); 3],
            links_m: [[Vector3::zeros(); 2]; 3],
            b_r_m2: Vector3::zeros(),
            upper_m: self.upper_m,
            lower_m: self.lower_m,
        };
        for (j, [cosine, sine]) in joints.into_iter().enumerate() {
            let e = self.direction(j);
            let upper = (e * cosine + Vector3::z() * sine) * self.upper_m;
            let tangent = (Vector3::z() * cosine - e * sine) * self.upper_m;
            posture.rods_m[j] = position_m + e * self.offset_m - upper;
            posture.links_m[j] = [upper, tangent];
            posture.b_r_m2[j] = posture.rods_m[j].dot(&tangent);
        }
        posture
    }
}

impl Posture {
    /// Where the platform is, m.
    #[must_use]
    pub fn position_m(&self) -> Vector3<f64> {
        self.position_m
    }

    /// `rho_j`, each in (-pi, pi].
    #[must_use]
    pub fn joints_rad(&self) -> Vector3<f64> {
        Vector3::from(self.joints.map(|[cosine, sine]| sine.atan2(cosine)))
    }

    /// Signs `K_j` of this posture.
    #[must_use]
    pub fn branch(&self) -> Branch {
        let signs = std::array::from_fn(|j| if 0.0 < self.b_r_m2[j] { -1 } else { 1 });
        Branch::from_signs(signs).expect("each sign is 1 or -1")
    }

    /// `K_r`: the rods as rows, m.
    #[must_use]
    pub fn k_r(&self) -> Matrix3<f64> {
        Matrix3::from_rows(&self.rods_m.map(|rod| rod.transpose()))
    }

    /// `B_r`: diagonal, m².
    #[must_use]
    pub fn b_r(&self) -> Matrix3<f64> {
        Matrix3::from_diagonal(&self.b_r_m2)
    }

    /// `J` (15): joint rates in rad/s to platform velocity in m/s.
    ///
    /// # Errors
    /// Either kind of singularity: `J` does not exist, or has lost rank.
    pub fn jacobian(&self) -> Result<Matrix3<f64>, KinematicsError> {
        self.require_regular()?;
        Ok(self.inverse_k_r() * self.b_r())
    }

    /// Greatest over least singular value of `J`; 1 is best.
    ///
    /// # Errors
    /// As [`Posture::jacobian`].
    pub fn condition_number(&self) -> Result<f64, KinematicsError> {
        /// A 3 x 3 matrix settles within ten.
        const ITERATIONS: usize = 100;
        let jacobian = self.jacobian()?;
        let undetermined = KinematicsError::Singular(Singularity::Parallel);
        let svd =
            SVD::try_new(jacobian, false, false, f64::EPSILON, ITERATIONS).ok_or(undetermined)?;
        Ok(svd.singular_values.max() / svd.singular_values.min())
    }

    /// Joint torques in N·m that hold a force in N on the platform: `J^T F`. Exists at a serial singularity too.
    ///
    /// # Errors
    /// The force is not finite, or the rods do not hold the platform.
    pub fn torques_n_m(&self, force_n: &Vector3<f64>) -> Result<Vector3<f64>, KinematicsError> {
        require_finite("force_n", force_n)?;
        self.require_rods_hold()?;
        Ok(self
            .b_r_m2
            .component_mul(&self.inverse_k_r().tr_mul(force_n)))
    }

    /// Platform velocity in m/s for joint rates in rad/s (14).
    ///
    /// # Errors
    /// A rate is not finite, or the rods do not hold the platform.
    pub fn velocity_m_s(
        &self,
        rates_rad_s: &Vector3<f64>,
    ) -> Result<Vector3<f64>, KinematicsError> {
        require_finite("rates_rad_s", rates_rad_s)?;
        self.require_rods_hold()?;
        Ok(self.inverse_k_r() * self.b_r_m2.component_mul(rates_rad_s))
    }

    /// Joint rates in rad/s for a platform velocity in m/s: (13), solved the other way.
    ///
    /// # Errors
    /// The velocity is not finite, or an arm is stretched or folded.
    pub fn rates_rad_s(
        &self,
        velocity_m_s: &Vector3<f64>,
    ) -> Result<Vector3<f64>, KinematicsError> {
        require_finite("velocity_m_s", velocity_m_s)?;
        let (arm, measure) = self.nearest_to_serial();
        if measure < SINGULAR {
            return Err(KinematicsError::Singular(Singularity::Serial { arm }));
        }
        Ok((self.k_r() * velocity_m_s).component_div(&self.b_r_m2))
    }

    /// Platform acceleration in m/s² for joint rates in rad/s and joint accelerations in rad/s²: (13) differentiated
    /// once more. With `u_j` the upper link and `u_j'` its derivative by `rho_j`,
    ///
    /// ```text
    /// k_j . X_ddot = b_j rho_ddot_j - (k_j . u_j) rho_dot_j² - |X_dot - u_j' rho_dot_j|²
    /// ```
    ///
    /// # Errors
    /// A rate is not finite, or the rods do not hold the platform.
    pub fn acceleration_m_s2(
        &self,
        rates_rad_s: &Vector3<f64>,
        accelerations_rad_s2: &Vector3<f64>,
    ) -> Result<Vector3<f64>, KinematicsError> {
        require_finite("accelerations_rad_s2", accelerations_rad_s2)?;
        let velocity_m_s = self.velocity_m_s(rates_rad_s)?;
        let right = Vector3::from_fn(|j, _| {
            let (rate, [upper_m, tangent_m]) = (rates_rad_s[j], self.links_m[j]);
            self.b_r_m2[j] * accelerations_rad_s2[j]
                - self.rods_m[j].dot(&upper_m) * rate * rate
                - (velocity_m_s - tangent_m * rate).norm_squared()
        });
        Ok(self.inverse_k_r() * right)
    }

    /// How far each arm is from stretched or folded: `|cos|` between the rod and the way the elbow moves, from 0
    /// (singular) to 1.
    #[must_use]
    pub fn serial_measures(&self) -> Vector3<f64> {
        self.b_r_m2.map(f64::abs) / (self.upper_m * self.lower_m)
    }

    /// How far the rods are from one plane: volume that they span as unit vectors, from 0 (singular) to 1.
    #[must_use]
    pub fn parallel_measure(&self) -> f64 {
        self.determinant().abs() / self.lower_m.powi(3)
    }

    /// Which kind of singularity the posture is within `measure` of, if any. Measures are those of
    /// [`Posture::serial_measures`] and [`Posture::parallel_measure`].
    #[must_use]
    pub fn singularity_within(&self, measure: f64) -> Option<Singularity> {
        let (arm, serial) = self.nearest_to_serial();
        match (serial < measure, self.parallel_measure() < measure) {
            (true, true) => Some(Singularity::Both { arm }),
            (true, false) => Some(Singularity::Serial { arm }),
            (false, true) => Some(Singularity::Parallel),
            (false, false) => None,
        }
    }

    fn nearest_to_serial(&self) -> (usize, f64) {
        let measures = self.serial_measures();
        let j = measures.imin();
        (j + 1, measures[j])
    }

    fn require_regular(&self) -> Result<(), KinematicsError> {
        match self.singularity_within(SINGULAR) {
            Some(singularity) => Err(KinematicsError::Singular(singularity)),
            None => Ok(()),
        }
    }

    fn require_rods_hold(&self) -> Result<(), KinematicsError> {
        match self.singularity_within(SINGULAR) {
            Some(singularity @ (Singularity::Parallel | Singularity::Both { .. })) => {
                Err(KinematicsError::Singular(singularity))
            }
            Some(Singularity::Serial { .. }) | None => Ok(()),
        }
    }

    fn determinant(&self) -> f64 {
        let [k1, k2, k3] = &self.rods_m;
        k1.dot(&k2.cross(k3))
    }

    /// Columns `k_2 x k_3`, `k_3 x k_1`, `k_1 x k_2` over the determinant.
    fn inverse_k_r(&self) -> Matrix3<f64> {
        let [k1, k2, k3] = &self.rods_m;
        Matrix3::from_columns(&[k2.cross(k3), k3.cross(k1), k1.cross(k2)]) / self.determinant()
    }
}
