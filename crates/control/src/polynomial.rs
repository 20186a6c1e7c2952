//! Polynomials in `s` with real coefficients, highest power first.

use nalgebra::Complex;

/// `a_n s^n + … + a_1 s + a_0`, coefficients in descending powers.
///
/// Invariant: at least one coefficient, all finite, degree at most [`Polynomial::MAX_DEGREE`], and the first one is not
/// zero unless the polynomial is the constant 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Polynomial {
    descending: Vec<f64>,
}

/// Why a list of coefficients is not a [`Polynomial`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PolynomialError {
    /// There was no coefficient at all.
    #[error("polynomial has no coefficients")]
    Empty,
    /// A coefficient is infinite or not a number, as given or after an arithmetic overflow.
    #[error("coefficient {index} is {got}, need a finite number")]
    NonFinite {
        /// Position in the descending list.
        index: usize,
        /// The offending value.
        got: f64,
    },
    /// The degree is above [`Polynomial::MAX_DEGREE`].
    #[error("polynomial has degree {got}, at most {cap} is supported")]
    DegreeTooHigh {
        /// Degree after leading zeros were dropped.
        got: usize,
        /// The cap.
        cap: usize,
    },
}

impl Polynomial {
    /// Twice [`MAX_ORDER`](crate::MAX_ORDER): a closed loop multiplies one plant by another.
    pub const MAX_DEGREE: usize = 2 * crate::MAX_ORDER;

    /// Takes coefficients in descending powers; leading zeros are dropped.
    ///
    /// # Errors
    /// Empty input, a non-finite coefficient, or a degree above the cap.
    pub fn new(descending: &[f64]) -> Result<Self, PolynomialError> {
        if descending.is_empty() {
            return Err(PolynomialError::Empty);
        }
        if let Some((index, &got)) = descending.iter().enumerate().find(|(_, c)| !c.is_finite()) {
            return Err(PolynomialError::NonFinite { index, got });
        }
        let trimmed = without_leading_zeros(descending);
        let got = trimmed.len() - 1;
        if Self::MAX_DEGREE < got {
            return Err(PolynomialError::DegreeTooHigh {
                got,
                cap: Self::MAX_DEGREE,
            });
        }
        Ok(Self {
            descending: trimmed.to_vec(),
        })
    }

    /// The constant `value`.
    ///
    /// # Errors
    /// A non-finite value.
    pub fn constant(value: f64) -> Result<Self, PolynomialError> {
        Self::new(&[value])
    }

    /// The constant 0.
    #[must_use]
    pub fn zero() -> Self {
        Self {
            descending: vec![0.0],
        }
    }

    /// The constant 1.
    #[must_use]
    pub fn one() -> Self {
        Self {
            descending: vec![1.0],
        }
    }

    /// Coefficients in descending powers, without leading zeros.
    #[must_use]
    pub fn coefficients(&self) -> &[f64] {
        &self.descending
    }

    /// Degree; 0 for any constant, the zero polynomial too.
    #[must_use]
    pub fn degree(&self) -> usize {
        self.descending.len() - 1
    }

    /// Coefficient of the highest power.
    #[must_use]
    pub fn leading(&self) -> f64 {
        self.descending[0]
    }

    /// Coefficient of the lowest power present; 0 for the zero polynomial.
    #[must_use]
    pub fn lowest(&self) -> f64 {
        self.descending[self.degree() - self.roots_at_origin()]
    }

    /// Whether this is the constant 0.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        is_exactly_zero(self.descending[0])
    }

    /// How many roots lie exactly at the origin: the number of trailing zero coefficients. 0 for the zero polynomial.
    #[must_use]
    pub fn roots_at_origin(&self) -> usize {
        if self.is_zero() {
            return 0;
        }
        self.descending
            .iter()
            .rev()
            .take_while(|c| is_exactly_zero(**c))
            .count()
    }

    /// The polynomial divided by `s^power`.
    ///
    /// `power` beyond [`Self::roots_at_origin`] would leave a remainder; only whole factors are taken out.
    #[must_use]
    pub fn without_origin_roots(&self, power: usize) -> Self {
        let kept = self.descending.len() - power.min(self.roots_at_origin());
        Self {
            descending: self.descending[..kept].to_vec(),
        }
    }

    /// Value at a complex point, by Horner's rule.
    #[must_use]
    pub fn at(&self, s: Complex<f64>) -> Complex<f64> {
        self.descending
            .iter()
            .fold(Complex::new(0.0, 0.0), |sum, &c| sum * s + c)
    }

    /// The derivative by `s`.
    #[must_use]
    pub fn derivative(&self) -> Self {
        let degree = self.degree();
        if degree == 0 {
            return Self::zero();
        }
        let descending = self.descending[..degree]
            .iter()
            .enumerate()
            .map(|(i, c)| c * (degree - i) as f64)
            .collect();
        Self { descending }
    }

    /// Sum.
    ///
    /// # Errors
    /// A coefficient overflows.
    pub fn plus(&self, other: &Self) -> Result<Self, PolynomialError> {
        let length = self.descending.len().max(other.descending.len());
        let mut sum = vec![0.0; length];
        for part in [self, other] {
            let offset = length - part.descending.len();
            for (slot, c) in sum[offset..].iter_mut().zip(&part.descending) {
                *slot += c;
            }
        }
        Self::new(&sum)
    }

    /// Product.
    ///
    /// # Errors
    /// The degree passes the cap or a coefficient overflows.
    pub fn times(&self, other: &Self) -> Result<Self, PolynomialError> {
        let mut product = vec![0.0; self.descending.len() + other.descending.len() - 1];
        for (i, a) in self.descending.iter().enumerate() {
            for (j, b) in other.descending.iter().enumerate() {
                product[i + j] += a * b;
            }
        }
        Self::new(&product)
    }

    /// Every coefficient times `factor`.
    ///
    /// # Errors
    /// `factor` is not finite or a coefficient overflows.
    pub fn scaled(&self, factor: f64) -> Result<Self, PolynomialError> {
        let scaled: Vec<f64> = self.descending.iter().map(|c| c * factor).collect();
        Self::new(&scaled)
    }
}

