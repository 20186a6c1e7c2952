//! A block of clay whose steps give a blade the wanted dampings.
//!
//! ```text
//! B_i = k w d_i        k viscosity, w width of the blade, d_i depth of cut in range i
//! ```
//!
//! The blade is 10 mm wide and the deepest range is cut 30 mm deep, which fixes the viscosity: with the dampings 20, 40
//! and 60 N·s/m that is clay of 2e5 Pa·s/m cut 1, 2 and 3 cm deep. It is cut deeper where voxels would otherwise not
//! show the depths well: a step that ends within a voxel is felt up to a quarter of a voxel wrong, and on a tall blade
//! half the distance between its rows of points more ([`depth_error_voxels`]), which matters for a thin one.

use teleclay_clay::{
    Blade, BladeDimensions, Clay, Coefficients, LOOK_AHEAD_VOXELS, Material, Shape, SteppedBlock,
    SteppedDimensions, ToolShape, row_spacing_m,
};

use super::{CuttingInputs, Refusal};

/// Width of the blade, m.
const BLADE_WIDTH_M: f64 = 0.010;
/// Thickness of the blade, m, and at least as many voxels.
const BLADE_THICKNESS_M: f64 = 0.002;
const BLADE_THICKNESS_VOXELS: f64 = 4.0;
/// Depth of the deepest cut where nothing speaks against it, m.
const USUAL_DEPTH_M: f64 = 0.030;
/// Voxel where nothing speaks against it, m.
const USUAL_VOXEL_M: f64 = 5e-4;
/// Depths are tried in steps of this many voxels, until every plateau is expected to be right within [`GOOD_ENOUGH`].
const DEPTH_STEP_VOXELS: f64 = 0.25;
const GOOD_ENOUGH: f64 = 5e-3;
/// Clay below the blade, so that a cut has a floor, and beside and above it, in voxels.
const MARGIN_VOXELS: f64 = 4.0;
/// Voxels along an axis that the ranges may take up, of the 512 that an experiment on a slider can wait for; the rest
/// is margin.
const USABLE_VOXELS: f64 = 512.0 - 4.0 * MARGIN_VOXELS;
/// The axis of the cut: x.
const ALONG_THE_CUT: usize = 0;
/// Share of a range that its plateau leaves to the transient.
const TRANSIENT: f64 = 0.75;
/// Before a range ends, its plateau does: an edge between voxels is blurred over one.
const END_VOXELS: f64 = 1.0;

/// The clay and the blade of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Specimen {
    /// Edge of a voxel, m.
    pub voxel_size_m: f64,
    /// `k`, Pa·s/m.
    pub viscosity_pa_s_per_m: f64,
    /// `d_i`, m.
    pub depths_of_cut_m: Vec<f64>,
    /// The blade.
    pub blade: BladeDimensions,
    /// Where the ranges begin and end in the clay's frame, m. Its origin is where the blade first touches.
    pub tool_edges_m: Vec<f64>,
    /// Height at which the blade's lower edge travels, m.
    pub base_m: f64,
    /// Extent of the block across the cut, m.
    pub width_m: f64,
}

impl Specimen {
    pub(super) fn for_inputs(inputs: &CuttingInputs) -> Result<Self, Refusal> {
        let tool_edges_m: Vec<f64> = inputs
            .edges_m
            .iter()
            .map(|edge_m| (edge_m - inputs.edges_m[0]) * inputs.position_ratio)
            .collect();
        let length_m = tool_edges_m[inputs.ranges()];
        let voxel_size_m = inputs
            .voxel_size_m
            .unwrap_or_else(|| fitting_voxel_m(length_m));

        let dampings = &inputs.clay_damping_n_s_per_m;
        let greatest = dampings.iter().copied().fold(0.0, f64::max);
        let deepest_m = deepest_cut_m(inputs, voxel_size_m);
        // A step this thin fills no voxel by a 255th: a gap.
        let gap_m = 1e-3 * voxel_size_m;
        let depth_m = |damping: f64| {
            if 0.0 < damping {
                deepest_m * (damping / greatest)
            } else {
                gap_m
            }
        };
        let specimen = Self {
            voxel_size_m,
            viscosity_pa_s_per_m: greatest / (BLADE_WIDTH_M * deepest_m),
            depths_of_cut_m: dampings.iter().map(|&damping| depth_m(damping)).collect(),
            blade: blade(deepest_m, voxel_size_m),
            tool_edges_m,
            base_m: MARGIN_VOXELS * voxel_size_m,
            width_m: BLADE_WIDTH_M + 2.0 * MARGIN_VOXELS * voxel_size_m,
        };
        // What cannot be made is refused here, with what stands in the way.
        specimen.clay()?.admits(&specimen.tool()?)?;
        specimen.material()?;
        Ok(specimen)
    }

    /// The block, fresh.
    pub(super) fn clay(&self) -> Result<Clay, Refusal> {
        let block = SteppedBlock::new(SteppedDimensions {
            edges_m: self.tool_edges_m.clone(),
            depths_of_cut_m: self.depths_of_cut_m.clone(),
            base_m: self.base_m,
            width_m: self.width_m,
        })?;
        Ok(Clay::new(&Shape::Stepped(block), self.voxel_size_m)?)
    }

