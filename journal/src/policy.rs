//! How a journal is kept: sizes, times, and how much of it.

use std::time::Duration;

/// How a journal is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Policy {
    /// Bytes that a segment is given at once.
    pub segment_bytes: u64,
    /// Records that are not durable take at most so many bytes of memory.
    pub backlog_bytes: usize,
    /// A record is written and synced when it has waited for so long.
    pub commit_within: Duration,
    /// Bytes of history, see [`compact`](crate::compact).
    pub most_bytes: u64,
    /// Snapshots that are kept whatever they take.
    pub kept_snapshots: usize,
}

impl Default for Policy {
    fn default() -> Self {
        Self {
            // A minute and a half of one tool that cuts at 1 kHz.
            segment_bytes: 4 << 20,
            // Three minutes of it.
            backlog_bytes: 8 << 20,
            // As soon as the thread has looked, which it does seldom enough by itself.
            commit_within: Duration::ZERO,
            most_bytes: 1 << 30,
            // The older one stands should the newest be damaged.
            kept_snapshots: 2,
        }
    }
}
