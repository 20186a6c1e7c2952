//! Why a file cannot be read.

use mcap::McapError;
use teleclay_history::Malformed;
use teleclay_ros::CdrError;

/// Why a file is no recording, or no further readable.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It begins otherwise than files of MCAP do.
    #[error("this is no MCAP file: it begins otherwise")]
    NotMcap,
    /// It is damaged.
    #[error("the file is damaged: {0}")]
    File(McapError),
    /// A chunk is compressed otherwise than recordings are.
    #[error("its chunks are compressed as `{got}`, and recordings are by lz4 or not at all")]
    Compression {
        /// The name of the compression.
        got: String,
    },
    /// A chunk is longer than any that is written.
    #[error("a chunk of {got} bytes is too large: recordings have none beyond {want}")]
    ChunkTooLarge {
        /// Bytes, decompressed.
        got: u64,
        /// The most that are read.
        want: u64,
    },
    /// A chunk is damaged.
    #[error("a chunk is damaged: {why}")]
    Chunk {
        /// What is wrong with it.
        why: String,
    },
    /// A message is damaged.
    #[error("a message on {topic} cannot be read: {error}")]
    Message {
        /// Its topic.
        topic: String,
        /// What is wrong with its bytes.
        error: CdrError,
    },
    /// A state in it.
    #[error("a state in it: {0}")]
    State(Malformed),
    /// A record of its history.
    #[error("a record of its history: {0}")]
    Record(Malformed),
    /// It is of other things.
    #[error("this MCAP file is no recording of a session: it has no topic of ticks and clay")]
    NotOurs,
    /// It has messages outside of chunks.
    #[error("its messages stand outside of chunks, so no moment of it can be looked up")]
    Unchunked,
    /// Nobody has read it to its end yet.
    #[error("moment {at_s} s is not read yet")]
    NotYet {
        /// The moment.
        at_s: f64,
    },
}

impl From<McapError> for ReadError {
    fn from(error: McapError) -> Self {
        Self::File(error)
    }
}
