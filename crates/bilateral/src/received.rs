//! The server's clay as a handle receives it: a block, messages of its classes of material if it has more than one, and
//! messages of bricks until every one has been told.
//!
//! Nothing that a server says is trusted: what shows another block, misses bricks or holds clay where none can be is no
//! clay.

use std::sync::Arc;

use teleclay_clay::{BrickView, Classes, ClassesError, Clay, ReplaceError, ShapeError};
use teleclay_proto::FrameError;
use teleclay_proto::http::{ClaySpec, Validate};
use teleclay_proto::watch::{BRICK_VOXELS, BrickBody, BricksView, ClassesView};

use crate::parameters::clay_shape;

/// Why what came is not the clay.
#[derive(Debug, thiserror::Error)]
pub enum NotReceived {
    /// There is no such block.
    #[error("clay: {reason}")]
    Spec {
        /// Why not, for people.
        reason: String,
    },
    /// Nor is there one of this shape.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// A message is none of bricks.
    #[error("bricks: {0}")]
    Message(#[from] FrameError),
    /// It shows another block.
    #[error("bricks of block {got}, wanted {want}")]
    Epoch {
        /// Its epoch.
        got: u32,
        /// The block's.
        want: u32,
    },
    /// It shows another grid.
    #[error("bricks of a grid of {got:?}, wanted {want:?}")]
    Grid {
        /// Its bricks along each axis.
        got: [u16; 3],
        /// The block's.
        want: [u16; 3],
    },
    /// It tells a brick outside of the grid.
    #[error("there is no brick {index}")]
    NoBrick {
        /// As it came.
        index: u32,
    },
    /// It holds clay where none can be.
    #[error("bricks: {0}")]
    Brick(#[from] ReplaceError),
    /// A part of the classes that does not follow the one before.
    #[error("classes from byte {got} of {total} on, wanted byte {want} of {want_total}")]
    ClassesPart {
        /// Where the part begins.
        got: u32,
        /// Of how many it says it is.
        total: u32,
        /// Where the next part begins.
        want: u32,
        /// Of how many it is.
        want_total: u32,
    },
    /// What came as classes is none, or another block's.
    #[error(transparent)]
    Classes(#[from] ClassesError),
    /// The messages are over too early.
    #[error("{missing} of {bricks} bricks did not come")]
    Missing {
        /// How many were not told.
        missing: usize,
        /// How many there are.
        bricks: usize,
    },
}

/// A block of which some bricks have come.
pub struct ReceivedClay {
    clay: Box<Clay>,
    epoch: u32,
    is_told: Vec<bool>,
    voxels: Box<[u8; BRICK_VOXELS]>,
    /// The classes as far as they have come, and how many bytes they are.
    classes: Option<(Vec<u8>, u32)>,
}

impl ReceivedClay {
    /// The block of `spec`, of which nothing has come.
    ///
    /// # Errors
    /// There is no such block.
    pub fn begin(spec: &ClaySpec, epoch: u32) -> Result<Self, NotReceived> {
        spec.validate().map_err(|error| NotReceived::Spec {
            reason: error.to_string(),
        })?;
        let clay = Clay::new(&clay_shape(&spec.shape)?, spec.voxel_size_m)?;
        Ok(Self {
            is_told: vec![false; clay.grid().brick_count()],
            clay: Box::new(clay),
            epoch,
            voxels: Box::new([0; BRICK_VOXELS]),
            classes: None,
        })
    }

    /// Takes in a message. One that is refused may have told a part of its bricks: then there is nothing to go on with.
    ///
    /// # Errors
    /// It is none, or one of another block.
    pub fn take_in(&mut self, message: &[u8]) -> Result<(), NotReceived> {
        if let Ok(view) = ClassesView::decode(message) {
            return self.take_in_classes(&view);
        }
        let view = BricksView::decode(message)?;
        if view.header.clay_epoch != self.epoch {
            return Err(NotReceived::Epoch {
                got: view.header.clay_epoch,
                want: self.epoch,
            });
        }
        let grid = *self.clay.grid();
        if view.header.bricks_per_axis != grid.bricks() {
            return Err(NotReceived::Grid {
                got: view.header.bricks_per_axis,
                want: grid.bricks(),
            });
        }
        for brick in view.iter() {
            let index = brick.index;
            let place = grid
                .brick_index(index)
                .ok_or(NotReceived::NoBrick { index })?;
            let content = match brick.body {
                BrickBody::Empty => BrickView::Empty,
                BrickBody::Full => BrickView::Full,
                BrickBody::Packed(packed) => {
                    packed.unpack(&mut self.voxels);
                    BrickView::Voxels(&self.voxels)
                }
            };
            self.clay.replace_brick(place, content)?;
            self.is_told[index as usize] = true;
        }
        Ok(())
    }

    /// Takes in a part of the classes. They come in their order.
    fn take_in_classes(&mut self, view: &ClassesView<'_>) -> Result<(), NotReceived> {
        if view.clay_epoch != self.epoch {
            return Err(NotReceived::Epoch {
                got: view.clay_epoch,
                want: self.epoch,
            });
        }
        // Nothing is set aside for what has not come.
        let (bytes, total) = self.classes.get_or_insert((Vec::new(), view.total));
        let want = bytes.len() as u32;
        if (view.offset, view.total) != (want, *total) {
            return Err(NotReceived::ClassesPart {
                got: view.offset,
                total: view.total,
                want,
                want_total: *total,
            });
        }
        bytes.extend_from_slice(view.part);
        Ok(())
    }

    /// Which block it is.
    #[must_use]
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// The clay, once all of it has come.
    ///
    /// # Errors
    /// Bricks are missing.
    pub fn finish(mut self) -> Result<Box<Clay>, NotReceived> {
        let bricks = self.is_told.len();
        let missing = self.is_told.iter().filter(|is_told| !**is_told).count();
        if 0 < missing {
            return Err(NotReceived::Missing { missing, bricks });
        }
        if let Some((bytes, _)) = &self.classes {
            // Cut short, they are malformed.
            let classes = Classes::decode(self.clay.grid(), bytes)?;
            self.clay.assign_classes(Some(Arc::new(classes)))?;
        }
        // Neither page faults nor hashes of bricks that nobody has touched are the tick's work.
        self.clay.commit_pages();
        self.clay.hash();
        Ok(self.clay)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use teleclay_clay::{Ball, Pose, Sweep, ToolShape};
    use teleclay_proto::http::ClayShape;
    use teleclay_proto::watch::{BrickContent, BricksHeader, BricksWriter};

    fn spec() -> ClaySpec {
        ClaySpec {
            shape: ClayShape::Block {
                size_m: [0.048, 0.032, 0.020],
            },
            voxel_size_m: 1e-3,
            layers: Vec::new(),
        }
    }

    fn cut_block() -> Clay {
        let mut clay = Clay::new(&clay_shape(&spec().shape).unwrap(), 1e-3).unwrap();
        let at = |position_m| Pose::quantise(position_m).unwrap();
        clay.carve(&Sweep {
            shape: ToolShape::Ball(Ball::new(0.006).unwrap()),
            from: at([0.005, 0.016, 0.018]),
            to: at([0.040, 0.012, 0.012]),
        });
        clay
    }

    fn build(spec: &ClaySpec, epoch: u32, messages: &[Vec<u8>]) -> Result<Box<Clay>, NotReceived> {
        let mut received = ReceivedClay::begin(spec, epoch)?;
        messages
            .iter()
            .try_for_each(|message| received.take_in(message))?;
        received.finish()
    }

    fn refusal(built: Result<Box<Clay>, NotReceived>) -> String {
        built.map(|_| ()).unwrap_err().to_string()
    }

    /// The clay in messages, without the bricks that `is_told` leaves out.
    fn told(clay: &Clay, epoch: u32, is_told: impl Fn(u32) -> bool) -> Vec<Vec<u8>> {
        let header = BricksHeader {
            clay_epoch: epoch,
            bricks_per_axis: clay.grid().bricks(),
            voxel_size_m: 1e-3,
            ..BricksHeader::default()
        };
        // So short that it takes several messages.
        let mut writer = BricksWriter::new(header, 4096);
        for dense in (0..clay.grid().brick_count() as u32).filter(|dense| is_told(*dense)) {
            let index = clay.grid().brick_index(dense).unwrap();
            let content = match clay.brick(index) {
                BrickView::Empty => BrickContent::Empty,
                BrickView::Full => BrickContent::Full,
                BrickView::Voxels(voxels) => BrickContent::Voxels(voxels),
            };
            writer.push(dense, content).unwrap();
        }
        writer.finish()
    }

    #[test]
    fn a_snapshot_is_the_clay_to_the_last_bit() {
        let mut clay = cut_block();
        let messages = told(&clay, 4, |_| true);
        assert!(1 < messages.len());
        let mut built = build(&spec(), 4, &messages).unwrap();
        assert_eq!(built.hash(), clay.hash());
        assert_eq!(built.remaining_units(), clay.remaining_units());
        assert_eq!(built.initial_units(), clay.initial_units());
    }

    #[test]
    fn what_is_no_snapshot_of_this_block_is_refused_with_the_reason() {
        let clay = cut_block();
        let whole = told(&clay, 4, |_| true);
        let why = |messages: &[Vec<u8>]| refusal(build(&spec(), 4, messages));
        assert_eq!(
            why(&told(&clay, 5, |_| true)),
            "bricks of block 5, wanted 4"
        );
        assert_eq!(why(&[]), "12 of 12 bricks did not come");
        assert_eq!(
            why(&told(&clay, 4, |dense| dense != 3)),
            "1 of 12 bricks did not come"
        );
        assert!(why(&[whole[0][..20].to_vec()]).starts_with("bricks: "));
        let taller = ClaySpec {
            shape: ClayShape::Block {
                size_m: [0.048, 0.032, 0.040],
            },
            ..spec()
        };
        let said = refusal(build(&taller, 4, &whole));
        assert!(said.contains("bricks of a grid of [3, 2, 2]"), "{said}");
    }

    #[test]
    fn clay_where_none_can_be_is_refused() {
        let higher = ClaySpec {
            shape: ClayShape::Block {
                size_m: [0.048, 0.032, 0.024],
            },
            ..spec()
        };
        let clay = Clay::new(&clay_shape(&higher.shape).unwrap(), 1e-3).unwrap();
        let said = refusal(build(&spec(), 4, &told(&clay, 4, |_| true)));
        assert!(said.starts_with("bricks: "), "{said}");
    }
}
