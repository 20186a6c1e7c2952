//! Nyquist and Bode curves, sampled where they bend.

use crate::closed_loop::{ClosedLoop, LoopOnAxis};
use crate::roots::RootsError;
use nalgebra::Complex;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The loop gain `L(j omega)` along ascending frequencies. All lists have one length.
///
/// Straight lines between neighbours stay within about a fifth of a per cent of the distance to -1, and within a
/// thirtieth of a decibel: a plot needs nothing in between, and shows no corners.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// Frequencies, rad/s.
    pub omega_rad_s: Vec<f64>,
    /// Real part of `L`.
    pub re: Vec<f64>,
    /// Imaginary part of `L`.
    pub im: Vec<f64>,
    /// `20 log10 |L|`, dB; `None` where `L` is zero.
    pub magnitude_db: Vec<Option<f64>>,
    /// Phase of `L` without jumps, rad, from the phase that the integrators give at the lowest frequency; `None` where
    /// `L` is zero.
    pub phase_rad: Vec<Option<f64>>,
}

/// A chord may miss the curve by this share of the distance to -1.
const CHORD_TOLERANCE: f64 = 2e-3;
/// A chord in a Bode plot may miss the curve by this, in nepers (0.03 dB) and in rad (0.2 degrees).
const BODE_TOLERANCE: f64 = 3e-3;
/// Enough for every sensible plot; a curve with more needles than that is drawn more coarsely, never without end.
const MOST_POINTS: usize = 4000;
/// Halvings of one mesh interval.
const DEEPEST: usize = 6;
/// Every `STRIDE`-th mesh point starts the refinement: the mesh finds extrema, a plot needs less.
const STRIDE: usize = 8;

impl ClosedLoop {
    /// Nyquist and Bode data of `L`; `also_at_rad_s` are points that must be among the samples.
    ///
    /// Frequencies at which `L` has a pole, or is too large for a number, are left out.
    ///
    /// # Errors
    /// Roots are not to be had.
    pub fn curve(&self, also_at_rad_s: &[f64]) -> Result<Curve, RootsError> {
        Ok(self.along_axis()?.curve(also_at_rad_s))
    }
}

impl LoopOnAxis {
    pub(crate) fn curve(&self, also_at_rad_s: &[f64]) -> Curve {
        let mesh = self.mesh.omegas();
        let mut coarse: Vec<f64> = mesh.iter().step_by(STRIDE).copied().collect();
        coarse.extend(mesh.last());
        coarse.extend(
            also_at_rad_s
                .iter()
                .filter(|omega| omega.is_finite() && 0.0 < **omega),
        );
        coarse.sort_by(f64::total_cmp);
        coarse.dedup();
        let mut samples: Vec<(f64, Complex<f64>)> = Vec::with_capacity(2 * coarse.len());
        for pair in coarse.windows(2) {
            let ends = [pair[0], pair[1]].map(|omega| (omega, self.sample(omega)));
            samples.push(ends[0]);
            self.refine(ends, DEEPEST, &mut samples);
        }
        samples.extend(coarse.last().map(|&omega| (omega, self.sample(omega))));
        samples.retain(|(_, gain)| gain.re.is_finite() && gain.im.is_finite());
        self.curve_of(&samples)
    }

    /// `L`, not a number at a pole.
    fn sample(&self, omega_rad_s: f64) -> Complex<f64> {
        self.gain
            .at(omega_rad_s)
            .unwrap_or(Complex::new(f64::NAN, f64::NAN))
    }

    /// Adds what lies strictly between the ends.
    fn refine(
        &self,
        [from, to]: [(f64, Complex<f64>); 2],
        depth: usize,
        samples: &mut Vec<(f64, Complex<f64>)>,
    ) {
        if depth == 0 || MOST_POINTS <= samples.len() {
            return;
        }
        let omega = (from.0 * to.0).sqrt();
        let middle = (omega, self.sample(omega));
        if !(from.0 < omega && omega < to.0) || is_straight(from.1, middle.1, to.1) {
            return;
        }
        self.refine([from, middle], depth - 1, samples);
        samples.push(middle);
        self.refine([middle, to], depth - 1, samples);
    }

    fn curve_of(&self, samples: &[(f64, Complex<f64>)]) -> Curve {
        let mut curve = Curve::default();
        let (numerator, denominator) = (&self.gain.numerator, &self.gain.denominator);
        // At the low end L is k (j omega)^power.
        let power = numerator.roots_at_origin() as f64 - denominator.roots_at_origin() as f64;
        let mut before: Option<f64> = None;
        for &(omega, gain) in samples {
            let polar = self.polar(omega, gain).map(|(magnitude_db, wrapped)| {
                let phase = match before {
                    Some(before) => before + (wrapped - before + PI).rem_euclid(TAU) - PI,
                    None => nearest_turn(wrapped, power * FRAC_PI_2),
                };
                (magnitude_db, phase)
            });
            before = polar.map(|(_, phase)| phase).or(before);
            curve.omega_rad_s.push(omega);
            curve.re.push(gain.re);
            curve.im.push(gain.im);
            curve
                .magnitude_db
                .push(polar.map(|(magnitude_db, _)| magnitude_db));
            curve.phase_rad.push(polar.map(|(_, phase)| phase));
        }
        curve
    }

    /// Magnitude in dB and phase in rad, also where the gain is too small or its square too large for a number; `None`
    /// where it is zero.
    fn polar(&self, omega_rad_s: f64, gain: Complex<f64>) -> Option<(f64, f64)> {
        let size = gain.norm();
        if size.is_normal() {
            return Some((20.0 * size.log10(), gain.arg()));
        }
        let [above, below] =
            [&self.gain.numerator, &self.gain.denominator].map(|p| p.along_axis(omega_rad_s));
        if above.may_be_zero() {
            return None;
        }
        let ln_size =
            above.value.norm().ln() + above.ln_scale - below.value.norm().ln() - below.ln_scale;
        let turn = above.value * below.value.conj();
        Some((20.0 * std::f64::consts::LOG10_E * ln_size, turn.arg()))
    }
}

/// Whether a straight line from end to end is as good as the curve, in a Nyquist and in a Bode plot.
fn is_straight(from: Complex<f64>, middle: Complex<f64>, to: Complex<f64>) -> bool {
    let chord = to - from;
    let along = if 0.0 < chord.norm_sqr() {
        (((middle - from) * chord.conj()).re / chord.norm_sqr()).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let nyquist = (from + chord * along - middle).norm();
    let bode = (middle / from).ln() - (to / middle).ln();
    // NaN, at a pole, asks for refinement.
    nyquist <= CHORD_TOLERANCE * (middle + 1.0).norm() && bode.norm() <= 2.0 * BODE_TOLERANCE
}

/// The angle plus whole turns, nearest to `wanted`.
fn nearest_turn(angle: f64, wanted: f64) -> f64 {
    angle + ((wanted - angle) / TAU).round() * TAU
}
