//! Strokes: which cuts belong together, and which of them were undone.
//!
//! A stroke begins where a tool removes clay and has removed none for [`GAP_TICKS`], or was taken, or stands in a fresh
//! block. All that the tool passes through from then on until its next stroke begins belongs to it, removed or not: a
//! pass through a groove that it has cut goes with the groove. What a tool clears where it stands before its hand is
//! heard belongs to no stroke.

use std::collections::VecDeque;
use std::sync::Arc;

use teleclay_session::{Exchange, Operator};

use crate::bytes::{Malformed, Reader, put_number, put_text};

/// A tool that has removed nothing for so many ticks begins a new stroke with what it removes next: a hand that lifts
/// off and sets down again takes longer.
pub const GAP_TICKS: u64 = 250;
/// A stroke is undone as of a tick that lies no further back than this.
pub const UNDONE_WITHIN_TICKS: u64 = 1000;
/// What belongs to no stroke.
pub const NONE: u64 = 0;

/// A stroke.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stroke {
    /// Its number, from 1.
    pub number: u64,
    /// The tool's slot, from 0.
    pub slot: usize,
    /// Who held the tool.
    pub operator: Arc<str>,
    /// Tick of the first cut that removed clay.
    pub from_tick: u64,
    /// Tick of the last one.
    pub to_tick: u64,
    /// What it removed when it was cut, in units of 1/255 voxel.
    pub removed_units: u64,
    /// Whether it was undone.
    pub is_undone: bool,
}

/// Whose stroke is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Whose<'a> {
    /// Of any tool and operator.
    Anybodys,
    /// Of the tool in this slot.
    Tools(usize),
    /// Of this operator.
    Operators(&'a str),
}

/// What a tool is at.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Present {
    /// The stroke to which what it passes through belongs; 0 for none.
    stroke: u64,
    /// When it removed how much of late, oldest first.
    recent: VecDeque<(u64, u64)>,
}

/// Cuts that belong to another stroke than was thought: those of `stroke` after a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moved {
    /// The stroke that was undone.
    pub stroke: u64,
    /// Up to this tick its cuts were.
    pub after_tick: u64,
    /// The stroke that they belong to; 0 for none.
    pub to: u64,
}

/// The strokes of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Strokes {
    list: Vec<Stroke>,
    /// By slot.
    present: Vec<Present>,
    /// Those that are undone, the last one last.
    undone: Vec<u64>,
    /// The first stroke of the present block.
    block_from: u64,
}

impl Strokes {
    /// None yet, of so many tools.
    #[must_use]
    pub fn new(tools: usize) -> Self {
        Self {
            list: Vec::new(),
            present: vec![Present::default(); tools],
            undone: Vec::new(),
            block_from: 1,
        }
    }

    /// Every stroke, oldest first, those of earlier blocks too.
    #[must_use]
    pub fn list(&self) -> &[Stroke] {
        &self.list
    }

    /// A stroke by its number.
    #[must_use]
    pub fn stroke(&self, number: u64) -> Option<&Stroke> {
        let index = usize::try_from(number.checked_sub(1)?).ok()?;
        self.list.get(index)
    }

    /// Number of the next stroke.
    #[must_use]
    pub fn next(&self) -> u64 {
        self.list.len() as u64 + 1
    }

    /// First number of the present block: strokes of earlier ones cannot be undone.
    #[must_use]
    pub const fn block_from(&self) -> u64 {
        self.block_from
    }

    /// The last stroke that can be undone.
    #[must_use]
    pub fn to_undo(&self, whose: Whose<'_>) -> Option<u64> {
        let strokes = self.list.iter().rev();
        let mut block = strokes.take_while(|stroke| self.block_from <= stroke.number);
        block
            .find(|stroke| !stroke.is_undone && whose.is_of(stroke))
            .map(|stroke| stroke.number)
    }

    /// The stroke that was undone last and can be redone.
    #[must_use]
    pub fn to_redo(&self, whose: Whose<'_>) -> Option<u64> {
        let mut undone = self.undone.iter().rev().copied();
        undone.find(|number| {
            self.block_from <= *number
                && self
                    .stroke(*number)
                    .is_some_and(|stroke| whose.is_of(stroke))
        })
    }

