//! The sender's half: sweeps in the order they were made, kept until they are acknowledged.
//!
//! A sweep goes into [`COPIES`] packets in a row, so that single losses cost no round trip. What is still not acknowledged after a round trip
//! and a little was lost with all its copies, or its acknowledgement waits behind one that was: it goes out again, oldest first, as often as
//! it takes. Half of every packet is for each of the two, so neither starves the other.
//!
//! Some lines let one packet in ten through, such as a transport that drops whatever was overtaken where the network jitters by more than a tick. So
//! the other side's echo counts, too: it names a packet that came, and what that one carried only waits for a gap to be filled. What is left are the gaps:
//! the more often one was repeated in vain, the sooner it goes again.

use std::time::Duration;

use teleclay_proto::frame::{MAX_SWEEPS, SweepRecord, Sweeps};

use super::WINDOW;
use crate::time::Timestamp;

/// Packets in a row that carry a fresh sweep. With every third packet lost, one sweep in a hundred needs more.
const COPIES: u8 = 4;
/// Slots of a packet that overdue sweeps may take, if fresh ones want the rest.
const OVERDUE_SLOTS: usize = MAX_SWEEPS / 2;
/// Sweeps looked at for a packet: what is overdue is found within a few packets, however many wait.
const LOOKS: u32 = 256;
/// An acknowledgement is awaited this much longer than the round trip, for jitter and both sides' ticks.
const PATIENCE: Duration = Duration::from_millis(20);
/// However often a sweep was repeated in vain, it goes again no sooner than this.
const LEAST_WAIT: Duration = Duration::from_millis(10);
/// A sweep that came is repeated after so many times the usual wait: it may have come when there was no room for it.
const WAITS_WHEN_IT_CAME: u32 = 4;
/// Packets that are remembered until their echo comes: a second of them.
const PACKETS: usize = 1024;
/// Round trip before one is known.
const UNKNOWN_ROUND_TRIP: Duration = Duration::from_millis(100);

/// [`WINDOW`] sweeps wait for acknowledgement: whoever cuts has to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{WINDOW} sweeps wait for acknowledgement")]
pub struct LogFull;

/// A sweep and what became of it.
#[derive(Clone, Copy, Debug)]
struct Entry {
    record: SweepRecord,
    copies: u8,
    sent_at: Timestamp,
    has_come: bool,
}

/// What went out when.
#[derive(Clone, Copy, Debug)]
struct Packet {
    at: Timestamp,
    carried: [u32; MAX_SWEEPS],
}

/// Sweeps that are not yet acknowledged. Numbers start at 1 and go up by one a sweep; 0 is never one.
#[derive(Clone, Debug)]
pub struct SweepLog {
    entries: Box<[Entry]>,
    /// Number of the oldest that waits; equal to `next` when none does.
    oldest: u32,
    next: u32,
    /// Where the search for overdue ones goes on.
    round: u32,
    round_trip: Duration,
    packets: Box<[Packet]>,
    /// Packets so far, and how many of them an echo has dealt with: named, or passed over.
    packets_sent: u64,
    packets_judged: u64,
}

impl Default for SweepLog {
    fn default() -> Self {
        let none = Entry {
            record: SweepRecord {
                sequence: 0,
                from: [0; 3],
                to: [0; 3],
            },
            copies: 0,
            sent_at: Timestamp::ZERO,
            has_come: false,
        };
        let nothing = Packet {
            at: Timestamp::ZERO,
            carried: [0; MAX_SWEEPS],
        };
        Self {
            entries: vec![none; WINDOW].into_boxed_slice(),
            oldest: 1,
            next: 1,
            round: 1,
            round_trip: UNKNOWN_ROUND_TRIP,
            packets: vec![nothing; PACKETS].into_boxed_slice(),
            packets_sent: 0,
            packets_judged: 0,
        }
    }
}

impl Entry {
    /// Whether it goes out again, where an acknowledgement is usually there after `wait`.
    fn is_due(&self, now: Timestamp, wait: Duration) -> bool {
        let in_vain = self.copies.saturating_sub(COPIES).min(16);
        let pause = if self.has_come {
            wait * WAITS_WHEN_IT_CAME
        } else {
            (wait / 2_u32.pow(in_vain.into())).max(LEAST_WAIT)
        };
        self.copies == 0 || pause <= now.since(self.sent_at)
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
        self.entries[slot(sequence)] = Entry {
            record: SweepRecord { sequence, from, to },
            copies: 0,
            sent_at: Timestamp::ZERO,
            has_come: false,
        };
        self.next += 1;
        Ok(sequence)
    }

    /// The other side has everything up to and including `sequence`. An older or impossible number changes nothing.
    pub fn on_acknowledged(&mut self, sequence: u32) {
        if self.oldest <= sequence && sequence < self.next {
            self.oldest = sequence + 1;
        }
    }

