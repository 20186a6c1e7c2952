//! The clay as a file.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use hyper::body::{Frame, SizeHint};
use teleclay_clay::{Clay, Mesh, stl};
use tokio::sync::OwnedSemaphorePermit;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body::Found;
use super::openapi::refusals;
use super::problem::{BUSY, Failure, INTERNAL, NO_SUCH_SESSION, PATH};
use super::{Api, MAX_MODELS};

/// The call of this module, under `/api/v1`.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new().routes(routes!(model))
}

refusals!(ModelRefusals: PATH, NO_SUCH_SESSION, BUSY);

/// The clay as binary STL
///
/// The clay's surface in its own frame, in millimetres, which is what programs for printing take the numbers of an STL
/// for: a closed manifold, each edge of exactly two triangles, facing outwards. It encloses the clay's remaining
/// volume, to a thousandth unless clay is porous throughout, which tools do not make of it. The header says the volume
/// that the triangles enclose.
#[utoipa::path(
    get, path = "/sessions/{id}/clay.stl", tag = "clay",
    params(("id" = String, Path, description = "The session's name")),
    responses(
        (
            status = 200, description = "The clay", content_type = "model/stl", body = Vec<u8>,
            headers(("Content-Disposition" = String, description = "A name for the file")),
        ),
        ModelRefusals,
    ),
)]
async fn model(State(api): State<Api>, Found { id, live }: Found) -> Result<Response, Failure> {
    let place = Arc::clone(api.model_places())
        .try_acquire_owned()
        .map_err(|_| {
            BUSY.because(format!(
                "at most {MAX_MODELS} models are made or sent at once"
            ))
        })?;
    // It takes seconds for the largest clay. The place goes along: it is taken until the work is done, whether or not
    // anybody still waits for it.
    let (file, place) = tokio::task::spawn_blocking(move || {
        let clay = live.clay().with(|clay, _| Clay::clone(clay));
        (stl::encode(&Mesh::of(&clay)), place)
    })
    .await
    .map_err(|_| INTERNAL.because("the model was broken off"))?;
    let headers = [
        (header::CONTENT_TYPE, "model/stl".to_owned()),
        (
            header::CONTENT_DISPOSITION,
            format!("attachment; filename=\"{id}.stl\""),
        ),
    ];
    let body = Placed {
        rest: file.into(),
        _place: place,
    };
    Ok((headers, Body::new(body)).into_response())
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
