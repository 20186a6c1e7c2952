//! Where to look along the frequency axis.
//!
//! In `x = ln omega` a factor `j omega - r` is smooth except at the complex point `ln|r| + j theta`, where `theta` is
//! the angle between the root and the imaginary axis. So a mesh whose step stays a fraction of the distance to the
//! nearest such point sees every resonance, however sharp, and wastes nothing elsewhere. Crossings and extrema are then
//! enclosed between neighbours and found by halving: a bounded number of evaluations, whatever the curve.

use crate::polynomial::{Polynomial, is_exactly_zero};
use crate::roots::RootsError;
use nalgebra::Complex;
use std::f64::consts::FRAC_PI_2;

/// Step over distance to the nearest singular point: neighbours then differ by a quickly converging power series.
const STEP_RATIO: f64 = 0.125;
/// Longest step, a third of an octave.
const LONGEST_STEP: f64 = 0.25;
/// Sharpest resonance that the mesh zooms into; a sharper one is found by its flanks.
const SHARPEST_RAD: f64 = 1e-6;
/// The mesh reaches this factor beyond the outermost feature, where curves are powers of the frequency.
const REACH: f64 = 1e3;
/// Frequencies beyond are of no machine; they keep powers of the frequency within the range of numbers.
const LOWEST_RAD_S: f64 = 1e-100;
const HIGHEST_RAD_S: f64 = 1e100;

/// A point of interest: `ln` of its frequency and its angle to the imaginary axis.
#[derive(Clone, Copy, Debug)]
struct Feature {
    x: f64,
    theta: f64,
}

/// Frequencies in rad/s, ascending, dense where curves bend.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    omegas: Vec<f64>,
}

/// Gathers what bends a curve, then lays the mesh.
#[derive(Clone, Debug, Default)]
pub(crate) struct Features(Vec<Feature>);

impl Features {
    /// All roots of a factor of the curve; the zero polynomial has no say.
    pub(crate) fn add_roots(&mut self, polynomial: &Polynomial) -> Result<(), RootsError> {
        if !polynomial.is_zero() {
            self.add_points(&polynomial.roots()?);
        }
        Ok(())
    }

    /// Roots found already.
    pub(crate) fn add_points(&mut self, roots: &[Complex<f64>]) {
        for root in roots {
            if !is_exactly_zero(root.norm()) {
                self.0.push(Feature {
                    x: root.norm().ln(),
                    theta: root.re.abs().atan2(root.im.abs()),
                });
            }
        }
    }

    /// The frequencies at which `numerator / denominator` would pass magnitude 1, seen from far below and far above
    /// all roots: a crossing may lie decades away from any of them.
    pub(crate) fn add_outer_crossings(&mut self, numerator: &Polynomial, denominator: &Polynomial) {
        if numerator.is_zero() || denominator.is_zero() {
            return;
        }
        let lowest = |p: &Polynomial| (p.lowest(), p.roots_at_origin());
        let highest = |p: &Polynomial| (p.leading(), p.degree());
        for end in [
            (lowest(numerator), lowest(denominator)),
            (highest(numerator), highest(denominator)),
        ] {
            let ((above, power_above), (below, power_below)) = end;
            let power = power_below as f64 - power_above as f64;
            if !is_exactly_zero(power) {
                let x = (above.abs().ln() - below.abs().ln()) / power;
                self.0.push(Feature {
                    x,
                    theta: FRAC_PI_2,
                });
            }
        }
    }

    pub(crate) fn mesh(&self) -> Mesh {
        let clamp = |x: f64| x.clamp(LOWEST_RAD_S.ln(), HIGHEST_RAD_S.ln());
        let low = self.0.iter().map(|f| f.x).reduce(f64::min).unwrap_or(0.0);
        let high = self.0.iter().map(|f| f.x).reduce(f64::max).unwrap_or(0.0);
        let (mut x, end) = (clamp(low - REACH.ln()), clamp(high + REACH.ln()));
        let mut omegas = Vec::new();
        while x < end {
            omegas.push(x.exp());
            let distance = self.0.iter().fold(f64::INFINITY, |least, f| {
                least.min((x - f.x).hypot(f.theta.max(SHARPEST_RAD)))
            });
            x += (STEP_RATIO * distance).min(LONGEST_STEP);
        }
        omegas.push(end.exp());
        Mesh { omegas }
    }
}

impl Mesh {
    pub(crate) fn omegas(&self) -> &[f64] {
        &self.omegas
    }

