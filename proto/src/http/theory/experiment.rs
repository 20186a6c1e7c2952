//! The cutting experiment, Fig. 7.

use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use super::check_list;
use crate::http::schema::{Damping, Pair, Place};
use crate::validate::{FieldError, Validate, check, whole_within};
use crate::word::words;

/// Most ranges of one experiment.
pub const MAX_RANGES: usize = 32;
/// Fewest samples that a trace may be asked to hold.
pub const MIN_TRACE_SAMPLES: u32 = 64;
/// Most samples that a trace may be asked to hold.
pub const MAX_TRACE_SAMPLES: u32 = 20_000;

words! {
    /// Where the hand's force acts.
    #[derive(Default, ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum HandForceAt: "place of the hand's force" {
        /// The force at the sensor is constant, whatever the arm does: the theory's assumption.
        #[default]
        Sensor "sensor",
        /// The muscles push with a constant force, and the arm takes its share (16).
        Muscles "muscles",
    }
}

/// An experiment to run. Positions are the handle's; dampings are per tool velocity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CuttingRequest {
    /// `M` of `C_h1 = 1 / (M s² + B s)`, kg.
    #[schema(minimum = 1e-3, maximum = 1e3)]
    pub virtual_mass_kg: f64,
    /// `B` of `C_h1`, N·s/m.
    #[schema(minimum = 0, maximum = 1e5)]
    pub virtual_damping_n_s_per_m: f64,
    /// `A_h1`, tool position over handle position.
    #[schema(minimum = 1e-3, maximum = 1e3)]
    pub position_ratio: f64,
    /// `A_h2`, clay force over hand force; below zero.
    #[schema(minimum = -1e3, maximum = -1e-3)]
    pub force_ratio: f64,
    /// The hand's steady force, N.
    #[schema(minimum = 1e-3, maximum = 100)]
    pub hand_force_n: f64,
    /// Handle positions at which the ranges begin and end, m: ascending, one more than there are dampings.
    #[schema(value_type = Vec<Place>, min_items = 2, max_items = 33)]
    pub edges_m: Vec<f64>,
    /// `B_i`, the clay's damping in each range, N·s/m; 0 is a gap.
    #[schema(value_type = Vec<Damping>, min_items = 1, max_items = 32)]
    pub clay_damping_n_s_per_m: Vec<f64>,
    /// Where the hand's force acts.
    #[serde(default)]
    pub hand_force_at: HandForceAt,
    /// Edge of a voxel, m; chosen to fit when left out.
    #[schema(nullable = false, minimum = 2e-5, maximum = 5e-3)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub voxel_size_m: Option<f64>,
    /// Most samples of the trace, 64 to 20,000. It starts at 1 kHz and keeps every second sample whenever it is full.
    #[serde(default = "usual_samples", deserialize_with = "samples")]
    #[schema(minimum = 64, maximum = 20000)]
    pub trace_samples: u32,
}

/// What the run through the clay gave. Every list has one entry per range, but for the trace's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CuttingAnswer {
    /// The theory: `f_h / (B + rho B_i)`, m/s, with the force that the sensor read on the plateau.
    pub plateau_velocity_m_s: Vec<f64>,
    /// What was measured at the handle over the last part of each range, m/s.
    pub simulated_velocity_m_s: Vec<f64>,
    /// Greatest less least velocity over that part, over the mean.
    pub ripple: Vec<f64>,
    /// Handle positions between which it was measured, m.
    #[schema(value_type = Vec<Pair>)]
    pub window_m: Vec<[f64; 2]>,
    /// Mean engaged area of the blade, m².
    pub engaged_area_m2: Vec<f64>,
    /// From the first edge, at rest, to the last, s.
    pub duration_s: f64,
    /// Clay removed, m³.
    pub removed_volume_m3: f64,
    /// The clay and the blade.
    pub specimen: CuttingSpecimen,
    /// The way there.
    pub trace: CuttingTrace,
}

/// The clay and the blade of an experiment: `B_i` is viscosity times width times depth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CuttingSpecimen {
    /// Edge of a voxel, m.
    pub voxel_size_m: f64,
    /// Viscosity, Pa·s/m.
    pub viscosity_pa_s_per_m: f64,
    /// Width of the blade, m.
    pub blade_width_m: f64,
    /// Depth of cut in each range, m.
    pub depth_of_cut_m: Vec<f64>,
}

/// Evenly spaced samples; all lists have one length. Positions and velocities are the handle's.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CuttingTrace {
    /// Time since the loop took over, s.
    pub t_s: Vec<f64>,
    /// Handle position, m.
    pub position_m: Vec<f64>,
    /// Its velocity, m/s.
    pub velocity_m_s: Vec<f64>,
    /// Net force of the hand at the sensor, N.
    pub hand_force_n: Vec<f64>,
    /// Force of the clay on the tool, N; it opposes the motion.
    pub tool_force_n: Vec<f64>,
}

impl Validate for CuttingRequest {
    /// # Errors
    /// A number out of its range, or lists whose lengths do not match. Whether the handle gets there is found out by
    /// the calculation.
    fn validate(&self) -> Result<(), FieldError> {
        check("/virtual_mass_kg", self.virtual_mass_kg, 1e-3..=1e3)?;
        let damping = self.virtual_damping_n_s_per_m;
        check("/virtual_damping_n_s_per_m", damping, 0.0..=1e5)?;
        check("/position_ratio", self.position_ratio, 1e-3..=1e3)?;
        check("/force_ratio", self.force_ratio, -1e3..=-1e-3)?;
        check("/hand_force_n", self.hand_force_n, 1e-3..=100.0)?;
        check_list("/edges_m", &self.edges_m, 2..=MAX_RANGES + 1)?;
        let ranges = self.edges_m.len() - 1;
        let dampings = self.clay_damping_n_s_per_m.len();
        if dampings != ranges {
            return Err(FieldError::new(
                "/clay_damping_n_s_per_m",
                format!(
                    "{dampings} dampings for the {ranges} ranges between {} edges",
                    ranges + 1
                ),
            ));
        }
        for (index, &edge) in self.edges_m.iter().enumerate() {
            let pointer = format!("/edges_m/{index}");
            check(&pointer, edge, -10.0..=10.0)?;
            if 0 < index && edge <= self.edges_m[index - 1] {
                return Err(FieldError::new(
                    pointer,
                    format!(
                        "{edge} is not above the edge before it, {}",
                        self.edges_m[index - 1]
                    ),
                ));
            }
        }
        for (index, &damping) in self.clay_damping_n_s_per_m.iter().enumerate() {
            check(
                &format!("/clay_damping_n_s_per_m/{index}"),
                damping,
                0.0..=1e6,
            )?;
        }
        if let Some(voxel_size_m) = self.voxel_size_m {
            check("/voxel_size_m", voxel_size_m, 2e-5..=5e-3)?;
        }
        let samples = f64::from(self.trace_samples);
        check(
            "/trace_samples",
            samples,
            f64::from(MIN_TRACE_SAMPLES)..=f64::from(MAX_TRACE_SAMPLES),
        )
    }
}

fn samples<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    whole_within(deserializer, MIN_TRACE_SAMPLES..=MAX_TRACE_SAMPLES)
}

fn usual_samples() -> u32 {
    8192
}
