//! Bricks of the clay: all of them, or those that changed.

use crate::FrameError;
use crate::bytes::Reader;
use crate::pack::{BRICK_VOXELS, MAX_PACKED, PackedBrick, pack};
use crate::{Kind, PREFIX, read_prefix_of, write_prefix};

/// Bytes before the first brick.
const FIXED: usize = PREFIX + 20;

/// Bytes of a brick before its packed voxels.
const BRICK_FIXED: usize = 8;

/// Where in a message the number of its bricks stands.
const COUNT_AT: usize = FIXED - 4;

/// Set in the first message of a keyframe.
const FLAG_KEYFRAME: u16 = 1;

/// Kind of a brick whose every voxel is 0.
const EMPTY: u8 = 0;
/// Kind of a brick whose every voxel is 255.
const FULL: u8 = 1;
/// Kind of a brick whose voxels follow, packed.
const PACKED: u8 = 2;

/// What a message is to the bricks that came before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BricksKind {
    /// Forget all bricks held before: what is not told from here on is empty.
    Keyframe,
    /// These bricks replace the ones held before.
    #[default]
    Delta,
}

/// What a message says about its bricks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BricksHeader {
    /// Number of the message on its stream.
    pub sequence: u32,
    /// Counts the fresh blocks of clay.
    pub clay_epoch: u32,
    /// Bricks of the grid along x, y, z.
    pub bricks_per_axis: [u16; 3],
    /// Whether the message begins a keyframe or is a delta.
    pub kind: BricksKind,
    /// Edge of a voxel, m.
    pub voxel_size_m: f32,
}

impl BricksHeader {
    /// Bricks of the grid. Indices are below it.
    #[must_use]
    pub const fn bricks(&self) -> u64 {
        let [x, y, z] = self.bricks_per_axis;
        x as u64 * y as u64 * z as u64
    }

    fn check_index(&self, index: u32) -> Result<(), FrameError> {
        if self.bricks() <= u64::from(index) {
            return Err(FrameError::BrickOutsideGrid {
                index,
                bricks: self.bricks(),
            });
        }
        Ok(())
    }
}

/// A brick of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Brick<'a> {
    /// `x + nx (y + ny z)` with `nx` and `ny` the bricks of the grid along x and y.
    pub index: u32,
    /// Its voxels.
    pub body: BrickBody<'a>,
}

/// The voxels of a brick, as they are told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BrickBody<'a> {
    /// Every voxel is 0.
    Empty,
    /// Every voxel is 255.
    Full,
    /// Anything else.
    Packed(PackedBrick<'a>),
}

impl BrickBody<'_> {
    /// The voxels.
    pub fn unpack(&self, voxels: &mut [u8; BRICK_VOXELS]) {
        match self {
            Self::Empty => voxels.fill(0),
            Self::Full => voxels.fill(255),
            Self::Packed(packed) => packed.unpack(voxels),
        }
    }
}

/// A message of bricks, decoded in place. It was checked throughout: every brick in it lies in the grid and unpacks.
///
/// ```text
///  0        8            12                18      20             24            28
///  +--------+------------+-----------------+-------+--------------+-------------+-------------+
///  | prefix | clay_epoch | bricks_per_axis | flags | voxel_size_m | brick_count | bricks      |
///  |        |    u32     |     u16x3       |  u16  |     f32      |     u32     |             |
///  +--------+------------+-----------------+-------+--------------+-------------+-------------+
///
///  a brick:
///  0       4      5      6             8
///  +-------+------+------+-------------+---------------------+
///  | index | kind | zero | byte_length | byte_length bytes   |
///  |  u32  |  u8  |  u8  |     u16     | packed voxels       |
///  +-------+------+------+-------------+---------------------+
/// ```
#[derive(Clone, Copy, Debug)]
pub struct BricksView<'a> {
    /// What the message says about its bricks.
    pub header: BricksHeader,
    count: u32,
    bricks: &'a [u8],
}

impl<'a> BricksView<'a> {
    /// Reads a message. Does not allocate.
    ///
    /// # Errors
    /// When the bytes are not exactly one message of this version, a brick lies outside of the grid or does not unpack.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, FrameError> {
        let mut reader = Reader::new(bytes);
        let sequence = read_prefix_of(Kind::Bricks, &mut reader)?;
        let clay_epoch = reader.u32()?;
        let bricks_per_axis = [reader.u16()?, reader.u16()?, reader.u16()?];
        let kind = match reader.u16()? {
            0 => BricksKind::Delta,
            FLAG_KEYFRAME => BricksKind::Keyframe,
            _ => return Err(FrameError::ReservedNotZero { field: "flags" }),
        };
        let voxel_size_m = reader.f32()?;
        let count = reader.u32()?;
        let header = BricksHeader {
            sequence,
            clay_epoch,
            bricks_per_axis,
            kind,
            voxel_size_m,
        };
        let bricks = &bytes[FIXED..];
        for _ in 0..count {
            header.check_index(read_brick(&mut reader)?.index)?;
        }
        reader.finish()?;
        Ok(Self {
            header,
            count,
            bricks,
        })
    }

    /// How many bricks the message holds.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.count as usize
    }

    /// Whether it holds none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The bricks, in the order they were written. Where one comes twice the later holds.
    pub fn iter(&self) -> impl Iterator<Item = Brick<'a>> + use<'a> {
        let mut reader = Reader::new(self.bricks);
        // Every brick was read once on decoding, so none is lost here.
        (0..self.count).map_while(move |_| read_brick(&mut reader).ok())
    }
}

