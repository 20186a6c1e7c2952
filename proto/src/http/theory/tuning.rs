//! A target for a handle, and the handle that meets it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::stability::check_ratios;
use super::{DelayVerdict, MAX_COEFFICIENTS, TransferFunction, check_list};
use crate::http::schema::Span;
use crate::validate::{FieldError, Validate, check};
use crate::word::words;

words! {
    /// Which signals cross the network.
    #[derive(Default, ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum TunedScheme: "scheme" {
        /// Each side integrates its own force and the other's: the paper's.
        #[default]
        ForceExchange "force_exchange",
        /// Position goes forward, force comes back.
        PositionForce "position_force",
    }
}

/// What is wanted, and of which plants.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TuningRequest {
    /// Handle servo `G_h`.
    pub g_h: TransferFunction,
    /// The handle's give `S_h`; 0 when left out.
    #[serde(default = "TransferFunction::zero")]
    pub s_h: TransferFunction,
    /// The operator's arm `T_h`, N per m: coefficients, highest power first.
    #[schema(min_items = 1, max_items = 13)]
    pub t_h: Vec<f64>,
    /// Tool actuator `G_t`.
    pub g_t: TransferFunction,
    /// The tool's give `S_t`; 0 when left out.
    #[serde(default = "TransferFunction::zero")]
    pub s_t: TransferFunction,
    /// `A_h1`, above zero.
    #[schema(minimum = 1e-6, maximum = 1e6)]
    pub position_ratio: f64,
    /// `A_h2`, below zero.
    #[schema(minimum = -1e6, maximum = -1e-6)]
    pub force_ratio: f64,
    /// Least and greatest viscous answer of the clay, N·s/m.
    #[schema(value_type = Span)]
    pub clay_damping_n_s_per_m: [f64; 2],
    /// Least and greatest elastic answer of the clay, N/m.
    #[schema(value_type = Span)]
    pub clay_stiffness_n_per_m: [f64; 2],
    /// What crosses the network.
    #[serde(default)]
    pub scheme: TunedScheme,
    /// Longest round trip, s; every shorter one must do too.
    #[schema(minimum = 0, maximum = 10)]
    pub round_trip_s: f64,
    /// Wanted distance of the characteristic function from zero (33), above 0 and below 1.
    #[schema(minimum = 1e-6, exclusive_maximum = 1.0)]
    pub distance: f64,
    /// Heaviest handle to put up with: its impedance at 1 Hz, N·s/m.
    #[schema(minimum = 1e-6, maximum = 1e6)]
    pub heaviest_n_s_per_m: f64,
}

/// The lightest handle that meets the target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TuningAnswer {
    /// `M`, kg.
    pub mass_kg: f64,
    /// `B`, N·s/m.
    pub damping_n_s_per_m: f64,
    /// `C_h1 = 1 / (M s² + B s)`.
    pub c_h1: TransferFunction,
    /// Distance that it keeps in the least favourable clay, over every delay up to the target's.
    pub distance: f64,
    /// Shortest delay margin over the clay range, s; `null` when unbounded.
    #[schema(required)]
    pub delay_margin_s: Option<f64>,
    /// What that margin is.
    pub delay_verdict: DelayVerdict,
    /// Impedance at 1 Hz, N·s/m.
    pub impedance_n_s_per_m: f64,
}

impl Validate for TuningRequest {
    fn validate(&self) -> Result<(), FieldError> {
        let functions = [
            ("/g_h", &self.g_h),
            ("/s_h", &self.s_h),
            ("/g_t", &self.g_t),
            ("/s_t", &self.s_t),
        ];
        for (pointer, function) in functions {
            function.validate_under(pointer)?;
        }
        check_list("/t_h", &self.t_h, 1..=MAX_COEFFICIENTS)?;
        check_ratios(self.position_ratio, self.force_ratio)?;
        check_range("/clay_damping_n_s_per_m", self.clay_damping_n_s_per_m)?;
        check_range("/clay_stiffness_n_per_m", self.clay_stiffness_n_per_m)?;
        check("/round_trip_s", self.round_trip_s, 0.0..=10.0)?;
        check("/distance", self.distance, 1e-6..=1.0_f64.next_down())?;
        check("/heaviest_n_s_per_m", self.heaviest_n_s_per_m, 1e-6..=1e6)
    }
}

fn check_range(pointer: &str, [least, greatest]: [f64; 2]) -> Result<(), FieldError> {
    check(&format!("{pointer}/0"), least, 0.0..=1e9)?;
    check(&format!("{pointer}/1"), greatest, least..=1e9)
}
