//! What came, what was lost, what came twice. Force and pose want the newest frame only; the counts go on display.

use crate::safety::{Flaw, Implausible};

/// How a frame relates to those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// Newer than all before it: use it.
    Newest,
    /// Late: an older number that had not been seen.
    Late,
    /// A number seen before, or so old that it cannot be told.
    Duplicate,
}

/// Counts since the start of the stream. None ever falls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ArrivalCounts {
    /// Distinct frames received.
    pub received: u64,
    /// Frames received twice.
    pub duplicates: u64,
    /// Distinct frames that came after a newer one.
    pub reordered: u64,
    /// Frames that had not come when the [`MEMORY`] after them were due.
    pub lost: u64,
    /// Frames that had waited in a queue: see [`freshness`](crate::freshness).
    pub stale: u64,
    /// Frames that [`check`](crate::safety::check) did not let in, or whose number [leaps](Arrivals::leaps).
    pub implausible: u64,
}

impl ArrivalCounts {
    /// These and the counts of another stream.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            received: self.received + other.received,
            duplicates: self.duplicates + other.duplicates,
            reordered: self.reordered + other.reordered,
            lost: self.lost + other.lost,
            stale: self.stale + other.stale,
            implausible: self.implausible + other.implausible,
        }
    }
}

/// Numbers that are remembered: a duplicate or late frame within 128 ms is told apart.
pub const MEMORY: u32 = u128::BITS;

/// A stream may go on by so many numbers at once, and by so many a millisecond: twice what the shortest tick sends.
const AT_ONCE: u64 = 1000;
const FRAMES_PER_MS: u64 = 4;

/// Watches the sequence numbers of one stream. Remembers the last [`MEMORY`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Arrivals {
    /// Newest sequence number, and which of the numbers up to it came (bit 0 is the newest itself).
    newest: Option<(u32, u128)>,
    /// How many of the remembered numbers belong to the stream: those before its first do not.
    of_the_stream: u32,
    /// When the frame with the newest number was sent, on the sender's clock, ns.
    newest_sent_ns: u64,
    counts: ArrivalCounts,
}

impl Arrivals {
    /// Another sender's stream begins, with numbers from 0, and a frame with number `sequence` that was sent at
    /// `sent_ns` on its clock is the first of it that came. Counts go on.
    ///
    /// # Errors
    /// Nobody can have sent as many frames until then. The stream before goes on.
    pub fn restart(&mut self, sent_ns: u64, sequence: u32) -> Result<(), Implausible> {
        let begun = Self {
            newest: Some((0, 0)),
            counts: self.counts,
            ..Self::default()
        };
        begun.check_sequence(sent_ns, sequence)?;
        *self = Self {
            newest: None,
            ..begun
        };
        Ok(())
    }

    /// Whether a number is one that a frame sent at `sent_ns` can have.
    ///
    /// # Errors
    /// It [leaps](Self::leaps).
    pub fn check_sequence(&self, sent_ns: u64, sequence: u32) -> Result<(), Implausible> {
        if self.leaps(sent_ns, sequence) {
            return Err(Implausible {
                field: "sequence",
                flaw: Flaw::TooLarge,
            });
        }
        Ok(())
    }

    /// Whether a number is so far ahead that nobody can have sent as many frames until `sent_ns`, on the sender's
    /// clock: a peer that is taken at its word there is not heard again for days. Arrival does not tell: what queued up
    /// comes at once, with gaps.
    pub fn leaps(&self, sent_ns: u64, sequence: u32) -> bool {
        let Some((newest, _)) = self.newest else {
            return false;
        };
        let ahead = sequence.wrapping_sub(newest) as i32;
        let elapsed_ms = sent_ns.saturating_sub(self.newest_sent_ns) / 1_000_000;
        0 < ahead && AT_ONCE + elapsed_ms.saturating_mul(FRAMES_PER_MS) < ahead as u64
    }

    /// Takes note of sequence number `sequence`, sent at `sent_ns` on the sender's clock. Numbers wrap.
    pub fn on_sequence(&mut self, sent_ns: u64, sequence: u32) -> Arrival {
        let Some((newest, seen)) = self.newest else {
            self.newest = Some((sequence, 1));
            self.newest_sent_ns = sent_ns;
            self.of_the_stream = 1;
            self.counts.received += 1;
            return Arrival::Newest;
        };
        let ahead = sequence.wrapping_sub(newest) as i32;
        if 0 < ahead {
            self.go_on(ahead as u32, seen);
            self.newest = Some((sequence, seen.checked_shl(ahead as u32).unwrap_or(0) | 1));
            self.counts.received += 1;
            self.newest_sent_ns = sent_ns;
            return Arrival::Newest;
        }
        let behind = ahead.unsigned_abs();
        let bit = 1_u128.checked_shl(behind).unwrap_or(0);
        if bit == 0 || seen & bit != 0 {
            self.counts.duplicates += 1;
            return Arrival::Duplicate;
        }
        self.of_the_stream = self.of_the_stream.max(behind + 1);
        self.newest = Some((newest, seen | bit));
        self.counts.received += 1;
        self.counts.reordered += 1;
        Arrival::Late
    }

    /// The frame noted last is stale.
    pub fn on_stale(&mut self) {
        self.counts.stale += 1;
    }

    /// A frame came that holds a number that is no measurement, or leaps.
    pub fn on_implausible(&mut self) {
        self.counts.implausible += 1;
    }

