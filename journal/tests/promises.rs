//! Ten thousand disks that fail in every way that a disk may, on virtual time: no promise is broken.
//!
//! A life is a writer from its opening to a crash or a kill. What it called durable has to be there in every later
//! life, once and in its place; what else is found has to be what was pushed. When the disk works again, the writer has
//! to go on by itself.

use std::time::Duration;

use teleclay_journal::memory::{Faults, Memory};
use teleclay_journal::{Policy, Reader, Snapshot, State, Storage, Writer, compact, write_snapshot};

const SEEDS: u64 = 10_000;
const LIVES: u64 = 4;

/// Small, so that every seed sees many segments and compactions.
const POLICY: Policy = Policy {
    segment_bytes: 1024,
    backlog_bytes: 4096,
    commit_within: Duration::from_millis(8),
    most_bytes: 6 * 1024,
    kept_snapshots: 2,
};

#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    lives: u64,
    records: u64,
    durable: u64,
    failures: u64,
    snapshots: u64,
    compactions: u64,
    cut_off: u64,
}

/// A disk, and what was promised of it.
struct World {
    disk: Memory,
    lot: u64,
    now: Duration,
    /// The payload of each record, from number 1.
    pushed: Vec<Vec<u8>>,
    /// The same of earlier lives. Of what nobody was promised, one of them may be found.
    earlier: Vec<Vec<Vec<u8>>>,
    promised: u64,
    promised_snapshot: u64,
    counts: Counts,
}

impl World {
    fn new(seed: u64) -> Self {
        Self {
            disk: Memory::new(seed ^ 0xD15C),
            lot: seed,
            now: Duration::ZERO,
            pushed: Vec::new(),
            earlier: Vec::new(),
            promised: 0,
            promised_snapshot: 0,
            counts: Counts::default(),
        }
    }

