//! Proposes `C_h1 = 1 / (M s² + B s)` for a wish, or says why there is none.
//!
//! Of all handles that keep the wanted distance for every clay and every delay in range, the lightest is proposed:
//! least impedance `|j w M + B|` at one cycle per second, about where a hand works. The shape `M / B` is scanned; along
//! each shape the impedance is lowered from the heaviest that is allowed until something gives way.

use crate::closed_loop::{ClosedLoop, LoopError};
use crate::compensators::{CompensatorError, Sides, compensators};
use crate::delay::{DelayMargin, DelayedScheme, NoMargin};
use crate::paper;
use crate::polynomial::Polynomial;
use crate::rational::{RationalError, RationalFunction};
use std::f64::consts::TAU;

/// What is wanted, and of which plants.
#[derive(Clone, Debug, PartialEq)]
pub struct Wish {
    /// Handle servo.
    pub g_h: RationalFunction,
    /// Handle's give.
    pub s_h: RationalFunction,
    /// Tool actuator.
    pub g_t: RationalFunction,
    /// Tool's give.
    pub s_t: RationalFunction,
    /// `A_h1`, above zero.
    pub position_ratio: f64,
    /// `A_h2`, below zero.
    pub force_ratio: f64,
    /// The operator's arm, N per metre.
    pub t_h: Polynomial,
    /// Least and greatest viscous answer of the clay, N·s/m.
    pub clay_damping_n_s_per_m: [f64; 2],
    /// Least and greatest elastic answer of the clay, N/m.
    pub clay_stiffness_n_per_m: [f64; 2],
    /// What crosses the network.
    pub scheme: DelayedScheme,
    /// Longest round trip, s; every shorter one must do too.
    pub round_trip_s: f64,
    /// Wanted distance of the characteristic function from zero, between 0 and 1: (33), with any of the delays in it.
    pub distance: f64,
    /// Heaviest handle to put up with: impedance at 1 Hz, N·s/m.
    pub heaviest_n_s_per_m: f64,
}

/// Mass and damping that fulfil a [`Wish`].
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// `M`, kg.
    pub mass_kg: f64,
    /// `B`, N·s/m.
    pub damping_n_s_per_m: f64,
    /// `1 / (M s² + B s)`.
    pub c_h1: RationalFunction,
    /// What it keeps in the least favourable clay, over every delay up to the wish's.
    pub distance: f64,
    /// Shortest delay margin over the clay range.
    pub delay_margin: DelayMargin,
    /// Impedance at 1 Hz, N·s/m.
    pub impedance_n_s_per_m: f64,
}

/// A kind of clay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClayPoint {
    /// N·s/m.
    pub damping_n_s_per_m: f64,
    /// N/m.
    pub stiffness_n_per_m: f64,
}

/// Where even the heaviest handle allowed fails, at the shape that fails least.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Obstacle {
    /// Not stable even without a network.
    #[error("unstable without delay in clay of {} N s/m and {} N/m", clay.damping_n_s_per_m, clay.stiffness_n_per_m)]
    Unstable {
        /// Least favourable clay.
        clay: ClayPoint,
    },
    /// The two copies of the admittance part: the handle's own servo is not stable.
    #[error(
        "the handle's servo is not stable by itself, and force exchange keeps a copy on either side"
    )]
    UnstableAdmittance,
    /// Stable, yet not over the whole round trip.
    #[error(
        "stable up to a round trip of {margin_s} s, wanted {wanted_s} s, in clay of {} N s/m and {} N/m",
        clay.damping_n_s_per_m,
        clay.stiffness_n_per_m
    )]
    Delay {
        /// What it bears, s.
        margin_s: f64,
        /// What was wanted, s.
        wanted_s: f64,
        /// Least favourable clay.
        clay: ClayPoint,
    },
    /// Stable, yet nearer to instability than wanted.
    #[error(
        "distance {got} from instability, wanted {wanted}, in clay of {} N s/m and {} N/m",
        clay.damping_n_s_per_m,
        clay.stiffness_n_per_m
    )]
    Distance {
        /// What is kept.
        got: f64,
        /// What was wanted.
        wanted: f64,
        /// Least favourable clay.
        clay: ClayPoint,
    },
}