    /// Whether an exchange can be made: its stroke is of the present block, and not already so.
    #[must_use]
    pub fn admits(&self, exchange: Exchange) -> bool {
        let (number, is_undone) = match exchange {
            Exchange::Undone { stroke } => (stroke, false),
            Exchange::Redone { stroke } => (stroke, true),
            Exchange::UndoneSince { stroke } => return self.block_from <= stroke,
        };
        let stroke = self.stroke(number);
        self.block_from <= number && stroke.is_some_and(|stroke| stroke.is_undone == is_undone)
    }

    /// Whether a stroke counts after an exchange, or as things are.
    #[must_use]
    pub fn counts(&self, number: u64, after: Option<Exchange>) -> bool {
        let is_undone = self.stroke(number).is_some_and(|stroke| stroke.is_undone);
        number == NONE
            || match after {
                Some(Exchange::Undone { stroke }) => !is_undone && number != stroke,
                Some(Exchange::UndoneSince { stroke }) => !is_undone && number < stroke,
                Some(Exchange::Redone { stroke }) => !is_undone || number == stroke,
                None => !is_undone,
            }
    }

    /// A tool has cut in a tick, and removed so much. Gives the stroke to which that belongs.
    pub fn on_cuts(
        &mut self,
        tick: u64,
        slot: usize,
        operator: Option<&Operator>,
        removed_units: u64,
    ) -> u64 {
        let next = self.next();
        let Some(present) = self.present.get_mut(slot) else {
            return NONE;
        };
        if removed_units == 0 {
            return present.stroke;
        }
        let last = present.recent.back().map(|(tick, _)| *tick);
        let goes_on = present.stroke != NONE
            && last.is_some_and(|last| tick.saturating_sub(last) <= GAP_TICKS);
        if !goes_on {
            present.stroke = next;
            present.recent.clear();
            self.list.push(Stroke {
                number: next,
                slot,
                operator: operator.map_or("", |operator| &operator.name).into(),
                from_tick: tick,
                to_tick: tick,
                removed_units: 0,
                is_undone: false,
            });
        }
        present.recent.push_back((tick, removed_units));
        while present
            .recent
            .front()
            .is_some_and(|(first, _)| first + UNDONE_WITHIN_TICKS < tick)
        {
            present.recent.pop_front();
        }
        let number = present.stroke;
        if let Some(stroke) = self.list.get_mut(number as usize - 1) {
            stroke.to_tick = tick;
            stroke.removed_units += removed_units;
        }
        number
    }

    /// Another operator holds a tool, or nobody does.
    pub fn on_other_holder(&mut self, slot: usize) {
        if let Some(present) = self.present.get_mut(slot) {
            *present = Present::default();
        }
    }

    /// A fresh block stands in place of the one that was cut.
    pub fn on_fresh_block(&mut self) {
        self.block_from = self.next();
        self.present.fill(Present::default());
        self.undone.clear();
    }

    /// Clay was exchanged as of a tick. A stroke that was undone while it was being cut ends there; what was cut after
    /// is another one. Gives the cuts that belong elsewhere by that.
    pub fn on_exchange(&mut self, exchange: Exchange, as_of_tick: u64) -> Vec<Moved> {
        match exchange {
            Exchange::Redone { stroke } => {
                self.undone.retain(|number| *number != stroke);
                self.mark(stroke, false);
                Vec::new()
            }
            Exchange::Undone { stroke } => self.undo(stroke, as_of_tick).into_iter().collect(),
            Exchange::UndoneSince { stroke } => (stroke.max(self.block_from)..self.next())
                .filter_map(|number| self.undo(number, as_of_tick))
                .collect(),
        }
    }

