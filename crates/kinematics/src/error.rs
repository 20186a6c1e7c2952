//! What can stand between an input and an answer.

/// Why there is no solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum KinematicsError {
    /// An input is infinite or not a number.
    #[error("{quantity}[{index}] is {got}, need a finite number")]
    NonFinite {
        /// Which input.
        quantity: &'static str,
        /// Which component, from 0.
        index: usize,
        /// As given.
        got: f64,
    },
    /// `V_j < 0` (12): the arm is too short for the position, or too long.
    #[error(
        "position is out of reach of arm {arm}: R² + S² - T² = {discriminant_m2} m², need at least 0"
    )]
    Unreachable {
        /// Arm, from 1.
        arm: usize,
        /// `V_j`, m².
        discriminant_m2: f64,
    },
    /// The rods meet on the joint's own axis: any angle of this arm closes the loop.
    #[error("the rods of arm {arm} end on its joint's axis, so every joint angle fits")]
    Indeterminate {
        /// Arm, from 1.
        arm: usize,
    },
    /// The three spheres about the elbows have no point in common.
    #[error("rods are {gap_m} m too short to meet from these elbows")]
    SpheresDoNotMeet {
        /// How much longer the rods would have to be.
        gap_m: f64,
    },
    /// The three sphere centres lie on a line: the platform may turn about it freely, or does not fit at all.
    #[error("the elbows are in line, so the platform's position is not determined")]
    ElbowsInLine,
    /// The requested map does not exist here.
    #[error("singular: {0}")]
    Singular(Singularity),
}

/// The two kinds of singularity, told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Singularity {
    /// `det B_r = 0`: an arm is stretched or folded. The platform cannot be moved along its rods, and the joint there
    /// carries no load.
    #[error("arm {arm} is stretched or folded")]
    Serial {
        /// The arm that is nearest to it, from 1.
        arm: usize,
    },
    /// `det K_r = 0`: the rods lie in a plane, or parallel to one. The platform gains a freedom that no joint holds;
    /// where arms folded inwards bring their rods together, two or three.
    #[error("the rods lie in one plane and do not hold the platform")]
    Parallel,
    /// Both at once.
    #[error("arm {arm} is stretched or folded, and the rods lie in one plane")]
    Both {
        /// The arm that is nearest to stretched or folded, from 1.
        arm: usize,
    },
}