    /// Everything that waits is given up: the clay it cut is gone. Numbers go on.
    pub fn give_up(&mut self) {
        self.oldest = self.next;
    }

    /// Every sweep so far was acknowledged up to and including this number; 0 when none was.
    pub fn acknowledged(&self) -> u32 {
        self.oldest - 1
    }

    /// A sweep by its number, acknowledged or not, as long as it is among the last [`WINDOW`].
    pub fn record(&self, sequence: u32) -> Option<&SweepRecord> {
        let record = &self.entries[slot(sequence)].record;
        (0 < sequence && record.sequence == sequence).then_some(record)
    }

    /// Sweeps that wait for acknowledgement.
    pub fn waiting(&self) -> usize {
        (self.next - self.oldest) as usize
    }

    /// Number of the last sweep made; 0 before the first.
    pub fn last(&self) -> u32 {
        self.next - 1
    }

    /// The line's round trip, as last measured.
    pub fn on_round_trip(&mut self, round_trip: Duration) {
        self.round_trip = round_trip;
    }

    /// The other side names the packet that came last, by when it was sent.
    pub fn on_echo(&mut self, sent_at: Timestamp) {
        let oldest_kept = self.packets_sent.saturating_sub(PACKETS as u64);
        let mut number = self.packets_judged.max(oldest_kept);
        while number < self.packets_sent {
            let packet = self.packets[number as usize % PACKETS];
            if sent_at < packet.at {
                break;
            }
            number += 1;
            if packet.at == sent_at {
                for sequence in packet.carried {
                    let entry = &mut self.entries[slot(sequence)];
                    entry.has_come |= 0 < sequence && entry.record.sequence == sequence;
                }
                break;
            }
        }
        self.packets_judged = number;
    }

    /// Sweeps that no packet has carried yet.
    pub fn unsent(&self) -> usize {
        self.newest_first()
            .take_while(|entry| entry.copies == 0)
            .count()
    }

    /// Writes what the next packet carries. It counts as sent only when [`SweepLog::on_sent`] says so.
    pub fn fill(&mut self, now: Timestamp, sweeps: &mut Sweeps) {
        sweeps.clear();
        sweeps.oldest_unacknowledged = self.oldest;
        let fresh = self
            .newest_first()
            .take_while(|entry| entry.copies < COPIES)
            .take(MAX_SWEEPS)
            .count();
        let overdue_slots = OVERDUE_SLOTS.max(MAX_SWEEPS - fresh);
        self.fill_overdue(now, self.next - fresh as u32, overdue_slots, sweeps);
        let fresh = fresh.min(MAX_SWEEPS - sweeps.len()) as u32;
        for sequence in self.next - fresh..self.next {
            self.write(sequence, sweeps);
        }
    }

    /// The packet last filled went out.
    pub fn on_sent(&mut self, now: Timestamp, sweeps: &Sweeps) {
        let packet = &mut self.packets[self.packets_sent as usize % PACKETS];
        packet.at = now;
        packet.carried = [0; MAX_SWEEPS];
        for (record, carried) in sweeps.iter().zip(&mut packet.carried) {
            let entry = &mut self.entries[slot(record.sequence)];
            entry.copies = entry.copies.saturating_add(1);
            entry.sent_at = now;
            *carried = record.sequence;
        }
        self.packets_sent += 1;
    }

    /// Those before number `end` that were sent long ago, or that newer ones crowded out before they were ever sent.
    fn fill_overdue(&mut self, now: Timestamp, end: u32, slots: usize, sweeps: &mut Sweeps) {
        let wait = self.round_trip.mul_f64(1.25) + PATIENCE;
        for _ in 0..LOOKS.min(end - self.oldest) {
            if slots <= sweeps.len() {
                return;
            }
            if !(self.oldest..end).contains(&self.round) {
                self.round = self.oldest;
            }
            if self.entries[slot(self.round)].is_due(now, wait) {
                self.write(self.round, sweeps);
            }
            self.round += 1;
        }
    }

    fn newest_first(&self) -> impl Iterator<Item = &Entry> {
        (self.oldest..self.next)
            .rev()
            .map(|sequence| &self.entries[slot(sequence)])
    }

    fn write(&self, sequence: u32, sweeps: &mut Sweeps) {
        // `fill` writes MAX_SWEEPS at most.
        let _ = sweeps.push(self.entries[slot(sequence)].record);
    }
}

