//! Calls from JavaScript, which passes and takes nothing but numbers: whatever is longer lies in buffers of the module.
//!
//! What a call is to look at is written into [`Buffer::BytesIn`] first; what it found lies in others until the next
//! call of its kind. Memory moves when it grows, so a buffer is asked for its address each time. The TypeScript side is
//! `client-web/src/protocol/module.ts`; the two change together.

use teleclay_clay::BrickMesh;
use teleclay_clay::mirror::COARSE_VOXELS;

use crate::shown::{Detail, Grid, ShownClay};

/// All that a module holds.
#[derive(Default)]
pub struct Page {
    bytes_in: Vec<u8>,
    numbers: Vec<f64>,
    refusal: String,
    clay: ShownClay,
    mesh: BrickMesh,
    coarse: Vec<u8>,
}

/// A stretch of memory that both sides know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Buffer {
    /// A message, as it came.
    BytesIn,
    /// `f64`: what a call found.
    Numbers,
    /// UTF-8: why a call was refused.
    Refusal,
    /// `f32`, three a vertex: as [`BrickMesh::positions`].
    Positions,
    /// `i8`, four a vertex: as [`BrickMesh::facing`].
    Facing,
    /// `u16`, three a triangle: as [`BrickMesh::indices`].
    Indices,
    /// `u8`: as [`teleclay_clay::Mirror::coarse`].
    Coarse,
}

/// The call was carried out.
pub const DONE: u32 = 0;
/// The call was carried out, and the grid of the clay is another one.
pub const REGRIDDED: u32 = 1;
/// The call was refused, and [`Buffer::Refusal`] says why.
pub const REFUSED: u32 = 2;
/// No brick is stale.
pub const NO_BRICK: u32 = u32::MAX;

impl Buffer {
    /// By the number that JavaScript gives it.
    #[must_use]
    pub fn numbered(number: u32) -> Option<Self> {
        const ALL: [Buffer; 7] = [
            Buffer::BytesIn,
            Buffer::Numbers,
            Buffer::Refusal,
            Buffer::Positions,
            Buffer::Facing,
            Buffer::Indices,
            Buffer::Coarse,
        ];
        ALL.get(number as usize).copied()
    }
}

impl Page {
    /// Makes room for a message of so many bytes.
    pub fn resize_bytes_in(&mut self, length: usize) {
        self.bytes_in.resize(length, 0);
    }

    /// The message that is to be looked at.
    pub fn bytes_in(&mut self) -> &mut [u8] {
        &mut self.bytes_in
    }

    /// What the last call found.
    #[must_use]
    pub fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// Why the last call that was refused was.
    #[must_use]
    pub fn refusal(&self) -> &str {
        &self.refusal
    }

    /// The mesh of the brick that was found last.
    #[must_use]
    pub const fn mesh(&self) -> &BrickMesh {
        &self.mesh
    }

    /// Where a buffer begins.
    #[must_use]
    pub fn address(&self, buffer: Buffer) -> *const u8 {
        match buffer {
            Buffer::BytesIn => self.bytes_in.as_ptr(),
            Buffer::Numbers => self.numbers.as_ptr().cast(),
            Buffer::Refusal => self.refusal.as_ptr(),
            Buffer::Positions => self.mesh.positions.as_ptr().cast(),
            Buffer::Facing => self.mesh.facing.as_ptr().cast(),
            Buffer::Indices => self.mesh.indices.as_ptr().cast(),
            Buffer::Coarse => self.coarse.as_ptr(),
        }
    }

    /// How many elements of its kind a buffer has.
    #[must_use]
    pub fn length(&self, buffer: Buffer) -> usize {
        match buffer {
            Buffer::BytesIn => self.bytes_in.len(),
            Buffer::Numbers => self.numbers.len(),
            Buffer::Refusal => self.refusal.len(),
            Buffer::Positions => self.mesh.positions.len(),
            Buffer::Facing => self.mesh.facing.len(),
            Buffer::Indices => self.mesh.indices.len(),
            Buffer::Coarse => self.coarse.len(),
        }
    }

    /// Shows clay at half its resolution from here on.
    pub fn halve_clay(&mut self) {
        self.clay.show(Detail::Half);
    }

    /// Takes in the message of bricks.
    pub fn take_in_bricks(&mut self) -> u32 {
        match self.clay.take_in(&self.bytes_in) {
            Ok(Grid::AsBefore) => DONE,
            Ok(Grid::Another) => REGRIDDED,
            Err(error) => self.refuse(&error),
        }
    }

    /// Calls every brick stale.
    pub fn mark_all_bricks(&mut self) {
        self.clay.mark_all();
    }

    /// What there is to know about the clay, in numbers: epoch, edge of a voxel in m, bricks along x, y, z, bricks that
    /// are stale.
    pub fn describe_clay(&mut self) {
        let [x, y, z] = self.clay.counts().map(f64::from);
        self.numbers.clear();
        self.numbers.extend([
            f64::from(self.clay.epoch()),
            self.clay.voxel_size_m(),
            x,
            y,
            z,
            self.clay.stale_count() as f64,
        ]);
    }

    /// Finds the surface of a brick that is stale; its index, or [`NO_BRICK`].
    pub fn mesh_next_brick(&mut self) -> u32 {
        let Some(index) = self.clay.mesh_next(&mut self.mesh) else {
            return NO_BRICK;
        };
        let coarse: [u8; COARSE_VOXELS] = self.clay.coarse(index);
        self.coarse.clear();
        self.coarse.extend_from_slice(&coarse);
        index
    }

    fn refuse(&mut self, error: &dyn std::error::Error) -> u32 {
        self.refusal = error.to_string();
        REFUSED
    }
}
