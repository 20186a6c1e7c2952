//! The clay on show: messages of bricks in, meshes of those that changed out.

use teleclay_clay::mirror::{COARSE_VOXELS, TooManyBricks};
use teleclay_clay::{BRICK_VOXELS, BrickMesh, BrickView, Mirror};
use teleclay_wire::{BrickBody, BricksHeader, BricksKind, BricksView, FrameError};

/// How fine clay is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Detail {
    /// As it is.
    #[default]
    Full,
    /// In voxels of twice the edge: a quarter of the triangles, for machines whose processor draws. Eight bricks make
    /// one.
    Half,
}

/// What a message made of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grid {
    /// Meshes of before still stand.
    AsBefore,
    /// It has other voxels, and no mesh of before is of any use.
    Another,
}

/// A message that is of no use.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NotShown {
    /// It is no message of bricks.
    #[error(transparent)]
    Message(#[from] FrameError),
    /// No grid is as large.
    #[error(transparent)]
    Grid(#[from] TooManyBricks),
}

/// The clay that a page shows.
#[derive(Default)]
pub struct ShownClay {
    detail: Detail,
    mirror: Mirror,
    epoch: u32,
    voxel_size_m: f64,
}

impl ShownClay {
    /// Shows clay as fine as this from the next keyframe on.
    pub fn show(&mut self, detail: Detail) {
        self.detail = detail;
    }

    /// Takes a message in, whole or not at all.
    ///
    /// # Errors
    /// When it is none, or of a grid that is too large.
    pub fn take_in(&mut self, message: &[u8]) -> Result<Grid, NotShown> {
        let message = BricksView::decode(message)?;
        let header = message.header;
        let (counts, voxel_size_m) = self.grid_of(&header);
        let is_another =
            counts != self.mirror.counts() || voxel_size_m.to_bits() != self.voxel_size_m.to_bits();
        if is_another || header.kind == BricksKind::Keyframe {
            self.mirror.start_anew(counts)?;
        }
        (self.epoch, self.voxel_size_m) = (header.clay_epoch, voxel_size_m);
        let mut voxels = [0; BRICK_VOXELS];
        for brick in message.iter() {
            let content = match brick.body {
                BrickBody::Empty => BrickView::Empty,
                BrickBody::Full => BrickView::Full,
                BrickBody::Packed(packed) => {
                    packed.unpack(&mut voxels);
                    BrickView::Voxels(&voxels)
                }
            };
            match self.detail {
                Detail::Full => self.mirror.replace(brick.index, content),
                Detail::Half => {
                    let (index, eighth) = halved(&header, counts, brick.index);
                    self.mirror.replace_eighth(index, eighth, content);
                }
            }
        }
        Ok(if is_another {
            Grid::Another
        } else {
            Grid::AsBefore
        })
    }

    /// Counts the fresh blocks of clay.
    #[must_use]
    pub const fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Edge of a voxel as it is shown, m; 0 before the first message.
    #[must_use]
    pub const fn voxel_size_m(&self) -> f64 {
        self.voxel_size_m
    }

    /// Bricks along x, y, z, as they are shown.
    #[must_use]
    pub const fn counts(&self) -> [u16; 3] {
        self.mirror.counts()
    }

    /// Bricks whose mesh is out of date.
    #[must_use]
    pub fn stale_count(&self) -> usize {
        self.mirror.stale_count()
    }

    /// Calls every brick stale: a new view holds no mesh yet.
    pub fn mark_all(&mut self) {
        self.mirror.mark_all();
    }

    /// Finds the surface of a brick that is stale, in place of whatever `mesh` holds; its index, or nothing when none
    /// is.
    pub fn mesh_next(&mut self, mesh: &mut BrickMesh) -> Option<u32> {
        let index = self.mirror.take_stale()?;
        self.mirror.mesh(index, mesh);
        Some(index)
    }

    /// As [`Mirror::coarse`].
    #[must_use]
    pub fn coarse(&self, index: u32) -> [u8; COARSE_VOXELS] {
        self.mirror.coarse(index)
    }

    fn grid_of(&self, header: &BricksHeader) -> ([u16; 3], f64) {
        let voxel_size_m = f64::from(header.voxel_size_m);
        match self.detail {
            Detail::Full => (header.bricks_per_axis, voxel_size_m),
            Detail::Half => (
                header.bricks_per_axis.map(|count| count.div_ceil(2)),
                2.0 * voxel_size_m,
            ),
        }
    }
}

/// Which brick a brick of a finer grid is an eighth of, and which eighth.
fn halved(header: &BricksHeader, counts: [u16; 3], index: u32) -> (u32, [usize; 3]) {
    let [nx, ny, _] = header.bricks_per_axis.map(u32::from);
    let at = [index % nx, index / nx % ny, index / nx / ny];
    let [x, y, z] = at.map(|along| along / 2);
    let [nx, ny, _] = counts.map(u32::from);
    (x + nx * (y + ny * z), at.map(|along| (along % 2) as usize))
}
