//! The sender's half: sweeps in the order they were made, repeated until they are acknowledged, kept until they are
//! durable.
//!
//! What is acknowledged and not durable may be asked for once more, by a server that takes over and has less. So it
//! takes room as well: [`WINDOW`] sweeps are kept at most, eight seconds of cutting at 1 kHz, and then whoever cuts has
//! to stop.
//!
//! Two numbers say everything that the other side has: up to where all has come, and which beyond that ([`Gaps`], the
//! selective acknowledgement of [MMFR96] in docs/papers.md). Only what the other side has *noted* counts as come. That
//! a packet came says nothing of what it carried: there may have been no room for it.
//!
//! A sweep goes out in rounds. A round is so many packets in a row, four on a good line, so that single
//! losses cost no round trip. When it is over and the usual [`Wait`] has gone by without a word of the sweep, the next
//! round begins, and after that one half as much time goes by, and so on: the more rounds were in vain, the sooner the
//! next, until it goes into every packet. Half of every packet is kept for sweeps made before and half for fresh ones,
//! so neither starves the other.
//!
//! Some lines let one packet in thirty through, such as a transport that drops whatever was overtaken where the network
//! jitters by many ticks. There a round of four packets is mostly in vain, and every cut would cost round trips. So
//! rounds become longer where more than a sweep in eleven needs a second one ([`Copies`]), until the packets that pass
//! carry what was made between them.

use std::time::Duration;

use teleclay_proto::frame::{Gaps, SWEEP_BYTES, SweepRecord, Sweeps};

use super::WINDOW;
use super::copies::Copies;
use super::wait::Wait;
use crate::time::Timestamp;

/// Room in a packet that sweeps made before may take, if fresh ones want the rest.
const OVERDUE_BYTES: usize = SWEEP_BYTES / 2;
/// Sweeps looked at for a packet: what is overdue is found within a few packets, however many wait.
const LOOKS: u32 = 256;

/// [`WINDOW`] sweeps wait to become durable: whoever cuts has to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{WINDOW} sweeps wait to become durable")]
pub struct LogFull;

/// A sweep and what became of it.
#[derive(Clone, Copy, Debug)]
struct Entry {
    record: SweepRecord,
    /// Bytes that it takes in a packet, alone and behind the one before it.
    alone: u8,
    behind: u8,
    /// Rounds begun, and the packet with which the last one began.
    rounds: u8,
    round_from: u64,
    sent_at: Timestamp,
}

/// A packet that is being filled.
#[derive(Clone, Copy, Debug)]
struct Packet {
    now: Timestamp,
    number: u64,
    /// How long a round is.
    round: u64,
    /// How long a word of a sweep is waited for.
    wait_ns: u64,
}

/// Sweeps that are not yet durable. Numbers start at 1 and go up by one a sweep; 0 is never one.
#[derive(Clone, Debug)]
pub struct SweepLog {
    entries: Box<[Entry]>,
    /// Those that wait and have not come, one bit each, at the number modulo the window.
    missing: Box<[u64]>,
    /// Number of the oldest that waits; equal to `next` when none does.
    oldest: u32,
    /// Number of the oldest that is kept; at most `oldest`.
    kept_from: u32,
    next: u32,
    /// Where the search for overdue ones goes on.
    search: u32,
    wait: Wait,
    copies: Copies,
    packets_sent: u64,
}

impl Entry {
    fn is_in_round(&self, packet: &Packet) -> bool {
        0 < self.rounds && packet.number - self.round_from < packet.round
    }

    /// Whether it has not had its first round.
    fn is_fresh(&self, packet: &Packet) -> bool {
        self.rounds == 0 || self.rounds == 1 && self.is_in_round(packet)
    }

    /// Whether it goes out in this packet.
    fn is_due(&self, packet: &Packet) -> bool {
        let in_vain = self.rounds.saturating_sub(1).min(63);
        let waited_ns = packet.now.since(self.sent_at).as_nanos() as u64;
        self.rounds == 0 || self.is_in_round(packet) || packet.wait_ns >> in_vain <= waited_ns
    }
}

impl Default for SweepLog {
    fn default() -> Self {
        let none = Entry {
            record: SweepRecord {
                sequence: 0,
                from: [0; 3],
                to: [0; 3],
            },
            alone: 0,
            behind: 0,
            rounds: 0,
            round_from: 0,
            sent_at: Timestamp::ZERO,
        };
        Self {
            entries: vec![none; WINDOW].into_boxed_slice(),
            missing: vec![0; WINDOW / 64].into_boxed_slice(),
            oldest: 1,
            kept_from: 1,
            next: 1,
            search: 1,
            wait: Wait::default(),
            copies: Copies::default(),
            packets_sent: 0,
        }
    }
}

