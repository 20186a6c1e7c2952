//! Where to look along the frequency axis.
//!
//! In `x = ln omega` a factor `j omega - r` is smooth except at the complex point `ln|r| + j theta`, where `theta` is
//! the angle between the root and the imaginary axis. So a mesh whose step stays a fraction of the distance to the
//! nearest such point sees every resonance, however sharp, and wastes nothing elsewhere. Crossings and extrema are then
//! enclosed between neighbours and found by halving: a bounded number of evaluations, whatever the curve.

use crate::axis::Sample;
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
pub(crate) struct Features {
    points: Vec<Feature>,
    /// Bounds on `ln omega` of what is looked for.
    ranges: Vec<[f64; 2]>,
}

/// Where a function along the axis meets zero, by crossing it or by touching it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Contacts {
    /// At these frequencies, rad/s, ascending.
    At(Vec<f64>),
    /// Nowhere can it be told from zero.
    Everywhere,
}

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
                self.points.push(Feature {
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
                self.points.push(Feature {
                    x,
                    theta: FRAC_PI_2,
                });
            }
        }
    }

    /// Bounds on `ln omega`, between which something is looked for that may lie far from every feature.
    pub(crate) fn add_range(&mut self, ln_range: Option<[f64; 2]>) {
        self.ranges.extend(ln_range);
    }

    pub(crate) fn mesh(&self) -> Mesh {
        /// The mesh passes a range by this much, in `ln omega`, so that the ends are told from what lies within.
        const BEYOND: f64 = 3.0;
        let clamp = |x: f64| x.clamp(LOWEST_RAD_S.ln(), HIGHEST_RAD_S.ln());
        let points = self.points.iter().map(|f| f.x);
        let low = points.clone().reduce(f64::min).unwrap_or(0.0) - REACH.ln();
        let high = points.reduce(f64::max).unwrap_or(0.0) + REACH.ln();
        let low = self
            .ranges
            .iter()
            .fold(low, |low, r| low.min(r[0] - BEYOND));
        let high = self
            .ranges
            .iter()
            .fold(high, |high, r| high.max(r[1] + BEYOND));
        let (mut x, end) = (clamp(low), clamp(high));
        let mut omegas = Vec::new();
        while x < end {
            omegas.push(x.exp());
            let distance = self.points.iter().fold(f64::INFINITY, |least, f| {
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

    /// Where a real function of the frequency passes through zero or touches it, above rest and below infinity.
    ///
    /// Only values that are told from zero decide. Between two neighbours of different signs the function crosses.
    /// Between two of one sign it touches if it cannot be told from zero somewhere between. What it does below the
    /// first and above the last of them is a limit and no contact. `is_barred` names stretches, by both ends, in which
    /// zero means something else.
    pub(crate) fn contacts(
        &self,
        function: impl Fn(f64) -> Sample,
        is_barred: impl Fn(f64, f64) -> bool,
    ) -> Contacts {
        let search = Search {
            function: |omega| {
                let sample = function(omega);
                Sample {
                    // What is not a number counts as far from zero.
                    value: if sample.value.is_nan() {
                        f64::INFINITY
                    } else {
                        sample.value
                    },
                    ..sample
                }
            },
            is_barred,
        };
        let samples: Vec<(f64, Sample)> = self
            .omegas
            .iter()
            .map(|&omega| (omega, (search.function)(omega)))
            .collect();
        let decided: Vec<usize> = (0..samples.len())
            .filter(|&at| samples[at].1.is_decided)
            .collect();
        if decided.is_empty() {
            return Contacts::Everywhere;
        }
        let mut found = Vec::new();
        for pair in decided.windows(2) {
            let (from, to) = (samples[pair[0]], samples[pair[1]]);
            if pair[0] + 1 < pair[1] {
                let inner = [samples[pair[0] + 1].0, samples[pair[1] - 1].0];
                found.extend(search.undecided(from.0, inner, to.0));
            } else if is_negative(from) != is_negative(to) {
                found.extend(search.crossing(from.0, to.0));
            }
        }
        for triple in samples.windows(3) {
            found.extend(search.between(triple));
        }
        found.sort_by(f64::total_cmp);
        Contacts::At(found)
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

fn is_negative((_, sample): (f64, Sample)) -> bool {
    sample.value < 0.0
}

/// A function whose contacts with zero are looked for between points of a mesh.
struct Search<F, B> {
    function: F,
    is_barred: B,
}

impl<F: Fn(f64) -> Sample, B: Fn(f64, f64) -> bool> Search<F, B> {
    /// The contact in a stretch whose inner points cannot be told from zero.
    fn undecided(&self, low: f64, [first, last]: [f64; 2], high: f64) -> Option<f64> {
        let edge = |decided: f64, undecided: f64| {
            let (mut decided, mut undecided) = (decided, undecided);
            for _ in 0..HALVINGS {
                let middle = decided + (undecided - decided) / 2.0;
                if (self.function)(middle).is_decided {
                    decided = middle;
                } else {
                    undecided = middle;
                }
            }
            decided
        };
        let (low, high) = (edge(low, first), edge(high, last));
        // The function is as far from zero at one edge as at the other, so its zero is in the middle.
        (!(self.is_barred)(low, high)).then(|| (low * high).sqrt())
    }

    fn crossing(&self, low: f64, high: f64) -> Option<f64> {
        let omega = halve(|omega| (self.function)(omega).value, low, high);
        (!(self.is_barred)(omega, omega)).then_some(omega)
    }

    /// What three neighbours of one sign hide around the middle one, if that is the nearest to zero.
    fn between(&self, triple: &[(f64, Sample)]) -> Vec<f64> {
        let sizes = [0, 1, 2].map(|at| triple[at].1.value.abs());
        let is_plain = triple.iter().all(|point| point.1.is_decided)
            && triple
                .iter()
                .all(|&point| is_negative(point) == is_negative(triple[1]));
        if !(is_plain && sizes[1] <= sizes[0] && sizes[1] <= sizes[2]) {
            return Vec::new();
        }
        let (low, high) = (triple[0].0, triple[2].0);
        let side = triple[1].1.value.signum();
        let (omega, least) = lowest_point(|omega| side * (self.function)(omega).value, low, high);
        if !(self.function)(omega).is_decided {
            self.undecided(low, [omega, omega], high)
                .into_iter()
                .collect()
        } else if least < 0.0 {
            let pair = [self.crossing(low, omega), self.crossing(omega, high)];
            pair.into_iter().flatten().collect()
        } else {
            Vec::new()
        }
    }
}

/// More than the bits of a number.
const HALVINGS: usize = 64;

/// Halves an interval with a change of sign down to neighbouring numbers.
fn halve(function: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
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
            let level_squared = Polynomial::constant(level).unwrap();
            let contacts = mesh_of(p.coefficients()).contacts(
                |omega| {
                    let value = (p.at(Complex::new(0.0, omega)).norm() / level).ln();
                    p.along_axis(omega)
                        .is_larger(&level_squared.along_axis(omega), value)
                },
                |_, _| false,
            );
            let Contacts::At(found) = contacts else {
                panic!("zeta {zeta}: everywhere");
            };
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

    /// A value that is known to 1e-13.
    fn known(value: f64) -> Sample {
        Sample {
            value,
            is_decided: 1e-13 < value.abs(),
        }
    }

    fn contacts_of(function: impl Fn(f64) -> f64) -> Contacts {
        mesh_of(&[1.0, 3.0, 2.0]).contacts(|omega| known(function(omega)), |_, _| false)
    }

    #[test]
    fn a_curve_that_touches_zero_meets_it_and_one_that_only_nears_it_does_not() {
        for power in [2, 4, 6] {
            let Contacts::At(touched) = contacts_of(|omega| (omega.ln() - 0.2).powi(power)) else {
                panic!("everywhere");
            };
            assert!(
                !touched.is_empty()
                    && touched
                        .iter()
                        .all(|omega| (omega - 0.2_f64.exp()).abs() < 1e-6),
                "{power}: {touched:?}"
            );
        }
        let apart = contacts_of(|omega| (omega.ln() - 0.2).powi(2) + 1e-9);
        assert_eq!(apart, Contacts::At(Vec::new()));
    }

    /// What a curve comes to at rest or at infinity is a limit: only what lies between is a contact.
    #[test]
    fn limits_are_no_contacts() {
        assert_eq!(contacts_of(|omega| omega.powi(6)), Contacts::At(Vec::new()));
        assert_eq!(
            contacts_of(|omega| -omega.powi(-6)),
            Contacts::At(Vec::new())
        );
        assert_eq!(contacts_of(|_| 1e-15), Contacts::Everywhere);
    }

    /// A stretch may be barred, and only contacts within it are left out.
    #[test]
    fn a_barred_stretch_holds_no_contact() {
        let mesh = mesh_of(&[1.0, 3.0, 2.0]);
        let product = |omega: f64| known((omega - 0.5) * (omega - 3.0));
        let found = mesh.contacts(product, |low, high| low <= 0.5 && 0.5 <= high + 1e-12);
        let Contacts::At(found) = found else {
            panic!("everywhere");
        };
        assert!(
            matches!(found[..], [only] if (only - 3.0).abs() < 1e-12),
            "{found:?}"
        );
    }

    #[test]
    fn the_least_value_is_found_between_mesh_points() {
        let (omega, value) =
            mesh_of(&[1.0, 1.0]).least(|omega| 0.25 + (omega.ln() - 0.377).powi(2));
        assert!((omega.ln() - 0.377).abs() < 1e-7 && (value - 0.25).abs() < 1e-14);
    }
}
