//! Frames of the loop on their way over a WebSocket: several to a message, since who steps a loop in a browser wakes
//! for several ticks at a time. What a frame holds, and the trailer at its end, is none of this module's business.

use crate::bytes::Reader;
use crate::{FrameError, MAGIC, PREFIX, VERSION};

/// Bytes before the first frame.
const FIXED: usize = PREFIX + 4;
/// Where in a message the number of its frames stands.
const COUNT_AT: usize = PREFIX;
/// Bytes of a frame's length.
const LENGTH: usize = 2;

/// Most frames of a message: the ticks of 64 ms at 1 kHz, longer than any frame is news.
pub const MAX_FRAMES: usize = 64;

/// Longest frame with its trailer, bytes: one fits a datagram on any path.
pub const MAX_SEALED: usize = 1224;

/// Longest message of frames, bytes.
pub const MAX_FRAMES_MESSAGE: usize = FIXED + MAX_FRAMES * (LENGTH + MAX_SEALED);

/// Which way frames go. They are the kinds 3 and 4 of the messages on a WebSocket; those who only watch know neither.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FramesKind {
    /// From a handle to the server.
    Handle = 3,
    /// From the server to a handle.
    Tool = 4,
}

impl FramesKind {
    const fn from_byte(byte: u8) -> Result<Self, FrameError> {
        match byte {
            3 => Ok(Self::Handle),
            4 => Ok(Self::Tool),
            got => Err(FrameError::UnknownValue {
                field: "kind of message of frames",
                got,
            }),
        }
    }
}

/// A message has no room for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FramesFull {
    /// It holds as many as it may.
    #[error("a message holds {MAX_FRAMES} frames at most")]
    TooMany,
    /// The frame is longer than one can be.
    #[error("a frame of {got} bytes, {MAX_SEALED} are the most")]
    TooLong {
        /// Its length.
        got: usize,
    },
}

/// Writes message after message into one stretch of memory, which is taken once.
///
/// ```
/// use teleclay_wire::{FramesKind, FramesView, FramesWriter};
///
/// let mut writer = FramesWriter::new(FramesKind::Handle);
/// assert_eq!(writer.message(), None);
/// writer.push([b"frame", b"trailer"]).unwrap();
/// let view = FramesView::decode(writer.message().unwrap()).unwrap();
/// assert_eq!(view.iter().collect::<Vec<_>>(), [b"frametrailer"]);
/// // The next message counts one more.
/// writer.restart();
/// writer.push([b"next", b""]).unwrap();
/// let view = FramesView::decode(writer.message().unwrap()).unwrap();
/// assert_eq!((view.sequence, view.len()), (1, 1));
/// ```
#[derive(Clone, Debug)]
pub struct FramesWriter {
    kind: FramesKind,
    sequence: u32,
    count: u16,
    message: Vec<u8>,
}

impl FramesWriter {
    /// The first message of a stream, without a frame yet.
    #[must_use]
    pub fn new(kind: FramesKind) -> Self {
        let mut writer = Self {
            kind,
            sequence: 0,
            count: 0,
            message: Vec::with_capacity(MAX_FRAMES_MESSAGE),
        };
        writer.begin();
        writer
    }

    /// Forgets what was written and begins another message; the number of one that held nothing is used again.
    pub fn restart(&mut self) {
        if 0 < self.count {
            self.sequence = self.sequence.wrapping_add(1);
        }
        self.count = 0;
        self.begin();
    }

    /// Adds a frame that lies in parts: the frame, and its trailer. Does not allocate.
    ///
    /// # Errors
    /// There is no room for it; the message stays as it is.
    pub fn push<const N: usize>(&mut self, parts: [&[u8]; N]) -> Result<(), FramesFull> {
        let got = parts.iter().map(|part| part.len()).sum();
        if MAX_SEALED < got {
            return Err(FramesFull::TooLong { got });
        }
        if MAX_FRAMES <= usize::from(self.count) {
            return Err(FramesFull::TooMany);
        }
        self.count += 1;
        self.message.extend_from_slice(&(got as u16).to_le_bytes());
        for part in parts {
            self.message.extend_from_slice(part);
        }
        let count = self.count.to_le_bytes();
        self.message[COUNT_AT..COUNT_AT + count.len()].copy_from_slice(&count);
        Ok(())
    }

    /// How many frames were written since the last restart.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count.into()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The message, if it holds a frame.
    #[must_use]
    pub fn message(&self) -> Option<&[u8]> {
        (0 < self.count).then_some(&self.message)
    }

    fn begin(&mut self) {
        self.message.clear();
        self.message.extend_from_slice(&MAGIC);
        self.message.extend_from_slice(&[VERSION, self.kind as u8]);
        self.message.extend_from_slice(&self.sequence.to_le_bytes());
        self.message.extend_from_slice(&[0; FIXED - PREFIX]);
    }
}

