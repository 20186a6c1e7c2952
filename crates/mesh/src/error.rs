//! Why something is no mesh, or none that can be clay.

use std::borrow::Cow;
use std::fmt;

use thiserror::Error;

/// What is being read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// STL in numbers.
    BinaryStl,
    /// STL in words.
    TextStl,
    /// The archive around a 3MF model.
    Package,
    /// A part of a 3MF package, as XML.
    Model,
    /// Vertices and triangles, from wherever they came.
    Mesh,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BinaryStl => "binary STL",
            Self::TextStl => "text STL",
            Self::Package => "3MF package",
            Self::Model => "XML of a 3MF package",
            Self::Mesh => "mesh",
        })
    }
}

/// Why there is no mesh, or no clay.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MeshError {
    /// No triangles, or none that enclose anything; or less than a grid's voxels can show.
    #[error("mesh encloses nothing")]
    Empty,
    /// Triangles do not go around what they enclose.
    #[error(
        "mesh is open: along {open_edges} edges, triangles do not pass as often one way as the other"
    )]
    Open {
        /// Edges at fault, each counted once: where triangles end, and where neighbours face opposite ways.
        open_edges: usize,
    },
    /// Larger than the block, wherever it lies.
    #[error("mesh measures {mesh_m:?} m, the block only {block_m:?} m")]
    TooLarge {
        /// Edges of the mesh's bounding box along x, y, z, m.
        mesh_m: [f64; 3],
        /// Edges of the block, m.
        block_m: [f64; 3],
    },
    /// Not larger than the block, but not within it either.
    #[error("mesh lies at {lower_m:?} to {upper_m:?} m, wanted within 0 to {block_m:?} m")]
    Outside {
        /// Lower corner of the mesh's bounding box, m.
        lower_m: [f64; 3],
        /// Upper corner, m.
        upper_m: [f64; 3],
        /// Edges of the block, m.
        block_m: [f64; 3],
    },
    /// A vertex that is nowhere, or farther out than anything that is made.
    #[error("vertex {vertex} is at {got_m:?} m, wanted finite numbers of at most {most_m} m")]
    OutOfRange {
        /// The vertex's number, from 0, in the order of the file.
        vertex: usize,
        /// Where it is said to be, m.
        got_m: [f64; 3],
        /// How far it may be along an axis, m.
        most_m: f64,
    },
    /// More of something than is read.
    #[error("{format} has {got} {what}, at most {most} are read")]
    TooMuch {
        /// What is being read.
        format: Format,
        /// What there is too much of.
        what: &'static str,
        /// How many there are, or how many there were when counting ended.
        got: u64,
        /// How many are read.
        most: u64,
    },
    /// Not what its format asks for.
    #[error("{format}, byte {at}: {problem}")]
    Malformed {
        /// What is being read.
        format: Format,
        /// Where, in bytes from its beginning.
        at: usize,
        /// What is wrong there.
        problem: Cow<'static, str>,
    },
    /// It says of itself what is not so.
    #[error("{format} speaks of {said} {what}, there are {found}")]
    SelfContradicting {
        /// What is being read.
        format: Format,
        /// What is counted.
        what: &'static str,
        /// How many it speaks of.
        said: u64,
        /// How many there are.
        found: u64,
    },
}

impl MeshError {
    /// Something malformed.
    pub(crate) fn malformed(
        format: Format,
        at: usize,
        problem: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self::Malformed {
            format,
            at,
            problem: problem.into(),
        }
    }
}

/// The beginning of a text from a file, or about one: an error does not repeat a whole document.
pub(crate) fn beginning(text: impl fmt::Display) -> String {
    /// So much tells what it is about.
    const SHOWN: usize = 120;
    let text = text.to_string();
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}
