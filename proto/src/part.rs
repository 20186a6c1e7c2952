//! Parts of an answer that has several: each says which it is, so that whoever asked knows when all have come.

use crate::FrameError;
use teleclay_wire::bytes::Reader;

/// One of the parts that make up an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part<'a> {
    /// Which, from 0.
    pub index: u32,
    /// How many there are.
    pub count: u32,
    /// What it holds.
    pub content: &'a [u8],
}

/// Bytes before the content.
const HEAD: usize = 8;

impl<'a> Part<'a> {
    /// Reads one.
    ///
    /// # Errors
    /// The bytes are too short, or the part is none of as many as it says.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, FrameError> {
        let mut reader = Reader::new(bytes);
        let (index, count) = (reader.u32()?, reader.u32()?);
        if count <= index {
            return Err(FrameError::TooMany {
                field: "parts",
                got: u64::from(index) + 1,
                most: u64::from(count),
            });
        }
        Ok(Self {
            index,
            count,
            content: &bytes[HEAD..],
        })
    }

    /// Writes it.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEAD + self.content.len());
        bytes.extend_from_slice(&self.index.to_le_bytes());
        bytes.extend_from_slice(&self.count.to_le_bytes());
        bytes.extend_from_slice(self.content);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_one_of_as_many_as_it_says() {
        let bytes = [1, 0, 0, 0, 2, 0, 0, 0, 7, 8];
        let part = Part::decode(&bytes).unwrap();
        assert_eq!((part.index, part.count, part.content), (1, 2, &[7, 8][..]));
        assert_eq!(part.encode(), bytes);
        for length in 0..HEAD {
            assert!(Part::decode(&bytes[..length]).is_err());
        }
        for beyond in [[2, 0, 0, 0, 2, 0, 0, 0], [0; 8]] {
            assert!(matches!(
                Part::decode(&beyond),
                Err(FrameError::TooMany { .. })
            ));
        }
    }
}