impl SweepLog {
    /// Takes in a sweep between two lattice positions and returns its number.
    ///
    /// # Errors
    /// Too many wait; nothing is taken in.
    pub fn push(&mut self, from: [i32; 3], to: [i32; 3]) -> Result<u32, LogFull> {
        if WINDOW <= self.kept() {
            return Err(LogFull);
        }
        let sequence = self.next;
        let record = SweepRecord { sequence, from, to };
        let before = &self.entries[slot(self.last())].record;
        self.entries[slot(sequence)] = Entry {
            record,
            alone: record.bytes_after(None) as u8,
            behind: record.bytes_after(Some(before)) as u8,
            rounds: 0,
            round_from: 0,
            sent_at: Timestamp::ZERO,
        };
        self.set_missing(sequence);
        self.next += 1;
        Ok(sequence)
    }

    /// The other side has everything up to and including `sequence`, and beyond that what the gaps leave. An older
    /// acknowledgement is still true, and an impossible one changes nothing.
    pub fn on_acknowledged(&mut self, sequence: u32, gaps: &Gaps) {
        if self.next <= sequence {
            return;
        }
        if self.oldest <= sequence {
            self.come(self.oldest, sequence);
            self.oldest = sequence + 1;
        }
        for [first, last] in gaps.come_after(sequence) {
            if last < first || self.next <= last {
                return;
            }
            self.come(first.max(self.oldest), last);
        }
    }

    /// What is acknowledged up to and including `sequence` will not be asked for again: it need not be kept. An older
    /// word is still true, and one of what is not acknowledged counts as far as it is.
    pub fn on_durable(&mut self, sequence: u32) {
        let durable = sequence.min(self.oldest - 1);
        self.kept_from = self.kept_from.max(durable + 1);
    }

    /// Everything that waits is given up: the clay it cut is gone. Numbers go on.
    pub fn give_up(&mut self) {
        self.oldest = self.next;
        self.kept_from = self.next;
        self.missing.fill(0);
    }

