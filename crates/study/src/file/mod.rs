//! The study file: what a study is, read from TOML or JSON, and checked.
//!
//! A condition says scheme, line and material; that is the standard. A trial shows the condition with a *level* added
//! to one quantity of it, and, where two intervals are compared, the condition as it is beside that. What a study may
//! set is what [`Presentation`] holds, and nothing in it is a bound on force, speed or travel: a study has no words for
//! those, and values beyond the server's own ranges are refused here.

mod check;
mod raw;

use serde::Serialize;
use sha2::{Digest, Sha256};
use teleclay_proto::http::{
    FieldError, ImpairmentPatch, JitterDistribution, MaterialPatch, NetworkPatch, SessionPatch,
};
use teleclay_proto::{Material, Scheme};

pub use raw::{Condition, FitSettings, Line, Procedure, Quantity, Stimulus, Task};

use crate::fit::{Model, Rate, STAIRCASE_CORRECTION};
use raw::RawStudy;

/// Why a file is no study.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StudyError {
    /// The text is no TOML, or not that of a study; says where.
    #[error("{0}")]
    Toml(String),
    /// The text is no JSON, or not that of a study; says where.
    #[error("{0}")]
    Json(String),
    /// A field does not hold what it should.
    #[error(transparent)]
    Field(#[from] FieldError),
}

/// A study, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    raw: RawStudy,
}

/// What is shown in one interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Presentation {
    /// The law that couples hand and tool.
    pub scheme: Scheme,
    /// What the network does, both ways alike.
    pub line: Line,
    /// What the clay resists with.
    pub material: Material,
}

impl Study {
    /// From TOML.
    ///
    /// # Errors
    /// The text is no study; says what was wanted, and where.
    pub fn from_toml(text: &str) -> Result<Self, StudyError> {
        let raw = toml::from_str(text).map_err(|error| StudyError::Toml(error.to_string()))?;
        Self::checked(raw)
    }

    /// From JSON.
    ///
    /// # Errors
    /// The text is no study; says what was wanted, and where.
    pub fn from_json(text: &str) -> Result<Self, StudyError> {
        let raw =
            serde_json::from_str(text).map_err(|error| StudyError::Json(error.to_string()))?;
        Self::checked(raw)
    }

    fn checked(raw: RawStudy) -> Result<Self, StudyError> {
        check::check(&raw)?;
        Ok(Self { raw })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.raw.name
    }

    /// The seed of every order and draw.
    pub fn seed(&self) -> u64 {
        self.raw.seed
    }

    /// How many people take part; they are numbered from 1.
    pub fn participants(&self) -> u32 {
        self.raw.participants
    }

    /// What is asked after each trial.
    pub fn question(&self) -> &str {
        &self.raw.question
    }

    /// Whether every trial begins in a fresh block.
    pub fn wants_fresh_clay(&self) -> bool {
        self.raw.fresh_clay
    }

    /// Whether every trial is recorded, where the server can.
    pub fn wants_recordings(&self) -> bool {
        self.raw.record
    }

    /// What is varied.
    pub fn stimulus(&self) -> &Stimulus {
        &self.raw.stimulus
    }

    /// Which level comes next.
    pub fn procedure(&self) -> &Procedure {
        &self.raw.procedure
    }

    /// What is asked of a participant.
    pub fn task(&self) -> Task {
        self.raw.procedure.task()
    }

    /// The conditions, in the order of the file.
    pub fn conditions(&self) -> &[Condition] {
        &self.raw.conditions
    }

    /// What is fitted to the answers; nothing for ratings.
    pub fn model(&self) -> Option<Model> {
        let fit = &self.raw.fit;
        let guess = match self.task() {
            Task::TwoIntervals => Rate::Fixed(0.5),
            Task::YesNo => fit.guess_most.map_or(Rate::Fixed(0.0), Rate::UpTo),
            Task::Rating { .. } => return None,
        };
        Some(Model {
            shape: fit.shape,
            guess,
            lapse: fit.lapse_most.map_or(Rate::Fixed(fit.lapse), Rate::UpTo),
            confidence: fit.confidence,
            correction: match self.raw.procedure {
                Procedure::Staircase { .. } => STAIRCASE_CORRECTION,
                _ => 0.0,
            },
        })
    }