/// A message of frames, decoded in place.
///
/// ```text
///  0        8       10     12
///  +--------+-------+------+------------------------------------------+
///  | prefix | count | zero | count x (length u16, frame with trailer) |
///  |        |  u16  | u8x2 |                                          |
///  +--------+-------+------+------------------------------------------+
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FramesView<'a> {
    /// Which way its frames go.
    pub kind: FramesKind,
    /// Number of the message on its stream.
    pub sequence: u32,
    count: u16,
    frames: &'a [u8],
}

impl<'a> FramesView<'a> {
    /// Reads a message. Does not allocate.
    ///
    /// # Errors
    /// When the bytes are not exactly one message of frames of this version.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, FrameError> {
        let mut reader = Reader::new(bytes);
        let magic = reader.array()?;
        if magic != MAGIC {
            return Err(FrameError::WrongMagic {
                got: magic,
                want: MAGIC,
            });
        }
        let version = reader.u8()?;
        if version != VERSION {
            return Err(FrameError::WrongVersion {
                got: version,
                want: VERSION,
            });
        }
        let kind = FramesKind::from_byte(reader.u8()?)?;
        let sequence = reader.u32()?;
        let count = reader.u16()?;
        reader.zeros::<2>("message of frames")?;
        let most = MAX_FRAMES as u64;
        if most < u64::from(count) {
            return Err(FrameError::TooMany {
                field: "frames",
                got: count.into(),
                most,
            });
        }
        let frames = bytes.get(FIXED..).unwrap_or_default();
        for _ in 0..count {
            let length = reader.u16()?;
            if MAX_SEALED < usize::from(length) {
                return Err(FrameError::TooMany {
                    field: "bytes of a frame",
                    got: length.into(),
                    most: MAX_SEALED as u64,
                });
            }
            reader.slice(length.into())?;
        }
        reader.finish()?;
        Ok(Self {
            kind,
            sequence,
            count,
            frames,
        })
    }

    /// How many frames it holds.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count.into()
    }

    /// Whether it holds none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The frames, each with its trailer, in the order in which they left.
    pub fn iter(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        let mut reader = Reader::new(self.frames);
        (0..self.count).map_while(move |_| {
            let length = reader.u16().ok()?;
            reader.slice(length.into()).ok()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_laid_out_as_its_picture_says_and_takes_no_more_than_it_may() {
        let mut writer = FramesWriter::new(FramesKind::Tool);
        writer.push([&[7, 8], &[9]]).unwrap();
        let message = [b'T', b'C', 1, 4, 0, 0, 0, 0, 1, 0, 0, 0, 3, 0, 7, 8, 9];
        assert_eq!(writer.message(), Some(&message[..]));
        for _ in 1..MAX_FRAMES {
            writer.push([&[5; MAX_SEALED]]).unwrap();
        }
        assert_eq!(writer.push([&[1]]), Err(FramesFull::TooMany));
        let room = writer.message.capacity();
        let view = FramesView::decode(writer.message().unwrap()).unwrap();
        assert_eq!((view.len(), view.iter().count()), (MAX_FRAMES, MAX_FRAMES));
        writer.restart();
        let got = MAX_SEALED + 1;
        assert_eq!(
            writer.push([&vec![0; got]]),
            Err(FramesFull::TooLong { got })
        );
        assert_eq!((writer.message(), writer.message.capacity()), (None, room));
    }

    #[test]
    fn what_is_no_message_of_frames_is_refused_wherever_it_is_wrong() {
        let mut writer = FramesWriter::new(FramesKind::Handle);
        writer.push([&[7, 8, 9]]).unwrap();
        writer.push([&[]]).unwrap();
        let good = writer.message().unwrap().to_vec();
        for length in 0..good.len() {
            let got = FramesView::decode(&good[..length]).map(|_| ());
            assert!(matches!(got, Err(FrameError::TooShort { .. })), "{got:?}");
        }
        let changed = |at: usize, to: u8| {
            let mut bytes = good.clone();
            bytes[at] = to;
            FramesView::decode(&bytes).map(|_| ()).unwrap_err()
        };
        assert!(matches!(changed(1, b'F'), FrameError::WrongMagic { .. }));
        assert!(matches!(changed(2, 2), FrameError::WrongVersion { .. }));
        for kind in [0, 1, 2, 5] {
            assert!(matches!(changed(3, kind), FrameError::UnknownValue { .. }));
        }
        assert!(matches!(changed(8, 1), FrameError::TrailingBytes { .. }));
        assert!(matches!(changed(8, 65), FrameError::TooMany { .. }));
        assert!(matches!(changed(10, 1), FrameError::ReservedNotZero { .. }));
        assert!(matches!(changed(13, 9), FrameError::TooMany { .. }));
    }
}
