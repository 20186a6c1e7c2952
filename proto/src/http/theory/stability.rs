//! A loop: compensators (30)–(32), poles, and margins of every kind.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{ComplexPair, check_list};
use crate::http::schema::{Frequency, Pair};
use crate::validate::{FieldError, Validate, check};
use crate::word::words;

/// Most coefficients of a polynomial: of order 12.
pub const MAX_COEFFICIENTS: usize = 13;
/// Most frequencies that one call evaluates: what fits into a body with every digit written out.
pub const MAX_OMEGAS: usize = 2_000;

/// A rational function of `s`. In JSON `{"numerator": [18, 1], "denominator": [0.005, 0.4, 18, 1]}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TransferFunction {
    /// Coefficients, highest power first.
    #[schema(min_items = 1, max_items = 13)]
    pub numerator: Vec<f64>,
    /// Coefficients, highest power first; not all zero.
    #[schema(min_items = 1, max_items = 13)]
    pub denominator: Vec<f64>,
}

/// A loop to analyse.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LoopRequest {
    /// Handle servo `G_h`, commanded to actual position.
    pub g_h: TransferFunction,
    /// The handle's give `S_h`, from hand force in N to position in m; 0, not back-drivable, when left out.
    #[serde(default = "TransferFunction::zero")]
    pub s_h: TransferFunction,
    /// The operator's arm `T_h`, N per m: coefficients, highest power first.
    #[schema(min_items = 1, max_items = 13)]
    pub t_h: Vec<f64>,
    /// `C_h1`, from hand force in N to commanded position in m: the free choice.
    pub c_h1: TransferFunction,
    /// Tool actuator `G_t`.
    pub g_t: TransferFunction,
    /// The tool's give `S_t`, from clay force to position; 0 when left out.
    #[serde(default = "TransferFunction::zero")]
    pub s_t: TransferFunction,
    /// `A_h1`, tool position over handle position; above zero.
    #[schema(minimum = 1e-6, maximum = 1e6)]
    pub position_ratio: f64,
    /// `A_h2`, clay force over net hand force; below zero.
    #[schema(minimum = -1e6, maximum = -1e-6)]
    pub force_ratio: f64,
    /// Viscous part of the clay's answer `T_t` per tool velocity, N·s/m.
    #[schema(minimum = 0, maximum = 1e9)]
    pub clay_damping_n_s_per_m: f64,
    /// Elastic part of `T_t`, N/m.
    #[schema(minimum = 0, maximum = 1e9)]
    pub clay_stiffness_n_per_m: f64,
    /// Where the compensators are evaluated, rad/s, each above zero; 0.1, 1, 10, 60 and 300 when left out. The curves
    /// hold these points too.
    #[serde(default = "usual_omegas")]
    #[schema(value_type = Vec<Frequency>, max_items = 2000)]
    pub omegas_rad_s: Vec<f64>,
}

/// What there is to know about a loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LoopAnswer {
    /// Frequency responses of the compensators, one entry per frequency asked for.
    pub compensators: Vec<CompensatorPoint>,
    /// Compensators that would have to differentiate: no machine can run them.
    pub improper_compensators: Vec<CompensatorName>,
    /// Roots of `1 + P (T_h + rho T_t)`, rad/s, by real part, then by imaginary part.
    #[schema(value_type = Vec<Pair>)]
    pub closed_loop_poles: Vec<ComplexPair>,
    /// Whether all of them are left of the axis.
    pub stable_without_delay: bool,
    /// Round trip that the paper's own scheme bears, s; `null` unless the verdict is `finite`.
    #[schema(required)]
    pub delay_margin_force_exchange_s: Option<f64>,
    /// What that margin is, or why there is none.
    pub delay_verdict_force_exchange: DelayVerdict,
    /// Round trip that position forward, force back bears, s; `null` unless the verdict is `finite`.
    #[schema(required)]
    pub delay_margin_position_force_s: Option<f64>,
    /// What that margin is, or why there is none.
    pub delay_verdict_position_force: DelayVerdict,
    /// Whether `|P| |T_h + rho T_t| < 1` at every frequency (34): sufficient, and tight.
    pub small_gain_holds: bool,
    /// The greatest of `|L|`, what (34) compares with 1; `null` when unbounded, as with a pole of `L` at rest or on the
    /// imaginary axis.
    #[schema(required)]
    pub small_gain_peak: Option<f64>,
    /// Least of `|1 + L|` (33): exact, 0 with a closed-loop pole on the imaginary axis; `null` when unbounded.
    #[schema(required)]
    pub nyquist_min_distance: Option<f64>,
    /// Where, rad/s; `null` when it is a limit at infinite frequency.
    #[schema(required)]
    pub nyquist_min_omega_rad_s: Option<f64>,
    /// Least factor above 1 on the loop gain that makes the loop lose its stability; `null` when none does.
    #[schema(required)]
    pub gain_margin_increase: Option<GainMargin>,
    /// Greatest factor below 1 that does; `null` when none does.
    #[schema(required)]
    pub gain_margin_decrease: Option<GainMargin>,
    /// Least turn of the curve that does; `null` when the gain is 1 at no frequency above zero.
    #[schema(required)]
    pub phase_margin: Option<PhaseMargin>,
    /// `L` in the complex plane.
    pub nyquist: NyquistCurve,
    /// `L` over frequency.
    pub bode: BodeCurve,
}

