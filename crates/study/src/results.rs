//! Answers as tidy CSV: a row a trial, a column a variable, units in the names; and back, to be fitted.
//!
//! | column | holds |
//! |---|---|
//! | `study`, `participant`, `part`, `code`, `condition` | whose trial, and of which condition |
//! | `scheme`, `delay_s`, … `stiffness_pa` | the condition as it is, without the level |
//! | `task`, `trial` | what was asked, and which trial of the run it was |
//! | `level_…` | what was added to the condition; the name ends as the quantity's, in its unit |
//! | `comparison_interval`, `answer` | which interval had it, what was answered |
//! | `noticed` | 1 or 0: the right interval, or a yes; empty for ratings |
//! | `rating`, `reversal` | the number given, and whether a staircase turned here |
//! | `response_s` | from question to answer |

use std::fmt::Write;

use crate::answer::Answer;
use crate::fit::Counts;
use crate::run::Run;

/// Columns before the level and behind it.
const BEFORE: [&str; 14] = [
    "study",
    "participant",
    "part",
    "code",
    "condition",
    "scheme",
    "delay_s",
    "jitter_s",
    "loss",
    "viscosity_pa_s_per_m",
    "yield_stress_pa",
    "stiffness_pa",
    "task",
    "trial",
];
const BEHIND: [&str; 6] = [
    "comparison_interval",
    "answer",
    "noticed",
    "rating",
    "reversal",
    "response_s",
];
/// What the level's column begins with.
const LEVEL: &str = "level_";

/// The head of the table.
pub fn head(study: &crate::file::Study) -> String {
    let level = format!("{LEVEL}{}", study.stimulus().quantity.word());
    let names = BEFORE.into_iter().chain([&*level]).chain(BEHIND);
    let mut text = names.collect::<Vec<_>>().join(",");
    text.push('\n');
    text
}

/// A run's rows.
pub fn rows(run: &Run<'_>) -> String {
    let study = run.study();
    let mut text = String::new();
    for record in run.records() {
        let condition = study
            .conditions()
            .iter()
            .find(|condition| condition.name == record.condition);
        let Some(condition) = condition else { continue };
        let (line, material) = (condition.line, condition.material);
        let noticed = record.noticed.map_or("", |is| if is { "1" } else { "0" });
        let rating = match record.answer {
            Answer::Rating(rating) => rating.to_string(),
            _ => String::new(),
        };
        // Names, words and numbers have neither comma nor quote. Writing into a string does not fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{noticed},{rating},{},{}",
            study.name(),
            run.participant(),
            record.part,
            record.code,
            record.condition,
            condition.scheme,
            line.delay_s,
            line.jitter_s,
            line.loss,
            material.viscosity_pa_s_per_m,
            material.yield_stress_pa,
            material.stiffness_pa,
            study.task().word(),
            record.trial,
            record.level,
            record.comparison_interval,
            record.answer.word(),
            u8::from(record.reversal),
            record.response_s,
        );
    }
    text
}

/// What a table lacks to be one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TableError {
    /// A column.
    #[error("no column `{wanted}`, have {got}")]
    Column {
        /// Its name.
        wanted: String,
        /// Those that are there.
        got: String,
    },
    /// A value.
    #[error("line {line}, column `{column}`: `{got}`, wanted {wanted}")]
    Value {
        /// Counted from 1, the head with it.
        line: usize,
        /// The column's name.
        column: String,
        /// As it stands there.
        got: String,
        /// What would do.
        wanted: &'static str,
    },
    /// A row that is longer or shorter than the head.
    #[error("line {line} has {got} fields, the head {wanted}")]
    Length {
        /// Counted from 1, the head with it.
        line: usize,
        /// Its fields.
        got: usize,
        /// Those of the head.
        wanted: usize,
    },
}