    /// Another receiver took over, of which nothing is known but what it acknowledges from now on: all that is kept
    /// waits again.
    pub fn forget_what_came(&mut self) {
        self.oldest = self.kept_from;
        for sequence in self.oldest..self.next {
            self.set_missing(sequence);
        }
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

    /// Sweeps that are kept because they are not durable.
    pub fn kept(&self) -> usize {
        (self.next - self.kept_from) as usize
    }

    /// Number of the last sweep made; 0 before the first.
    pub fn last(&self) -> u32 {
        self.next - 1
    }

    /// An exchange with the other side that came to its end at `now` took so long.
    pub fn on_round_trip(&mut self, now: Timestamp, round_trip: Duration) {
        self.wait.on_round_trip(now, round_trip);
    }

    /// Sweeps that no packet has carried yet.
    pub fn unsent(&self) -> usize {
        self.newest_first()
            .take_while(|entry| entry.rounds == 0)
            .count()
    }

    /// Writes what the next packet carries. It counts as sent only when [`SweepLog::on_sent`] says so.
    pub fn fill(&mut self, now: Timestamp, sweeps: &mut Sweeps) {
        sweeps.clear();
        sweeps.oldest_unacknowledged = self.oldest;
        let packet = self.packet(now);
        let (mut fresh_from, fresh_bytes) = self.fresh(&packet, SWEEP_BYTES);
        let room = OVERDUE_BYTES.max(SWEEP_BYTES - fresh_bytes);
        self.fill_overdue(&packet, fresh_from, room, sweeps);
        let room = SWEEP_BYTES - sweeps.bytes();
        if room < fresh_bytes {
            (fresh_from, _) = self.fresh(&packet, room);
        }
        for sequence in fresh_from..self.next {
            // There is room: `fresh` has counted.
            let _ = sweeps.push(self.entries[slot(sequence)].record);
        }
    }

    /// The packet last filled went out.
    pub fn on_sent(&mut self, now: Timestamp, sweeps: &Sweeps) {
        let packet = self.packet(now);
        for record in sweeps {
            let entry = &mut self.entries[slot(record.sequence)];
            if !entry.is_in_round(&packet) {
                entry.rounds = entry.rounds.saturating_add(1);
                entry.round_from = packet.number;
                if entry.rounds == 2 {
                    self.copies.on_second_round();
                }
            }
            entry.sent_at = now;
        }
        self.packets_sent += 1;
    }

    fn packet(&self, now: Timestamp) -> Packet {
        Packet {
            now,
            number: self.packets_sent,
            round: self.copies.packets(),
            wait_ns: self.wait.span().as_nanos() as u64,
        }
    }

    /// Number of the first of the newest sweeps that have not had their first round and find `room`, and the bytes that
    /// they take.
    fn fresh(&self, packet: &Packet, room: usize) -> (u32, usize) {
        let (mut first, mut bytes, mut behind) = (self.next, 0, 0);
        for entry in self.newest_first() {
            let together = behind + usize::from(entry.alone);
            if !entry.is_fresh(packet) || room < together {
                break;
            }
            (first, bytes) = (entry.record.sequence, together);
            behind += usize::from(entry.behind);
        }
        (first, bytes)
    }

    /// Those before number `end` that are in a later round, or that newer ones crowded out of their first, as long as
    /// the packet takes less than `room`.
    fn fill_overdue(&mut self, packet: &Packet, end: u32, room: usize, sweeps: &mut Sweeps) {
        let from = if (self.oldest..end).contains(&self.search) {
            self.search
        } else {
            self.oldest
        };
        let mut looks = 0;
        for (start, stop) in [(from, end), (self.oldest, from)] {
            self.search = start;
            while let Some(sequence) = self.next_missing(self.search, stop) {
                self.search = sequence;
                looks += 1;
                if LOOKS < looks {
                    return;
                }
                let entry = &self.entries[slot(sequence)];
                if entry.is_due(packet) {
                    let is_behind = sweeps
                        .last()
                        .is_some_and(|last| last.sequence + 1 == sequence);
                    let bytes = if is_behind { entry.behind } else { entry.alone };
                    if room < sweeps.bytes() + usize::from(bytes) {
                        return;
                    }
                    let _ = sweeps.push(entry.record);
                }
                self.search += 1;
            }
        }
    }

    fn newest_first(&self) -> impl Iterator<Item = &Entry> {
        (self.oldest..self.next)
            .rev()
            .map(|sequence| &self.entries[slot(sequence)])
    }

    /// Everything from `first` to `last` has come.
    fn come(&mut self, first: u32, last: u32) {
        let mut sequence = first;
        while let Some(missing) = self.next_missing(sequence, last + 1) {
            let (word, bit) = place(missing);
            self.missing[word] &= !bit;
            if self.entries[slot(missing)].rounds <= 1 {
                self.copies.on_first_round_that_came();
            }
            sequence = missing + 1;
        }
    }

    fn set_missing(&mut self, sequence: u32) {
        let (word, bit) = place(sequence);
        self.missing[word] |= bit;
    }

    /// The first number from `from` on and below `end` that waits and has not come.
    fn next_missing(&self, from: u32, end: u32) -> Option<u32> {
        let mut sequence = from;
        while sequence < end {
            let (word, bit) = place(sequence);
            let ahead = (self.missing[word] & !(bit - 1)).trailing_zeros();
            let at = bit.trailing_zeros();
            if ahead < u64::BITS {
                sequence += ahead - at;
                return (sequence < end).then_some(sequence);
            }
            sequence += u64::BITS - at;
        }
        None
    }
}

fn slot(sequence: u32) -> usize {
    sequence as usize % WINDOW
}

/// Word and bit of a number.
fn place(sequence: u32) -> (usize, u64) {
    let position = slot(sequence);
    (position / 64, 1 << (position % 64))
}

#[cfg(test)]
mod tests {
    use teleclay_proto::frame::Gap;

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
        line.log.on_round_trip(Timestamp::ZERO, TICK * 80);
        let round = |line: &mut Line, pause: u32, copies: u32, expected: &[u32]| {
            for _ in 1..pause {
                assert!(line.packet().is_empty());
            }
            for _ in 0..copies {
                assert_eq!(line.packet(), expected);
            }
        };
        round(&mut line, 1, 4, &[1, 2, 3]);
        // 1.25 round trips and 20 ms after the last copy, then half of that, and so on down to every packet. Two that
        // needed a second round make rounds a packet longer.
        line.log.on_acknowledged(1, &Gaps::default());
        round(&mut line, 120, 5, &[2, 3]);
        line.log.on_acknowledged(1, &gaps(&[[1, 1]]));
        for pause in [60, 30, 15, 8, 4, 2, 1, 1, 1] {
            round(&mut line, pause, 5, &[2]);
        }
    }

    fn gaps(pairs: &[[u16; 2]]) -> Gaps {
        let mut gaps = Gaps::default();
        for &[missing, come] in pairs {
            gaps.push(Gap { missing, come }).unwrap();
        }
        gaps
    }

