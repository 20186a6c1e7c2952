//! The loop that operator, handle, tool and clay close together. Source: [KHMH03] (33)–(34) and their derivation.
//!
//! With `P = G_h C_h1 + S_h`, `rho = A_h1 / |A_h2|` and clay `T_t`, all as polynomials that are never cancelled:
//!
//! ```text
//! P = N / D      H = P T_h = N_H / D      E = rho P T_t = N_E / D      1 + H + E = C / D
//! ```
//!
//! `C` holds every closed-loop pole, hidden ones too. `L = H + E` is the loop gain.

use crate::axis::{AxisQuotient, AxisRoot, roots_of};
use crate::balance;
use crate::compensators::{CompensatorError, Sides};
use crate::frequency::{Features, Mesh};
use crate::polynomial::{Polynomial, PolynomialError, quotient_at};
use crate::rational::RationalError;
use crate::roots::RootsError;
use nalgebra::Complex;

/// Operator, handle, tool and clay of one axis, joined.
#[derive(Clone, Debug)]
pub struct ClosedLoop {
    /// Denominator `D` that the shares of arm and clay have in common.
    pub(crate) d: Polynomial,
    /// `N_H`, the arm's share.
    pub(crate) n_h: Polynomial,
    /// `N_E`, the clay's share.
    pub(crate) n_e: Polynomial,
    /// `N_H + N_E`.
    pub(crate) n_l: Polynomial,
    /// `C = D + N_H + N_E`.
    pub(crate) c: Polynomial,
}

/// Why there is no loop to speak of.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LoopError {
    /// A ratio has the wrong sign.
    #[error(transparent)]
    Compensator(#[from] CompensatorError),
    /// The admittance `G_h C_h1 + S_h` passes the cap.
    #[error("admittance G_h C_h1 + S_h: {0}")]
    Admittance(#[source] RationalError),
    /// A product of loop polynomials overflows or is too long.
    #[error("loop polynomial: {0}")]
    Polynomial(#[from] PolynomialError),
    /// `1 + L` is zero everywhere: the equations do not determine the motion.
    #[error("1 + P (T_h + rho T_t) is zero at every frequency")]
    Undetermined,
    /// Roots that the analysis needs are not to be had.
    #[error("roots of the loop: {0}")]
    Roots(#[from] RootsError),
}

impl ClosedLoop {
    /// Joins the sides with an arm `t_h` and clay `t_t`, both forces per metre of motion.
    ///
    /// # Errors
    /// A ratio has the wrong sign, a product is out of range, or the loop does not determine the motion.
    pub fn new(sides: &Sides, t_h: &Polynomial, t_t: &Polynomial) -> Result<Self, LoopError> {
        let rho = sides.force_per_position()?;
        let p = sides.admittance().map_err(LoopError::Admittance)?;
        let d = p.denominator().clone();
        let n_h = p.numerator().times(t_h)?;
        let n_e = p.numerator().times(t_t)?.scaled(rho)?;
        let n_l = n_h.plus(&n_e)?;
        let c = d.plus(&n_l)?;
        if c.is_zero() {
            return Err(LoopError::Undetermined);
        }
        Ok(Self {
            d,
            n_h,
            n_e,
            n_l,
            c,
        })
    }

    /// Closed-loop poles without delay, rad/s, ordered by real part, then by imaginary part.
    ///
    /// # Errors
    /// The roots are not to be had.
    pub fn poles(&self) -> Result<Vec<Complex<f64>>, RootsError> {
        self.c.roots()
    }

    /// Whether every pole is left of the axis by more than rounding, without delay.
    ///
    /// # Errors
    /// The roots are not to be had.
    pub fn is_stable_without_delay(&self) -> Result<bool, RootsError> {
        self.c.is_hurwitz()
    }

    /// Loop gain `L = P (T_h + rho T_t)` at `j omega`. Not finite at a pole on the axis.
    #[must_use]
    pub fn gain_at(&self, omega_rad_s: f64) -> Complex<f64> {
        quotient_at(&self.n_l, &self.d, Complex::new(0.0, omega_rad_s))
    }

    /// `1 + L` at `j omega`, from the poles' polynomial, so that it keeps its digits near -1.
    #[must_use]
    pub fn return_difference_at(&self, omega_rad_s: f64) -> Complex<f64> {
        quotient_at(&self.c, &self.d, Complex::new(0.0, omega_rad_s))
    }

    /// `L` and `1 + L` along the axis, and a mesh for both.
    pub(crate) fn along_axis(&self) -> Result<LoopOnAxis, RootsError> {
        let gain = AxisQuotient::new(&self.n_l, &self.d)?;
        // What arm, clay and sides hide from each other is a pole of the loop, and none of its curve.
        let c = gain.hidden.iter().fold(self.c.clone(), |c, &omega| {
            c.without_axis_root(omega).unwrap_or(c)
        });
        let closed_roots = roots_of(&c)?;
        let mut features = Features::default();
        features.add_points(&gain.roots);
        features.add_points(&closed_roots);
        features.add_outer_crossings(&gain.numerator, &gain.denominator);
        features.add_range(balance::equal_magnitudes(
            &gain.numerator,
            &gain.denominator,
        ));
        features.add_range(balance::real_quotient(&gain.numerator, &gain.denominator));
        Ok(LoopOnAxis {
            closed_on_axis: c.roots_on_axis(&closed_roots),
            gain,
            c,
            mesh: features.mesh(),
        })
    }
}

/// A loop along the imaginary axis.
#[derive(Clone, Debug)]
pub(crate) struct LoopOnAxis {
    /// `L = N_L / D`, without the modes on the axis that both share.
    pub(crate) gain: AxisQuotient,
    /// `C` without the same modes.
    pub(crate) c: Polynomial,
    /// Roots of `1 + L` on the axis, above the origin.
    pub(crate) closed_on_axis: Vec<AxisRoot>,
    /// Dense where either curve bends.
    pub(crate) mesh: Mesh,
}

impl LoopOnAxis {
    /// `1 + L` at `j omega`.
    pub(crate) fn return_difference_at(&self, omega_rad_s: f64) -> Complex<f64> {
        let s = Complex::new(0.0, omega_rad_s);
        quotient_at(&self.c, &self.gain.denominator, s)
    }
}

/// Magnitude that a quotient of polynomials approaches at the lowest and at the highest frequencies.
pub(crate) fn limits(numerator: &Polynomial, denominator: &Polynomial) -> [f64; 2] {
    if numerator.is_zero() {
        return [0.0, 0.0];
    }
    let grows_towards = [
        numerator.roots_at_origin() < denominator.roots_at_origin(),
        denominator.degree() < numerator.degree(),
    ];
    let signed = signed_limits(numerator, denominator);
    std::array::from_fn(|end| {
        signed[end].map_or(
            if grows_towards[end] {
                f64::INFINITY
            } else {
                0.0
            },
            f64::abs,
        )
    })
}

/// The same limits with their sign, where they are neither zero nor infinite.
pub(crate) fn signed_limits(numerator: &Polynomial, denominator: &Polynomial) -> [Option<f64>; 2] {
    if numerator.is_zero() {
        return [None, None];
    }
    let same_at_rest = numerator.roots_at_origin() == denominator.roots_at_origin();
    let same_far_up = numerator.degree() == denominator.degree();
    [
        same_at_rest.then(|| numerator.lowest() / denominator.lowest()),
        same_far_up.then(|| numerator.leading() / denominator.leading()),
    ]
}
