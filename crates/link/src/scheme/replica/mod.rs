//! The replica: the handle's side holds a copy of the clay and cuts it at once, so the hand feels no network; the
//! server merges the same cuts and stays the authority. Cuts that need no order: see [`crate::replica`]. Known before:
//! replicated haptic clay [G06], teleoperation by way of a model at the near side [MN08]; both in docs/papers.md.
//!
//! ```text
//! handle   tool at A_h1 y_h in the copy, now     cut -> SweepLog      felt = limited(answer of the copy) / |A_h2|
//! up       sweeps not acknowledged, state of the copy
//! tool     each new sweep: checked, merged, its own answer computed        refused with a reason where it cannot have been
//! down     acknowledged up to, hash of the clay, sweeps of other tools
//! ```
//!
//! Without a copy (it has not come yet; the block is another one) both ends run [`tdpa`](super::tdpa), which needs
//! none. The tool then stands where tdpa left it, and a copy takes over from there: the tool goes to the handle's place
//! through the clay, at recovery speed.
//!
//! # Silence
//!
//! The copy needs no frames to be felt, so the watchdog does not take its force away. But it may be cut only while
//! somebody merges the cuts: after [`STALE`] without a frame, or with the log full, the tool goes blunt: it cuts
//! nothing, and says so. In a silence that lasts so long, the handle side lets its force fade.
//!
//! # Differences
//!
//! Both sides know a hash of their clay. When nothing is under way that changed any, the two must be equal; a refused
//! sweep makes them differ at once. Then a snapshot of the server's clay is asked for
//! ([`ReplicaHandle::wanted_snapshot`]). It is as old as the line is long; so every cut of which the snapshot may not
//! know is repeated on it, newest first.
//!
//! # What it cannot do
//!
//! It hides the network from the hand, not from the clay: what others cut is felt a delay late, and two tools in one
//! place can cut the same clay for one delay, each feeling all of it. What the server's tool meets then differs from
//! what was felt (`hidden_force` of the tool's controller says by how much). It assumes one tool shape a session, and
//! clay that does nothing by itself.

mod handle;
mod tool;

use std::time::Duration;

pub use handle::{ReplicaHandle, Snapshot, WantedSnapshot};
pub use tool::{MergeContext, Merged, ReplicaTool};

/// A copy that heard nothing for this long is not cut any more. A quarter of what the log holds at 1 kHz.
pub const STALE: Duration = Duration::from_secs(2);
