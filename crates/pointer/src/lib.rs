//! The handle side of the loop for a pointer: a mouse, a finger or a pen on a page. A pure machine, for whoever wakes
//! it.
//!
//! ```text
//! samples ──> coupling ──> HandleSide ──> brake ──> guard ──> the loop's handle, and the coupling again
//!                            ^      └──> frames, sealed, several to a message
//! frames, opened ────────────┘
//! ```
//!
//! | item | is |
//! |---|---|
//! | [`Pointer`] | the machine: what came goes in with its time, [`Pointer::advance`] makes the ticks that are owed |
//! | [`Grant`], [`Refused`] | what a server grants, as far as a pointer takes it, and why it takes none |
//! | [`PointerSetup`], [`PROFILE`] | what the device is, and what it may do to a hand |
//! | [`View`], [`Wanted`] | what there is to draw, and to ask the server for |
//! | [`Deadlines`] | which ticks are owed |
//! | [`MadePath`] | a hand's path as a page tells it, for tests |
//!
//! It holds the law of `teleclay-handle`, with the same parts of other rooms. Time is an argument, in nanoseconds of
//! the caller's own clock; no tick allocates, and the same calls give the same bits on every machine.

mod deadlines;
mod grant;
mod inbox;
mod machine;
mod path;
mod renewal;
mod snapshot;
mod view;

pub use deadlines::{Deadlines, MOST_AT_ONCE, Owed};
pub use grant::{Grant, PROFILE, PointerSetup, Refused};
pub use machine::{Advanced, Pointer};
pub use path::MadePath;
pub use view::{Counts, Mode, View, Wanted};
