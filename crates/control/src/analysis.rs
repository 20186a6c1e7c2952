//! One call for everything about a loop: compensators, poles, margins of four kinds, delay margins, curves.

use crate::axis::AxisQuotient;
use crate::closed_loop::{ClosedLoop, LoopError};
use crate::compensators::{Compensator, CompensatorError, Compensators, Sides};
use crate::curves::Curve;
use crate::delay::DelayMargin;
use crate::margins::{ClassicalMargins, Margins};
use crate::polynomial::{Polynomial, PolynomialError};
use crate::rational::RationalFunction;
use crate::roots::RootsError;
use nalgebra::Complex;

/// A loop to analyse: the sides, the arm, the clay.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopInput {
    /// Plants, `C_h1` and ratios.
    pub sides: Sides,
    /// The operator's arm `T_h`, N per metre of motion.
    pub t_h: Polynomial,
    /// Viscous part of the clay's answer per tool velocity, N·s/m; not below zero.
    pub clay_damping_n_s_per_m: f64,
    /// Elastic part of the clay's answer, N/m; not below zero.
    pub clay_stiffness_n_per_m: f64,
    /// Where the compensators are evaluated, rad/s, each finite and above zero; the curves hold these points too.
    pub omegas_rad_s: Vec<f64>,
}

/// Where compensators are evaluated when nobody asks otherwise: from slow hand motion to beyond the servo.
pub const DEFAULT_OMEGAS_RAD_S: [f64; 5] = [0.1, 1.0, 10.0, 60.0, 300.0];

/// The most frequencies that one call evaluates: a plot of four screens' width.
pub const MOST_OMEGAS: usize = 10_000;

/// Frequency response of the four compensators; `None` at a pole on the axis, and where a value is too large for a
/// number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompensatorResponse {
    /// Frequency, rad/s.
    pub omega_rad_s: f64,
    /// Compensator `C_h1` of the handle.
    pub c_h1: Option<Complex<f64>>,
    /// `C_t1` (30).
    pub c_t1: Option<Complex<f64>>,
    /// `C_h2` (31).
    pub c_h2: Option<Complex<f64>>,
    /// `C_t2` (32).
    pub c_t2: Option<Complex<f64>>,
}

/// What there is to know about a loop.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopAnalysis {
    /// One entry per frequency asked for.
    pub compensators: Vec<CompensatorResponse>,
    /// Compensators that would have to differentiate: they have a response, yet no machine can run them.
    pub improper_compensators: Vec<Compensator>,
    /// Roots of `1 + P (T_h + rho T_t)`, rad/s, ordered by real part, then by imaginary part.
    pub closed_loop_poles: Vec<Complex<f64>>,
    /// Whether all of them are left of the axis by more than rounding.
    pub stable_without_delay: bool,
    /// Round trip that the paper's own scheme bears.
    pub delay_margin_force_exchange: DelayMargin,
    /// Round trip that position forward, force back bears.
    pub delay_margin_position_force: DelayMargin,
    /// Whether (34) holds. Only sufficient.
    pub small_gain_holds: bool,
    /// `sup |L|`, what (34) compares with 1; `None` when unbounded.
    pub small_gain_peak: Option<f64>,
    /// `inf |1 + L|` (33). Exact.
    pub nyquist_min_distance: f64,
    /// Where the infimum lies, rad/s; 0 or infinite for a limit.
    pub nyquist_min_omega_rad_s: f64,
    /// Gain and phase margin.
    pub classical: ClassicalMargins,
    /// Nyquist and Bode data of `L`.
    pub curve: Curve,
}

