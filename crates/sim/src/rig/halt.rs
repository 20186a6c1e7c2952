//! Programs that do not run for a while.

use teleclay_link::time::Timestamp;

/// How an end of the loop stands still.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Halt {
    /// Its 1 kHz thread is starved. What comes meanwhile is stamped as it comes, and taken in by the next tick.
    Thread,
    /// The whole program is stopped. What comes meanwhile waits outside, and is stamped when the program goes on.
    Program,
}

/// An end of the loop that stands still.
#[derive(Clone, Copy, Debug)]
pub(super) struct Halted {
    pub(super) how: Halt,
    pub(super) until: Timestamp,
}

/// The halt is over: what came before this instant has been noticed only now.
pub(super) fn noticed_since(halt: &mut Option<Halted>) -> Timestamp {
    match halt.take() {
        Some(Halted {
            how: Halt::Program,
            until,
        }) => until,
        _ => Timestamp::ZERO,
    }
}