fn read_brick<'a>(reader: &mut Reader<'a>) -> Result<Brick<'a>, FrameError> {
    let index = reader.u32()?;
    let kind = reader.u8()?;
    reader.zeros::<1>("brick")?;
    let length = reader.u16()?;
    let packed = reader.slice(length.into())?;
    let body = match kind {
        EMPTY | FULL if !packed.is_empty() => {
            return Err(FrameError::WrongBrickLength {
                kind,
                got: packed.len(),
            });
        }
        EMPTY => BrickBody::Empty,
        FULL => BrickBody::Full,
        PACKED => BrickBody::Packed(PackedBrick::new(packed)?),
        got => {
            return Err(FrameError::UnknownValue {
                field: "kind of brick",
                got,
            });
        }
    };
    Ok(Brick { index, body })
}

/// What a brick is to hold.
#[derive(Clone, Copy, Debug)]
pub enum BrickContent<'a> {
    /// Every voxel is 0.
    Empty,
    /// Every voxel is 255.
    Full,
    /// These voxels. All 0 or all 255 are told as empty or full.
    Voxels(&'a [u8; BRICK_VOXELS]),
    /// These voxels, packed before: one packing can go to many readers.
    Packed(PackedBrick<'a>),
}

impl<'a> From<BrickBody<'a>> for BrickContent<'a> {
    fn from(body: BrickBody<'a>) -> Self {
        match body {
            BrickBody::Empty => Self::Empty,
            BrickBody::Full => Self::Full,
            BrickBody::Packed(packed) => Self::Packed(packed),
        }
    }
}

/// Writes bricks into as many messages as they need.
pub struct BricksWriter {
    header: BricksHeader,
    longest: usize,
    messages: Vec<Vec<u8>>,
    packed: Vec<u8>,
}

impl BricksWriter {
    /// Starts on messages of at most `longest` bytes, such as [`MAX_MESSAGE`](crate::MAX_MESSAGE); one brick is written
    /// whatever its length. The first message has the header's sequence number, each further one the next.
    #[must_use]
    pub fn new(header: BricksHeader, longest: usize) -> Self {
        let mut writer = Self {
            header,
            longest,
            messages: Vec::new(),
            packed: Vec::with_capacity(MAX_PACKED),
        };
        if header.kind == BricksKind::Keyframe {
            // Even a keyframe without bricks says that those held before are gone.
            writer.start();
        }
        writer
    }

    /// Adds a brick.
    ///
    /// # Errors
    /// When the index lies outside of the grid; nothing is written then.
    pub fn push(&mut self, index: u32, content: BrickContent<'_>) -> Result<(), FrameError> {
        self.header.check_index(index)?;
        match content {
            BrickContent::Empty => self.write(index, EMPTY, &[]),
            BrickContent::Full => self.write(index, FULL, &[]),
            BrickContent::Packed(packed) => self.write(index, PACKED, packed.as_bytes()),
            BrickContent::Voxels(voxels) if voxels.iter().all(|&voxel| voxel == 0) => {
                self.write(index, EMPTY, &[]);
            }
            BrickContent::Voxels(voxels) if voxels.iter().all(|&voxel| voxel == 255) => {
                self.write(index, FULL, &[]);
            }
            BrickContent::Voxels(voxels) => {
                let mut packed = std::mem::take(&mut self.packed);
                packed.clear();
                pack(voxels, &mut packed);
                self.write(index, PACKED, &packed);
                self.packed = packed;
            }
        }
        Ok(())
    }

    /// The messages, in the order to be sent: none when there were no changes.
    #[must_use]
    pub fn finish(self) -> Vec<Vec<u8>> {
        self.messages
    }

    fn write(&mut self, index: u32, kind: u8, packed: &[u8]) {
        let room = |message: &Vec<u8>| {
            message.len() == FIXED || message.len() + BRICK_FIXED + packed.len() <= self.longest
        };
        if !self.messages.last().is_some_and(room) {
            self.start();
        }
        if let Some(message) = self.messages.last_mut() {
            message.extend_from_slice(&index.to_le_bytes());
            message.extend_from_slice(&[kind, 0]);
            message.extend_from_slice(&(packed.len() as u16).to_le_bytes());
            message.extend_from_slice(packed);
            let mut count = [0; 4];
            count.copy_from_slice(&message[COUNT_AT..FIXED]);
            let count = u32::from_le_bytes(count) + 1;
            message[COUNT_AT..FIXED].copy_from_slice(&count.to_le_bytes());
        }
    }

    fn start(&mut self) {
        let mut message = Vec::with_capacity(self.longest.min(FIXED + BRICK_FIXED + MAX_PACKED));
        let part = self.messages.len() as u32;
        let flags = if part == 0 && self.header.kind == BricksKind::Keyframe {
            FLAG_KEYFRAME
        } else {
            0
        };
        write_prefix(
            Kind::Bricks,
            self.header.sequence.wrapping_add(part),
            &mut message,
        );
        message.extend_from_slice(&self.header.clay_epoch.to_le_bytes());
        for bricks in self.header.bricks_per_axis {
            message.extend_from_slice(&bricks.to_le_bytes());
        }
        message.extend_from_slice(&flags.to_le_bytes());
        message.extend_from_slice(&self.header.voxel_size_m.to_le_bytes());
        message.extend_from_slice(&0_u32.to_le_bytes());
        self.messages.push(message);
    }
}
