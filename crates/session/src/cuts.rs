//! What was cut, for whoever keeps it: a journal, another node, clay that is to be exchanged.

use std::collections::VecDeque;

use teleclay_bilateral::CUTS_A_TICK;
use teleclay_clay::Operation;
use teleclay_link::replica::Cut;

/// Cuts that are remembered: an eighth of a second of eight tools that cut.
const REMEMBERED: usize = 1024;

/// What one tool has done to the clay in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolCuts<'a> {
    /// The tool's slot, from 0.
    pub slot: usize,
    /// The lease under which it was held.
    pub lease: u32,
    /// Every sweep of its handle up to this number has been merged or refused; 0 under a scheme without sweeps.
    pub decided: u32,
    /// What it did to the clay.
    pub operation: Operation,
    /// What it removed, added, or moved by smoothing, in units of 1/255 voxel.
    pub moved_units: u64,
    /// Its ways through the clay, in the order in which they were made.
    pub cuts: &'a [Cut],
}

/// Of one tool in the last tick: [`ToolCuts`], with the end of its cuts.
#[derive(Clone, Copy)]
struct Entry {
    slot: usize,
    lease: u32,
    decided: u32,
    operation: Operation,
    moved_units: u64,
    end: usize,
}

/// Cuts of the last tick by tool, and of some ticks before it.
pub(crate) struct Cuts {
    entries: Vec<Entry>,
    made: Vec<Cut>,
    /// With their ticks, oldest first.
    remembered: VecDeque<(u64, Operation, Cut)>,
    /// Everything made after this tick is remembered.
    complete_after: u64,
}

impl Cuts {
    /// None yet; ticks are counted on from `tick`.
    pub(crate) fn new(tools: usize, tick: u64) -> Self {
        Self {
            entries: Vec::with_capacity(tools),
            made: Vec::with_capacity(tools * CUTS_A_TICK),
            remembered: VecDeque::with_capacity(REMEMBERED),
            complete_after: tick,
        }
    }

    /// A tick begins.
    pub(crate) fn clear(&mut self) {
        self.entries.clear();
        self.made.clear();
    }

    /// A tool has worked in this tick.
    pub(crate) fn push(&mut self, tick: u64, tool: &ToolCuts<'_>) {
        self.made.extend_from_slice(tool.cuts);
        for cut in tool.cuts {
            if REMEMBERED <= self.remembered.len()
                && let Some((forgotten, ..)) = self.remembered.pop_front()
            {
                self.complete_after = forgotten;
            }
            self.remembered.push_back((tick, tool.operation, *cut));
        }
        self.entries.push(Entry {
            slot: tool.slot,
            lease: tool.lease,
            decided: tool.decided,
            operation: tool.operation,
            moved_units: tool.moved_units,
            end: self.made.len(),
        });
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = ToolCuts<'_>> {
        self.entries.iter().scan(0, |start, entry| {
            let cuts = &self.made[*start..entry.end];
            *start = entry.end;
            Some(ToolCuts {
                slot: entry.slot,
                lease: entry.lease,
                decided: entry.decided,
                operation: entry.operation,
                moved_units: entry.moved_units,
                cuts,
            })
        })
    }

    /// Everything that was done after a tick, in its order; `None` where that is not remembered.
    pub(crate) fn after(
        &self,
        tick: u64,
    ) -> Option<impl ExactSizeIterator<Item = (Operation, Cut)>> {
        let first = self.remembered.partition_point(|(made, ..)| *made <= tick);
        let since = || self.remembered.range(first..);
        (self.complete_after <= tick).then(|| since().map(|(_, operation, cut)| (*operation, *cut)))
    }
}