/// All answers of one participant under one condition.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// The study's name.
    pub study: String,
    /// Whose answers.
    pub participant: String,
    /// Under which condition.
    pub condition: String,
    /// What was asked.
    pub task: String,
    /// The quantity that the level was added to.
    pub quantity: String,
    /// Answers level by level; ratings are left out.
    pub counts: Vec<Counts>,
    /// Levels at which a staircase turned.
    pub reversals: Vec<f64>,
    /// Ratings level by level, in the order in which they were given.
    pub ratings: Vec<Ratings>,
}

/// What was given for one level.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratings {
    /// The level.
    pub level: f64,
    /// The numbers.
    pub given: Vec<u8>,
}

/// Reads a table, whoever wrote it: columns may stand in any order, others may be there as well, fields may be quoted.
///
/// # Errors
/// A column or a value is missing or wrong; says where.
pub fn read(text: &str) -> Result<Vec<Group>, TableError> {
    let mut lines = text.lines().enumerate();
    let head: Vec<String> = lines.next().map_or_else(Vec::new, |(_, line)| fields(line));
    let level = head
        .iter()
        .position(|name| name.starts_with(LEVEL))
        .ok_or_else(|| missing("level_…", &head))?;
    let place = |name: &str| {
        let at = head.iter().position(|other| other == name);
        at.ok_or_else(|| missing(name, &head))
    };
    let [
        study,
        participant,
        condition,
        task,
        noticed,
        reversal,
        rating,
    ] = [
        place("study")?,
        place("participant")?,
        place("condition")?,
        place("task")?,
        place("noticed")?,
        place("reversal")?,
        place("rating")?,
    ];
    let mut groups: Vec<Group> = Vec::new();
    for (index, text) in lines.filter(|(_, text)| !text.trim().is_empty()) {
        let row = fields(text);
        let line = index + 1;
        if row.len() != head.len() {
            return Err(TableError::Length {
                line,
                got: row.len(),
                wanted: head.len(),
            });
        }
        let wrong = |at: usize, wanted| TableError::Value {
            line,
            column: head[at].clone(),
            got: row[at].clone(),
            wanted,
        };
        let is_group = |group: &Group| {
            (&group.study, &group.participant, &group.condition)
                == (&row[study], &row[participant], &row[condition])
        };
        let at = groups.iter().position(is_group).unwrap_or_else(|| {
            groups.push(Group {
                study: row[study].clone(),
                participant: row[participant].clone(),
                condition: row[condition].clone(),
                task: row[task].clone(),
                quantity: head[level][LEVEL.len()..].to_owned(),
                counts: Vec::new(),
                reversals: Vec::new(),
                ratings: Vec::new(),
            });
            groups.len() - 1
        });
        let group = &mut groups[at];
        let shown: f64 = row[level]
            .parse()
            .ok()
            .filter(|level: &f64| level.is_finite())
            .ok_or_else(|| wrong(level, "a number"))?;
        match &*row[noticed] {
            "0" => group.count(shown, 0),
            "1" => group.count(shown, 1),
            "" => {
                let given = row[rating].parse();
                let given = given.map_err(|_| wrong(rating, "a rating, where noticed is empty"))?;
                group.rate(shown, given);
            }
            _ => return Err(wrong(noticed, "1, 0 or nothing")),
        }
        match &*row[reversal] {
            "0" | "" => {}
            "1" => group.reversals.push(shown),
            _ => return Err(wrong(reversal, "1 or 0")),
        }
    }
    Ok(groups)
}

impl Group {
    fn count(&mut self, level: f64, noticed: u32) {
        let same = |counts: &&mut Counts| counts.level.to_bits() == level.to_bits();
        match self.counts.iter_mut().find(same) {
            Some(counts) => {
                counts.trials += 1;
                counts.noticed += noticed;
            }
            None => self.counts.push(Counts {
                level,
                trials: 1,
                noticed,
            }),
        }
    }

