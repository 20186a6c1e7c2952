//! Transfer functions as quotients of polynomials in `s`.

use crate::MAX_ORDER;
use crate::polynomial::{Polynomial, PolynomialError, quotient_at};
use crate::roots::RootsError;
use nalgebra::Complex;

/// `numerator(s) / denominator(s)`; either part may have the higher degree.
///
/// Invariant: the denominator is not zero and both degrees are at most [`MAX_ORDER`]. Arithmetic never cancels on its
/// own: a mode that a product hides is still there in the machine. [`RationalFunction::reduced`] cancels what is safe.
#[derive(Clone, Debug, PartialEq)]
pub struct RationalFunction {
    numerator: Polynomial,
    denominator: Polynomial,
}

/// Why two polynomials, or the outcome of an operation, are not a [`RationalFunction`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RationalError {
    /// The numerator is not a polynomial.
    #[error("numerator: {0}")]
    Numerator(#[source] PolynomialError),
    /// The denominator is not a polynomial.
    #[error("denominator: {0}")]
    Denominator(#[source] PolynomialError),
    /// The denominator, or a divisor, is zero everywhere.
    #[error("denominator is zero")]
    ZeroDenominator,
    /// A degree is above [`MAX_ORDER`].
    #[error("degree {got} is above the supported {cap}")]
    OrderTooHigh {
        /// The higher of the two degrees.
        got: usize,
        /// The cap.
        cap: usize,
    },
}

impl RationalFunction {
    /// Takes coefficients of both parts in descending powers.
    ///
    /// # Errors
    /// A part is empty, not finite or too long, or the denominator is zero.
    pub fn new(numerator: &[f64], denominator: &[f64]) -> Result<Self, RationalError> {
        let numerator = Polynomial::new(numerator).map_err(RationalError::Numerator)?;
        let denominator = Polynomial::new(denominator).map_err(RationalError::Denominator)?;
        Self::from_parts(numerator, denominator)
    }

    /// The quotient of two polynomials.
    ///
    /// # Errors
    /// The denominator is zero or a degree is above [`MAX_ORDER`].
    pub fn from_parts(
        numerator: Polynomial,
        denominator: Polynomial,
    ) -> Result<Self, RationalError> {
        if denominator.is_zero() {
            return Err(RationalError::ZeroDenominator);
        }
        let got = numerator.degree().max(denominator.degree());
        if MAX_ORDER < got {
            return Err(RationalError::OrderTooHigh {
                got,
                cap: MAX_ORDER,
            });
        }
        Ok(Self {
            numerator,
            denominator,
        })
    }

    /// The constant 0: what a non-back-drivable `S_h` is.
    #[must_use]
    pub fn zero() -> Self {
        Self {
            numerator: Polynomial::zero(),
            denominator: Polynomial::one(),
        }
    }

    /// The part above the line.
    #[must_use]
    pub fn numerator(&self) -> &Polynomial {
        &self.numerator
    }

    /// The part below the line.
    #[must_use]
    pub fn denominator(&self) -> &Polynomial {
        &self.denominator
    }

    /// Whether the value is 0 everywhere.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.numerator.is_zero()
    }

    /// Whether the gain stays bounded as the frequency grows, so that a state-space form exists.
    #[must_use]
    pub fn is_proper(&self) -> bool {
        self.numerator.degree() <= self.denominator.degree()
    }

    /// Whether the gain falls to zero as the frequency grows, so that the output never jumps with the input.
    #[must_use]
    pub fn is_strictly_proper(&self) -> bool {
        self.is_zero() || self.numerator.degree() < self.denominator.degree()
    }

    /// Value at a complex point; `None` at a pole, and where the value is too large for a number.
    #[must_use]
    pub fn at(&self, s: Complex<f64>) -> Option<Complex<f64>> {
        let value = quotient_at(&self.numerator, &self.denominator, s);
        (value.re.is_finite() && value.im.is_finite()).then_some(value)
    }

    /// Frequency response: the value at `s = j·omega`, omega in rad/s. `None` at a pole on the axis.
    #[must_use]
    pub fn at_omega(&self, omega_rad_s: f64) -> Option<Complex<f64>> {
        self.at(Complex::new(0.0, omega_rad_s))
    }

    /// Sum. Equal denominators stay as they are, others are multiplied.
    ///
    /// # Errors
    /// The outcome passes the cap or overflows.
    pub fn plus(&self, other: &Self) -> Result<Self, RationalError> {
        if self.denominator == other.denominator {
            let numerator = self
                .numerator
                .plus(&other.numerator)
                .map_err(RationalError::Numerator)?;
            return Self::from_parts(numerator, self.denominator.clone());
        }
        // A zero summand must not drag its denominator's modes in.
        if self.is_zero() {
            return Ok(other.clone());
        }
        if other.is_zero() {
            return Ok(self.clone());
        }
        let left = self
            .numerator
            .times(&other.denominator)
            .map_err(RationalError::Numerator)?;
        let right = other
            .numerator
            .times(&self.denominator)
            .map_err(RationalError::Numerator)?;
        let numerator = left.plus(&right).map_err(RationalError::Numerator)?;
        let denominator = self
            .denominator
            .times(&other.denominator)
            .map_err(RationalError::Denominator)?;
        Self::from_parts(numerator, denominator)
    }

    /// Product.
    ///
    /// # Errors
    /// The outcome passes the cap or overflows.
    pub fn times(&self, other: &Self) -> Result<Self, RationalError> {
        let numerator = self
            .numerator
            .times(&other.numerator)
            .map_err(RationalError::Numerator)?;
        let denominator = self
            .denominator
            .times(&other.denominator)
            .map_err(RationalError::Denominator)?;
        Self::from_parts(numerator, denominator)
    }

    /// Quotient.
    ///
    /// # Errors
    /// `other` is zero, or the outcome passes the cap or overflows.
    pub fn divided_by(&self, other: &Self) -> Result<Self, RationalError> {
        self.times(&other.inverse()?)
    }

    /// `1 / self`.
    ///
    /// # Errors
    /// The function is zero.
    pub fn inverse(&self) -> Result<Self, RationalError> {
        Self::from_parts(self.denominator.clone(), self.numerator.clone())
    }

    /// The same function with common factors taken out where that is safe: powers of `s`, exactly, and pairs of a zero
    /// and a pole that agree to nine digits and lie clearly left of the axis, where what is hidden dies out.
    ///
    /// Everything else stays, and so does a function whose reduced form would not reproduce its values.
    ///
    /// # Errors
    /// Roots are not to be had.
    pub fn reduced(&self) -> Result<Self, RootsError> {
        if self.is_zero() {
            return Ok(Self::zero());
        }
        let at_origin = self
            .numerator
            .roots_at_origin()
            .min(self.denominator.roots_at_origin());
        let plain = Self {
            numerator: self.numerator.without_origin_roots(at_origin),
            denominator: self.denominator.without_origin_roots(at_origin),
        };
        let mut zeros = plain.numerator.roots()?;
        let mut poles = plain.denominator.roots()?;
        let before = poles.len();
        poles.retain(
            |&pole| match zeros.iter().position(|&zero| cancels(zero, pole)) {
                Some(at) => {
                    zeros.swap_remove(at);
                    false
                }
                None => true,
            },
        );
        if poles.len() == before {
            return Ok(plain);
        }
        let numerator = from_roots(plain.numerator.leading(), &zeros);
        let denominator = from_roots(plain.denominator.leading(), &poles);
        match (numerator, denominator) {
            (Ok(numerator), Ok(denominator)) => {
                let reduced = Self {
                    numerator,
                    denominator,
                };
                Ok(if reduced.agrees_with(&plain) {
                    reduced
                } else {
                    plain
                })
            }
            // Multiplying out left the range of numbers.
            _ => Ok(plain),
        }
    }

    /// The function times a constant.
    ///
    /// # Errors
    /// `factor` is not finite or a coefficient overflows.
    pub fn scaled(&self, factor: f64) -> Result<Self, RationalError> {
        let numerator = self
            .numerator
            .scaled(factor)
            .map_err(RationalError::Numerator)?;
        Self::from_parts(numerator, self.denominator.clone())
    }
}

