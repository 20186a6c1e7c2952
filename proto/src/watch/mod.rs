//! What watchers see: binary telemetry and bricks, and JSON text for everything slow.
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
mod pack;
mod telemetry;
mod text;

pub use bricks::{
    Brick, BrickBody, BrickContent, BricksHeader, BricksKind, BricksView, BricksWriter,
};
pub use pack::{BRICK_EDGE, BRICK_VOXELS, MAX_PACKED, PackedBrick, pack, unpack};
pub use telemetry::{MAX_SAMPLES, TelemetryBatch, TelemetrySample, TelemetryView, TooManySamples};
pub use text::{ClientText, Level, ServerText, Switch};

use crate::bytes::Reader;
use crate::word::words;

pub use crate::FrameError;

/// First two bytes of every binary message.
pub const MAGIC: [u8; 2] = *b"TC";

/// Version of the layouts.
pub const VERSION: u8 = 1;

/// Longest message that a server writes to a WebSocket. Longer keyframes are split: a browser should not wait for a
/// megabyte before it draws, nor a server hold one for each slow reader.
pub const MAX_MESSAGE: usize = 256 * 1024;

words! {
    /// What a binary message carries.
    pub enum Kind: "kind of message" {
        /// Samples of the loop, [`TelemetryView`].
        Telemetry = 1 "telemetry",
        /// Bricks of the clay, [`BricksView`].
        Bricks = 2 "bricks",
    }
}

/// A binary message, decoded in place.
#[derive(Clone, Copy, Debug)]
pub enum Message<'a> {
    /// Samples of the loop.
    Telemetry(TelemetryView<'a>),
    /// Bricks of the clay.
    Bricks(BricksView<'a>),
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
