//! Proposes `C_h1 = 1 / (M s² + B s)` for a target, or says why there is none.
//!
//! Of all handles that keep the wanted distance for every clay and every delay in range, the lightest is proposed:
//! least impedance `|j w M + B|` at one cycle per second, about where a hand works. The shape `M / B` is scanned; along
//! each shape the impedance is lowered from the heaviest that is allowed until something gives way.

mod search;

use crate::closed_loop::LoopError;
use crate::compensators::CompensatorError;
use crate::delay::{DelayMargin, DelayedScheme};
use crate::polynomial::Polynomial;
use crate::rational::RationalFunction;
use search::{Assessment, CHECKED, ROUNDS, Search};
use std::ops::ControlFlow;

/// What is wanted, and of which plants.
#[derive(Clone, Debug, PartialEq)]
pub struct TuningTarget {
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

/// Mass and damping that meet a [`TuningTarget`].
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// `M`, kg.
    pub mass_kg: f64,
    /// `B`, N·s/m.
    pub damping_n_s_per_m: f64,
    /// `1 / (M s² + B s)`.
    pub c_h1: RationalFunction,
    /// What it keeps in the least favourable clay, over every delay up to the target's.
    pub distance: f64,
    /// Shortest delay margin over the clay range.
    pub delay_margin: DelayMargin,
    /// Impedance at 1 Hz, N·s/m.
    pub impedance_n_s_per_m: f64,
}

/// A kind of clay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClayPoint {
    /// Damping, N·s/m.
    pub damping_n_s_per_m: f64,
    /// Stiffness, N/m.
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
        "stable up to a round trip of {margin_s:.4} s, wanted {wanted_s} s, in clay of {} N s/m and {} N/m",
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
        "distance {got:.4} from instability, wanted {wanted}, in clay of {} N s/m and {} N/m",
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
    /// A number of the target is out of range.
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
        /// As asked for.
        wanted: f64,
    },
    /// No machine could run the compensators.
    #[error("no mass and damping make the compensators proper: {0}")]
    Compensator(#[source] CompensatorError),
    /// The loop cannot be formed.
    #[error(transparent)]
    Loop(#[from] LoopError),
    /// Whoever asked has called the search off.
    #[error("the search was called off")]
    CalledOff,
    /// Even the heaviest handle allowed is not enough.
    #[error(
        "no handle up to {heaviest_n_s_per_m} N s/m at 1 Hz will do: with {mass_kg:.4} kg and {damping_n_s_per_m:.4} N s/m, {obstacle}"
    )]
    NotWithin {
        /// The limit of the target.
        heaviest_n_s_per_m: f64,
        /// Shape that fails least.
        mass_kg: f64,
        /// Shape that fails least.
        damping_n_s_per_m: f64,
        /// What it fails at.
        obstacle: Obstacle,
    },
}

/// The lightest handle that meets the target in every clay and at every delay.
///
/// # Errors
/// The target is out of range, or cannot be met: the error says what stands against it.
pub fn propose(target: &TuningTarget) -> Result<Proposal, TuningError> {
    propose_while(target, || ControlFlow::Continue(()))
}

/// The same; `go_on` is asked every few milliseconds at most, and may call the search off. Plants with many sharp
/// resonances take a minute.
///
/// # Errors
/// As [`propose`], and [`TuningError::CalledOff`].
pub fn propose_while(
    target: &TuningTarget,
    mut go_on: impl FnMut() -> ControlFlow<()>,
) -> Result<Proposal, TuningError> {
    target.require_ranges()?;
    let target = &target.without_what_is_negligible();
    let mut search = Search {
        target,
        go_on: &mut go_on,
    };
    let mut clays = target.clays(2);
    for _ in 0..ROUNDS {
        let candidate = search.lightest(&clays)?;
        match search.assess(candidate)? {
            Assessment::Fulfils(proposal) => return Ok(proposal),
            // The ends of the range were not the worst of it: search again with this clay among them.
            Assessment::Fails { clay, .. } => clays.push(clay),
        }
    }
    // Clays keep turning up between the known ones: let the whole grid decide.
    let candidate = search.lightest(&target.clays(CHECKED))?;
    match search.assess(candidate)? {
        Assessment::Fulfils(proposal) => Ok(proposal),
        Assessment::Fails { obstacle, .. } => Err(target.not_within(candidate, obstacle)),
    }
}

/// A clay of less than this, N·s/m or N/m, or a delay, s, is none: what differs shows at frequencies of no machine
/// only, and the search would look there.
const NEGLIGIBLE: f64 = 1e-12;

impl TuningTarget {
    fn without_what_is_negligible(&self) -> Self {
        let kept = |value: f64| if value < NEGLIGIBLE { 0.0 } else { value };
        Self {
            clay_damping_n_s_per_m: self.clay_damping_n_s_per_m.map(kept),
            clay_stiffness_n_per_m: self.clay_stiffness_n_per_m.map(kept),
            round_trip_s: kept(self.round_trip_s),
            ..self.clone()
        }
    }

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
}
