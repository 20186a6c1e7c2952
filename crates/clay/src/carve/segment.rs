//! The line segment on which a sweep leads through the voxels.

use crate::grid::MAX_AXIS_VOXELS;
use crate::pose::{Pose, STEPS_PER_METRE};
use crate::sweep::Sweep;

/// Rounding error of a coordinate in single precision, relative to the largest that occurs: half a unit in the last
/// place for the offset and for the sum, and as much again in reserve.
const COORDINATE_ERROR: f64 = 2.4e-7;

/// A sweep's poses in voxels, with voxel centres at whole numbers.
pub(super) struct Segment {
    pub(super) from: [f64; 3],
    pub(super) to: [f64; 3],
    pub(super) per_metre: f64,
    /// Bound on the rounding error of single-precision coordinates about this segment, in voxels.
    pub(super) rounding: f64,
}

impl Segment {
    pub(super) fn new(sweep: &Sweep, voxel_size_m: f64) -> Self {
        Self::between(sweep.from, sweep.to, voxel_size_m)
    }

    pub(super) fn between(from: Pose, to: Pose, voxel_size_m: f64) -> Self {
        let per_metre = 1.0 / voxel_size_m;
        let per_step = per_metre / STEPS_PER_METRE;
        let in_voxels = |steps: [i32; 3]| steps.map(|step| f64::from(step) * per_step - 0.5);
        let (from, to) = (in_voxels(from.steps()), in_voxels(to.steps()));
        let far = from
            .iter()
            .chain(&to)
            .fold(MAX_AXIS_VOXELS as f64, |far: f64, at| far.max(at.abs()));
        Self {
            from,
            to,
            per_metre,
            rounding: far * COORDINATE_ERROR,
        }
    }

    /// The segment of a point of the tool that is this far from its pose, in voxels.
    pub(super) fn shifted(&self, offset: [f64; 3]) -> Self {
        let shift = |at: [f64; 3]| std::array::from_fn(|axis| at[axis] + offset[axis]);
        Self {
            from: shift(self.from),
            to: shift(self.to),
            ..*self
        }
    }

    /// A segment without length, from the start to the start.
    pub(super) fn at_its_start(&self) -> Self {
        Self {
            to: self.from,
            ..*self
        }
    }

    /// From its end to its start.
    pub(super) fn backwards(&self) -> Self {
        Self {
            from: self.to,
            to: self.from,
            ..*self
        }
    }

    /// Whether its length is zero.
    pub(super) fn is_standing(&self) -> bool {
        self.length_squared() <= 0.0
    }

    pub(super) fn length_squared(&self) -> f64 {
        self.step().iter().map(|d| d * d).sum()
    }

    pub(super) fn step(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.to[axis] - self.from[axis])
    }

    pub(super) fn middle(&self) -> [f64; 3] {
        std::array::from_fn(|axis| 0.5 * (self.from[axis] + self.to[axis]))
    }

    /// Voxels within `reach` of the segment along each axis, from the first up to but not including the last.
    pub(super) fn bounds(&self, reach: [f64; 3]) -> [[i32; 2]; 3] {
        std::array::from_fn(|axis| {
            let (a, b) = (self.from[axis], self.to[axis]);
            let [first, _] = Self::voxels_about(a.min(b), reach[axis]);
            let [_, end] = Self::voxels_about(a.max(b), reach[axis]);
            [first, end]
        })
    }

    /// Voxels within `reach` of a place along an axis, from the first up to but not including the last.
    pub(super) fn voxels_about(at: f64, reach: f64) -> [i32; 2] {
        // No grid is longer, so clamping there loses nothing and keeps the conversion exact.
        let index = |at: f64| at.clamp(-1.0, MAX_AXIS_VOXELS as f64) as i32;
        [index(at - reach), index(at + reach + 1.0)]
    }
}

/// A voxel whose centre is within one voxel of a place along an axis.
pub(super) fn nearest_voxel(at: f64) -> i32 {
    at as i32
}
