//! The state that a recording begins with, put together from what left the tick.

use std::sync::Arc;

use teleclay_clay::{BRICK_VOXELS, BrickView, Classes, Clay, Grid};
use teleclay_history::{Replay, State, content};

use crate::error::WriteError;
use crate::tick::Parcel;

/// A state on its way: all but the clay at one tick, bricks as they were at that tick or later, and every record since.
pub(crate) struct Coming {
    grid: Grid,
    initial_units: u64,
    head: Vec<u8>,
    /// What has come of the classes of material; nothing where there is one.
    classes: Vec<u8>,
    bricks: Vec<Brick>,
    records: Vec<Vec<u8>>,
}

enum Brick {
    Empty,
    Full,
    Voxels(Box<[u8; BRICK_VOXELS]>),
}

impl Coming {
    pub(crate) fn read(mut parcel: Parcel<'_>) -> Option<Self> {
        let voxels = [parcel.u16()?, parcel.u16()?, parcel.u16()?];
        let size_m = f64::from_bits(parcel.u64()?);
        Some(Self {
            grid: Grid::of_voxels(voxels, size_m).ok()?,
            initial_units: parcel.u64()?,
            head: parcel.0.to_vec(),
            classes: Vec::new(),
            bricks: Vec::new(),
            records: Vec::new(),
        })
    }

    pub(crate) fn add_record(&mut self, record: &[u8]) {
        self.records.push(record.to_vec());
    }

    /// The next part of the classes of material.
    pub(crate) fn add_classes(&mut self, parcel: Parcel<'_>) {
        self.classes.extend_from_slice(parcel.0);
    }

    /// They come in their order.
    pub(crate) fn add_brick(&mut self, mut parcel: Parcel<'_>) -> Option<()> {
        let index = parcel.u32()? as usize;
        let brick = match parcel.byte()? {
            0 => Brick::Empty,
            1 => Brick::Full,
            _ => Brick::Voxels(Box::new(parcel.0.try_into().ok()?)),
        };
        (index == self.bricks.len()).then(|| self.bricks.push(brick))
    }

    /// The state after the last record.
    pub(crate) fn finish(mut self) -> Result<State, WriteError> {
        let bricks = &self.bricks;
        let mut clay = Clay::from_bricks(self.grid, self.initial_units, |index| {
            match bricks.get(index.as_u32() as usize) {
                None | Some(Brick::Empty) => BrickView::Empty,
                Some(Brick::Full) => BrickView::Full,
                Some(Brick::Voxels(voxels)) => BrickView::Voxels(voxels),
            }
        })
        .map_err(|error| WriteError::Broken(error.to_string()))?;
        if !self.classes.is_empty() {
            Classes::decode(&self.grid, &self.classes)
                .and_then(|classes| clay.assign_classes(Some(Arc::new(classes))))
                .map_err(|error| WriteError::Broken(error.to_string()))?;
        }
        content::encode(&mut clay, &mut self.head);
        let state =
            State::decode(&self.head).map_err(|error| WriteError::Broken(error.to_string()))?;
        state_after(state, &self.records)
    }
}

/// The state after these records.
pub(crate) fn state_after(state: State, records: &[Vec<u8>]) -> Result<State, WriteError> {
    let mut replay = Replay::from_state(state, Vec::new());
    for record in records {
        replay
            .apply(record)
            .map_err(|error| WriteError::Broken(error.to_string()))?;
    }
    Ok(replay.into_state())
}
