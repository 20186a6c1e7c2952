//! The task: an operator pushes the blade of the cutting experiment to and fro through even clay, 2 cm deep, in two
//! axes.
//!
//! Operator, handle, controller, blade and clay are those of \[KHMH03\]: arm, servo, `C_h1`, 10 mm of blade in clay of
//! 2·10⁵ N s/m³. At that depth the clay resists with 40 N s/m, the middle of the paper's three. What the muscles do is
//! fixed by the seed, whatever the scheme and the line; where that takes the hand is the loop's doing.

use std::sync::Arc;
use std::time::Duration;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use teleclay_clay::{Clay, Shape};
use teleclay_link::scheme::Controllers;
use teleclay_operator::Intent;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Axes, Material, ToolDescription};
use teleclay_sim::rig::{Further, Rig, RigError, Setup};

use crate::cell::{Cell, Profile};

/// The block, m.
const BLOCK_M: [f64; 3] = [0.160, 0.080, 0.040];
/// Edge of a voxel, m: half the blade's thickness.
const VOXEL_M: f64 = 1e-3;
/// Depth of the cut, m.
const DEPTH_M: f64 = 0.020;
/// What the clay resists with, Pa s/m.
const VISCOSITY_PA_S_PER_M: f64 = 2e5;
/// Pushes of a run. Each lasts [`PUSH`].
const PUSHES: usize = 5;
/// A hand that pushes this long gets three to seven centimetres far.
pub const PUSH: Duration = Duration::from_millis(1300);
/// A second operator begins this far away along the strokes, m, pushes the other way, and so meets the first.
const FURTHER_M: f64 = 0.03;

/// Hands off, until the longest line has carried the first frames.
pub const START: Duration = Duration::from_millis(700);
/// The pushes.
pub const WORK: Duration = Duration::from_millis(1300 * PUSHES as u64);
/// Hands off again: what swings now, swings by itself.
pub const CALM: Duration = Duration::from_millis(2500);

/// A rig for one run, at rest.
///
/// # Errors
/// Does not happen with the constants of this module; told rather than hidden.
pub fn rig(cell: &Cell, seed: u64) -> Result<Rig, RigError> {
    rig_with(cell, seed, cell.scheme.controllers())
}

/// A rig for one run, at rest, with controllers that somebody has made for the cell's scheme.
///
/// # Errors
/// Likewise.
pub fn rig_with(
    cell: &Cell,
    seed: u64,
    controllers: Arc<dyn Controllers>,
) -> Result<Rig, RigError> {
    let home_m = [BLOCK_M[0] / 2.0, BLOCK_M[1] / 2.0, BLOCK_M[2] - DEPTH_M];
    let setup = Setup {
        parameters: LoopParameters {
            scheme: cell.scheme.goes_under(),
            axes: Axes::Two,
            home_m,
            // The paper's.
            tool: ToolDescription::Blade {
                width_m: 0.010,
                height_m: 0.040,
                thickness_m: 0.002,
            },
            material: Material {
                viscosity_pa_s_per_m: VISCOSITY_PA_S_PER_M,
                yield_stress_pa: 0.0,
                stiffness_pa: 0.0,
            },
            ..LoopParameters::default()
        },
        clay: Clay::new(&Shape::Block { size_m: BLOCK_M }, VOXEL_M)
            .expect("the block's size and voxels fit each other"),
        intent: Intent::Idle,
        lines: cell.lines(seed),
    };
    let further = match cell.profile {
        Profile::SecondWriter => vec![Further {
            home_m: [home_m[0] + FURTHER_M, home_m[1], home_m[2]],
            intent: Intent::Idle,
        }],
        _ => Vec::new(),
    };
    Rig::with_controllers(setup, further, controllers)
}

/// What the muscles of every operator do, one push after another.
pub fn pushes(seed: u64) -> impl Iterator<Item = [f64; 3]> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut between = move |least: f64, most: f64| {
        let share = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        least + share * (most - least)
    };
    let mut side = 1.0;
    (0..PUSHES).map(move |_| {
        let force_n = [side * between(1.5, 3.0), between(-0.8, 0.8), 0.0];
        side = -side;
        force_n
    })
}

/// Every operator begins a push, the second one the other way.
pub fn push(rig: &mut Rig, force_n: [f64; 3]) {
    for slot in 0..rig.session().tools() {
        let side = if slot == 0 { 1.0 } else { -1.0 };
        // The forces of `pushes` are finite.
        let intent = Intent::constant_force([side * force_n[0], force_n[1], 0.0]);
        rig.device_of_mut(slot)
            .intend(intent.unwrap_or(Intent::Idle));
    }
}

/// Every operator lets go.
pub fn let_go(rig: &mut Rig) {
    for slot in 0..rig.session().tools() {
        rig.device_of_mut(slot).intend(Intent::Idle);
    }
}
