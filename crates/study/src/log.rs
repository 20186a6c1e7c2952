//! The file of answers: a line for whose run it is, then a line an answer, each written once and never changed. It is
//! all the state that a run has.
//!
//! ```text
//! {"version":1,"study":"late-clay","digest":"…","participant":3}
//! {"trial":1,"part":1,"condition":"wave-50ms","code":"KXR","level":0.16,…}
//! {"withdrawn":true}
//! ```
//!
//! A process that is killed may leave half a line behind. What does not end in a line's end was never answered for
//! good, and is cut off; anything else that is unreadable is an error.

use serde::{Deserialize, Serialize};

use crate::file::Study;
use crate::run::{Record, ReplayError, Run};

/// Of the layout.
const VERSION: u32 = 1;

/// Why a text is no file of answers to this study.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LogError {
    /// A line says nothing.
    #[error("line {line}: {detail}")]
    Line {
        /// Counted from 1.
        line: usize,
        /// What is wrong with it.
        detail: String,
    },
    /// The answers are to another study, or to this one before it was changed.
    #[error(
        "the answers are to study {got}, wanted {wanted}: the file was changed after the first answer"
    )]
    OtherStudy {
        /// Its name and digest.
        got: String,
        /// Those of the study at hand.
        wanted: String,
    },
    /// The answers are another participant's.
    #[error("the answers are of participant {got}, wanted {wanted}")]
    OtherParticipant {
        /// Whose they are.
        got: u32,
        /// Whose they should be.
        wanted: u32,
    },
    /// They do not follow from the study.
    #[error(transparent)]
    Replay(#[from] ReplayError),
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    version: u32,
    study: String,
    digest: String,
    participant: u32,
}

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Line {
    Withdrawn { withdrawn: bool },
    Record(Box<Record>),
}

/// What a text of answers says.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// Whose run it is.
    pub participant: u32,
    /// The answers.
    pub records: Vec<Record>,
    /// Whether the participant has ended it.
    pub is_withdrawn: bool,
    /// So many bytes of the text are whole lines; the rest is to be cut off.
    pub whole_bytes: usize,
    head: Head,
}

/// The first line of a run's file, with its end.
pub fn head(study: &Study, participant: u32) -> String {
    let head = Head {
        version: VERSION,
        study: study.name().to_owned(),
        digest: study.digest(),
        participant,
    };
    line(&head)
}

/// An answer's line, with its end.
pub fn answer(record: &Record) -> String {
    line(record)
}

/// The line of a participant who ends the run, with its end.
pub fn withdrawn() -> String {
    line(&Line::Withdrawn { withdrawn: true })
}

/// Reads a file of answers; nothing if there is not a whole line of it.
///
/// # Errors
/// A line that says nothing.
pub fn read(text: &str) -> Result<Option<Log>, LogError> {
    let whole_bytes = text.rfind('\n').map_or(0, |end| end + 1);
    let mut lines = text[..whole_bytes].lines().enumerate();
    let Some((_, first)) = lines.next() else {
        return Ok(None);
    };
    let head: Head = parse(first, 1)?;
    if head.version != VERSION {
        return Err(LogError::Line {
            line: 1,
            detail: format!("version {}, wanted {VERSION}", head.version),
        });
    }
    let mut log = Log {
        participant: head.participant,
        records: Vec::new(),
        is_withdrawn: false,
        whole_bytes,
        head,
    };
    for (index, text) in lines {
        let number = index + 1;
        if log.is_withdrawn {
            return Err(LogError::Line {
                line: number,
                detail: "it comes after the participant has ended the run".to_owned(),
            });
        }
        match parse(text, number)? {
            Line::Withdrawn { withdrawn } => log.is_withdrawn = withdrawn,
            Line::Record(record) => log.records.push(*record),
        }
    }
    Ok(Some(log))
}

impl Log {
    /// The run, where it was.
    ///
    /// # Errors
    /// The answers are not those of this study and participant.
    pub fn run<'a>(&self, study: &'a Study, participant: u32) -> Result<Run<'a>, LogError> {
        let name = |study: &str, digest: &str| format!("{study} ({digest})");
        if (&*self.head.study, &*self.head.digest) != (study.name(), &*study.digest()) {
            return Err(LogError::OtherStudy {
                got: name(&self.head.study, &self.head.digest),
                wanted: name(study.name(), &study.digest()),
            });
        }
        if self.participant != participant {
            return Err(LogError::OtherParticipant {
                got: self.participant,
                wanted: participant,
            });
        }
        Ok(Run::replay(study, participant, &self.records)?)
    }
}

fn parse<'a, T: Deserialize<'a>>(text: &'a str, line: usize) -> Result<T, LogError> {
    serde_json::from_str(text).map_err(|error| LogError::Line {
        line,
        detail: error.to_string(),
    })
}

fn line(value: &impl Serialize) -> String {
    let mut text = serde_json::to_string(value).expect("numbers and words make JSON");
    text.push('\n');
    text
}
