//! The handle against a server over real Zenoh on loopback, in one process. Nothing here sleeps: every wait is for
//! something to happen.

mod allocations;
mod holder;
mod joining;
mod losing;
mod server;

use std::time::Duration;

/// Whatever is waited for happens within this, on a machine that does ten other things; what does not happen fails the
/// test.
const PATIENCE: Duration = Duration::from_secs(60);
