//! What a participant answers.

use serde::{Deserialize, Serialize};

use crate::file::Task;

/// What a participant answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// It was the first interval.
    First,
    /// It was the second one.
    Second,
    /// It was noticed.
    Yes,
    /// It was not.
    No,
    /// A number on the scale.
    Rating(u8),
}

impl Answer {
    /// The word for it in results.
    pub fn word(self) -> String {
        match self {
            Self::First => "first".to_owned(),
            Self::Second => "second".to_owned(),
            Self::Yes => "yes".to_owned(),
            Self::No => "no".to_owned(),
            Self::Rating(rating) => rating.to_string(),
        }
    }
}

/// An answer that is none to the question.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{got}` answers nothing here, wanted {wanted}")]
pub struct AnswerError {
    /// As given.
    pub got: String,
    /// What would do.
    pub wanted: String,
}

impl Task {
    /// Reads an answer as it was typed.
    ///
    /// # Errors
    /// It is none to this task; says what would be.
    pub fn read(self, text: &str) -> Result<Answer, AnswerError> {
        let text = text.trim().to_lowercase();
        let answer = match (self, text.as_str()) {
            (Self::TwoIntervals, "1") => Some(Answer::First),
            (Self::TwoIntervals, "2") => Some(Answer::Second),
            (Self::YesNo, "y" | "yes") => Some(Answer::Yes),
            (Self::YesNo, "n" | "no") => Some(Answer::No),
            (Self::Rating { least, most }, number) => number
                .parse()
                .ok()
                .filter(|rating| (least..=most).contains(rating))
                .map(Answer::Rating),
            _ => None,
        };
        answer.ok_or_else(|| AnswerError {
            got: text,
            wanted: self.wanted(),
        })
    }

    /// What an answer may be.
    pub fn wanted(self) -> String {
        match self {
            Self::TwoIntervals => "1 or 2".to_owned(),
            Self::YesNo => "yes or no".to_owned(),
            Self::Rating { least, most } => format!("a number from {least} to {most}"),
        }
    }
}
