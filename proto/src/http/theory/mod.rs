//! The mathematics of \[KHMH03\] as calls: the robot, the loop, the cutting experiment.
//!
//! Requests name a quantity as the paper's symbol does, in SI units; a polynomial is the list of its coefficients,
//! highest power first; a complex number is `[re, im]`; what has no finite value is `null`.

mod experiment;
mod kinematics;
mod stability;
mod tuning;

pub use experiment::{
    CuttingAnswer, CuttingRequest, CuttingSpecimen, CuttingTrace, HandForceAt, MAX_RANGES,
    MAX_TRACE_SAMPLES, MIN_TRACE_SAMPLES,
};
pub use kinematics::{
    BranchJoints, ForwardAnswer, ForwardRequest, InverseAnswer, InverseRequest, JacobianAnswer,
    JacobianRequest, MAX_WORKSPACE_CELLS, RobotGeometry, WorkspaceAnswer, WorkspaceRequest,
};
pub use stability::{
    BodeCurve, CompensatorName, CompensatorPoint, DelayVerdict, GainMargin, LoopAnswer,
    LoopRequest, MAX_COEFFICIENTS, MAX_OMEGAS, NyquistCurve, PhaseMargin, TransferFunction,
};
pub use tuning::{TunedScheme, TuningAnswer, TuningRequest};

use super::FieldError;

/// A complex number, `[re, im]`.
pub type ComplexPair = [f64; 2];

/// Checks a list's length and that every number in it is finite.
fn check_list(
    pointer: &str,
    list: &[f64],
    lengths: std::ops::RangeInclusive<usize>,
) -> Result<(), FieldError> {
    if !lengths.contains(&list.len()) {
        let (least, most) = lengths.into_inner();
        return Err(FieldError::new(
            pointer,
            format!("{} numbers, wanted {least} to {most}", list.len()),
        ));
    }
    check_finite(pointer, list)
}

/// Checks that every number of a list is finite.
fn check_finite(pointer: &str, list: &[f64]) -> Result<(), FieldError> {
    match list.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(FieldError::new(
            format!("{pointer}/{index}"),
            format!("{} is not a finite number", list[index]),
        )),
        None => Ok(()),
    }
}
