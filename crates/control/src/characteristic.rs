//! The characteristic function of a loop with the network in it, `A(s) + B(s) exp(-s d)` ([`crate::DelayedScheme`]), as
//! something that can be looked at: the gain of the path that the delay is in, its peak, its curve.
//!
//! `A` and `B` are kept as the products that they are, so that no degree doubles and no coefficient is rounded once
//! more.

use crate::closed_loop::{ClosedLoop, LoopError};
use crate::delay::DelayedScheme;
use crate::frequency::Features;
use crate::polynomial::{Polynomial, PolynomialError, is_exactly_zero, quotient_at};
use crate::roots::RootsError;
use nalgebra::Complex;

/// `A(s) + B(s) exp(-s d)`, for any round trip `d`. Invariant: `A` is not zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Characteristic {
    /// Factors of `A`.
    pub(crate) prompt: [Polynomial; 2],
    /// Factors of `B`.
    pub(crate) delayed: [Polynomial; 2],
    /// Factors of `A + B`.
    pub(crate) together: [Polynomial; 2],
}

/// The gain at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainAt {
    /// The frequency, rad/s.
    pub omega_rad_s: f64,
    /// What a swing of it is multiplied by on its way round.
    pub gain: Complex<f64>,
}

/// Where a drawn curve begins and ends, rad/s: far below and far above all that a hand does.
const DRAWN_RAD_S: [f64; 2] = [1e-2, 1e4];
/// Steps along it: this share of a frequency, so that a decade has two hundred.
const STEP_SHARE: f64 = 0.012;
/// And as much of the turn that the delay makes, rad: a circle of 126 corners looks round.
const STEP_RAD: f64 = 0.05;
/// After about a hundred turns the gain of every loop that rolls off is a dot, and is not followed round any more, rad.
const FOLLOWED_RAD: f64 = 600.0;

impl Characteristic {
    /// From `A` and `B` themselves.
    ///
    /// # Errors
    /// `A` is zero, or the sum is out of range.
    pub fn new(a: Polynomial, b: Polynomial) -> Result<Self, LoopError> {
        if a.is_zero() {
            return Err(LoopError::Undetermined);
        }
        let together = a.plus(&b)?;
        Ok(Self {
            prompt: [a, Polynomial::one()],
            delayed: [b, Polynomial::one()],
            together: [together, Polynomial::one()],
        })
    }

    /// `B/A exp(-j omega d)`: the loop is at the edge of stability where this passes -1. Not finite where `A` is zero.
    #[must_use]
    pub fn gain_at(&self, omega_rad_s: f64, delay_s: f64) -> Complex<f64> {
        self.prompt_gain_at(omega_rad_s) * Complex::from_polar(1.0, -omega_rad_s * delay_s)
    }

    /// The gain without the delay, which only turns it.
    pub(crate) fn prompt_gain_at(&self, omega_rad_s: f64) -> Complex<f64> {
        let s = Complex::new(0.0, omega_rad_s);
        let quotient = |n: usize| quotient_at(&self.delayed[n], &self.prompt[n], s);
        quotient(0) * quotient(1)
    }

    /// `A(s) + B(s) exp(-s d)` itself.
    #[must_use]
    pub fn at(&self, s: Complex<f64>, delay_s: f64) -> Complex<f64> {
        let [a, b] = [&self.prompt, &self.delayed].map(|[p, q]| p.at(s) * q.at(s));
        a + b * (-s * delay_s).exp()
    }

    /// The greatest magnitude of the gain over all frequencies, limits at rest and at infinite frequency included. The
    /// delay does not change it. Infinite where `A` has a root on the axis that `B` has not.
    ///
    /// # Errors
    /// Roots are not to be had.
    pub fn peak_gain(&self) -> Result<f64, RootsError> {
        if self.delayed.iter().any(Polynomial::is_zero) {
            return Ok(0.0);
        }
        let mut features = Features::default();
        for (above, below) in self.delayed.iter().zip(&self.prompt) {
            features.add_roots(above)?;
            features.add_roots(below)?;
            features.add_outer_crossings(above, below);
        }
        let (_, inverse) = features
            .mesh()
            .least(|omega| self.prompt_gain_at(omega).norm().recip());
        let peak = inverse.recip();
        Ok(self.limits().into_iter().fold(peak, f64::max))
    }

