//! The search behind [`super::propose`]: candidates, what they fail at, and how light they may get.

use super::{ClayPoint, Obstacle, Proposal, TuningError, TuningTarget};
use crate::closed_loop::{ClosedLoop, LoopError};
use crate::compensators::{Sides, compensators};
use crate::delay::{DelayMargin, NoMargin};
use crate::paper;
use crate::polynomial::Polynomial;
use crate::rational::{RationalError, RationalFunction};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// `M / B` in s: from a handle that is nearly pure damping to one that coasts for seconds.
const SHAPES_S: [f64; 11] = [
    0.005, 0.01, 0.02, 0.04, 0.07, 0.12, 0.2, 0.35, 0.6, 1.0, 2.0,
];
/// Lightest handle looked at, as a share of the heaviest.
const LIGHTEST_SHARE: f64 = 1e-4;
/// Steps downwards from the heaviest, then halvings of the last one.
const STEPS: usize = 16;
const HALVINGS: usize = 8;
/// Clay values per range when a candidate is checked over the whole range, ends included.
pub(super) const CHECKED: usize = 7;
/// How often the whole-range check may add a clay to the search.
pub(super) const ROUNDS: usize = 6;

/// A candidate's behaviour over the whole clay range.
pub(super) enum Assessment {
    Fulfils(Proposal),
    Fails { clay: ClayPoint, obstacle: Obstacle },
}

/// A candidate's behaviour in one clay.
struct Verdict {
    distance: f64,
    delay_margin: DelayMargin,
    obstacle: Option<Obstacle>,
}

/// A search under way, which asks before each candidate in each clay whether to go on.
pub(super) struct Search<'a> {
    pub(super) target: &'a TuningTarget,
    pub(super) go_on: &'a mut dyn FnMut() -> ControlFlow<()>,
}

impl TuningTarget {
    /// A grid over the clay ranges, `per_range` values each, ends included.
    pub(super) fn clays(&self, per_range: usize) -> Vec<ClayPoint> {
        let values = |[low, high]: [f64; 2]| -> Vec<f64> {
            if low < high {
                (0..per_range)
                    .map(|i| low + (high - low) * i as f64 / (per_range - 1) as f64)
                    .collect()
            } else {
                vec![low]
            }
        };
        let stiffnesses = values(self.clay_stiffness_n_per_m);
        values(self.clay_damping_n_s_per_m)
            .into_iter()
            .flat_map(|damping_n_s_per_m| {
                stiffnesses.iter().map(move |&stiffness_n_per_m| ClayPoint {
                    damping_n_s_per_m,
                    stiffness_n_per_m,
                })
            })
            .collect()
    }

    fn sides(&self, candidate: Candidate) -> Result<Sides, TuningError> {
        let sides = Sides {
            g_h: self.g_h.clone(),
            s_h: self.s_h.clone(),
            g_t: self.g_t.clone(),
            s_t: self.s_t.clone(),
            c_h1: candidate.c_h1()?,
            position_ratio: self.position_ratio,
            force_ratio: self.force_ratio,
        };
        compensators(&sides).map_err(TuningError::Compensator)?;
        Ok(sides)
    }

    pub(super) fn not_within(&self, candidate: Candidate, obstacle: Obstacle) -> TuningError {
        TuningError::NotWithin {
            heaviest_n_s_per_m: self.heaviest_n_s_per_m,
            mass_kg: candidate.mass_kg(),
            damping_n_s_per_m: candidate.damping_n_s_per_m(),
            obstacle,
        }
    }
}