    /// Counts so far.
    pub fn counts(&self) -> ArrivalCounts {
        self.counts
    }

    /// The newest number is `ahead` further on: what falls out of memory and had not come is lost.
    fn go_on(&mut self, ahead: u32, seen: u128) {
        let remembered = u64::from(self.of_the_stream) + u64::from(ahead);
        let forgotten = remembered.saturating_sub(MEMORY.into());
        // Forgotten are the oldest numbers remembered so far and, on a jump beyond the memory, some that were never in
        // it.
        let old = forgotten.min(self.of_the_stream.into()) as u32;
        let kept = self.of_the_stream - old;
        let of_the_stream = u128::MAX >> (MEMORY - self.of_the_stream);
        let forgotten_ones = (of_the_stream & seen).checked_shr(kept).unwrap_or(0);
        self.counts.lost += forgotten - u64::from(forgotten_ones.count_ones());
        self.of_the_stream = remembered.min(MEMORY.into()) as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn counts_of(sequences: &[u32]) -> ArrivalCounts {
        let mut arrivals = Arrivals::default();
        for &sequence in sequences {
            arrivals.on_sequence(0, sequence);
        }
        arrivals.counts()
    }

    #[test]
    fn a_gap_is_lost_once_128_later_numbers_were_due_and_the_count_never_falls() {
        let mut arrivals = Arrivals::default();
        for sequence in [5, 6, 9] {
            arrivals.on_sequence(0, sequence);
        }
        assert_eq!(arrivals.on_sequence(0, 7), Arrival::Late);
        for sequence in 10..8 + MEMORY {
            arrivals.on_sequence(0, sequence);
        }
        assert_eq!(arrivals.counts().lost, 0, "number 8 may still come");
        arrivals.on_sequence(0, 8 + MEMORY);
        assert_eq!(arrivals.counts().lost, 1);
        assert_eq!(arrivals.on_sequence(0, 8), Arrival::Duplicate);
        assert_eq!(arrivals.counts().lost, 1);
    }

    proptest! {
        /// Whatever comes in whatever order: what was sent has come or is lost, once all of it is out of memory.
        #[test]
        fn every_number_is_received_or_lost(
            first in any::<u32>(),
            jumps in prop::collection::vec(1..400_u32, 0..40),
            late in prop::collection::vec((0..40_usize, 0..120_u32), 0..40),
        ) {
            let mut arrivals = Arrivals::default();
            arrivals.on_sequence(0, first);
            let (mut at, mut span, mut lost) = (first, 1_u64, 0);
            for (number, jump) in jumps.iter().enumerate() {
                at = at.wrapping_add(*jump);
                span += u64::from(*jump);
                arrivals.on_sequence(0, at);
                for (_, back) in late.iter().filter(|(when, back)| *when == number && u64::from(*back) < span) {
                    arrivals.on_sequence(0, at.wrapping_sub(*back));
                }
                prop_assert!(lost <= arrivals.counts().lost);
                lost = arrivals.counts().lost;
            }
            for _ in 0..MEMORY {
                at = at.wrapping_add(1);
                arrivals.on_sequence(0, at);
            }
            let counts = arrivals.counts();
            prop_assert_eq!(counts.received + counts.lost, span + u64::from(MEMORY));
        }
    }

    #[test]
    fn a_copy_is_counted_once_and_never_used() {
        let mut arrivals = Arrivals::default();
        assert_eq!(arrivals.on_sequence(0, 1), Arrival::Newest);
        assert_eq!(arrivals.on_sequence(0, 2), Arrival::Newest);
        assert_eq!(arrivals.on_sequence(0, 1), Arrival::Duplicate);
        assert_eq!(arrivals.on_sequence(0, 2), Arrival::Duplicate);
        assert_eq!(arrivals.counts().duplicates, 2);
        assert_eq!(arrivals.counts().received, 2);
    }

    #[test]
    fn numbers_wrap() {
        let counts = counts_of(&[u32::MAX - 1, u32::MAX, 0, 1]);
        assert_eq!((counts.received, counts.lost), (4, 0));
    }

    #[test]
    fn the_memory_ends_at_128_and_says_duplicate_beyond() {
        let mut arrivals = Arrivals::default();
        arrivals.on_sequence(0, 0);
        arrivals.on_sequence(0, 200);
        assert_eq!(arrivals.on_sequence(0, 73), Arrival::Late);
        assert_eq!(arrivals.on_sequence(0, 72), Arrival::Duplicate);
        assert_eq!(arrivals.on_sequence(0, 72 + 1), Arrival::Duplicate);
    }

    #[test]
    fn a_number_leaps_when_nobody_can_have_sent_as_many_frames() {
        let at = |ms: u64| 1_000_000 * ms;
        for first in [0, 7, u32::MAX - 3, u32::MAX / 2] {
            let mut arrivals = Arrivals::default();
            assert!(
                !arrivals.leaps(at(0), first),
                "the first one may have any number"
            );
            arrivals.on_sequence(at(5), first);
            for (ms, most) in [(5, 1000), (15, 1040), (60_005, 241_000)] {
                assert!(!arrivals.leaps(at(ms), first.wrapping_add(most)));
                assert!(arrivals.leaps(at(ms), first.wrapping_add(most + 1)));
            }
            assert!(arrivals.leaps(at(5), first.wrapping_add(1 << 30)));
            assert!(
                !arrivals.leaps(at(5), first.wrapping_sub(1)),
                "an old one does not"
            );
        }
    }
}
