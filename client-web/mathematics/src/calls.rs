//! Calls from JavaScript, which passes and takes nothing but numbers: whatever is longer lies in buffers of the module.
//!
//! What a call is to look at is written into [`Buffer::NumbersIn`] first; what it found lies in [`Buffer::Numbers`]
//! until the next call. Memory moves when it grows, so a buffer is asked for its address each time. The TypeScript side
//! is `client-web/src/protocol/mathematics.ts`; the two change together.

use crate::theory::{Refused, Theory, arms};

/// All that a module holds.
#[derive(Default)]
pub struct Mathematics {
    numbers_in: Vec<f64>,
    numbers: Vec<f64>,
    refusal: String,
    theory: Theory,
}

/// A stretch of memory that both sides know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Buffer {
    /// `f64`: what a call is to look at.
    NumbersIn,
    /// `f64`: what a call found.
    Numbers,
    /// UTF-8: why a call was refused.
    Refusal,
}

/// The call was carried out.
pub const DONE: u32 = 0;
/// The call was refused, and [`Buffer::Refusal`] says why.
pub const REFUSED: u32 = 1;

impl Buffer {
    /// By the number that JavaScript gives it.
    #[must_use]
    pub fn numbered(number: u32) -> Option<Self> {
        const ALL: [Buffer; 3] = [Buffer::NumbersIn, Buffer::Numbers, Buffer::Refusal];
        ALL.get(number as usize).copied()
    }
}

impl Mathematics {
    /// Makes room for so many numbers.
    pub fn resize_numbers_in(&mut self, length: usize) {
        self.numbers_in.resize(length, 0.0);
    }

    /// The numbers that are to be looked at.
    pub fn numbers_in(&mut self) -> &mut [f64] {
        &mut self.numbers_in
    }

    /// What the last call found.
    #[must_use]
    pub fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// Why the last call that was refused was.
    #[must_use]
    pub fn refusal(&self) -> &str {
        &self.refusal
    }

    /// Where a buffer begins.
    #[must_use]
    pub fn address(&self, buffer: Buffer) -> *const u8 {
        match buffer {
            Buffer::NumbersIn => self.numbers_in.as_ptr().cast(),
            Buffer::Numbers => self.numbers.as_ptr().cast(),
            Buffer::Refusal => self.refusal.as_ptr(),
        }
    }

    /// How many elements of its kind a buffer has.
    #[must_use]
    pub fn length(&self, buffer: Buffer) -> usize {
        match buffer {
            Buffer::NumbersIn => self.numbers_in.len(),
            Buffer::Numbers => self.numbers.len(),
            Buffer::Refusal => self.refusal.len(),
        }
    }

    /// Takes the loop that the numbers describe, as [`Theory::set_loop`] reads them.
    pub fn set_loop(&mut self) -> u32 {
        let outcome = self.theory.set_loop(&self.numbers_in);
        self.outcome(outcome)
    }

    /// What the loop does, in numbers: [`Theory::outlook`].
    pub fn find_outlook(&mut self, scheme: u32, round_trip_s: f64) -> u32 {
        let outlook = self.theory.outlook(scheme, round_trip_s);
        let outcome = outlook.map(|outlook| {
            self.numbers.clear();
            self.numbers.extend(outlook);
        });
        self.outcome(outcome)
    }

    /// The loop gain, in numbers: [`Theory::curve`].
    pub fn find_curve(&mut self, scheme: u32, round_trip_s: f64) -> u32 {
        let outcome = self.theory.curve(scheme, round_trip_s, &mut self.numbers);
        self.outcome(outcome)
    }

    /// The robot's arms, in numbers: [`arms`].
    pub fn find_arms(&mut self) -> u32 {
        let outcome = arms(&self.numbers_in, &mut self.numbers);
        self.outcome(outcome)
    }

    fn outcome(&mut self, outcome: Result<(), Refused>) -> u32 {
        match outcome {
            Ok(()) => DONE,
            Err(error) => {
                self.refusal = error.to_string();
                REFUSED
            }
        }
    }
}
