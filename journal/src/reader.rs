//! What a directory holds: records, snapshots, damage.
//!
//! Segments overlap where a writer went on after a failure or a crash, with the same records under the same numbers. A
//! record counts in the newest file that holds it whole, with all before it in that file, unless a newer file says that
//! it begins before that record was made. What a crash left torn at an end is cut off there, at the last whole record.
//!
//! Everything from the oldest snapshot on, or from number 1, up to what any file tells to have been durable has to be
//! there; where it is not, that is damage.

use std::io;

use crate::segment::{self, End, Header, HeaderError, Scan};
use crate::snapshot::{self, Snapshot};
use crate::storage::{Entry, Storage};

/// A directory that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The storage fails.
    #[error("reading {file}: {error}")]
    Storage {
        /// What was read.
        file: String,
        /// What came.
        error: io::Error,
    },
    /// A later program wrote it.
    #[error("{file}: {error}")]
    Newer {
        /// The file.
        file: String,
        /// Which version, and which ones are read.
        error: HeaderError,
    },
}

/// A record that is not as it was when it was durable.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}, record {record}, byte {offset}: {reason}")]
pub struct Damage {
    /// The file.
    pub file: String,
    /// Where in it, bytes.
    pub offset: u64,
    /// The first record that is missing.
    pub record: u64,
    /// What is there instead.
    pub reason: &'static str,
}

/// Bytes that are no record and need not be one: a torn end, or what a newer file stands for. Shown as damage is.
pub type Remark = Damage;

/// A record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// Its number, from 1.
    pub sequence: u64,
    /// What it means is the caller's business.
    pub payload: Vec<u8>,
}

/// A segment as it was found.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Segment {
    file: String,
    header: Header,
    /// Number of the last whole record; one less than the base where there is none.
    last: u64,
    end: End,
    /// Where its records end, bytes, if it was looked into.
    used: Option<u64>,
}

/// A row of records and the segment in which they count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Piece {
    from: u64,
    to: u64,
    segment: usize,
}

/// What a directory holds.
#[derive(Debug)]
pub struct Reader<S> {
    storage: S,
    segments: Vec<Segment>,
    /// In the order of the records, without a gap.
    pieces: Vec<Piece>,
    snapshots: Vec<u64>,
    next_index: u64,
    epoch: u32,
    bytes: u64,
    /// Number that is known to have been durable, because a record says so.
    durable: u64,
    damage: Vec<Damage>,
    remarks: Vec<Remark>,
}

/// How much of a directory is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Depth {
    /// What stands behind the newest snapshot.
    SinceSnapshot,
    /// Every record and snapshot.
    All,
}

impl<S: Storage> Reader<S> {
    /// Looks at the records behind the newest snapshot, and at the names of all files.
    ///
    /// # Errors
    /// The storage fails, or a later program has written there. Damage is no error: see [`Reader::damage`].
    pub fn open(storage: S) -> Result<Self, ReadError> {
        Self::look(storage, Depth::SinceSnapshot)
    }

    /// Looks at every record and every snapshot.
    ///
    /// # Errors
    /// As [`Reader::open`].
    pub fn verify(storage: S) -> Result<Self, ReadError> {
        Self::look(storage, Depth::All)
    }

    /// What is not as it was when it was durable. A journal with damage is not to be written on.
    #[must_use]
    pub fn damage(&self) -> &[Damage] {
        &self.damage
    }

    /// Torn ends and leftovers: nothing of them was durable, or a newer file stands for it.
    #[must_use]
    pub fn remarks(&self) -> &[Remark] {
        &self.remarks
    }

    /// Number of the last record; 0 where there is none.
    #[must_use]
    pub fn last(&self) -> u64 {
        let in_segments = self.pieces.last().map_or(0, |piece| piece.to);
        in_segments.max(self.snapshots.last().copied().unwrap_or(0))
    }

