//! What a network does to a bilateral loop, and what undoes it.
//!
//! Everything here is a state machine without sockets, clocks or threads: `now` and seeds are arguments, inputs are
//! `on_*` calls, outputs are return values. The same code runs in the virtual-time rig and in front of live traffic.
//!
//! | module | holds |
//! |---|---|
//! | [`time`] | the integer timestamps that all of it is written in |
//! | [`conditioner`] | delay, jitter, loss, bursts, duplicates, reordering, outages, from a seed |
//! | [`arrivals`] | what came, what was lost, what came twice; newest wins |
//! | [`deadband`] | which frames a hand would not miss |
//! | [`freshness`] | which frames are news, and which have waited in a queue |
//! | [`energy`] | tanks, cumulative counters, and an observer of a channel from outside |
//! | [`motion_limiter`] | where a tool may go in a tick |
//! | [`phase`] | when a tick is due, so that what it works on has waited little for it |
//! | [`playout`] | from varying delay to a constant one |
//! | [`replica`] | cuts that arrive in any order, and corrections bounded by energy |
//! | [`round_trip`] | round trip and clock offset from echoed stamps |
//! | [`safety`] | input check, watchdog ramp, the one limiter that every force passes |
//! | [`scheme`] | the coupling of the two sides, one module a scheme |

pub mod arrivals;
pub mod conditioner;
pub mod deadband;
pub mod energy;
pub mod freshness;
pub mod motion_limiter;
pub mod phase;
pub mod playout;
pub mod replica;
pub mod round_trip;
pub mod safety;
pub mod scheme;
pub mod time;

/// Three-vector in SI units; axes x, y, z of the clay frame.
pub type Vec3 = nalgebra::Vector3<f64>;
