//! What both programs need around their pure loop: a monotonic clock, a 1 kHz thread on absolute deadlines, the rings
//! between such a thread and everybody else, Zenoh sessions that open nothing they were not told to open, the
//! certificates that some of them show, and the log.

pub mod beside;
pub mod certificate;
mod clock;
pub mod endpoint;
pub mod log;
pub mod network;
pub mod realtime;
pub mod ticker;

pub use clock::{Clock, Drift, DriftError};