    fn undo(&mut self, number: u64, as_of_tick: u64) -> Option<Moved> {
        if !self.counts(number, None) || number == NONE {
            return None;
        }
        self.mark(number, true);
        self.undone.push(number);
        let slot = self.stroke(number)?.slot;
        let present = self.present.get_mut(slot)?;
        if present.stroke != number {
            return None;
        }
        let first = present
            .recent
            .partition_point(|(tick, _)| *tick <= as_of_tick);
        let since: VecDeque<(u64, u64)> = present.recent.split_off(first);
        let last_before = present.recent.back().map(|(tick, _)| *tick);
        *present = Present::default();
        let removed_since: u64 = since.iter().map(|(_, removed)| removed).sum();
        let index = number as usize - 1;
        let of_undone = self.list[index].clone();
        self.list[index].removed_units -= removed_since;
        if let (Some(last_before), false) = (last_before, since.is_empty()) {
            self.list[index].to_tick = last_before;
        }
        let mut moved = Moved {
            stroke: number,
            after_tick: as_of_tick,
            to: NONE,
        };
        if let (Some((from_tick, _)), Some((to_tick, _))) = (since.front(), since.back()) {
            moved.to = self.next();
            self.list.push(Stroke {
                number: moved.to,
                from_tick: *from_tick,
                to_tick: *to_tick,
                removed_units: removed_since,
                is_undone: false,
                ..of_undone
            });
            self.present[slot] = Present {
                stroke: moved.to,
                recent: since,
            };
        }
        Some(moved)
    }

    fn mark(&mut self, number: u64, is_undone: bool) {
        let index = (number as usize).checked_sub(1);
        if let Some(stroke) = index.and_then(|index| self.list.get_mut(index)) {
            stroke.is_undone = is_undone;
        }
    }

    pub(crate) fn put(&self, out: &mut Vec<u8>) {
        put_number(out, self.block_from);
        put_number(out, self.list.len() as u64);
        for stroke in &self.list {
            put_number(out, stroke.slot as u64);
            put_text(out, stroke.operator.as_bytes());
            put_number(out, stroke.from_tick);
            put_number(out, stroke.to_tick);
            put_number(out, stroke.removed_units);
            out.push(stroke.is_undone.into());
        }
        put_number(out, self.undone.len() as u64);
        self.undone
            .iter()
            .for_each(|number| put_number(out, *number));
        put_number(out, self.present.len() as u64);
        for present in &self.present {
            put_number(out, present.stroke);
            put_number(out, present.recent.len() as u64);
            for (tick, removed) in &present.recent {
                put_number(out, *tick);
                put_number(out, *removed);
            }
        }
    }

    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, Malformed> {
        const WHAT: &str = "strokes";
        let mut strokes = Self::new(0);
        strokes.block_from = reader.number(WHAT)?;
        for _ in 0..reader.number(WHAT)? {
            let stroke = Stroke {
                number: strokes.next(),
                slot: reader.small::<u8>(WHAT)?.into(),
                operator: reader.string(WHAT)?.into(),
                from_tick: reader.number(WHAT)?,
                to_tick: reader.number(WHAT)?,
                removed_units: reader.number(WHAT)?,
                is_undone: reader.byte(WHAT)? != 0,
            };
            strokes.list.push(stroke);
        }
        for _ in 0..reader.number(WHAT)? {
            strokes.undone.push(reader.number(WHAT)?);
        }
        for _ in 0..reader.number(WHAT)? {
            let mut present = Present {
                stroke: reader.number(WHAT)?,
                recent: VecDeque::new(),
            };
            let is_there = present.stroke < strokes.next();
            for _ in 0..reader.number(WHAT)? {
                let (tick, removed) = (reader.number(WHAT)?, reader.number(WHAT)?);
                present.recent.push_back((tick, removed));
            }
            if !is_there {
                let got = present.stroke;
                return Err(Malformed::Value { what: WHAT, got });
            }
            strokes.present.push(present);
        }
        Ok(strokes)
    }
}

impl Whose<'_> {
    fn is_of(self, stroke: &Stroke) -> bool {
        match self {
            Self::Anybodys => true,
            Self::Tools(slot) => stroke.slot == slot,
            Self::Operators(name) => &*stroke.operator == name,
        }
    }
}
