//! The clay of one moment after another as messages of bricks: a keyframe first, then what differs.

use teleclay_clay::{BrickView, Clay};
use teleclay_wire::{
    BrickContent, BricksHeader, BricksKind, BricksWriter, FrameError, MAX_MESSAGE,
};

/// What the reader of the messages has by now.
#[derive(Default)]
pub struct Told {
    /// Bricks along x, y, z, and the bits of a voxel's edge; nothing before the first message.
    grid: Option<([u16; 3], u64)>,
    /// By brick.
    hashes: Vec<u64>,
    sequence: u32,
}

impl Told {
    /// The messages that make the clay that was told into this one.
    ///
    /// # Errors
    /// The clay has a grid that no message can tell of.
    pub fn tell(&mut self, clay: &mut Clay, clay_epoch: u32) -> Result<Vec<Vec<u8>>, FrameError> {
        let grid = *clay.grid();
        let (counts, size_m) = (grid.bricks(), grid.voxel_size_m());
        let is_another = self.grid != Some((counts, size_m.to_bits()));
        let mut writer = BricksWriter::new(
            BricksHeader {
                sequence: self.sequence,
                clay_epoch,
                bricks_per_axis: counts,
                kind: if is_another {
                    BricksKind::Keyframe
                } else {
                    BricksKind::Delta
                },
                voxel_size_m: size_m as f32,
            },
            MAX_MESSAGE,
        );
        self.grid = Some((counts, size_m.to_bits()));
        self.hashes.resize(grid.brick_count(), 0);
        for dense in 0..grid.brick_count() as u32 {
            let Some(index) = grid.brick_index(dense) else {
                continue;
            };
            let hash = clay.brick_hash(index);
            let before = std::mem::replace(&mut self.hashes[dense as usize], hash);
            let content = match clay.brick(index) {
                // A keyframe leaves out what is empty.
                BrickView::Empty if is_another => continue,
                BrickView::Empty => BrickContent::Empty,
                BrickView::Full => BrickContent::Full,
                BrickView::Voxels(voxels) => BrickContent::Voxels(voxels),
            };
            if is_another || before != hash {
                writer.push(dense, content)?;
            }
        }
        let messages = writer.finish();
        self.sequence = self.sequence.wrapping_add(messages.len() as u32);
        Ok(messages)
    }
}
