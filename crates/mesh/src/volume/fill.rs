//! A volume as clay, by thresholds.
//!
//! Below the first threshold is air; from each threshold up to the next is a class of its own. A voxel is as full as it
//! has places, [`PLACES`] along each axis, at which the volume is at or above the first threshold, and of the class of
//! its middle, or where that is air, of most of these. Between samples the volume is interpolated, and beyond its
//! outermost samples it goes on, up to its edge, as it is there. A number that is none is air.
//!
//! Bricks over which all samples are air, or of one class, are known without looking at their voxels.

use std::sync::Arc;

use teleclay_clay::{
    BRICK_EDGE, BRICK_VOXELS, BrickIndex, BrickView, Classes, Clay, Grid, MAX_CLASSES, Material,
    SOLID,
};

use super::{Volume, VolumeError};
use crate::fill::Placement;

/// Places in a voxel along an axis at which the volume is looked at.
pub const PLACES: usize = 2;
/// A volume may stand out of the block by half a voxel, as a mesh may.
const STANDS_OUT_VOXELS: f64 = 0.5 + 1e-6;

/// How values become classes. Invariant: 1 to [`MAX_CLASSES`] thresholds, finite and ascending, and a material for each
/// but the first.
#[derive(Clone, Debug, PartialEq)]
pub struct Thresholds {
    from: Vec<f64>,
    further: Vec<Material>,
}

impl Thresholds {
    /// A class from each of these values on. The first class resists with the material of the session, the others with
    /// `further`.
    ///
    /// # Errors
    /// There are too few, too many, or they do not ascend; or there is a material short or over.
    pub fn new(from: Vec<f64>, further: Vec<Material>) -> Result<Self, VolumeError> {
        let (thresholds, materials) = (from.len(), further.len());
        if !(1..=MAX_CLASSES).contains(&thresholds) || thresholds != materials + 1 {
            return Err(VolumeError::Count {
                thresholds,
                materials,
                most: MAX_CLASSES,
            });
        }
        for (index, &got) in from.iter().enumerate() {
            let is_above = index == 0 || from[index - 1] < got;
            if !(got.is_finite() && is_above) {
                return Err(VolumeError::Threshold { index, got });
            }
        }
        Ok(Self { from, further })
    }

    /// Nothing for air.
    fn class(&self, value: f64) -> Option<u8> {
        let reached = self.from.iter().take_while(|&&from| from <= value).count();
        (reached as u8).checked_sub(1)
    }
}

/// A block of clay with what the volume has from the first threshold on. It began with what it holds: nothing counts as
/// removed.
///
/// # Errors
/// When the volume is larger than the block and not to be fitted, or has nothing from the first threshold on.
pub fn fill_volume(
    volume: &Volume,
    grid: &Grid,
    thresholds: &Thresholds,
    placement: Placement,
) -> Result<Clay, VolumeError> {
    let frame = Frame::new(volume, grid, placement)?;
    let filled: Vec<Filled> = bricks(grid)
        .map(|index| frame.fill(volume, grid, thresholds, index))
        .collect();
    let units = filled.iter().map(Filled::units).sum();
    if units == 0 {
        let threshold = thresholds.from[0];
        return Err(VolumeError::Empty { threshold });
    }
    let clay = Clay::from_bricks(*grid, units, |index| {
        match &filled[index.as_u32() as usize].clay {
            Content::Empty => BrickView::Empty,
            Content::Full => BrickView::Full,
            Content::Voxels(voxels) => BrickView::Voxels(voxels),
        }
    });
    let mut clay = clay.expect("voxels beyond the grid are left empty, and the units are the sum");
    if !thresholds.further.is_empty() {
        let classes = Classes::new(
            grid,
            thresholds.further.clone(),
            |index, voxels| match &filled[index.as_u32() as usize].classes {
                ClassContent::One(class) => voxels.fill(*class),
                ClassContent::Voxels(classes) => *voxels = **classes,
            },
        );
        let classes = classes.expect("thresholds name no class without a material");
        clay.assign_classes(Some(Arc::new(classes)))
            .expect("they were made for its grid");
    }
    Ok(clay)
}

