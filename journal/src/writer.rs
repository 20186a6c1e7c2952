//! The writer as a pure state machine: it is given records, the storage and the time, and says what is durable.

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use crate::policy::Policy;
use crate::reader::{Fault, ReadError, Reader};
use crate::segment::{self, HEADER_BYTES, Header, MAX_PAYLOAD, RECORD_BYTES};
use crate::storage::{Storage, write_all};

/// The first try after a failure, and the longest pause between tries.
const FIRST_RETRY: Duration = Duration::from_millis(50);
const LAST_RETRY: Duration = Duration::from_secs(2);

/// What has become of the records so far.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// All are durable.
    Durable,
    /// Some are on their way.
    Behind,
    /// The storage fails; some are not durable until it works again.
    Failed(Failure),
}

/// Why records do not become durable.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{doing}: {error}")]
pub struct Failure {
    /// What was tried.
    pub doing: &'static str,
    /// What kind of error came.
    pub kind: io::ErrorKind,
    /// The error, in the words of the storage.
    pub error: String,
}

/// A record that cannot be taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// Too much waits to become durable.
    #[error("{waiting} bytes wait to become durable, there is room for {room}")]
    Full {
        /// Bytes that wait.
        waiting: usize,
        /// Bytes that may.
        room: usize,
    },
    /// It is longer than a record may be.
    #[error("a record has {got} bytes, at most {MAX_PAYLOAD} are allowed")]
    TooLong {
        /// Its length, bytes.
        got: usize,
    },
}

/// Why a journal is not written on.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Another process writes to it.
    #[error("another process writes to this directory")]
    InUse,
    /// The storage fails.
    #[error("locking the directory: {0}")]
    Lock(io::Error),
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It is damaged.
    #[error(transparent)]
    Damaged(#[from] crate::reader::Damage),
}

/// A segment that is being written.
struct Current<F> {
    file: F,
    header: Header,
    /// Where the next record goes.
    offset: u64,
    bytes: u64,
}

/// The writer.
///
/// Call [`push`](Self::push) for each record and [`step`](Self::step) whenever [`due`](Self::due) has come; neither
/// fails for what the storage does. [`durable`](Self::durable) and [`state`](Self::state) say what has become of it.
pub struct Writer<S: Storage> {
    storage: S,
    policy: Policy,
    epoch: u32,
    next_index: u64,
    current: Option<Current<S::File>>,
    /// Everything up to this number is durable.
    durable: u64,
    /// What follows.
    pending: VecDeque<Vec<u8>>,
    pending_bytes: usize,
    /// How many of them the current file has.
    written: usize,
    /// Since when one of them waits.
    waiting_since: Option<Duration>,
    failure: Option<Failure>,
    retry_after: Duration,
    retry_at: Duration,
}

impl<S: Storage> Writer<S> {
    /// Goes on behind what a reader has found, and keeps other processes out. Nothing is written yet.
    ///
    /// What was found and is not known to have been durable counts as pushed anew: a file is trusted only by who has
    /// synced it.
    ///
    /// # Errors
    /// Another process writes there, or the journal is damaged.
    pub fn go_on(reader: Reader<S>, policy: Policy) -> Result<Self, OpenError> {
        if let Some(damage) = reader.damage().first() {
            return Err(damage.clone().into());
        }
        let durable = reader.durable().min(reader.last());
        let pending = reader
            .records_from(durable + 1)
            .map(|record| Ok(record?.payload))
            .collect::<Result<VecDeque<_>, Fault>>();
        let pending = pending.map_err(|fault| match fault {
            Fault::Read(error) => OpenError::Read(error),
            Fault::Damage(damage) => OpenError::Damaged(damage),
        })?;
        let (epoch, next_index) = (reader.epoch() + 1, reader.next_index());
        let mut storage = reader.into_storage();
        storage.lock().map_err(|error| match error.kind() {
            io::ErrorKind::WouldBlock => OpenError::InUse,
            _ => OpenError::Lock(error),
        })?;
        Ok(Self {
            storage,
            policy,
            epoch,
            next_index,
            current: None,
            durable,
            pending_bytes: pending.iter().map(|payload| held_bytes(payload)).sum(),
            waiting_since: (!pending.is_empty()).then_some(Duration::ZERO),
            pending,
            written: 0,
            failure: None,
            retry_after: FIRST_RETRY,
            retry_at: Duration::ZERO,
        })
    }

    /// Takes in a record and gives its number.
    ///
    /// # Errors
    /// There is no room, or it is too long; nothing is taken in.
    pub fn push(&mut self, now: Duration, payload: &[u8]) -> Result<u64, Refused> {
        if MAX_PAYLOAD < payload.len() {
            return Err(Refused::TooLong { got: payload.len() });
        }
        if !self.has_room_for(payload.len()) {
            return Err(Refused::Full {
                waiting: self.pending_bytes,
                room: self.policy.backlog_bytes,
            });
        }
        self.pending_bytes += held_bytes(payload);
        self.pending.push_back(payload.to_vec());
        self.waiting_since.get_or_insert(now);
        Ok(self.last())
    }

    /// Whether a record of so many bytes would be taken in.
    #[must_use]
    pub fn has_room_for(&self, payload: usize) -> bool {
        self.pending_bytes + RECORD_BYTES + payload <= self.policy.backlog_bytes
    }

    /// When [`Writer::step`] has something to do; `None` while nothing waits.
    #[must_use]
    pub fn due(&self) -> Option<Duration> {
        let commit_at = self.waiting_since? + self.policy.commit_within;
        Some(if self.failure.is_some() {
            self.retry_at
        } else {
            commit_at
        })
    }

