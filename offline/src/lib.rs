//! The commands of `teleclay-server` that need no server and no network: the theory, and the description of the
//! interface.
//!
//! Each command answers on standard output as the call of the same name under `/api/v1` does: as a table for people, as
//! CSV for spreadsheets and plots, or as the very JSON of the call. Progress and errors go to standard error.

mod experiment;
mod kinematics;
mod output;
mod progress;
mod stability;
mod tuning;
mod values;
mod workspace;

use std::io::{self, Read as _, Write};
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::{Args, Command, Subcommand};
use serde::Serialize;
use serde::de::DeserializeOwned;
use teleclay_proto::http::{Validate, parse};
use teleclay_theory::Unanswered;

use self::output::{Format, Table};

/// What can be asked for without a server.
#[derive(Clone, Debug, Subcommand)]
pub enum Offline {
    /// Joint angles, positions and Jacobians of the parallel robot
    #[command(subcommand)]
    Kinematics(kinematics::Kinematics),
    /// Whether a loop is stable, and for how long a delay
    #[command(visible_alias = "stability")]
    Analyse(stability::Analyse),
    /// Run the cutting experiment through the clay
    Experiment(experiment::Experiment),
    /// Where the robot reaches, and how evenly it moves there
    Workspace(workspace::Workspace),
    /// The lightest handle that keeps a margin
    #[command(visible_alias = "tuning")]
    Tune(tuning::Tune),
    /// Print the description of the HTTP interface, as /api/v1/openapi.json has it
    Openapi,
}

/// How an answer is printed.
#[derive(Clone, Copy, Debug, Args)]
struct Output {
    /// Print CSV: a header, then a line a row
    #[arg(long)]
    csv: bool,
    /// Print the JSON that the call under /api/v1 answers with
    #[arg(long, conflicts_with = "csv")]
    json: bool,
}

/// Where a request comes from.
#[derive(Clone, Debug, Args)]
struct Input {
    /// Take the request from a file of JSON, as the call under /api/v1 does; - is standard input
    #[arg(long, value_name = "FILE")]
    input: Option<PathBuf>,
}

/// Options that say how an answer is printed; every other one would be lost where a file makes the request.
const OF_THE_OUTPUT: [&str; 3] = ["csv", "json", "help"];

/// Rounds off the options of every command here: numbers may be below zero, so that they are refused for their value
/// and not taken for an option; and a request from a file goes with no option that says otherwise.
#[must_use]
pub fn rounded_off(command: Command) -> Command {
    command.mut_subcommands(|command| {
        let others: Vec<clap::Id> = command
            .get_arguments()
            .map(|argument| argument.get_id().clone())
            .filter(|id| *id != "input" && !OF_THE_OUTPUT.contains(&id.as_str()))
            .collect();
        rounded_off(command).mut_args(|argument| {
            if argument.get_id() == "input" {
                argument.conflicts_with_all(&others)
            } else if argument.get_action().takes_values() {
                argument.allow_negative_numbers(true)
            } else {
                argument
            }
        })
    })
}

/// Longest request that is read, bytes.
const MAX_INPUT: u64 = 1 << 20;

impl Offline {
    /// Answers on standard output; `interface` is the description of the HTTP interface.
    ///
    /// # Errors
    /// The request is none, or has no answer.
    pub fn run(&self, interface: &impl Serialize) -> anyhow::Result<()> {
        let mut out = io::BufWriter::new(io::stdout().lock());
        self.write(&mut out, interface)?;
        match out.flush() {
            // Whoever read has seen enough: `| head`.
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            flushed => flushed.context("standard output"),
        }
    }

    /// Answers on `out`; `interface` is the description of the HTTP interface.
    ///
    /// # Errors
    /// The request is none, has no answer, or `out` cannot be written to.
    pub fn write(&self, out: &mut dyn Write, interface: &impl Serialize) -> anyhow::Result<()> {
        let answer = match self {
            Self::Kinematics(command) => command.answer()?,
            Self::Analyse(command) => command.answer()?,
            Self::Experiment(command) => command.answer()?,
            Self::Workspace(command) => command.answer()?,
            Self::Tune(command) => command.answer()?,
            Self::Openapi => Answer::json(interface)?,
        };
        match answer.write(out) {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            written => written.context("standard output"),
        }
    }
}

/// An answer in the form that was asked for.
struct Answer {
    text: Form,
}

enum Form {
    /// Tables for people, each under its heading.
    Tables(Vec<(String, Table)>),
    Csv(Table),
    Json(String),
}

impl Answer {
    fn new<T: Serialize>(
        output: Output,
        answer: &T,
        tables: impl FnOnce(&T) -> Vec<(String, Table)>,
        csv: impl FnOnce(&T) -> Table,
    ) -> anyhow::Result<Self> {
        let text = match output.format() {
            Format::Table => Form::Tables(tables(answer)),
            Format::Csv => Form::Csv(csv(answer)),
            Format::Json => Form::Json(serde_json::to_string_pretty(answer)?),
        };
        Ok(Self { text })
    }

    fn json<T: Serialize>(answer: &T) -> anyhow::Result<Self> {
        let text = Form::Json(serde_json::to_string_pretty(answer)?);
        Ok(Self { text })
    }

    fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        match &self.text {
            Form::Tables(tables) => {
                for (index, (heading, table)) in tables.iter().enumerate() {
                    if 0 < index {
                        writeln!(out)?;
                    }
                    writeln!(out, "{heading}")?;
                    table.write_aligned(out)?;
                }
                Ok(())
            }
            Form::Csv(table) => table.write_csv(out),
            Form::Json(text) => writeln!(out, "{text}"),
        }
    }
}

impl Output {
    fn format(self) -> Format {
        match (self.csv, self.json) {
            (true, _) => Format::Csv,
            (_, true) => Format::Json,
            _ => Format::Table,
        }
    }
}

impl Input {
    /// The request from the file, or the one that the options make.
    fn request<T>(&self, from_options: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T>
    where
        T: DeserializeOwned + Serialize + Validate,
    {
        let Some(path) = &self.input else {
            return from_options();
        };
        let body = read(path).with_context(|| format!("cannot read {}", path.display()))?;
        parse(&body).with_context(|| format!("{} is no request", path.display()))
    }

    /// Why there is no answer, told to whoever wrote the request: a field of a file by its pointer, any other by its
    /// option.
    fn blame(&self, error: Unanswered) -> anyhow::Error {
        let field = match error {
            Unanswered::Field(field) if self.input.is_none() => field,
            other => return other.into(),
        };
        let name = field.pointer.trim_start_matches("/geometry");
        let name = name.split('/').nth(1).unwrap_or_default();
        match name {
            "" => field.into(),
            "region_m" => anyhow::anyhow!("--from-m, --to-m: {}", field.detail),
            name => anyhow::anyhow!("--{}: {}", name.replace('_', "-"), field.detail),
        }
    }
}

fn read(path: &Path) -> io::Result<Vec<u8>> {
    let source: Box<dyn io::Read> = if path == Path::new("-") {
        Box::new(io::stdin())
    } else {
        Box::new(std::fs::File::open(path)?)
    };
    let mut body = Vec::new();
    source.take(MAX_INPUT + 1).read_to_end(&mut body)?;
    if MAX_INPUT < body.len() as u64 {
        let detail = format!("it has more than {MAX_INPUT} bytes");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, detail));
    }
    Ok(body)
}
