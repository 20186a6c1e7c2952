//! Files that are whole or not there, and nobody else's to read.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

/// Why something that is kept cannot be had, or kept.
#[derive(Debug, thiserror::Error)]
pub enum DoorError {
    /// A file or folder.
    #[error("{}: {source}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file's content.
    #[error("{}: {reason}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A certificate cannot be made.
    #[error("no certificate can be made: {0}")]
    Certificate(#[from] rcgen::Error),
    /// There is no room for another invite.
    #[error("there are {most} invites, which is the limit: revoke some")]
    TooMany {
        /// The limit.
        most: usize,
    },
}

impl DoorError {
    pub(crate) fn content(path: &Path, reason: impl ToString) -> Self {
        Self::Content {
            path: path.to_owned(),
            reason: reason.to_string(),
        }
    }
}

/// Names the file that an error is about.
pub(crate) trait At<T> {
    fn at(self, path: &Path) -> Result<T, DoorError>;
}

impl<T> At<T> for io::Result<T> {
    fn at(self, path: &Path) -> Result<T, DoorError> {
        self.map_err(|source| DoorError::File {
            path: path.to_owned(),
            source,
        })
    }
}

/// The folder, made where it is not there.
pub(crate) fn folder(data: &Path) -> Result<PathBuf, DoorError> {
    let folder = data.join("doors");
    fs::DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(&folder)
        .at(&folder)?;
    Ok(folder)
}

/// The text of a file; nothing where there is none.
pub(crate) fn read(path: &Path) -> Result<Option<String>, DoorError> {
    match fs::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error).at(path),
    }
}

/// Puts `text` in place of what the file held, all of it or nothing, whatever fails meanwhile.
pub(crate) fn replace(path: &Path, text: &str) -> Result<(), DoorError> {
    let fresh = path.with_extension("new");
    let mut file = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .mode(0o600)
        .open(&fresh)
        .at(&fresh)?;
    file.write_all(text.as_bytes()).at(&fresh)?;
    file.sync_all().at(&fresh)?;
    fs::rename(&fresh, path).at(path)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    File::open(folder)
        .and_then(|folder| folder.sync_all())
        .at(folder)
}

/// Keeps other processes from what is done while the lock is held.
pub(crate) fn lock(path: &Path) -> Result<File, DoorError> {
    let file = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .open(path)
        .at(path)?;
    file.lock().at(path)?;
    Ok(file)
}

/// A folder of its own for a test.
#[cfg(test)]
pub(crate) fn test_folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("teleclay-doors-{name}-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    folder
}
