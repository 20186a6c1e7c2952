//! A journal in a real directory, with its thread; and what a reader says of one that was tampered with.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use teleclay_journal::memory::{Faults, Memory};
use teleclay_journal::segment::{self, Header};
use teleclay_journal::{
    Disk, OpenError, Policy, Reader, Snapshot, State, Storage, Writer, compact, start,
    write_snapshot,
};

/// A folder that is gone when the test is over.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let name = format!("teleclay-journal-{name}-{}", std::process::id());
        Self(std::env::temp_dir().join(name))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn payload(number: u64) -> Vec<u8> {
    number.to_le_bytes().repeat(1 + number as usize % 7)
}

#[test]
fn what_a_thread_called_durable_is_there_for_the_next_one() {
    let folder = Folder::new("thread");
    let mut expected = 0;
    for life in 1..=3 {
        let reader = Reader::verify(Disk::new(&folder.0).unwrap()).unwrap();
        assert_eq!(reader.damage(), []);
        assert_eq!(reader.last(), expected);
        for (number, record) in (1..).zip(reader.records_from(1)) {
            let record = record.unwrap();
            assert_eq!((record.sequence, record.payload), (number, payload(number)));
        }
        let writer = Writer::go_on(reader, Policy::default()).unwrap();
        assert_eq!(writer.epoch(), life);
        let second = Reader::open(Disk::new(&folder.0).unwrap()).unwrap();
        assert!(matches!(
            Writer::go_on(second, Policy::default()),
            Err(OpenError::InUse)
        ));
        let (mut appender, running) = start(writer).unwrap();
        for _ in 0..5000 {
            expected += 1;
            assert_eq!(appender.push(&payload(expected)), Ok(expected));
        }
        let deadline = Instant::now() + Duration::from_secs(20);
        while running.watch().durable() < expected {
            assert!(Instant::now() < deadline, "{:?}", running.watch().state());
            std::thread::yield_now();
        }
        assert!(!appender.must_pause());
        // What is pushed last is written before the thread ends.
        expected += 1;
        appender.push(&payload(expected)).unwrap();
    }
}

/// Room that a server reserved and did not need is given back, and nothing else: the records stay, also where an end is
/// torn.
#[test]
fn room_that_was_reserved_in_vain_is_given_back_and_no_record_with_it() {
    let folder = Folder::new("spare");
    let disk = Disk::new(&folder.0).unwrap();
    for _ in 1..=4 {
        let reader = Reader::open(disk.clone()).unwrap();
        let last = reader.last();
        let mut writer = Writer::go_on(reader, Policy::default()).unwrap();
        for number in last + 1..=last + 100 {
            writer.push(Duration::ZERO, &payload(number)).unwrap();
        }
        writer.flush(Duration::ZERO);
        assert_eq!(writer.durable(), last + 100);
    }
    // The second file ends in what is no record.
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder.0)
        .unwrap()
        .map(|file| file.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "segment"))
        .collect();
    files.sort();
    let mut torn = std::fs::read(&files[1]).unwrap();
    *torn.last_mut().unwrap() = 1;
    std::fs::write(&files[1], &torn).unwrap();

    let reader = Reader::verify(disk.clone()).unwrap();
    let records = |reader: &Reader<Disk>| -> Vec<_> {
        let records = reader.records_from(1);
        records.map(|record| record.unwrap().payload).collect()
    };
    let (before, bytes) = (records(&reader), reader.bytes());
    assert_eq!(before.len(), 400);
    assert_eq!(reader.spare().count(), 3);
    for (file, used) in reader.spare() {
        disk.trim(file, used).unwrap();
    }
    let trimmed = Reader::verify(disk).unwrap();
    assert_eq!(trimmed.damage(), []);
    assert_eq!(records(&trimmed), before);
    assert!(
        trimmed.bytes() < bytes / 3,
        "{} of {bytes} B",
        trimmed.bytes()
    );
    assert_eq!(std::fs::read(&files[1]).unwrap(), torn);
}

#[test]
fn a_ring_that_is_full_says_so_and_takes_again() {
    let memory = Memory::new(1);
    let writer = Writer::go_on(Reader::open(memory.clone()).unwrap(), Policy::default()).unwrap();
    memory.set_faults(Faults {
        is_read_only: true,
        ..Faults::default()
    });
    let (mut appender, running) = start(writer).unwrap();
    let record = vec![3; 1 << 17];
    let deadline = Instant::now() + Duration::from_secs(20);
    while appender.push(&record).is_ok() || !appender.must_pause() {
        assert!(Instant::now() < deadline);
    }
    assert_eq!(appender.durable(), 0);
    while !matches!(running.watch().state(), State::Failed(_)) {
        assert!(Instant::now() < deadline);
    }
    memory.set_faults(Faults::default());
    while appender.durable() < appender.last() {
        assert!(Instant::now() < deadline);
        std::thread::yield_now();
    }
    assert!(!appender.must_pause());
    assert!(appender.push(&record).is_ok());
}

