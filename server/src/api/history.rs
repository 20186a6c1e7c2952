//! What was done to a session's clay: listed, undone, redone.

use axum::Json;
use teleclay_keeping::{RewriteError, Wanted};
use teleclay_proto::SessionId;
use teleclay_proto::http::{History, Redo, Session, Undo};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body::{Checked, Found};
use super::openapi::refusals;
use super::problem::{
    FIELD, Failure, MEDIA_TYPE, NO_ANSWER, NO_SUCH_SESSION, NOT_KEPT, NOTHING_THERE, PATH,
    SESSION_DAMAGED, SLOW_BODY, SYNTAX, TOO_LARGE, UNAVAILABLE,
};
use super::sessions::change_failure;
use super::{Api, see_through};
use crate::directory::PastFailure;
use crate::session::slot_of;

/// The calls of this module, under `/api/v1`.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new()
        .routes(routes!(history))
        .routes(routes!(undo))
        .routes(routes!(redo))
}

/// Why the past of session `id` cannot be had.
pub(crate) fn past_failure(error: PastFailure, id: &SessionId) -> Failure {
    match error {
        PastFailure::Change(error) => change_failure(error, id),
        PastFailure::Rewrite(error @ RewriteError::Nothing { .. }) => {
            NOTHING_THERE.because(format!("session {id}: {error}"))
        }
        error @ (PastFailure::Ephemeral
        | PastFailure::NotKept { .. }
        | PastFailure::Rewrite(RewriteError::NotKept { .. })) => {
            NOT_KEPT.because(format!("session {id}: {error}"))
        }
        PastFailure::Rewrite(error @ (RewriteError::Overtaken | RewriteError::Home(_))) => {
            UNAVAILABLE.because(format!("session {id}: {error}"))
        }
    }
}

refusals!(HistoryRefusals: PATH, NO_SUCH_SESSION, SESSION_DAMAGED, NOT_KEPT, UNAVAILABLE);
refusals!(RewriteRefusals: SYNTAX, PATH, NO_SUCH_SESSION, SLOW_BODY, SESSION_DAMAGED, NOTHING_THERE, NOT_KEPT, TOO_LARGE, MEDIA_TYPE, FIELD, UNAVAILABLE, NO_ANSWER);

/// The strokes of a session
///
/// Those of the present block: a fresh block begins a list of its own. A stroke is a span of contact of one tool.
#[utoipa::path(
    get, path = "/sessions/{id}/history", tag = "clay",
    params(("id" = String, Path, description = "The session's name")),
    responses((status = 200, description = "The strokes", body = History), HistoryRefusals),
)]
async fn history(Found { id, live }: Found) -> Result<Json<History>, Failure> {
    live.history()
        .await
        .map(Json)
        .map_err(|error| past_failure(error, &id))
}

/// Undo a stroke
///
/// The clay becomes what it would be had the stroke never been made; cuts that others made later stay, also where they
/// went through the same place. The block gets a new epoch. Clay that comes back under a tool is felt only as fast as
/// the limit on corrections allows.
#[utoipa::path(
    post, path = "/sessions/{id}/undo", tag = "clay",
    params(("id" = String, Path, description = "The session's name")),
    request_body = Undo,
    responses((status = 200, description = "The session after it", body = Session), RewriteRefusals),
)]
async fn undo(
    Found { id, live }: Found,
    Checked(undo): Checked<Undo>,
) -> Result<Json<Session>, Failure> {
    let wanted = match undo.since {
        Some(stroke) => Wanted::UndoSince(stroke),
        None => Wanted::Undo(undo.tool.map(slot_of)),
    };
    see_through(async move { live.rewrite(wanted).await })
        .await?
        .map(Json)
        .map_err(|error| past_failure(error, &id))
}

/// Redo the stroke that was undone last
#[utoipa::path(
    post, path = "/sessions/{id}/redo", tag = "clay",
    params(("id" = String, Path, description = "The session's name")),
    request_body = Redo,
    responses((status = 200, description = "The session after it", body = Session), RewriteRefusals),
)]
async fn redo(
    Found { id, live }: Found,
    Checked(redo): Checked<Redo>,
) -> Result<Json<Session>, Failure> {
    let wanted = Wanted::Redo(redo.tool.map(slot_of));
    see_through(async move { live.rewrite(wanted).await })
        .await?
        .map(Json)
        .map_err(|error| past_failure(error, &id))
}
