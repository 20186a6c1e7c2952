//! Materials by name.

use axum::Json;
use teleclay_proto::http::Materials;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::Api;
use super::openapi::refusals;

/// The call of this module, under `/api/v1`.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new().routes(routes!(materials))
}

refusals!(MaterialsRefusals:);

/// Materials by name
///
/// What a request may name as `{"preset": ...}` wherever it names a material, with numbers and sources.
#[utoipa::path(
    get, path = "/materials", tag = "clay",
    responses((status = 200, description = "All of them", body = Materials), MaterialsRefusals),
)]
async fn materials() -> Json<Materials> {
    Json(Materials::all())
}