    /// Does what is due. Waits for the storage.
    pub fn step(&mut self, now: Duration) {
        if self.due().is_some_and(|due| due <= now) {
            self.flush(now);
        }
    }

    /// Writes and syncs all that waits, due or not.
    pub fn flush(&mut self, now: Duration) {
        match self.commit() {
            Ok(()) => {
                self.failure = None;
                self.retry_after = FIRST_RETRY;
                self.waiting_since = None;
            }
            Err(failure) => self.fail(now, failure),
        }
    }

    /// Number of the last record that will be there whatever happens now.
    #[must_use]
    pub const fn durable(&self) -> u64 {
        self.durable
    }

    /// Number of the last record that was taken in.
    #[must_use]
    pub fn last(&self) -> u64 {
        self.durable + self.pending.len() as u64
    }

    /// Counts the writers of this journal, from 1: this one's number.
    #[must_use]
    pub const fn epoch(&self) -> u32 {
        self.epoch
    }

    /// What has become of the records so far.
    #[must_use]
    pub fn state(&self) -> State {
        match &self.failure {
            Some(failure) => State::Failed(failure.clone()),
            None if self.pending.is_empty() => State::Durable,
            None => State::Behind,
        }
    }

    /// The storage, for a snapshot.
    #[must_use]
    pub const fn storage(&self) -> &S {
        &self.storage
    }

    /// How the journal is kept.
    #[must_use]
    pub const fn policy(&self) -> &Policy {
        &self.policy
    }

    fn commit(&mut self) -> Result<(), Failure> {
        while self.written < self.pending.len() {
            let next = record_bytes_of(&self.pending[self.written]);
            let is_full = self
                .current
                .as_ref()
                .is_some_and(|current| current.bytes < current.offset + next);
            if is_full {
                self.sync()?;
                self.current = None;
            }
            if self.current.is_none() {
                self.current = Some(self.begin_file()?);
            }
            self.write()?;
        }
        self.sync()
    }

    /// A new segment behind what is durable.
    fn begin_file(&mut self) -> Result<Current<S::File>, Failure> {
        let header = Header {
            version: segment::VERSION,
            epoch: self.epoch,
            index: self.next_index,
            base: self.durable + 1,
            claimed: self.last(),
        };
        self.next_index += 1;
        let longest = self.pending.front().map_or(0, |next| record_bytes_of(next));
        let bytes = self.policy.segment_bytes.max(HEADER_BYTES as u64 + longest);
        let begun = self.begin_file_as(&header, bytes);
        begun.inspect_err(|_| {
            // It holds nothing. Should it stay, a reader passes over it.
            let _ = self.storage.remove(&header.file_name());
        })
    }

    fn begin_file_as(&mut self, header: &Header, bytes: u64) -> Result<Current<S::File>, Failure> {
        let storage = &mut self.storage;
        let created = storage.create(&header.file_name());
        let file = created.map_err(|error| failed("making a segment", &error))?;
        storage
            .preallocate(&file, bytes)
            .map_err(|error| failed("reserving room for a segment", &error))?;
        write_all(storage, &file, 0, &header.encode())
            .map_err(|error| failed("writing a segment's header", &error))?;
        // Records come only into a file that is there after a crash.
        storage
            .sync(&file)
            .map_err(|error| failed("syncing a segment's header", &error))?;
        storage
            .sync_directory()
            .map_err(|error| failed("syncing the directory", &error))?;
        Ok(Current {
            file,
            header: *header,
            offset: HEADER_BYTES as u64,
            bytes,
        })
    }

    /// Writes as many records as the current file has room for.
    fn write(&mut self) -> Result<(), Failure> {
        let Some(current) = &mut self.current else {
            return Ok(());
        };
        let mut bytes = Vec::new();
        let mut count = 0;
        for payload in self.pending.iter().skip(self.written) {
            let end = current.offset + bytes.len() as u64 + record_bytes_of(payload);
            if current.bytes < end {
                break;
            }
            let sequence = self.durable + (self.written + count) as u64 + 1;
            segment::push_record(&mut bytes, sequence, self.durable, payload);
            count += 1;
        }
        write_all(&mut self.storage, &current.file, current.offset, &bytes)
            .map_err(|error| failed("writing records", &error))?;
        current.offset += bytes.len() as u64;
        self.written += count;
        Ok(())
    }

    /// Makes durable what the current file has.
    fn sync(&mut self) -> Result<(), Failure> {
        if let (Some(current), true) = (&self.current, 0 < self.written) {
            let synced = self.storage.sync(&current.file);
            synced.map_err(|error| failed("syncing records", &error))?;
        }
        let durable = self.pending.drain(..self.written);
        self.pending_bytes -= durable.map(|payload| held_bytes(&payload)).sum::<usize>();
        self.durable += std::mem::take(&mut self.written) as u64;
        Ok(())
    }

    /// Nobody knows what the current file holds of what is not durable: all of that goes into a new one.
    fn fail(&mut self, now: Duration, failure: Failure) {
        self.written = 0;
        if let Some(current) = self.current.take()
            && self.durable < current.header.base
        {
            let _ = self.storage.remove(&current.header.file_name());
        }
        self.failure = Some(failure);
        self.retry_at = now + self.retry_after;
        self.retry_after = (2 * self.retry_after).min(LAST_RETRY);
    }
}

fn held_bytes(payload: &[u8]) -> usize {
    segment::record_bytes(payload.len())
}

fn record_bytes_of(payload: &[u8]) -> u64 {
    held_bytes(payload) as u64
}

fn failed(doing: &'static str, error: &io::Error) -> Failure {
    Failure {
        doing,
        kind: error.kind(),
        error: error.to_string(),
    }
}
