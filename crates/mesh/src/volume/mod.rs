//! Volumes from files: samples on a grid, such as a scan, which become clay of several classes of material.
//!
//! | module | holds |
//! |---|---|
//! | [`nrrd`] | NRRD, read: raw and gzip, the data behind the header |
//! | [`metaimage`] | MetaImage, read: raw and zlib, the data behind the header |
//! | [`samples`] | the samples as they came, unpacked and checked |
//! | [`fill`](mod@fill) | a volume as clay, by thresholds |
//!
//! Axes of a file may run along x, y and z in any order and either way; oblique ones are refused. Whatever the bytes, a
//! reader ends with a volume or an error. What it says of its size is held against [`MOST_SAMPLE_BYTES`], and against
//! what is there, before anything is allocated for it; a reader takes no more memory than that and the file itself.

pub mod fill;
pub mod metaimage;
pub mod nrrd;
pub mod samples;

use std::borrow::Cow;
use std::fmt;

use thiserror::Error;

pub use fill::{Thresholds, fill_volume};
pub use metaimage::read_metaimage;
pub use nrrd::read_nrrd;
pub use samples::{SampleType, Volume};

/// Bytes of samples that are read at most: 512³ of two bytes.
pub const MOST_SAMPLE_BYTES: u64 = 1 << 28;

/// A form in which volumes are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VolumeFormat {
    /// Nearly raw raster data.
    Nrrd,
    /// The format of the Insight toolkit, `.mha` and `.mhd`.
    MetaImage,
}

impl fmt::Display for VolumeFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nrrd => "NRRD",
            Self::MetaImage => "MetaImage",
        })
    }
}

/// Why there is no volume, or no clay of it.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum VolumeError {
    /// Not what its format asks for, or of a kind that is not read.
    #[error("{format}: {problem}")]
    Malformed {
        /// What is being read.
        format: VolumeFormat,
        /// What is wrong.
        problem: Cow<'static, str>,
    },
    /// More samples than are read.
    #[error("{format} has {got} bytes of samples, at most {MOST_SAMPLE_BYTES} are read")]
    TooMuch {
        /// What is being read.
        format: VolumeFormat,
        /// How many it says there are.
        got: u64,
    },
    /// It says of itself what is not so.
    #[error("{format} speaks of {said} bytes of samples, there are {found}")]
    SelfContradicting {
        /// What is being read.
        format: VolumeFormat,
        /// How many it speaks of.
        said: u64,
        /// How many there are, or how many there can be at most.
        found: u64,
    },
    /// Larger than the block.
    #[error("volume measures {volume_m:?} m, the block only {block_m:?} m")]
    TooLarge {
        /// Edges of the volume along x, y, z, m.
        volume_m: [f64; 3],
        /// Edges of the block, m.
        block_m: [f64; 3],
    },
    /// Nothing in it is clay.
    #[error("volume has nothing at or above the first threshold, {threshold}")]
    Empty {
        /// The first threshold.
        threshold: f64,
    },
    /// Thresholds that do not part values.
    #[error("threshold {index} is {got}, wanted finite and above the one before")]
    Threshold {
        /// Which one, from 0.
        index: usize,
        /// As it came.
        got: f64,
    },
    /// Too few or too many classes, or a material short or over.
    #[error(
        "{thresholds} thresholds and {materials} further materials, wanted 1 to {most} thresholds and one material fewer"
    )]
    Count {
        /// How many thresholds there are.
        thresholds: usize,
        /// How many materials beside the first class's.
        materials: usize,
        /// Most thresholds.
        most: usize,
    },
}

impl VolumeError {
    pub(crate) fn malformed(format: VolumeFormat, problem: impl Into<Cow<'static, str>>) -> Self {
        let problem = problem.into();
        Self::Malformed { format, problem }
    }
}