    /// How many participants see every order equally often: multiples of this.
    pub fn round(&self) -> usize {
        crate::order::williams(self.raw.conditions.len()).len()
    }

    /// Tells two studies apart that differ in anything that matters, however their files are laid out.
    pub fn digest(&self) -> String {
        let text = serde_json::to_vec(&self.raw).unwrap_or_default();
        let bytes: [u8; 32] = Sha256::digest(&text).into();
        bytes
            .iter()
            .take(16)
            .fold(String::new(), |text, byte| format!("{text}{byte:02x}"))
    }

    /// What a condition shows with a level added.
    pub(crate) fn presentation(&self, condition: usize, level: f64) -> Presentation {
        self.raw.conditions[condition].with(self.raw.stimulus.quantity, level)
    }
}

impl Presentation {
    /// The change of a session that shows it: scheme, line and material, and nothing else. `seeds` are of the line's
    /// two directions.
    pub fn patch(&self, seeds: [u64; 2]) -> SessionPatch {
        let [up, down] = seeds.map(|seed| {
            Some(ImpairmentPatch {
                delay_s: Some(self.line.delay_s),
                jitter_s: Some(self.line.jitter_s),
                loss: Some(self.line.loss),
                seed: Some(seed),
                jitter_distribution: Some(JitterDistribution::Normal),
                duplicate: Some(0.0),
                reorder: Some(0.0),
                burst: Some(None),
                outage: Some(None),
            })
        });
        SessionPatch {
            scheme: Some(self.scheme),
            material: Some(MaterialPatch {
                viscosity_pa_s_per_m: Some(self.material.viscosity_pa_s_per_m),
                yield_stress_pa: Some(self.material.yield_stress_pa),
                stiffness_pa: Some(self.material.stiffness_pa),
            }),
            network: Some(NetworkPatch { up, down }),
            ..SessionPatch::default()
        }
    }

    /// The same with another value of one quantity.
    fn but(mut self, quantity: Quantity, value: f64) -> Self {
        let place = match quantity {
            Quantity::DelayS => &mut self.line.delay_s,
            Quantity::JitterS => &mut self.line.jitter_s,
            Quantity::Loss => &mut self.line.loss,
            Quantity::ViscosityPaSPerM => &mut self.material.viscosity_pa_s_per_m,
            Quantity::YieldStressPa => &mut self.material.yield_stress_pa,
            Quantity::StiffnessPa => &mut self.material.stiffness_pa,
        };
        *place = value;
        self
    }

    /// What a quantity has here.
    pub fn value(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::DelayS => self.line.delay_s,
            Quantity::JitterS => self.line.jitter_s,
            Quantity::Loss => self.line.loss,
            Quantity::ViscosityPaSPerM => self.material.viscosity_pa_s_per_m,
            Quantity::YieldStressPa => self.material.yield_stress_pa,
            Quantity::StiffnessPa => self.material.stiffness_pa,
        }
    }
}

impl Condition {
    /// Itself, as it is.
    fn standard(&self) -> Presentation {
        Presentation {
            scheme: self.scheme,
            line: self.line,
            material: self.material,
        }
    }

    /// With a level added to one quantity.
    fn with(&self, quantity: Quantity, level: f64) -> Presentation {
        let standard = self.standard();
        standard.but(quantity, standard.value(quantity) + level)
    }
}

impl Task {
    /// The word for it in results.
    pub fn word(self) -> &'static str {
        match self {
            Self::TwoIntervals => "two_intervals",
            Self::YesNo => "yes_no",
            Self::Rating { .. } => "rating",
        }
    }
}

impl Serialize for Study {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.raw.serialize(serializer)
    }
}
