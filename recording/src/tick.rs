//! What leaves the tick for the thread that writes: parcels of bytes in one ring, each with its length before it.
//!
//! ```text
//! length  kind  fields
//! u32     u8
//! ```
//!
//! They never leave the process, so they have no version: both ends are this file.

use teleclay_bilateral::ToolView;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{HandleFrame, MAX_FRAME};

pub(crate) const TICK: u8 = 1;
pub(crate) const BASE: u8 = 2;
pub(crate) const BRICK: u8 = 3;
pub(crate) const WHOLE: u8 = 4;
pub(crate) const END: u8 = 5;
pub(crate) const CLASSES: u8 = 6;

/// One tool after a tick, as far as it is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Seen {
    pub(crate) slot: usize,
    pub(crate) lease: u32,
    pub(crate) is_connected: bool,
    pub(crate) age_s: f64,
    /// The last round trip, if there was one.
    pub(crate) rtt_s: Option<f64>,
    pub(crate) view: ToolView,
}

/// How many numbers a tool is written as.
const NUMBERS: usize = 29;

impl Seen {
    pub(crate) fn put(&self, out: &mut Vec<u8>) {
        out.push(self.slot as u8);
        out.push(u8::from(self.is_connected));
        out.extend_from_slice(&self.lease.to_le_bytes());
        let view = &self.view;
        let vectors = [
            view.position_m,
            view.velocity_m_s,
            view.force_n,
            view.handle_position_m,
            view.handle_velocity_m_s,
            view.hand_force_n,
            view.felt_force_n,
            view.corrections.held_n.map(f64::from),
        ];
        let others = [
            view.energy_handle_j,
            view.energy_tool_j,
            view.corrections.moved_n,
            self.age_s,
            self.rtt_s.unwrap_or(f64::NAN),
        ];
        for number in vectors.iter().flatten().chain(&others) {
            out.extend_from_slice(&number.to_le_bytes());
        }
    }

    fn read(from: &mut Parcel<'_>) -> Option<Self> {
        let slot = from.byte()?.into();
        let is_connected = from.byte()? != 0;
        let lease = from.u32()?;
        let mut numbers = [0.0; NUMBERS];
        for number in &mut numbers {
            *number = f64::from_bits(from.u64()?);
        }
        let vector = |at: usize| std::array::from_fn(|axis| numbers[3 * at + axis]);
        let mut view = ToolView {
            position_m: vector(0),
            velocity_m_s: vector(1),
            force_n: vector(2),
            handle_position_m: vector(3),
            handle_velocity_m_s: vector(4),
            hand_force_n: vector(5),
            felt_force_n: vector(6),
            energy_handle_j: numbers[24],
            energy_tool_j: numbers[25],
            ..ToolView::default()
        };
        view.corrections.held_n = vector(7).map(|newtons| newtons as f32);
        view.corrections.moved_n = numbers[26];
        Some(Self {
            slot,
            lease,
            is_connected,
            age_s: numbers[27],
            rtt_s: Some(numbers[28]).filter(|rtt_s| !rtt_s.is_nan()),
            view,
        })
    }
}

/// Writes a frame as it came out of a line.
pub(crate) fn put_frame(
    out: &mut Vec<u8>,
    slot: usize,
    arrived: Timestamp,
    frame: &HandleFrame,
    buffer: &mut [u8; MAX_FRAME],
) {
    let bytes = frame.encode(buffer);
    out.push(slot as u8);
    out.extend_from_slice(&arrived.as_nanos().to_le_bytes());
    out.extend_from_slice(&(bytes.len() as u16).to_le_bytes());
    out.extend_from_slice(bytes);
}

/// One tick, as the thread that writes has it.
#[derive(Debug, Default)]
pub(crate) struct Tick<'a> {
    pub(crate) tick: u64,
    pub(crate) now_ns: u64,
    /// Ticks that found no room so far.
    pub(crate) dropped: u64,
    pub(crate) can_keep_cuts: bool,
    pub(crate) clay_epoch: u32,
    /// The clay's hash after the tick, where it was known.
    pub(crate) hash: Option<u64>,
    /// Slot, arrival in ns, bytes.
    pub(crate) frames: Vec<(usize, u64, &'a [u8])>,
    /// Of the history.
    pub(crate) records: Vec<&'a [u8]>,
    pub(crate) seen: Vec<Seen>,
}

impl<'a> Tick<'a> {
    pub(crate) fn read(from: &mut Parcel<'a>) -> Option<Self> {
        let mut tick = Self {
            tick: from.u64()?,
            now_ns: from.u64()?,
            dropped: from.u64()?,
            can_keep_cuts: from.byte()? != 0,
            clay_epoch: from.u32()?,
            hash: None,
            ..Self::default()
        };
        let has_hash = from.byte()? != 0;
        tick.hash = Some(from.u64()?).filter(|_| has_hash);
        for _ in 0..from.u16()? {
            let (slot, arrived) = (from.byte()?.into(), from.u64()?);
            let length = from.u16()?.into();
            tick.frames.push((slot, arrived, from.slice(length)?));
        }
        for _ in 0..from.byte()? {
            let length = from.u32()? as usize;
            tick.records.push(from.slice(length)?);
        }
        for _ in 0..from.byte()? {
            tick.seen.push(Seen::read(from)?);
        }
        Some(tick)
    }
}

/// What is left of a parcel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parcel<'a>(pub(crate) &'a [u8]);

impl<'a> Parcel<'a> {
    pub(crate) fn slice(&mut self, length: usize) -> Option<&'a [u8]> {
        let (slice, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(slice)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.slice(N)?.try_into().ok()
    }

    pub(crate) fn byte(&mut self) -> Option<u8> {
        self.array::<1>().map(|[byte]| byte)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }
}
