//! Cuts on their way to the server: a list of bounded length, so that the loop never allocates.
//!
//! A tool that cuts goes on from where it came to, so sweeps mostly follow one another: the list is kept, and written,
//! as runs of sweeps each of which begins where the one before it ends.

use std::fmt;

use crate::FrameError;
use teleclay_wire::bytes::{Reader, Writer};

/// Bytes that the sweeps of one frame take at most.
///
/// In one run these are [`MAX_SWEEPS`], at one sweep a tick an eighth of a second; a frame full of them and of
/// [gaps](super::Gaps) still fits one datagram.
pub const SWEEP_BYTES: usize = 800;

/// Most sweeps that one frame carries: one run of short steps.
pub const MAX_SWEEPS: usize = (SWEEP_BYTES - RUN_HEAD) / SHORT;

/// Metres per unit of a sweep's position: 2⁻²⁴ m, about 60 nm. 32 bits reach ±128 m.
pub const POSITION_UNIT_M: f64 = 1.0 / 16_777_216.0;

/// Bytes before the first run.
pub(super) const HEAD: usize = 8;

/// Bytes of a run before its steps.
const RUN_HEAD: usize = 20;
/// Where in a run the count of its sweeps stands.
const COUNT_AT: usize = 4;
/// Bytes of a step whose coordinates take 16 bits, and of one whose coordinates take 32.
const SHORT: usize = 6;
const LONG: usize = 12;

const _: () = assert!(
    MAX_SWEEPS <= u8::MAX as usize,
    "a run counts its sweeps in a byte"
);

const NOTHING: SweepRecord = SweepRecord {
    sequence: 0,
    from: [0; 3],
    to: [0; 3],
};

/// One straight cut that a tool has made in a copy of the clay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SweepRecord {
    /// Number of the sweep, counted from 1 since joining; wraps, see [`is_after`](crate::is_after).
    pub sequence: u32,
    /// Where the tool was, in the clay's frame, in units of [`POSITION_UNIT_M`].
    pub from: [i32; 3],
    /// Where the tool came to, likewise.
    pub to: [i32; 3],
}

impl SweepRecord {
    /// The bytes that this sweep adds to a list whose last one is `before`.
    #[must_use]
    pub fn bytes_after(&self, before: Option<&Self>) -> usize {
        let step = step_bytes(self.step());
        if before.is_some_and(|before| self.continues(before)) {
            step
        } else {
            RUN_HEAD + step
        }
    }

    #[inline]
    fn step(&self) -> [i32; 3] {
        std::array::from_fn(|axis| self.to[axis].wrapping_sub(self.from[axis]))
    }

    /// Whether it can stand in the run that `before` ends.
    fn continues(&self, before: &Self) -> bool {
        self.sequence == before.sequence.wrapping_add(1)
            && self.from == before.to
            && step_bytes(self.step()) == step_bytes(before.step())
    }
}

/// Sweeps that the other side has not acknowledged yet, as many as [`SWEEP_BYTES`] hold.
///
/// On the wire, and here, they are runs:
///
/// ```text
///  0          4       5       6      8            20
///  +----------+-------+-------+------+------------+-------------------+
///  | sequence | count | bytes | zero | from       | count x step      |
///  |   u32    |  u8   |  u8   | u8x2 | i32x3      | i16x3 or i32x3    |
///  +----------+-------+-------+------+------------+-------------------+
/// ```
///
/// The first sweep has this sequence number and begins at `from`; each goes on by its step, in a coordinate of so many
/// bytes, 2 or 4, that wraps.
#[derive(Clone, Copy)]
pub struct Sweeps {
    /// Number of the oldest sweep that the sender still keeps; the number the next sweep will get when it keeps none.
    pub oldest_unacknowledged: u32,
    bytes: [u8; SWEEP_BYTES],
    used: u16,
    count: u16,
    runs: u8,
    /// Where the last run begins, and the last sweep of all.
    run_at: u16,
    last: SweepRecord,
}

/// There is no room in the list for this sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the sweeps of a frame take at most {SWEEP_BYTES} bytes")]
pub struct SweepsFull;

impl Sweeps {
    /// An empty list.
    #[must_use]
    pub const fn new(oldest_unacknowledged: u32) -> Self {
        Self {
            oldest_unacknowledged,
            bytes: [0; SWEEP_BYTES],
            used: 0,
            count: 0,
            runs: 0,
            run_at: 0,
            last: NOTHING,
        }
    }

    /// Adds a sweep at the end.
    ///
    /// # Errors
    /// There is no room for it; the list is then unchanged.
    pub fn push(&mut self, sweep: SweepRecord) -> Result<(), SweepsFull> {
        let step = sweep.step();
        let continues = self.last().is_some_and(|last| sweep.continues(last));
        let step_bytes = step_bytes(step);
        let needed = step_bytes + if continues { 0 } else { RUN_HEAD };
        let used = usize::from(self.used);
        if SWEEP_BYTES < used + needed {
            return Err(SweepsFull);
        }
        let mut writer = Writer::new(&mut self.bytes[used..]);
        if !continues {
            writer.put(sweep.sequence.to_le_bytes());
            writer.put([0, step_bytes as u8 / 3, 0, 0]);
            writer.i32x3(sweep.from);
            self.run_at = self.used;
            self.runs += 1;
        }
        for coordinate in step {
            if step_bytes == SHORT {
                writer.put((coordinate as i16).to_le_bytes());
            } else {
                writer.put(coordinate.to_le_bytes());
            }
        }
        self.bytes[usize::from(self.run_at) + COUNT_AT] += 1;
        self.used += needed as u16;
        self.count += 1;
        self.last = sweep;
        Ok(())
    }

