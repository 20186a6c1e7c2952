//! Roots of real polynomials by the Ehrlich–Aberth iteration: all at once, a bounded number of sweeps, always an end.
//! Sources: [E67], [A73] in docs/papers.md.
//!
//! Eigenvalues of a companion matrix are the usual way; the QR iteration behind them need not end on inputs as plain
//! as `s^4 + 1`, whose shifts cycle. Here every sweep moves every root by
//!
//! ```text
//! z_i -= 1 / (p'(z_i)/p(z_i) - sum_{j != i} 1/(z_i - z_j))
//! ```
//!
//! and a root rests once `p` there is no larger than its own rounding. First guesses lie on circles whose radii come
//! from the upper hull of `log |a_k|` over `k`, so roots many decades apart are found as fast as roots side by side.

use crate::polynomial::{Polynomial, is_exactly_zero};
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Why a polynomial's roots are not given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RootsError {
    /// Every number is a root of 0.
    #[error("every number is a root of the zero polynomial")]
    ZeroPolynomial,
    /// Roots lie so many decades apart that they do not fit the range of numbers together.
    #[error("roots lie too many decades apart")]
    OutOfRange,
    /// The iteration did not settle.
    #[error("roots did not settle within {sweeps} sweeps")]
    NotSettled {
        /// How many sweeps were made.
        sweeps: usize,
    },
}

/// Five are typical; the most seen is 15, for equal roots and for coefficients over 24 decades alike. 200 sweeps at the
/// highest degree take about two milliseconds.
const SWEEPS: usize = 200;

impl Polynomial {
    /// All roots with their multiplicity, ordered by real part, then by imaginary part.
    ///
    /// Complex roots come as exact conjugate pairs and roots at the origin are exact. The others are exact for a
    /// polynomial whose coefficients differ from these by rounding: a root of multiplicity `m` is uncertain by about
    /// the `m`-th root of that.
    ///
    /// # Errors
    /// The zero polynomial, roots beyond the range of numbers, or an iteration that does not settle.
    pub fn roots(&self) -> Result<Vec<Complex<f64>>, RootsError> {
        if self.is_zero() {
            return Err(RootsError::ZeroPolynomial);
        }
        let mut roots = vec![Complex::new(0.0, 0.0); self.roots_at_origin()];
        let scaled = Scaled::new(self)?;
        for root in conjugate_pairs(scaled.roots()?) {
            let root = root * scaled.unit;
            if !(root.re.is_finite() && root.im.is_finite()) {
                return Err(RootsError::OutOfRange);
            }
            roots.push(root);
        }
        roots.sort_by(|a, b| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
        Ok(roots)
    }

    /// Whether every root lies in the open left half-plane, by more than rounding could have moved it.
    ///
    /// So a root on the axis, or one that cannot be told from it, counts as not stable.
    ///
    /// # Errors
    /// As [`Polynomial::roots`].
    pub fn is_hurwitz(&self) -> Result<bool, RootsError> {
        Ok(self.roots_at_origin() == 0 && self.is_hurwitz_apart_from_origin()?)
    }

    /// [`Polynomial::is_hurwitz`] for the factor without roots at the origin.
    pub(crate) fn is_hurwitz_apart_from_origin(&self) -> Result<bool, RootsError> {
        if self.is_zero() {
            return Err(RootsError::ZeroPolynomial);
        }
        let scaled = Scaled::new(self)?;
        let roots = conjugate_pairs(scaled.roots()?);
        Ok(roots.iter().all(|&root| scaled.is_strictly_left(root)))
    }
}

/// The factor without origin roots, in `z = s / unit`, ascending, largest coefficient about 1.
struct Scaled {
    ascending: Vec<f64>,
    unit: f64,
}

/// What one evaluation tells about a candidate.
struct Probe {
    /// `p'(z) / p(z)`.
    log_derivative: Complex<f64>,
    /// Whether `p(z)` is within its own rounding.
    at_rest: bool,
}

impl Scaled {
    fn new(polynomial: &Polynomial) -> Result<Self, RootsError> {
        let factor = polynomial.without_origin_roots(usize::MAX);
        let mut ascending = factor.coefficients().to_vec();
        ascending.reverse();
        let degree = factor.degree();
        if degree == 0 {
            return Ok(Self {
                ascending,
                unit: 1.0,
            });
        }
        // Geometric mean of the roots, to a power of two, so that scaling rounds nothing.
        let log = |c: f64| c.abs().log2();
        let exponent = ((log(ascending[0]) - log(ascending[degree])) / degree as f64).round();
        let shift = |k: usize| exponent * k as f64;
        let top = ascending
            .iter()
            .enumerate()
            .filter(|(_, c)| !is_exactly_zero(**c))
            .fold(f64::NEG_INFINITY, |top, (k, c)| top.max(log(*c) + shift(k)))
            .floor();
        let scaled: Vec<f64> = ascending
            .iter()
            .enumerate()
            .map(|(k, c)| times_power_of_two(*c, shift(k) - top))
            .collect();
        let unit = exponent.exp2();
        let ends_survive = !is_exactly_zero(scaled[0]) && !is_exactly_zero(scaled[degree]);
        if !(ends_survive && unit.is_finite() && 0.0 < unit) {
            return Err(RootsError::OutOfRange);
        }
        Ok(Self {
            ascending: scaled,
            unit,
        })
    }