fn bricks(grid: &Grid) -> impl Iterator<Item = BrickIndex> {
    let grid = *grid;
    (0..grid.brick_count() as u32).filter_map(move |dense| grid.brick_index(dense))
}

/// What a brick holds.
struct Filled {
    clay: Content,
    classes: ClassContent,
}

enum Content {
    Empty,
    Full,
    Voxels(Box<[u8; BRICK_VOXELS]>),
}

enum ClassContent {
    One(u8),
    Voxels(Box<[u8; BRICK_VOXELS]>),
}

impl Filled {
    fn units(&self) -> u64 {
        match &self.clay {
            Content::Empty => 0,
            Content::Full => BRICK_VOXELS as u64 * u64::from(SOLID),
            Content::Voxels(voxels) => voxels.iter().map(|&voxel| u64::from(voxel)).sum(),
        }
    }
}

/// From places in the block, in voxels, to places in the volume, in samples, along each axis.
struct Frame {
    samples_per_voxel: [f64; 3],
    /// Where the lower edge of the block is, with samples at whole numbers.
    from: [f64; 3],
}

impl Frame {
    fn new(volume: &Volume, grid: &Grid, placement: Placement) -> Result<Self, VolumeError> {
        let voxel_m = grid.voxel_size_m();
        let voxels = grid.voxels().map(f64::from);
        let volume_m = volume.size_m();
        let scale = if placement == Placement::Fitted {
            (0..3).fold(f64::INFINITY, |scale, axis| {
                scale.min(voxels[axis] * voxel_m / volume_m[axis])
            })
        } else {
            let block_m = voxels.map(|count| count * voxel_m);
            let is_larger =
                (0..3).any(|axis| block_m[axis] + STANDS_OUT_VOXELS * voxel_m < volume_m[axis]);
            if is_larger {
                return Err(VolumeError::TooLarge { volume_m, block_m });
            }
            1.0
        };
        let spacing_m = volume.spacing_m().map(|spacing_m| spacing_m * scale);
        let samples_per_voxel = spacing_m.map(|spacing_m| voxel_m / spacing_m);
        let from = [0, 1, 2].map(|axis| {
            let margin = match placement {
                Placement::AsIs => 0.0,
                Placement::Centred | Placement::Fitted => {
                    0.5 * (voxels[axis] * voxel_m - volume_m[axis] * scale)
                }
            };
            // A sample stands in the middle of its box.
            -0.5 - margin / spacing_m[axis]
        });
        Ok(Self {
            samples_per_voxel,
            from,
        })
    }

    fn fill(
        &self,
        volume: &Volume,
        grid: &Grid,
        thresholds: &Thresholds,
        index: BrickIndex,
    ) -> Filled {
        let first = grid
            .brick_coordinates(index)
            .map(|at| usize::from(at) * BRICK_EDGE);
        let extent = grid.brick_extent(index);
        if let Some(uniform) = self.uniform(volume, thresholds, first) {
            let clay = match uniform {
                None => Some(Content::Empty),
                Some(_) if extent == [BRICK_EDGE; 3] => Some(Content::Full),
                Some(_) => None,
            };
            if let Some(clay) = clay {
                let classes = ClassContent::One(uniform.unwrap_or(0));
                return Filled { clay, classes };
            }
        }
        let mut voxels = Box::new([0; BRICK_VOXELS]);
        let mut classes = Box::new([0; BRICK_VOXELS]);
        for z in 0..extent[2] {
            for y in 0..extent[1] {
                for x in 0..extent[0] {
                    let at = (z * BRICK_EDGE + y) * BRICK_EDGE + x;
                    let voxel = [first[0] + x, first[1] + y, first[2] + z];
                    (voxels[at], classes[at]) = self.voxel(volume, thresholds, voxel);
                }
            }
        }
        Filled {
            clay: Content::Voxels(voxels),
            classes: ClassContent::Voxels(classes),
        }
    }

