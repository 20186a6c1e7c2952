//! The cutting experiment: requests to `teleclay_sim::experiment` and back.

use std::ops::ControlFlow;

use teleclay_proto::http::theory::{
    CuttingAnswer, CuttingRequest, CuttingSpecimen, CuttingTrace, HandForceAt,
};
use teleclay_proto::http::{FieldError, Validate};
use teleclay_sim::experiment::{
    CuttingExperiment, CuttingInputs, Outcome, Plateau, Progress, Push, Refusal, RunError, Specimen,
};

use super::Unanswered;

/// Runs the experiment through the clay. `progress` is told now and then how far it has come, and may call it off.
///
/// # Errors
/// A field out of range, an experiment that cannot come to its end, or one that was called off.
pub fn cutting(
    request: &CuttingRequest,
    progress: impl FnMut(Progress) -> ControlFlow<()>,
) -> Result<CuttingAnswer, Unanswered> {
    request.validate()?;
    let experiment = CuttingExperiment::new(inputs(request)).map_err(refused)?;
    let outcome = experiment.run(progress).map_err(broken_off)?;
    Ok(answer(experiment.specimen(), outcome))
}

fn inputs(request: &CuttingRequest) -> CuttingInputs {
    CuttingInputs {
        virtual_mass_kg: request.virtual_mass_kg,
        virtual_damping_n_s_per_m: request.virtual_damping_n_s_per_m,
        position_ratio: request.position_ratio,
        force_ratio: request.force_ratio,
        hand_force_n: request.hand_force_n,
        edges_m: request.edges_m.clone(),
        clay_damping_n_s_per_m: request.clay_damping_n_s_per_m.clone(),
        push: match request.hand_force_at {
            HandForceAt::Sensor => Push::AtSensor,
            HandForceAt::Muscles => Push::ThroughArm,
        },
        voxel_size_m: request.voxel_size_m,
        most_trace_samples: request.trace_samples as usize,
    }
}

fn answer(specimen: &Specimen, outcome: Outcome) -> CuttingAnswer {
    let each = |value: fn(&Plateau) -> f64| outcome.plateaus.iter().map(value).collect();
    CuttingAnswer {
        plateau_velocity_m_s: each(|plateau| plateau.theory_m_s),
        simulated_velocity_m_s: each(|plateau| plateau.measured_m_s),
        ripple: each(|plateau| plateau.ripple),
        window_m: outcome
            .plateaus
            .iter()
            .map(|plateau| plateau.window_m)
            .collect(),
        engaged_area_m2: each(|plateau| plateau.engaged_area_m2),
        duration_s: outcome.duration_s,
        removed_volume_m3: outcome.removed_volume_m3,
        specimen: CuttingSpecimen {
            voxel_size_m: specimen.voxel_size_m,
            viscosity_pa_s_per_m: specimen.viscosity_pa_s_per_m,
            blade_width_m: specimen.blade.width_m,
            depth_of_cut_m: specimen.depths_of_cut_m.clone(),
        },
        trace: CuttingTrace {
            t_s: outcome.trace.t_s,
            position_m: outcome.trace.position_m,
            velocity_m_s: outcome.trace.velocity_m_s,
            hand_force_n: outcome.trace.hand_force_n,
            tool_force_n: outcome.trace.tool_force_n,
        },
    }
}

fn refused(refusal: Refusal) -> Unanswered {
    let detail = refusal.to_string();
    match refusal {
        Refusal::Input { field, index, .. } => {
            let place = index.map_or_else(String::new, |index| format!("/{index}"));
            FieldError::new(format!("/{field}{place}"), detail).into()
        }
        Refusal::Counts { .. } => FieldError::new("/clay_damping_n_s_per_m", detail).into(),
        _ => Unanswered::Infeasible(detail),
    }
}

fn broken_off(error: RunError) -> Unanswered {
    let detail = error.to_string();
    match error {
        RunError::Refusal(refusal) => refused(refusal),
        RunError::Cancelled { .. } => Unanswered::CalledOff(detail),
        _ => Unanswered::Infeasible(detail),
    }
}