/// A journal of three small segments and a snapshot, and its files.
fn small_journal() -> Memory {
    let memory = Memory::new(3);
    let policy = Policy {
        segment_bytes: 400,
        ..Policy::default()
    };
    let mut writer = Writer::go_on(Reader::open(memory.clone()).unwrap(), policy).unwrap();
    for number in 1..=30 {
        writer.push(Duration::ZERO, &payload(number)).unwrap();
        writer.flush(Duration::ZERO);
    }
    memory.kill();
    memory
}

#[test]
fn one_flipped_byte_is_noticed_and_the_record_named() {
    let memory = small_journal();
    let (mut flipped, mut damaged) = (0, 0);
    for entry in memory.list().unwrap() {
        for at in 0..entry.bytes as usize {
            memory.flip(&entry.name, at, 0x10);
            let reader = Reader::verify(memory.clone()).unwrap();
            let told = [reader.damage(), reader.remarks()].concat();
            assert!(
                told.iter()
                    .any(|told| told.file == entry.name && 0 < told.record),
                "{} byte {at}: {told:?}",
                entry.name
            );
            // But for the last record and what follows it, later ones tell that it was durable.
            damaged += u64::from(!reader.damage().is_empty());
            let is_all = reader.last() == 30;
            assert!(is_all || reader.last() == 29 || !reader.damage().is_empty());
            flipped += 1;
            memory.flip(&entry.name, at, 0x10);
        }
    }
    assert!(1500 < flipped && 1000 < damaged, "{flipped}, {damaged}");
}

#[test]
fn a_damaged_journal_is_not_written_on_and_a_newer_one_is_refused_in_words() {
    let memory = small_journal();
    let first = memory.list().unwrap()[0].name.clone();
    memory.flip(&first, 70, 1);
    let reader = Reader::open(memory.clone()).unwrap();
    let Err(error) = Writer::go_on(reader, Policy::default()) else {
        panic!("it is written on");
    };
    assert_eq!(
        error.to_string(),
        format!("{first}, record 1, byte 64: the record does not check")
    );
    let mut newer = Memory::new(1);
    let header = Header {
        version: segment::VERSION + 1,
        epoch: 1,
        index: 1,
        base: 1,
        claimed: 0,
    };
    let file = newer.create(&header.file_name()).unwrap();
    newer.write_at(&file, 0, &header.encode()).unwrap();
    let error = Reader::open(newer).unwrap_err().to_string();
    assert!(error.contains("version 3 is newer than 2"), "{error}");
}

/// Writes a segment of these numbers, each of which holds `byte`.
fn put_segment(memory: &mut Memory, header: &Header, byte: u8, to: u64) {
    let mut bytes = header.encode().to_vec();
    for sequence in header.base..=to {
        segment::push_record(&mut bytes, sequence, header.base - 1, &[byte]);
    }
    let file = memory.create(&header.file_name()).unwrap();
    memory.write_at(&file, 0, &bytes).unwrap();
}

/// A file of a failed sync is removed, its records pushed anew; the process is killed; the next one pushes others; the
/// power fails before the directory was synced.
#[test]
fn a_removed_file_that_is_there_again_adds_nothing_behind_what_a_newer_one_holds() {
    let mut memory = Memory::new(1);
    let older = Header {
        version: segment::VERSION,
        epoch: 1,
        index: 1,
        base: 1,
        claimed: 0,
    };
    put_segment(&mut memory, &older, 1, 6);
    let newer = Header {
        epoch: 2,
        index: 2,
        claimed: 1,
        ..older
    };
    put_segment(&mut memory, &newer, 2, 2);
    let reader = Reader::verify(memory).unwrap();
    let records: Vec<u8> = reader
        .records_from(1)
        .map(|record| record.unwrap().payload[0])
        .collect();
    assert_eq!((records, reader.damage()), (vec![2, 2], &[][..]));
}

#[test]
fn a_directory_keeps_within_its_bound_and_goes_back_to_its_oldest_snapshot() {
    let memory = Memory::new(5);
    let policy = Policy {
        segment_bytes: 2000,
        most_bytes: 20_000,
        ..Policy::default()
    };
    let mut writer = Writer::go_on(Reader::open(memory.clone()).unwrap(), policy).unwrap();
    let mut storage = memory.clone();
    for number in 1..=3000 {
        writer.push(Duration::ZERO, &payload(number)).unwrap();
        if number % 50 != 0 {
            continue;
        }
        writer.flush(Duration::ZERO);
        let snapshot = Snapshot {
            sequence: number,
            epoch: 1,
            payload: vec![1; 300],
        };
        write_snapshot(&mut storage, &snapshot).unwrap();
        assert!(compact(&mut storage, &policy).unwrap() <= policy.most_bytes);
    }
    let reader = Reader::verify(memory).unwrap();
    assert_eq!((reader.damage(), reader.last()), (&[][..], 3000));
    assert!(2 < reader.snapshots().len());
    let oldest = reader.snapshots()[0];
    let records = reader
        .records_from(oldest + 1)
        .map(|record| record.unwrap());
    assert_eq!(records.count() as u64, 3000 - oldest);
}