/// Zero as a structural fact (an absent power), never as the outcome of a rounding.
pub(crate) fn is_exactly_zero(value: f64) -> bool {
    value == 0.0
}

/// `numerator(s) / denominator(s)`, without an overflow on the way; not finite only where the quotient itself is not.
pub(crate) fn quotient_at(
    numerator: &Polynomial,
    denominator: &Polynomial,
    s: Complex<f64>,
) -> Complex<f64> {
    if s.norm() <= 1.0 {
        return numerator.at(s) / denominator.at(s);
    }
    // Both parts in powers of 1/s: neither overflows at a high frequency before the quotient is taken.
    let inverse = s.inv();
    let excess = numerator.degree() as i32 - denominator.degree() as i32;
    reversed_at(numerator, inverse) / reversed_at(denominator, inverse) * s.powi(excess)
}

/// `s^-n p(s)` as a function of `1/s`.
fn reversed_at(polynomial: &Polynomial, inverse: Complex<f64>) -> Complex<f64> {
    polynomial
        .descending
        .iter()
        .rev()
        .fold(Complex::new(0.0, 0.0), |sum, &c| sum * inverse + c)
}

/// Keeps at least one coefficient, so that zero stays a polynomial.
fn without_leading_zeros(descending: &[f64]) -> &[f64] {
    let zeros = descending
        .iter()
        .take_while(|c| is_exactly_zero(**c))
        .count();
    &descending[zeros.min(descending.len() - 1)..]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn coefficients() -> impl Strategy<Value = Vec<f64>> {
        proptest::collection::vec(-10.0..10.0, 1..8)
    }

    proptest! {
        /// Evaluation is a ring homomorphism: it may be done before or after sum and product.
        #[test]
        fn arithmetic_commutes_with_evaluation(a in coefficients(), b in coefficients(), re in -2.0..2.0, im in -2.0..2.0) {
            let s = Complex::new(re, im);
            let (a, b) = (Polynomial::new(&a).unwrap(), Polynomial::new(&b).unwrap());
            let sum = a.plus(&b).unwrap().at(s) - (a.at(s) + b.at(s));
            let product = a.times(&b).unwrap().at(s) - a.at(s) * b.at(s);
            prop_assert!(sum.norm() < 1e-8 && product.norm() < 1e-5 * (1.0 + a.at(s).norm() * b.at(s).norm()));
        }

        /// Leibniz: (ab)' = a'b + ab'.
        #[test]
        fn derivative_obeys_the_product_rule(a in coefficients(), b in coefficients()) {
            let (a, b) = (Polynomial::new(&a).unwrap(), Polynomial::new(&b).unwrap());
            let left = a.times(&b).unwrap().derivative();
            let right = a.derivative().times(&b).unwrap().plus(&a.times(&b.derivative()).unwrap()).unwrap();
            let s = Complex::new(0.7, -0.4);
            prop_assert!((left.at(s) - right.at(s)).norm() < 1e-7 * (1.0 + left.at(s).norm()));
        }
    }

    #[test]
    fn leading_zeros_carry_no_degree() {
        let p = Polynomial::new(&[0.0, 0.0, 3.0, 0.0]).unwrap();
        assert_eq!((p.degree(), p.roots_at_origin()), (1, 1));
        assert_eq!(p.without_origin_roots(5).coefficients(), [3.0]);
        assert!(Polynomial::new(&[0.0, 0.0]).unwrap().is_zero());
    }

    #[test]
    fn bad_lists_are_refused_with_what_was_wrong() {
        assert_eq!(Polynomial::new(&[]), Err(PolynomialError::Empty));
        assert!(matches!(
            Polynomial::new(&[1.0, f64::NAN]),
            Err(PolynomialError::NonFinite { index: 1, .. })
        ));
        let long = vec![1.0; Polynomial::MAX_DEGREE + 2];
        assert!(matches!(
            Polynomial::new(&long),
            Err(PolynomialError::DegreeTooHigh { got: 25, cap: 24 })
        ));
        let huge = Polynomial::constant(1e300).unwrap();
        assert!(matches!(
            huge.times(&huge),
            Err(PolynomialError::NonFinite { .. })
        ));
    }
}
