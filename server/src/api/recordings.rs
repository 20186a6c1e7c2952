//! Recordings of a session.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::pin::Pin;
use std::task::{Context, Poll};

use axum::Json;
use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{FromRequestParts, Path as InPath};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use hyper::body::{Frame, SizeHint};
use serde::Deserialize;
use teleclay_proto::SessionId;
use teleclay_proto::http::{NewRecording, Recording};
use teleclay_recording::ShelfError;
use tokio::sync::OwnedSemaphorePermit;
use tokio::sync::mpsc::{Receiver, channel};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body::{Found, Optional};
use super::openapi::refusals;
use super::problem::{
    BUSY, FIELD, Failure, INTERNAL, MEDIA_TYPE, NO_ANSWER, NO_SUCH_RECORDING, NO_SUCH_SESSION,
    PATH, RANGE, RECORDING, SESSION_DAMAGED, SLOW_BODY, SYNTAX, TOO_LARGE, UNAVAILABLE,
};
use super::range::Asked;
use super::sessions::change_failure;
use super::{Api, see_through};
use crate::directory::RecordingFailure;

/// Bytes of a file that are read at once, and how many of these wait for whoever reads.
const PART: usize = 64 * 1024;
const PARTS_WAITING: usize = 4;

/// The calls of this module, under `/api/v1`.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new()
        .routes(routes!(list, start))
        .routes(routes!(stop))
        .routes(routes!(download, delete))
}

refusals!(ListRefusals: PATH, NO_SUCH_SESSION, SESSION_DAMAGED, UNAVAILABLE);
refusals!(StartRefusals: SYNTAX, PATH, NO_SUCH_SESSION, SLOW_BODY, SESSION_DAMAGED, RECORDING, TOO_LARGE, MEDIA_TYPE, FIELD, UNAVAILABLE, NO_ANSWER);
refusals!(StopRefusals: PATH, NO_SUCH_SESSION, NO_SUCH_RECORDING, SESSION_DAMAGED, UNAVAILABLE, NO_ANSWER);
refusals!(DownloadRefusals: PATH, NO_SUCH_SESSION, NO_SUCH_RECORDING, SESSION_DAMAGED, RANGE, UNAVAILABLE, BUSY);
refusals!(DeleteRefusals: PATH, NO_SUCH_SESSION, NO_SUCH_RECORDING, SESSION_DAMAGED, RECORDING, UNAVAILABLE, NO_ANSWER);

fn failure(error: RecordingFailure, id: &SessionId) -> Failure {
    let of = |error: &dyn std::fmt::Display| format!("session {id}: {error}");
    match error {
        RecordingFailure::Change(error) => change_failure(error, id),
        RecordingFailure::Shelf(error @ ShelfError::Missing { .. }) => {
            NO_SUCH_RECORDING.because(of(&error))
        }
        RecordingFailure::Shelf(
            error @ (ShelfError::Exists { .. }
            | ShelfError::Running { .. }
            | ShelfError::Full { .. }),
        ) => RECORDING.because(of(&error)),
        RecordingFailure::Shelf(error @ (ShelfError::Folder(_) | ShelfError::Write(_))) => {
            UNAVAILABLE.because(of(&error))
        }
        RecordingFailure::BrokenOff => INTERNAL.because(of(&error)),
    }
}

/// The recordings of a session
///
/// Those of a server that was killed are told as interrupted: their files have all but the last second.
#[utoipa::path(
    get, path = "/sessions/{id}/recordings", operation_id = "list_recordings", tag = "recordings",
    params(("id" = String, Path, description = "The session's name")),
    responses((status = 200, description = "The recordings, by name", body = Vec<Recording>), ListRefusals),
)]
async fn list(Found { id, live }: Found) -> Result<Json<Vec<Recording>>, Failure> {
    let recordings = live.recordings().await;
    recordings.map(Json).map_err(|error| failure(error, &id))
}

