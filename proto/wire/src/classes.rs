//! Classes of material of a block, as a part of a snapshot.

use crate::bytes::Reader;
use crate::{FrameError, Kind, PREFIX, read_prefix_of, write_prefix};

/// Bytes before the part itself.
const FIXED: usize = PREFIX + 12;

/// A part of the classes of a block, decoded in place. The parts of all messages, one behind the other, are the bytes
/// that the clay writes them as; how these are to be read is told there.
///
/// ```text
///  0        8            12      16       20
///  +--------+------------+-------+--------+---------------------+
///  | prefix | clay_epoch | total | offset | the rest: a part    |
///  |        |    u32     |  u32  |  u32   | of the total bytes  |
///  +--------+------------+-------+--------+---------------------+
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClassesView<'a> {
    /// Number of the message on its stream.
    pub sequence: u32,
    /// Counts the fresh blocks of clay.
    pub clay_epoch: u32,
    /// Bytes that the classes take in all.
    pub total: u32,
    /// Where among them this part begins.
    pub offset: u32,
    /// The part. Never empty, and never beyond the total.
    pub part: &'a [u8],
}

impl<'a> ClassesView<'a> {
    /// Reads a message. Does not allocate.
    ///
    /// # Errors
    /// When the bytes are not exactly one message of this version.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, FrameError> {
        let mut reader = Reader::new(bytes);
        let sequence = read_prefix_of(Kind::Classes, &mut reader)?;
        let (clay_epoch, total, offset) = (reader.u32()?, reader.u32()?, reader.u32()?);
        let (got, need) = (bytes.len(), FIXED + 1);
        let part = bytes
            .get(FIXED..)
            .filter(|part| !part.is_empty())
            .ok_or(FrameError::TooShort { got, need })?;
        let room = u64::from(total).saturating_sub(offset.into());
        if room < part.len() as u64 {
            let want = FIXED + room as usize;
            return Err(FrameError::TrailingBytes { got, want });
        }
        Ok(Self {
            sequence,
            clay_epoch,
            total,
            offset,
            part,
        })
    }
}

/// Writes the classes of a block into as many messages of at most `longest` bytes as they need; the first has the
/// number `sequence` on its stream, each further one the next.
///
/// # Panics
/// When a message has no room for a part, or the classes take 4 GiB, which those of no block do.
#[must_use]
pub fn write_classes(
    encoded: &[u8],
    clay_epoch: u32,
    sequence: u32,
    longest: usize,
) -> Vec<Vec<u8>> {
    assert!(FIXED < longest, "messages of {longest} bytes");
    let total = u32::try_from(encoded.len()).expect("classes are smaller than the largest block");
    let parts = encoded.chunks(longest - FIXED);
    let mut offset = 0_u32;
    parts
        .zip(0..)
        .map(|(part, number)| {
            let mut message = Vec::with_capacity(FIXED + part.len());
            write_prefix(Kind::Classes, sequence.wrapping_add(number), &mut message);
            for field in [clay_epoch, total, offset] {
                message.extend_from_slice(&field.to_le_bytes());
            }
            message.extend_from_slice(part);
            offset += part.len() as u32;
            message
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_any_length_come_back_in_their_places() {
        let encoded: Vec<u8> = (0..=255).collect();
        for room in [1, 7, 128, 256, 999] {
            let messages = write_classes(&encoded, 9, 40, FIXED + room);
            assert_eq!(messages.len(), encoded.len().div_ceil(room));
            let mut read = Vec::new();
            for (number, message) in messages.iter().enumerate() {
                let view = ClassesView::decode(message).unwrap();
                assert_eq!((view.clay_epoch, view.total), (9, 256));
                assert_eq!(view.sequence, 40 + number as u32);
                assert_eq!(view.offset as usize, read.len());
                read.extend_from_slice(view.part);
            }
            assert_eq!(read, encoded);
        }
    }

    #[test]
    fn a_part_beyond_the_total_and_an_empty_one_are_refused() {
        let message = write_classes(&[1, 2, 3], 1, 0, 64).remove(0);
        assert!(ClassesView::decode(&message).is_ok());
        assert!(matches!(
            ClassesView::decode(&message[..FIXED]),
            Err(FrameError::TooShort { .. })
        ));
        let mut beyond = message.clone();
        beyond[16] = 1;
        assert!(matches!(
            ClassesView::decode(&beyond),
            Err(FrameError::TrailingBytes { got: 23, want: 22 })
        ));
        beyond[16..20].fill(0xFF);
        assert!(ClassesView::decode(&beyond).is_err());
        let mut other = message;
        other[3] = Kind::Bricks.byte();
        assert!(matches!(
            ClassesView::decode(&other),
            Err(FrameError::WrongKind { got: 2, want: 5 })
        ));
    }
}
