//! The tuning helper: requests to `teleclay_control::tuning` and back.

use std::ops::ControlFlow;

use teleclay_control::compensators::CompensatorError;
use teleclay_control::tuning::{TuningError, TuningTarget, propose_while};
use teleclay_control::{DelayedScheme, LoopError};
use teleclay_proto::http::theory::{TransferFunction, TunedScheme, TuningAnswer, TuningRequest};
use teleclay_proto::http::{FieldError, Validate};

use super::Unanswered;
use super::stability::{compensator_error, function, polynomial, verdict};

/// The lightest handle that meets a target. `go_on` is asked now and then, and may call the search off.
///
/// # Errors
/// A field out of range, a target that cannot be met, with what stands against it, or a search that was called off.
pub fn tune(
    request: &TuningRequest,
    go_on: impl FnMut() -> ControlFlow<()>,
) -> Result<TuningAnswer, Unanswered> {
    request.validate()?;
    let target = TuningTarget {
        g_h: function("/g_h", &request.g_h)?,
        s_h: function("/s_h", &request.s_h)?,
        g_t: function("/g_t", &request.g_t)?,
        s_t: function("/s_t", &request.s_t)?,
        position_ratio: request.position_ratio,
        force_ratio: request.force_ratio,
        t_h: polynomial("/t_h", &request.t_h)?,
        clay_damping_n_s_per_m: request.clay_damping_n_s_per_m,
        clay_stiffness_n_per_m: request.clay_stiffness_n_per_m,
        scheme: match request.scheme {
            TunedScheme::ForceExchange => DelayedScheme::ForceExchange,
            TunedScheme::PositionForce => DelayedScheme::PositionForce,
        },
        round_trip_s: request.round_trip_s,
        distance: request.distance,
        heaviest_n_s_per_m: request.heaviest_n_s_per_m,
    };
    let proposal = propose_while(&target, go_on).map_err(unanswered)?;
    Ok(TuningAnswer {
        mass_kg: proposal.mass_kg,
        damping_n_s_per_m: proposal.damping_n_s_per_m,
        c_h1: TransferFunction {
            numerator: proposal.c_h1.numerator().coefficients().to_vec(),
            denominator: proposal.c_h1.denominator().coefficients().to_vec(),
        },
        distance: proposal.distance,
        delay_margin_s: proposal.delay_margin.seconds(),
        delay_verdict: verdict(proposal.delay_margin),
        impedance_n_s_per_m: proposal.impedance_n_s_per_m,
    })
}

fn unanswered(error: TuningError) -> Unanswered {
    let detail = error.to_string();
    match error {
        TuningError::OutOfRange { quantity, .. } => {
            FieldError::new(format!("/{quantity}"), detail).into()
        }
        TuningError::DistanceBeyondReach { .. } => FieldError::new("/distance", detail).into(),
        TuningError::Loop(LoopError::Compensator(
            error @ (CompensatorError::PositionRatio { .. } | CompensatorError::ForceRatio { .. }),
        )) => compensator_error(error),
        TuningError::Loop(_) => Unanswered::NoLoop(detail),
        TuningError::CalledOff => Unanswered::CalledOff(detail),
        TuningError::Compensator(_) | TuningError::NotWithin { .. } => {
            Unanswered::Untunable(detail)
        }
    }
}
