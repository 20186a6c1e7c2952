//! What corrections of the handle's copy of the clay have done to the hand.

use crate::FrameError;
use teleclay_wire::bytes::{Reader, Writer};

/// Bytes on the wire.
pub(super) const LENGTH: usize = 36;

/// What corrections of the handle's copy of the clay have done to the hand, since the copy was made.
///
/// ```text
///  0         8        20               24           28       32      36
///  +---------+--------+----------------+------------+--------+-------+
///  | moved_n | held_n | largest_step_n | injected_j | tank_j | count |
///  |   f64   | f32x3  |      f32       |    f32     |  f32   |  u32  |
///  +---------+--------+----------------+------------+--------+-------+
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Corrections {
    /// How far corrections have moved the felt force, tick by tick and all told, N. Never falls, so a frame that is
    /// lost hides no step.
    pub moved_n: f64,
    /// Felt force less the force that the corrected copy gives, N: what is still to be let in.
    pub held_n: [f32; 3],
    /// Largest change of the felt force in one tick on account of corrections, N. Never falls.
    pub largest_step_n: f32,
    /// Energy that corrections have brought into the hand, J. Never falls.
    pub injected_j: f32,
    /// Energy that they may bring into it yet, J.
    pub tank_j: f32,
    /// Corrections that changed the force on the tool; wraps.
    pub count: u32,
}

impl Corrections {
    pub(super) fn write(&self, writer: &mut Writer<'_>) {
        writer.put(self.moved_n.to_le_bytes());
        writer.f32x3(self.held_n);
        for value in [self.largest_step_n, self.injected_j, self.tank_j] {
            writer.put(value.to_le_bytes());
        }
        writer.put(self.count.to_le_bytes());
    }

    pub(super) fn read(reader: &mut Reader<'_>) -> Result<Self, FrameError> {
        Ok(Self {
            moved_n: reader.f64()?,
            held_n: reader.f32x3()?,
            largest_step_n: reader.f32()?,
            injected_j: reader.f32()?,
            tank_j: reader.f32()?,
            count: reader.u32()?,
        })
    }
}