impl RationalFunction {
    /// Whether two forms give the same values, off the axis and away from any root, over the range of the coefficients.
    fn agrees_with(&self, other: &Self) -> bool {
        const DECADES: std::ops::RangeInclusive<i32> = -6..=6;
        const AGREEMENT: f64 = 1e-9;
        DECADES
            .map(|decade| Complex::from_polar(10.0_f64.powi(decade), 1.0))
            .all(|s| match (self.at(s), other.at(s)) {
                (Some(ours), Some(theirs)) => (ours - theirs).norm() <= AGREEMENT * theirs.norm(),
                _ => false,
            })
    }
}

/// Whether a zero and a pole are one and the same, and harmless.
fn cancels(zero: Complex<f64>, pole: Complex<f64>) -> bool {
    const SAME: f64 = 1e-9;
    const CLEARLY_LEFT: f64 = 1e-6;
    (zero - pole).norm() <= SAME * pole.norm() && pole.re < -CLEARLY_LEFT * pole.norm()
}

/// `leading` times the product of `s - root`; roots come in conjugate pairs, so imaginary parts cancel.
fn from_roots(leading: f64, roots: &[Complex<f64>]) -> Result<Polynomial, PolynomialError> {
    let mut product = vec![Complex::new(leading, 0.0)];
    for root in roots {
        product.push(Complex::new(0.0, 0.0));
        for i in (1..product.len()).rev() {
            let carried = product[i - 1] * root;
            product[i] -= carried;
        }
    }
    let real: Vec<f64> = product.iter().map(|c| c.re).collect();
    Polynomial::new(&real)
}
