//! Tool poses on a fixed lattice, so that both ends of a network cut with the same numbers.
//!
//! A pose is quantised *before* it cuts. Whoever receives it cuts with exactly the same integers, and floating-point
//! noise in the control loop of one side can never show as a difference between two copies of the clay.

use thiserror::Error;

/// Lattice steps in a metre: a step is `2^-24` m, about 60 nm, exactly representable in binary.
pub const STEPS_PER_METRE: f64 = 16_777_216.0;

/// Adding and subtracting this rounds a double of magnitude below `2^51` to the nearest integer, ties to even, with
/// additions alone: no library call whose result could differ from machine to machine.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// A tool position in the clay frame, in lattice steps of `2^-24` m; every axis reaches to ±128 m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Pose {
    steps: [i32; 3],
}

/// A position that has no place on the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum PoseError {
    /// A coordinate is NaN or infinite.
    #[error("coordinate {axis} of the position is {got_m} m, which is not finite")]
    NotFinite {
        /// 0, 1, 2 for x, y, z.
        axis: usize,
        /// The coordinate as it came, m.
        got_m: f64,
    },
    /// A coordinate is outside the lattice.
    #[error("coordinate {axis} of the position is {got_m} m, the lattice ends at 128 m")]
    OutOfRange {
        /// 0, 1, 2 for x, y, z.
        axis: usize,
        /// The coordinate as it came, m.
        got_m: f64,
    },
}

impl Pose {
    /// The lattice point nearest to a position in metres, ties to even.
    ///
    /// # Errors
    /// When a coordinate is not finite or its magnitude reaches 128 m.
    pub fn quantise(position_m: [f64; 3]) -> Result<Self, PoseError> {
        let mut steps = [0; 3];
        for (axis, (&got_m, step)) in position_m.iter().zip(&mut steps).enumerate() {
            if !got_m.is_finite() {
                return Err(PoseError::NotFinite { axis, got_m });
            }
            let scaled = got_m * STEPS_PER_METRE;
            let in_range = -f64::from(i32::MAX) <= scaled && scaled <= f64::from(i32::MAX);
            if !in_range {
                return Err(PoseError::OutOfRange { axis, got_m });
            }
            *step = ((scaled + ROUNDER) - ROUNDER) as i32;
        }
        Ok(Self { steps })
    }

    /// The pose at these lattice steps; every triple is a valid pose.
    #[must_use]
    pub const fn from_steps(steps: [i32; 3]) -> Self {
        Self { steps }
    }

    /// Lattice steps along x, y, z: what travels over a network.
    #[must_use]
    pub const fn steps(self) -> [i32; 3] {
        self.steps
    }

    /// The position in metres, without rounding.
    #[must_use]
    pub fn position_m(self) -> [f64; 3] {
        self.steps.map(|step| f64::from(step) / STEPS_PER_METRE)
    }

    /// The way from another pose to this one, m, without rounding.
    #[must_use]
    pub fn displacement_from_m(self, from: Self) -> [f64; 3] {
        std::array::from_fn(|axis| {
            (f64::from(self.steps[axis]) - f64::from(from.steps[axis])) / STEPS_PER_METRE
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Quantising moves a point by at most half a step, and a lattice point not at all.
        #[test]
        fn quantising_rounds_to_nearest_and_once(x in -127.9..127.9, y in -0.1..0.1, z in -1e-7..1e-7) {
            let pose = Pose::quantise([x, y, z]).unwrap();
            for (back, asked) in pose.position_m().into_iter().zip([x, y, z]) {
                prop_assert!((back - asked).abs() <= 0.5 / STEPS_PER_METRE);
            }
            prop_assert_eq!(Pose::quantise(pose.position_m()).unwrap(), pose);
        }

        #[test]
        fn displacements_telescope(a in any::<[i32; 3]>(), b in any::<[i32; 3]>()) {
            let (a, b) = (Pose::from_steps(a), Pose::from_steps(b));
            let way_m = b.displacement_from_m(a);
            for (axis, way_m) in way_m.into_iter().enumerate() {
                let exact = i64::from(b.steps()[axis]) - i64::from(a.steps()[axis]);
                prop_assert_eq!((way_m * STEPS_PER_METRE) as i64, exact);
            }
        }
    }

    #[test]
    fn what_has_no_place_is_refused_with_its_axis() {
        assert!(matches!(
            Pose::quantise([0.0, f64::NAN, 0.0]),
            Err(PoseError::NotFinite { axis: 1, .. })
        ));
        assert!(matches!(
            Pose::quantise([0.0, 0.0, f64::NEG_INFINITY]),
            Err(PoseError::NotFinite { axis: 2, .. })
        ));
        assert_eq!(
            Pose::quantise([128.0, 0.0, 0.0]),
            Err(PoseError::OutOfRange {
                axis: 0,
                got_m: 128.0
            })
        );
        assert!(Pose::quantise([-1e300, 0.0, 0.0]).is_err());
        assert!(Pose::quantise([127.999_999, -127.999_999, 0.0]).is_ok());
    }
}