    fn degree(&self) -> usize {
        self.ascending.len() - 1
    }

    fn roots(&self) -> Result<Vec<Complex<f64>>, RootsError> {
        let mut roots = self.first_guesses();
        let mut resting = vec![false; roots.len()];
        for _ in 0..SWEEPS {
            for i in 0..roots.len() {
                if resting[i] {
                    continue;
                }
                let z = roots[i];
                let probe = self.probe(z);
                let repulsion: Complex<f64> = roots
                    .iter()
                    .enumerate()
                    .filter(|(j, _)| *j != i)
                    .map(|(_, other)| (z - other).inv())
                    .sum();
                let correction = (probe.log_derivative - repulsion).inv();
                let usable = correction.re.is_finite() && correction.im.is_finite();
                // What settles a candidate is the polynomial. A small correction alone does not: a neighbour that has
                // come too near makes one as well.
                let last_digit = f64::EPSILON * z.norm();
                let settled = probe.at_rest || probe.log_derivative.inv().norm() <= last_digit;
                let pinned = !settled && correction.norm() <= last_digit;
                // One last correction is taken even at rest: it costs nothing and often gives the final digit.
                if usable && !pinned && !(settled && 1e-6 * z.norm() < correction.norm()) {
                    roots[i] = z - correction;
                } else if !settled {
                    // Two candidates in one place, or a flat spot: step aside, by the same amount every time.
                    roots[i] = z * Complex::new(1.01, 0.02);
                }
                resting[i] = settled;
            }
            if resting.iter().all(|r| *r) {
                return Ok(roots);
            }
        }
        Err(RootsError::NotSettled { sweeps: SWEEPS })
    }

    /// Candidates on one circle per edge of the upper hull of `(k, log |a_k|)`.
    fn first_guesses(&self) -> Vec<Complex<f64>> {
        /// Turns every circle away from the real axis: symmetric guesses would stay symmetric for ever.
        const TURN_RAD: f64 = 0.7;
        let mut hull: Vec<(usize, f64)> = Vec::new();
        for (k, c) in self
            .ascending
            .iter()
            .enumerate()
            .filter(|(_, c)| !is_exactly_zero(**c))
        {
            let point = (k, c.abs().ln());
            while let [.., before, last] = hull.as_slice() {
                let slope = |from: &(usize, f64), to: &(usize, f64)| {
                    (to.1 - from.1) / (to.0 - from.0) as f64
                };
                if slope(last, &point) < slope(before, last) {
                    break;
                }
                hull.pop();
            }
            hull.push(point);
        }
        let mut guesses = Vec::with_capacity(self.degree());
        for (edge, ends) in hull.windows(2).enumerate() {
            let count = ends[1].0 - ends[0].0;
            let radius = ((ends[0].1 - ends[1].1) / count as f64).exp();
            for k in 0..count {
                let angle =
                    TAU * (k as f64 / count as f64 + edge as f64 / self.degree() as f64) + TURN_RAD;
                guesses.push(Complex::from_polar(radius, angle));
            }
        }
        guesses
    }

