//! Calls from JavaScript, which passes and takes nothing but numbers: whatever is longer lies in buffers of the module.
//!
//! What a call is to look at is written into [`Buffer::BytesIn`] first; what it found lies in others until the next
//! call of its kind. Memory moves when it grows, so a buffer is asked for its address each time. The TypeScript side is
//! `client-web/src/protocol/film_module.ts`; the two change together.

use std::collections::VecDeque;

use teleclay_reel::overview::Extremes;
use teleclay_reel::{ReadError, Reel, words};

use crate::bricks::Told;

/// All that a module holds: one recording.
#[derive(Default)]
pub struct Film {
    reel: Reel,
    told: Told,
    bytes_in: Vec<u8>,
    text: Vec<u8>,
    numbers: Vec<f64>,
    envelope: Vec<f32>,
    waiting: VecDeque<Vec<u8>>,
    bricks: Vec<u8>,
}

/// A stretch of memory that both sides know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Buffer {
    /// A piece of the file, as it came.
    BytesIn,
    /// UTF-8: what a call found, as JSON, or why it was refused.
    Text,
    /// `f64`: where what is wanted begins in the file, and its bytes.
    Numbers,
    /// `f32`: the least and the greatest of each column; the first is above the second where there is none.
    Envelope,
    /// A message of bricks.
    Bricks,
}

/// The call was carried out.
pub const DONE: u32 = 0;
/// The call was carried out, and more of the file is needed: [`Buffer::Numbers`] say what. Or: there is a message.
pub const MORE: u32 = 1;
/// The call was refused, and [`Buffer::Text`] says why.
pub const REFUSED: u32 = 2;

impl Buffer {
    /// By the number that JavaScript gives it.
    #[must_use]
    pub fn numbered(number: u32) -> Option<Self> {
        const ALL: [Buffer; 5] = [
            Buffer::BytesIn,
            Buffer::Text,
            Buffer::Numbers,
            Buffer::Envelope,
            Buffer::Bricks,
        ];
        ALL.get(number as usize).copied()
    }
}

impl Film {
    /// Where a buffer begins.
    #[must_use]
    pub fn address(&self, buffer: Buffer) -> *const u8 {
        match buffer {
            Buffer::BytesIn => self.bytes_in.as_ptr(),
            Buffer::Text => self.text.as_ptr(),
            Buffer::Numbers => self.numbers.as_ptr().cast(),
            Buffer::Envelope => self.envelope.as_ptr().cast(),
            Buffer::Bricks => self.bricks.as_ptr(),
        }
    }

    /// How many elements of its kind a buffer has.
    #[must_use]
    pub fn length(&self, buffer: Buffer) -> usize {
        match buffer {
            Buffer::BytesIn => self.bytes_in.len(),
            Buffer::Text => self.text.len(),
            Buffer::Numbers => self.numbers.len(),
            Buffer::Envelope => self.envelope.len(),
            Buffer::Bricks => self.bricks.len(),
        }
    }

    /// Makes room for a piece of so many bytes.
    pub fn resize_bytes_in(&mut self, length: usize) {
        self.bytes_in.resize(length, 0);
    }

    /// The piece that is to be looked at.
    pub fn bytes_in(&mut self) -> &mut [u8] {
        &mut self.bytes_in
    }

    /// What a call found, or why it was refused.
    #[must_use]
    pub fn text(&self) -> &str {
        str::from_utf8(&self.text).unwrap_or_default()
    }

    /// Where what is wanted begins, and its bytes.
    #[must_use]
    pub fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// The message of bricks that came last.
    #[must_use]
    pub fn bricks(&self) -> &[u8] {
        &self.bricks
    }

    /// The columns that were found last.
    #[must_use]
    pub fn envelope(&self) -> &[f32] {
        &self.envelope
    }

    /// Takes in the next piece of the file; an empty one is its end.
    pub fn push(&mut self) -> u32 {
        let outcome = self.reel.push(&self.bytes_in);
        self.answer(outcome)
    }

    /// Sets out for a moment, s since the recording began.
    pub fn seek(&mut self, at_s: f64) -> u32 {
        let after_ns = (at_s.max(0.0) * 1e9).round() as u64;
        let outcome = self
            .reel
            .seek(self.reel.facts().from_ns.saturating_add(after_ns));
        self.answer_with_want(outcome)
    }

    /// Takes in what was wanted.
    pub fn give(&mut self) -> u32 {
        let outcome = self.reel.give(&self.bytes_in);
        self.answer_with_want(outcome)
    }

    /// Tells all that is known of the recording, and what happened from the mark of that number on.
    pub fn tell_recording(&mut self, first_mark: u32) {
        self.text = words::of_recording(&self.reel, first_mark as usize)
            .to_string()
            .into_bytes();
    }

    /// Tells the moment on show.
    pub fn tell_moment(&mut self) {
        let from_ns = self.reel.facts().from_ns;
        self.text = words::of_moment(from_ns, self.reel.scene())
            .to_string()
            .into_bytes();
    }

    /// Finds the extremes of a quantity of a tool, from 1, between two moments, in so many columns.
    pub fn find_envelope(&mut self, tool: u32, quantity: u32, from_s: f64, to_s: f64, count: u32) {
        let first_ns = self.reel.facts().from_ns;
        let moment = |at_s: f64| first_ns.saturating_add((at_s.max(0.0) * 1e9).round() as u64);
        let slot = (tool as usize).saturating_sub(1);
        let span = [moment(from_s), moment(to_s)];
        let count = (count as usize).min(teleclay_reel::overview::COLUMNS);
        let found = self.reel.overview().map_or_else(Vec::new, |overview| {
            overview.envelope(slot, quantity as usize, span, count)
        });
        self.envelope.clear();
        let pair = |Extremes { least, greatest }| [least, greatest];
        self.envelope.extend(found.into_iter().flat_map(pair));
    }

    /// Makes messages of what the clay on show has that was not told yet.
    pub fn tell_clay(&mut self) -> u32 {
        let scene = self.reel.scene();
        let epoch = scene.clay_epoch();
        let Some(clay) = scene.clay() else {
            return DONE;
        };
        match self.told.tell(clay, epoch) {
            Ok(messages) => {
                self.waiting.extend(messages);
                DONE
            }
            Err(error) => {
                self.text = error.to_string().into_bytes();
                REFUSED
            }
        }
    }

    /// Puts the next of these messages into [`Buffer::Bricks`]; [`DONE`] when there is none.
    pub fn next_bricks(&mut self) -> u32 {
        match self.waiting.pop_front() {
            Some(message) => {
                self.bricks = message;
                MORE
            }
            None => DONE,
        }
    }

    fn answer_with_want(&mut self, outcome: Result<(), ReadError>) -> u32 {
        let answer = self.answer(outcome);
        match self.reel.want() {
            Some(want) if answer == DONE => {
                self.numbers.clear();
                self.numbers
                    .extend([want.offset as f64, want.length as f64]);
                MORE
            }
            _ => answer,
        }
    }

    fn answer(&mut self, outcome: Result<(), ReadError>) -> u32 {
        match outcome {
            Ok(()) => DONE,
            Err(error) => {
                self.text = error.to_string().into_bytes();
                REFUSED
            }
        }
    }
}
