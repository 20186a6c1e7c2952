//! Layout of a segment: a header, records, zeros up to its preallocated end. All numbers are little-endian.
//!
//! ```text
//!  0         8         12      16      24     32        40    44     64
//!  +---------+---------+-------+-------+------+---------+-----+------+--------+--------+- - -+-------+
//!  | magic   | version | epoch | index | base | claimed | CRC | zero | record | record |     | zeros |
//!  | 8 bytes | u32     | u32   | u64   | u64  | u64     | u32 |      |        |        |     |       |
//!  +---------+---------+-------+-------+------+---------+-----+------+--------+--------+- - -+-------+
//!
//!  0        4     8          16    20
//!  +--------+-----+----------+-----+---------+
//!  | length | CRC | sequence | lag | payload |
//!  | u32    | u32 | u64      | u32 |         |
//!  +--------+-----+----------+-----+---------+
//! ```
//!
//! The CRC is CRC-32C, of the header's first 40 bytes, and of all of a record but the CRC itself. `epoch` counts the
//! writers that the journal has had, `index` the files; `base` is the number of the first record, and what stands
//! before it was durable when the file began; up to `claimed` older files may hold records that were not. `lag` says
//! how far behind its number the durable one was when the record was written: so a record that follows tells of one
//! that does not check whether it was ever durable, and with that a torn end from damage. Version 1 had neither claim
//! nor lag.

use std::ops::Range;

/// What a segment begins with.
const MAGIC: [u8; 8] = *b"tclayjnl";
/// The version that is written.
pub const VERSION: u32 = 2;
/// The oldest version that is read.
pub const OLDEST_VERSION: u32 = 1;
/// Bytes of a segment's header.
pub const HEADER_BYTES: usize = 64;
/// Bytes of a record before its payload.
pub const RECORD_BYTES: usize = 20;
/// Longest payload, bytes: settings with every field written out are a fiftieth of it.
pub const MAX_PAYLOAD: usize = 1 << 18;
/// Behind a record that does not check, later ones are looked for as far as these many numbers on.
const LOOK_AHEAD: u64 = 1 << 20;

const CRC_AT: usize = 40;
const SUFFIX: &str = ".segment";

/// What a segment says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Format version.
    pub version: u32,
    /// Counts the writers of the journal, from 1.
    pub epoch: u32,
    /// Counts its files, from 1.
    pub index: u64,
    /// Number of the first record.
    pub base: u64,
    /// Older files hold no record of a later number than this.
    pub claimed: u64,
}

/// A header that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HeaderError {
    /// The bytes are no header.
    #[error("the header does not check")]
    Broken,
    /// A later program wrote it.
    #[error("format version {got} is newer than {VERSION}, the newest that this program reads")]
    Newer {
        /// The version.
        got: u32,
    },
}

impl Header {
    /// The name of the file.
    #[must_use]
    pub fn file_name(&self) -> String {
        let Self {
            index, epoch, base, ..
        } = self;
        format!("{index:08}-{epoch:06}-{base:020}{SUFFIX}")
    }

    /// What a file name tells, if it is a segment's of the version that is written.
    #[must_use]
    pub fn of_file_name(name: &str) -> Option<Self> {
        let mut parts = name.strip_suffix(SUFFIX)?.split('-');
        let index = parts.next()?.parse().ok()?;
        let epoch = parts.next()?.parse().ok()?;
        let base = parts.next()?.parse().ok()?;
        let header = Self {
            version: VERSION,
            epoch,
            index,
            base,
            claimed: u64::MAX,
        };
        (parts.next().is_none() && 0 < base).then_some(header)
    }

    /// The bytes that a segment begins with.
    #[must_use]
    pub fn encode(&self) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        bytes[..8].copy_from_slice(&MAGIC);
        bytes[8..12].copy_from_slice(&self.version.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.epoch.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.index.to_le_bytes());
        bytes[24..32].copy_from_slice(&self.base.to_le_bytes());
        bytes[32..40].copy_from_slice(&self.claimed.to_le_bytes());
        let crc = crc32c::crc32c(&bytes[..CRC_AT]);
        bytes[CRC_AT..CRC_AT + 4].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// Reads a header.
    ///
    /// # Errors
    /// It does not check, or its version is newer than this program.
    pub fn decode(bytes: &[u8]) -> Result<Self, HeaderError> {
        let bytes: &[u8; HEADER_BYTES] = bytes.first_chunk().ok_or(HeaderError::Broken)?;
        let is_whole = bytes[..8] == MAGIC
            && u32_at(bytes, CRC_AT) == crc32c::crc32c(&bytes[..CRC_AT])
            && bytes[CRC_AT + 4..].iter().all(|byte| *byte == 0);
        let version = u32_at(bytes, 8);
        if !is_whole || version < OLDEST_VERSION {
            return Err(HeaderError::Broken);
        }
        if VERSION < version {
            return Err(HeaderError::Newer { got: version });
        }
        Ok(Self {
            version,
            epoch: u32_at(bytes, 12),
            index: u64_at(bytes, 16),
            base: u64_at(bytes, 24),
            claimed: if version == 1 {
                u64::MAX
            } else {
                u64_at(bytes, 32)
            },
        })
    }
}

