//! Programs that do not run for a while.

use std::time::Duration;

use teleclay_link::time::Timestamp;

use super::Rig;

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

impl Rig {
    /// The program of the first handle stands still for `span`. The device goes on at the last command, the hand feels
    /// the last force.
    pub fn halt_handle(&mut self, how: Halt, span: Duration) {
        let until = self.now.after(span);
        self.hands[0].halt = Some(Halted { how, until });
    }

    /// The session's program stands still for `span`.
    pub fn halt_session(&mut self, how: Halt, span: Duration) {
        let until = self.now.after(span);
        self.halt = Some(Halted { how, until });
    }
}
