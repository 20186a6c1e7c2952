//! The mathematics of \[KHMH03\] as calls: kinematics, stability, tuning, the cutting experiment.
//!
//! What takes longer than a moment runs on a thread of its own, a few at a time, so that it can hold up neither the
//! interface nor the loop ([`work`]). The calculations themselves are in [`teleclay_theory`].

mod work;

use axum::Json;
use axum::extract::State;
use teleclay_proto::http::theory::{
    CuttingAnswer, CuttingRequest, ForwardAnswer, ForwardRequest, InverseAnswer, InverseRequest,
    JacobianAnswer, JacobianRequest, LoopAnswer, LoopRequest, TuningAnswer, TuningRequest,
    WorkspaceAnswer, WorkspaceRequest,
};
use teleclay_theory::{self as theory, Unanswered};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

pub(crate) use self::work::ComputePool;

use super::Api;
use super::body::Checked;
use super::openapi::refusals;
use super::problem::{
    BUSY, FIELD, Failure, INFEASIBLE, MEDIA_TYPE, NO_ANSWER, NO_ASSEMBLY, NO_LOOP, SINGULAR,
    SLOW_BODY, SYNTAX, TOO_LARGE, UNREACHABLE, UNTUNABLE,
};

/// The calls of this module, under `/api/v1`.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new()
        .routes(routes!(inverse))
        .routes(routes!(forward))
        .routes(routes!(jacobian))
        .routes(routes!(workspace))
        .routes(routes!(analyse))
        .routes(routes!(tune))
        .routes(routes!(cutting))
}

refusals!(InverseRefusals: SYNTAX, SLOW_BODY, TOO_LARGE, MEDIA_TYPE, FIELD, UNREACHABLE, SINGULAR);
refusals!(ForwardRefusals: SYNTAX, SLOW_BODY, TOO_LARGE, MEDIA_TYPE, FIELD, NO_ASSEMBLY, SINGULAR);
refusals!(WorkspaceRefusals: SYNTAX, SLOW_BODY, TOO_LARGE, MEDIA_TYPE, FIELD, BUSY);
refusals!(LoopRefusals: SYNTAX, SLOW_BODY, TOO_LARGE, MEDIA_TYPE, FIELD, NO_LOOP, BUSY);
refusals!(TuningRefusals: SYNTAX, SLOW_BODY, TOO_LARGE, MEDIA_TYPE, FIELD, NO_LOOP, UNTUNABLE, BUSY, NO_ANSWER);
refusals!(CuttingRefusals: SYNTAX, SLOW_BODY, TOO_LARGE, MEDIA_TYPE, FIELD, INFEASIBLE, BUSY, NO_ANSWER);

impl From<Unanswered> for Failure {
    fn from(error: Unanswered) -> Self {
        let kind = match error {
            Unanswered::Field(error) => return error.into(),
            Unanswered::Unreachable(_) => UNREACHABLE,
            Unanswered::NoAssembly(_) => NO_ASSEMBLY,
            Unanswered::Singular(_) => SINGULAR,
            Unanswered::NoLoop(_) => NO_LOOP,
            Unanswered::Untunable(_) => UNTUNABLE,
            Unanswered::Infeasible(_) => INFEASIBLE,
            Unanswered::CalledOff(_) => NO_ANSWER,
        };
        kind.because(error.to_string())
    }
}

/// Joint angles for a position
///
/// All eight solutions of the parallel robot's inverse kinematics.
#[utoipa::path(
    post, path = "/kinematics/inverse", tag = "theory",
    request_body = InverseRequest,
    responses((status = 200, description = "The eight branches", body = InverseAnswer), InverseRefusals),
)]
async fn inverse(
    Checked(request): Checked<InverseRequest>,
) -> Result<Json<InverseAnswer>, Failure> {
    Ok(Json(theory::inverse(&request)?))
}

/// Positions for joint angles
///
/// Both assemblies of the parallel robot, in closed form.
#[utoipa::path(
    post, path = "/kinematics/forward", tag = "theory",
    request_body = ForwardRequest,
    responses((status = 200, description = "Both positions", body = ForwardAnswer), ForwardRefusals),
)]
async fn forward(
    Checked(request): Checked<ForwardRequest>,
) -> Result<Json<ForwardAnswer>, Failure> {
    Ok(Json(theory::forward(&request)?))
}

/// How the robot moves at a position
///
/// The Jacobian of one branch, its condition number, and how far either kind of singularity is.
#[utoipa::path(
    post, path = "/kinematics/jacobian", tag = "theory",
    request_body = JacobianRequest,
    responses((status = 200, description = "The Jacobian and what belongs to it", body = JacobianAnswer), InverseRefusals),
)]
async fn jacobian(
    Checked(request): Checked<JacobianRequest>,
) -> Result<Json<JacobianAnswer>, Failure> {
    Ok(Json(theory::jacobian(&request)?))
}

/// Where the robot reaches
///
/// Dexterity over a box of cells, or over a slice.
#[utoipa::path(
    post, path = "/kinematics/workspace", tag = "theory",
    request_body = WorkspaceRequest,
    responses((status = 200, description = "The map", body = WorkspaceAnswer), WorkspaceRefusals),
)]
async fn workspace(
    State(api): State<Api>,
    Checked(request): Checked<WorkspaceRequest>,
) -> Result<Json<WorkspaceAnswer>, Failure> {
    api.compute()
        .calculate(move |_| theory::workspace(&request))
        .await
        .map(Json)
}

/// Whether a loop is stable, and for how long a delay
///
/// Compensators, poles, margins of every kind, and the curves to draw.
#[utoipa::path(
    post, path = "/analysis/loop", tag = "theory",
    request_body = LoopRequest,
    responses((status = 200, description = "What there is to know about the loop", body = LoopAnswer), LoopRefusals),
)]
async fn analyse(
    State(api): State<Api>,
    Checked(request): Checked<LoopRequest>,
) -> Result<Json<LoopAnswer>, Failure> {
    api.compute()
        .calculate(move |_| theory::analyse(&request))
        .await
        .map(Json)
}

/// The lightest handle that keeps a margin
///
/// Proposes mass and damping of `C_h1`, or says what stands against the target.
#[utoipa::path(
    post, path = "/analysis/tuning", tag = "theory",
    request_body = TuningRequest,
    responses((status = 200, description = "The handle", body = TuningAnswer), TuningRefusals),
)]
async fn tune(
    State(api): State<Api>,
    Checked(request): Checked<TuningRequest>,
) -> Result<Json<TuningAnswer>, Failure> {
    api.compute()
        .calculate(move |deadline| theory::tune(&request, || deadline.check()))
        .await
        .map(Json)
}

/// Run the cutting experiment
///
/// In virtual time, through the real clay: a stepped block, a blade, a steady hand. No device is needed.
#[utoipa::path(
    post, path = "/experiments/cutting", tag = "theory",
    request_body = CuttingRequest,
    responses((status = 200, description = "Plateaus and trace", body = CuttingAnswer), CuttingRefusals),
)]
async fn cutting(
    State(api): State<Api>,
    Checked(request): Checked<CuttingRequest>,
) -> Result<Json<CuttingAnswer>, Failure> {
    api.compute()
        .experiment(move |deadline| theory::cutting(&request, |_| deadline.check()))
        .await
        .map(Json)
}