    /// Magnitudes of the gain that it approaches at the lowest and at the highest frequencies.
    fn limits(&self) -> [f64; 2] {
        let count = |factors: &[Polynomial; 2], of: fn(&Polynomial) -> usize| {
            factors.iter().map(of).sum::<usize>()
        };
        let size = |factors: &[Polynomial; 2], of: fn(&Polynomial) -> f64| {
            factors
                .iter()
                .map(|factor| of(factor).abs().ln())
                .sum::<f64>()
        };
        let [at_rest, far_up] = [Polynomial::roots_at_origin, Polynomial::degree]
            .map(|of| [&self.delayed, &self.prompt].map(|factors| count(factors, of)));
        let ratio = |of| (size(&self.delayed, of) - size(&self.prompt, of)).exp();
        let limit = |powers: [usize; 2], at_equal: f64| match powers[0].cmp(&powers[1]) {
            std::cmp::Ordering::Less => 0.0,
            std::cmp::Ordering::Equal => at_equal,
            std::cmp::Ordering::Greater => f64::INFINITY,
        };
        [
            limit([at_rest[1], at_rest[0]], ratio(Polynomial::lowest)),
            limit(far_up, ratio(Polynomial::leading)),
        ]
    }

    /// The gain from far below to far above a hand, with steps so small that the turns of the delay are round.
    /// Frequencies ascend; where `A` is zero on the axis there is no entry.
    #[must_use]
    pub fn curve(&self, delay_s: f64) -> Vec<GainAt> {
        let [mut omega_rad_s, end] = DRAWN_RAD_S;
        let mut curve = Vec::new();
        while omega_rad_s < end {
            let gain = self.gain_at(omega_rad_s, delay_s);
            if gain.re.is_finite() && gain.im.is_finite() {
                curve.push(GainAt { omega_rad_s, gain });
            }
            let is_followed = 0.0 < delay_s && omega_rad_s * delay_s < FOLLOWED_RAD;
            let turn = if is_followed {
                STEP_RAD / delay_s
            } else {
                f64::INFINITY
            };
            // A turn without end is not followed to the last digit of a frequency.
            let step = (STEP_SHARE * omega_rad_s).min(turn.max(1e-6 * omega_rad_s));
            omega_rad_s += step;
        }
        curve
    }
}

impl ClosedLoop {
    /// The loop's characteristic function under a scheme.
    ///
    /// # Errors
    /// A sum of loop polynomials is out of range, or one side by itself does not determine the motion.
    pub fn characteristic(&self, scheme: DelayedScheme) -> Result<Characteristic, LoopError> {
        let with_arm = self.d.plus(&self.n_h)?;
        let one = Polynomial::one;
        let found = match scheme {
            DelayedScheme::PositionForce => Characteristic {
                prompt: [with_arm, one()],
                delayed: [self.n_e.clone(), one()],
                together: [self.c.clone(), one()],
            },
            DelayedScheme::ForceExchange => Characteristic {
                prompt: [self.d.plus(&self.n_e)?, with_arm],
                delayed: [self.n_e.clone(), negated(&self.n_h)?],
                together: [self.d.clone(), self.c.clone()],
            },
        };
        if found.prompt.iter().any(Polynomial::is_zero) {
            return Err(LoopError::Undetermined);
        }
        Ok(found)
    }
}

fn negated(polynomial: &Polynomial) -> Result<Polynomial, PolynomialError> {
    polynomial.scaled(-1.0)
}

/// The product's coefficients, lowest power first, each by its magnitude.
pub(crate) fn sizes(factors: &[Polynomial; 2]) -> Vec<f64> {
    let ascending = |factor: &Polynomial| -> Vec<f64> {
        let sizes = factor.coefficients().iter().rev();
        sizes.map(|coefficient| coefficient.abs()).collect()
    };
    let [one, other] = [&factors[0], &factors[1]].map(ascending);
    let mut product = vec![0.0; one.len() + other.len() - 1];
    for (i, a) in one
        .iter()
        .enumerate()
        .filter(|(_, a)| !is_exactly_zero(**a))
    {
        for (j, b) in other.iter().enumerate() {
            product[i + j] += a * b;
        }
    }
    product
}