    fn probe(&self, z: Complex<f64>) -> Probe {
        if z.norm() <= 1.0 {
            return probe_inside(self.ascending.iter().rev(), self.degree(), z);
        }
        // Outside the unit circle in w = 1/z, where p(z) = z^n q(w): nothing overflows.
        let w = z.inv();
        let mirrored = probe_inside(self.ascending.iter(), self.degree(), w);
        Probe {
            log_derivative: w * (self.degree() as f64 - w * mirrored.log_derivative),
            ..mirrored
        }
    }

    /// Whether a root is left of the axis by more than rounding of the coefficients could have moved it.
    ///
    /// With `e` the rounding of `p` at the root, a polynomial that is `e` away has a root within
    /// `min_k (C(n,k) e k! / |p^(k)|)^(1/k)`, for clusters too. Taking `1/z` keeps the side, so the same bound serves
    /// large roots.
    fn is_strictly_left(&self, root: Complex<f64>) -> bool {
        let degree = self.degree();
        let inside = root.norm() <= 1.0;
        let mut descending: Vec<Complex<f64>> =
            self.ascending.iter().map(|c| Complex::from(*c)).collect();
        if inside {
            descending.reverse();
        }
        let z = if inside { root } else { root.inv() };
        let rounding = rounding_scale(degree)
            * descending
                .iter()
                .fold(0.0, |sum, c| sum * z.norm() + c.norm());
        let mut radius = f64::INFINITY;
        let mut binomial = 1.0;
        // Taylor coefficients at z, one synthetic division each: the remainder of the k-th is p^(k)(z) / k!.
        for k in 0..=degree {
            for i in 1..descending.len() {
                let carried = descending[i - 1] * z;
                descending[i] += carried;
            }
            let taylor = descending.pop().map_or(0.0, |c| c.norm());
            if 0 < k {
                binomial *= (degree - k + 1) as f64 / k as f64;
                radius = radius.min((binomial * rounding / taylor).powf(1.0 / k as f64));
            }
        }
        z.re < -radius
    }
}

fn probe_inside<'a>(
    descending: impl Iterator<Item = &'a f64>,
    degree: usize,
    z: Complex<f64>,
) -> Probe {
    let size = z.norm();
    let (mut value, mut derivative, mut bound) =
        (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0), 0.0);
    for c in descending {
        derivative = derivative * z + value;
        value = value * z + c;
        bound = bound * size + c.abs();
    }
    Probe {
        log_derivative: derivative / value,
        at_rest: value.norm() <= rounding_scale(degree) * bound,
    }
}

/// Relative rounding of Horner's rule with complex numbers.
fn rounding_scale(degree: usize) -> f64 {
    2.0 * (degree as f64 + 1.0) * f64::EPSILON
}

/// `value * 2^exponent` without a detour through infinity when only the outcome is in range.
fn times_power_of_two(value: f64, exponent: f64) -> f64 {
    let half = (exponent / 2.0).trunc();
    value * half.exp2() * (exponent - half).exp2()
}

/// Makes roots of a real polynomial what they must be: real, or exact conjugate pairs.
fn conjugate_pairs(mut roots: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
    // Most clearly complex first, so that a pair is not broken by a near-real neighbour.
    roots.sort_by(|a, b| {
        b.im.abs()
            .total_cmp(&a.im.abs())
            .then(a.re.total_cmp(&b.re))
    });
    let mut paired = Vec::with_capacity(roots.len());
    while !roots.is_empty() {
        let root = roots.remove(0);
        let mirror = root.conj();
        let nearest = (0..roots.len()).min_by(|&a, &b| {
            (roots[a] - mirror)
                .norm()
                .total_cmp(&(roots[b] - mirror).norm())
        });
        match nearest {
            // Nearer to its mirror image's candidate than to the real axis, twice over: a pair.
            Some(at)
                if (roots[at] - mirror).norm() <= 2.0 * root.im.abs()
                    && !is_exactly_zero(root.im) =>
            {
                let partner = roots.remove(at);
                let mean = (root + partner.conj()) / 2.0;
                paired.extend([mean, mean.conj()]);
            }
            _ => paired.push(Complex::new(root.re, 0.0)),
        }
    }
    paired
}
