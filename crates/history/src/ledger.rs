//! Which tick is durable, by the numbers of the records that tell of it.

use std::collections::VecDeque;

/// Records that wait, at most: four seconds of them.
const WAITING: usize = 4096;

/// Keeps in mind which record tells of which tick, until it is durable. Allocates nothing after it was made.
///
/// ```
/// # use teleclay_history::Ledger;
/// let mut ledger = Ledger::new();
/// ledger.push(1, 10);
/// ledger.push(2, 12);
/// assert_eq!(ledger.durable_tick(0, 15), 9);
/// assert_eq!(ledger.durable_tick(1, 15), 11);
/// // Where no record waits, nothing has happened that is not durable.
/// assert_eq!(ledger.durable_tick(2, 15), 15);
/// ```
#[derive(Clone, Debug)]
pub struct Ledger {
    /// Number and tick, oldest first.
    waiting: VecDeque<(u64, u64)>,
}

impl Default for Ledger {
    fn default() -> Self {
        Self::new()
    }
}

impl Ledger {
    /// Nothing waits.
    #[must_use]
    pub fn new() -> Self {
        Self {
            waiting: VecDeque::with_capacity(WAITING),
        }
    }

    /// Record `sequence` tells of `tick`. Without room it counts with the one before it, so as durable no sooner.
    pub fn push(&mut self, sequence: u64, tick: u64) {
        let is_full = WAITING <= self.waiting.len();
        match self.waiting.back_mut() {
            Some(last) if is_full => last.0 = sequence,
            _ => self.waiting.push_back((sequence, tick)),
        }
    }

    /// Up to which tick all is durable, when records are up to `durable` and the session is in tick `now`.
    pub fn durable_tick(&mut self, durable: u64, now: u64) -> u64 {
        while self
            .waiting
            .front()
            .is_some_and(|(sequence, _)| *sequence <= durable)
        {
            self.waiting.pop_front();
        }
        self.waiting
            .front()
            .map_or(now, |(_, tick)| tick.saturating_sub(1))
    }
}
