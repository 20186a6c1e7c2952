//! Why a recording cannot go on.

use mcap::McapError;

/// Why a recording cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file.
    #[error(transparent)]
    File(#[from] McapError),
    /// What came from the tick does not fit together.
    #[error("what came from the tick does not fit together: {0}")]
    Broken(String),
}