    /// Number of the first record that counts: the one behind the oldest snapshot, or 1 where there is none.
    #[must_use]
    pub fn first(&self) -> u64 {
        self.snapshots.first().map_or(1, |oldest| oldest + 1)
    }

    /// Number up to which records are known to have been durable. What follows was read, and may be lost yet.
    #[must_use]
    pub fn durable(&self) -> u64 {
        self.durable
    }

    /// Segments that hold nothing but zeros behind their records, and where these begin: room that was reserved and not
    /// needed. Whoever goes on writes into another file.
    pub fn spare(&self) -> impl Iterator<Item = (&str, u64)> {
        let clean = self
            .segments
            .iter()
            .filter(|segment| segment.end == End::Clean);
        clean.filter_map(|segment| Some((&*segment.file, segment.used?)))
    }

    /// How many writers there were.
    #[must_use]
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// What all files take, bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Numbers of the snapshots, oldest first.
    #[must_use]
    pub fn snapshots(&self) -> &[u64] {
        &self.snapshots
    }

    /// The newest snapshot that stands for no more than the records up to `sequence`.
    ///
    /// # Errors
    /// The storage fails, or the snapshot is damaged.
    pub fn snapshot_before(&self, sequence: u64) -> Result<Option<Snapshot>, Fault> {
        let at = self.snapshots.partition_point(|number| *number <= sequence);
        let number = at.checked_sub(1).map(|index| self.snapshots[index]);
        number.map(|number| self.snapshot(number)).transpose()
    }

    /// The records from number `sequence` on, a segment in memory at a time.
    pub fn records_from(&self, sequence: u64) -> impl Iterator<Item = Result<Record, Fault>> {
        let wanted = self.pieces.iter().filter(move |piece| sequence <= piece.to);
        wanted.flat_map(move |piece| match self.records_of(piece) {
            Ok(records) => {
                let kept = records
                    .into_iter()
                    .filter(move |record| sequence <= record.sequence);
                kept.map(Ok).collect()
            }
            Err(fault) => vec![Err(fault)],
        })
    }

    /// The storage, to go on with.
    pub(crate) fn into_storage(self) -> S {
        self.storage
    }

    pub(crate) fn next_index(&self) -> u64 {
        self.next_index
    }

    fn look(storage: S, depth: Depth) -> Result<Self, ReadError> {
        let entries = storage.list();
        let entries = entries.map_err(|error| storage_error("the directory", error))?;
        let mut snapshots: Vec<u64> = entries
            .iter()
            .filter_map(|entry| snapshot::of_file_name(&entry.name))
            .collect();
        snapshots.sort_unstable();
        let mut reader = Self {
            storage,
            segments: Vec::new(),
            pieces: Vec::new(),
            snapshots,
            next_index: 1,
            epoch: 0,
            bytes: entries.iter().map(|entry| entry.bytes).sum(),
            durable: 0,
            damage: Vec::new(),
            remarks: Vec::new(),
        };
        reader.look_at_snapshots(depth)?;
        reader.look_at_segments(entries, depth)?;
        Ok(reader)
    }

    fn look_at_snapshots(&mut self, depth: Depth) -> Result<(), ReadError> {
        let skipped = match depth {
            Depth::All => 0,
            Depth::SinceSnapshot => self.snapshots.len().saturating_sub(1),
        };
        for number in self.snapshots.clone().into_iter().skip(skipped) {
            match self.snapshot(number) {
                Ok(snapshot) => {
                    self.epoch = self.epoch.max(snapshot.epoch);
                    self.durable = self.durable.max(number);
                }
                Err(Fault::Damage(damage)) => self.damage.push(damage),
                Err(Fault::Read(error)) => return Err(error),
            }
        }
        Ok(())
    }