/// Record a session
///
/// Motion and force at both ends, link, energy, corrections, what came from the handles, what was cut, settings, events
/// and the clay, as an MCAP file with the profile `ros2`. The loop never waits for it: a tick that finds no room on its
/// way is counted as dropped. A session has one recording at a time.
#[utoipa::path(
    post, path = "/sessions/{id}/recordings", operation_id = "start_recording", tag = "recordings",
    params(("id" = String, Path, description = "The session's name")),
    request_body = NewRecording,
    responses(
        (
            status = 201, description = "The recording", body = Recording,
            headers(("Location" = String, description = "Where it is deleted, and with `.mcap` read")),
        ),
        StartRefusals,
    ),
)]
async fn start(
    Found { id, live }: Found,
    Optional(new): Optional<NewRecording>,
) -> Result<Response, Failure> {
    let new = new.unwrap_or_default();
    let recording = see_through(async move { live.start_recording(new).await }).await?;
    let recording = recording.map_err(|error| failure(error, &id))?;
    let location = format!("/api/v1/sessions/{id}/recordings/{}", recording.id);
    Ok((
        StatusCode::CREATED,
        [(header::LOCATION, location)],
        Json(recording),
    )
        .into_response())
}

/// End a recording
///
/// Its file is whole once the answer has come. A recording that has ended stays as it is.
#[utoipa::path(
    post, path = "/sessions/{id}/recordings/{recording}/stop", operation_id = "stop_recording", tag = "recordings",
    params(
        ("id" = String, Path, description = "The session's name"),
        ("recording" = String, Path, description = "The recording's name"),
    ),
    responses((status = 200, description = "The recording", body = Recording), StopRefusals),
)]
async fn stop(Found { id, live }: Found, name: Name) -> Result<Json<Recording>, Failure> {
    let recording = name.parse("")?;
    see_through(async move { live.stop_recording(recording).await })
        .await?
        .map(Json)
        .map_err(|error| failure(error, &id))
}

/// The file of a recording
///
/// One that goes on has what was written so far, and ordinary readers open that as well. With a `Range` of bytes the
/// answer is these.
#[utoipa::path(
    get, path = "/sessions/{id}/recordings/{recording}", operation_id = "recording_file", tag = "recordings",
    params(
        ("id" = String, Path, description = "The session's name"),
        ("recording" = String, Path, description = "The recording's name, and `.mcap`"),
        ("range" = Option<String>, Header, description = "One range of bytes, as in `bytes=0-65535`; any other is passed over"),
    ),
    responses(
        (
            status = 200, description = "The file", content_type = "application/octet-stream", body = Vec<u8>,
            headers(("Content-Disposition" = String, description = "A name for the file")),
        ),
        (
            status = 206, description = "Bytes of the file", content_type = "application/octet-stream", body = Vec<u8>,
            headers(("Content-Range" = String, description = "Which bytes, and of how many")),
        ),
        DownloadRefusals,
    ),
)]
async fn download(
    axum::extract::State(api): axum::extract::State<Api>,
    Found { id, live }: Found,
    name: Name,
    headers: HeaderMap,
) -> Result<Response, Failure> {
    let recording = name.parse(".mcap")?;
    let place = std::sync::Arc::clone(api.model_places())
        .try_acquire_owned()
        .map_err(|_| BUSY.because("enough large answers are under way"))?;
    let disposition = format!("attachment; filename=\"{id}-{recording}.mcap\"");
    let path = live.recording_file(recording).await;
    let path = path.map_err(|error| failure(error, &id))?;
    let unavailable = |error: std::io::Error| UNAVAILABLE.because(format!("session {id}: {error}"));
    let file = File::open(&path).map_err(unavailable)?;
    let length = file.metadata().map_err(unavailable)?.len();
    let (bytes, part) = match Asked::of(&headers, length) {
        Asked::Whole => (0..length, None),
        Asked::Bytes(bytes) => {
            let part = format!("bytes {}-{}/{length}", bytes.start, bytes.end - 1);
            (bytes, Some(part))
        }
        Asked::Beyond => {
            let refusal = RANGE.because(format!("session {id}: the file has {length} bytes"));
            let size = HeaderValue::try_from(format!("bytes */{length}"));
            return Err(match size {
                Ok(size) => refusal.with_header(header::CONTENT_RANGE, size),
                Err(_) => refusal,
            });
        }
    };
    let body = Body::new(Sent::of(file, bytes, place).map_err(unavailable)?);
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (header::CONTENT_DISPOSITION, disposition),
        (header::ACCEPT_RANGES, "bytes".to_owned()),
    ];
    Ok(match part {
        None => (headers, body).into_response(),
        Some(part) => (
            StatusCode::PARTIAL_CONTENT,
            headers,
            [(header::CONTENT_RANGE, part)],
            body,
        )
            .into_response(),
    })
}