    pub(super) fn tool(&self) -> Result<ToolShape, Refusal> {
        Ok(ToolShape::Blade(Blade::new(self.blade)?))
    }

    pub(super) fn material(&self) -> Result<Material, Refusal> {
        Ok(Material::new(Coefficients {
            viscosity_pa_s_per_m: self.viscosity_pa_s_per_m,
            yield_stress_pa: 0.0,
            stiffness_pa: 0.0,
        })?)
    }

    /// Tool position with the handle at the first edge, m. The blade feels for clay a little ahead of its leading face;
    /// what it feels is at the image of the handle, so that a step is felt where it stands.
    pub(super) fn home_m(&self) -> [f64; 3] {
        let feels_ahead_m = LOOK_AHEAD_VOXELS * self.voxel_size_m;
        [
            -0.5 * self.blade.thickness_m - feels_ahead_m,
            0.5 * self.width_m,
            self.base_m,
        ]
    }

    pub(super) fn deepest_m(&self) -> f64 {
        self.depths_of_cut_m.iter().copied().fold(0.0, f64::max)
    }

    /// Share of a plateau's velocity that voxels may be wrong by.
    pub(super) fn velocity_error(&self, inputs: &CuttingInputs, range: usize) -> f64 {
        let depth_voxels = self.depths_of_cut_m[range] / self.voxel_size_m;
        velocity_error(
            inputs,
            range,
            depth_voxels,
            row_voxels(self.blade, self.voxel_size_m),
        )
    }

    /// How far off at most the depth of a range is felt, m: voxels, and the rows of points by which the blade feels
    /// them, show it no better.
    pub fn depth_error_m(&self, range: usize) -> f64 {
        let depth_voxels = self.depths_of_cut_m[range] / self.voxel_size_m;
        self.voxel_size_m
            * depth_error_voxels(depth_voxels, row_voxels(self.blade, self.voxel_size_m))
    }

    /// Handle positions between which the plateau of a range is measured, m.
    pub(super) fn window_m(&self, inputs: &CuttingInputs, range: usize) -> [f64; 2] {
        let [from_m, to_m] = [inputs.edges_m[range], inputs.edges_m[range + 1]];
        let end_m = END_VOXELS * self.voxel_size_m / inputs.position_ratio;
        [from_m + TRANSIENT * (to_m - from_m), to_m - end_m]
    }
}

/// Share of a plateau's velocity that voxels may be wrong by where a range is cut so deep by a blade with rows so far
/// apart, both in voxels.
fn velocity_error(inputs: &CuttingInputs, range: usize, depth_voxels: f64, row_voxels: f64) -> f64 {
    let clay = inputs.force_per_position() * inputs.clay_damping_n_s_per_m[range];
    if clay <= 0.0 {
        return 0.0;
    }
    // Only the clay's part of the damping is wrong.
    let share = clay / (inputs.virtual_damping_n_s_per_m + clay);
    share * depth_error_voxels(depth_voxels, row_voxels) / depth_voxels
}

/// How far off the top of clay is felt at most, in voxels, as measured for every share of the topmost voxel: too low
/// where little of it is filled, nearly right where most of it is. Rows of points up to a quarter of a voxel apart show
/// that; wider ones miss the top by half of what they are wider, besides.
fn depth_error_voxels(depth_voxels: f64, row_voxels: f64) -> f64 {
    const FINE_ROW_VOXELS: f64 = 0.25;
    let filled = depth_voxels.fract();
    let by_voxels = if filled < 0.2 {
        0.115 + 0.575 * filled
    } else if filled < 0.4 {
        0.23
    } else if filled < 0.6 {
        0.23 - 0.7 * (filled - 0.4)
    } else if filled < 0.95 {
        0.08
    } else {
        0.115
    };
    by_voxels + 0.5 * (row_voxels - FINE_ROW_VOXELS).max(0.0)
}

/// The blade that cuts `deepest_m` deep and no lower.
fn blade(deepest_m: f64, voxel_size_m: f64) -> BladeDimensions {
    BladeDimensions {
        width_m: BLADE_WIDTH_M,
        height_m: deepest_m + MARGIN_VOXELS * voxel_size_m,
        thickness_m: BLADE_THICKNESS_M.max(BLADE_THICKNESS_VOXELS * voxel_size_m),
    }
}

/// Distance between the rows of points on a blade's leading face, in voxels.
fn row_voxels(blade: BladeDimensions, voxel_size_m: f64) -> f64 {
    // A blade that is none is refused when the specimen is made.
    let spacing_m = Blade::new(blade).map_or(0.0, |blade| row_spacing_m(&blade, ALONG_THE_CUT));
    spacing_m / voxel_size_m
}

