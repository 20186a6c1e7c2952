//! The receiver's half: which sweeps came, and up to where without a gap.

use teleclay_proto::frame::{Gap, Gaps, NoGap};

use super::WINDOW;

/// Whether a sweep is to be carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Novelty {
    /// It had not come before.
    New,
    /// It is known. Carrying it out again would change nothing, only cost time.
    Known,
    /// Its number is so far ahead that no honest sender can have got there.
    BeyondWindow,
}

/// Which of the last [`WINDOW`] numbers came.
#[derive(Clone, Debug)]
pub struct SweepInbox {
    /// Everything up to this number has come.
    complete: u32,
    /// Numbers above `complete` that came, one bit each, at the number modulo the window.
    ahead: Box<[u64]>,
    /// The greatest number that came.
    greatest: u32,
}

impl Default for SweepInbox {
    fn default() -> Self {
        Self {
            complete: 0,
            ahead: vec![0; WINDOW / 64].into_boxed_slice(),
            greatest: 0,
        }
    }
}

impl SweepInbox {
    /// Takes note of number `sequence`.
    pub fn on_sweep(&mut self, sequence: u32) -> Novelty {
        if sequence <= self.complete {
            return Novelty::Known;
        }
        if WINDOW as u32 <= sequence - self.complete {
            return Novelty::BeyondWindow;
        }
        let (word, bit) = place(sequence);
        if self.ahead[word] & bit != 0 {
            return Novelty::Known;
        }
        self.ahead[word] |= bit;
        self.greatest = self.greatest.max(sequence);
        self.run_on();
        Novelty::New
    }

    /// As if nothing had come: the sender numbers anew, or says where it goes on ([`SweepInbox::skip_to`]).
    pub fn restart(&mut self) {
        self.complete = 0;
        self.greatest = 0;
        self.ahead.fill(0);
    }

    /// The sender keeps nothing older than `oldest`: what has not come by now will never come, because it cut clay that
    /// is gone.
    pub fn skip_to(&mut self, oldest: u32) {
        while self.complete.wrapping_add(1) < oldest {
            let ahead = oldest - 1 - self.complete;
            if WINDOW as u32 <= ahead {
                // So far that every bit remembered is older.
                self.ahead.fill(0);
                self.complete = oldest - 1;
            } else {
                let (word, bit) = place(self.complete + 1);
                self.ahead[word] &= !bit;
                self.complete += 1;
            }
        }
        self.run_on();
    }

    /// The number to acknowledge: everything up to it has come. 0 when the first is missing.
    pub fn complete(&self) -> u32 {
        self.complete
    }

    /// Writes what has come beyond the complete number, as many gaps as a frame names.
    pub fn fill(&self, gaps: &mut Gaps) {
        gaps.clear();
        let mut behind = self.complete;
        while behind < self.greatest {
            let come_from = self.next_that(behind + 1, |word| word);
            let come_to = self.next_that(come_from, |word| !word);
            // The window is shorter than what these count.
            let gap = Gap {
                missing: (come_from - behind - 1) as u16,
                come: (come_to - come_from) as u16,
            };
            if gaps.push(gap) == Err(NoGap) {
                return;
            }
            behind = come_to - 1;
        }
    }

    /// The first number from `from` on whose bit is set in what `view` makes of its word; one behind the greatest if
    /// none is.
    fn next_that(&self, from: u32, view: impl Fn(u64) -> u64) -> u32 {
        let mut sequence = from;
        while sequence <= self.greatest {
            let (word, bit) = place(sequence);
            let ahead = (view(self.ahead[word]) & !(bit - 1)).trailing_zeros();
            if ahead < u64::BITS {
                return (sequence + ahead - bit.trailing_zeros()).min(self.greatest + 1);
            }
            sequence += u64::BITS - bit.trailing_zeros();
        }
        self.greatest + 1
    }

    /// Moves the complete number over everything that has come next to it.
    fn run_on(&mut self) {
        loop {
            let (word, bit) = place(self.complete.wrapping_add(1));
            if self.ahead[word] & bit == 0 {
                return;
            }
            self.ahead[word] &= !bit;
            self.complete += 1;
        }
    }
}

fn place(sequence: u32) -> (usize, u64) {
    let position = sequence as usize % WINDOW;
    (position / 64, 1 << (position % 64))
}

#[cfg(test)]
mod tests {
    use super::super::SweepLog;
    use super::*;
    use proptest::prelude::*;
    use teleclay_proto::frame::Sweeps;

    fn gaps_of(inbox: &SweepInbox) -> Gaps {
        let mut gaps = Gaps::default();
        inbox.fill(&mut gaps);
        gaps
    }