    fn rate(&mut self, level: f64, given: u8) {
        let same = |ratings: &&mut Ratings| ratings.level.to_bits() == level.to_bits();
        match self.ratings.iter_mut().find(same) {
            Some(ratings) => ratings.given.push(given),
            None => self.ratings.push(Ratings {
                level,
                given: vec![given],
            }),
        }
    }

    /// The mean of the levels at which the staircase turned, without the first `left_out` and over an even number of
    /// them, as many up as down ([L71]); nothing where too few are left.
    pub fn reversal_mean(&self, left_out: usize) -> Option<f64> {
        let settled = self.reversals.get(left_out..)?;
        let settled = &settled[settled.len() % 2..];
        (!settled.is_empty()).then(|| settled.iter().sum::<f64>() / settled.len() as f64)
    }
}

/// Answers of a run, level by level, for each condition's name.
pub fn counts(run: &Run<'_>) -> Vec<(String, Vec<Counts>)> {
    let table = head(run.study()) + &rows(run);
    let groups = read(&table).expect("what is written here can be read here");
    groups
        .into_iter()
        .map(|group| (group.condition, group.counts))
        .collect()
}

fn missing(wanted: &str, head: &[String]) -> TableError {
    TableError::Column {
        wanted: wanted.to_owned(),
        got: head.join(", "),
    }
}

/// The fields of a line, RFC 4180, without line ends inside of quotes.
fn fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut letters = line.chars().peekable();
    let mut is_quoted = false;
    while let Some(letter) = letters.next() {
        let last = fields.len() - 1;
        match letter {
            '"' if is_quoted && letters.peek() == Some(&'"') => {
                letters.next();
                fields[last].push('"');
            }
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => fields.push(String::new()),
            letter => fields[last].push(letter),
        }
    }
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "\
level_delay_s,noticed,study,participant,condition,task,reversal,rating,more
0.1,1,a,1,\"quoted, with a comma\",yes_no,0,,x
0.1,0,a,1,\"quoted, with a comma\",yes_no,1,,x
0.2,1,a,1,\"quoted, with a comma\",yes_no,0,,x
0.1,1,a,2,\"quoted, with a comma\",yes_no,0,,x
";

    #[test]
    fn a_table_from_elsewhere_is_read_by_its_names() {
        let groups = read(TABLE).unwrap();
        assert_eq!(groups.len(), 2);
        let [first, second] = &groups[..] else {
            panic!("two groups");
        };
        assert_eq!(first.condition, "quoted, with a comma");
        assert_eq!((&*first.quantity, &*first.participant), ("delay_s", "1"));
        let counts: Vec<_> = first
            .counts
            .iter()
            .map(|counts| (counts.trials, counts.noticed))
            .collect();
        assert_eq!(counts, [(2, 1), (1, 1)]);
        assert_eq!(first.reversals, [0.1]);
        assert_eq!(second.counts.len(), 1);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        let told =
            |from: &str, to: &str| read(&TABLE.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(told("noticed", "heard").starts_with("no column `noticed`, have level_delay_s"));
        assert_eq!(
            told("0.2,1", "far,1"),
            "line 4, column `level_delay_s`: `far`, wanted a number"
        );
        assert_eq!(
            told("0.2,1", "0.2,maybe"),
            "line 4, column `noticed`: `maybe`, wanted 1, 0 or nothing"
        );
        assert_eq!(told("0,,x", "0,,x,y"), "line 2 has 10 fields, the head 9");
    }

    #[test]
    fn reversals_count_up_and_down_alike() {
        let group = Group {
            reversals: vec![9.0, 1.0, 4.0, 2.0, 4.0],
            ..read(TABLE).unwrap().remove(0)
        };
        assert_eq!(group.reversal_mean(0), Some(11.0 / 4.0));
        assert_eq!(group.reversal_mean(3), Some(3.0));
        assert_eq!(group.reversal_mean(4), None);
        assert_eq!(group.reversal_mean(9), None);
    }
}