    fn look_at_segments(&mut self, entries: Vec<Entry>, depth: Depth) -> Result<(), ReadError> {
        let mut files: Vec<(Header, String)> = entries
            .into_iter()
            .filter_map(|entry| Some((Header::of_file_name(&entry.name)?, entry.name)))
            .collect();
        files.sort_by_key(|(header, _)| header.index);
        self.next_index = files.last().map_or(1, |(header, _)| header.index + 1);
        let epochs = files.iter().map(|(header, _)| header.epoch);
        self.epoch = epochs.fold(self.epoch, u32::max);
        for (named, file) in &files {
            if let Some(header) = self.header_of(file, named.base)? {
                self.segments.push(Segment {
                    file: file.clone(),
                    header,
                    last: header.base - 1,
                    end: End::Clean,
                    used: None,
                });
            }
        }
        let newest = self.snapshots.last().copied().unwrap_or(0);
        let (mut next, mut claimed) = (u64::MAX, u64::MAX);
        for place in (0..self.segments.len()).rev() {
            let header = self.segments[place].header;
            if depth == Depth::SinceSnapshot && claimed <= newest {
                // Not looked into: it holds nothing newer than the snapshot, and all before the next base.
                self.segments[place].last = next - 1;
            } else {
                self.scan(place)?;
            }
            next = next.min(header.base);
            claimed = header.claimed;
        }
        self.join();
        Ok(())
    }

    /// The header of a segment, if it has one.
    fn header_of(&mut self, file: &str, record: u64) -> Result<Option<Header>, ReadError> {
        let front = self.storage.read_front(file, segment::HEADER_BYTES);
        match Header::decode(&front.map_err(|error| storage_error(file, error))?) {
            Ok(header) => Ok(Some(header)),
            Err(error @ HeaderError::Newer { .. }) => Err(ReadError::Newer {
                file: file.to_owned(),
                error,
            }),
            Err(HeaderError::Broken) => {
                let broken = Damage {
                    file: file.to_owned(),
                    offset: 0,
                    record,
                    reason: "the header does not check",
                };
                // Records are written only behind a header that is durable.
                if segment::has_records(&self.bytes_of(file)?) {
                    self.damage.push(broken);
                } else {
                    self.remarks.push(broken);
                }
                Ok(None)
            }
        }
    }

    fn scan(&mut self, place: usize) -> Result<(), ReadError> {
        let bytes = self.bytes_of(&self.segments[place].file)?;
        let segment = &mut self.segments[place];
        let scan = Scan::of(&bytes, &segment.header);
        segment.last = scan.last(&segment.header);
        let told = scan.records.iter().map(|found| found.durable).max();
        // A file begins only when what stands before it is durable.
        let told = told.unwrap_or(0).max(segment.header.base - 1);
        self.durable = self.durable.max(told);
        if let End::Broken { durable, .. } = scan.end {
            self.durable = self.durable.max(durable);
        }
        let used = scan.records.last().map(|found| found.payload.end);
        segment.used = Some(used.unwrap_or(segment::HEADER_BYTES) as u64);
        segment.end = scan.end;
        Ok(())
    }

    /// Joins the segments to one row of records, and says where it is not whole.
    fn join(&mut self) {
        let mut pieces: Vec<Piece> = Vec::new();
        for (segment, of) in self.segments.iter().enumerate() {
            // A file that was removed, and is there again after a crash, goes on with what was never so.
            for older in &mut pieces {
                older.to = older.to.min(of.header.claimed);
            }
            let piece = Piece {
                from: of.header.base,
                to: of.last,
                segment,
            };
            lay_over(&mut pieces, piece);
        }
        pieces.sort_unstable_by_key(|piece| piece.from);
        let mut expected = self.first();
        for mut piece in pieces {
            // What stands before the oldest snapshot is about to be removed.
            piece.from = piece.from.max(self.first());
            expected = expected.max(self.first());
            if piece.to < piece.from {
                continue;
            }
            if expected < piece.from {
                self.report(expected, piece.segment);
            }
            expected = piece.to + 1;
            self.pieces.push(piece);
        }
        if self.last() < self.durable {
            self.report(self.last() + 1, self.segments.len().saturating_sub(1));
        }
        self.remark_on_ends();
    }

