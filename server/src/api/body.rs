//! What comes in: bodies and the session's name in the path.

use std::time::Duration;

use axum::extract::rejection::{BytesRejection, FailedToBufferBody};
use axum::extract::{FromRequest, FromRequestParts, OriginalUri, Path, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use teleclay_proto::SessionId;
use teleclay_proto::http::{Validate, parse};
use tokio::time::timeout;

use super::Api;
use super::problem::{
    Failure, MEDIA_TYPE, NO_SUCH_SESSION, NO_SUCH_TOOL, PATH, SESSION_DAMAGED, SLOW_BODY, SYNTAX,
    TOO_LARGE, path_of,
};
use crate::directory::Live;

/// Longest body, bytes. The largest that means something, a stepped block of 64 steps, has about four thousand.
pub(crate) const MAX_BODY: usize = 64 * 1024;

/// A JSON body whose every field is in its range, or no body at all.
pub(crate) struct Optional<T>(pub(crate) Option<T>);

impl<S, T> FromRequest<S> for Optional<T>
where
    S: Send + Sync,
    T: DeserializeOwned + Serialize + Validate,
{
    type Rejection = Failure;

    async fn from_request(request: Request, state: &S) -> Result<Self, Failure> {
        let headers = request.headers();
        let has_length = headers
            .get(header::CONTENT_LENGTH)
            .is_some_and(|length| length.as_bytes() != b"0");
        let has_body = has_length
            || headers.contains_key(header::TRANSFER_ENCODING)
            || headers.contains_key(header::CONTENT_TYPE);
        if !has_body {
            return Ok(Self(None));
        }
        let Checked(body) = Checked::from_request(request, state).await?;
        Ok(Self(Some(body)))
    }
}

/// A body of that length takes a twentieth of this on the slowest link that could carry the loop.
const BODY_TIMEOUT: Duration = Duration::from_secs(5);

/// A JSON body whose every field is in its range.
pub(crate) struct Checked<T>(pub(crate) T);

impl<S, T> FromRequest<S> for Checked<T>
where
    S: Send + Sync,
    T: DeserializeOwned + Serialize + Validate,
{
    type Rejection = Failure;

    async fn from_request(request: Request, state: &S) -> Result<Self, Failure> {
        check_media_type(request.headers())?;
        check_announced_length(request.headers())?;
        let body = timeout(
            BODY_TIMEOUT,
            axum::body::Bytes::from_request(request, state),
        )
        .await
        .map_err(|_| SLOW_BODY.because(format!("waited {} s for it", BODY_TIMEOUT.as_secs())))?
        .map_err(|rejection| incomplete(&rejection))?;
        Ok(Self(parse(&body)?))
    }
}

/// A body that says it is too large need not be waited for.
fn check_announced_length(headers: &HeaderMap) -> Result<(), Failure> {
    let announced = headers
        .get(header::CONTENT_LENGTH)
        .and_then(|length| length.to_str().ok()?.parse::<u64>().ok());
    if announced.is_some_and(|length| (MAX_BODY as u64) < length) {
        return Err(too_large());
    }
    Ok(())
}

fn too_large() -> Failure {
    TOO_LARGE.because(format!("the body has more than {MAX_BODY} bytes"))
}

fn check_media_type(headers: &HeaderMap) -> Result<(), Failure> {
    if let Some(encoding) = headers.get(header::CONTENT_ENCODING) {
        return Err(
            MEDIA_TYPE.because(format!("the Content-Encoding is {encoding:?}, wanted none"))
        );
    }
    let Some(got) = headers.get(header::CONTENT_TYPE) else {
        return Err(MEDIA_TYPE.because("there is no Content-Type, wanted application/json"));
    };
    let essence = got
        .to_str()
        .unwrap_or_default()
        .split(';')
        .next()
        .unwrap_or_default()
        .trim();
    if essence.eq_ignore_ascii_case("application/json") {
        return Ok(());
    }
    Err(MEDIA_TYPE.because(format!(
        "the Content-Type is {got:?}, wanted application/json"
    )))
}

fn incomplete(rejection: &BytesRejection) -> Failure {
    match rejection {
        BytesRejection::FailedToBufferBody(FailedToBufferBody::LengthLimitError(_)) => too_large(),
        // The connection broke or its framing did; if anybody still listens, this is what they sent.
        other => SYNTAX.because(other.body_text()),
    }
}

#[derive(Deserialize)]
struct InPath {
    id: String,
}

#[derive(Deserialize)]
struct ToolInPath {
    tool: String,
}

/// The number of the tool that the path names. Whether the session has one of that number, the session says.
pub(crate) struct Tool(pub(crate) u32);

impl FromRequestParts<Api> for Tool {
    type Rejection = Failure;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Failure> {
        let Path(ToolInPath { tool }) = Path::<ToolInPath>::from_request_parts(parts, api)
            .await
            .map_err(|rejection| PATH.because(rejection.body_text()))?;
        let number = tool.parse().map_err(|_| {
            NO_SUCH_TOOL.because(format!("{tool:.20} is no number of a tool, from 1"))
        })?;
        Ok(Self(number))
    }
}

/// The session that the path names.
pub(crate) struct Found {
    pub(crate) id: SessionId,
    pub(crate) live: Live,
}

impl FromRequestParts<Api> for Found {
    type Rejection = Failure;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Failure> {
        let Path(InPath { id: name }) = Path::<InPath>::from_request_parts(parts, api)
            .await
            .map_err(|rejection| PATH.because(rejection.body_text()))?;
        // What is no name names no session: there is one way to say so, whatever the reason.
        let OriginalUri(asked) = OriginalUri::from_request_parts(parts, api)
            .await
            .unwrap_or_else(|never| match never {});
        let nothing_at =
            |why: String| NO_SUCH_SESSION.because(format!("{}: {why}", path_of(&asked)));
        let id = SessionId::new(name).map_err(|error| nothing_at(error.to_string()))?;
        if let Some(live) = api.directory().session(&id) {
            return Ok(Self { id, live });
        }
        match api.directory().damaged(&id) {
            Some(damaged) => Err(SESSION_DAMAGED.because(format!(
                "session {id}: {}",
                damaged.storage.reason.unwrap_or_default()
            ))),
            None => Err(nothing_at(format!("no session is named {id}"))),
        }
    }
}

/// The name of a session that is there, or that was set aside.
pub(crate) struct Named(pub(crate) SessionId);

impl FromRequestParts<Api> for Named {
    type Rejection = Failure;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Failure> {
        match Found::from_request_parts(parts, api).await {
            Ok(Found { id, .. }) => Ok(Self(id)),
            Err(failure) if failure.is(SESSION_DAMAGED) => {
                let Path(name) = Path::<SessionId>::from_request_parts(parts, api)
                    .await
                    .map_err(|rejection| PATH.because(rejection.body_text()))?;
                Ok(Self(name))
            }
            Err(failure) => Err(failure),
        }
    }
}

/// There is no session of this name any longer.
pub(crate) fn no_such_session(id: &SessionId) -> Failure {
    NO_SUCH_SESSION.because(format!("no session is named {id}"))
}
