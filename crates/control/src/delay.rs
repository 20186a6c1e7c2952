//! How much round-trip delay a loop bears, with the exact `exp(-s d)`, never a rational stand-in.
//!
//! A quasi-polynomial `A(s) + B(s) exp(-s d)` that is stable at `d = 0` first loses stability where it has a root on
//! the imaginary axis, which needs `|A(j w)| = |B(j w)|`. Those frequencies do not depend on `d`; each then tells the
//! delays that complete the phase: `w d = arg(-B/A) mod 2 pi`. The least of them is the margin.
//!
//! Where `|B/A|` only touches 1, a root touches the axis at those delays, and that is no stability either. At rest it
//! is: `A + B` is not zero there, and no delay turns a constant. At infinite frequency a `|B/A|` that comes to 1, from
//! whichever side, leaves an unending row of roots that come as near to the axis as one likes, for every delay: the
//! margin is zero.
//!
//! The two schemes, with `D, N_H, N_E, C` of [`ClosedLoop`]:
//!
//! ```text
//! position forward, force back   1 + H + E exp(-s d) = 0            A = D + N_H              B = N_E
//! force exchange, [KHMH03]       (1+E)(1+H) - H E exp(-s d) = 0     A = (D+N_E)(D+N_H)       B = -N_E N_H
//! ```
//!
//! In force exchange `A + B = D C`, so `A/B` is one plus a term that may be tiny; it is computed from that term.

use crate::axis::Sample;
use crate::balance;
use crate::closed_loop::{ClosedLoop, LoopError, limits};
use crate::frequency::{Contacts, Features};
use crate::margins::ROUNDING_OF_ONE;
use crate::polynomial::{Polynomial, quotient_at};
use nalgebra::Complex;
use std::cmp::Ordering;
use std::f64::consts::TAU;

/// Which signals cross the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DelayedScheme {
    /// Each side integrates its own force and the other's.
    ForceExchange,
    /// Position goes forward, force comes back.
    PositionForce,
}

/// What a loop bears.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DelayMargin {
    /// Stable at every delay.
    Unbounded,
    /// Stable below this round trip. Zero when any delay at all is too much.
    Finite {
        /// The round trip at which the first root reaches the axis, s.
        seconds: f64,
        /// Where on the axis it does so, rad/s; infinite when an unending row of roots does at once.
        omega_rad_s: f64,
    },
    /// There is nothing to keep.
    None(NoMargin),
}

/// Why there is no delay margin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoMargin {
    /// The loop is not stable even without delay.
    UnstableWithoutDelay,
    /// Force exchange keeps a copy of the admittance on either side. It has modes that are not stable by themselves,
    /// and what feeds back to one copy does not hold the difference between the two.
    UnstableAdmittance,
}

impl DelayMargin {
    /// The margin in s where it is finite.
    #[must_use]
    pub fn seconds(&self) -> Option<f64> {
        match self {
            Self::Finite { seconds, .. } => Some(*seconds),
            Self::Unbounded | Self::None(_) => None,
        }
    }

    /// Whether a loop with this margin is stable with a round trip of `delay_s`.
    #[must_use]
    pub fn bears(&self, delay_s: f64) -> bool {
        match self {
            Self::Unbounded => true,
            Self::Finite { seconds, .. } => delay_s < *seconds,
            Self::None(_) => false,
        }
    }
}

/// Delay margin of `A(s) + B(s) exp(-s d) = 0`.
///
/// # Errors
/// `A + B` is zero everywhere or out of range, or roots are not to be had.
pub fn delay_margin(a: &Polynomial, b: &Polynomial) -> Result<DelayMargin, LoopError> {
    let sum = a.plus(b)?;
    if sum.is_zero() {
        return Err(LoopError::Undetermined);
    }
    if !sum.is_hurwitz()? {
        return Ok(DelayMargin::None(NoMargin::UnstableWithoutDelay));
    }
    if b.is_zero() {
        return Ok(DelayMargin::Unbounded);
    }
    if let Some(zero) = lost_at_once([b], [a]) {
        return Ok(zero);
    }
    let mut features = Features::default();
    for factor in [a, b, &sum] {
        features.add_roots(factor)?;
    }
    features.add_outer_crossings(b, a);
    features.add_range(balance::equal_magnitudes(b, a));
    let ratio = |omega: f64| quotient_at(b, a, Complex::new(0.0, omega));
    let magnitude = |omega: f64| {
        let [above, below] = [b, a].map(|part| part.along_axis(omega));
        above.is_larger(&below, ratio(omega).norm().ln())
    };
    let contacts = features.mesh().contacts(magnitude, |_, _| false);
    Ok(first_delay(contacts, |omega| (-ratio(omega)).arg()))
}

