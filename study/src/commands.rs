//! What each command does.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::{Parser, Subcommand, ValueEnum};
use teleclay_study::file::{Study, Task};
use teleclay_study::fit::{Model, Rate, STAIRCASE_CORRECTION, fit};
use teleclay_study::observer::Observer;
use teleclay_study::psychometric::{Psychometric, Shape};
use teleclay_study::results::{self, Group};
use teleclay_study::run::Run;

use crate::answers::{self, Answers};
use crate::conduct::{Desk, Ending};
use crate::session::Remote;
use crate::table::thresholds;

/// Runs studies of what people tell apart: who feels what in which order, what they answer, and the thresholds of it.
#[derive(Parser)]
#[command(name = "teleclay-study", version)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Read a study's file, and say what it comes to
    Check {
        /// The study, TOML or JSON
        file: PathBuf,
    },
    /// Run a study with one participant at a session, or go on where it was
    Run {
        /// The study, TOML or JSON
        file: PathBuf,
        /// The server, such as http://127.0.0.1:8080
        #[arg(long, value_name = "URL")]
        server: String,
        /// The session that the participant holds a tool of
        #[arg(long, value_name = "ID")]
        session: String,
        /// The participant's number, from 1
        #[arg(long, value_name = "N")]
        participant: u32,
        /// Where answers are kept
        #[arg(long, value_name = "DIR", default_value = ".")]
        answers: PathBuf,
        /// An admin's token, where the server wants one
        #[arg(long, env = "TELECLAY_TOKEN", hide_env_values = true)]
        token: Option<String>,
    },
    /// Write the answers of everybody as CSV, a row a trial
    Results {
        /// The study, TOML or JSON
        file: PathBuf,
        /// Where answers are kept
        #[arg(long, value_name = "DIR", default_value = ".")]
        answers: PathBuf,
    },
    /// Let simulated participants of known threshold answer; their answers as CSV, or how often the interval has it
    Simulate {
        /// The study, TOML or JSON
        file: PathBuf,
        /// The threshold that they have, in the unit of the stimulus
        #[arg(long, value_name = "LEVEL")]
        threshold: f64,
        /// The spread of their function: of a Gaussian in the same unit, of a Weibull one over its slope
        #[arg(long, value_name = "SPREAD")]
        spread: f64,
        /// Share of answers given without attention
        #[arg(long, value_name = "SHARE", default_value_t = 0.02)]
        lapse: f64,
        /// Of yes-no tasks: share of yes where there is nothing
        #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
        false_alarms: f64,
        /// Instead of answers: run so many participants, and say how often the interval has the threshold
        #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(10..=100_000))]
        seeds: Option<u64>,
    },
    /// Fit thresholds to a table of results
    Fit {
        /// Results as CSV
        table: PathBuf,
        /// Shape of the function
        #[arg(long, value_enum, default_value_t = ShapeWord::CumulativeGaussian)]
        shape: ShapeWord,
        /// Share of wrong answers however clear it is
        #[arg(long, value_name = "SHARE", default_value_t = 0.02)]
        lapse: f64,
        /// Instead: fitted, up to this
        #[arg(long, value_name = "SHARE")]
        lapse_most: Option<f64>,
        /// Of yes-no tasks: share of yes where nothing is noticed, fitted up to this
        #[arg(long, value_name = "SHARE")]
        guess_most: Option<f64>,
        /// Confidence of the interval
        #[arg(long, value_name = "SHARE", default_value_t = 0.95)]
        confidence: f64,
    },
}

#[derive(Clone, Copy, ValueEnum)]
enum ShapeWord {
    CumulativeGaussian,
    Weibull,
}

impl From<ShapeWord> for Shape {
    fn from(word: ShapeWord) -> Self {
        match word {
            ShapeWord::CumulativeGaussian => Self::CumulativeGaussian,
            ShapeWord::Weibull => Self::Weibull,
        }
    }
}