    /// A sweep a tick for 20 s over a line of 100 ms round trip that lets this share of packets through, each way, by
    /// lot. Gives the most that waited, and the sweeps carried.
    fn over_a_line(share: f64) -> (usize, usize) {
        let mut log = SweepLog::default();
        log.on_round_trip(Timestamp::ZERO, TICK * 100);
        let mut inbox = crate::replica::SweepInbox::default();
        let mut up = std::collections::VecDeque::new();
        let mut down = std::collections::VecDeque::new();
        let mut now = Timestamp::ZERO;
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
            up.push_back(passes().then_some(sweeps));
            if up.len() == 50
                && let Some(Some(sweeps)) = up.pop_front()
            {
                for record in &sweeps {
                    inbox.on_sweep(record.sequence);
                }
            }
            let mut gaps = Gaps::default();
            inbox.fill(&mut gaps);
            down.push_back(passes().then_some((inbox.complete(), gaps)));
            if down.len() == 50
                && let Some(Some((complete, gaps))) = down.pop_front()
            {
                log.on_acknowledged(complete, &gaps);
                log.on_durable(complete);
            }
            most = most.max(log.waiting());
        }
        (most, carried)
    }

    #[test]
    fn a_line_that_lets_one_packet_in_ten_through_keeps_up_and_a_good_one_is_not_shouted_at() {
        let (most, _) = over_a_line(0.1);
        assert!(most < 500, "{most} sweeps waited");
        // A round trip's worth, and each one went out as often as it always does.
        assert!(over_a_line(1.0).0 <= 101);
        assert_eq!(over_a_line(1.0).1, 20_000 * 4 - 6);
        // With a tenth lost, one sweep in ten thousand loses all its copies; what came behind it is not repeated for
        // that.
        let (most, carried) = over_a_line(0.9);
        assert!(most < 400, "{most} sweeps waited");
        assert!(carried < 20_000 * 4 * 21 / 20, "{carried}");
    }

    #[test]
    fn an_acknowledgement_that_cannot_be_counts_for_nothing() {
        let mut line = Line::of(5);
        line.log.on_acknowledged(3, &Gaps::default());
        line.log.on_acknowledged(2, &Gaps::default());
        line.log.on_acknowledged(99, &gaps(&[[1, 1]]));
        assert_eq!(line.log.waiting(), 2);
        // Of gaps that leave the log counts what comes before they do.
        line.log.on_acknowledged(3, &gaps(&[[1, 7]]));
        line.log.on_acknowledged(1, &gaps(&[[u16::MAX, u16::MAX]]));
        line.packet();
        for _ in 0..4 {
            line.log.packets_sent += 1;
        }
        line.now = line.now.after(TICK * 1000);
        assert_eq!(line.packet(), [4, 5]);
    }

    #[test]
    fn what_has_come_is_not_repeated_and_for_another_receiver_it_has_not_come() {
        let mut line = Line::of(6);
        for _ in 0..4 {
            line.packet();
        }
        // Older and newer acknowledgements in any order.
        line.log.on_acknowledged(1, &gaps(&[[1, 1], [1, 1]]));
        line.log.on_acknowledged(0, &gaps(&[[1, 2]]));
        line.log.on_durable(1);
        line.now = line.now.after(TICK * 1000);
        assert_eq!(line.packet(), [4, 6]);
        line.log.forget_what_came();
        line.now = line.now.after(TICK * 1000);
        assert_eq!(line.packet(), [2, 3, 4, 5, 6]);
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
        log.on_acknowledged(1, &Gaps::default());
        assert_eq!(
            log.push([0; 3], [1; 3]),
            Err(LogFull),
            "it may be asked for again"
        );
        log.on_durable(1);
        assert_eq!(log.push([0; 3], [1; 3]), Ok(WINDOW as u32 + 1));
        assert_eq!((log.waiting(), log.kept()), (WINDOW, WINDOW));
    }

    #[test]
    fn a_receiver_that_has_less_gets_what_it_lacks_and_nothing_that_is_durable() {
        let mut line = Line::of(9);
        line.packet();
        line.log.on_acknowledged(6, &gaps(&[[1, 1]]));
        // Of what is not acknowledged nothing is durable.
        line.log.on_durable(2);
        line.log.on_durable(1);
        assert_eq!((line.log.waiting(), line.log.kept()), (3, 7));
        line.log.forget_what_came();
        line.log.on_acknowledged(4, &Gaps::default());
        line.now = line.now.after(TICK * 1000);
        assert_eq!(line.packet(), [5, 6, 7, 8, 9]);
        line.log.on_durable(99);
        assert_eq!((line.log.acknowledged(), line.log.kept()), (4, 5));
        line.log.on_acknowledged(9, &Gaps::default());
        line.log.on_durable(9);
        assert_eq!((line.log.waiting(), line.log.kept()), (0, 0));
    }
}
