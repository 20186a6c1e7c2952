//! Polynomials and their quotients along the imaginary axis, each value with a bound on what rounding may have done to
//! it.
//!
//! A coefficient is known to a few units in its last place: it was typed in decimals or came out of a product. So a
//! value `p(j omega)` is known to within
//!
//! ```text
//! e = u sum |a_k| omega^k        u = 4 (n + 1) epsilon
//! ```
//!
//! and a polynomial within rounding of this one has a root at `j omega` exactly if `|p(j omega)| <= e`. What cannot be
//! told from a root on the axis counts as one. So a resonance without damping is a pole, and no number as large as
//! rounding happens to leave it; and a comparison of two values has three outcomes, the third being that they cannot be
//! told apart.

use crate::polynomial::{Polynomial, quotient_at};
use crate::roots::RootsError;
use nalgebra::Complex;

/// Relative rounding of a value of this degree: of its coefficients, and of the evaluation.
fn unit(degree: usize) -> f64 {
    4.0 * (degree as f64 + 1.0) * f64::EPSILON
}

/// A complex value, up to the factor `exp(ln_scale)`, with a bound on the error of each of its parts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisValue {
    pub(crate) value: Complex<f64>,
    pub(crate) error: Complex<f64>,
    pub(crate) ln_scale: f64,
}

/// A number that decides by its sign, unless rounding could have turned it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// The number. Only its sign means something far from zero.
    pub(crate) value: f64,
    /// Whether rounding cannot have turned its sign.
    pub(crate) is_decided: bool,
}

/// A root at `j omega`, as far as rounding can tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AxisRoot {
    /// rad/s, above zero.
    pub(crate) omega_rad_s: f64,
    /// From this relative distance on, values are told from zero.
    pub(crate) reach: f64,
}

impl AxisValue {
    /// Whether the value cannot be told from zero.
    pub(crate) fn may_be_zero(&self) -> bool {
        self.value.norm() <= self.error.norm()
    }

    pub(crate) fn times(&self, other: &Self) -> Self {
        let (a, b) = (self.value, other.value);
        let (e, f) = (self.error, other.error);
        let of_product = |p: f64, ep: f64, q: f64, eq: f64| {
            p.abs() * eq + q.abs() * ep + ep * eq + 2.0 * f64::EPSILON * (p * q).abs()
        };
        Self {
            value: a * b,
            error: Complex::new(
                of_product(a.re, e.re, b.re, f.re) + of_product(a.im, e.im, b.im, f.im),
                of_product(a.re, e.re, b.im, f.im) + of_product(a.im, e.im, b.re, f.re),
            ),
            ln_scale: self.ln_scale + other.ln_scale,
        }
    }

    pub(crate) fn conj(&self) -> Self {
        Self {
            value: self.value.conj(),
            ..*self
        }
    }

    /// The sign of `|self| - |other|`; `value` is any number that has it.
    pub(crate) fn is_larger(&self, other: &Self, value: f64) -> Sample {
        let bounds = |this: &Self| {
            let (size, error) = (this.value.norm(), this.error.norm());
            let slack = f64::EPSILON * (4.0 + this.ln_scale.abs());
            (
                (size - error).max(0.0).ln() + this.ln_scale - slack,
                (size + error).ln() + this.ln_scale + slack,
            )
        };
        let ((low, high), (other_low, other_high)) = (bounds(self), bounds(other));
        Sample {
            value,
            is_decided: other_high < low || high < other_low,
        }
    }
}

impl Polynomial {
    /// The value at `j omega`. Each power contributes to one part only, so the parts are as exact as two real
    /// polynomials.
    pub(crate) fn along_axis(&self, omega_rad_s: f64) -> AxisValue {
        let coefficients = self.coefficients();
        let degree = self.degree();
        // In powers of 1/omega above 1 rad/s: nothing overflows.
        let inverse = 1.0 < omega_rad_s;
        let base = if inverse {
            omega_rad_s.recip()
        } else {
            omega_rad_s
        };
        let (mut parts, mut sizes) = ([0.0; 2], [0.0; 2]);
        for step in 0..=degree {
            let power = if inverse { step } else { degree - step };
            let c = coefficients[degree - power];
            for (part, size) in parts.iter_mut().zip(&mut sizes) {
                *part *= base;
                *size *= base;
            }
            parts[power % 2] += if power % 4 < 2 { c } else { -c };
            sizes[power % 2] += c.abs();
        }
        let largest = sizes[0].max(sizes[1]);
        let scale = if 0.0 < largest && largest.is_finite() {
            largest
        } else {
            1.0
        };
        let u = unit(degree);
        AxisValue {
            value: Complex::new(parts[0] / scale, parts[1] / scale),
            error: Complex::new(u * sizes[0] / scale, u * sizes[1] / scale),
            ln_scale: scale.ln()
                + if inverse {
                    degree as f64 * omega_rad_s.ln()
                } else {
                    0.0
                },
        }
    }

