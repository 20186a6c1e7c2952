//! A mesh or a volume becomes clay.

use std::sync::Arc;
use std::time::Duration;

use axum::Json;
use axum::body::{Bytes, to_bytes};
use axum::extract::{FromRequestParts, Query, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use serde::Deserialize;
use teleclay_bilateral::material;
use teleclay_clay::{Classes, Clay, Grid, Material};
use teleclay_mesh::{
    MeshError, Placement, Thresholds, TriangleMesh, Volume, VolumeError, fill, fill_volume,
    read_3mf, read_metaimage, read_nrrd, read_stl,
};
use teleclay_proto::http::{self, FieldError, Preset, Session, Validate};
use teleclay_proto::{SessionId, UnknownWord};
use tokio::time::timeout;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body::Found;
use super::openapi::refusals;
use super::problem::{
    BUSY, FIELD, Failure, INTERNAL, MEDIA_TYPE, MESH, MESH_EMPTY, MESH_OPEN, MESH_TOO_LARGE,
    NO_ANSWER, NO_SUCH_SESSION, PATH, SESSION_DAMAGED, SLOW_BODY, SYNTAX, TOO_LARGE, UNAVAILABLE,
    VOLUME, VOLUME_EMPTY, VOLUME_TOO_LARGE,
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

refusals!(ImportRefusals: SYNTAX, PATH, NO_SUCH_SESSION, SLOW_BODY, SESSION_DAMAGED, TOO_LARGE, MEDIA_TYPE, FIELD, MESH, MESH_OPEN, MESH_EMPTY, MESH_TOO_LARGE, VOLUME, VOLUME_EMPTY, VOLUME_TOO_LARGE, UNAVAILABLE, NO_ANSWER, BUSY);

/// What a file says it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Stl,
    ThreeMf,
    Nrrd,
    MetaImage,
}

/// A mesh or a volume as clay
///
/// The body of the mesh takes the place of the block, under a new epoch. The mesh must be closed: shells that overlap
/// are one body, and one that faces inwards is a hollow. The numbers of an STL are millimetres, a 3MF says its unit.
/// The file has at most 64 MiB. The mesh stays where it is, the block's lower corner being the origin, unless `fit` is
/// true: then it is scaled alike along all axes until it touches two opposite faces of the block, and centred. Where
/// the block has layers, what a mesh has at a place is of the layer there.
///
/// A volume is a scan or the like, as NRRD (raw or gzip) or MetaImage (raw or zlib) with its data behind the header, of
/// at most 256 MiB once unpacked. It becomes clay of one class or several: what is below the first of `thresholds` is
/// air, what is from it up to the next one is of the first class and resists with the session's material, and what is
/// from each further threshold on resists with one of `materials`. Axes must run along x, y, z, in any order and either
/// way. Values between samples are interpolated, so between air and a class far above it there is a thin shell of the
/// classes between.
#[utoipa::path(
    put, path = "/sessions/{id}/clay", tag = "clay",
    params(
        ("id" = String, Path, description = "The session's name"),
        ("fit" = Option<bool>, Query, description = "Whether the mesh or volume is scaled into the block. False when left out."),
        ("thresholds" = Option<String>, Query, description = "For a volume: 1 to 8 ascending values, separated by commas. A class of material begins at each. A volume needs them, a mesh has none."),
        ("materials" = Option<String>, Query, description = "For a volume: materials of the second class and those after it, separated by commas, each a preset's name or `viscosity:yield:stiffness` in Pa s/m, Pa and Pa. As many as there are thresholds, less one."),
    ),
    request_body(
        description = "The mesh or the volume",
        content(
            (Vec<u8> = "model/stl"),
            (Vec<u8> = "model/3mf"),
            (Vec<u8> = "application/x-nrrd"),
            (Vec<u8> = "application/x-metaimage"),
        ),
    ),
    responses((status = 200, description = "The session with its new clay", body = Session), ImportRefusals),
)]
async fn put(
    State(api): State<Api>,
    Found { id, live }: Found,
    Asked { placement, parts }: Asked,
    request: Request,
) -> Result<Json<Session>, Failure> {
    let kind = kind(request.headers())?;
    let wanted = Wanted::new(kind, placement, parts)?;
    let places = Arc::clone(api.model_places());
    let place = places.try_acquire_owned().map_err(|_| {
        BUSY.because(format!(
            "at most {MAX_MODELS} models are made or read at once"
        ))
    })?;
    let file = file(request).await?;
    let put = async move {
        let block = live
            .clay()
            .with(|clay, _| (*clay.grid(), clay.classes().cloned()));
        let read = tokio::task::spawn_blocking(move || clay_of(&wanted, &file, block));
        let clay = read
            .await
            .map_err(|_| INTERNAL.because("reading the file was broken off"))??;
        let put = live.put_clay(clay).await;
        drop(place);
        put.map_err(|error| import_failure(error, &id))
    };
    see_through(put).await?.map(Json)
}

/// What the file is to become.
enum Wanted {
    Mesh {
        read: fn(&[u8]) -> Result<TriangleMesh, MeshError>,
        placement: Placement,
    },
    Volume {
        read: fn(&[u8]) -> Result<Volume, VolumeError>,
        placement: Placement,
        thresholds: Thresholds,
    },
}