    /// Takes every sweep out.
    pub const fn clear(&mut self) {
        self.used = 0;
        self.count = 0;
        self.runs = 0;
    }

    /// How many sweeps the list holds.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.count as usize
    }

    /// Whether the list holds none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// How many bytes they take, of [`SWEEP_BYTES`].
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.used as usize
    }

    /// The sweep added last.
    #[must_use]
    pub const fn last(&self) -> Option<&SweepRecord> {
        if self.is_empty() {
            None
        } else {
            Some(&self.last)
        }
    }

    /// The sweeps in the order they were added.
    #[must_use]
    pub fn iter(&self) -> Iter<'_> {
        Iter {
            bytes: &self.bytes[..usize::from(self.used)],
            left: 0,
            is_short: false,
            at: NOTHING,
        }
    }

    pub(super) fn write(&self, writer: &mut Writer<'_>) {
        writer.put(self.oldest_unacknowledged.to_le_bytes());
        writer.put([self.runs, 0, 0, 0]);
        writer.slice(&self.bytes[..usize::from(self.used)]);
    }

    pub(super) fn read(reader: &mut Reader<'_>) -> Result<Self, FrameError> {
        let mut sweeps = Self::new(reader.u32()?);
        let runs = reader.u8()?;
        reader.zeros::<3>("sweeps")?;
        for _ in 0..runs {
            sweeps.read_run(reader)?;
        }
        sweeps.last = sweeps.iter().last().unwrap_or(NOTHING);
        Ok(sweeps)
    }

    fn read_run(&mut self, reader: &mut Reader<'_>) -> Result<(), FrameError> {
        let head: [u8; RUN_HEAD] = reader.array()?;
        let count = head[COUNT_AT];
        if count == 0 {
            return Err(FrameError::UnknownValue {
                field: "count of a run of sweeps",
                got: 0,
            });
        }
        let step_bytes = match head[COUNT_AT + 1] {
            2 => SHORT,
            4 => LONG,
            got => {
                return Err(FrameError::UnknownValue {
                    field: "width of a step",
                    got,
                });
            }
        };
        if head[COUNT_AT + 2..8] != [0; 2] {
            return Err(FrameError::ReservedNotZero {
                field: "a run of sweeps",
            });
        }
        let used = usize::from(self.used);
        let end = used + RUN_HEAD + usize::from(count) * step_bytes;
        if SWEEP_BYTES < end {
            return Err(FrameError::TooMany {
                field: "bytes of sweeps",
                got: end as u64,
                most: SWEEP_BYTES as u64,
            });
        }
        let steps = reader.slice(usize::from(count) * step_bytes)?;
        self.bytes[used..used + RUN_HEAD].copy_from_slice(&head);
        self.bytes[used + RUN_HEAD..end].copy_from_slice(steps);
        self.run_at = self.used;
        self.used = end as u16;
        self.count += u16::from(count);
        self.runs += 1;
        Ok(())
    }
}

/// Bytes of a step in the narrowest form that holds it.
fn step_bytes(step: [i32; 3]) -> usize {
    let is_short = step
        .iter()
        .all(|coordinate| i16::try_from(*coordinate).is_ok());
    if is_short { SHORT } else { LONG }
}

/// The sweeps of a list, one after the other.
#[derive(Clone)]
pub struct Iter<'a> {
    /// What is left: in the middle of a run, or at the beginning of one.
    bytes: &'a [u8],
    /// Sweeps of the present run that are left.
    left: u8,
    is_short: bool,
    at: SweepRecord,
}

impl Iter<'_> {
    /// The bytes of a list were checked, or written here, before.
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.bytes.split_first_chunk::<N>()?;
        self.bytes = rest;
        Some(*taken)
    }

    fn i32x3(&mut self) -> Option<[i32; 3]> {
        let mut vector = [0; 3];
        for coordinate in &mut vector {
            *coordinate = i32::from_le_bytes(self.take()?);
        }
        Some(vector)
    }

    fn step(&mut self) -> Option<[i32; 3]> {
        if !self.is_short {
            return self.i32x3();
        }
        let mut vector = [0; 3];
        for coordinate in &mut vector {
            *coordinate = i16::from_le_bytes(self.take()?).into();
        }
        Some(vector)
    }
}

impl Iterator for Iter<'_> {
    type Item = SweepRecord;

    fn next(&mut self) -> Option<SweepRecord> {
        let (sequence, from) = if self.left == 0 {
            let sequence = u32::from_le_bytes(self.take()?);
            let [count, width, _, _] = self.take()?;
            self.left = count;
            self.is_short = width == 2;
            (sequence, self.i32x3()?)
        } else {
            (self.at.sequence.wrapping_add(1), self.at.to)
        };
        let step = self.step()?;
        self.left -= 1;
        self.at = SweepRecord {
            sequence,
            from,
            to: std::array::from_fn(|axis| from[axis].wrapping_add(step[axis])),
        };
        Some(self.at)
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
        self.oldest_unacknowledged == other.oldest_unacknowledged && self.iter().eq(other)
    }
}

impl Eq for Sweeps {}

impl fmt::Debug for Sweeps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Sweeps")
            .field("oldest_unacknowledged", &self.oldest_unacknowledged)
            .field("records", &self.iter().collect::<Vec<_>>())
            .finish()
    }
}

impl<'a> IntoIterator for &'a Sweeps {
    type Item = SweepRecord;
    type IntoIter = Iter<'a>;

    fn into_iter(self) -> Iter<'a> {
        self.iter()
    }
}
