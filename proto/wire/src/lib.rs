//! The binary messages that watchers read, and what every binary layout is read and written with. It brings nothing
//! along that knows JSON, so that the dashboard's own module has it at no cost; all else of the protocol is in
//! `teleclay_proto`, which offers what is here under its own names.
//!
//! Every binary message starts with the same eight bytes, little-endian:
//!
//! ```text
//!  0      2       3      4          8
//!  +------+-------+------+----------+---
//!  | "TC" |version| kind | sequence | …
//!  | u8x2 |  u8   |  u8  |   u32    |
//!  +------+-------+------+----------+---
//! ```
//!
//! `sequence` counts the messages of one kind on one stream (a WebSocket, or a Zenoh publication) from 0 and wraps, so
//! that a reader sees a gap. Bricks go over Zenoh in the same bytes.

mod bricks;
pub mod bytes;
mod classes;
mod error;
mod frames;
mod pack;
mod telemetry;

pub use bricks::{
    Brick, BrickBody, BrickContent, BricksHeader, BricksKind, BricksView, BricksWriter,
};
pub use classes::{ClassesView, write_classes};
pub use error::FrameError;
pub use frames::{
    FramesFull, FramesKind, FramesView, FramesWriter, MAX_FRAMES, MAX_FRAMES_MESSAGE, MAX_SEALED,
};
pub use pack::{BRICK_EDGE, BRICK_VOXELS, MAX_PACKED, PackedBrick, pack, unpack};
pub use telemetry::{MAX_SAMPLES, TelemetryBatch, TelemetrySample, TelemetryView, TooManySamples};

use bytes::Reader;

/// First two bytes of every binary message.
pub const MAGIC: [u8; 2] = *b"TC";

/// Version of the layouts.
pub const VERSION: u8 = 1;

/// Longest message that a server writes to a WebSocket. Longer keyframes are split: a browser should not wait for a
/// megabyte before it draws, nor a server hold one for each slow reader.
pub const MAX_MESSAGE: usize = 256 * 1024;

/// What a binary message carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Kind {
    /// Samples of the loop, [`TelemetryView`].
    Telemetry = 1,
    /// Bricks of the clay, [`BricksView`].
    Bricks = 2,
    /// A part of the classes of material of a block, [`ClassesView`]. 3 and 4 are [frames](FramesKind).
    Classes = 5,
}

impl Kind {
    /// The byte that stands for it.
    #[must_use]
    pub const fn byte(self) -> u8 {
        self as u8
    }

    const fn from_byte(byte: u8) -> Result<Self, FrameError> {
        match byte {
            1 => Ok(Self::Telemetry),
            2 => Ok(Self::Bricks),
            5 => Ok(Self::Classes),
            got => Err(FrameError::UnknownValue {
                field: "kind of message",
                got,
            }),
        }
    }
}

/// A binary message, decoded in place.
#[derive(Clone, Copy, Debug)]
pub enum Message<'a> {
    /// Samples of the loop.
    Telemetry(TelemetryView<'a>),
    /// Bricks of the clay.
    Bricks(BricksView<'a>),
    /// A part of the classes of material of a block.
    Classes(ClassesView<'a>),
}

impl<'a> Message<'a> {
    /// Reads a message of whatever kind. Does not allocate.
    ///
    /// # Errors
    /// When the bytes are not exactly one message of this version.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, FrameError> {
        let (kind, _) = read_prefix(&mut Reader::new(bytes))?;
        match kind {
            Kind::Telemetry => TelemetryView::decode(bytes).map(Self::Telemetry),
            Kind::Bricks => BricksView::decode(bytes).map(Self::Bricks),
            Kind::Classes => ClassesView::decode(bytes).map(Self::Classes),
        }
    }
}

/// Gives a message that is already written another sequence number, so that one message can go to many streams.
///
/// # Errors
/// When `message` does not start as a binary message does; it is then unchanged.
pub fn renumber(message: &mut [u8], sequence: u32) -> Result<(), FrameError> {
    read_prefix(&mut Reader::new(message))?;
    message[4..8].copy_from_slice(&sequence.to_le_bytes());
    Ok(())
}

/// Length of what every message begins with.
const PREFIX: usize = 8;

fn write_prefix(kind: Kind, sequence: u32, message: &mut Vec<u8>) {
    message.extend_from_slice(&MAGIC);
    message.extend_from_slice(&[VERSION, kind.byte()]);
    message.extend_from_slice(&sequence.to_le_bytes());
}

fn read_prefix(reader: &mut Reader<'_>) -> Result<(Kind, u32), FrameError> {
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
    let kind = Kind::from_byte(reader.u8()?)?;
    Ok((kind, reader.u32()?))
}

fn read_prefix_of(want: Kind, reader: &mut Reader<'_>) -> Result<u32, FrameError> {
    let (got, sequence) = read_prefix(reader)?;
    if got != want {
        return Err(FrameError::WrongKind {
            got: got.byte(),
            want: want.byte(),
        });
    }
    Ok(sequence)
}
