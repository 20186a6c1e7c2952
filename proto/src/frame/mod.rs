//! The frames of the control loop: one [`HandleFrame`] up and one [`ToolFrame`] down every tick.
//!
//! Every frame starts with the same 48 bytes; numbers are little-endian, offsets are fixed and floats are aligned to
//! their size:
//!
//! ```text
//!  0      2       3      4       8          12             16        24        32
//!  +------+-------+------+-------+----------+--------------+---------+---------+
//!  | "TF" |version| kind | lease | sequence | echo_hold_ns | sent_ns | echo_ns |
//!  | u8x2 |  u8   |  u8  |  u32  |   u32    |     u32      |   u64   |   u64   |
//!  +------+-------+------+-------+----------+--------------+---------+---------+
//!  32           36                40         44       45      46     48
//!  +------------+-----------------+----------+--------+-------+------+
//!  | clay_epoch | ownership_epoch | revision | scheme | state | zero |
//!  |    u32     |       u32       |   u32    |   u8   |  u8   | u8x2 |
//!  +------------+-----------------+----------+--------+-------+------+
//! ```
//!
//! `state` is the [`Engagement`] in a handle frame and the [`LoopStatus`] in a tool frame.

mod corrections;
mod gaps;
mod handle;
mod header;
mod sweeps;
mod tool;

pub use corrections::Corrections;
pub use gaps::{Gap, Gaps, MAX_GAPS, NoGap};
pub use handle::{CopyState, Engagement, HandleFrame};
pub use header::Header;
pub use sweeps::{MAX_SWEEPS, POSITION_UNIT_M, SWEEP_BYTES, SweepRecord, Sweeps, SweepsFull};
pub use tool::{LoopStatus, SweepRefusal, ToolFrame};

pub use crate::FrameError;

/// First two bytes of every frame.
pub const MAGIC: [u8; 2] = *b"TF";

/// Version of the frame layouts.
pub const VERSION: u8 = 1;

/// Bytes of the longest frame: a handle frame full of sweeps and gaps. Below 1200, so that no path splits it.
pub const MAX_FRAME: usize = handle::FIXED + SWEEP_BYTES + MAX_GAPS * gaps::GAP;

const _: () = assert!(
    MAX_FRAME < 1200,
    "a frame must fit one datagram on any path"
);

const KIND_HANDLE: u8 = 1;
const KIND_TOOL: u8 = 2;