impl ClosedLoop {
    /// Delay margin of either scheme.
    ///
    /// # Errors
    /// Roots are not to be had.
    pub fn delay_margin(&self, scheme: DelayedScheme) -> Result<DelayMargin, LoopError> {
        match scheme {
            DelayedScheme::ForceExchange => self.delay_margin_force_exchange(),
            DelayedScheme::PositionForce => self.delay_margin_position_force(),
        }
    }

    /// Least magnitude of the characteristic function on the axis over *every* round trip from 0 to the given one: (33)
    /// with the network in it. Without delay both schemes give `inf |1 + H + E|`.
    ///
    /// Says how far a loop is from instability only if its delay margin is above the round trip.
    ///
    /// # Errors
    /// Roots are not to be had.
    pub fn least_distance_within(
        &self,
        scheme: DelayedScheme,
        round_trip_s: f64,
    ) -> Result<f64, LoopError> {
        let with_arm = self.d.plus(&self.n_h)?;
        let with_clay = self.d.plus(&self.n_e)?;
        let mut features = Features::default();
        for factor in [
            &self.d, &self.n_e, &self.n_h, &with_clay, &with_arm, &self.c,
        ] {
            features.add_roots(factor)?;
        }
        features.add_outer_crossings(&self.n_l, &self.d);
        if 0.0 < round_trip_s {
            // The exponential bends the curve from about here on.
            features.add_points(&[Complex::new(1.0 / round_trip_s, 0.0)]);
        }
        let over_d = |numerator: &Polynomial, omega: f64| {
            quotient_at(numerator, &self.d, Complex::new(0.0, omega))
        };
        let (_, distance) = features.mesh().least(|omega| {
            let (h, e) = (over_d(&self.n_h, omega), over_d(&self.n_e, omega));
            let (prompt, delayed) = match scheme {
                DelayedScheme::PositionForce => (1.0 + h, -e),
                DelayedScheme::ForceExchange => ((1.0 + e) * (1.0 + h), h * e),
            };
            least_difference(prompt, delayed, omega * round_trip_s)
        });
        Ok(distance.min(limits(&self.c, &self.d)[1]))
    }

    /// Delay margin when the tool follows the handle's position and the clay's force comes back.
    ///
    /// # Errors
    /// Roots are not to be had.
    pub fn delay_margin_position_force(&self) -> Result<DelayMargin, LoopError> {
        delay_margin(&self.d.plus(&self.n_h)?, &self.n_e)
    }

    /// Delay margin of the paper's own scheme, in which each side integrates both forces.
    ///
    /// The two admittances have an integrator each. Their difference drifts at every delay, and the margin does not
    /// speak of it: that is the loss of coordination that this scheme has instead of a loss of stability.
    ///
    /// # Errors
    /// Roots are not to be had.
    pub fn delay_margin_force_exchange(&self) -> Result<DelayMargin, LoopError> {
        if !self.is_stable_without_delay()? {
            return Ok(DelayMargin::None(NoMargin::UnstableWithoutDelay));
        }
        if !self.admittances_stay_together()? {
            return Ok(DelayMargin::None(NoMargin::UnstableAdmittance));
        }
        if self.n_e.is_zero() || self.n_h.is_zero() {
            return Ok(DelayMargin::Unbounded);
        }
        let with_clay = self.d.plus(&self.n_e)?;
        let with_arm = self.d.plus(&self.n_h)?;
        if let Some(zero) = lost_at_once([&self.n_e, &self.n_h], [&with_clay, &with_arm]) {
            return Ok(zero);
        }
        let mut features = Features::default();
        for factor in [
            &self.d, &self.n_e, &self.n_h, &with_clay, &with_arm, &self.c,
        ] {
            features.add_roots(factor)?;
        }
        features.add_outer_crossings(&self.n_e, &with_clay);
        features.add_outer_crossings(&self.n_h, &with_arm);
        features.add_outer_crossings(&self.d, &self.n_e);
        features.add_outer_crossings(&self.c, &self.n_h);
        // (1+E)(1+H)/(H E) = 1 + q,  q = (D/N_E)(C/N_H).
        let q = |omega: f64| {
            let s = Complex::new(0.0, omega);
            quotient_at(&self.d, &self.n_e, s) * quotient_at(&self.c, &self.n_h, s)
        };
        features.add_range(balance::unit_shift(
            [&self.d, &self.c],
            [&self.n_e, &self.n_h],
        ));
        // |1 + q|² - 1 without forming 1 + q.
        let excess = |omega: f64| {
            let q = q(omega);
            let difference = q.norm_sqr() + 2.0 * q.re;
            let value = if difference.is_finite() {
                difference.max(-1.0).ln_1p()
            } else {
                f64::INFINITY
            };
            Sample {
                value,
                is_decided: self.is_shift_decided(omega),
            }
        };
        let contacts = features.mesh().contacts(excess, |_, _| false);
        Ok(first_delay(contacts, |omega| -(1.0 + q(omega)).arg()))
    }

