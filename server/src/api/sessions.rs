//! Sessions: listed, made, looked at, changed, ended.

use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use axum::{Extension, Json};
use teleclay_proto::SessionId;
use teleclay_proto::http::{
    ClayReset, Duplicate, ListedSession, NewSession, Session, SessionPatch,
};
use teleclay_session::Refusal;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body::{Checked, Found, Named, no_such_session};
use super::openapi::refusals;
use super::problem::{
    CLAY_MEMORY, CONTROL, FIELD, Failure, MEDIA_TYPE, NO_ANSWER, NO_SUCH_SESSION, NO_SUCH_TOOL,
    NO_TICK_TIME, NOT_STOPPED, PATH, SESSION_DAMAGED, SESSION_EXISTS, SLOW_BODY, SYNTAX, TOO_LARGE,
    TOO_MANY_SESSIONS, UNAVAILABLE,
};
use super::{Api, see_through};
use crate::directory::{ChangeError, CreateError, NoSuchSession};
use crate::doors::Pass;

/// The calls of this module, under `/api/v1`.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new()
        .routes(routes!(list, create))
        .routes(routes!(show, change, delete))
        .routes(routes!(reset))
        .routes(routes!(duplicate))
}

/// What went wrong with a change of the session `id`.
pub(crate) fn change_failure(error: ChangeError, id: &SessionId) -> Failure {
    match error {
        ChangeError::Field(error) => error.into(),
        ChangeError::NoMemory(error) => CLAY_MEMORY.because(error.to_string()),
        ChangeError::Gone => no_such_session(id),
        ChangeError::Refused(refusal) => {
            let kind = match refusal {
                Refusal::NotStopped => NOT_STOPPED,
                Refusal::NoSuchTool { .. } => NO_SUCH_TOOL,
                Refusal::NotHeld { .. }
                | Refusal::HeldByAsker { .. }
                | Refusal::AskedAlready { .. }
                | Refusal::TooManyRequests { .. }
                | Refusal::NoSuchRequest { .. }
                | Refusal::NoSuchLease { .. } => CONTROL,
                _ => NO_ANSWER,
            };
            kind.because(format!("session {id}: {refusal}"))
        }
        ChangeError::Timeout => {
            NO_ANSWER.because(format!("session {id} did not take the change up"))
        }
    }
}

refusals!(ListRefusals:);
refusals!(CreateRefusals: SYNTAX, SLOW_BODY, SESSION_EXISTS, TOO_MANY_SESSIONS, CLAY_MEMORY, TOO_LARGE, MEDIA_TYPE, FIELD, UNAVAILABLE, NO_TICK_TIME);
refusals!(DuplicateRefusals: SYNTAX, PATH, NO_SUCH_SESSION, SLOW_BODY, SESSION_DAMAGED, SESSION_EXISTS, TOO_MANY_SESSIONS, CLAY_MEMORY, TOO_LARGE, MEDIA_TYPE, FIELD, UNAVAILABLE, NO_TICK_TIME);
refusals!(FindRefusals: PATH, NO_SUCH_SESSION, SESSION_DAMAGED);
refusals!(DeleteRefusals: PATH, NO_SUCH_SESSION);
refusals!(ChangeRefusals: SYNTAX, PATH, NO_SUCH_SESSION, SLOW_BODY, SESSION_DAMAGED, CLAY_MEMORY, TOO_LARGE, MEDIA_TYPE, FIELD, NO_ANSWER);

/// All sessions; to a guest, the one that they were invited to
///
/// A session whose files are damaged is there with its name and what is wrong, and can only be deleted.
#[utoipa::path(
    get, path = "/sessions", tag = "sessions",
    responses((status = 200, description = "The sessions, by name", body = [ListedSession]), ListRefusals),
)]
async fn list(
    State(api): State<Api>,
    Extension(pass): Extension<Pass>,
) -> Json<Vec<ListedSession>> {
    let mut sessions = api.directory().listed();
    sessions.retain(|session| pass.covers(session.id()));
    Json(sessions)
}

/// A new session
///
/// Only `id` must be there. The session runs at once and waits for an operator to join.
#[utoipa::path(
    post, path = "/sessions", tag = "sessions",
    request_body = NewSession,
    responses(
        (status = 201, description = "The session", body = Session, headers(("Location" = String, description = "Its path"))),
        CreateRefusals,
    ),
)]
async fn create(
    State(api): State<Api>,
    Checked(new): Checked<NewSession>,
) -> Result<impl IntoResponse, Failure> {
    let directory = api.directory().clone();
    let session = see_through(async move { directory.create(new).await })
        .await?
        .map_err(create_failure)?;
    Ok(created(session))
}