/// Why there is no proposal.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TuningError {
    /// A number of the wish is out of range.
    #[error("{quantity} is {got}, need {need}")]
    OutOfRange {
        /// Its name.
        quantity: &'static str,
        /// As given.
        got: f64,
        /// Its range, in words.
        need: &'static str,
    },
    /// Every curve ends at distance 1 where the loop has died out.
    #[error(
        "a distance of {wanted} cannot be kept: far above the servo's band every loop is at distance 1 or less"
    )]
    DistanceBeyondReach {
        /// As wished.
        wanted: f64,
    },
    /// No machine could run the compensators.
    #[error("no mass and damping make the compensators proper: {0}")]
    Compensator(#[source] CompensatorError),
    /// The loop cannot be formed.
    #[error(transparent)]
    Loop(#[from] LoopError),
    /// Even the heaviest handle allowed is not enough.
    #[error(
        "no handle up to {heaviest_n_s_per_m} N s/m at 1 Hz will do: with {mass_kg} kg and {damping_n_s_per_m} N s/m, {obstacle}"
    )]
    NotWithin {
        /// The limit of the wish.
        heaviest_n_s_per_m: f64,
        /// Shape that fails least.
        mass_kg: f64,
        /// Shape that fails least.
        damping_n_s_per_m: f64,
        /// What it fails at.
        obstacle: Obstacle,
    },
}

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
const CHECKED: usize = 7;
/// How often the whole-range check may add a clay to the search.
const ROUNDS: usize = 6;

/// A candidate's behaviour over the whole clay range.
enum Assessment {
    Fulfils(Proposal),
    Fails { clay: ClayPoint, obstacle: Obstacle },
}

/// A candidate's behaviour in one clay.
struct Verdict {
    distance: f64,
    delay_margin: DelayMargin,
    obstacle: Option<Obstacle>,
}

/// The lightest handle that fulfils the wish in every clay and at every delay.
///
/// # Errors
/// The wish is out of range, or cannot be fulfilled: the error says what stands against it.
pub fn propose(wish: &Wish) -> Result<Proposal, TuningError> {
    wish.require_ranges()?;
    let mut clays = wish.clays(2);
    for _ in 0..ROUNDS {
        match wish.assess(wish.lightest(&clays)?)? {
            Assessment::Fulfils(proposal) => return Ok(proposal),
            // The ends of the range were not the worst of it: search again with this clay among them.
            Assessment::Fails { clay, .. } => clays.push(clay),
        }
    }
    // Clays keep turning up between the known ones: let the whole grid decide.
    let candidate = wish.lightest(&wish.clays(CHECKED))?;
    match wish.assess(candidate)? {
        Assessment::Fulfils(proposal) => Ok(proposal),
        Assessment::Fails { obstacle, .. } => Err(wish.not_within(candidate, obstacle)),
    }
}

