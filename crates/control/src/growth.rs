//! What a loop does past its delay margin: the roots of `A(s) + B(s) exp(-s d)` right of the axis, each a motion that
//! grows by itself.
//!
//! Such a root has `|A(s)| <= |B(s)|`, as `|exp(-s d)| <= 1` there, and where `A` has the higher degree that bounds it.
//! Without delay the roots are those of the polynomial `A + B`. With one, Newton's method starts
//!
//! - from these and from the roots of `A`, which the roots leave for and come from as the delay grows;
//! - along the axis, wherever `|B/A|` is above 1, four times in each turn of `exp(-s d)`, at the distance from the axis
//!   at which the exponential makes up for it: a root that has crossed the axis lies near there;
//! - from a grid over what is left of the half-plane.

use crate::characteristic::{Characteristic, sizes};
use crate::polynomial::Polynomial;
use crate::roots::RootsError;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// A motion that grows by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// Rate of its envelope, 1/s.
    pub rate_per_s: f64,
    /// How often it swings, Hz; 0 where it grows without swinging.
    pub frequency_hz: f64,
}

/// Newton's method doubles its digits with every step once it is near; a root that it does not find by then is found
/// from another start.
const NEWTON_STEPS: usize = 60;
/// Starts along the axis at most, so that the work is bounded whatever the delay.
const MOST_ALONG_AXIS: usize = 2000;
/// The grid: shares of the bound away from the axis, and how many along it.
const GRID_SHARES: [f64; 6] = [0.0, 0.02, 0.08, 0.25, 0.6, 1.0];
const GRID_ALONG: usize = 24;
/// Roots nearer to each other than this share are one.
const SAME: f64 = 1e-6;
/// A root this near to the real axis, as a share of its distance from the origin, is on it.
const REAL: f64 = 1e-9;

impl Characteristic {
    /// The motion that grows fastest at a round trip; nothing when none grows faster than `slowest_per_s`.
    ///
    /// # Errors
    /// As [`Characteristic::growing_roots`].
    pub fn fastest_growth(
        &self,
        delay_s: f64,
        slowest_per_s: f64,
    ) -> Result<Option<Growth>, RootsError> {
        let roots = self.growing_roots(delay_s, slowest_per_s)?;
        let fastest = roots.into_iter().max_by(|a, b| a.re.total_cmp(&b.re));
        Ok(fastest.map(|root| Growth {
            rate_per_s: root.re,
            frequency_hz: root.im / TAU,
        }))
    }

    /// Roots at a round trip with a real part above `slowest_per_s`, which is not below zero, 1/s; of a conjugate pair
    /// the one above the axis. Each comes once, whatever its multiplicity.
    ///
    /// Where `B` has the degree of `A` or a higher one, there are such roots without end as soon as there is a delay
    /// ([`crate::delay_margin`] is zero); only those are told that are no further out than the roots of `A + B` and of
    /// `A`.
    ///
    /// # Errors
    /// Roots of `A` or of `A + B` are not to be had.
    pub fn growing_roots(
        &self,
        delay_s: f64,
        slowest_per_s: f64,
    ) -> Result<Vec<Complex<f64>>, RootsError> {
        let mut known = Vec::new();
        for factor in self.together.iter().filter(|factor| 0 < factor.degree()) {
            known.extend(factor.roots()?);
        }
        let mut found = Found {
            slowest_per_s,
            roots: Vec::new(),
        };
        if delay_s <= 0.0 {
            known.into_iter().for_each(|root| found.add(root));
            return Ok(found.roots);
        }
        for factor in self.prompt.iter().filter(|factor| 0 < factor.degree()) {
            known.extend(factor.roots()?);
        }
        let farthest = known.iter().map(|root| root.norm()).fold(0.0, f64::max);
        let reach = self.reach().unwrap_or(farthest);
        let grid = GRID_SHARES.into_iter().flat_map(|share| {
            let along = (0..=GRID_ALONG).map(|n| n as f64 / GRID_ALONG as f64);
            along.map(move |height| Complex::new(share, height) * reach)
        });
        let starts = known.into_iter().chain(self.along_axis(delay_s, reach));
        let newton = Newton::new(self, delay_s);
        for start in starts.chain(grid) {
            // Rounding may put a root at the bound beyond it.
            if let Some(root) = newton
                .root_from(start)
                .filter(|root| root.norm() <= 2.0 * reach)
            {
                found.add(root);
            }
        }
        Ok(found.roots)
    }