    /// Those of its `roots` that lie on the axis above the origin, as far as rounding can tell, in ascending order.
    pub(crate) fn roots_on_axis(&self, roots: &[Complex<f64>]) -> Vec<AxisRoot> {
        /// What is this far from the axis, against its size, has no business on it.
        const NEAR: f64 = 0.1;
        let mut found: Vec<AxisRoot> = roots
            .iter()
            .filter(|root| 0.0 < root.im && root.re.abs() < NEAR * root.im)
            .filter(|root| self.along_axis(root.im).may_be_zero())
            .map(|root| AxisRoot {
                omega_rad_s: root.im,
                reach: self.reach(root.im),
            })
            .collect();
        found.sort_by(|a, b| a.omega_rad_s.total_cmp(&b.omega_rad_s));
        found
    }

    fn reach(&self, omega_rad_s: f64) -> f64 {
        const FARTHEST: f64 = 0.1;
        let mut reach = f64::EPSILON;
        while reach < FARTHEST
            && [1.0 - reach, 1.0 + reach]
                .iter()
                .any(|factor| self.along_axis(omega_rad_s * factor).may_be_zero())
        {
            reach *= 2.0;
        }
        reach
    }

    /// The polynomial divided by `s² + omega²`, of which it has the roots.
    ///
    /// High powers are divided from above and low ones from below, up to the largest term at `j omega`: either way
    /// alone would multiply rounding where the roots are far apart.
    pub(crate) fn without_axis_root(&self, omega_rad_s: f64) -> Option<Self> {
        let degree = self.degree();
        if degree < 2 {
            return None;
        }
        let square = omega_rad_s * omega_rad_s;
        let c: Vec<f64> = self.coefficients().iter().rev().copied().collect();
        let size = |k: usize| c[k].abs().ln() + k as f64 * omega_rad_s.ln();
        let join = (0..=degree).max_by(|&a, &b| size(a).total_cmp(&size(b)))?;
        let mut quotient = vec![0.0; degree - 1];
        for k in (0..degree - 1).rev().take_while(|k| join <= k + 2) {
            let above = quotient.get(k + 2).copied().unwrap_or(0.0);
            quotient[k] = c[k + 2] - square * above;
        }
        for k in (0..degree - 1).take_while(|k| k + 2 < join) {
            let below = k.checked_sub(2).map_or(0.0, |k| quotient[k]);
            quotient[k] = (c[k] - below) / square;
        }
        quotient.reverse();
        Self::new(&quotient).ok().filter(|q| !q.is_zero())
    }
}

/// A quotient of polynomials along the axis, without the roots on the axis that both parts share, and with the others
/// known.
#[derive(Clone, Debug)]
pub(crate) struct AxisQuotient {
    pub(crate) numerator: Polynomial,
    pub(crate) denominator: Polynomial,
    /// Roots of the numerator on the axis, above the origin.
    pub(crate) zeros: Vec<AxisRoot>,
    /// Roots of the denominator on the axis, above the origin.
    pub(crate) poles: Vec<AxisRoot>,
    /// Frequencies of the modes that the two parts hid from each other, rad/s.
    pub(crate) hidden: Vec<f64>,
    /// All roots of both parts, for a mesh.
    pub(crate) roots: Vec<Complex<f64>>,
}

impl AxisQuotient {
    pub(crate) fn new(
        numerator: &Polynomial,
        denominator: &Polynomial,
    ) -> Result<Self, RootsError> {
        let (mut above, mut below) = (numerator.clone(), denominator.clone());
        let mut hidden = Vec::new();
        loop {
            let (above_roots, below_roots) = (roots_of(&above)?, roots_of(&below)?);
            let zeros = above.roots_on_axis(&above_roots);
            let poles = below.roots_on_axis(&below_roots);
            let without_shared = shared(&zeros, &poles).and_then(|omega| {
                let parts = (
                    above.without_axis_root(omega)?,
                    below.without_axis_root(omega)?,
                );
                Some((omega, parts))
            });
            let Some((omega, parts)) = without_shared else {
                return Ok(Self {
                    numerator: above,
                    denominator: below,
                    zeros,
                    poles,
                    hidden,
                    roots: [above_roots, below_roots].concat(),
                });
            };
            (above, below) = parts;
            hidden.push(omega);
        }
    }