    fn draw(&mut self, below: u64) -> u64 {
        self.lot = self
            .lot
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.lot >> 33) % below
    }

    /// What a snapshot at this number holds.
    fn snapshot_of(&self, sequence: u64) -> Vec<u8> {
        let records = &self.pushed[..sequence as usize];
        let sum = records
            .iter()
            .flatten()
            .map(|byte| u64::from(*byte))
            .sum::<u64>();
        sum.to_le_bytes().repeat(20)
    }

    fn open(&mut self) -> Writer<Memory> {
        let reader = Reader::verify(self.disk.clone()).unwrap();
        assert_eq!(reader.damage(), [], "a disk that fails is not damaged");
        let quick = Reader::open(self.disk.clone()).unwrap();
        assert_eq!((quick.last(), quick.damage()), (reader.last(), &[][..]));
        assert!(quick.epoch() == reader.epoch() && quick.durable() <= quick.last());
        let last = reader.last();
        assert!(
            self.promised <= last,
            "{} was durable, {last} is left",
            self.promised
        );
        self.adopt(&reader);
        let newest = reader.snapshots().last().copied().unwrap_or(0);
        assert!(self.promised_snapshot <= newest);
        for sequence in reader.snapshots() {
            let snapshot = reader.snapshot_before(*sequence).unwrap().unwrap();
            assert_eq!(snapshot.sequence, *sequence);
            assert_eq!(snapshot.payload, self.snapshot_of(*sequence));
        }
        let oldest = reader.snapshots().first().copied().unwrap_or(0);
        assert_eq!(reader.first(), oldest + 1);
        for reader in [&reader, &quick] {
            let mut expected = reader.first();
            for record in reader.records_from(expected) {
                let record = record.unwrap();
                assert_eq!(record.sequence, expected, "nothing twice, nothing missing");
                assert_eq!(record.payload, self.pushed[expected as usize - 1]);
                expected += 1;
            }
            assert_eq!(expected, last + 1);
        }
        self.counts.cut_off += reader.remarks().len() as u64;
        let writer = Writer::go_on(reader, POLICY).unwrap();
        assert!(matches!(
            Writer::go_on(Reader::open(self.disk.clone()).unwrap(), POLICY),
            Err(teleclay_journal::OpenError::InUse)
        ));
        writer
    }

    /// What was found is what one life has pushed, and what was promised is of the last one.
    fn adopt(&mut self, reader: &Reader<Memory>) {
        let mut found: Vec<Vec<u8>> = self.pushed[..reader.first() as usize - 1].to_vec();
        for record in reader.records_from(reader.first()) {
            found.push(record.unwrap().payload);
        }
        assert!(reader.last() == found.len() as u64);
        let promised = self.promised as usize;
        assert_eq!(found[..promised], self.pushed[..promised]);
        self.earlier.push(std::mem::take(&mut self.pushed));
        let mut lives = self.earlier.iter();
        assert!(
            lives.any(|life| life.starts_with(&found)),
            "nobody has pushed that"
        );
        self.pushed = found;
    }

    fn faults(&mut self) -> Faults {
        if self.draw(3) == 0 {
            return Faults::default();
        }
        let mut often = || [0, 0, 20, 200][self.draw(4) as usize];
        Faults {
            write: often(),
            short_write: often(),
            sync: often(),
            sync_directory: often(),
            name: often(),
            room: (self.draw(4) == 0).then(|| self.draw(8) * 1024),
            is_read_only: self.draw(20) == 0,
        }
    }

    fn live(&mut self) {
        self.counts.lives += 1;
        let mut writer = self.open();
        let faults = self.faults();
        self.disk.set_faults(faults);
        if self.draw(2) == 0 {
            let fuse = self.draw(60) as u32;
            self.disk.set_fuse(fuse);
        }
        for _ in 0..10 + self.draw(60) {
            self.act(&mut writer);
            if self.disk.is_dead() {
                break;
            }
        }
        match self.draw(4) {
            0 => self.disk.kill(),
            1 if !self.disk.is_dead() => {
                self.recover(&mut writer);
                self.disk.crash();
            }
            _ => self.disk.crash(),
        }
    }

    fn act(&mut self, writer: &mut Writer<Memory>) {
        match self.draw(20) {
            0 => {
                let faults = self.faults();
                self.disk.set_faults(faults);
            }
            1 => self.snapshot(writer),
            2..7 => {
                let passed_us = self.draw(60_000);
                self.now += Duration::from_micros(passed_us);
            }
            _ => {
                let length = [8, 30, 200][self.draw(3) as usize];
                let payload: Vec<u8> = (0..self.draw(length))
                    .map(|_| self.draw(256) as u8)
                    .collect();
                if let Ok(sequence) = writer.push(self.now, &payload) {
                    self.pushed.push(payload);
                    self.counts.records += 1;
                    assert_eq!(sequence, self.pushed.len() as u64);
                }
                self.now += Duration::from_millis(1);
            }
        }
        let was_well = !matches!(writer.state(), State::Failed(_));
        writer.step(self.now);
        self.note(writer);
        if matches!(writer.state(), State::Failed(_)) && was_well {
            self.counts.failures += 1;
        }
    }

    /// What is called durable counts from now on, unless the power was off when it was said.
    fn note(&mut self, writer: &Writer<Memory>) {
        assert!(self.promised <= writer.durable() || self.promised <= writer.last());
        assert_eq!(writer.last(), self.pushed.len() as u64);
        self.counts.durable += writer.durable().saturating_sub(self.promised);
        self.promised = self.promised.max(writer.durable());
    }

    fn snapshot(&mut self, writer: &Writer<Memory>) {
        let sequence = writer.durable();
        if sequence == 0 {
            return;
        }
        let snapshot = Snapshot {
            sequence,
            epoch: writer.epoch(),
            payload: self.snapshot_of(sequence),
        };
        let mut storage = self.disk.clone();
        if write_snapshot(&mut storage, &snapshot).is_ok() {
            self.promised_snapshot = sequence;
            self.counts.snapshots += 1;
            let before = storage.list().unwrap().len();
            let compacted = compact(&mut storage, writer.policy());
            let after = storage.list().unwrap().len();
            self.counts.compactions += u64::from(after < before);
            if let Ok(bytes) = compacted {
                let taken: u64 = storage
                    .list()
                    .unwrap()
                    .iter()
                    .map(|entry| entry.bytes)
                    .sum();
                assert_eq!(bytes, taken);
            }
        }
    }

    /// The disk works again: everything becomes durable without help, and then within 20 ms.
    fn recover(&mut self, writer: &mut Writer<Memory>) {
        self.disk.set_faults(Faults::default());
        self.disk.set_fuse(u32::MAX);
        let deadline = self.now + Duration::from_secs(3);
        while self.now < deadline && writer.state() != State::Durable {
            self.now += Duration::from_millis(1);
            writer.step(self.now);
        }
        assert_eq!(
            writer.state(),
            State::Durable,
            "it does not go on by itself"
        );
        self.note(writer);
        writer.push(self.now, &[7; 9]).unwrap();
        self.pushed.push(vec![7; 9]);
        for _ in 0..20 {
            self.now += Duration::from_millis(1);
            writer.step(self.now);
        }
        self.note(writer);
        assert_eq!(self.promised, self.pushed.len() as u64);
    }
}

#[test]
#[allow(clippy::print_stdout, reason = "the counts are a result")]
fn ten_thousand_disks_that_fail_break_no_promise() {
    let parts: Vec<_> = (0..2_u64)
        .map(|part| std::thread::spawn(move || run_seeds(part * SEEDS / 2..(part + 1) * SEEDS / 2)))
        .collect();
    let mut all = Counts::default();
    for part in parts {
        let counts = part.join().unwrap();
        all.lives += counts.lives;
        all.records += counts.records;
        all.durable += counts.durable;
        all.failures += counts.failures;
        all.snapshots += counts.snapshots;
        all.compactions += counts.compactions;
        all.cut_off += counts.cut_off;
    }
    println!("{SEEDS} seeds, 0 broken promises: {all:?}");
    assert_eq!(all.lives, SEEDS * LIVES);
    assert!(100_000 < all.durable && 10_000 < all.failures && 10_000 < all.cut_off);
    assert!(10_000 < all.snapshots && 1_000 < all.compactions);
}

fn run_seeds(seeds: std::ops::Range<u64>) -> Counts {
    let mut all = Counts::default();
    for seed in seeds {
        let outcome = std::panic::catch_unwind(|| {
            let mut world = World::new(seed);
            (0..LIVES).for_each(|_| world.live());
            world.open();
            world.counts
        });
        let counts = outcome.unwrap_or_else(|_| panic!("seed {seed} breaks a promise"));
        all.lives += counts.lives;
        all.records += counts.records;
        all.durable += counts.durable;
        all.failures += counts.failures;
        all.snapshots += counts.snapshots;
        all.compactions += counts.compactions;
        all.cut_off += counts.cut_off;
    }
    all
}