    /// A distance from the origin beyond which `|B| < |A|` on the right half-plane: Cauchy's bound on the roots of `A`,
    /// with `B` against it. Nothing where `B` does not fall off against `A`.
    fn reach(&self) -> Option<f64> {
        let (prompt, delayed) = (sizes(&self.prompt), sizes(&self.delayed));
        let (leading, rest) = prompt.split_last()?;
        if prompt.len() <= delayed.len() && delayed.iter().any(|size| 0.0 < *size) {
            return None;
        }
        // All over the leading power, so that a large radius overflows nothing.
        let is_beyond = |radius: f64| {
            let against: f64 = [rest, &delayed]
                .into_iter()
                .flat_map(|sizes| sizes.iter().enumerate())
                .map(|(power, size)| size * radius.powi(power as i32 - rest.len() as i32))
                .sum();
            against < *leading
        };
        let mut high = 1.0;
        while !is_beyond(high) && high < 1e12 {
            high *= 2.0;
        }
        let mut low = if is_beyond(0.5 * high) {
            0.0
        } else {
            0.5 * high
        };
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if is_beyond(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Some(high)
    }

    /// Starts along the axis.
    fn along_axis(&self, delay_s: f64, reach: f64) -> impl Iterator<Item = Complex<f64>> {
        let step = (0.5 * PI / delay_s).max(reach / MOST_ALONG_AXIS as f64);
        let count = (reach / step).ceil().min(MOST_ALONG_AXIS as f64) as usize;
        (0..=count).filter_map(move |n| {
            let omega = n as f64 * step;
            let log_gain = self.prompt_gain_at(omega).norm().ln();
            (0.0 <= log_gain && log_gain.is_finite())
                .then(|| Complex::new((log_gain / delay_s).min(reach), omega))
        })
    }
}

/// Roots right of a line, each once.
struct Found {
    slowest_per_s: f64,
    roots: Vec<Complex<f64>>,
}

impl Found {
    fn add(&mut self, root: Complex<f64>) {
        if root.re <= self.slowest_per_s {
            return;
        }
        let im = root.im.abs();
        let im = if im <= REAL * root.norm() { 0.0 } else { im };
        let root = Complex::new(root.re, im);
        let is_known = |other: &Complex<f64>| (other - root).norm() <= SAME * root.norm();
        if !self.roots.iter().any(is_known) {
            self.roots.push(root);
        }
    }
}

/// Newton's method on the characteristic function.
struct Newton<'a> {
    prompt: [(&'a Polynomial, Polynomial); 2],
    delayed: [(&'a Polynomial, Polynomial); 2],
    delay_s: f64,
}

impl<'a> Newton<'a> {
    fn new(of: &'a Characteristic, delay_s: f64) -> Self {
        let with_slopes = |factors: &'a [Polynomial; 2]| {
            [&factors[0], &factors[1]].map(|factor| (factor, factor.derivative()))
        };
        Self {
            prompt: with_slopes(&of.prompt),
            delayed: with_slopes(&of.delayed),
            delay_s,
        }
    }

    fn root_from(&self, start: Complex<f64>) -> Option<Complex<f64>> {
        let mut s = start;
        for _ in 0..NEWTON_STEPS {
            let [a, a_slope] = product_at(&self.prompt, s);
            let [b, b_slope] = product_at(&self.delayed, s);
            let turn = (-s * self.delay_s).exp();
            let step = (a + b * turn) / (a_slope + (b_slope - b * self.delay_s) * turn);
            s -= step;
            if !(s.re.is_finite() && s.im.is_finite()) {
                return None;
            }
            if step.norm() <= 1e-11 * s.norm() {
                return Some(s);
            }
        }
        None
    }
}

/// A product and its derivative.
fn product_at(factors: &[(&Polynomial, Polynomial); 2], s: Complex<f64>) -> [Complex<f64>; 2] {
    let [(p, p_slope), (q, q_slope)] =
        [&factors[0], &factors[1]].map(|(value, slope)| (value.at(s), slope.at(s)));
    [p * q, p_slope * q + p * q_slope]
}
