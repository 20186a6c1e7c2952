//! The robot's dimensions, checked once.

use crate::error::KinematicsError;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Raw dimensions, as they come from a file or a request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dimensions {
    /// `r_b`, from the centre of the base to the joints, m; not below zero.
    pub base_radius_m: f64,
    /// `r_p`, from the centre of the platform to the rods, m; not below zero.
    pub platform_radius_m: f64,
    /// `l_1`, actuated links, m; above zero.
    pub upper_link_m: f64,
    /// `l_2`, rods, m; above zero.
    pub lower_link_m: f64,
    /// `gamma_j`, directions of the arms on the base, rad; no two alike.
    pub arm_angles_rad: [f64; 3],
}

/// Proven dimensions, with everything in place that does not depend on the posture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    dimensions: Dimensions,
    /// `e_j`, first two components.
    pub(crate) directions: [[f64; 2]; 3],
    /// `r_p - r_b`.
    pub(crate) offset_m: f64,
    pub(crate) upper_m: f64,
    pub(crate) lower_m: f64,
    /// `l_1² - l_2²`.
    pub(crate) squares_m2: f64,
    /// `1 / (2 l_1)`.
    pub(crate) half_per_upper: f64,
}

/// Why dimensions describe no robot.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum GeometryError {
    /// A length is out of range.
    #[error("{quantity} is {got} m, need a finite length {need}")]
    Length {
        /// Its name.
        quantity: &'static str,
        /// As given.
        got: f64,
        /// Its range, in words.
        need: &'static str,
    },
    /// An angle is infinite or not a number.
    #[error("angle of arm {arm} is {got} rad, need a finite number")]
    Angle {
        /// Arm, from 1.
        arm: usize,
        /// As given.
        got: f64,
    },
    /// Two arms stand in one place: the platform could slide along a line that no joint holds.
    #[error("arms {first} and {second} point the same way")]
    ArmsCoincide {
        /// Arm, from 1.
        first: usize,
        /// Arm, from 1.
        second: usize,
    },
}

/// Arms nearer than this count as one: a micrometre on a metre.
const LEAST_ANGLE_RAD: f64 = 1e-6;
/// Shortest and longest length: below and above, squares would leave the range in which rounding is harmless.
const SHORTEST_M: f64 = 1e-6;
const LONGEST_M: f64 = 1e6;

impl Default for Dimensions {
    /// Ours, since the paper prints none: a robot that fits on a desk, arms at 0, 120 and 240 degrees.
    fn default() -> Self {
        Self {
            base_radius_m: 0.12,
            platform_radius_m: 0.04,
            upper_link_m: 0.10,
            lower_link_m: 0.20,
            arm_angles_rad: [0.0, TAU / 3.0, 2.0 * TAU / 3.0],
        }
    }
}

impl Default for Geometry {
    fn default() -> Self {
        Self::new(Dimensions::default()).expect("the default dimensions are in range")
    }
}

impl Geometry {
    /// Checks the dimensions.
    ///
    /// # Errors
    /// A length is out of range, an angle is not finite, or two arms coincide.
    pub fn new(dimensions: Dimensions) -> Result<Self, GeometryError> {
        let Dimensions {
            base_radius_m,
            platform_radius_m,
            upper_link_m,
            lower_link_m,
            arm_angles_rad,
        } = dimensions;
        for (quantity, got) in [
            ("base_radius_m", base_radius_m),
            ("platform_radius_m", platform_radius_m),
        ] {
            if !(0.0..=LONGEST_M).contains(&got) {
                return Err(GeometryError::Length {
                    quantity,
                    got,
                    need: "from 0 to 1e6 m",
                });
            }
        }
        for (quantity, got) in [
            ("upper_link_m", upper_link_m),
            ("lower_link_m", lower_link_m),
        ] {
            if !(SHORTEST_M..=LONGEST_M).contains(&got) {
                return Err(GeometryError::Length {
                    quantity,
                    got,
                    need: "from 1e-6 to 1e6 m",
                });
            }
        }
        if let Some(j) = arm_angles_rad.iter().position(|angle| !angle.is_finite()) {
            return Err(GeometryError::Angle {
                arm: j + 1,
                got: arm_angles_rad[j],
            });
        }
        let directions = arm_angles_rad.map(|angle| [angle.cos(), angle.sin()]);
        for (first, second) in [(0, 1), (1, 2), (0, 2)] {
            let ([a, b], [c, d]) = (directions[first], directions[second]);
            if (a - c).hypot(b - d) < LEAST_ANGLE_RAD {
                return Err(GeometryError::ArmsCoincide {
                    first: first + 1,
                    second: second + 1,
                });
            }
        }
        Ok(Self {
            dimensions,
            directions,
            offset_m: platform_radius_m - base_radius_m,
            upper_m: upper_link_m,
            lower_m: lower_link_m,
            squares_m2: upper_link_m * upper_link_m - lower_link_m * lower_link_m,
            half_per_upper: 0.5 / upper_link_m,
        })
    }

    /// The dimensions it was made from.
    #[must_use]
    pub fn dimensions(&self) -> Dimensions {
        self.dimensions
    }

    /// `e_j` of the arm at `j`, from 0.
    pub(crate) fn direction(&self, j: usize) -> Vector3<f64> {
        Vector3::new(self.directions[j][0], self.directions[j][1], 0.0)
    }
}

/// The one place where non-finite numbers are stopped.
#[inline]
pub(crate) fn require_finite(
    quantity: &'static str,
    values: &Vector3<f64>,
) -> Result<(), KinematicsError> {
    // One comparison for the common case: a sum of finite numbers within any machine's reach is finite.
    if (values.x + values.y + values.z).is_finite() {
        return Ok(());
    }
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(KinematicsError::NonFinite {
            quantity,
            index,
            got: values[index],
        }),
        None => Ok(()),
    }
}
