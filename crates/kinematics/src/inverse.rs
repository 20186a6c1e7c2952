//! From a position to joint angles: (6)–(12).
//!
//! ```text
//! R_j = d_j . e_j     S_j = d_j . z     T_j = (|d_j|² + l_1² - l_2²) / (2 l_1)
//! R_j cos rho_j + S_j sin rho_j = T_j                                              (6)
//! V_j = R_j² + S_j² - T_j²                                                         (12)
//! sin rho_j = (S_j T_j + K_j R_j sqrt V_j) / (R_j² + S_j²)                         (10)
//! cos rho_j = (R_j T_j - K_j S_j sqrt V_j) / (R_j² + S_j²)                         (11)
//! ```
//!
//! `R_j` is the component of `d_j` along the arm; (7) as printed has x and y exchanged.

use crate::angle;
use crate::branch::Branch;
use crate::error::KinematicsError;
use crate::geometry::{Geometry, require_finite};
use nalgebra::Vector3;

/// One of the eight joint sets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Signs `K_j`.
    pub branch: Branch,
    /// `rho_j`, each in (-pi, pi].
    pub joints_rad: Vector3<f64>,
}

/// `R, S, T` and the root of `V` of one arm.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Reach {
    pub(crate) r: f64,
    pub(crate) s: f64,
    pub(crate) t: f64,
    pub(crate) root_v: f64,
}

/// `V` this far below zero, relative to `R² + S² + T²`, is rounding: a stretched arm, not one out of reach.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

impl Geometry {
    /// All eight joint sets that put the platform at `position_m`, in the order of [`Branch::ALL`].
    ///
    /// # Errors
    /// The position is not finite, out of an arm's reach, or on an arm's axis where any angle fits.
    #[inline]
    pub fn inverse(&self, position_m: &Vector3<f64>) -> Result<[Solution; 8], KinematicsError> {
        let reaches = self.reaches(position_m)?;
        let (mut y, mut x) = ([0.0; 6], [0.0; 6]);
        for (j, reach) in reaches.iter().enumerate() {
            [y[j], x[j]] = reach.sine_cosine(1.0);
            [y[j + 3], x[j + 3]] = reach.sine_cosine(-1.0);
        }
        let angles = angle::directions(&y, &x);
        Ok(Branch::ALL.map(|branch| {
            let joint = |j: usize| angles[if branch.is_minus(j) { j + 3 } else { j }];
            Solution {
                branch,
                joints_rad: Vector3::new(joint(0), joint(1), joint(2)),
            }
        }))
    }

    /// The joint set of one branch, rad.
    ///
    /// # Errors
    /// As [`Geometry::inverse`].
    #[inline]
    pub fn inverse_on(
        &self,
        position_m: &Vector3<f64>,
        branch: Branch,
    ) -> Result<Vector3<f64>, KinematicsError> {
        let reaches = self.reaches(position_m)?;
        let (mut y, mut x) = ([0.0; 3], [0.0; 3]);
        for (j, reach) in reaches.iter().enumerate() {
            [y[j], x[j]] = reach.sine_cosine(sign(branch, j));
        }
        Ok(angle::directions(&y, &x).into())
    }

    /// Whether all three arms reach the position, without the angles.
    #[must_use]
    pub fn reaches_to(&self, position_m: &Vector3<f64>) -> bool {
        self.reaches(position_m).is_ok()
    }

    /// The branch with all elbows outwards at this position, where a robot of this kind usually works.
    #[must_use]
    pub fn outward_branch(&self, position_m: &Vector3<f64>) -> Branch {
        if position_m.z < 0.0 {
            Branch::ALL[0]
        } else {
            Branch::ALL[7]
        }
    }

    #[inline]
    pub(crate) fn reaches(&self, position_m: &Vector3<f64>) -> Result<[Reach; 3], KinematicsError> {
        require_finite("position_m", position_m)?;
        let squared = position_m.norm_squared();
        let mut reaches = [Reach::default(); 3];
        for (j, reach) in reaches.iter_mut().enumerate() {
            *reach = self.reach(position_m, squared, j)?;
        }
        Ok(reaches)
    }

    /// Of the arm at `j`, from 0, for a finite position and the square of its length.
    #[inline(always)]
    fn reach(
        &self,
        position_m: &Vector3<f64>,
        squared: f64,
        j: usize,
    ) -> Result<Reach, KinematicsError> {
        let [cosine, sine] = self.directions[j];
        let along = position_m.x * cosine + position_m.y * sine;
        let r = along + self.offset_m;
        let s = position_m.z;
        // |d|² with |e| = 1, so that only the component along the arm differs between arms.
        let d_squared = squared + self.offset_m * (2.0 * along + self.offset_m);
        let t = (d_squared + self.squares_m2) * self.half_per_upper;
        let plane = r * r + s * s;
        let v = plane - t * t;
        // Squares of a position far beyond any robot overflow, and infinity less infinity is not a number.
        if !v.is_finite() || v < -ROUNDING * (plane + t * t) {
            let discriminant_m2 = if v.is_nan() { f64::NEG_INFINITY } else { v };
            return Err(KinematicsError::Unreachable {
                arm: j + 1,
                discriminant_m2,
            });
        }
        // With T as small as its own rounding, position and axis cannot be told apart.
        if plane <= ROUNDING * ROUNDING * (d_squared + self.upper_m * self.upper_m) {
            return Err(KinematicsError::Indeterminate { arm: j + 1 });
        }
        Ok(Reach {
            r,
            s,
            t,
            root_v: v.max(0.0).sqrt(),
        })
    }

    /// How the arm at `j`, from 0, bends: its joint angle in (-pi, pi], rad.
    pub(crate) fn joint_on(
        &self,
        position_m: &Vector3<f64>,
        branch: Branch,
        j: usize,
    ) -> Result<f64, KinematicsError> {
        require_finite("position_m", position_m)?;
        let reach = self.reach(position_m, position_m.norm_squared(), j)?;
        let [y, x] = reach.sine_cosine(sign(branch, j));
        let [angle] = angle::directions(&[y], &[x]);
        Ok(angle)
    }
}

impl Reach {
    /// `sin rho` and `cos rho` times `R² + S²`: (10), (11) without the division, which a direction does not need.
    #[inline(always)]
    pub(crate) fn sine_cosine(&self, k: f64) -> [f64; 2] {
        let Self { r, s, t, root_v } = *self;
        [s * t + k * r * root_v, r * t - k * s * root_v]
    }
}

/// `K_j` as a factor.
#[inline(always)]
pub(crate) fn sign(branch: Branch, j: usize) -> f64 {
    if branch.is_minus(j) { -1.0 } else { 1.0 }
}