    /// Whether the sign of `|1 + q|² - 1` for `q = (D/N_E)(C/N_H)` is beyond rounding: of `|Q|² + 2 Re (Q conj M)`,
    /// where `q = Q / M`.
    fn is_shift_decided(&self, omega_rad_s: f64) -> bool {
        let [d, c, n_e, n_h] =
            [&self.d, &self.c, &self.n_e, &self.n_h].map(|part| part.along_axis(omega_rad_s));
        let (above, below) = (d.times(&c), n_e.times(&n_h));
        // Both summands over the scale of the second.
        let ratio = (above.ln_scale - below.ln_scale).exp();
        let own = above.times(&above.conj());
        let mixed = above.times(&below.conj());
        let (first, second) = (own.value.re * ratio, 2.0 * mixed.value.re);
        let rounding = f64::EPSILON
            * (4.0 + above.ln_scale.abs() + below.ln_scale.abs())
            * (first.abs() + second.abs());
        own.error.re * ratio + 2.0 * mixed.error.re + rounding < (first + second).abs()
    }

    /// Whether the modes that two copies of `P` have apart from each other stay bounded once there is any delay.
    ///
    /// Without delay the characteristic polynomial of force exchange is `D C`: the roots of `D` are the difference
    /// between the copies. Roots left of the axis are harmless. Of `k` at the origin, `D C + N_E N_H d s` keeps some
    /// there (drift) and lets the others go: one along the real axis, to the left if the signs agree; two or more apart
    /// in all directions.
    fn admittances_stay_together(&self) -> Result<bool, LoopError> {
        if !self.d.is_hurwitz_apart_from_origin()? {
            return Ok(false);
        }
        let integrators = self.d.roots_at_origin();
        if self.n_e.is_zero() || self.n_h.is_zero() {
            return Ok(integrators <= 1);
        }
        let kept = self.n_e.roots_at_origin() + self.n_h.roots_at_origin() + 1;
        Ok(match integrators.saturating_sub(kept) {
            0 => true,
            1 => 0.0 < self.d.lowest() * self.c.lowest() * self.n_e.lowest() * self.n_h.lowest(),
            _ => false,
        })
    }
}

/// Least of `|prompt - delayed exp(-j theta)|` for `theta` from 0 to `turn_rad`.
fn least_difference(prompt: Complex<f64>, delayed: Complex<f64>, turn_rad: f64) -> f64 {
    let aligned_at = (delayed / prompt).arg().rem_euclid(TAU);
    if aligned_at <= turn_rad {
        return (prompt.norm() - delayed.norm()).abs();
    }
    let at_end = (prompt - delayed * Complex::from_polar(1.0, -turn_rad)).norm();
    at_end.min((prompt - delayed).norm())
}

/// When the delayed part does not fall off against the rest, roots far up the axis cross, or come as near as one likes,
/// at the slightest delay. Both parts are products.
fn lost_at_once<const N: usize>(
    delayed: [&Polynomial; N],
    prompt: [&Polynomial; N],
) -> Option<DelayMargin> {
    let degree = |product: [&Polynomial; N]| product.iter().map(|p| p.degree()).sum::<usize>();
    let ln_leading =
        |product: [&Polynomial; N]| product.iter().map(|p| p.leading().abs().ln()).sum::<f64>();
    let is_lost = match degree(delayed).cmp(&degree(prompt)) {
        Ordering::Less => false,
        Ordering::Equal => -ROUNDING_OF_ONE <= ln_leading(delayed) - ln_leading(prompt),
        Ordering::Greater => true,
    };
    is_lost.then_some(DelayMargin::Finite {
        seconds: 0.0,
        omega_rad_s: f64::INFINITY,
    })
}

fn first_delay(contacts: Contacts, phase_rad: impl Fn(f64) -> f64) -> DelayMargin {
    let omegas = match contacts {
        Contacts::At(omegas) => omegas,
        // Equal up to infinite frequency, which is lost at once.
        Contacts::Everywhere => Vec::new(),
    };
    omegas
        .into_iter()
        .map(|omega| (phase_rad(omega).rem_euclid(TAU) / omega, omega))
        .filter(|(seconds, _)| seconds.is_finite())
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(DelayMargin::Unbounded, |(seconds, omega_rad_s)| {
            DelayMargin::Finite {
                seconds,
                omega_rad_s,
            }
        })
}