impl Search<'_> {
    /// Lightest candidate over all shapes that does in these clays.
    pub(super) fn lightest(&mut self, clays: &[ClayPoint]) -> Result<Candidate, TuningError> {
        let mut best: Option<Candidate> = None;
        let mut least_bad: Option<(f64, Candidate, Obstacle)> = None;
        for shape_s in SHAPES_S {
            let heaviest = Candidate {
                shape_s,
                impedance_n_s_per_m: self.target.heaviest_n_s_per_m,
            };
            if let Some((distance, obstacle)) = self.first_obstacle(heaviest, clays)? {
                if least_bad
                    .as_ref()
                    .is_none_or(|(least, ..)| *least < distance)
                {
                    least_bad = Some((distance, heaviest, obstacle));
                }
                continue;
            }
            let found = self.lighten(heaviest, clays, best)?;
            if best.is_none_or(|best| found.impedance_n_s_per_m < best.impedance_n_s_per_m) {
                best = Some(found);
            }
        }
        if let Some(best) = best {
            return Ok(best);
        }
        let (_, candidate, obstacle) =
            least_bad.expect("a shape that does not do leaves its obstacle");
        Err(self.target.not_within(candidate, obstacle))
    }

    /// Goes down from a candidate that does; stops where a step no longer does, and halves that step.
    fn lighten(
        &mut self,
        from: Candidate,
        clays: &[ClayPoint],
        rival: Option<Candidate>,
    ) -> Result<Candidate, TuningError> {
        let at = |impedance_n_s_per_m: f64| Candidate {
            impedance_n_s_per_m,
            ..from
        };
        let ratio = LIGHTEST_SHARE.powf(1.0 / STEPS as f64);
        let mut good = from.impedance_n_s_per_m;
        let mut bad = None;
        for _ in 0..STEPS {
            let next = good * ratio;
            if self.first_obstacle(at(next), clays)?.is_some() {
                bad = Some(next);
                break;
            }
            good = next;
        }
        let Some(mut bad) = bad else {
            return Ok(at(good));
        };
        // No halving of this step can beat a rival that is already lighter than its lower end.
        if rival.is_some_and(|rival| rival.impedance_n_s_per_m <= bad) {
            return Ok(at(good));
        }
        for _ in 0..HALVINGS {
            let middle = (good * bad).sqrt();
            if self.first_obstacle(at(middle), clays)?.is_some() {
                bad = middle;
            } else {
                good = middle;
            }
        }
        Ok(at(good))
    }

    /// The first clay in which a candidate fails, with the distance that it keeps there.
    fn first_obstacle(
        &mut self,
        candidate: Candidate,
        clays: &[ClayPoint],
    ) -> Result<Option<(f64, Obstacle)>, TuningError> {
        for &clay in clays {
            let verdict = self.verdict(candidate, clay)?;
            if let Some(obstacle) = verdict.obstacle {
                return Ok(Some((verdict.distance, obstacle)));
            }
        }
        Ok(None)
    }

    /// Checks a candidate over the whole clay range: a proposal, or a clay in which it fails.
    pub(super) fn assess(&mut self, candidate: Candidate) -> Result<Assessment, TuningError> {
        let mut proposal = Proposal {
            mass_kg: candidate.mass_kg(),
            damping_n_s_per_m: candidate.damping_n_s_per_m(),
            c_h1: candidate.c_h1()?,
            distance: f64::INFINITY,
            delay_margin: DelayMargin::Unbounded,
            impedance_n_s_per_m: candidate.impedance_n_s_per_m,
        };
        for clay in self.target.clays(CHECKED) {
            let verdict = self.verdict(candidate, clay)?;
            if let Some(obstacle) = verdict.obstacle {
                return Ok(Assessment::Fails { clay, obstacle });
            }
            proposal.distance = proposal.distance.min(verdict.distance);
            let shorter = match (
                verdict.delay_margin.seconds(),
                proposal.delay_margin.seconds(),
            ) {
                (Some(this), Some(least)) => this < least,
                (Some(_), None) => true,
                (None, _) => false,
            };
            if shorter {
                proposal.delay_margin = verdict.delay_margin;
            }
        }
        Ok(Assessment::Fulfils(proposal))
    }

    fn verdict(&mut self, candidate: Candidate, clay: ClayPoint) -> Result<Verdict, TuningError> {
        if (self.go_on)().is_break() {
            return Err(TuningError::CalledOff);
        }
        let sides = self.target.sides(candidate)?;
        let t_t = Polynomial::new(&[clay.damping_n_s_per_m, clay.stiffness_n_per_m])
            .map_err(LoopError::Polynomial)?;
        let closed_loop = ClosedLoop::new(&sides, &self.target.t_h, &t_t)?;
        let delay_margin = closed_loop.delay_margin(self.target.scheme)?;
        let failed = |distance, obstacle| {
            Ok(Verdict {
                distance,
                delay_margin,
                obstacle: Some(obstacle),
            })
        };
        match delay_margin {
            DelayMargin::None(NoMargin::UnstableWithoutDelay) => {
                return failed(-1.0, Obstacle::Unstable { clay });
            }
            DelayMargin::None(NoMargin::UnstableAdmittance) => {
                return failed(-1.0, Obstacle::UnstableAdmittance);
            }
            DelayMargin::Finite { seconds, .. } if seconds <= self.target.round_trip_s => {
                let obstacle = Obstacle::Delay {
                    margin_s: seconds,
                    wanted_s: self.target.round_trip_s,
                    clay,
                };
                // Ranks behind every stable candidate, and the sooner lost the further.
                return failed(seconds / self.target.round_trip_s - 1.0, obstacle);
            }
            DelayMargin::Finite { .. } | DelayMargin::Unbounded => {}
        }
        let distance =
            closed_loop.least_distance_within(self.target.scheme, self.target.round_trip_s)?;
        let obstacle = (distance < self.target.distance).then_some(Obstacle::Distance {
            got: distance,
            wanted: self.target.distance,
            clay,
        });
        Ok(Verdict {
            distance,
            delay_margin,
            obstacle,
        })
    }
}

/// A handle, by the shape `M / B` and its impedance at 1 Hz.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    shape_s: f64,
    impedance_n_s_per_m: f64,
}

impl Candidate {
    fn damping_n_s_per_m(self) -> f64 {
        self.impedance_n_s_per_m / (TAU * self.shape_s).hypot(1.0)
    }

    fn mass_kg(self) -> f64 {
        self.damping_n_s_per_m() * self.shape_s
    }

    fn c_h1(self) -> Result<RationalFunction, TuningError> {
        let refused = |source: RationalError| TuningError::Loop(LoopError::Admittance(source));
        paper::c_h1(self.mass_kg(), self.damping_n_s_per_m()).map_err(refused)
    }
}