/// Why a loop cannot be analysed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AnalysisError {
    /// The compensators cannot be formed.
    #[error(transparent)]
    Compensator(#[from] CompensatorError),
    /// The loop cannot be formed.
    #[error(transparent)]
    Loop(#[from] LoopError),
    /// A clay parameter is negative or not finite.
    #[error("{quantity} is {got}, need a finite number not below zero")]
    Clay {
        /// Which one.
        quantity: &'static str,
        /// As given.
        got: f64,
    },
    /// A frequency is not one.
    #[error("frequency {index} is {got} rad/s, need a finite one above zero")]
    Omega {
        /// Position in the list.
        index: usize,
        /// As given.
        got: f64,
    },
    /// Too many frequencies.
    #[error("{got} frequencies, at most {cap} are evaluated at once")]
    TooManyOmegas {
        /// How many came.
        got: usize,
        /// The cap.
        cap: usize,
    },
}

impl From<RootsError> for AnalysisError {
    fn from(error: RootsError) -> Self {
        Self::Loop(LoopError::Roots(error))
    }
}

impl From<PolynomialError> for AnalysisError {
    fn from(error: PolynomialError) -> Self {
        Self::Loop(LoopError::Polynomial(error))
    }
}

/// Analyses a loop. Bounded work: every input ends with an answer or an error.
///
/// # Errors
/// Inputs out of range, or a loop that cannot be formed.
pub fn analyse(input: &LoopInput) -> Result<LoopAnalysis, AnalysisError> {
    input.require_omegas()?;
    let closed_loop = input.closed_loop()?;
    let formal = input.sides.formal_compensators()?;
    let on_axis = closed_loop.along_axis()?;
    let Margins {
        nyquist,
        small_gain,
        classical,
    } = on_axis.margins();
    Ok(LoopAnalysis {
        compensators: responses(&formal, &input.omegas_rad_s)?,
        improper_compensators: improper(&formal),
        closed_loop_poles: closed_loop.poles()?,
        stable_without_delay: closed_loop.is_stable_without_delay()?,
        delay_margin_force_exchange: closed_loop.delay_margin_force_exchange()?,
        delay_margin_position_force: closed_loop.delay_margin_position_force()?,
        small_gain_holds: small_gain.holds,
        small_gain_peak: small_gain.peak,
        nyquist_min_distance: nyquist.distance,
        nyquist_min_omega_rad_s: nyquist.omega_rad_s,
        classical,
        curve: on_axis.curve(&input.omegas_rad_s),
    })
}

impl LoopInput {
    /// The loop that these inputs close.
    ///
    /// # Errors
    /// A clay parameter is out of range or the loop cannot be formed.
    pub fn closed_loop(&self) -> Result<ClosedLoop, AnalysisError> {
        let clay = [
            ("clay_damping_n_s_per_m", self.clay_damping_n_s_per_m),
            ("clay_stiffness_n_per_m", self.clay_stiffness_n_per_m),
        ];
        for (quantity, got) in clay {
            if !(got.is_finite() && 0.0 <= got) {
                return Err(AnalysisError::Clay { quantity, got });
            }
        }
        let t_t = Polynomial::new(&clay.map(|(_, value)| value))?;
        Ok(ClosedLoop::new(&self.sides, &self.t_h, &t_t)?)
    }

    fn require_omegas(&self) -> Result<(), AnalysisError> {
        let got = self.omegas_rad_s.len();
        if MOST_OMEGAS < got {
            return Err(AnalysisError::TooManyOmegas {
                got,
                cap: MOST_OMEGAS,
            });
        }
        match self
            .omegas_rad_s
            .iter()
            .position(|omega| !(omega.is_finite() && 0.0 < *omega))
        {
            Some(index) => Err(AnalysisError::Omega {
                index,
                got: self.omegas_rad_s[index],
            }),
            None => Ok(()),
        }
    }
}

fn responses(
    compensators: &Compensators,
    omegas_rad_s: &[f64],
) -> Result<Vec<CompensatorResponse>, RootsError> {
    if omegas_rad_s.is_empty() {
        return Ok(Vec::new());
    }
    let along = |f: &RationalFunction| AxisQuotient::new(f.numerator(), f.denominator());
    let (c_h1, c_t1) = (along(&compensators.c_h1)?, along(&compensators.c_t1)?);
    let (c_h2, c_t2) = (along(&compensators.c_h2)?, along(&compensators.c_t2)?);
    let at = |f: &AxisQuotient, omega| {
        f.at(omega)
            .filter(|value| value.re.is_finite() && value.im.is_finite())
    };
    let response = |&omega_rad_s: &f64| CompensatorResponse {
        omega_rad_s,
        c_h1: at(&c_h1, omega_rad_s),
        c_t1: at(&c_t1, omega_rad_s),
        c_h2: at(&c_h2, omega_rad_s),
        c_t2: at(&c_t2, omega_rad_s),
    };
    Ok(omegas_rad_s.iter().map(response).collect())
}

fn improper(compensators: &Compensators) -> Vec<Compensator> {
    let all: [(Compensator, &RationalFunction); 4] = [
        (Compensator::CH1, &compensators.c_h1),
        (Compensator::CT1, &compensators.c_t1),
        (Compensator::CH2, &compensators.c_h2),
        (Compensator::CT2, &compensators.c_t2),
    ];
    all.into_iter()
        .filter(|(_, function)| !function.is_proper())
        .map(|(which, _)| which)
        .collect()
}
