//! 3MF packages, written and read: an archive with a model as XML in it.
//!
//! | part of a package | what it is |
//! |---|---|
//! | `[Content_Types].xml` | which kinds of parts there are |
//! | `_rels/.rels` | which part is the model |
//! | `3D/3dmodel.model` | the model: objects, and which of them are built, where |
//!
//! The formats are the 3MF core specification 1.3 and the Open Packaging Conventions, ECMA-376 part 2.
//!
//! What is read of a model is its core: meshes, components, items, transforms, units. Colours and materials are passed
//! over. A model that requires any other extension is refused, since its shape would not be the one that was meant.
//! Supports and surfaces are no clay: only objects of type `model` count.

mod model;
mod package;
mod transform;
mod write;

pub use write::encode;

use crate::error::MeshError;
use crate::triangles::TriangleMesh;

/// Most bytes that the parts of a package which are read may have together: about what [`encode`] writes of the most
/// triangles that are read.
pub const MOST_UNPACKED_BYTES: usize = 160 << 20;
/// Most parts in a package. One of a model has three and a few pictures.
pub const MOST_PARTS: usize = 1000;
/// Most objects that are in others, one within the other.
pub const MOST_NESTED_OBJECTS: u32 = 16;
/// Most times that meshes are put somewhere. As objects may be made of others, a short file could ask for any number.
pub const MOST_PLACED: u64 = 10_000;

/// What reading takes at most, beside 64 KiB, for each byte of the parts that are unpacked: the byte itself, and a
/// vertex of 24 bytes that is written in as many, in a list that holds three times as much while it grows.
pub const MEMORY_PER_BYTE: usize = 5;
/// What reading takes at most besides, for each triangle of what is built, and for each three vertices where these are
/// more: lists of both, and of the edges, while vertices are welded.
pub const MEMORY_PER_TRIANGLE: usize = 300;

/// Reads a 3MF package: all that it builds, as one mesh.
///
/// # Errors
/// When the archive or its XML is broken or larger than it may be, the model requires more than the core of 3MF or
/// contradicts itself, or what it builds is no closed mesh.
pub fn read_3mf(bytes: &[u8]) -> Result<TriangleMesh, MeshError> {
    let text = package::model_text(bytes)?;
    let built = model::built(&text)?;
    drop(text);
    TriangleMesh::new(built.vertices_m, built.triangles)
}
