//! How far a loop without delay is from instability: (33), (34) of [KHMH03], gain margin and phase margin.
//!
//! These are four different answers. (33) is exact for the loop as it is; (34) is only sufficient, and tight; the
//! classical margins each move one thing and hold the rest.

use crate::closed_loop::{ClosedLoop, LoopOnAxis, limits, signed_limits};
use crate::frequency::Contacts;
use crate::roots::RootsError;
use std::f64::consts::{PI, TAU};

/// Least distance of the Nyquist curve from -1 (33).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NyquistDistance {
    /// `inf |1 + L|` over all frequencies, limits at both ends included. Its inverse is the peak of the sensitivity.
    /// Exactly 0 for a loop with a pole on the axis.
    pub distance: f64,
    /// Where; 0 or infinite when the infimum is a limit.
    pub omega_rad_s: f64,
}

/// The small-gain condition (34): `|P| |T_h + rho T_t| < 1` at every frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmallGain {
    /// `sup |L|`; `None` when it is unbounded, as with any integrator in `C_h1` and any resonance without damping.
    pub peak: Option<f64>,
    /// Whether the condition holds. That proves stability only if `L` itself is stable; and a loop may be stable
    /// without it, as most loops here are.
    pub holds: bool,
}

/// Classical margins. Meaningful for a loop that is stable; they say what would make it lose that.
///
/// A curve that touches the negative real axis or the unit circle reaches -1 as well as one that crosses: at the
/// margin, a root lies on the axis. What it comes to at infinite frequency, or the unit circle at rest, is a limit that
/// no turn takes to -1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassicalMargins {
    /// Least factor above 1 on the loop gain that reaches -1; `None` when no increase does.
    pub gain_increase: Option<GainMargin>,
    /// Greatest factor below 1 that reaches -1; `None` when no decrease does.
    pub gain_decrease: Option<GainMargin>,
    /// Least turn of the curve, either way, that reaches -1; `None` when the gain is 1 at no frequency above zero.
    pub phase: Option<PhaseMargin>,
}

/// A factor and where it bites.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainMargin {
    /// Factor on `L`, no unit.
    pub factor: f64,
    /// Phase crossover, rad/s; 0 or infinite where the curve begins or ends on the axis.
    pub omega_rad_s: f64,
}

/// A turn and where it bites.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseMargin {
    /// Angle between `L` and -1, above zero when `L` lags by less than half a turn, rad.
    pub phase_rad: f64,
    /// Gain crossover, rad/s.
    pub omega_rad_s: f64,
}

/// All of them, over one mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Distance of the Nyquist curve from -1, (33).
    pub nyquist: NyquistDistance,
    /// Small-gain margin, (34).
    pub small_gain: SmallGain,
    /// Gain and phase margin.
    pub classical: ClassicalMargins,
}

/// What differs from 1 by less than this cannot be told from it: a quotient of two coefficients, each of a few
/// roundings.
pub(crate) const ROUNDING_OF_ONE: f64 = 16.0 * f64::EPSILON;

impl ClosedLoop {
    /// All margins without delay.
    ///
    /// # Errors
    /// Roots are not to be had.
    pub fn margins(&self) -> Result<Margins, RootsError> {
        Ok(self.along_axis()?.margins())
    }

    /// Least distance from -1 alone, for searches that need nothing else.
    ///
    /// # Errors
    /// Roots are not to be had.
    pub fn least_distance(&self) -> Result<NyquistDistance, RootsError> {
        Ok(self.along_axis()?.nyquist_distance())
    }
}

impl LoopOnAxis {
    pub(crate) fn margins(&self) -> Margins {
        Margins {
            nyquist: self.nyquist_distance(),
            small_gain: self.small_gain(),
            classical: ClassicalMargins {
                phase: self.phase_margin(),
                ..self.gain_margins()
            },
        }
    }

    fn nyquist_distance(&self) -> NyquistDistance {
        if let Some(root) = self.closed_on_axis.first() {
            return NyquistDistance {
                distance: 0.0,
                omega_rad_s: root.omega_rad_s,
            };
        }
        let (omega_rad_s, distance) = self
            .mesh
            .least(|omega| self.return_difference_at(omega).norm());
        let [at_rest, far_up] = limits(&self.c, &self.gain.denominator);
        [(0.0, at_rest), (f64::INFINITY, far_up)].into_iter().fold(
            NyquistDistance {
                distance,
                omega_rad_s,
            },
            |least, (omega_rad_s, distance)| {
                if distance <= least.distance {
                    NyquistDistance {
                        distance,
                        omega_rad_s,
                    }
                } else {
                    least
                }
            },
        )
    }

