//! One participant's way through a study: which trial comes next, and what was answered.
//!
//! The next trial is a function of the study, the participant and the answers so far. So the answers are all the state
//! there is: whoever replays them ([`Run::replay`]) is where the run was.

use serde::{Deserialize, Serialize};

use crate::answer::{Answer, AnswerError};
use crate::chance::Chance;
use crate::file::{Presentation, Procedure, Study, Task};
use crate::observer::Observer;
use crate::order;
use crate::procedure::{Scale, Staircase, StaircaseRule, rounds};

/// Answers that are not those of this study and participant.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReplayError {
    /// Another trial was answered than the study has there.
    #[error("answer {number} is to another trial than the study has there: {got}, wanted {wanted}")]
    OtherTrial {
        /// Counted from 1.
        number: usize,
        /// What was answered.
        got: String,
        /// What the study shows.
        wanted: String,
    },
    /// The study is over.
    #[error("answer {number} comes after the study's last trial")]
    TooMany {
        /// Counted from 1.
        number: usize,
    },
    /// An answer to another question.
    #[error("answer {number}: {source}")]
    Answer {
        /// Counted from 1.
        number: usize,
        /// What is wrong with it.
        source: AnswerError,
    },
    /// A participant whom the study does not have.
    #[error("participant {got}, wanted 1 to {most}")]
    Participant {
        /// As given.
        got: u32,
        /// How many the study has.
        most: u32,
    },
}

/// A trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Counted from 1, over the whole run.
    pub number: u32,
    /// The part of the run, one for each condition, counted from 1.
    pub part: usize,
    /// How many parts there are.
    pub parts: usize,
    /// What the part's condition is called before the participant.
    pub code: String,
    /// What is shown, interval by interval.
    pub shown: Vec<Presentation>,
    /// Seeds of the line's two directions.
    pub line_seeds: [u64; 2],
    /// What is asked.
    pub task: Task,
    condition: usize,
    level: f64,
    comparison: u8,
}

impl Trial {
    /// What the participant reads before it. It names no condition and no level.
    pub fn heading(&self) -> String {
        let Self {
            number,
            part,
            parts,
            code,
            ..
        } = self;
        format!("Trial {number}, part {code} ({part} of {parts})")
    }

    /// What was added to the condition. Not for the participant.
    pub fn level(&self) -> f64 {
        self.level
    }

    /// The condition, by its place in the file. Not for the participant.
    pub fn condition(&self) -> usize {
        self.condition
    }

    /// The answer of whoever notices the level, or fails to.
    fn answer_of(&self, notices: bool) -> Answer {
        match (self.task, notices) {
            (Task::TwoIntervals, notices) if notices == (self.comparison == 1) => Answer::First,
            (Task::TwoIntervals, _) => Answer::Second,
            (Task::YesNo, true) => Answer::Yes,
            (Task::YesNo, false) => Answer::No,
            (Task::Rating { most, .. }, true) => Answer::Rating(most),
            (Task::Rating { least, .. }, false) => Answer::Rating(least),
        }
    }
}

/// A trial and its answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// The trial's number, from 1.
    pub trial: u32,
    /// The part of the run, from 1.
    pub part: usize,
    /// The condition's name.
    pub condition: String,
    /// What it was called before the participant.
    pub code: String,
    /// What was added to the condition, in the unit of the stimulus.
    pub level: f64,
    /// The interval that had it, 1 or 2; 1 where there is one only.
    pub comparison_interval: u8,
    /// What was answered.
    pub answer: Answer,
    /// Whether it was noticed: the right interval, or a yes; nothing for a rating.
    pub noticed: Option<bool>,
    /// Whether a staircase turned here.
    pub reversal: bool,
    /// From the question to the answer, s.
    pub response_s: f64,
}

/// One participant's run.
pub struct Run<'a> {
    study: &'a Study,
    participant: u32,
    parts: Vec<Part>,
    records: Vec<Record>,
}

struct Part {
    condition: usize,
    code: String,
    progress: Progress,
}

enum Progress {
    Sequence { levels: Vec<f64>, at: usize },
    Staircase(Staircase),
}

impl Progress {
    fn next_level(&self) -> Option<f64> {
        match self {
            Self::Sequence { levels, at } => levels.get(*at).copied(),
            Self::Staircase(staircase) => staircase.next_level(),
        }
    }

    fn answer(&mut self, is_noticed: bool) -> bool {
        match self {
            Self::Sequence { at, .. } => {
                *at += 1;
                false
            }
            Self::Staircase(staircase) => staircase.answer(is_noticed),
        }
    }
}

impl<'a> Run<'a> {
    /// Before the first trial.
    ///
    /// # Errors
    /// The study has no such participant.
    pub fn new(study: &'a Study, participant: u32) -> Result<Self, ReplayError> {
        let most = study.participants();
        if !(1..=most).contains(&participant) {
            return Err(ReplayError::Participant {
                got: participant,
                most,
            });
        }
        let count = study.conditions().len();
        let codes = order::codes(study.seed(), count, participant);
        let parts = order::order(study.seed(), count, participant)
            .into_iter()
            .map(|condition| Part {
                condition,
                code: codes[condition].clone(),
                progress: progress(study, participant, condition),
            })
            .collect();
        Ok(Self {
            study,
            participant,
            parts,
            records: Vec::new(),
        })
    }

