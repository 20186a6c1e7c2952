//! The clay as one watcher has it: what is due to be sent, and never more than there are bricks.
//!
//! For each brick it is known up to which revision the watcher has it. However slowly a watcher reads, a brick that
//! changed a hundred times is sent once, as it is when its turn comes.

use teleclay_clay::{BRICK_VOXELS, BrickView, Clay};
use teleclay_proto::watch::{
    BrickContent, BricksHeader, BricksKind, BricksWriter, PackedBrick, pack,
};

/// Longest message, so that telemetry does not wait behind a keyframe.
const LONGEST: usize = 32 * 1024;

/// Bytes that a brick takes besides its voxels; as much as an empty or full one takes at all.
const BRICK_HEAD: usize = 8;

/// Follows one clay for one watcher.
#[derive(Default)]
pub(super) struct Follower {
    sequence: u32,
    seen: Option<Seen>,
}

/// What the watcher has of the present block.
struct Seen {
    epoch: u32,
    /// Per brick: it is due when its revision is at least this.
    due_from: Vec<u64>,
    /// The clay's revision when last everything was sent; nothing is due until it changes.
    complete_at: Option<u64>,
    /// The brick whose turn it is, so that a busy corner cannot starve the rest.
    next: u32,
}

impl Follower {
    /// The messages that bring the watcher nearer to the clay: at most `most_bytes`, and one brick more. A fresh
    /// watcher and a fresh block get a keyframe first; what does not fit into one call comes with the next ones.
    pub(super) fn follow(&mut self, clay: &Clay, epoch: u32, most_bytes: usize) -> Vec<Vec<u8>> {
        if most_bytes == 0 {
            return Vec::new();
        }
        let grid = clay.grid();
        let bricks = grid.brick_count();
        let mut header = BricksHeader {
            sequence: self.sequence,
            clay_epoch: epoch,
            bricks_per_axis: grid.bricks(),
            kind: BricksKind::Delta,
            voxel_size_m: grid.voxel_size_m() as f32,
        };
        let known = self
            .seen
            .take_if(|seen| seen.epoch == epoch && seen.due_from.len() == bricks);
        let mut seen = known.unwrap_or_else(|| {
            header.kind = BricksKind::Keyframe;
            Seen::nothing(epoch, bricks)
        });
        let mut writer = BricksWriter::new(header, LONGEST);
        if seen.complete_at != Some(clay.revision()) {
            seen.send_due(clay, &mut writer, most_bytes);
        }
        self.seen = Some(seen);
        let messages = writer.finish();
        self.sequence = self.sequence.wrapping_add(messages.len() as u32);
        messages
    }

    /// The watcher does not want bricks for a while; the next ones begin with a keyframe. Sequence numbers go on.
    pub(super) fn rest(&mut self) {
        self.seen = None;
    }
}

impl Seen {
    fn nothing(epoch: u32, bricks: usize) -> Self {
        Self {
            epoch,
            due_from: vec![0; bricks],
            complete_at: None,
            next: 0,
        }
    }

    fn send_due(&mut self, clay: &Clay, writer: &mut BricksWriter, most_bytes: usize) {
        let bricks = self.due_from.len() as u32;
        let mut packed = Vec::new();
        let mut spent = 0;
        for _ in 0..bricks {
            if most_bytes <= spent {
                return;
            }
            let dense = self.next;
            self.next = (dense + 1) % bricks;
            let Some(index) = clay.grid().brick_index(dense) else {
                continue;
            };
            let revision = clay.brick_revision(index);
            let due_from = &mut self.due_from[dense as usize];
            if revision < *due_from {
                continue;
            }
            // A keyframe starts out empty.
            let is_news = *due_from != 0;
            *due_from = revision + 1;
            let content = match clay.brick(index) {
                BrickView::Empty if !is_news => continue,
                BrickView::Empty => BrickContent::Empty,
                BrickView::Full => BrickContent::Full,
                BrickView::Voxels(voxels) => pack_into(&mut packed, voxels),
            };
            spent += BRICK_HEAD;
            if let BrickContent::Packed(packed) = content {
                spent += packed.as_bytes().len();
            }
            writer
                .push(dense, content)
                .expect("the index is below the number of bricks that the header states");
        }
        self.complete_at = Some(clay.revision());
    }
}

