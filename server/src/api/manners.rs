//! Manners among operators, and the stop.

use std::time::Duration;

use axum::body::{Body, to_bytes};
use axum::{Extension, Json};
use teleclay_proto::SessionId;
use teleclay_proto::http::{ControlRequest, Denial, NO_REASON, Session, StopClearing, StopRequest};
use teleclay_proto::invite::Role;
use tokio::time::timeout;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body::{Checked, Found, MAX_BODY, Optional, Tool};
use super::guard::check_role;
use super::openapi::refusals;
use super::problem::{
    CONTROL, FIELD, Failure, MEDIA_TYPE, NO_ANSWER, NO_SUCH_SESSION, NO_SUCH_TOOL, NOT_ALLOWED,
    NOT_STOPPED, PATH, SESSION_DAMAGED, SLOW_BODY, SYNTAX, TOO_LARGE,
};
use super::sessions::change_failure;
use super::{Api, see_through};
use crate::directory::{Control, Live};
use crate::doors::{Pass, Who};

/// The calls of this module, under `/api/v1`.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new()
        .routes(routes!(stop))
        .routes(routes!(clear_stop))
        .routes(routes!(request))
        .routes(routes!(withdraw))
        .routes(routes!(grant))
        .routes(routes!(deny))
        .routes(routes!(release))
}

refusals!(StopRefusals: PATH, NO_SUCH_SESSION, SESSION_DAMAGED, NO_ANSWER);
refusals!(ClearRefusals: SYNTAX, PATH, NO_SUCH_SESSION, SLOW_BODY, SESSION_DAMAGED, NOT_STOPPED, TOO_LARGE, MEDIA_TYPE, FIELD, NO_ANSWER);
refusals!(ControlRefusals: SYNTAX, PATH, NO_SUCH_SESSION, NO_SUCH_TOOL, SLOW_BODY, SESSION_DAMAGED, CONTROL, TOO_LARGE, MEDIA_TYPE, FIELD, NO_ANSWER);
refusals!(ReleaseRefusals: PATH, NO_SUCH_SESSION, NO_SUCH_TOOL, SESSION_DAMAGED, CONTROL, NO_ANSWER);

/// A stop waits no longer for its own words.
const WORDS_WITHIN: Duration = Duration::from_millis(200);

/// Who does something, for people: the name that was given, or what the door knows.
pub(super) fn name_of(given: Option<String>, pass: &Pass) -> String {
    given.unwrap_or_else(|| match pass.who {
        Who::Anybody => "somebody".to_owned(),
        Who::Token => "an admin".to_owned(),
        Who::Guest(id) => format!("invite {id}"),
    })
}

/// Whether somebody may decide who holds a tool: an admin, or whoever came in by the door of its holder. Gives the
/// lease of the holder who decides, so that nobody decides about another's.
///
/// # Errors
/// They may not.
pub(super) fn check_decides(pass: &Pass, live: &Live, tool: u32) -> Result<Option<u32>, Failure> {
    check_role(pass, Role::Operator)?;
    if pass.role == Role::Admin {
        return Ok(None);
    }
    let slot = (tool as usize).checked_sub(1);
    let holder = slot.and_then(|slot| live.channels().at(slot));
    if let Some(holder) = holder.filter(|holder| holder.pass.who == pass.who) {
        return Ok(Some(holder.lease));
    }
    Err(NOT_ALLOWED.because(format!(
        "tool {tool} is held by somebody else, who decides about it, or an admin does"
    )))
}

/// Stop a session
///
/// Every tool is taken away and every force goes, and nobody gets a tool until the stop is cleared and they take hold
/// anew. A stop is never refused for its body: one that cannot be read, or does not come at once, stops likewise, and
/// words that are too long are cut off. A second stop changes nothing of the first. It is no emergency stop in the
/// sense of a standard.
#[utoipa::path(
    post, path = "/sessions/{id}/stop", tag = "operators",
    params(("id" = String, Path, description = "The session's name")),
    request_body(content = Option<StopRequest>, content_type = "application/json"),
    responses((status = 200, description = "The session, stopped", body = Session), StopRefusals),
)]
async fn stop(
    Found { id, live }: Found,
    Extension(pass): Extension<Pass>,
    body: Body,
) -> Result<Json<Session>, Failure> {
    let body = timeout(WORDS_WITHIN, to_bytes(body, MAX_BODY)).await;
    let body = body.ok().and_then(Result::ok).unwrap_or_default();
    let (operator, reason) = serde_json::from_slice::<StopRequest>(&body)
        .map_or((None, NO_REASON.to_owned()), |said| {
            (said.operator, said.reason)
        });
    let by = name_of(operator, &pass);
    see_through(async move { live.stop(&by, &reason).await })
        .await?
        .map(Json)
        .map_err(|error| change_failure(error, &id))
}

/// Clear a stop
///
/// Tools can be taken again. Nobody gets one back by it: each operator takes hold anew.
#[utoipa::path(
    post, path = "/sessions/{id}/stop/clear", tag = "operators",
    params(("id" = String, Path, description = "The session's name")),
    request_body = StopClearing,
    responses((status = 200, description = "The session, stopped no longer", body = Session), ClearRefusals),
)]
async fn clear_stop(
    Found { id, live }: Found,
    Extension(pass): Extension<Pass>,
    Optional(clearing): Optional<StopClearing>,
) -> Result<Json<Session>, Failure> {
    let by = name_of(clearing.and_then(|clearing| clearing.operator), &pass);
    see_through(async move { live.clear_stop(by).await })
        .await?
        .map(Json)
        .map_err(|error| change_failure(error, &id))
}

