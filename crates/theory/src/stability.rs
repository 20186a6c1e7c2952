//! The loop: requests to `teleclay_control::analysis` and back.

use teleclay_control::analysis::{AnalysisError, CompensatorResponse, LoopInput};
use teleclay_control::compensators::{Compensator, CompensatorError, Sides};
use teleclay_control::{
    Complex, DelayMargin, GainMargin, LoopError, NoMargin, Polynomial, RationalError,
    RationalFunction, analysis,
};
use teleclay_proto::http::theory::{
    BodeCurve, CompensatorName, CompensatorPoint, ComplexPair, DelayVerdict, LoopAnswer,
    LoopRequest, NyquistCurve, PhaseMargin, TransferFunction,
};
use teleclay_proto::http::{FieldError, Validate, theory};

use super::Unanswered;

/// Everything about a loop.
///
/// # Errors
/// A field out of range, or parts that make no loop.
pub fn analyse(request: &LoopRequest) -> Result<LoopAnswer, Unanswered> {
    let input = loop_input(request)?;
    let found = analysis::analyse(&input).map_err(unanswered)?;
    let curve = found.curve;
    Ok(LoopAnswer {
        compensators: found.compensators.iter().map(point).collect(),
        improper_compensators: found.improper_compensators.iter().map(name).collect(),
        closed_loop_poles: found
            .closed_loop_poles
            .iter()
            .map(|pole| pair(*pole))
            .collect(),
        stable_without_delay: found.stable_without_delay,
        delay_margin_force_exchange_s: found.delay_margin_force_exchange.seconds(),
        delay_verdict_force_exchange: verdict(found.delay_margin_force_exchange),
        delay_margin_position_force_s: found.delay_margin_position_force.seconds(),
        delay_verdict_position_force: verdict(found.delay_margin_position_force),
        small_gain_holds: found.small_gain_holds,
        small_gain_peak: found.small_gain_peak,
        nyquist_min_distance: finite(found.nyquist_min_distance),
        nyquist_min_omega_rad_s: finite(found.nyquist_min_omega_rad_s),
        gain_margin_increase: found.classical.gain_increase.map(gain_margin),
        gain_margin_decrease: found.classical.gain_decrease.map(gain_margin),
        phase_margin: found.classical.phase.map(|margin| PhaseMargin {
            phase_rad: margin.phase_rad,
            omega_rad_s: margin.omega_rad_s,
        }),
        nyquist: NyquistCurve {
            omega_rad_s: curve.omega_rad_s.clone(),
            re: curve.re,
            im: curve.im,
        },
        bode: BodeCurve {
            omega_rad_s: curve.omega_rad_s,
            magnitude_db: curve.magnitude_db,
            phase_rad: curve.phase_rad,
        },
    })
}

/// The loop that a request describes, proven, for whoever asks what [`analyse`] does not.
///
/// # Errors
/// A field out of range.
pub fn loop_input(request: &LoopRequest) -> Result<LoopInput, Unanswered> {
    request.validate()?;
    Ok(LoopInput {
        sides: Sides {
            g_h: function("/g_h", &request.g_h)?,
            s_h: function("/s_h", &request.s_h)?,
            g_t: function("/g_t", &request.g_t)?,
            s_t: function("/s_t", &request.s_t)?,
            c_h1: function("/c_h1", &request.c_h1)?,
            position_ratio: request.position_ratio,
            force_ratio: request.force_ratio,
        },
        t_h: polynomial("/t_h", &request.t_h)?,
        clay_damping_n_s_per_m: request.clay_damping_n_s_per_m,
        clay_stiffness_n_per_m: request.clay_stiffness_n_per_m,
        omegas_rad_s: request.omegas_rad_s.clone(),
    })
}

/// A rational function, or which part of it is none.
pub(super) fn function(
    pointer: &str,
    raw: &TransferFunction,
) -> Result<RationalFunction, Unanswered> {
    RationalFunction::new(&raw.numerator, &raw.denominator).map_err(|error| {
        let part = match error {
            RationalError::Numerator(_) => "/numerator",
            RationalError::Denominator(_) | RationalError::ZeroDenominator => "/denominator",
            RationalError::OrderTooHigh { .. } => "",
        };
        FieldError::new(format!("{pointer}{part}"), error.to_string()).into()
    })
}

pub(super) fn polynomial(pointer: &str, raw: &[f64]) -> Result<Polynomial, Unanswered> {
    Polynomial::new(raw).map_err(|error| FieldError::new(pointer, error.to_string()).into())
}

/// What a margin is, for programs.
pub(super) fn verdict(margin: DelayMargin) -> DelayVerdict {
    match margin {
        DelayMargin::Unbounded => DelayVerdict::Unbounded,
        DelayMargin::Finite { .. } => DelayVerdict::Finite,
        DelayMargin::None(NoMargin::UnstableWithoutDelay) => DelayVerdict::UnstableWithoutDelay,
        DelayMargin::None(NoMargin::UnstableAdmittance) => DelayVerdict::UnstableAdmittance,
    }
}

/// A compensator's error, with the field that it comes from where there is one.
pub(super) fn compensator_error(error: CompensatorError) -> Unanswered {
    let detail = error.to_string();
    match error {
        CompensatorError::PositionRatio { .. } => FieldError::new("/position_ratio", detail).into(),
        CompensatorError::ForceRatio { .. } => FieldError::new("/force_ratio", detail).into(),
        CompensatorError::Improper { .. } | CompensatorError::Algebra { .. } => {
            Unanswered::NoLoop(detail)
        }
    }
}

fn unanswered(error: AnalysisError) -> Unanswered {
    let detail = error.to_string();
    match error {
        AnalysisError::Compensator(error) | AnalysisError::Loop(LoopError::Compensator(error)) => {
            compensator_error(error)
        }
        AnalysisError::Loop(_) => Unanswered::NoLoop(detail),
        AnalysisError::Clay { quantity, .. } => {
            FieldError::new(format!("/{quantity}"), detail).into()
        }
        AnalysisError::Omega { index, .. } => {
            FieldError::new(format!("/omegas_rad_s/{index}"), detail).into()
        }
        AnalysisError::TooManyOmegas { .. } => FieldError::new("/omegas_rad_s", detail).into(),
    }
}

fn point(response: &CompensatorResponse) -> CompensatorPoint {
    CompensatorPoint {
        omega_rad_s: response.omega_rad_s,
        c_h1: response.c_h1.map(pair),
        c_t1: response.c_t1.map(pair),
        c_h2: response.c_h2.map(pair),
        c_t2: response.c_t2.map(pair),
    }
}

fn name(compensator: &Compensator) -> CompensatorName {
    match compensator {
        Compensator::CH1 => CompensatorName::CH1,
        Compensator::CT1 => CompensatorName::CT1,
        Compensator::CH2 => CompensatorName::CH2,
        Compensator::CT2 => CompensatorName::CT2,
    }
}

fn gain_margin(margin: GainMargin) -> theory::GainMargin {
    theory::GainMargin {
        factor: margin.factor,
        omega_rad_s: finite(margin.omega_rad_s),
    }
}

fn pair(value: Complex<f64>) -> ComplexPair {
    [value.re, value.im]
}

/// JSON has no infinity.
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
