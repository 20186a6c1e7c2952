//! What is known to be carved already.

use crate::pose::Pose;
use crate::sweep::Sweep;
use crate::tool::ToolShape;

/// What is known about the clay before a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    /// Nothing is known.
    Unknown,
    /// The same solid was carved at the sweep's start and nothing was put back since.
    Clear,
}

/// Solids known to be carved where tools last stopped: a sweep that starts there need not look behind itself. Kept per
/// tool, for as many tools as may work in turns.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cleared {
    places: [Option<(ToolShape, Pose)>; 8],
    next: usize,
}

impl Cleared {
    /// Says whether the sweep's start is clear, and notes that its end is going to be.
    pub(crate) fn advance(&mut self, sweep: &Sweep) -> Start {
        let end = Some((sweep.shape, sweep.to));
        let start = Some((sweep.shape, sweep.from));
        if let Some(place) = self.places.iter_mut().find(|place| **place == start) {
            *place = end;
            return Start::Clear;
        }
        self.places[self.next] = end;
        self.next = (self.next + 1) % self.places.len();
        Start::Unknown
    }
}