impl Arguments {
    /// Does what they say.
    ///
    /// # Errors
    /// What kept it from being done.
    pub fn run(self) -> Result<()> {
        match self.command {
            Command::Check { file } => print(&told(&read(&file)?)),
            Command::Run {
                file,
                server,
                session,
                participant,
                answers,
                token,
            } => {
                let study = read(&file)?;
                let (mut answers, mut run) = Answers::open(&answers, &study, participant)?;
                let mut session = Remote::find(&server, &session, token)?;
                let mut desk = Desk {
                    input: &mut std::io::stdin().lock(),
                    output: &mut std::io::stdout().lock(),
                    session: &mut session,
                };
                match desk.conduct(&mut run, &mut answers)? {
                    Ending::Complete | Ending::Withdrawn => Ok(()),
                    Ending::Interrupted => bail!("the run is not over"),
                }
            }
            Command::Results { file, answers } => print(&collected(&read(&file)?, &answers)?),
            Command::Simulate {
                file,
                threshold,
                spread,
                lapse,
                false_alarms,
                seeds,
            } => {
                let study = read(&file)?;
                let simulated = Simulated {
                    threshold,
                    spread,
                    lapse,
                    false_alarms,
                };
                let function = simulated.function(&study)?;
                match seeds {
                    Some(seeds) => print(&coverage(&study, function, seeds)?),
                    None => print(&simulation(&study, function)?),
                }
            }
            Command::Fit {
                table,
                shape,
                lapse,
                lapse_most,
                guess_most,
                confidence,
            } => {
                for (name, share, most) in [
                    ("--lapse", Some(lapse), 0.2),
                    ("--lapse-most", lapse_most, 0.2),
                    ("--guess-most", guess_most, 0.5),
                    ("--confidence", Some(confidence), 0.999),
                ] {
                    if let Some(share) = share {
                        ensure!(
                            (0.0..=most).contains(&share),
                            "{name} {share}, wanted 0 to {most}"
                        );
                    }
                }
                let text = std::fs::read_to_string(&table)
                    .with_context(|| format!("cannot read {}", table.display()))?;
                let groups = results::read(&text).with_context(|| table.display().to_string())?;
                ensure!(!groups.is_empty(), "{} has no trial", table.display());
                let model = |group: &Group| {
                    let guess = match &*group.task {
                        "two_intervals" => Rate::Fixed(0.5),
                        "yes_no" => guess_most.map_or(Rate::Fixed(0.0), Rate::UpTo),
                        _ => return None,
                    };
                    Some(Model {
                        shape: shape.into(),
                        guess,
                        lapse: lapse_most.map_or(Rate::Fixed(lapse), Rate::UpTo),
                        confidence,
                        // Only a staircase turns.
                        correction: if group.reversals.is_empty() {
                            0.0
                        } else {
                            STAIRCASE_CORRECTION
                        },
                    })
                };
                print(&thresholds(&groups, model))
            }
        }
    }
}

/// A study from its file.
fn read(file: &Path) -> Result<Study> {
    let text =
        std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let is_json = file
        .extension()
        .is_some_and(|extension| extension == "json");
    let study = if is_json {
        Study::from_json(&text)
    } else {
        Study::from_toml(&text)
    };
    study.with_context(|| format!("{} is no study", file.display()))
}

/// What a study comes to, for whoever is about to run it.
fn told(study: &Study) -> String {
    let conditions: Vec<&str> = study
        .conditions()
        .iter()
        .map(|condition| &*condition.name)
        .collect();
    let [least, most] = study.stimulus().bounds;
    let round = study.round();
    let balance = if study.participants().is_multiple_of(round as u32) {
        "orders are balanced".to_owned()
    } else {
        format!("orders are balanced with multiples of {round} only")
    };
    format!(
        "{}: {} conditions ({}), {} participants; {balance}.\n\
         {} stays within {least} and {most}. A participant answers with {}.\n",
        study.name(),
        conditions.len(),
        conditions.join(", "),
        study.participants(),
        study.stimulus().quantity.word(),
        study.task().wanted(),
    )
}

