//! What supervisors ask: does the process answer, and can it do its work.

use axum::Json;
use axum::extract::State;
use teleclay_proto::http::{Health, HealthStatus, Readiness};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::Api;
use super::openapi::refusals;
use super::problem::{Failure, NOT_READY};

/// The calls of this module.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new()
        .routes(routes!(health))
        .routes(routes!(readiness))
}

refusals!(HealthRefusals in ANYWHERE:);
refusals!(ReadinessRefusals in ANYWHERE: NOT_READY);

/// Does the process answer
#[utoipa::path(
    get, path = "/healthz", tag = "probes",
    responses((status = 200, description = "It does", body = Health), HealthRefusals),
    security(()),
)]
async fn health(State(api): State<Api>) -> Json<Health> {
    Json(Health {
        status: HealthStatus::Ok,
        version: api.config().version.clone(),
        uptime_s: api.config().started.elapsed().as_secs_f64(),
    })
}

/// Can the server do its work
#[utoipa::path(
    get, path = "/readyz", tag = "probes",
    responses((status = 200, description = "The loop runs and Zenoh is up", body = Readiness), ReadinessRefusals),
    security(()),
)]
async fn readiness(State(api): State<Api>) -> Result<Json<Readiness>, Failure> {
    let readiness = api.directory().readiness();
    if readiness.ready {
        return Ok(Json(readiness));
    }
    let parts = [
        (readiness.loop_running, "the loop does not run"),
        (readiness.zenoh_up, "Zenoh is not up"),
    ];
    let missing: Vec<&str> = parts
        .into_iter()
        .filter_map(|(is_there, otherwise)| (!is_there).then_some(otherwise))
        .collect();
    Err(NOT_READY.because(missing.join("; ")))
}