    /// The value at `j omega`: `None` at a pole, exactly zero at a zero.
    pub(crate) fn at(&self, omega_rad_s: f64) -> Option<Complex<f64>> {
        if self.denominator.along_axis(omega_rad_s).may_be_zero() {
            return None;
        }
        if self.numerator.along_axis(omega_rad_s).may_be_zero() {
            return Some(Complex::new(0.0, 0.0));
        }
        Some(self.raw_at(omega_rad_s))
    }

    /// The same in plain numbers, which may be anything at a pole and its neighbours.
    pub(crate) fn raw_at(&self, omega_rad_s: f64) -> Complex<f64> {
        quotient_at(
            &self.numerator,
            &self.denominator,
            Complex::new(0.0, omega_rad_s),
        )
    }

    /// `ln |self|`: zero where the magnitude is 1.
    pub(crate) fn magnitude(&self, omega_rad_s: f64) -> Sample {
        let [above, below] =
            [&self.numerator, &self.denominator].map(|part| part.along_axis(omega_rad_s));
        above.is_larger(&below, self.raw_at(omega_rad_s).norm().ln())
    }

    /// Sine of the angle to the real axis, turned by half at each zero and pole on the axis: so it passes through zero
    /// where the curve crosses the real axis, and not where it passes through zero or infinity.
    pub(crate) fn sine(&self, omega_rad_s: f64) -> Sample {
        let [above, below] =
            [&self.numerator, &self.denominator].map(|part| part.along_axis(omega_rad_s));
        let product = above.times(&below.conj());
        let passed = self
            .zeros
            .iter()
            .chain(&self.poles)
            .filter(|root| root.omega_rad_s < omega_rad_s)
            .count();
        let sine = self.raw_at(omega_rad_s).arg().sin();
        Sample {
            value: if passed % 2 == 0 { sine } else { -sine },
            is_decided: product.error.im < product.value.im.abs(),
        }
    }

    /// Whether a zero or a pole on the axis lies between two frequencies, or within its reach of either.
    pub(crate) fn has_root_between(&self, low: f64, high: f64) -> bool {
        /// Values next to a root are told from zero, but little more.
        const WIDER: f64 = 4.0;
        self.zeros.iter().chain(&self.poles).any(|root| {
            let reach = WIDER * root.reach * root.omega_rad_s;
            low <= root.omega_rad_s + reach && root.omega_rad_s - reach <= high
        })
    }
}

/// Roots, of which the zero polynomial has none to speak of.
pub(crate) fn roots_of(polynomial: &Polynomial) -> Result<Vec<Complex<f64>>, RootsError> {
    if polynomial.is_zero() {
        Ok(Vec::new())
    } else {
        polynomial.roots()
    }
}

/// A frequency at which both lists have a root, by the list that knows it better.
fn shared(zeros: &[AxisRoot], poles: &[AxisRoot]) -> Option<f64> {
    let is_same = |a: &AxisRoot, b: &AxisRoot| {
        (a.omega_rad_s - b.omega_rad_s).abs() <= a.reach * a.omega_rad_s + b.reach * b.omega_rad_s
    };
    let (zero, pole) = zeros.iter().find_map(|zero| {
        let pole = poles.iter().find(|pole| is_same(zero, pole))?;
        Some((zero, pole))
    })?;
    // Roots of multiplicity m scatter around their place, which their mean still knows.
    let mean = |list: &[AxisRoot], one: &AxisRoot| {
        let cluster: Vec<f64> = list
            .iter()
            .filter(|other| is_same(one, other))
            .map(|other| other.omega_rad_s)
            .collect();
        (
            cluster.iter().sum::<f64>() / cluster.len() as f64,
            cluster.len(),
        )
    };
    let (of_zeros, of_poles) = (mean(zeros, zero), mean(poles, pole));
    Some(if of_zeros.1 < of_poles.1 {
        of_zeros.0
    } else {
        of_poles.0
    })
}
