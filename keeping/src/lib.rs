//! Sessions on disk: what a server keeps of each while it runs, and what it begins with when it starts again.
//!
//! | module | holds |
//! |---|---|
//! | [`home`] | the folder of all sessions, and the lock that keeps other servers out |
//! | [`keeper`] | one session's history as its tick writes it |
//! | [`archive`] | the same as everybody else sees it: what is durable, how much it takes, snapshots |
//! | [`past`] | what was, read from what is on disk: a state, strokes, clay at a moment |
//! | [`rewrite`] | clay without a stroke or with one again, for a session that goes on cutting meanwhile |
//! | [`error`] | why sessions cannot be kept |
//! | `blocks` | blocks that no settings describe |

pub mod archive;
pub mod error;
pub mod home;
pub mod keeper;
pub mod past;
pub mod rewrite;

mod blocks;

pub use archive::{Archive, Depth, Storage, look_back};
pub use error::HomeError;
pub use home::{Home, folder_of};
pub use keeper::Keeper;
pub use past::{Past, PastError, Until};
pub use rewrite::{Rewrite, RewriteError, Wanted};