/// Delete a recording
///
/// One that goes on is ended before.
#[utoipa::path(
    delete, path = "/sessions/{id}/recordings/{recording}", operation_id = "delete_recording", tag = "recordings",
    params(
        ("id" = String, Path, description = "The session's name"),
        ("recording" = String, Path, description = "The recording's name"),
    ),
    responses((status = 204, description = "It is gone"), DeleteRefusals),
)]
async fn delete(Found { id, live }: Found, name: Name) -> Result<StatusCode, Failure> {
    let recording = name.parse("")?;
    see_through(async move {
        live.stop_recording(recording.clone()).await?;
        live.delete_recording(recording).await
    })
    .await?
    .map(|()| StatusCode::NO_CONTENT)
    .map_err(|error| failure(error, &id))
}

#[derive(Deserialize)]
struct Named {
    recording: String,
}

/// What the path calls a recording.
struct Name(String);

impl Name {
    /// The recording's name, before an ending.
    fn parse(self, ending: &str) -> Result<SessionId, Failure> {
        let name = self.0.strip_suffix(ending);
        name.and_then(|name| SessionId::new(name).ok())
            .ok_or_else(|| NO_SUCH_RECORDING.because(format!("nothing is called {:?}", self.0)))
    }
}

impl FromRequestParts<Api> for Name {
    type Rejection = Failure;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Failure> {
        let InPath(Named { recording }) = InPath::<Named>::from_request_parts(parts, api)
            .await
            .map_err(|rejection| PATH.because(rejection.body_text()))?;
        Ok(Self(recording))
    }
}

/// Bytes of a file on their way, as many as it had when it was asked for.
struct Sent {
    parts: Receiver<std::io::Result<Bytes>>,
    left: u64,
    _place: OwnedSemaphorePermit,
}

impl Sent {
    fn of(mut file: File, bytes: Range<u64>, place: OwnedSemaphorePermit) -> std::io::Result<Self> {
        file.seek(SeekFrom::Start(bytes.start))?;
        let left = bytes.end - bytes.start;
        let (parts, receiver) = channel(PARTS_WAITING);
        tokio::task::spawn_blocking(move || {
            let mut file = file.take(left);
            loop {
                let mut part = Vec::with_capacity(PART);
                let read = file.by_ref().take(PART as u64).read_to_end(&mut part);
                if matches!(read, Ok(0)) {
                    return;
                }
                let (is_broken, part) = (read.is_err(), read.map(|_| Bytes::from(part)));
                // Nobody reads any more, or nothing more can be read.
                if parts.blocking_send(part).is_err() || is_broken {
                    return;
                }
            }
        });
        Ok(Self {
            parts: receiver,
            left,
            _place: place,
        })
    }
}

impl HttpBody for Sent {
    type Data = Bytes;
    type Error = std::io::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Self::Error>>> {
        self.parts.poll_recv(context).map(|part| {
            part.map(|part| {
                part.map(|bytes| {
                    self.left = self.left.saturating_sub(bytes.len() as u64);
                    Frame::data(bytes)
                })
            })
        })
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.left)
    }
}
