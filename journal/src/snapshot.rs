//! Layout of a snapshot, how it is written, and what may be removed once it stands.
//!
//! ```text
//!  0         8         12      16         24       32    36         40
//!  +---------+---------+-------+----------+--------+-----+----------+---------+
//!  | magic   | version | epoch | sequence | length | CRC | CRC of   | payload |
//!  | 8 bytes | u32     | u32   | u64      | u64    | u32 | 36 bytes |         |
//!  +---------+---------+-------+----------+--------+-----+----------+---------+
//! ```
//!
//! What a journal tells begins with its oldest snapshot. A snapshot is written under another name, synced, renamed, and
//! the directory synced: under its own name it is whole.

use std::io;

use crate::policy::Policy;
use crate::segment::{Header, HeaderError};
use crate::storage::{Entry, Storage, write_all};

const MAGIC: [u8; 8] = *b"tclaysnp";
const HEADER_BYTES: usize = 40;
const SUFFIX: &str = ".snapshot";
const PART: &str = ".part";

/// The version that is written.
pub const VERSION: u32 = 1;

/// What all records up to a number have come to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// The number.
    pub sequence: u64,
    /// The writer under whom it was made.
    pub epoch: u32,
    /// What it means is the caller's business.
    pub payload: Vec<u8>,
}

impl Snapshot {
    /// The bytes of the file.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEADER_BYTES + self.payload.len());
        bytes.extend_from_slice(&MAGIC);
        bytes.extend_from_slice(&VERSION.to_le_bytes());
        bytes.extend_from_slice(&self.epoch.to_le_bytes());
        bytes.extend_from_slice(&self.sequence.to_le_bytes());
        bytes.extend_from_slice(&(self.payload.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&crc32c::crc32c(&self.payload).to_le_bytes());
        let crc = crc32c::crc32c(&bytes);
        bytes.extend_from_slice(&crc.to_le_bytes());
        bytes.extend_from_slice(&self.payload);
        bytes
    }

    /// Reads a file.
    ///
    /// # Errors
    /// It does not check, or its version is newer than this program.
    pub fn decode(bytes: &[u8]) -> Result<Self, HeaderError> {
        let (header, payload) = bytes
            .split_first_chunk::<HEADER_BYTES>()
            .ok_or(HeaderError::Broken)?;
        let u32_at = |at: usize| u32::from_le_bytes(std::array::from_fn(|k| header[at + k]));
        let u64_at = |at: usize| u64::from_le_bytes(std::array::from_fn(|k| header[at + k]));
        if header[..8] != MAGIC || u32_at(36) != crc32c::crc32c(&header[..36]) {
            return Err(HeaderError::Broken);
        }
        let version = u32_at(8);
        if VERSION < version {
            return Err(HeaderError::Newer { got: version });
        }
        if u64_at(24) != payload.len() as u64 || u32_at(32) != crc32c::crc32c(payload) {
            return Err(HeaderError::Broken);
        }
        Ok(Self {
            epoch: u32_at(12),
            sequence: u64_at(16),
            payload: payload.to_vec(),
        })
    }
}

/// The file name of a snapshot.
#[must_use]
pub fn file_name(sequence: u64) -> String {
    format!("{sequence:020}{SUFFIX}")
}

/// The number that a file name tells, if it is a snapshot's.
#[must_use]
pub fn of_file_name(name: &str) -> Option<u64> {
    name.strip_suffix(SUFFIX)?.parse().ok()
}

/// Whether a file is a snapshot that was not finished.
#[must_use]
pub fn is_part(name: &str) -> bool {
    name.ends_with(PART)
}

/// Writes a snapshot so that it is there whole or not at all. It may be written beside a [`Writer`](crate::Writer) at
/// work, from another thread; its number has to be durable.
///
/// # Errors
/// The storage fails; the journal goes on without this snapshot.
pub fn write_snapshot<S: Storage>(storage: &mut S, snapshot: &Snapshot) -> io::Result<()> {
    let name = file_name(snapshot.sequence);
    let part = format!("{name}{PART}");
    // Left behind by a crash or an error, if it is there.
    let _ = storage.remove(&part);
    let written = write_as(storage, &part, &name, &snapshot.encode());
    if written.is_err() {
        let _ = storage.remove(&part);
    }
    written
}

fn write_as<S: Storage>(storage: &mut S, part: &str, name: &str, bytes: &[u8]) -> io::Result<()> {
    let file = storage.create(part)?;
    write_all(storage, &file, 0, bytes)?;
    storage.sync(&file)?;
    storage.rename(part, name)?;
    storage.sync_directory()
}

/// Removes the oldest history while the directory takes more than the policy's [`most_bytes`](Policy::most_bytes):
/// first records wholly older than the oldest snapshot, then that snapshot and the records before the next one, as long
/// as [`kept_snapshots`](Policy::kept_snapshots) are left. Gives the bytes that are left.
///
/// So a directory takes at most `most_bytes`, or what the kept snapshots and the records since the oldest of them take
/// if that is more; and beyond either a segment and a snapshot, which come before the next call.
///
/// # Errors
/// The storage fails. What was removed by then was not needed.
pub fn compact<S: Storage>(storage: &mut S, policy: &Policy) -> io::Result<u64> {
    let mut files = Files::of(storage.list()?);
    while policy.most_bytes < files.bytes {
        if files.remove_before_oldest_snapshot(storage)? {
            continue;
        }
        if files.snapshots.len() <= policy.kept_snapshots.max(1) {
            break;
        }
        let (_, oldest) = files.snapshots.remove(0);
        storage.remove(&oldest.name)?;
        files.bytes -= oldest.bytes;
        // A snapshot outlives no record that follows it.
        storage.sync_directory()?;
    }
    Ok(files.bytes)
}

/// The files of a journal, oldest first.
struct Files {
    snapshots: Vec<(u64, Entry)>,
    segments: Vec<(Header, Entry)>,
    bytes: u64,
}

impl Files {
    fn of(entries: Vec<Entry>) -> Self {
        let bytes = entries.iter().map(|entry| entry.bytes).sum();
        let (mut snapshots, mut segments) = (Vec::new(), Vec::new());
        for entry in entries {
            if let Some(sequence) = of_file_name(&entry.name) {
                snapshots.push((sequence, entry));
            } else if let Some(header) = Header::of_file_name(&entry.name) {
                segments.push((header, entry));
            }
        }
        snapshots.sort_by_key(|(sequence, _)| *sequence);
        segments.sort_by_key(|(header, _)| header.index);
        Self {
            snapshots,
            segments,
            bytes,
        }
    }

    /// Removes the oldest segment if a later one begins no later than the oldest snapshot goes on.
    fn remove_before_oldest_snapshot<S: Storage>(&mut self, storage: &mut S) -> io::Result<bool> {
        let (Some((sequence, _)), Some((next, _))) = (self.snapshots.first(), self.segments.get(1))
        else {
            return Ok(false);
        };
        if sequence + 1 < next.base {
            return Ok(false);
        }
        let (_, oldest) = self.segments.remove(0);
        storage.remove(&oldest.name)?;
        self.bytes -= oldest.bytes;
        Ok(true)
    }
}