    #[test]
    fn a_gap_holds_the_acknowledgement_back_until_it_is_filled() {
        let mut inbox = SweepInbox::default();
        for sequence in [1, 2, 4, 5] {
            assert_eq!(inbox.on_sweep(sequence), Novelty::New);
        }
        assert_eq!(inbox.complete(), 2);
        assert_eq!(inbox.on_sweep(4), Novelty::Known);
        assert_eq!(inbox.on_sweep(3), Novelty::New);
        assert_eq!(inbox.complete(), 5);
        assert_eq!(inbox.on_sweep(1), Novelty::Known);
    }

    #[test]
    fn a_number_from_beyond_the_window_changes_nothing() {
        let mut inbox = SweepInbox::default();
        assert_eq!(inbox.on_sweep(u32::MAX), Novelty::BeyondWindow);
        assert_eq!(inbox.on_sweep(WINDOW as u32), Novelty::BeyondWindow);
        assert_eq!(inbox.on_sweep(WINDOW as u32 - 1), Novelty::New);
        assert_eq!(inbox.on_sweep(1), Novelty::New);
        assert_eq!(inbox.complete(), 1);
    }

    #[test]
    fn what_the_sender_has_dropped_is_not_waited_for() {
        let mut inbox = SweepInbox::default();
        for sequence in [2, 5, 9] {
            inbox.on_sweep(sequence);
        }
        inbox.skip_to(5);
        assert_eq!(inbox.complete(), 5);
        inbox.skip_to(3);
        assert_eq!(inbox.complete(), 5);
        inbox.skip_to(8);
        assert_eq!(inbox.complete(), 7);
        assert_eq!(inbox.on_sweep(8), Novelty::New);
        assert_eq!(inbox.complete(), 9);
        inbox.skip_to(9 + 3 * WINDOW as u32);
        assert_eq!(inbox.complete(), 8 + 3 * WINDOW as u32);
        assert_eq!(inbox.on_sweep(9 + 3 * WINDOW as u32), Novelty::New);
        assert_eq!(inbox.complete(), 9 + 3 * WINDOW as u32);
    }

    proptest! {
        /// The gaps name exactly what came, up to where they end, and they end only where the frame is full or nothing
        /// more came.
        #[test]
        fn gaps_are_what_came(numbers in prop::collection::vec(1..3000_u32, 0..400), skipped in 0..2000_u32) {
            let mut inbox = SweepInbox::default();
            inbox.skip_to(skipped);
            let mut came: std::collections::BTreeSet<u32> = (1..skipped).collect();
            for &number in &numbers {
                inbox.on_sweep(number);
                came.insert(number);
            }
            let mut gaps = Gaps::default();
            inbox.fill(&mut gaps);
            let complete = (1..).find(|number| !came.contains(number)).unwrap() - 1;
            prop_assert_eq!(inbox.complete(), complete);
            let (mut named, mut end) = (Vec::new(), complete);
            for [first, last] in gaps.come_after(complete) {
                named.extend(first..=last);
                end = last;
            }
            prop_assert!(came.range(complete + 1..end + 1).eq(&named));
            let is_full = gaps.as_slice().len() == teleclay_proto::frame::MAX_GAPS;
            prop_assert!(is_full || came.range(end + 1..).next().is_none());
            prop_assert!(!came.contains(&(end + 1)));
        }

        /// Whatever is lost and whatever is late, each sweep is carried out exactly once, and in the end all are
        /// acknowledged.
        #[test]
        fn log_and_inbox_agree_across_a_bad_line(
            losses in prop::collection::vec(prop::bool::weighted(0.6), 400),
            echoes in prop::collection::vec(prop::bool::weighted(0.5), 400),
        ) {
            const TICK: std::time::Duration = std::time::Duration::from_millis(1);
            let mut now = crate::time::Timestamp::ZERO;
            let (mut log, mut inbox) = (SweepLog::default(), SweepInbox::default());
            let mut carried_out = Vec::new();
            for (lost, echo_lost) in losses.iter().zip(&echoes) {
                log.push([0; 3], [1; 3]).unwrap();
                let mut packet = Sweeps::default();
                now = now.after(TICK);
                log.fill(now, &mut packet);
                log.on_sent(now, &packet);
                if !lost {
                    carried_out.extend(packet.iter().filter(|s| inbox.on_sweep(s.sequence) == Novelty::New).map(|s| s.sequence));
                }
                if !echo_lost {
                    log.on_acknowledged(inbox.complete(), &gaps_of(&inbox));
                    log.on_durable(inbox.complete());
                }
            }
            for _ in 0..1000 {
                let mut packet = Sweeps::default();
                now = now.after(TICK);
                log.fill(now, &mut packet);
                log.on_sent(now, &packet);
                carried_out.extend(packet.iter().filter(|s| inbox.on_sweep(s.sequence) == Novelty::New).map(|s| s.sequence));
                log.on_acknowledged(inbox.complete(), &gaps_of(&inbox));
            }
            carried_out.sort_unstable();
            prop_assert_eq!(carried_out, (1..=400).collect::<Vec<_>>());
            prop_assert_eq!(log.waiting(), 0);
        }
    }
}
