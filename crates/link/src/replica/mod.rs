//! The replica: the handle's side holds a copy of the clay and cuts it at once; the server merges the same cuts and
//! stays the authority.
//!
//! A cut is a sweep between two quantised poses, and cutting takes the lesser occupancy voxel by voxel: commutative,
//! associative, idempotent. So it does not matter in which order sweeps arrive, how often, or by which way; it only
//! matters that each arrives. That is all that travels reliably here. A sweep mostly needs no repetition, for it goes
//! into several packets; and what was lost with all of them is known by its number from the first acknowledgement
//! behind it.
//!
//! On any line that lets a tenth of a frame a tick through, or a thirtieth where that drops what was overtaken, no
//! sweep waits longer than four round trips, a tenth of a second and what the two programs stand still for:
//! `tests/acknowledgement.rs` asks that of a thousand lines.
//!
//! | item | does |
//! |---|---|
//! | [`SweepLog`] | numbers the sweeps that one side makes and says which of them go into the next packet |
//! | [`SweepInbox`] | tells new sweeps from known ones and says what to acknowledge |
//! | [`Copy`] | the clay at the handle's side, with a tool in it, and corrections on their way into it |
//! | [`CorrectionLimiter`] | lets a correction of the copy change the felt force only slowly, and only with energy that cutting has earned |

mod copies;
mod copy;
mod correction_limiter;
mod inbox;
mod log;
mod wait;

pub use copy::{CORRECTIONS_WAITING, Copy, Cut, Edge, Impossible, ToolSetup, Worked};
pub use correction_limiter::{CorrectionLimiter, CorrectionLimits};
pub use inbox::{Novelty, SweepInbox};
pub use log::{LogFull, SweepLog};

/// Sweeps that may be under way: eight seconds of cutting at 1 kHz, four times what a stale copy is allowed to cut.
pub const WINDOW: usize = 8192;