/// Bytes that a record takes in a segment.
#[must_use]
pub const fn record_bytes(payload: usize) -> usize {
    RECORD_BYTES + payload
}

/// Writes a record behind what `buffer` holds. `durable` is the number that is durable by now.
pub fn push_record(buffer: &mut Vec<u8>, sequence: u64, durable: u64, payload: &[u8]) {
    let start = buffer.len();
    let lag = u32::try_from(sequence - durable).unwrap_or(u32::MAX);
    buffer.extend_from_slice(&(payload.len() as u32).to_le_bytes());
    buffer.extend_from_slice(&[0; 4]);
    buffer.extend_from_slice(&sequence.to_le_bytes());
    buffer.extend_from_slice(&lag.to_le_bytes());
    buffer.extend_from_slice(payload);
    let crc = crc_of_record(&buffer[start..]);
    buffer[start + 4..start + 8].copy_from_slice(&crc.to_le_bytes());
}

fn crc_of_record(record: &[u8]) -> u32 {
    crc32c::crc32c_append(crc32c::crc32c(&record[..4]), &record[8..])
}

/// A whole record in a segment's bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Its number.
    pub sequence: u64,
    /// Where it begins.
    pub offset: usize,
    /// Where its payload is.
    pub payload: Range<usize>,
    /// The number that was durable when it was written; 0 where that is not known.
    pub durable: u64,
}

/// How the records of a segment end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// With zeros, or with the file.
    Clean,
    /// With bytes that are no record.
    Broken {
        /// Where they begin.
        offset: usize,
        /// Number of the record that should be there.
        record: u64,
        /// Why they are none.
        reason: &'static str,
        /// The number that was durable, as records behind them tell; 0 where none does.
        durable: u64,
    },
}

/// What a segment holds behind its header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scan {
    /// Whole records, their numbers without a gap from the base on.
    pub records: Vec<Found>,
    /// What follows them.
    pub end: End,
}

impl Scan {
    /// The records in the bytes of a segment, of which `header` is the header.
    #[must_use]
    pub fn of(bytes: &[u8], header: &Header) -> Self {
        let mut records: Vec<Found> = Vec::new();
        let mut offset = HEADER_BYTES.min(bytes.len());
        let mut record = header.base;
        loop {
            match record_at(bytes, offset, header.version) {
                Ok(found) if found.sequence == record => {
                    offset = found.payload.end;
                    record += 1;
                    records.push(found);
                }
                other => {
                    let end = end_at(bytes, offset, record, header.version, other.err());
                    return Self { records, end };
                }
            }
        }
    }

    /// Number of the last whole record; one less than the base where there is none.
    #[must_use]
    pub fn last(&self, header: &Header) -> u64 {
        self.records
            .last()
            .map_or(header.base - 1, |found| found.sequence)
    }
}

/// Whether any whole record stands behind a header that cannot be read: then the header was once durable.
pub(crate) fn has_records(bytes: &[u8]) -> bool {
    let first = HEADER_BYTES..bytes.len().min(HEADER_BYTES + 1);
    first
        .into_iter()
        .any(|offset| record_at(bytes, offset, VERSION).is_ok())
}

fn end_at(
    bytes: &[u8],
    offset: usize,
    record: u64,
    version: u32,
    reason: Option<&'static str>,
) -> End {
    if bytes[offset..].iter().all(|byte| *byte == 0) {
        return End::Clean;
    }
    let later = (offset + 1..bytes.len()).filter_map(|at| later_record(bytes, at, record, version));
    End::Broken {
        offset,
        record,
        reason: reason.unwrap_or("another record's number"),
        durable: later.map(|found| found.durable).max().unwrap_or(0),
    }
}

