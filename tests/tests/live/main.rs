//! Server and handles as real processes over real Zenoh. Nothing here sleeps to let something happen: every wait is for
//! a condition, and has a deadline.

#![allow(
    clippy::float_cmp,
    reason = "a force that is released is zero, a tool that is held stands still, neither nearly so"
)]
#![allow(clippy::print_stdout, reason = "how long things took is a result, too")]

mod agreement;
mod backlog;
mod changing;
mod doors;
mod encrypted;
mod endings;
mod held;
mod kept;
mod many;
mod network;
mod on_virtual_time;
mod robot;
mod rotation;
mod sharing;
mod soak;
mod stopping;
mod strangers;