fn pack_into<'a>(packed: &'a mut Vec<u8>, voxels: &[u8; BRICK_VOXELS]) -> BrickContent<'a> {
    packed.clear();
    pack(voxels, packed);
    BrickContent::Packed(PackedBrick::new(packed).expect("what was packed unpacks"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use teleclay_clay::{Pose, Shape, Sweep, ToolShape};
    use teleclay_proto::watch::{BRICK_VOXELS, BricksView};

    use super::*;

    /// What a browser keeps.
    #[derive(Default)]
    struct Mirror {
        bricks: BTreeMap<u32, Box<[u8; BRICK_VOXELS]>>,
        bytes: usize,
        messages: u32,
        told: usize,
    }

    impl Mirror {
        fn take(&mut self, messages: &[Vec<u8>]) {
            for message in messages {
                let view = BricksView::decode(message).unwrap();
                assert_eq!(view.header.sequence, self.messages);
                self.messages += 1;
                self.bytes += message.len();
                assert!(message.len() <= LONGEST + 8192);
                if view.header.kind == BricksKind::Keyframe {
                    self.bricks.clear();
                }
                for brick in view.iter() {
                    self.told += 1;
                    let mut voxels = Box::new([0; BRICK_VOXELS]);
                    brick.body.unpack(&mut voxels);
                    self.bricks.insert(brick.index, voxels);
                }
            }
        }

        fn assert_shows(&self, clay: &Clay) {
            for dense in 0..clay.grid().brick_count() as u32 {
                let index = clay.grid().brick_index(dense).unwrap();
                let want = match clay.brick(index) {
                    BrickView::Empty => [0; BRICK_VOXELS],
                    BrickView::Full => [255; BRICK_VOXELS],
                    BrickView::Voxels(voxels) => *voxels,
                };
                let got = self.bricks.get(&dense).map_or([0; BRICK_VOXELS], |b| **b);
                assert!(got == want, "brick {dense} differs");
            }
        }
    }

    fn clay() -> Clay {
        let shape = Shape::Block {
            size_m: [0.128, 0.064, 0.064],
        };
        Clay::new(&shape, 5e-4).unwrap()
    }

    fn carve(clay: &mut Clay, from: [f64; 3], to: [f64; 3]) {
        clay.carve(&Sweep {
            shape: ToolShape::ball(0.006).unwrap(),
            from: Pose::quantise(from).unwrap(),
            to: Pose::quantise(to).unwrap(),
        });
    }

    #[test]
    fn a_fresh_watcher_gets_the_whole_clay_and_then_only_changes() {
        let mut clay = clay();
        carve(&mut clay, [0.02, 0.03, 0.06], [0.1, 0.03, 0.06]);
        let (mut follower, mut mirror) = (Follower::default(), Mirror::default());
        mirror.take(&follower.follow(&clay, 0, usize::MAX));
        mirror.assert_shows(&clay);
        assert!(follower.follow(&clay, 0, usize::MAX).is_empty());

        let told = mirror.told;
        carve(&mut clay, [0.02, 0.01, 0.06], [0.021, 0.01, 0.06]);
        mirror.take(&follower.follow(&clay, 0, usize::MAX));
        mirror.assert_shows(&clay);
        let changed = mirror.told - told;
        assert!(0 < changed && changed < 30, "{changed} bricks for one cut");
    }

    #[test]
    fn empty_bricks_are_told_only_to_who_had_them_otherwise() {
        let shape = Shape::Block { size_m: [0.064; 3] };
        let mut clay = Clay::new(&shape, 1e-3).unwrap();
        carve(&mut clay, [0.0; 3], [0.0; 3]);
        let scoop = Sweep {
            shape: ToolShape::ball(0.03).unwrap(),
            from: Pose::quantise([0.032; 3]).unwrap(),
            to: Pose::quantise([0.032; 3]).unwrap(),
        };
        let (mut early, mut late) = (Follower::default(), Follower::default());
        let (mut has, mut comes) = (Mirror::default(), Mirror::default());
        has.take(&early.follow(&clay, 0, usize::MAX));
        clay.carve(&scoop);
        has.take(&early.follow(&clay, 0, usize::MAX));
        has.assert_shows(&clay);
        comes.take(&late.follow(&clay, 0, usize::MAX));
        comes.assert_shows(&clay);
        assert!(
            comes.told < clay.grid().brick_count(),
            "the hollow is not told"
        );
    }

    /// A watcher with a trickle of budget gets everything in the end, and a brick that changes all the time costs it
    /// one copy per turn, not one per change.
    #[test]
    fn a_slow_watcher_gets_merged_bricks_and_nothing_starves() {
        let mut clay = clay();
        let (mut follower, mut mirror) = (Follower::default(), Mirror::default());
        let mut calls = 0;
        for step in 0..400 {
            let x = 0.02 + 0.0002 * f64::from(step);
            carve(&mut clay, [x, 0.03, 0.06], [x + 0.0002, 0.03, 0.06]);
            // And one place that is never left alone.
            let z = 0.064 - 1e-5 * f64::from(step);
            carve(&mut clay, [0.001, 0.001, z], [0.001, 0.001, z]);
            if step % 10 == 0 {
                let messages = follower.follow(&clay, 0, 500);
                let bytes: usize = messages.iter().map(Vec::len).sum();
                assert!(bytes < 500 + 28 + 8 + 4128, "{bytes} B at once");
                mirror.take(&messages);
                calls += 1;
            }
        }
        while {
            let messages = follower.follow(&clay, 0, 500);
            mirror.take(&messages);
            calls += 1;
            assert!(calls < 1000, "it never gets there");
            !messages.is_empty()
        } {}
        mirror.assert_shows(&clay);
    }

    #[test]
    fn a_fresh_block_starts_a_keyframe_even_of_another_size() {
        let mut follower = Follower::default();
        let mut mirror = Mirror::default();
        mirror.take(&follower.follow(&clay(), 0, usize::MAX));
        let small = Clay::new(&Shape::Block { size_m: [0.02; 3] }, 1e-3).unwrap();
        mirror.take(&follower.follow(&small, 1, usize::MAX));
        assert_eq!(mirror.bricks.len(), small.grid().brick_count());
        mirror.assert_shows(&small);
    }

    #[test]
    fn without_budget_nothing_is_sent_and_nothing_is_lost() {
        let clay = clay();
        let mut follower = Follower::default();
        assert!(follower.follow(&clay, 0, 0).is_empty());
        let mut mirror = Mirror::default();
        mirror.take(&follower.follow(&clay, 0, usize::MAX));
        mirror.assert_shows(&clay);
    }

    #[test]
    fn after_a_rest_comes_a_keyframe_again() {
        let clay = clay();
        let mut follower = Follower::default();
        let first = follower.follow(&clay, 0, usize::MAX);
        follower.rest();
        let again = follower.follow(&clay, 0, usize::MAX);
        let view = BricksView::decode(&again[0]).unwrap();
        assert_eq!(view.header.kind, BricksKind::Keyframe);
        assert_eq!(view.header.sequence, first.len() as u32);
    }
}