    fn end_at(&self, record: u64) -> Option<Damage> {
        let ends = self.segments.iter().rev().filter_map(Segment::broken_end);
        ends.into_iter().find(|end| end.record == record)
    }

    /// A record that is needed is missing: by the end that a segment has there, or before the segment that goes on.
    fn report(&mut self, record: u64, next: usize) {
        if self.damage.iter().any(|damage| damage.record == record) {
            return;
        }
        let found = self.end_at(record).unwrap_or_else(|| Damage {
            file: self
                .segments
                .get(next)
                .map_or_else(String::new, |segment| segment.file.clone()),
            offset: 0,
            record,
            reason: "records are missing that were durable",
        });
        self.damage.push(found);
    }

    fn remark_on_ends(&mut self) {
        let ends = self.segments.iter().filter_map(Segment::broken_end);
        let others = ends.filter(|end| !self.damage.contains(end));
        self.remarks.extend(others.collect::<Vec<_>>());
    }

    fn snapshot(&self, number: u64) -> Result<Snapshot, Fault> {
        let file = snapshot::file_name(number);
        let bytes = self.bytes_of(&file)?;
        match Snapshot::decode(&bytes) {
            Ok(snapshot) if snapshot.sequence == number => Ok(snapshot),
            Err(error @ HeaderError::Newer { .. }) => {
                Err(Fault::Read(ReadError::Newer { file, error }))
            }
            _ => Err(Fault::Damage(Damage {
                file,
                offset: 0,
                record: number,
                reason: "the snapshot does not check",
            })),
        }
    }

    fn records_of(&self, piece: &Piece) -> Result<Vec<Record>, Fault> {
        let segment = &self.segments[piece.segment];
        let bytes = self.bytes_of(&segment.file)?;
        let scan = Scan::of(&bytes, &segment.header);
        if scan.last(&segment.header) < piece.to {
            let offset = scan.records.last().map_or(0, |found| found.payload.end);
            return Err(Fault::Damage(Damage {
                file: segment.file.clone(),
                offset: offset as u64,
                record: scan.last(&segment.header) + 1,
                reason: "the record does not check",
            }));
        }
        let wanted = scan.records.into_iter();
        Ok(wanted
            .filter(|found| (piece.from..=piece.to).contains(&found.sequence))
            .map(|found| Record {
                sequence: found.sequence,
                payload: bytes[found.payload].to_vec(),
            })
            .collect())
    }

    fn bytes_of(&self, file: &str) -> Result<Vec<u8>, ReadError> {
        let bytes = self.storage.read(file);
        bytes.map_err(|error| storage_error(file, error))
    }
}

/// Why something could not be read.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The storage fails, or a later program has written there.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It is not as it was when it was durable.
    #[error(transparent)]
    Damage(#[from] Damage),
}

impl Segment {
    fn broken_end(&self) -> Option<Damage> {
        match &self.end {
            End::Clean => None,
            End::Broken {
                offset,
                record,
                reason,
                ..
            } => Some(Damage {
                file: self.file.clone(),
                offset: *offset as u64,
                record: *record,
                reason,
            }),
        }
    }
}

/// Lays a newer piece over older ones, which count only beside it.
fn lay_over(pieces: &mut Vec<Piece>, newer: Piece) {
    let mut beside = Vec::with_capacity(pieces.len() + 2);
    if newer.to < newer.from {
        return;
    }
    for older in pieces.drain(..) {
        let before = Piece {
            to: older.to.min(newer.from - 1),
            ..older
        };
        let behind = Piece {
            from: older.from.max(newer.to + 1),
            ..older
        };
        beside.extend(
            [before, behind]
                .into_iter()
                .filter(|piece| piece.from <= piece.to),
        );
    }
    beside.push(newer);
    *pieces = beside;
}

fn storage_error(file: &str, error: io::Error) -> ReadError {
    ReadError::Storage {
        file: file.to_owned(),
        error,
    }
}
