//! How far out two polynomials may balance along the imaginary axis: bounds on the frequencies at which their
//! magnitudes are equal, or at which their quotient is real, from the sizes of coefficients alone.
//!
//! `p(j omega) conj q(j omega)` has a real and an imaginary part, each a polynomial in `x = omega²`, the latter times
//! `omega`. The roots of a polynomial whose lowest and highest coefficients are `c_0` and `c_n` lie between
//!
//! ```text
//! min_k |c_0 / c_k|^(1/k) / 2    and    2 max_k |c_(n-k) / c_n|^(1/k)
//! ```

use crate::polynomial::Polynomial;

/// Ascending coefficients in `omega²`, each beside the sum of the sizes that it came from.
#[derive(Clone, Debug, Default)]
pub(crate) struct Balance {
    terms: Vec<(f64, f64)>,
}

impl Balance {
    /// Squared magnitude `|p|²`.
    pub(crate) fn squared(p: &[f64]) -> Self {
        Self::real_part(p, p)
    }

    /// Real part of `p conj q`; coefficients in descending powers of `s`.
    pub(crate) fn real_part(p: &[f64], q: &[f64]) -> Self {
        Self::of_product(p, q, 0)
    }

    /// Imaginary part of `p conj q`, divided by `omega`.
    pub(crate) fn imaginary_part(p: &[f64], q: &[f64]) -> Self {
        Self::of_product(p, q, 1)
    }

    /// `self + factor · other`.
    pub(crate) fn plus(mut self, factor: f64, other: &Self) -> Self {
        let length = self.terms.len().max(other.terms.len());
        self.terms.resize(length, (0.0, 0.0));
        for (term, (value, size)) in self.terms.iter_mut().zip(&other.terms) {
            term.0 += factor * value;
            term.1 += factor.abs() * size;
        }
        self
    }

    /// Bounds on `ln omega` of every root above zero; `None` where there is none.
    pub(crate) fn ln_range(&self) -> Option<[f64; 2]> {
        /// A coefficient below this share of what it came from is a remainder of rounding.
        const REMAINDER: f64 = 4.0 * f64::EPSILON;
        let known: Vec<(f64, f64)> = self
            .terms
            .iter()
            .enumerate()
            .filter(|(_, (value, size))| value.is_finite() && REMAINDER * size < value.abs())
            .map(|(power, (value, _))| (power as f64, value.abs().ln()))
            .collect();
        let (lowest, highest) = (known.first()?, known.last()?);
        let slope = |from: &(f64, f64), to: &(f64, f64)| (from.1 - to.1) / (to.0 - from.0);
        let low = known[1..]
            .iter()
            .map(|other| slope(lowest, other))
            .reduce(f64::min)?;
        let high = known[..known.len() - 1]
            .iter()
            .map(|other| slope(other, highest))
            .reduce(f64::max)?;
        let two = std::f64::consts::LN_2;
        Some([(low - two) / 2.0, (high + two) / 2.0])
    }

    /// `j^i (-j)^k = j^(i-k)`: the parts of a product are sums over even and over odd differences of powers.
    fn of_product(p: &[f64], q: &[f64], parity: usize) -> Self {
        let mut terms = vec![(0.0, 0.0); (p.len() + q.len()) / 2];
        for (i, a) in p.iter().rev().enumerate() {
            for (k, b) in q.iter().rev().enumerate() {
                if (i + k) % 2 != parity {
                    continue;
                }
                // Three times k is minus k, by fours.
                let is_negative = 2 <= (i + 3 * k) % 4;
                let term = &mut terms[(i + k) / 2];
                term.0 += if is_negative { -a * b } else { a * b };
                term.1 += (a * b).abs();
            }
        }
        Self { terms }
    }
}

/// Bounds on `ln omega` wherever `|1 + q| = 1` for the quotient `q = Q / M` of two products: where `|Q|² + 2 Re (Q conj
/// M)` is 0.
pub(crate) fn unit_shift(above: [&Polynomial; 2], below: [&Polynomial; 2]) -> Option<[f64; 2]> {
    let [above, below] = [above, below].map(|[p, q]| product(p.coefficients(), q.coefficients()));
    Balance::squared(&above)
        .plus(2.0, &Balance::real_part(&above, &below))
        .ln_range()
}

/// Bounds on `ln omega` wherever `|a| = |b|`.
pub(crate) fn equal_magnitudes(a: &Polynomial, b: &Polynomial) -> Option<[f64; 2]> {
    Balance::squared(a.coefficients())
        .plus(-1.0, &Balance::squared(b.coefficients()))
        .ln_range()
}

/// Bounds on `ln omega` wherever `a / b` is real.
pub(crate) fn real_quotient(a: &Polynomial, b: &Polynomial) -> Option<[f64; 2]> {
    Balance::imaginary_part(a.coefficients(), b.coefficients()).ln_range()
}

/// Product of two polynomials of any degree.
fn product(p: &[f64], q: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; p.len() + q.len() - 1];
    for (i, a) in p.iter().enumerate() {
        for (k, b) in q.iter().enumerate() {
            product[i + k] += a * b;
        }
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;
    use proptest::prelude::*;

    fn values_at(terms: &[(f64, f64)], x: f64) -> f64 {
        terms.iter().rev().fold(0.0, |sum, (c, _)| sum * x + c)
    }

    fn sizes_at(terms: &[(f64, f64)], x: f64) -> f64 {
        terms.iter().rev().fold(0.0, |sum, (_, c)| sum * x + c)
    }

    proptest! {
        /// The parts are those of the complex product.
        #[test]
        fn parts_of_a_product_are_polynomials_in_the_square_of_the_frequency(
            p in proptest::collection::vec(-5.0..5.0f64, 1..8), q in proptest::collection::vec(-5.0..5.0f64, 1..8),
            omega in 0.1..3.0f64,
        ) {
            let s = Complex::new(0.0, omega);
            let value = |list: &[f64]| list.iter().fold(Complex::new(0.0, 0.0), |sum, &c| sum * s + c);
            let product = value(&p) * value(&q).conj();
            let (real, imaginary) = (Balance::real_part(&p, &q), Balance::imaginary_part(&p, &q));
            let x = omega * omega;
            let rounding = 1e-13 * (sizes_at(&real.terms, x) + omega * sizes_at(&imaginary.terms, x));
            prop_assert!((values_at(&real.terms, x) - product.re).abs() <= rounding);
            prop_assert!((omega * values_at(&imaginary.terms, x) - product.im).abs() <= rounding);
        }

        /// Every root lies within the bounds: `|s + a|² = g²` at `omega² = g² - a²`, however near the two are.
        #[test]
        fn the_bounds_enclose_every_root(a in 1e-3..1e3f64, excess in -13.0..3.0f64) {
            let gain = a * (1.0 + 10f64.powf(excess));
            let p = Polynomial::new(&[1.0, a]).unwrap();
            let g = Polynomial::new(&[gain]).unwrap();
            let [low, high] = equal_magnitudes(&p, &g).unwrap();
            let omega = ((gain - a) * (gain + a)).sqrt().ln();
            prop_assert!(low <= omega && omega <= high, "{low} {omega} {high}");
        }
    }

    #[test]
    fn what_rounding_left_over_is_no_coefficient() {
        let p = Polynomial::new(&[1.0, 0.1 + 0.2]).unwrap();
        let g = Polynomial::new(&[0.3]).unwrap();
        assert_eq!(equal_magnitudes(&p, &g), None);
    }
}
