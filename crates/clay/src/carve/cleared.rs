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
    places: [Option<(Solid, Pose)>; 8],
    next: usize,
}

/// What a solid is known by.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Solid {
    Shape(ToolShape),
    /// By its digest.
    Mesh(u64),
}

impl Cleared {
    /// Says whether the sweep's start is clear, and notes that its end is going to be.
    pub(crate) fn advance(&mut self, sweep: &Sweep) -> Start {
        self.advance_solid(Solid::Shape(sweep.shape), sweep.from, sweep.to)
    }

    /// The same of a mesh.
    pub(crate) fn advance_mesh(&mut self, digest: u64, from: Pose, to: Pose) -> Start {
        self.advance_solid(Solid::Mesh(digest), from, to)
    }

    fn advance_solid(&mut self, solid: Solid, from: Pose, to: Pose) -> Start {
        let end = Some((solid, to));
        let start = Some((solid, from));
        if let Some(place) = self.places.iter_mut().find(|place| **place == start) {
            *place = end;
            return Start::Clear;
        }
        self.places[self.next] = end;
        self.next = (self.next + 1) % self.places.len();
        Start::Unknown
    }
}
