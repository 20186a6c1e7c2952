//! The words that a recording is written in, for whoever writes and whoever reads.

/// `format` of a clay message with the whole state, clay included.
pub const STATE: &str = "teleclay/state";
/// `format` of a clay message with nothing but the hash.
pub const HASH: &str = "hash";
/// Last word of the topic that says whether cuts could be kept.
pub const STORAGE: &str = "storage";
/// What it says while they could.
pub const READY: &str = "ready";
/// What it says while they could not.
pub const FULL: &str = "full";
/// Name of the metadata record at a file's end.
pub const METADATA: &str = "teleclay.recording";
/// Last words of the topics that show a tool, in the order in which they are told.
pub const SHOWN: [&str; 10] = [
    "handle_pose",
    "tool_pose",
    "handle_twist",
    "tool_twist",
    "hand_wrench",
    "felt_wrench",
    "tool_wrench",
    "link",
    "energy",
    "corrections",
];
