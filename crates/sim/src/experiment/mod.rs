//! The cutting experiment of \[KHMH03\] Fig. 7, through the real clay, on virtual time.
//!
//! An operator pushes a blade through clay that gets deeper in steps. In each range the clay answers with another
//! viscous damping `B_i`, and once the transient has died out the handle moves at the velocity at which the hand's
//! force balances the handle's own damping and the clay's:
//!
//! ```text
//! f_t = -B_i dy_t/dt        v_i = f_h / (B + rho B_i)        rho = A_h1 / |A_h2|
//! ```
//!
//! Nothing here types `B_i` in: a block is shaped so that the engaged area of the blade times the clay's viscosity is
//! `B_i` ([`Specimen`]), the rig of [`crate::rig`] cuts it voxel by voxel, and velocities are read off the handle. What
//! comes out may differ from the formula, and where the loop rings or a range is too short to settle in, it does.
//!
//! Positions are the handle's, and so are the edges of the ranges; the tool moves `A_h1` times as far. The handle
//! starts at rest at the first edge, the blade's leading face against the clay, with the hand already pushing.

mod feasible;
mod record;
mod run;
mod specimen;

use teleclay_clay::{MaterialError, ShapeError, ToolError};
use teleclay_control::paper;

pub use record::{Plateau, Trace};
pub use run::{Outcome, Progress, RunError};
pub use specimen::Specimen;

/// Most ranges of one experiment.
pub const MOST_RANGES: usize = 32;
/// Longest experiment, s of virtual time.
pub const LONGEST_S: f64 = 120.0;
/// Least and most samples that a trace may be asked to hold.
pub const TRACE_SAMPLES: std::ops::RangeInclusive<usize> = 64..=100_000;
/// A plateau is measured over at least this many ticks.
pub const LEAST_PLATEAU_TICKS: f64 = 10.0;
/// The sampled clay may err by this share of a plateau's velocity.
pub const VELOCITY_TOLERANCE: f64 = 0.02;

/// Where the hand's force acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Push {
    /// The force at the sensor is constant, whatever the arm does: the theory's assumption.
    #[default]
    AtSensor,
    /// The muscles push with a constant force, and the arm `T_h` (37) takes its share: `f_h = u_h - T_h y_h` (16).
    ThroughArm,
}

/// An experiment as it is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct CuttingInputs {
    /// `M` of `C_h1 = 1 / (M s² + B s)`, kg.
    pub virtual_mass_kg: f64,
    /// `B` of `C_h1`, N·s/m.
    pub virtual_damping_n_s_per_m: f64,
    /// `A_h1`, tool position over handle position; above zero.
    pub position_ratio: f64,
    /// `A_h2`, clay force over hand force; below zero.
    pub force_ratio: f64,
    /// The hand's steady force, N.
    pub hand_force_n: f64,
    /// Handle positions at which the ranges begin and end, m: ascending, one more than there are dampings.
    pub edges_m: Vec<f64>,
    /// `B_i`, the clay's damping in each range per *tool* velocity, N·s/m. 0 is a gap in the clay.
    pub clay_damping_n_s_per_m: Vec<f64>,
    /// Where the hand's force acts.
    pub push: Push,
    /// Edge of a voxel, m; chosen to fit when left out.
    pub voxel_size_m: Option<f64>,
    /// The trace holds at most this many samples. It starts at 1 kHz and keeps every second sample whenever it is full.
    pub most_trace_samples: usize,
}

impl Default for CuttingInputs {
    /// The experiment of Fig. 7, with our values for what \[KHMH03\] leaves open.
    fn default() -> Self {
        Self {
            virtual_mass_kg: paper::HANDLE_MASS_KG,
            virtual_damping_n_s_per_m: paper::HANDLE_DAMPING_N_S_PER_M,
            position_ratio: paper::POSITION_RATIO,
            force_ratio: paper::FORCE_RATIO,
            hand_force_n: paper::HAND_FORCE_N,
            edges_m: paper::CUTTING_EDGES_M.to_vec(),
            clay_damping_n_s_per_m: paper::CUTTING_DAMPING_N_S_PER_M.to_vec(),
            push: Push::AtSensor,
            voxel_size_m: None,
            most_trace_samples: 8192,
        }
    }
}

/// An experiment that can be run: every input in range, the clay shaped, every range stable.
#[derive(Clone, Debug, PartialEq)]
pub struct CuttingExperiment {
    inputs: CuttingInputs,
    specimen: Specimen,
    /// Rough time to the last edge, s.
    expected_s: f64,
}