impl Wanted {
    fn new(kind: Kind, placement: Placement, parts: Option<ClassesAsked>) -> Result<Self, Failure> {
        let mesh = |read| Ok(Self::Mesh { read, placement });
        let volume = |read| {
            let missing = || {
                let detail = "a volume needs thresholds: the value from which on it is clay, and one for each further class";
                FieldError::new("/thresholds", detail)
            };
            let ClassesAsked { from, further } = parts.clone().ok_or_else(missing)?;
            let thresholds = Thresholds::new(from, further)
                .map_err(|error| FieldError::new("/thresholds", error.to_string()))?;
            Ok(Self::Volume {
                read,
                placement,
                thresholds,
            })
        };
        match kind {
            Kind::Stl | Kind::ThreeMf if parts.is_some() => {
                let detail = "a mesh has no values that thresholds or materials could be for";
                Err(FieldError::new("/thresholds", detail).into())
            }
            Kind::Stl => mesh(read_stl),
            Kind::ThreeMf => mesh(read_3mf),
            Kind::Nrrd => volume(read_nrrd),
            Kind::MetaImage => volume(read_metaimage),
        }
    }
}

fn clay_of(
    wanted: &Wanted,
    file: &[u8],
    (grid, classes): (Grid, Option<Arc<Classes>>),
) -> Result<Clay, Failure> {
    match wanted {
        Wanted::Mesh { read, placement } => {
            let mesh = read(file).map_err(mesh_failure)?;
            let mut clay = fill(&mesh, &grid, *placement).map_err(mesh_failure)?;
            clay.assign_classes(classes)
                .map_err(|error| INTERNAL.because(error.to_string()))?;
            Ok(clay)
        }
        Wanted::Volume {
            read,
            placement,
            thresholds,
        } => {
            let volume = read(file).map_err(volume_failure)?;
            fill_volume(&volume, &grid, thresholds, *placement).map_err(volume_failure)
        }
    }
}

fn volume_failure(error: VolumeError) -> Failure {
    let kind = match &error {
        VolumeError::Empty { .. } => VOLUME_EMPTY,
        VolumeError::TooLarge { .. } => VOLUME_TOO_LARGE,
        VolumeError::Malformed { .. }
        | VolumeError::TooMuch { .. }
        | VolumeError::SelfContradicting { .. }
        | VolumeError::Threshold { .. }
        | VolumeError::Count { .. } => VOLUME,
    };
    kind.because(error.to_string())
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
    const WANTED: &str =
        "wanted model/stl, model/3mf, application/x-nrrd or application/x-metaimage";
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
        "application/x-nrrd" => Ok(Kind::Nrrd),
        "application/x-metaimage" => Ok(Kind::MetaImage),
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

/// What a query says: where the mesh or the volume goes, and how values become classes.
struct Asked {
    placement: Placement,
    parts: Option<ClassesAsked>,
}

/// Thresholds and materials as they came.
#[derive(Clone)]
struct ClassesAsked {
    from: Vec<f64>,
    further: Vec<Material>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct AskedQuery {
    #[serde(default)]
    fit: bool,
    thresholds: Option<String>,
    materials: Option<String>,
}

impl FromRequestParts<Api> for Asked {
    type Rejection = Failure;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Failure> {
        let Query(query) = Query::<AskedQuery>::from_request_parts(parts, api)
            .await
            .map_err(|rejection| FieldError::new("/fit", rejection.body_text()))?;
        let placement = if query.fit {
            Placement::Fitted
        } else {
            Placement::AsIs
        };
        let parts = match (&query.thresholds, &query.materials) {
            (None, None) => None,
            (thresholds, materials) => Some(ClassesAsked {
                from: each(thresholds.as_deref(), "/thresholds", threshold)?,
                further: each(materials.as_deref(), "/materials", material_of)?,
            }),
        };
        Ok(Self { placement, parts })
    }
}

/// Reads what commas separate.
fn each<T>(
    texts: Option<&str>,
    pointer: &str,
    read: impl Fn(&str) -> Result<T, String>,
) -> Result<Vec<T>, FieldError> {
    let texts = texts.filter(|texts| !texts.is_empty());
    texts
        .into_iter()
        .flat_map(|texts| texts.split(','))
        .map(|text| read(text.trim()).map_err(|detail| FieldError::new(pointer, detail)))
        .collect()
}

fn threshold(text: &str) -> Result<f64, String> {
    text.parse()
        .map_err(|_| format!("`{text}` is not a number"))
}

/// A preset's name, or three numbers with colons between them.
fn material_of(text: &str) -> Result<Material, String> {
    let raw = if text.contains(':') {
        let mut numbers = text.split(':').map(threshold);
        let mut next = || {
            numbers
                .next()
                .ok_or("wanted viscosity:yield:stiffness".to_owned())?
        };
        let raw = http::Material {
            viscosity_pa_s_per_m: next()?,
            yield_stress_pa: next()?,
            stiffness_pa: next()?,
        };
        if numbers.next().is_some() {
            return Err(format!("`{text}` has more than viscosity:yield:stiffness"));
        }
        raw
    } else {
        let preset: Preset = text
            .parse()
            .map_err(|error: UnknownWord| error.to_string())?;
        preset.material()
    };
    raw.validate().map_err(|error| error.to_string())?;
    material(&raw).map_err(|error| error.to_string())
}
