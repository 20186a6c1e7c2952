//! What came, what is missing, what came twice. Force and pose want the newest frame only; the counts go on display.

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

/// Counts since the start of the stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ArrivalCounts {
    /// Distinct frames received.
    pub received: u64,
    /// Frames received twice.
    pub duplicates: u64,
    /// Distinct frames that came after a newer one.
    pub reordered: u64,
    /// Numbers skipped and not (yet) come.
    pub missing: u64,
}

/// Watches the sequence numbers of one stream. Remembers the last 128, so a duplicate or late frame within 128 ms is told apart.
#[derive(Clone, Copy, Debug, Default)]
pub struct Arrivals {
    /// Newest sequence number, and which of the 128 up to it came (bit 0 is the newest itself).
    newest: Option<(u32, u128)>,
    counts: ArrivalCounts,
}

impl Arrivals {
    /// Takes note of sequence number `sequence`. Numbers wrap.
    pub fn on_sequence(&mut self, sequence: u32) -> Arrival {
        let Some((newest, seen)) = self.newest else {
            self.newest = Some((sequence, 1));
            self.counts.received = 1;
            return Arrival::Newest;
        };
        let ahead = sequence.wrapping_sub(newest) as i32;
        if 0 < ahead {
            let shifted = seen.checked_shl(ahead as u32).unwrap_or(0);
            self.newest = Some((sequence, shifted | 1));
            self.counts.received += 1;
            self.counts.missing += ahead as u64 - 1;
            return Arrival::Newest;
        }
        let bit = 1_u128.checked_shl(ahead.unsigned_abs()).unwrap_or(0);
        if bit == 0 || seen & bit != 0 {
            self.counts.duplicates += 1;
            return Arrival::Duplicate;
        }
        self.newest = Some((newest, seen | bit));
        self.counts.received += 1;
        self.counts.reordered += 1;
        self.counts.missing = self.counts.missing.saturating_sub(1);
        Arrival::Late
    }

    /// Counts so far.
    pub fn counts(&self) -> ArrivalCounts {
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts_of(sequences: &[u32]) -> ArrivalCounts {
        let mut arrivals = Arrivals::default();
        for &sequence in sequences {
            arrivals.on_sequence(sequence);
        }
        arrivals.counts()
    }

    #[test]
    fn a_gap_is_missing_until_the_late_frame_comes() {
        assert_eq!(counts_of(&[5, 6, 9]).missing, 2);
        let healed = counts_of(&[5, 6, 9, 7]);
        assert_eq!(
            (healed.missing, healed.reordered, healed.received),
            (1, 1, 4)
        );
    }

    #[test]
    fn a_copy_is_counted_once_and_never_used() {
        let mut arrivals = Arrivals::default();
        assert_eq!(arrivals.on_sequence(1), Arrival::Newest);
        assert_eq!(arrivals.on_sequence(2), Arrival::Newest);
        assert_eq!(arrivals.on_sequence(1), Arrival::Duplicate);
        assert_eq!(arrivals.on_sequence(2), Arrival::Duplicate);
        assert_eq!(arrivals.counts().duplicates, 2);
        assert_eq!(arrivals.counts().received, 2);
    }

    #[test]
    fn numbers_wrap() {
        let counts = counts_of(&[u32::MAX - 1, u32::MAX, 0, 1]);
        assert_eq!((counts.received, counts.missing), (4, 0));
    }

    #[test]
    fn the_memory_ends_at_128_and_says_duplicate_beyond() {
        let mut arrivals = Arrivals::default();
        arrivals.on_sequence(0);
        arrivals.on_sequence(200);
        assert_eq!(arrivals.on_sequence(73), Arrival::Late);
        assert_eq!(arrivals.on_sequence(72), Arrival::Duplicate);
        assert_eq!(arrivals.on_sequence(72 + 1), Arrival::Duplicate);
    }
}
