//! The sender's half: sweeps in the order they were made, kept until they are acknowledged.

use teleclay_proto::frame::{MAX_SWEEPS, SweepRecord, Sweeps};

use super::WINDOW;

/// Share of a full packet for the newest sweeps. The rest goes round the older ones, so that a burst of losses is made up for while
/// fresh cuts keep arriving at once.
const NEWEST: u32 = MAX_SWEEPS as u32 / 2;

/// [`WINDOW`] sweeps wait for acknowledgement: whoever cuts has to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{WINDOW} sweeps wait for acknowledgement")]
pub struct LogFull;

/// Sweeps that are not yet acknowledged. Numbers start at 1 and go up by one a sweep; 0 is never one.
#[derive(Clone, Debug)]
pub struct SweepLog {
    records: Box<[SweepRecord]>,
    /// Number of the oldest that waits; equal to `next` when none does.
    oldest: u32,
    next: u32,
    /// Where the round over the older ones goes on.
    round: u32,
}

impl Default for SweepLog {
    fn default() -> Self {
        let none = SweepRecord {
            sequence: 0,
            from: [0; 3],
            to: [0; 3],
        };
        Self {
            records: vec![none; WINDOW].into_boxed_slice(),
            oldest: 1,
            next: 1,
            round: 1,
        }
    }
}

impl SweepLog {
    /// Takes in a sweep between two lattice positions and returns its number.
    ///
    /// # Errors
    /// Too many wait; nothing is taken in.
    pub fn push(&mut self, from: [i32; 3], to: [i32; 3]) -> Result<u32, LogFull> {
        if WINDOW <= self.waiting() {
            return Err(LogFull);
        }
        let sequence = self.next;
        self.records[slot(sequence)] = SweepRecord { sequence, from, to };
        self.next += 1;
        Ok(sequence)
    }

    /// The other side has everything up to and including `sequence`. An older or impossible number changes nothing.
    pub fn on_acknowledged(&mut self, sequence: u32) {
        if self.oldest <= sequence && sequence < self.next {
            self.oldest = sequence + 1;
        }
    }

    /// Sweeps that wait for acknowledgement.
    pub fn waiting(&self) -> usize {
        (self.next - self.oldest) as usize
    }

    /// Number of the last sweep made; 0 before the first.
    pub fn last(&self) -> u32 {
        self.next - 1
    }

    /// Writes what the next packet carries: everything that waits if it fits; else the newest half, and the older ones in turn.
    pub fn fill(&mut self, sweeps: &mut Sweeps) {
        sweeps.clear();
        sweeps.oldest_unacknowledged = self.oldest;
        let all_fit = self.waiting() <= MAX_SWEEPS;
        let newest_from = if all_fit {
            self.oldest
        } else {
            self.next - NEWEST
        };
        for sequence in newest_from..self.next {
            self.write(sequence, sweeps);
        }
        if all_fit {
            return;
        }
        for _ in 0..MAX_SWEEPS as u32 - NEWEST {
            if !(self.oldest..newest_from).contains(&self.round) {
                self.round = self.oldest;
            }
            self.write(self.round, sweeps);
            self.round += 1;
        }
    }

    fn write(&self, sequence: u32, sweeps: &mut Sweeps) {
        // `fill` writes MAX_SWEEPS at most.
        let _ = sweeps.push(self.records[slot(sequence)]);
    }
}

fn slot(sequence: u32) -> usize {
    sequence as usize % WINDOW
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sequences(log: &mut SweepLog) -> Vec<u32> {
        let mut sweeps = Sweeps::default();
        log.fill(&mut sweeps);
        sweeps.iter().map(|sweep| sweep.sequence).collect()
    }

    fn log_of(count: u32) -> SweepLog {
        let mut log = SweepLog::default();
        for k in 0..count as i32 {
            log.push([k, 0, 0], [k + 1, 0, 0]).unwrap();
        }
        log
    }

    #[test]
    fn what_fits_goes_in_order_until_acknowledged() {
        let mut log = log_of(5);
        assert_eq!(sequences(&mut log), [1, 2, 3, 4, 5]);
        log.on_acknowledged(3);
        assert_eq!(sequences(&mut log), [4, 5]);
        log.on_acknowledged(2);
        log.on_acknowledged(99);
        assert_eq!(
            log.waiting(),
            2,
            "an old or impossible acknowledgement counts for nothing"
        );
    }

    #[test]
    fn when_too_many_wait_the_newest_go_first_and_every_older_one_gets_its_turn() {
        let mut log = log_of(500);
        let mut carried = std::collections::HashSet::new();
        for _ in 0..(500 - NEWEST).div_ceil(MAX_SWEEPS as u32 - NEWEST) {
            let packet = sequences(&mut log);
            assert!((500 - NEWEST + 1..=500).all(|newest| packet.contains(&newest)));
            carried.extend(packet);
        }
        assert_eq!(carried.len(), 500);
    }

    #[test]
    fn a_full_log_refuses_and_takes_again_after_an_acknowledgement() {
        let mut log = log_of(WINDOW as u32);
        assert_eq!(log.push([0; 3], [1; 3]), Err(LogFull));
        log.on_acknowledged(1);
        assert_eq!(log.push([0; 3], [1; 3]), Ok(WINDOW as u32 + 1));
        assert_eq!(log.waiting(), WINDOW);
    }
}
