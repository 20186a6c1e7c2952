//! Cuts on their way to the server: a list of fixed capacity, so that the loop never allocates.

use std::fmt;

use crate::FrameError;
use crate::bytes::{Reader, Writer};

/// Most sweeps that one frame carries.
///
/// At one sweep a tick this covers a gap of 24 ms without any retransmission; older ones follow in order.
pub const MAX_SWEEPS: usize = 24;

/// Metres per unit of a sweep's position: 2⁻²⁴ m, about 60 nm. 32 bits reach ±128 m.
pub const POSITION_UNIT_M: f64 = 1.0 / 16_777_216.0;

/// Bytes of one record.
pub(super) const RECORD: usize = 28;

/// Bytes before the first sweep.
pub(super) const HEAD: usize = 8;

const EMPTY: SweepRecord = SweepRecord {
    sequence: 0,
    from: [0; 3],
    to: [0; 3],
};

/// One straight cut that the handle's tool has made in its copy of the clay.
///
/// ```text
///  0          4                 16                28
///  +----------+-----------------+-----------------+
///  | sequence | from x, y, z    | to x, y, z      |
///  |   u32    | i32x3           | i32x3           |
///  +----------+-----------------+-----------------+
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SweepRecord {
    /// Number of the sweep, counted from 1 since joining; wraps, see [`is_after`](crate::is_after).
    pub sequence: u32,
    /// Where the tool was, in the clay's frame, in units of [`POSITION_UNIT_M`].
    pub from: [i32; 3],
    /// Where the tool came to, likewise.
    pub to: [i32; 3],
}

/// Up to [`MAX_SWEEPS`] sweeps that the server has not acknowledged yet.
#[derive(Clone, Copy)]
pub struct Sweeps {
    /// Number of the oldest sweep that the handle still keeps; the number the next sweep will get when it keeps none.
    pub oldest_unacknowledged: u32,
    length: u8,
    records: [SweepRecord; MAX_SWEEPS],
}

/// The list holds [`MAX_SWEEPS`] sweeps already.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a frame carries at most {MAX_SWEEPS} sweeps")]
pub struct SweepsFull;

impl Sweeps {
    /// An empty list.
    #[must_use]
    pub const fn new(oldest_unacknowledged: u32) -> Self {
        Self {
            oldest_unacknowledged,
            length: 0,
            records: [EMPTY; MAX_SWEEPS],
        }
    }

    /// Adds a sweep at the end.
    ///
    /// # Errors
    /// When the list is full; it is then unchanged.
    pub const fn push(&mut self, sweep: SweepRecord) -> Result<(), SweepsFull> {
        if MAX_SWEEPS <= self.len() {
            return Err(SweepsFull);
        }
        self.records[self.length as usize] = sweep;
        self.length += 1;
        Ok(())
    }

    /// Takes every sweep out.
    pub const fn clear(&mut self) {
        self.length = 0;
    }

    /// How many sweeps the list holds.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.length as usize
    }

    /// Whether the list holds none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Whether no further sweep fits.
    #[must_use]
    pub const fn is_full(&self) -> bool {
        self.len() == MAX_SWEEPS
    }

    /// The sweeps in the order they were added.
    #[must_use]
    pub fn as_slice(&self) -> &[SweepRecord] {
        &self.records[..self.len()]
    }

    /// The sweeps in the order they were added.
    pub fn iter(&self) -> std::slice::Iter<'_, SweepRecord> {
        self.as_slice().iter()
    }

    pub(super) fn write(&self, writer: &mut Writer<'_>) {
        writer.put(self.oldest_unacknowledged.to_le_bytes());
        writer.put([self.length, 0, 0, 0]);
        for sweep in self.as_slice() {
            writer.put(sweep.sequence.to_le_bytes());
            writer.i32x3(sweep.from);
            writer.i32x3(sweep.to);
        }
    }

    pub(super) fn read(reader: &mut Reader<'_>) -> Result<Self, FrameError> {
        let mut sweeps = Self::new(reader.u32()?);
        let count = reader.u8()?;
        reader.zeros::<3>("sweeps")?;
        for _ in 0..count {
            let sweep = SweepRecord {
                sequence: reader.u32()?,
                from: reader.i32x3()?,
                to: reader.i32x3()?,
            };
            sweeps
                .push(sweep)
                .map_err(|SweepsFull| FrameError::TooMany {
                    field: "sweeps",
                    got: count.into(),
                    most: MAX_SWEEPS as u64,
                })?;
        }
        Ok(sweeps)
    }
}

impl Default for Sweeps {
    /// An empty list of a handle that has not cut yet: its first sweep will be number 1.
    fn default() -> Self {
        Self::new(1)
    }
}

impl PartialEq for Sweeps {
    fn eq(&self, other: &Self) -> bool {
        self.oldest_unacknowledged == other.oldest_unacknowledged
            && self.as_slice() == other.as_slice()
    }
}

impl Eq for Sweeps {}

impl fmt::Debug for Sweeps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Sweeps")
            .field("oldest_unacknowledged", &self.oldest_unacknowledged)
            .field("records", &self.as_slice())
            .finish()
    }
}

impl<'a> IntoIterator for &'a Sweeps {
    type Item = &'a SweepRecord;
    type IntoIter = std::slice::Iter<'a, SweepRecord>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