impl Wish {
    fn require_ranges(&self) -> Result<(), TuningError> {
        let not_negative = "a finite number not below zero";
        let checks = [
            (
                "clay_damping_n_s_per_m",
                self.clay_damping_n_s_per_m[0],
                not_negative,
            ),
            (
                "clay_stiffness_n_per_m",
                self.clay_stiffness_n_per_m[0],
                not_negative,
            ),
            ("round_trip_s", self.round_trip_s, not_negative),
        ];
        for (quantity, got, need) in checks {
            if !(got.is_finite() && 0.0 <= got) {
                return Err(TuningError::OutOfRange {
                    quantity,
                    got,
                    need,
                });
            }
        }
        for (quantity, [low, got]) in [
            ("clay_damping_n_s_per_m", self.clay_damping_n_s_per_m),
            ("clay_stiffness_n_per_m", self.clay_stiffness_n_per_m),
        ] {
            if !(got.is_finite() && low <= got) {
                return Err(TuningError::OutOfRange {
                    quantity,
                    got,
                    need: "a finite number not below the least",
                });
            }
        }
        for (quantity, got) in [
            ("distance", self.distance),
            ("heaviest_n_s_per_m", self.heaviest_n_s_per_m),
        ] {
            if !(got.is_finite() && 0.0 < got) {
                return Err(TuningError::OutOfRange {
                    quantity,
                    got,
                    need: "a finite number above zero",
                });
            }
        }
        if 1.0 <= self.distance {
            return Err(TuningError::DistanceBeyondReach {
                wanted: self.distance,
            });
        }
        Ok(())
    }

    /// A grid over the clay ranges, `per_range` values each, ends included.
    fn clays(&self, per_range: usize) -> Vec<ClayPoint> {
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

    /// Lightest candidate over all shapes that does in these clays.
    fn lightest(&self, clays: &[ClayPoint]) -> Result<Candidate, TuningError> {
        let mut best: Option<Candidate> = None;
        let mut least_bad: Option<(f64, Candidate, Obstacle)> = None;
        for shape_s in SHAPES_S {
            let heaviest = Candidate {
                shape_s,
                impedance_n_s_per_m: self.heaviest_n_s_per_m,
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
        Err(self.not_within(candidate, obstacle))
    }

    /// Goes down from a candidate that does; stops where a step no longer does, and halves that step.
    fn lighten(
        &self,
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
        &self,
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
    fn assess(&self, candidate: Candidate) -> Result<Assessment, TuningError> {
        let mut proposal = Proposal {
            mass_kg: candidate.mass_kg(),
            damping_n_s_per_m: candidate.damping_n_s_per_m(),
            c_h1: candidate.c_h1()?,
            distance: f64::INFINITY,
            delay_margin: DelayMargin::Unbounded,
            impedance_n_s_per_m: candidate.impedance_n_s_per_m,
        };
        for clay in self.clays(CHECKED) {
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

    fn verdict(&self, candidate: Candidate, clay: ClayPoint) -> Result<Verdict, TuningError> {
        let sides = self.sides(candidate)?;
        let t_t = Polynomial::new(&[clay.damping_n_s_per_m, clay.stiffness_n_per_m])
            .map_err(LoopError::Polynomial)?;
        let closed_loop = ClosedLoop::new(&sides, &self.t_h, &t_t)?;
        let delay_margin = closed_loop.delay_margin(self.scheme)?;
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
            DelayMargin::Finite { seconds, .. } if seconds <= self.round_trip_s => {
                let obstacle = Obstacle::Delay {
                    margin_s: seconds,
                    wanted_s: self.round_trip_s,
                    clay,
                };
                // Ranks behind every stable candidate, and the sooner lost the further.
                return failed(seconds / self.round_trip_s - 1.0, obstacle);
            }
            DelayMargin::Finite { .. } | DelayMargin::Unbounded => {}
        }
        let distance = closed_loop.least_distance_within(self.scheme, self.round_trip_s)?;
        let obstacle = (distance < self.distance).then_some(Obstacle::Distance {
            got: distance,
            wanted: self.distance,
            clay,
        });
        Ok(Verdict {
            distance,
            delay_margin,
            obstacle,
        })
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

    fn not_within(&self, candidate: Candidate, obstacle: Obstacle) -> TuningError {
        TuningError::NotWithin {
            heaviest_n_s_per_m: self.heaviest_n_s_per_m,
            mass_kg: candidate.mass_kg(),
            damping_n_s_per_m: candidate.damping_n_s_per_m(),
            obstacle,
        }
    }
}

/// A handle, by the shape `M / B` and its impedance at 1 Hz.
#[derive(Clone, Copy, Debug)]
struct Candidate {
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