fn created(session: Session) -> impl IntoResponse {
    let location = format!("/api/v1/sessions/{}", session.id);
    (
        StatusCode::CREATED,
        [(header::LOCATION, location)],
        Json(session),
    )
}

fn create_failure(error: CreateError) -> Failure {
    match error {
        CreateError::Exists { id } => {
            SESSION_EXISTS.because(format!("a session is named {id} already"))
        }
        CreateError::TooMany { most } => {
            TOO_MANY_SESSIONS.because(format!("at most {most} run at once"))
        }
        CreateError::Field(error) => error.into(),
        CreateError::NoMemory(error) => CLAY_MEMORY.because(error.to_string()),
        CreateError::NoTickTime(error) => NO_TICK_TIME.because(error.to_string()),
        CreateError::Unavailable { reason } => UNAVAILABLE.because(reason),
    }
}

/// Another session with the same clay and settings
///
/// Its history is its own and begins with the clay as it is; nobody holds its tools.
#[utoipa::path(
    post, path = "/sessions/{id}/duplicate", tag = "sessions",
    params(("id" = String, Path, description = "The session's name")),
    request_body = Duplicate,
    responses(
        (status = 201, description = "The new session", body = Session, headers(("Location" = String, description = "Its path"))),
        DuplicateRefusals,
    ),
)]
async fn duplicate(
    State(api): State<Api>,
    Found { live, .. }: Found,
    Checked(Duplicate { id }): Checked<Duplicate>,
) -> Result<impl IntoResponse, Failure> {
    let directory = api.directory().clone();
    let session = see_through(async move { directory.duplicate(&live, id).await })
        .await?
        .map_err(create_failure)?;
    Ok(created(session))
}

/// One session
#[utoipa::path(
    get, path = "/sessions/{id}", tag = "sessions",
    params(("id" = String, Path, description = "The session's name")),
    responses((status = 200, description = "The session as it is", body = Session), FindRefusals),
)]
async fn show(found: Found) -> Json<Session> {
    Json(found.live.state())
}

/// Change a session
///
/// Whatever is left out keeps its value. A scheme changes on the running loop without a step of force.
#[utoipa::path(
    patch, path = "/sessions/{id}", tag = "sessions",
    params(("id" = String, Path, description = "The session's name")),
    request_body = SessionPatch,
    responses((status = 200, description = "The session after the change", body = Session), ChangeRefusals),
)]
async fn change(
    Found { id, live }: Found,
    Checked(patch): Checked<SessionPatch>,
) -> Result<Json<Session>, Failure> {
    patch.fits(live.state().network)?;
    see_through(async move { live.patch(patch).await })
        .await?
        .map(Json)
        .map_err(|error| change_failure(error, &id))
}

/// End a session
///
/// Its operators and watchers are told; its clay is gone, and everything that was kept of it. One whose files are
/// damaged is removed likewise.
#[utoipa::path(
    delete, path = "/sessions/{id}", tag = "sessions",
    params(("id" = String, Path, description = "The session's name")),
    responses((status = 204, description = "It has ended"), DeleteRefusals),
)]
async fn delete(State(api): State<Api>, Named(id): Named) -> Result<StatusCode, Failure> {
    let (directory, name) = (api.directory().clone(), id.clone());
    see_through(async move { directory.delete(&name).await })
        .await?
        .map(|()| StatusCode::NO_CONTENT)
        .map_err(|NoSuchSession { .. }| no_such_session(&id))
}

/// A fresh block of clay
///
/// Shape and material stay what they were where they are left out.
#[utoipa::path(
    post, path = "/sessions/{id}/clay/reset", tag = "clay",
    params(("id" = String, Path, description = "The session's name")),
    request_body = ClayReset,
    responses((status = 200, description = "The session with its fresh block", body = Session), ChangeRefusals),
)]
async fn reset(
    Found { id, live }: Found,
    Checked(reset): Checked<ClayReset>,
) -> Result<Json<Session>, Failure> {
    see_through(async move { live.reset(reset, None).await })
        .await?
        .map(Json)
        .map_err(|error| change_failure(error, &id))
}