/// The least depth of the deepest range at which voxels show all of them well, or the one that shows them best.
fn deepest_cut_m(inputs: &CuttingInputs, voxel_size_m: f64) -> f64 {
    let dampings = &inputs.clay_damping_n_s_per_m;
    let greatest = dampings.iter().copied().fold(0.0, f64::max);
    let worst_error = |deepest_m: f64| {
        let row_voxels = row_voxels(blade(deepest_m, voxel_size_m), voxel_size_m);
        (0..inputs.ranges())
            .map(|range| {
                let depth_m = deepest_m * (dampings[range] / greatest);
                velocity_error(inputs, range, depth_m / voxel_size_m, row_voxels)
            })
            .fold(0.0, f64::max)
    };
    let step_m = DEPTH_STEP_VOXELS * voxel_size_m;
    let steps = ((USABLE_VOXELS * voxel_size_m - USUAL_DEPTH_M) / step_m).max(0.0) as u32;
    let mut best = (USUAL_DEPTH_M, worst_error(USUAL_DEPTH_M));
    for step in 1..=steps {
        if best.1 <= GOOD_ENOUGH {
            break;
        }
        let deepest_m = USUAL_DEPTH_M + f64::from(step) * step_m;
        let error = worst_error(deepest_m);
        if error < best.1 {
            best = (deepest_m, error);
        }
    }
    best.0
}

/// The usual voxel, or the least whole multiple of a fifth of it at which the block fits a grid.
fn fitting_voxel_m(length_m: f64) -> f64 {
    const STEP_M: f64 = USUAL_VOXEL_M / 5.0;
    let needed_m = (length_m / USABLE_VOXELS).max(USUAL_DEPTH_M / USABLE_VOXELS);
    if needed_m <= USUAL_VOXEL_M {
        USUAL_VOXEL_M
    } else {
        (needed_m / STEP_M).ceil() * STEP_M
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use teleclay_clay::{ContactState, Motion, Pose, Tool};

    /// Depth that a blade for `deepest_m` feels on its way through a block `depth_m` deep, m.
    fn felt_depth_m(deepest_m: f64, depth_m: f64, voxel_size_m: f64) -> f64 {
        const SPEED_M_S: f64 = 0.02;
        const TICK_S: f64 = 1e-3;
        let base_m = MARGIN_VOXELS * voxel_size_m;
        let width_m = BLADE_WIDTH_M + 2.0 * base_m;
        let block = SteppedBlock::new(SteppedDimensions {
            edges_m: vec![0.0, 0.016],
            depths_of_cut_m: vec![depth_m],
            base_m,
            width_m,
        });
        let mut clay = Clay::new(&Shape::Stepped(block.unwrap()), voxel_size_m).unwrap();
        let blade = Blade::new(blade(deepest_m, voxel_size_m)).unwrap();
        let tool = Tool::new(ToolShape::Blade(blade));
        let material = Material::default();
        let mut contact = ContactState::default();
        let at = |tick: u32| {
            let x_m = 0.004 + f64::from(tick) * SPEED_M_S * TICK_S;
            Pose::quantise([x_m, 0.5 * width_m, base_m]).unwrap()
        };
        let (mut area_m2, mut ticks) = (0.0, 0);
        for tick in 0..300 {
            let motion = Motion::new(at(tick), at(tick + 1), [SPEED_M_S, 0.0, 0.0]).unwrap();
            let worked = clay.work(&tool, &material, &motion, &mut contact);
            if 100 <= tick {
                area_m2 += worked.response.engaged_area_m2;
                ticks += 1;
            }
        }
        area_m2 / f64::from(ticks) / BLADE_WIDTH_M
    }

    /// On the clay itself: whatever share of its topmost voxel is filled, and however tall the blade, a step is felt as
    /// well as promised.
    #[test]
    fn a_depth_is_felt_as_well_as_promised() {
        for (voxel_size_m, deepest_m) in [
            (5e-4, 0.03),
            (5e-4, 0.06),
            (5e-4, 0.0817),
            (5e-4, 0.15),
            (1e-3, 0.03),
            (1e-3, 0.24),
            (2e-4, 0.0817),
        ] {
            let row_voxels = row_voxels(blade(deepest_m, voxel_size_m), voxel_size_m);
            let mut worst = 0.0_f64;
            for step in 0..60 {
                let whole = [4.0, 7.0, 13.0, 22.0][step % 4];
                let depth_voxels = whole + step as f64 / 60.0;
                let felt_m = felt_depth_m(deepest_m, depth_voxels * voxel_size_m, voxel_size_m);
                let off_voxels = (felt_m / voxel_size_m - depth_voxels).abs();
                let promised = depth_error_voxels(depth_voxels, row_voxels);
                assert!(
                    off_voxels < promised,
                    "{deepest_m} m, voxels of {voxel_size_m} m: {depth_voxels} voxels are off by {off_voxels}, promised {promised}"
                );
                worst = worst.max(off_voxels / promised);
            }
            // A promise that nothing comes near would be an empty one.
            assert!(0.6 < worst, "{deepest_m} m, {voxel_size_m} m: {worst}");
        }
    }
}