    /// Where a run was after these answers.
    ///
    /// # Errors
    /// The answers are not those of this study and participant.
    pub fn replay(
        study: &'a Study,
        participant: u32,
        records: &[Record],
    ) -> Result<Self, ReplayError> {
        let mut run = Self::new(study, participant)?;
        for (index, record) in records.iter().enumerate() {
            let number = index + 1;
            if run.next_trial().is_none() {
                return Err(ReplayError::TooMany { number });
            }
            let made = run
                .answer(record.answer, record.response_s)
                .map_err(|source| ReplayError::Answer { number, source })?;
            if made != record {
                let text = |record: &Record| serde_json::to_string(record).unwrap_or_default();
                return Err(ReplayError::OtherTrial {
                    number,
                    got: text(record),
                    wanted: text(made),
                });
            }
        }
        Ok(run)
    }

    /// The next trial; nothing once the run is over. Asked twice, it is the same one.
    pub fn next_trial(&self) -> Option<Trial> {
        let (index, level) = self
            .parts
            .iter()
            .enumerate()
            .find_map(|(index, part)| Some((index, part.progress.next_level()?)))?;
        let part = &self.parts[index];
        let number = self.records.len() as u32 + 1;
        let of = [u64::from(self.participant), u64::from(number)];
        let mut chance = Chance::new(self.study.seed(), "trial", &of);
        let comparison = 1 + chance.below(2) as u8;
        let line_seeds = [(); 2].map(|()| 1 + chance.below(1 << 30) as u64);
        let task = self.study.task();
        let with = self.study.presentation(part.condition, level);
        let standard = self.study.presentation(part.condition, 0.0);
        let (shown, comparison) = match (task, comparison) {
            (Task::TwoIntervals, 1) => (vec![with, standard], 1),
            (Task::TwoIntervals, _) => (vec![standard, with], 2),
            _ => (vec![with], 1),
        };
        Some(Trial {
            number,
            part: index + 1,
            parts: self.parts.len(),
            code: part.code.clone(),
            shown,
            line_seeds,
            task,
            condition: part.condition,
            level,
            comparison,
        })
    }

    /// Takes the answer to the next trial, given `response_s` after the question.
    ///
    /// # Errors
    /// The answer is none to the question, or there is none.
    pub fn answer(&mut self, answer: Answer, response_s: f64) -> Result<&Record, AnswerError> {
        let refused = |wanted: String| AnswerError {
            got: answer.word(),
            wanted,
        };
        let trial = self
            .next_trial()
            .ok_or_else(|| refused("nothing, for the run is over".to_owned()))?;
        let noticed = match (trial.task, answer) {
            (Task::TwoIntervals, Answer::First) => Some(trial.comparison == 1),
            (Task::TwoIntervals, Answer::Second) => Some(trial.comparison == 2),
            (Task::YesNo, Answer::Yes) => Some(true),
            (Task::YesNo, Answer::No) => Some(false),
            (Task::Rating { least, most }, Answer::Rating(rating))
                if (least..=most).contains(&rating) =>
            {
                None
            }
            (task, _) => return Err(refused(task.wanted())),
        };
        let part = &mut self.parts[trial.part - 1];
        let reversal = part.progress.answer(noticed.unwrap_or(false));
        self.records.push(Record {
            trial: trial.number,
            part: trial.part,
            condition: self.study.conditions()[trial.condition].name.clone(),
            code: trial.code,
            level: trial.level,
            comparison_interval: trial.comparison,
            answer,
            noticed,
            reversal,
            response_s,
        });
        Ok(&self.records[self.records.len() - 1])
    }

    /// What was answered so far.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// Whose run it is.
    pub fn participant(&self) -> u32 {
        self.participant
    }

    /// The study.
    pub fn study(&self) -> &Study {
        self.study
    }

    /// Answers every trial as the observer does.
    pub fn simulate(&mut self, observer: &mut Observer) {
        while let Some(trial) = self.next_trial() {
            let answer = match trial.task {
                Task::Rating { least, most } => {
                    let steps = (least..most).filter(|_| observer.notices(trial.level));
                    Answer::Rating(least + steps.count() as u8)
                }
                _ => trial.answer_of(observer.notices(trial.level)),
            };
            if self.answer(answer, 0.0).is_err() {
                return;
            }
        }
    }
}

fn progress(study: &Study, participant: u32, condition: usize) -> Progress {
    match study.procedure() {
        Procedure::ConstantStimuli {
            levels,
            repetitions,
            ..
        }
        | Procedure::Rating {
            levels,
            repetitions,
            ..
        } => {
            let of = [u64::from(participant), condition as u64];
            let mut chance = Chance::new(study.seed(), "levels", &of);
            Progress::Sequence {
                levels: rounds(levels, *repetitions, &mut chance),
                at: 0,
            }
        }
        Procedure::Staircase {
            start,
            steps,
            scale,
            down,
            up,
            reversals,
            trials,
            ..
        } => {
            let [least, most] = study.stimulus().bounds;
            let quantity = study.stimulus().quantity;
            let standard = study.presentation(condition, 0.0).value(quantity);
            // A factor never comes to zero by itself, and from zero it never comes back.
            let weakest = match scale {
                Scale::Added => 0.0,
                Scale::Factor => start * FACTOR_LEAST,
            };
            Progress::Staircase(Staircase::new(StaircaseRule {
                start: *start,
                steps: steps.clone(),
                scale: *scale,
                down: *down,
                up: *up,
                least: (least - standard).max(weakest),
                most: most - standard,
                reversals: *reversals,
                trials: *trials,
            }))
        }
    }
}

/// A staircase of factors goes down to this share of where it began.
const FACTOR_LEAST: f64 = 1e-3;
