//! How far a loop without delay is from instability: (33), (34) of [KHMH03], gain margin and phase margin.
//!
//! These are four different answers. (33) is exact for the loop as it is; (34) is only sufficient, and tight; the
//! classical margins each move one thing and hold the rest.

use crate::closed_loop::{ClosedLoop, limits, signed_limits};
use crate::frequency::Mesh;
use crate::roots::RootsError;
use std::f64::consts::{PI, TAU};

/// Least distance of the Nyquist curve from -1 (33).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NyquistDistance {
    /// `inf |1 + L|` over all frequencies, limits at both ends included. Its inverse is the peak of the sensitivity.
    pub distance: f64,
    /// Where; 0 or infinite when the infimum is a limit.
    pub omega_rad_s: f64,
}

/// The small-gain condition (34): `|P| |T_h + rho T_t| < 1` at every frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmallGain {
    /// `sup |L|`; `None` when it is unbounded, as with any integrator in `C_h1`.
    pub peak: Option<f64>,
    /// Whether the condition holds. That proves stability only if `L` itself is stable; and a loop may be stable
    /// without it, as most loops here are.
    pub holds: bool,
}

/// Classical margins. Meaningful for a loop that is stable; they say what would make it lose that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassicalMargins {
    /// Least factor above 1 on the loop gain that reaches -1; `None` when no increase does.
    pub gain_increase: Option<GainMargin>,
    /// Greatest factor below 1 that reaches -1; `None` when no decrease does.
    pub gain_decrease: Option<GainMargin>,
    /// Least turn of the curve, either way, that reaches -1; `None` when the gain never passes 1.
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
    /// (33).
    pub nyquist: NyquistDistance,
    /// (34).
    pub small_gain: SmallGain,
    /// Gain and phase margin.
    pub classical: ClassicalMargins,
}

impl ClosedLoop {
    /// All margins without delay.
    ///
    /// # Errors
    /// Roots are not to be had.
    pub fn margins(&self) -> Result<Margins, RootsError> {
        let mesh = self.mesh()?;
        Ok(Margins {
            nyquist: self.nyquist_distance(&mesh),
            small_gain: self.small_gain(&mesh),
            classical: self.classical_margins(&mesh),
        })
    }

    /// Least distance from -1 alone, for searches that need nothing else.
    ///
    /// # Errors
    /// Roots are not to be had.
    pub fn least_distance(&self) -> Result<NyquistDistance, RootsError> {
        Ok(self.nyquist_distance(&self.mesh()?))
    }

    fn nyquist_distance(&self, mesh: &Mesh) -> NyquistDistance {
        let (omega_rad_s, distance) = mesh.least(|omega| self.return_difference_at(omega).norm());
        let [at_rest, far_up] = limits(&self.c, &self.d);
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

    fn small_gain(&self, mesh: &Mesh) -> SmallGain {
        let (_, least_inverse) = mesh.least(|omega| 1.0 / self.gain_at(omega).norm());
        let ends = limits(&self.n_l, &self.d);
        let peak = ends.into_iter().fold(1.0 / least_inverse, f64::max);
        SmallGain {
            peak: peak.is_finite().then_some(peak),
            holds: peak < 1.0,
        }
    }

    fn classical_margins(&self, mesh: &Mesh) -> ClassicalMargins {
        let mut gain_margins: Vec<GainMargin> = mesh
            .crossings(|omega| self.gain_at(omega).arg().sin())
            .into_iter()
            .map(|omega| (omega, self.gain_at(omega)))
            // A pole on the axis turns the curve by half at once without passing the real axis.
            .filter(|(_, gain)| gain.re < 0.0 && gain.im.abs() < 1e-6 * gain.re.abs())
            .map(|(omega_rad_s, gain)| GainMargin {
                factor: -1.0 / gain.re,
                omega_rad_s,
            })
            .collect();
        // The curve may also begin or end on the negative real axis, where no crossing shows it.
        for (limit, omega_rad_s) in signed_limits(&self.n_l, &self.d)
            .into_iter()
            .zip([0.0, f64::INFINITY])
        {
            if let Some(limit) = limit.filter(|limit| *limit < 0.0) {
                gain_margins.push(GainMargin {
                    factor: -1.0 / limit,
                    omega_rad_s,
                });
            }
        }
        let phase = mesh
            .crossings(|omega| self.gain_at(omega).norm().ln())
            .into_iter()
            .map(|omega_rad_s| {
                let phase_rad = (self.gain_at(omega_rad_s).arg() + TAU).rem_euclid(TAU) - PI;
                PhaseMargin {
                    phase_rad,
                    omega_rad_s,
                }
            })
            .min_by(|a, b| a.phase_rad.abs().total_cmp(&b.phase_rad.abs()));
        let by_factor = |a: &&GainMargin, b: &&GainMargin| a.factor.total_cmp(&b.factor);
        ClassicalMargins {
            gain_increase: gain_margins
                .iter()
                .filter(|m| 1.0 <= m.factor)
                .min_by(by_factor)
                .copied(),
            gain_decrease: gain_margins
                .iter()
                .filter(|m| m.factor < 1.0)
                .max_by(by_factor)
                .copied(),
            phase,
        }
    }
}
