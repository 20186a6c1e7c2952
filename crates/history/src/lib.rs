//! The history of a session: what its records mean, and the session's state at any of them.
//!
//! | module | holds |
//! |---|---|
//! | [`record`] | what happened in a tick, as bytes |
//! | [`recorder`] | writes these from a session, tick by tick, without allocating |
//! | [`ledger`] | which tick is durable |
//! | [`strokes`] | which cuts belong together, and which of them were undone |
//! | [`replay`] | the state after any record, and clay without a stroke |
//! | [`state`] | that state as bytes: a snapshot |
//! | [`content`] | clay as bytes |
//!
//! Where records are kept is somebody else's business. *Snapshot and the records that follow it are the session*, bit
//! for bit: clay, settings, holders, revision and epochs (`tests/random.rs`). The motion of tools is not in them.
//!
//! Undo needs no inverse of a cut: the clay without a stroke is the block before it with everything else that was done,
//! in its order. Among cuts the order would not matter; where clay was added or smoothed it does.

pub mod content;
pub mod ledger;
pub mod record;
pub mod recorder;
pub mod replay;
pub mod state;
pub mod strokes;

mod bytes;
mod settings;

pub use bytes::Malformed;
pub use ledger::Ledger;
pub use record::{Fact, Record};
pub use recorder::Recorder;
pub use replay::{Replay, ReplayError};
pub use state::State;
pub use strokes::{Stroke, Strokes, Whose};
