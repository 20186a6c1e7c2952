//! The shape of a study file.

use serde::{Deserialize, Serialize};
use teleclay_proto::{Material, Scheme};

use crate::procedure::Scale;
use crate::psychometric::Shape;

/// The whole file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawStudy {
    pub(super) name: String,
    pub(super) seed: u64,
    pub(super) participants: u32,
    pub(super) question: String,
    #[serde(default)]
    pub(super) fresh_clay: bool,
    #[serde(default)]
    pub(super) record: bool,
    pub(super) stimulus: Stimulus,
    pub(super) procedure: Procedure,
    #[serde(default)]
    pub(super) fit: FitSettings,
    pub(super) conditions: Vec<Condition>,
}

/// What a trial varies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stimulus {
    /// The quantity of a condition that a level is added to.
    pub quantity: Quantity,
    /// Least and greatest value of it that is ever shown, in its unit. Within the server's own range.
    pub bounds: [f64; 2],
}

/// A quantity of a condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Mean delay each way, s.
    DelayS,
    /// Standard deviation of the delay, s.
    JitterS,
    /// Share of frames lost.
    Loss,
    /// Stress per speed, Pa s/m.
    ViscosityPaSPerM,
    /// Stress below which clay only bends, Pa.
    YieldStressPa,
    /// Modulus of the elastic part, Pa.
    StiffnessPa,
}

impl Quantity {
    /// Its name, which ends in its unit.
    pub fn word(self) -> &'static str {
        match self {
            Self::DelayS => "delay_s",
            Self::JitterS => "jitter_s",
            Self::Loss => "loss",
            Self::ViscosityPaSPerM => "viscosity_pa_s_per_m",
            Self::YieldStressPa => "yield_stress_pa",
            Self::StiffnessPa => "stiffness_pa",
        }
    }
}

/// How levels are chosen and what is asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Procedure {
    /// Levels that are fixed beforehand.
    ConstantStimuli {
        /// What is asked.
        task: Choice,
        /// Each level.
        levels: Vec<f64>,
        /// How often each is shown.
        repetitions: u32,
    },
    /// Levels that follow the answers.
    Staircase {
        /// What is asked.
        task: Choice,
        /// The first level.
        start: f64,
        /// The step before the first reversal, after it, and so on; the last one stays.
        steps: Vec<f64>,
        /// What a step does.
        #[serde(default)]
        scale: Scale,
        /// So many noticed in a row, and it goes down.
        down: u32,
        /// So many missed in a row, and it goes up.
        #[serde(default = "one")]
        up: u32,
        /// It ends with so many reversals.
        #[serde(default)]
        reversals: Option<u32>,
        /// And with so many trials in any case.
        trials: u32,
    },
    /// A number on a scale for every condition and level.
    Rating {
        /// Each level; only the condition itself if there is none.
        #[serde(default = "nothing_added")]
        levels: Vec<f64>,
        /// How often each is shown.
        repetitions: u32,
        /// The lowest number.
        least: u8,
        /// The highest one.
        most: u8,
    },
}

fn one() -> u32 {
    1
}

fn nothing_added() -> Vec<f64> {
    vec![0.0]
}

/// A choice between two answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// The condition and the condition with the level, in an order of chance: which was which.
    TwoIntervals,
    /// The condition with the level: whether something is noticed.
    YesNo,
}

/// What is asked of a participant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Which of two intervals it was.
    TwoIntervals,
    /// Whether it was noticed.
    YesNo,
    /// A number on a scale.
    Rating {
        /// The lowest.
        least: u8,
        /// The highest.
        most: u8,
    },
}

impl Procedure {
    pub(super) fn task(&self) -> Task {
        match *self {
            Self::ConstantStimuli { task, .. } | Self::Staircase { task, .. } => match task {
                Choice::TwoIntervals => Task::TwoIntervals,
                Choice::YesNo => Task::YesNo,
            },
            Self::Rating { least, most, .. } => Task::Rating { least, most },
        }
    }
}

/// What is fitted to the answers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FitSettings {
    /// The shape of the function.
    pub shape: Shape,
    /// Share of wrong answers however clear it is.
    pub lapse: f64,
    /// Instead: fitted, up to this.
    pub lapse_most: Option<f64>,
    /// Of yes-no tasks: share of yes where nothing is noticed, fitted up to this; none is taken to be made without it.
    pub guess_most: Option<f64>,
    /// Of the threshold's interval.
    pub confidence: f64,
}

impl Default for FitSettings {
    /// A Gaussian, two lapses in a hundred trials, an interval of 95 %.
    fn default() -> Self {
        Self {
            shape: Shape::default(),
            lapse: 0.02,
            lapse_most: None,
            guess_most: None,
            confidence: 0.95,
        }
    }
}

/// A condition: what every trial of a part of the study has in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Its name, which no participant sees.
    pub name: String,
    /// The law that couples hand and tool.
    pub scheme: Scheme,
    /// What the network does, both ways alike.
    #[serde(default)]
    pub line: Line,
    /// What the clay resists with.
    #[serde(default)]
    pub material: Material,
}

/// What the network does to each direction, on top of what the real one does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Line {
    /// Mean delay, s.
    pub delay_s: f64,
    /// Standard deviation of the delay, s.
    pub jitter_s: f64,
    /// Share of frames lost.
    pub loss: f64,
}