/// A whole record of a later number at this place, if there is one.
fn later_record(bytes: &[u8], at: usize, record: u64, version: u32) -> Option<Found> {
    let sequence = u64_at(bytes.get(at + 8..at + 16)?, 0);
    // Most places are told by the number alone.
    let may_be = (record + 1..record + LOOK_AHEAD).contains(&sequence);
    may_be.then(|| record_at(bytes, at, version).ok()).flatten()
}

fn record_at(bytes: &[u8], offset: usize, version: u32) -> Result<Found, &'static str> {
    let head = if version == 1 {
        RECORD_BYTES - 4
    } else {
        RECORD_BYTES
    };
    let rest = &bytes[offset..];
    if rest.len() < head {
        return Err("the file ends within the record's header");
    }
    let length = u32_at(rest, 0) as usize;
    if MAX_PAYLOAD < length {
        return Err("the record's length cannot be");
    }
    let record = rest
        .get(..head + length)
        .ok_or("the file ends within the record")?;
    if u32_at(record, 4) != crc_of_record(record) {
        return Err("the record does not check");
    }
    let sequence = u64_at(record, 8);
    let lag = (version != 1).then(|| u32_at(record, 16));
    let durable =
        lag.and_then(|lag| (lag != u32::MAX).then(|| sequence.saturating_sub(lag.into())));
    Ok(Found {
        sequence,
        offset,
        payload: offset + head..offset + head + length,
        durable: durable.unwrap_or(0),
    })
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|index| bytes[at + index]))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|index| bytes[at + index]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: Header = Header {
        version: VERSION,
        epoch: 3,
        index: 7,
        base: 100,
        claimed: u64::MAX,
    };

    fn segment(count: u64) -> Vec<u8> {
        let mut bytes = HEADER.encode().to_vec();
        for sequence in 100..100 + count {
            push_record(&mut bytes, sequence, sequence - 2, &[sequence as u8; 5]);
        }
        bytes.resize(bytes.len() + 40, 0);
        bytes
    }

    #[test]
    fn what_is_written_is_read() {
        let bytes = segment(3);
        assert_eq!(Header::decode(&bytes), Ok(HEADER));
        let scan = Scan::of(&bytes, &HEADER);
        assert_eq!(scan.end, End::Clean);
        assert_eq!(scan.last(&HEADER), 102);
        assert_eq!(bytes[scan.records[1].payload.clone()], [101; 5]);
        assert_eq!(scan.records[1].durable, 99);
        assert_eq!(Header::of_file_name(&HEADER.file_name()), Some(HEADER));
    }

    #[test]
    fn every_flipped_bit_is_noticed_and_named() {
        let whole = segment(4);
        let length = record_bytes(5);
        for at in 0..whole.len() {
            for bit in 0..8 {
                let mut bytes = whole.clone();
                bytes[at] ^= 1 << bit;
                if at < HEADER_BYTES {
                    assert!(Header::decode(&bytes).is_err(), "byte {at}");
                    continue;
                }
                let wanted = 100 + ((at - HEADER_BYTES) / length) as u64;
                let End::Broken {
                    record, durable, ..
                } = Scan::of(&bytes, &HEADER).end
                else {
                    panic!("byte {at} is not missed");
                };
                assert_eq!(record, wanted.min(104));
                // Two further records say that this one was durable by then.
                assert_eq!(record <= durable, record <= 101, "byte {at}");
            }
        }
    }

    #[test]
    fn an_older_version_is_read_and_a_newer_one_refused_in_words() {
        let old = Header {
            version: 1,
            ..HEADER
        };
        let mut bytes = old.encode().to_vec();
        let mut record = 3_u32.to_le_bytes().to_vec();
        record.extend([0; 4]);
        record.extend(100_u64.to_le_bytes());
        record.extend(*b"abc");
        let crc = crc_of_record(&record);
        record[4..8].copy_from_slice(&crc.to_le_bytes());
        bytes.extend(record);
        let header = Header::decode(&bytes).unwrap();
        let scan = Scan::of(&bytes, &header);
        assert_eq!((scan.records.len(), scan.end), (1, End::Clean));
        assert_eq!(&bytes[scan.records[0].payload.clone()], b"abc");
        let newer = Header {
            version: VERSION + 1,
            ..HEADER
        };
        let refusal = Header::decode(&newer.encode()).unwrap_err();
        assert_eq!(
            refusal.to_string(),
            "format version 3 is newer than 2, the newest that this program reads"
        );
    }
}
