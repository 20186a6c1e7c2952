//! The clay as a file.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{FromRequestParts, Query, State};
use axum::http::header;
use axum::http::request::Parts;
use axum::response::{IntoResponse, Response};
use hyper::body::{Frame, SizeHint};
use serde::Deserialize;
use teleclay_clay::{Clay, Mesh, stl};
use teleclay_mesh::{glb, threemf};
use teleclay_proto::http::FieldError;
use tokio::sync::OwnedSemaphorePermit;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body::Found;
use super::history::past_failure;
use super::openapi::refusals;
use super::problem::{
    BUSY, FIELD, Failure, INTERNAL, NO_SUCH_SESSION, NOT_KEPT, PATH, SESSION_DAMAGED, UNAVAILABLE,
};
use super::{Api, MAX_MODELS};

/// The call of this module, under `/api/v1`.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new()
        .routes(routes!(model))
        .routes(routes!(model_3mf))
        .routes(routes!(model_glb))
}

/// A format, with what goes with it.
#[derive(Clone, Copy, Debug)]
struct Format {
    ending: &'static str,
    media_type: &'static str,
    encode: fn(&Mesh) -> Vec<u8>,
}

const STL: Format = Format {
    ending: "stl",
    media_type: "model/stl",
    encode: stl::encode,
};
const THREE_MF: Format = Format {
    ending: "3mf",
    media_type: "model/3mf",
    encode: threemf::encode,
};
const GLB: Format = Format {
    ending: "glb",
    media_type: "model/gltf-binary",
    encode: glb::encode,
};

refusals!(ModelRefusals: PATH, NO_SUCH_SESSION, SESSION_DAMAGED, NOT_KEPT, FIELD, UNAVAILABLE, BUSY);

/// The clay as binary STL
///
/// The clay's surface in its own frame, in millimetres, which is what programs for printing take the numbers of an STL
/// for: a closed manifold, each edge of exactly two triangles, facing outwards. It encloses the clay's remaining
/// volume, to a thousandth unless clay is porous throughout, which tools do not make of it. The header says the volume
/// that the triangles enclose.
#[utoipa::path(
    get, path = "/sessions/{id}/clay.stl", tag = "clay",
    params(
        ("id" = String, Path, description = "The session's name"),
        ("at_s" = Option<f64>, Query, description = "The clay as it was at this moment, s: since the session began, while its loop ran. Now when left out.", minimum = 0.0),
    ),
    responses(
        (
            status = 200, description = "The clay", content_type = "model/stl", body = Vec<u8>,
            headers(("Content-Disposition" = String, description = "A name for the file")),
        ),
        ModelRefusals,
    ),
)]
async fn model(State(api): State<Api>, found: Found, at: At) -> Result<Response, Failure> {
    made(&api, found, at, STL).await
}

/// The clay as 3MF
///
/// The same surface in millimetres, which the file says, with shared vertices.
#[utoipa::path(
    get, path = "/sessions/{id}/clay.3mf", tag = "clay",
    params(
        ("id" = String, Path, description = "The session's name"),
        ("at_s" = Option<f64>, Query, description = "As for STL", minimum = 0.0),
    ),
    responses(
        (
            status = 200, description = "The clay", content_type = "model/3mf", body = Vec<u8>,
            headers(("Content-Disposition" = String, description = "A name for the file")),
        ),
        ModelRefusals,
    ),
)]
async fn model_3mf(State(api): State<Api>, found: Found, at: At) -> Result<Response, Failure> {
    made(&api, found, at, THREE_MF).await
}

/// The clay as binary glTF
///
/// The same surface in metres, turned so that y points up, as the format asks for, with shared vertices and normals.
#[utoipa::path(
    get, path = "/sessions/{id}/clay.glb", tag = "clay",
    params(
        ("id" = String, Path, description = "The session's name"),
        ("at_s" = Option<f64>, Query, description = "As for STL", minimum = 0.0),
    ),
    responses(
        (
            status = 200, description = "The clay", content_type = "model/gltf-binary", body = Vec<u8>,
            headers(("Content-Disposition" = String, description = "A name for the file")),
        ),
        ModelRefusals,
    ),
)]
async fn model_glb(State(api): State<Api>, found: Found, at: At) -> Result<Response, Failure> {
    made(&api, found, at, GLB).await
}

async fn made(
    api: &Api,
    Found { id, live }: Found,
    At(at_s): At,
    format: Format,
) -> Result<Response, Failure> {
    let place = Arc::clone(api.model_places())
        .try_acquire_owned()
        .map_err(|_| {
            BUSY.because(format!(
                "at most {MAX_MODELS} models are made or sent at once"
            ))
        })?;
    let past = match at_s {
        Some(at_s) => {
            let past = live.clay_at(at_s).await;
            Some(past.map_err(|error| past_failure(error, &id))?)
        }
        None => None,
    };
    // It takes seconds for the largest clay. The place goes along: it is taken until the work is done, whether or not
    // anybody still waits for it.
    let (file, place) = tokio::task::spawn_blocking(move || {
        let clay = past.unwrap_or_else(|| live.clay().with(|clay, _| Clay::clone(clay)));
        ((format.encode)(&Mesh::of(&clay)), place)
    })
    .await
    .map_err(|_| INTERNAL.because("the model was broken off"))?;
    let headers = [
        (header::CONTENT_TYPE, format.media_type.to_owned()),
        (
            header::CONTENT_DISPOSITION,
            format!("attachment; filename=\"{id}.{}\"", format.ending),
        ),
    ];
    let body = Placed {
        rest: file.into(),
        _place: place,
    };
    Ok((headers, Body::new(body)).into_response())
}

/// The moment that is meant.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Moment {
    at_s: Option<f64>,
}

/// The moment that a query names, in seconds of the session.
struct At(Option<f64>);

impl FromRequestParts<Api> for At {
    type Rejection = Failure;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Failure> {
        let Query(Moment { at_s }) = Query::<Moment>::from_request_parts(parts, api)
            .await
            .map_err(|rejection| FieldError::new("/at_s", rejection.body_text()))?;
        match at_s {
            Some(at_s) if !(0.0..1e9).contains(&at_s) => {
                let detail = format!("{at_s} is not a moment from 0 to 1e9 s");
                Err(FieldError::new("/at_s", detail).into())
            }
            at_s => Ok(Self(at_s)),
        }
    }
}

/// A body that keeps its place until it is sent, or given up: models may be large, and this bounds how many there are.
struct Placed {
    rest: Bytes,
    _place: OwnedSemaphorePermit,
}

impl HttpBody for Placed {
    type Data = Bytes;
    type Error = std::convert::Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Self::Error>>> {
        /// Bytes handed over at once.
        const PART: usize = 64 * 1024;
        if self.rest.is_empty() {
            return Poll::Ready(None);
        }
        let length = self.rest.len().min(PART);
        let part = self.rest.split_to(length);
        Poll::Ready(Some(Ok(Frame::data(part))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty()
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.rest.len() as u64)
    }
}