/// Everybody's answers.
fn collected(study: &Study, folder: &Path) -> Result<String> {
    let mut text = results::head(study);
    let mut found = 0;
    for participant in 1..=study.participants() {
        let path = answers::path(folder, study, participant);
        if !path.exists() {
            continue;
        }
        let told = || path.display().to_string();
        let log = std::fs::read_to_string(&path).with_context(told)?;
        if let Some(log) = teleclay_study::log::read(&log).with_context(told)? {
            text += &results::rows(&log.run(study, participant).with_context(told)?);
            found += 1;
        }
    }
    ensure!(
        0 < found,
        "{} has no answers to {}",
        folder.display(),
        study.name()
    );
    Ok(text)
}

struct Simulated {
    threshold: f64,
    spread: f64,
    lapse: f64,
    false_alarms: f64,
}

impl Simulated {
    fn function(&self, study: &Study) -> Result<Psychometric> {
        let shape = study.model().map_or(Shape::default(), |model| model.shape);
        let place = shape
            .place(self.threshold)
            .filter(|place| place.is_finite());
        let location = place.with_context(|| {
            format!(
                "--threshold {}, wanted a level of the shape",
                self.threshold
            )
        })?;
        ensure!(
            self.spread.is_finite() && 0.0 < self.spread,
            "--spread {}, wanted a number above zero",
            self.spread
        );
        let guess = match study.task() {
            Task::TwoIntervals => 0.5,
            Task::YesNo | Task::Rating { .. } => self.false_alarms,
        };
        for (name, share) in [
            ("--lapse", self.lapse),
            ("--false-alarms", self.false_alarms),
        ] {
            ensure!(
                (0.0..=0.5).contains(&share),
                "{name} {share}, wanted 0 to 0.5"
            );
        }
        Ok(Psychometric {
            shape,
            location,
            spread: self.spread,
            guess,
            lapse: self.lapse,
        })
    }
}

/// The answers of every participant.
fn simulation(study: &Study, function: Psychometric) -> Result<String> {
    let mut text = results::head(study);
    for participant in 1..=study.participants() {
        let mut run = Run::new(study, participant)?;
        run.simulate(&mut Observer::new(function, participant.into()));
        text += &results::rows(&run);
    }
    Ok(text)
}

/// How often the interval of the first participant's first condition has the threshold.
fn coverage(study: &Study, function: Psychometric, seeds: u64) -> Result<String> {
    let model = study
        .model()
        .context("ratings have no threshold; leave --seeds out")?;
    let (mut covered, mut fitted, mut widths) = (0_u32, 0_u32, Vec::new());
    let truth = function.threshold();
    for seed in 0..seeds {
        let mut run = Run::new(study, 1)?;
        run.simulate(&mut Observer::new(function, seed));
        let Some((_, counts)) = results::counts(&run).into_iter().next() else {
            continue;
        };
        let Ok(fit) = fit(&counts, &model) else {
            continue;
        };
        fitted += 1;
        let [least, most] = fit.interval;
        let is_in =
            least.is_none_or(|least| least <= truth) && most.is_none_or(|most| truth <= most);
        covered += u32::from(is_in);
        if let [Some(least), Some(most)] = fit.interval {
            widths.push(most - least);
        }
    }
    widths.sort_by(f64::total_cmp);
    let width = widths.get(widths.len() / 2);
    Ok(format!(
        "{seeds} simulated participants, threshold {truth}: {fitted} fitted; the interval of confidence {} had the \
         threshold in {:.1} %. Its median width is {}.\n",
        model.confidence,
        100.0 * f64::from(covered) / seeds as f64,
        width.map_or_else(|| "without bound".to_owned(), |width| format!("{width:.4}")),
    ))
}

fn print(text: &str) -> Result<()> {
    match std::io::stdout().write_all(text.as_bytes()) {
        // `| head` is enough for some.
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to stdout"),
    }
}
