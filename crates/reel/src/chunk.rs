//! The messages of a chunk.

use std::io::Read as _;

use lz4_flex::frame::FrameDecoder;
use mcap::records::Record;

use crate::error::ReadError;
use crate::records::LONGEST;

/// A chunk, decompressed.
#[derive(Default)]
pub(crate) struct Chunk {
    bytes: Vec<u8>,
    /// Time of its first message, ns.
    pub(crate) from_ns: u64,
}

/// What stands in a chunk, or in a file that has none.
pub(crate) enum Entry<'a> {
    Schema {
        id: u16,
        name: String,
    },
    Channel {
        id: u16,
        schema: u16,
        topic: String,
    },
    Message(Message<'a>),
    /// Anything else.
    Other,
}

/// A message.
#[derive(Clone, Copy)]
pub(crate) struct Message<'a> {
    pub(crate) channel: u16,
    pub(crate) time_ns: u64,
    pub(crate) data: &'a [u8],
}

impl Chunk {
    /// Opens the body of a chunk's record.
    pub(crate) fn open(body: &[u8]) -> Result<Self, ReadError> {
        let Record::Chunk { header, data } = mcap::parse_record(mcap::records::op::CHUNK, body)?
        else {
            return Err(damaged("it is none"));
        };
        let need = header.uncompressed_size;
        if LONGEST as u64 <= need {
            return Err(ReadError::ChunkTooLarge {
                got: need,
                want: LONGEST as u64,
            });
        }
        let bytes = match header.compression.as_str() {
            "" => data.into_owned(),
            "lz4" => {
                let mut bytes = Vec::with_capacity(need as usize);
                // One byte more than is told would show that it tells too little.
                let mut read = FrameDecoder::new(&data[..]).take(need + 1);
                read.read_to_end(&mut bytes)
                    .map_err(|error| damaged(&error.to_string()))?;
                bytes
            }
            got => {
                return Err(ReadError::Compression {
                    got: got.to_owned(),
                });
            }
        };
        if bytes.len() as u64 != need {
            return Err(damaged(&format!(
                "it has {} bytes and tells of {need}",
                bytes.len()
            )));
        }
        // Zero: none was calculated.
        if header.uncompressed_crc != 0 && crc32fast::hash(&bytes) != header.uncompressed_crc {
            return Err(damaged("its checksum is another one"));
        }
        Ok(Self {
            bytes,
            from_ns: header.message_start_time,
        })
    }

    /// What stands at a place, and the place behind it; nothing at the end.
    pub(crate) fn entry(&self, at: usize) -> Result<Option<(Entry<'_>, usize)>, ReadError> {
        let rest = self.bytes.get(at..).unwrap_or_default();
        if rest.is_empty() {
            return Ok(None);
        }
        let short = || damaged("it ends within a record");
        let (head, rest) = rest.split_at_checked(9).ok_or_else(short)?;
        let length = u64::from_le_bytes(std::array::from_fn(|n| head[n + 1]));
        let length = usize::try_from(length).map_err(|_| short())?;
        let body = rest.get(..length).ok_or_else(short)?;
        Ok(Some((Entry::read(head[0], body)?, at + 9 + length)))
    }
}

impl<'a> Entry<'a> {
    /// Reads a record that is no chunk.
    pub(crate) fn read(opcode: u8, body: &'a [u8]) -> Result<Self, ReadError> {
        use mcap::records::op;
        Ok(match opcode {
            op::MESSAGE => {
                let short = || damaged("a message ends early");
                let (head, data) = body.split_at_checked(22).ok_or_else(short)?;
                Self::Message(Message {
                    channel: u16::from_le_bytes([head[0], head[1]]),
                    // Behind a sequence number, and before the same time again.
                    time_ns: u64::from_le_bytes(std::array::from_fn(|n| head[n + 6])),
                    data,
                })
            }
            op::SCHEMA | op::CHANNEL => match mcap::parse_record(opcode, body)? {
                Record::Schema { header, .. } => Self::Schema {
                    id: header.id,
                    name: header.name,
                },
                Record::Channel(channel) => Self::Channel {
                    id: channel.id,
                    schema: channel.schema_id,
                    topic: channel.topic,
                },
                _ => Self::Other,
            },
            _ => Self::Other,
        })
    }
}

fn damaged(why: &str) -> ReadError {
    ReadError::Chunk {
        why: why.to_owned(),
    }
}
