//! A mesh becomes clay.

use std::sync::Arc;
use std::time::Duration;

use axum::Json;
use axum::body::{Bytes, to_bytes};
use axum::extract::{FromRequestParts, Query, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use serde::Deserialize;
use teleclay_clay::{Clay, Grid};
use teleclay_mesh::{MeshError, Placement, fill, read_3mf, read_stl};
use teleclay_proto::SessionId;
use teleclay_proto::http::{FieldError, Session};
use tokio::time::timeout;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body::Found;
use super::openapi::refusals;
use super::problem::{
    BUSY, FIELD, Failure, INTERNAL, MEDIA_TYPE, MESH, MESH_EMPTY, MESH_OPEN, MESH_TOO_LARGE,
    NO_ANSWER, NO_SUCH_SESSION, PATH, SESSION_DAMAGED, SLOW_BODY, SYNTAX, TOO_LARGE, UNAVAILABLE,
};
use super::sessions::change_failure;
use super::{Api, MAX_MODELS, see_through};
use crate::directory::ImportError;

/// Longest file, bytes: a million triangles of binary STL are 50 MB.
pub(crate) const MAX_FILE: usize = 64 << 20;
/// Longest wait for the whole file: 64 MiB at 5 Mbit/s.
const FILE_TIMEOUT: Duration = Duration::from_secs(108);

/// The call of this module, under `/api/v1`.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new().routes(routes!(put))
}

refusals!(ImportRefusals: SYNTAX, PATH, NO_SUCH_SESSION, SLOW_BODY, SESSION_DAMAGED, TOO_LARGE, MEDIA_TYPE, FIELD, MESH, MESH_OPEN, MESH_EMPTY, MESH_TOO_LARGE, UNAVAILABLE, NO_ANSWER, BUSY);

/// What a file says it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Stl,
    ThreeMf,
}

/// A mesh as clay
///
/// The body of the mesh takes the place of the block, under a new epoch. The mesh must be closed: shells that overlap
/// are one body, and one that faces inwards is a hollow. The numbers of an STL are millimetres, a 3MF says its unit.
/// The file has at most 64 MiB. The mesh stays where it is, the block's lower corner being the origin, unless `fit` is
/// true: then it is scaled alike along all axes until it touches two opposite faces of the block, and centred.
#[utoipa::path(
    put, path = "/sessions/{id}/clay", tag = "clay",
    params(
        ("id" = String, Path, description = "The session's name"),
        ("fit" = Option<bool>, Query, description = "Whether the mesh is scaled into the block. False when left out."),
    ),
    request_body(
        description = "The mesh",
        content(
            (Vec<u8> = "model/stl"),
            (Vec<u8> = "model/3mf"),
        ),
    ),
    responses((status = 200, description = "The session with its new clay", body = Session), ImportRefusals),
)]
async fn put(
    State(api): State<Api>,
    Found { id, live }: Found,
    Fit(placement): Fit,
    request: Request,
) -> Result<Json<Session>, Failure> {
    let kind = kind(request.headers())?;
    let places = Arc::clone(api.model_places());
    let place = places.try_acquire_owned().map_err(|_| {
        BUSY.because(format!(
            "at most {MAX_MODELS} models are made or read at once"
        ))
    })?;
    let file = file(request).await?;
    let put = async move {
        let grid = live.clay().with(|clay, _| *clay.grid());
        let read = tokio::task::spawn_blocking(move || clay_of(kind, &file, &grid, placement));
        let clay = read
            .await
            .map_err(|_| INTERNAL.because("reading the mesh was broken off"))?
            .map_err(mesh_failure)?;
        let put = live.put_clay(clay).await;
        drop(place);
        put.map_err(|error| import_failure(error, &id))
    };
    see_through(put).await?.map(Json)
}

fn clay_of(kind: Kind, file: &[u8], grid: &Grid, placement: Placement) -> Result<Clay, MeshError> {
    let mesh = match kind {
        Kind::Stl => read_stl(file)?,
        Kind::ThreeMf => read_3mf(file)?,
    };
    fill(&mesh, grid, placement)
}

fn mesh_failure(error: MeshError) -> Failure {
    let kind = match &error {
        MeshError::Open { .. } => MESH_OPEN,
        MeshError::Empty => MESH_EMPTY,
        MeshError::TooLarge { .. } | MeshError::Outside { .. } => MESH_TOO_LARGE,
        MeshError::OutOfRange { .. }
        | MeshError::TooMuch { .. }
        | MeshError::Malformed { .. }
        | MeshError::SelfContradicting { .. } => MESH,
    };
    kind.because(error.to_string())
}

fn import_failure(error: ImportError, id: &SessionId) -> Failure {
    match error {
        ImportError::Home(error) => UNAVAILABLE.because(format!("session {id}: {error}")),
        ImportError::Change(error) => change_failure(error, id),
    }
}

fn kind(headers: &HeaderMap) -> Result<Kind, Failure> {
    const WANTED: &str = "wanted model/stl or model/3mf";
    if let Some(encoding) = headers.get(header::CONTENT_ENCODING) {
        let detail = format!("the Content-Encoding is {encoding:?}, wanted none");
        return Err(MEDIA_TYPE.because(detail));
    }
    let Some(got) = headers.get(header::CONTENT_TYPE) else {
        return Err(MEDIA_TYPE.because(format!("there is no Content-Type, {WANTED}")));
    };
    let essence = got.to_str().unwrap_or_default().split(';').next();
    match essence
        .unwrap_or_default()
        .trim()
        .to_ascii_lowercase()
        .as_str()
    {
        "model/stl" => Ok(Kind::Stl),
        "model/3mf" => Ok(Kind::ThreeMf),
        _ => Err(MEDIA_TYPE.because(format!("the Content-Type is {got:?}, {WANTED}"))),
    }
}

async fn file(request: Request) -> Result<Bytes, Failure> {
    let too_large = || TOO_LARGE.because(format!("the file has more than {MAX_FILE} bytes"));
    let announced = request.headers().get(header::CONTENT_LENGTH);
    let announced = announced.and_then(|length| length.to_str().ok()?.parse::<u64>().ok());
    // One that says it is too large need not be waited for.
    if announced.is_some_and(|length| (MAX_FILE as u64) < length) {
        return Err(too_large());
    }
    timeout(FILE_TIMEOUT, to_bytes(request.into_body(), MAX_FILE))
        .await
        .map_err(|_| SLOW_BODY.because(format!("waited {} s for it", FILE_TIMEOUT.as_secs())))?
        .map_err(|_| too_large())
}

/// What a query says of where the mesh goes.
struct Fit(Placement);

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FitQuery {
    #[serde(default)]
    fit: bool,
}

impl FromRequestParts<Api> for Fit {
    type Rejection = Failure;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Failure> {
        let Query(FitQuery { fit }) = Query::from_request_parts(parts, api)
            .await
            .map_err(|rejection| FieldError::new("/fit", rejection.body_text()))?;
        Ok(Self(if fit {
            Placement::Fitted
        } else {
            Placement::AsIs
        }))
    }
}