/// Why there is nothing to run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// An input is out of its range.
    #[error("{field}{} is {got}, need {need}", place(*.index))]
    Input {
        /// Its name.
        field: &'static str,
        /// Which element of a list, from 0.
        index: Option<usize>,
        /// As given.
        got: f64,
        /// Its range, in words.
        need: &'static str,
    },
    /// Edges and dampings do not match in number.
    #[error(
        "{edges} edges and {dampings} dampings, need one edge more than dampings and 1 to {MOST_RANGES} ranges"
    )]
    Counts {
        /// Edges given.
        edges: usize,
        /// Dampings given.
        dampings: usize,
    },
    /// Nothing holds the handle back.
    #[error("range {range} has no plateau: neither handle nor clay damps the motion there")]
    NoPlateau {
        /// Range, from 0.
        range: usize,
    },
    /// The loop of handle, servo and clay swings up.
    #[error(
        "the loop is unstable in range {range}: with {virtual_mass_kg} kg and {virtual_damping_n_s_per_m} N s/m on the handle it does \
         not bear {damping_n_s_per_m} N s/m on its side; more mass or damping, or less clay, would"
    )]
    Unstable {
        /// Range, from 0.
        range: usize,
        /// `rho B_i`, N·s/m.
        damping_n_s_per_m: f64,
        /// `M`, kg.
        virtual_mass_kg: f64,
        /// `B`, N·s/m.
        virtual_damping_n_s_per_m: f64,
    },
    /// The handle would take too long.
    #[error(
        "the handle would need {expected_s:.1} s to the last edge, at most {LONGEST_S} s are simulated"
    )]
    TooSlow {
        /// What the formula says, s.
        expected_s: f64,
    },
    /// The handle crosses a range before anything can be measured.
    #[error(
        "the handle would cross the plateau of range {range} within {ticks:.1} ticks, need {LEAST_PLATEAU_TICKS}"
    )]
    TooFast {
        /// Range, from 0.
        range: usize,
        /// Ticks that the formula leaves for it.
        ticks: f64,
    },
    /// The arm pulls back before the last edge.
    #[error(
        "the arm balances {hand_force_n} N at {reach_m} m from the start, the last edge is at {travel_m} m"
    )]
    OutOfReach {
        /// The hand's force, N.
        hand_force_n: f64,
        /// Where arm and force balance, m from the first edge.
        reach_m: f64,
        /// How far the handle should go, m.
        travel_m: f64,
    },
    /// The least damping needs so thin a layer that voxels cannot show it well enough.
    #[error(
        "range {range} needs clay {depth_m} m deep beside {deepest_m} m, and voxels of {voxel_size_m} m get its velocity right within \
         {error:.3} only, need {VELOCITY_TOLERANCE}"
    )]
    TooShallow {
        /// Range, from 0.
        range: usize,
        /// Its depth, m.
        depth_m: f64,
        /// The deepest range's, m.
        deepest_m: f64,
        /// Edge of a voxel, m.
        voxel_size_m: f64,
        /// Share of the velocity that it may be wrong by.
        error: f64,
    },
    /// No block of clay has these steps.
    #[error("the clay cannot be shaped: {0}")]
    Shape(#[from] ShapeError),
    /// No blade cuts it.
    #[error("the blade does not fit the clay: {0}")]
    Blade(#[from] ToolError),
    /// No clay has this viscosity.
    #[error("there is no such clay: {0}")]
    Material(#[from] MaterialError),
}

fn place(index: Option<usize>) -> String {
    index.map_or_else(String::new, |index| format!("[{index}]"))
}

impl CuttingExperiment {
    /// Checks the inputs, shapes the clay and asks whether the handle gets there.
    ///
    /// # Errors
    /// An input is out of range, or the experiment cannot come to an end that means something.
    pub fn new(inputs: CuttingInputs) -> Result<Self, Refusal> {
        inputs.require_ranges()?;
        inputs.require_plateaus()?;
        inputs.require_stability()?;
        let expected_s = inputs.expected_s()?;
        let specimen = Specimen::for_inputs(&inputs)?;
        inputs.require_samples(&specimen)?;
        Ok(Self {
            inputs,
            specimen,
            expected_s,
        })
    }

    /// What was asked for.
    #[must_use]
    pub fn inputs(&self) -> &CuttingInputs {
        &self.inputs
    }

    /// The clay and the blade.
    #[must_use]
    pub fn specimen(&self) -> &Specimen {
        &self.specimen
    }

    /// Time to the last edge by the formula, transients aside, s.
    #[must_use]
    pub fn expected_s(&self) -> f64 {
        self.expected_s
    }
}

impl CuttingInputs {
    /// `rho = A_h1 / |A_h2|`.
    #[must_use]
    pub fn force_per_position(&self) -> f64 {
        self.position_ratio / -self.force_ratio
    }

    /// `v_i = f_h / (B + rho B_i)` for a force `hand_force_n` at the sensor in range `range`, m/s.
    ///
    /// # Panics
    /// There is no such range.
    #[must_use]
    pub fn plateau_velocity_m_s(&self, range: usize, hand_force_n: f64) -> f64 {
        paper::plateau_velocity_m_s(
            hand_force_n,
            self.virtual_damping_n_s_per_m,
            self.force_per_position(),
            self.clay_damping_n_s_per_m[range],
        )
    }

    /// Number of ranges.
    pub(crate) fn ranges(&self) -> usize {
        self.clay_damping_n_s_per_m.len()
    }

    /// From the first edge to the last, m of handle travel.
    pub(crate) fn travel_m(&self) -> f64 {
        self.edges_m[self.ranges()] - self.edges_m[0]
    }
}
