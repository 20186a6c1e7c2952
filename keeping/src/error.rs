//! Why sessions cannot be kept, and what every module needs to say so.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use teleclay_journal::{OpenError, ReadError};

use crate::past::PastError;

/// The version of the layout that is written, and the newest that is read.
pub(crate) const VERSION: u32 = 1;

/// Why sessions cannot be kept, or not gone on with.
#[derive(Debug, thiserror::Error)]
pub enum HomeError {
    /// A file or folder.
    #[error("{}: {source}", path.display())]
    File {
        /// Its path.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Another server runs on the folder.
    #[error("another server keeps its sessions in {}: give this one another --data-dir, or --ephemeral", path.display())]
    InUse {
        /// The folder.
        path: PathBuf,
    },
    /// A later program wrote it.
    #[error("{} was written by a later version of this program ({got}, and this one reads up to {VERSION})", path.display())]
    Newer {
        /// The folder.
        path: PathBuf,
        /// Its version.
        got: u32,
    },
    /// The journal cannot be written on.
    #[error(transparent)]
    Journal(#[from] OpenError),
    /// The journal cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// What it tells makes no session.
    #[error(transparent)]
    Past(#[from] PastError),
}

/// An error of this file or folder.
pub(crate) fn at(path: &Path) -> impl Fn(io::Error) -> HomeError {
    let path = path.to_owned();
    move |source| HomeError::File {
        path: path.clone(),
        source,
    }
}

/// What the files of a folder take, bytes.
pub(crate) fn bytes_in(folder: &Path) -> u64 {
    let files = fs::read_dir(folder).into_iter().flatten();
    let lengths = files.filter_map(|file| Some(file.ok()?.metadata().ok()?.len()));
    lengths.sum()
}
