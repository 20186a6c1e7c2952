//! A file as it comes, piece by piece, cut into records. Chunks stay whole.

use mcap::McapError;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::error::ReadError;

/// Bytes before a record: what it is, and how long.
const HEAD_BYTES: u64 = 9;
/// The longest record that is read. A state of the largest block, 512³ voxels of which no two are alike, is shorter.
pub(crate) const LONGEST: usize = 192 << 20;

/// What comes next.
pub(crate) enum Next<'a> {
    /// Nothing before more of the file has come.
    Hungry,
    /// A record.
    Record {
        opcode: u8,
        body: &'a [u8],
        /// Where its body begins in the file.
        offset: u64,
    },
    /// The file is over.
    Over {
        /// Whether its end was written.
        is_whole: bool,
    },
}

pub(crate) struct Records {
    reader: LinearReader,
    /// Where the next record begins.
    at: u64,
    over: Option<bool>,
}

impl Records {
    pub(crate) fn new() -> Self {
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_record_length_limit(LONGEST);
        Self {
            reader: LinearReader::new_with_options(options),
            at: mcap::MAGIC.len() as u64,
            over: None,
        }
    }

    /// The next piece of the file; an empty one is its end.
    pub(crate) fn push(&mut self, piece: &[u8]) {
        self.reader.insert(piece.len()).copy_from_slice(piece);
        self.reader.notify_read(piece.len());
    }

    pub(crate) fn next(&mut self) -> Result<Next<'_>, ReadError> {
        if let Some(is_whole) = self.over {
            return Ok(Next::Over { is_whole });
        }
        match self.reader.next_event() {
            None => {
                self.over = Some(true);
                Ok(Next::Over { is_whole: true })
            }
            Some(Ok(LinearReadEvent::ReadRequest(_))) => Ok(Next::Hungry),
            Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                let offset = self.at + HEAD_BYTES;
                self.at = offset + data.len() as u64;
                Ok(Next::Record {
                    opcode,
                    body: data,
                    offset,
                })
            }
            Some(Err(error)) => {
                self.over = Some(false);
                let is_beginning = self.at == mcap::MAGIC.len() as u64;
                match error {
                    // A file that was cut off anywhere is over there.
                    McapError::UnexpectedEof => Ok(Next::Over { is_whole: false }),
                    McapError::BadMagic if is_beginning => Err(ReadError::NotMcap),
                    error => Err(error.into()),
                }
            }
        }
    }
}