    fn small_gain(&self) -> SmallGain {
        if !self.gain.poles.is_empty() {
            return SmallGain {
                peak: None,
                holds: false,
            };
        }
        let (omega_rad_s, least_inverse) = self
            .mesh
            .least(|omega| 1.0 / self.gain.raw_at(omega).norm());
        let ends = limits(&self.gain.numerator, &self.gain.denominator);
        let peak = ends.into_iter().fold(1.0 / least_inverse, f64::max);
        let highest = self.gain.magnitude(omega_rad_s);
        SmallGain {
            peak: peak.is_finite().then_some(peak),
            holds: highest.is_decided
                && highest.value < 0.0
                && ends.iter().all(|end| *end < 1.0 - ROUNDING_OF_ONE),
        }
    }

    fn gain_margins(&self) -> ClassicalMargins {
        let gain = &self.gain;
        // The curve may begin or end on the negative real axis, where no crossing shows it.
        let limits = signed_limits(&gain.numerator, &gain.denominator)
            .into_iter()
            .zip([0.0, f64::INFINITY])
            .filter_map(|(limit, omega)| Some((omega, limit?)));
        let mut met = match self.real_axis() {
            Contacts::At(omegas) => omegas,
            Contacts::Everywhere => self.nearest_of_a_real_curve(),
        };
        met.retain(|&omega| !self.passes_minus_one_at(omega));
        let through = self
            .closed_on_axis
            .iter()
            .map(|root| (root.omega_rad_s, -1.0));
        let within = met.into_iter().map(|omega| (omega, gain.raw_at(omega).re));
        let margins: Vec<GainMargin> = through
            .chain(within)
            .chain(limits)
            .filter(|(_, real)| *real < 0.0)
            .map(|(omega_rad_s, real)| GainMargin {
                factor: -1.0 / real,
                omega_rad_s,
            })
            .collect();
        let is_increase = |margin: &&GainMargin| 1.0 - ROUNDING_OF_ONE <= margin.factor;
        let by_factor = |a: &&GainMargin, b: &&GainMargin| a.factor.total_cmp(&b.factor);
        ClassicalMargins {
            gain_increase: margins
                .iter()
                .filter(is_increase)
                .min_by(by_factor)
                .map(|margin| GainMargin {
                    factor: margin.factor.max(1.0),
                    ..*margin
                }),
            gain_decrease: margins
                .iter()
                .filter(|margin| !is_increase(margin))
                .max_by(by_factor)
                .copied(),
            phase: None,
        }
    }

    /// Whether a contact is the one that a root of the loop on the axis makes: the factor there is 1, and is not to be
    /// worked out from a place that rounding smears.
    fn passes_minus_one_at(&self, omega_rad_s: f64) -> bool {
        const SMEARED: f64 = 1e-6;
        self.closed_on_axis
            .iter()
            .any(|root| (omega_rad_s / root.omega_rad_s - 1.0).abs() < SMEARED)
    }

    /// Where the curve crosses or touches the real axis; zeros and poles on the axis aside.
    fn real_axis(&self) -> Contacts {
        self.mesh.contacts(
            |omega| self.gain.sine(omega),
            |low, high| self.gain.has_root_between(low, high),
        )
    }

    /// Where the curve meets the unit circle.
    fn unit_circle(&self) -> Contacts {
        self.mesh
            .contacts(|omega| self.gain.magnitude(omega), |_, _| false)
    }

    /// A curve that is real at every frequency, a constant or `1/(s² + 1)`: where it passes -1 and, either side of it,
    /// comes nearest.
    fn nearest_of_a_real_curve(&self) -> Vec<f64> {
        if self.gain.numerator.is_zero() {
            return Vec::new();
        }
        let distance = |omega: f64, side: f64| {
            let gain = self.gain.raw_at(omega).re;
            let distance = side * (-gain).ln();
            // NaN for what is above zero.
            if 0.0 <= distance {
                distance
            } else {
                f64::INFINITY
            }
        };
        let mut found = match self.unit_circle() {
            Contacts::At(omegas) => omegas,
            Contacts::Everywhere => Vec::new(),
        };
        found.retain(|&omega| self.gain.raw_at(omega).re < 0.0);
        if found.is_empty() {
            found.extend([1.0, -1.0].map(|side| self.mesh.least(|omega| distance(omega, side)).0));
        }
        found
    }

    fn phase_margin(&self) -> Option<PhaseMargin> {
        if let Some(root) = self.closed_on_axis.first() {
            return Some(PhaseMargin {
                phase_rad: 0.0,
                omega_rad_s: root.omega_rad_s,
            });
        }
        let margin_at = |omega_rad_s: f64| PhaseMargin {
            phase_rad: (self.gain.raw_at(omega_rad_s).arg() + TAU).rem_euclid(TAU) - PI,
            omega_rad_s,
        };
        match self.unit_circle() {
            Contacts::At(omegas) => omegas
                .into_iter()
                .map(margin_at)
                .min_by(|a, b| a.phase_rad.abs().total_cmp(&b.phase_rad.abs())),
            // A filter that only turns the phase: any frequency may be the one.
            Contacts::Everywhere => {
                let turn = |omega: f64| margin_at(omega).phase_rad.abs();
                Some(margin_at(self.mesh.least(turn).0))
            }
        }
    }
}
