//! A recording read: what `teleclay-recording` writes, in its order or at any moment. Pure, so that programs and pages
//! read alike. Bytes come in, whoever has them; `docs/recording.md` says what is in a file.
//!
//! | module | holds |
//! |---|---|
//! | [`format`] | the words that a file is written in |
//! | `records` | a file as it comes, piece by piece, cut into records |
//! | `chunk` | the messages of a chunk |
//! | `channels` | what each channel tells |
//! | [`steps`] | tick by tick, for a replay |
//! | [`scene`] | a session at a moment: its tools, its settings, its clay |
//! | [`overview`] | the least and greatest of each quantity, along the whole recording |
//! | [`words`] | what is said of it and of a moment, as JSON |
//! | [`reel`] | all of a recording: read once from front to back, then shown at any moment |

pub mod format;
pub mod overview;
pub mod reel;
pub mod scene;
pub mod steps;
pub mod words;

mod channels;
mod chunk;
mod error;
mod records;

pub use error::ReadError;
pub use reel::{Reel, Want};
pub use steps::{CameIn, Recorded, Step, Ticked};