    /// What a brick is throughout, if that follows from the samples about it: air, or a class.
    fn uniform(
        &self,
        volume: &Volume,
        thresholds: &Thresholds,
        first: [usize; 3],
    ) -> Option<Option<u8>> {
        let sizes = volume.sizes();
        let mut range = [(0, 0); 3];
        for axis in 0..3 {
            let at = |voxel: usize| self.from[axis] + voxel as f64 * self.samples_per_voxel[axis];
            let (low, high) = (at(first[axis]), at(first[axis] + BRICK_EDGE));
            let last = sizes[axis] as f64 - 1.0;
            if high < -0.5 || last + 0.5 < low {
                return Some(None);
            }
            if low < -0.5 || last + 0.5 < high {
                return None;
            }
            let near = |place: f64| place.max(0.0).min(last);
            range[axis] = (near(low).floor() as usize, near(high).ceil() as usize);
        }
        let mut all = None;
        let [x, y, z] = range;
        for k in z.0..=z.1 {
            for j in y.0..=y.1 {
                for i in x.0..=x.1 {
                    let class = thresholds.class(volume.sample([i, j, k]));
                    if *all.get_or_insert(class) != class {
                        return None;
                    }
                }
            }
        }
        all
    }

    /// The occupancy of a voxel and its class.
    fn voxel(&self, volume: &Volume, thresholds: &Thresholds, voxel: [usize; 3]) -> (u8, u8) {
        const IN_ALL: u32 = (PLACES * PLACES * PLACES) as u32;
        let mut counts = [0; MAX_CLASSES];
        for place in 0..IN_ALL as usize {
            let within = [
                place % PLACES,
                place / PLACES % PLACES,
                place / PLACES / PLACES,
            ];
            let at = std::array::from_fn(|axis| {
                let share = (within[axis] as f64 + 0.5) / PLACES as f64;
                self.from[axis] + (voxel[axis] as f64 + share) * self.samples_per_voxel[axis]
            });
            let class = value(volume, at).and_then(|value| thresholds.class(value));
            if let Some(class) = class {
                counts[usize::from(class)] += 1;
            }
        }
        let clay: u32 = counts.iter().sum();
        // Of its middle, which is right as often one way as the other; where that is air, of the lowest of those that
        // have most.
        let middle = std::array::from_fn(|axis| {
            self.from[axis] + (voxel[axis] as f64 + 0.5) * self.samples_per_voxel[axis]
        });
        let most = counts.iter().copied().max().unwrap_or(0);
        let class = value(volume, middle)
            .and_then(|value| thresholds.class(value))
            .map_or_else(
                || counts.iter().position(|&count| count == most).unwrap_or(0),
                usize::from,
            );
        let occupancy = (clay * u32::from(SOLID) + IN_ALL / 2) / IN_ALL;
        (occupancy as u8, class as u8)
    }
}

/// The volume at a place, in samples; nothing outside of it.
fn value(volume: &Volume, at: [f64; 3]) -> Option<f64> {
    let sizes = volume.sizes();
    let mut lower = [0; 3];
    let mut beyond = [0.0; 3];
    for axis in 0..3 {
        let last = sizes[axis] as f64 - 1.0;
        if !(-0.5..=last + 0.5).contains(&at[axis]) {
            return None;
        }
        let place = at[axis].max(0.0).min(last);
        lower[axis] = (place as usize).min(sizes[axis].saturating_sub(2));
        beyond[axis] = place - lower[axis] as f64;
    }
    let mut value = 0.0;
    for corner in 0..8 {
        let mut weight = 1.0;
        let sample = std::array::from_fn(|axis| {
            let is_beyond = corner >> axis & 1;
            weight *= if is_beyond == 1 {
                beyond[axis]
            } else {
                1.0 - beyond[axis]
            };
            (lower[axis] + is_beyond).min(sizes[axis] - 1)
        });
        // What does not count cannot make a number of none.
        if 0.0 < weight {
            value += weight * volume.sample(sample);
        }
    }
    Some(value)
}