/// Compensators at one frequency; `null` at a pole, and where the value is too large for a number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CompensatorPoint {
    /// Frequency, rad/s.
    pub omega_rad_s: f64,
    /// Compensator `C_h1` of the handle.
    #[schema(required, value_type = Option<Pair>)]
    pub c_h1: Option<ComplexPair>,
    /// `C_t1` (30).
    #[schema(required, value_type = Option<Pair>)]
    pub c_t1: Option<ComplexPair>,
    /// `C_h2` (31).
    #[schema(required, value_type = Option<Pair>)]
    pub c_h2: Option<ComplexPair>,
    /// `C_t2` (32).
    #[schema(required, value_type = Option<Pair>)]
    pub c_t2: Option<ComplexPair>,
}

words! {
    /// A compensator by its symbol.
    #[derive(ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum CompensatorName: "compensator" {
        /// Hand force to handle command.
        CH1 "c_h1",
        /// Clay force to handle command (30).
        CT1 "c_t1",
        /// Hand force to tool command (31).
        CH2 "c_h2",
        /// Clay force to tool command (32).
        CT2 "c_t2",
    }
}

words! {
    /// What a delay margin is.
    #[derive(ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum DelayVerdict: "verdict" {
        /// Stable at every delay.
        Unbounded "unbounded",
        /// Stable below the margin.
        Finite "finite",
        /// Not stable even without delay.
        UnstableWithoutDelay "unstable_without_delay",
        /// The two copies of the admittance part as soon as there is any delay.
        UnstableAdmittance "unstable_admittance",
    }
}

/// A factor on the loop gain, and where it bites.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GainMargin {
    /// The factor.
    pub factor: f64,
    /// Phase crossover, rad/s; `null` at infinite frequency.
    #[schema(required)]
    pub omega_rad_s: Option<f64>,
}

/// A turn of the curve, and where it bites.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PhaseMargin {
    /// The turn, rad; above zero when the curve lags by less than half a turn.
    pub phase_rad: f64,
    /// Gain crossover, rad/s.
    pub omega_rad_s: f64,
}

/// `L(j omega)` along ascending frequencies; all lists have one length. Frequencies at which `L` has a pole, or is too
/// large for a number, are left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NyquistCurve {
    /// Frequencies, rad/s.
    pub omega_rad_s: Vec<f64>,
    /// Real part.
    pub re: Vec<f64>,
    /// Imaginary part.
    pub im: Vec<f64>,
}

/// The same points over frequency; all lists have one length.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BodeCurve {
    /// Frequencies, rad/s.
    pub omega_rad_s: Vec<f64>,
    /// `20 log10 |L|`, dB; `null` where `L` is zero.
    pub magnitude_db: Vec<Option<f64>>,
    /// Phase without jumps, rad; `null` where `L` is zero.
    pub phase_rad: Vec<Option<f64>>,
}

impl TransferFunction {
    /// The constant 0.
    #[must_use]
    pub fn zero() -> Self {
        Self {
            numerator: vec![0.0],
            denominator: vec![1.0],
        }
    }
}

impl Validate for TransferFunction {
    fn validate(&self) -> Result<(), FieldError> {
        check_list("/numerator", &self.numerator, 1..=MAX_COEFFICIENTS)?;
        check_list("/denominator", &self.denominator, 1..=MAX_COEFFICIENTS)?;
        if self
            .denominator
            .iter()
            .all(|coefficient| coefficient.abs() <= 0.0)
        {
            return Err(FieldError::new("/denominator", "every coefficient is zero"));
        }
        Ok(())
    }
}

impl Validate for LoopRequest {
    fn validate(&self) -> Result<(), FieldError> {
        let functions = [
            ("/g_h", &self.g_h),
            ("/s_h", &self.s_h),
            ("/c_h1", &self.c_h1),
            ("/g_t", &self.g_t),
            ("/s_t", &self.s_t),
        ];
        for (pointer, function) in functions {
            function.validate_under(pointer)?;
        }
        check_list("/t_h", &self.t_h, 1..=MAX_COEFFICIENTS)?;
        check_ratios(self.position_ratio, self.force_ratio)?;
        let (damping, stiffness) = (self.clay_damping_n_s_per_m, self.clay_stiffness_n_per_m);
        check("/clay_damping_n_s_per_m", damping, 0.0..=1e9)?;
        check("/clay_stiffness_n_per_m", stiffness, 0.0..=1e9)?;
        check_list("/omegas_rad_s", &self.omegas_rad_s, 0..=MAX_OMEGAS)?;
        for (index, &omega) in self.omegas_rad_s.iter().enumerate() {
            check(&format!("/omegas_rad_s/{index}"), omega, 1e-100..=1e100)?;
        }
        Ok(())
    }
}

/// `A_h1` is above zero and `A_h2` below, by our sign of them.
pub(super) fn check_ratios(position_ratio: f64, force_ratio: f64) -> Result<(), FieldError> {
    check("/position_ratio", position_ratio, 1e-6..=1e6)?;
    check("/force_ratio", force_ratio, -1e6..=-1e-6)
}

fn usual_omegas() -> Vec<f64> {
    vec![0.1, 1.0, 10.0, 60.0, 300.0]
}
