//! Recordings of sessions: MCAP files with the profile `ros2`, that explain themselves and from which the loop can be
//! run again. `docs/recording.md` says what is in a file.
//!
//! | module | holds |
//! |---|---|
//! | [`tap`] | what leaves the tick, without waiting or allocating |
//! | [`scribe`] | makes messages of that and writes them |
//! | [`shelf`] | the recordings of a server: a thread and a file for each that runs |
//!
//! What reads it is `teleclay-reel`.
//!
//! ```text
//! tick thread          recording's thread
//! Tap::on_tick  >  Feed ─> Scribe ─> file, synced each second
//! ```

pub mod scribe;
pub mod shelf;
pub mod tap;

mod base;
mod error;
mod messages;
mod tick;

pub use error::WriteError;
pub use scribe::{About, Diagnose, Scribe};
pub use shelf::{Shelf, ShelfError};
pub use tap::{Feed, Tap};