/// Ask the holder of a tool for it
///
/// The request is in the session's state until it is granted, denied, withdrawn or thirty seconds old.
#[utoipa::path(
    post, path = "/sessions/{id}/tools/{tool}/request", tag = "operators",
    params(("id" = String, Path, description = "The session's name"), ("tool" = u32, Path, description = "The tool's number, from 1")),
    request_body = ControlRequest,
    responses((status = 200, description = "The session with the request", body = Session), ControlRefusals),
)]
async fn request(
    Found { id, live }: Found,
    Tool(tool): Tool,
    Checked(ControlRequest { operator }): Checked<ControlRequest>,
) -> Result<Json<Session>, Failure> {
    control(id, live, tool, Control::Request { operator }, None).await
}

/// Want a tool no longer
#[utoipa::path(
    post, path = "/sessions/{id}/tools/{tool}/withdraw", tag = "operators",
    params(("id" = String, Path, description = "The session's name"), ("tool" = u32, Path, description = "The tool's number, from 1")),
    request_body = ControlRequest,
    responses((status = 200, description = "The session without the request", body = Session), ControlRefusals),
)]
async fn withdraw(
    Found { id, live }: Found,
    Tool(tool): Tool,
    Checked(ControlRequest { operator }): Checked<ControlRequest>,
) -> Result<Json<Session>, Failure> {
    control(id, live, tool, Control::Withdraw { operator }, None).await
}

/// Hand a tool over to whoever has asked for it
///
/// Without a body, to the one who has asked first. Its holder lets go, and for ten seconds nobody else gets it. It
/// takes an admin, or the token or invite by which the holder came in.
#[utoipa::path(
    post, path = "/sessions/{id}/tools/{tool}/grant", tag = "operators",
    params(("id" = String, Path, description = "The session's name"), ("tool" = u32, Path, description = "The tool's number, from 1")),
    request_body = ControlRequest,
    responses((status = 200, description = "The session with the tool kept for that operator", body = Session), ControlRefusals),
)]
async fn grant(
    Found { id, live }: Found,
    Extension(pass): Extension<Pass>,
    Tool(tool): Tool,
    Optional(asked): Optional<ControlRequest>,
) -> Result<Json<Session>, Failure> {
    let lease = check_decides(&pass, &live, tool)?;
    let operator = match asked {
        Some(ControlRequest { operator }) => operator,
        None => first_asker(&live, tool)?,
    };
    control(id, live, tool, Control::Grant { operator }, lease).await
}

/// Keep a tool from whoever has asked for it
///
/// Without a body, from the one who has asked first. It takes an admin, or the token or invite by which the holder came
/// in.
#[utoipa::path(
    post, path = "/sessions/{id}/tools/{tool}/deny", tag = "operators",
    params(("id" = String, Path, description = "The session's name"), ("tool" = u32, Path, description = "The tool's number, from 1")),
    request_body = Denial,
    responses((status = 200, description = "The session without the request", body = Session), ControlRefusals),
)]
async fn deny(
    Found { id, live }: Found,
    Extension(pass): Extension<Pass>,
    Tool(tool): Tool,
    Optional(denial): Optional<Denial>,
) -> Result<Json<Session>, Failure> {
    let lease = check_decides(&pass, &live, tool)?;
    let (operator, reason) = match denial {
        Some(Denial { operator, reason }) => (operator, reason),
        None => (first_asker(&live, tool)?, NO_REASON.to_owned()),
    };
    control(id, live, tool, Control::Deny { operator, reason }, lease).await
}

/// Take a tool away from its holder
///
/// It takes an admin, or the token or invite by which the holder came in.
#[utoipa::path(
    post, path = "/sessions/{id}/tools/{tool}/release", tag = "operators",
    params(("id" = String, Path, description = "The session's name"), ("tool" = u32, Path, description = "The tool's number, from 1")),
    responses((status = 200, description = "The session with the tool free", body = Session), ReleaseRefusals),
)]
async fn release(
    Found { id, live }: Found,
    Extension(pass): Extension<Pass>,
    Tool(tool): Tool,
) -> Result<Json<Session>, Failure> {
    let lease = check_decides(&pass, &live, tool)?;
    control(id, live, tool, Control::Release, lease).await
}

/// Who has asked for a tool first.
fn first_asker(live: &Live, tool: u32) -> Result<String, Failure> {
    let tools = live.state().tools;
    let Some(asked) = tools.iter().find(|state| state.id == tool) else {
        return Err(NO_SUCH_TOOL.because(format!(
            "there is no tool {tool}, only 1 to {}",
            tools.len()
        )));
    };
    asked
        .requests
        .first()
        .cloned()
        .ok_or_else(|| CONTROL.because(format!("nobody has asked for tool {tool}")))
}

async fn control(
    id: SessionId,
    live: Live,
    tool: u32,
    control: Control,
    lease: Option<u32>,
) -> Result<Json<Session>, Failure> {
    see_through(async move { live.control(tool, control, lease).await })
        .await?
        .map(Json)
        .map_err(|error| change_failure(error, &id))
}
