//! Meshes as files: clay becomes a file that slicers and viewers read, and a closed mesh from a file becomes clay.
//!
//! | module | holds |
//! |---|---|
//! | [`triangles`] | a closed mesh: welded, every edge in balance, facing outwards |
//! | [`stl`] | binary and text STL, read |
//! | [`threemf`] | 3MF packages, written and read |
//! | [`glb`] | binary glTF 2.0, written |
//! | [`fill`](mod@fill) | a closed mesh as clay |
//! | [`volume`] | volumes of samples, NRRD and MetaImage, read, and as clay of several classes |
//! | [`error`] | why something is no mesh, or none that can be clay |
//!
//! Binary STL is written by [`teleclay_clay::stl`]. Everything here is a pure function of what is passed in, and the
//! same input gives the same bits.
//!
//! Whatever the bytes, a reader ends with a mesh or an error, and takes a bounded amount of memory: [`stl::read_stl`]
//! at most [`stl::MEMORY_PER_BYTE`] times what it reads, [`threemf::read_3mf`] at most [`threemf::MEMORY_PER_BYTE`]
//! times what it unpacks and [`threemf::MEMORY_PER_TRIANGLE`] for each triangle that it builds; it unpacks at most
//! [`threemf::MOST_UNPACKED_BYTES`]. No mesh has more than [`triangles::MOST_TRIANGLES`].
//!
//! ```
//! use teleclay_clay::{Clay, Mesh, Shape, stl};
//! use teleclay_mesh::{Placement, fill, read_stl, threemf};
//!
//! let clay = Clay::new(&Shape::Block { size_m: [0.020, 0.030, 0.010] }, 1e-3)?;
//! let mesh = read_stl(&stl::encode(&Mesh::of(&clay)))?;
//! assert!((mesh.volume_m3() / clay.remaining_volume_m3() - 1.0).abs() < 1e-3);
//!
//! let again = fill(&mesh, clay.grid(), Placement::AsIs)?;
//! assert_eq!(again.remaining_units(), clay.remaining_units());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod error;
pub mod fill;
pub mod glb;
pub mod stl;
pub mod threemf;
pub mod triangles;
pub mod volume;

pub use error::{Format, MeshError};
pub use fill::{Placement, fill};
pub use stl::read_stl;
pub use threemf::read_3mf;
pub use triangles::TriangleMesh;
pub use volume::{Thresholds, Volume, VolumeError, fill_volume, read_metaimage, read_nrrd};