    /// Where a real function of the frequency passes through zero or touches it.
    ///
    /// `function` may be infinite; where it is not a number it counts as far from zero.
    pub(crate) fn crossings(&self, function: impl Fn(f64) -> f64) -> Vec<f64> {
        /// A function this near to zero touches it: functions here are logarithms or sines, of order 1.
        const TOUCH: f64 = 1e-13;
        let function = |omega: f64| {
            let value = function(omega);
            if value.is_nan() { f64::INFINITY } else { value }
        };
        let values: Vec<f64> = self.omegas.iter().map(|&omega| function(omega)).collect();
        let mut found = Vec::new();
        for (omegas, values) in self.omegas.windows(2).zip(values.windows(2)) {
            if is_exactly_zero(values[0]) {
                found.push(omegas[0]);
            } else if (values[0] < 0.0) != (values[1] < 0.0) && !is_exactly_zero(values[1]) {
                found.push(halve(function, omegas[0], omegas[1]));
            }
        }
        for (omegas, values) in self.omegas.windows(3).zip(values.windows(3)) {
            let same_side =
                (values[0] < 0.0) == (values[1] < 0.0) && (values[1] < 0.0) == (values[2] < 0.0);
            let nearest = values[1].abs() <= values[0].abs() && values[1].abs() <= values[2].abs();
            if !(same_side && nearest) || is_exactly_zero(values[1]) {
                continue;
            }
            let side = values[1].signum();
            let (omega, least) = lowest_point(|omega| side * function(omega), omegas[0], omegas[2]);
            if least < 0.0 {
                found.push(halve(function, omegas[0], omega));
                found.push(halve(function, omega, omegas[2]));
            } else if least <= TOUCH {
                found.push(omega);
            }
        }
        found.sort_by(f64::total_cmp);
        found
    }

    /// The frequency and the value of the least value of a non-negative function on the mesh and between its points.
    pub(crate) fn least(&self, function: impl Fn(f64) -> f64) -> (f64, f64) {
        let values: Vec<f64> = self.omegas.iter().map(|&omega| function(omega)).collect();
        let mut best = (self.omegas[0], f64::INFINITY);
        let mut offer = |candidate: (f64, f64)| {
            if candidate.1 < best.1 {
                best = candidate;
            }
        };
        for (&omega, &value) in self.omegas.iter().zip(&values) {
            offer((omega, value));
        }
        for (omegas, values) in self.omegas.windows(3).zip(values.windows(3)) {
            if values[1] <= values[0] && values[1] <= values[2] {
                offer(lowest_point(&function, omegas[0], omegas[2]));
            }
        }
        best
    }
}

/// Halves an interval with a change of sign down to neighbouring numbers.
fn halve(function: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    /// More than the bits of a number.
    const HALVINGS: usize = 64;
    let below = function(low) < 0.0;
    for _ in 0..HALVINGS {
        let middle = low + (high - low) / 2.0;
        if (function(middle) < 0.0) == below {
            low = middle;
        } else {
            high = middle;
        }
    }
    low + (high - low) / 2.0
}

/// Lowest point of a function with one minimum in the interval, by golden sections: frequency and value.
fn lowest_point(function: impl Fn(f64) -> f64, low: f64, high: f64) -> (f64, f64) {
    /// Beyond, the value no longer tells the points apart: a minimum is flat to the square root of rounding.
    const SECTIONS: usize = 44;
    let ratio = (5.0_f64.sqrt() - 1.0) / 2.0;
    let (mut low, mut high) = (low, high);
    let (mut left, mut right) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut at_left, mut at_right) = (function(left), function(right));
    for _ in 0..SECTIONS {
        if at_left < at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - ratio * (high - low);
            at_left = function(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + ratio * (high - low);
            at_right = function(right);
        }
    }
    if at_left < at_right {
        (left, at_left)
    } else {
        (right, at_right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh_of(coefficients: &[f64]) -> Mesh {
        let mut features = Features::default();
        features
            .add_roots(&Polynomial::new(coefficients).unwrap())
            .unwrap();
        features.mesh()
    }

    /// `|s² + 2 zeta s + 1| = level` has two solutions in closed form; a needle is found as surely as a hump.
    #[test]
    fn both_flanks_of_a_resonance_are_found() {
        for zeta in [0.3, 1e-2, 1e-4, 1e-6, 1e-9, 1e-12] {
            let level: f64 = 3.0 * zeta;
            let p = Polynomial::new(&[1.0, 2.0 * zeta, 1.0]).unwrap();
            let found = mesh_of(p.coefficients())
                .crossings(|omega| (p.at(Complex::new(0.0, omega)).norm() / level).ln());
            // (1 - w)^2 + 4 zeta^2 w = level^2 with w = omega^2.
            let middle = 1.0 - 2.0 * zeta * zeta;
            let half = zeta * (5.0 + 4.0 * zeta * zeta).sqrt();
            let wanted = [(middle - half).sqrt(), (middle + half).sqrt()];
            assert_eq!(found.len(), 2, "zeta {zeta}: {found:?}");
            for (found, wanted) in found.iter().zip(wanted) {
                assert!(
                    (found - wanted).abs() < 1e-3 * zeta * wanted.max(1.0) + 1e-15,
                    "{zeta}: {found} {wanted}"
                );
            }
        }
    }

    #[test]
    fn a_curve_that_touches_zero_counts_as_crossing() {
        let mesh = mesh_of(&[1.0, 3.0, 2.0]);
        let touched = mesh.crossings(|omega| (omega.ln() - 0.2).powi(2));
        assert!(
            !touched.is_empty()
                && touched
                    .iter()
                    .all(|omega| (omega - 0.2_f64.exp()).abs() < 1e-6)
        );
        assert!(
            mesh.crossings(|omega| (omega.ln() - 0.2).powi(2) + 1e-9)
                .is_empty()
        );
    }

    #[test]
    fn the_least_value_is_found_between_mesh_points() {
        let (omega, value) =
            mesh_of(&[1.0, 1.0]).least(|omega| 0.25 + (omega.ln() - 0.377).powi(2));
        assert!((omega.ln() - 0.377).abs() < 1e-7 && (value - 0.25).abs() < 1e-14);
    }
}