fn slot(sequence: u32) -> usize {
    sequence as usize % WINDOW
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK: Duration = Duration::from_millis(1);

    /// Packets that a log sends, one a tick.
    struct Line {
        log: SweepLog,
        now: Timestamp,
    }

    impl Line {
        fn of(count: u32) -> Self {
            Self {
                log: log_of(count),
                now: Timestamp::ZERO.after(TICK),
            }
        }

        fn packet(&mut self) -> Vec<u32> {
            let mut sweeps = Sweeps::default();
            self.log.fill(self.now, &mut sweeps);
            self.log.on_sent(self.now, &sweeps);
            self.now = self.now.after(TICK);
            sweeps.iter().map(|sweep| sweep.sequence).collect()
        }
    }

    fn log_of(count: u32) -> SweepLog {
        let mut log = SweepLog::default();
        for k in 0..count as i32 {
            log.push([k, 0, 0], [k + 1, 0, 0]).unwrap();
        }
        log
    }

    #[test]
    fn a_fresh_sweep_goes_out_in_a_row_and_again_when_it_is_overdue() {
        let mut line = Line::of(3);
        line.log.on_round_trip(TICK * 80);
        for _ in 0..COPIES {
            assert_eq!(line.packet(), [1, 2, 3]);
        }
        // 1.25 round trips and 20 ms after the last copy.
        for _ in 1..120 {
            assert!(line.packet().is_empty());
        }
        line.log.on_acknowledged(1);
        assert_eq!(line.packet(), [2, 3]);
        assert!(line.packet().is_empty());
    }

    /// A sweep a tick for 20 s over a line of 100 ms round trip that lets this share of packets through, each way, by lot. Gives the most that waited, and
    /// the sweeps carried.
    fn over_a_line(share: f64) -> (usize, usize) {
        let mut log = SweepLog::default();
        log.on_round_trip(TICK * 100);
        let mut inbox = crate::replica::SweepInbox::default();
        let mut up = std::collections::VecDeque::new();
        let mut down = std::collections::VecDeque::new();
        let (mut now, mut echo) = (Timestamp::ZERO, Timestamp::ZERO);
        let (mut lot, mut most, mut carried) = (1_u64, 0, 0);
        let mut passes = || {
            lot = lot.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            ((lot >> 32) as f64) < share * 2_f64.powi(32)
        };
        for tick in 0..20_000 {
            now = now.after(TICK);
            log.push([tick, 0, 0], [tick + 1, 0, 0]).unwrap();
            let mut sweeps = Sweeps::default();
            log.fill(now, &mut sweeps);
            log.on_sent(now, &sweeps);
            carried += sweeps.len();
            up.push_back(passes().then_some((now, sweeps)));
            if up.len() == 50
                && let Some(Some((sent_at, sweeps))) = up.pop_front()
            {
                echo = sent_at;
                for record in &sweeps {
                    inbox.on_sweep(record.sequence);
                }
            }
            down.push_back(passes().then_some((inbox.complete(), echo)));
            if down.len() == 50
                && let Some(Some((complete, echo))) = down.pop_front()
            {
                log.on_acknowledged(complete);
                log.on_echo(echo);
            }
            most = most.max(log.waiting());
        }
        (most, carried)
    }

    #[test]
    fn a_line_that_lets_one_packet_in_ten_through_keeps_up_and_a_good_one_is_not_shouted_at() {
        let (most, _) = over_a_line(0.1);
        assert!(most < 2000, "{most} sweeps waited");
        // A round trip's worth, and each one went out as often as it always does.
        assert!(over_a_line(1.0).0 <= 101);
        assert_eq!(over_a_line(1.0).1, 20_000 * usize::from(COPIES) - 6);
        // With a tenth lost, one sweep in ten thousand loses all its copies; what came behind it is not repeated for that.
        let (most, carried) = over_a_line(0.9);
        assert!(most < 400, "{most} sweeps waited");
        assert!(
            carried < 20_000 * usize::from(COPIES) * 21 / 20,
            "{carried}"
        );
    }

    #[test]
    fn an_acknowledgement_that_cannot_be_counts_for_nothing() {
        let mut log = log_of(5);
        log.on_acknowledged(3);
        log.on_acknowledged(2);
        log.on_acknowledged(99);
        assert_eq!(log.waiting(), 2);
    }

    #[test]
    fn what_was_filled_and_not_sent_does_not_count() {
        let mut line = Line::of(2);
        for _ in 0..10 {
            line.log.fill(line.now, &mut Sweeps::default());
        }
        assert_eq!(line.log.unsent(), 2);
        assert_eq!(line.packet(), [1, 2]);
        assert_eq!(line.log.unsent(), 0);
    }

    #[test]
    fn overdue_sweeps_and_fresh_ones_share_the_packets() {
        let mut line = Line::of(500);
        for _ in 0..2000 {
            line.packet();
        }
        let mut carried = std::collections::HashSet::new();
        for k in 0..200 {
            let number = line.log.push([k, 1, 0], [k + 1, 1, 0]).unwrap();
            let packet = line.packet();
            assert!(packet.contains(&number), "a fresh sweep has to wait");
            carried.extend(packet.into_iter().filter(|number| *number <= 500));
        }
        assert_eq!(carried.len(), 500, "an overdue sweep has to wait");
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
