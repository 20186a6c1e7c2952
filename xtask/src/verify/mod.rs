//! `cargo verify`: every check of every language, in the order in which a mistake shows soonest.

mod citations;
mod compose;
mod files;
mod golden;
mod image;
mod links;
mod steps;

use std::fmt;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use clap::Args;
use clap::builder::PossibleValuesParser;

use self::steps::{STEPS, Step};
use crate::process::Interrupt;
use crate::progress::duration;
use crate::workspace::Workspace;

/// What `cargo verify` can be told.
#[derive(Args)]
pub(crate) struct Options {
    /// Go on after a step that failed; the end fails all the same
    #[arg(long)]
    keep_going: bool,
    /// Run this step alone; may be given several times
    #[arg(long, value_name = "STEP", value_parser = PossibleValuesParser::new(STEPS.iter().map(|step| step.name)))]
    only: Vec<String>,
    /// Name the steps and do nothing
    #[arg(long)]
    list: bool,
}

/// Runs the steps.
pub(crate) fn run(options: &Options, interrupt: &Interrupt) -> Result<()> {
    if options.list {
        for step in &STEPS {
            println!("{:<10} {}", step.name, step.what);
        }
        return Ok(());
    }
    let workspace = Workspace::find()?;
    let is_asked =
        |step: &&Step| options.only.is_empty() || options.only.iter().any(|only| only == step.name);
    let chosen: Vec<&Step> = STEPS.iter().filter(is_asked).collect();
    let began = Instant::now();
    let mut rows: Vec<Row> = Vec::new();
    for (index, step) in chosen.iter().enumerate() {
        println!(
            "\n━━ {} of {}: {} ━━ {}",
            index + 1,
            chosen.len(),
            step.name,
            step.what
        );
        let row = take(step, &workspace, interrupt);
        let failed = row.outcome == Outcome::Failed;
        rows.push(row);
        if interrupt.heard() || (failed && !options.keep_going) {
            break;
        }
    }
    rows.extend(chosen[rows.len()..].iter().map(|step| Row {
        name: step.name,
        outcome: Outcome::NotRun,
        took: Duration::ZERO,
    }));
    println!(
        "\n{}",
        Table {
            rows: &rows,
            took: began.elapsed()
        }
    );
    let failed: Vec<&str> = rows
        .iter()
        .filter(|row| row.outcome == Outcome::Failed)
        .map(|row| row.name)
        .collect();
    if !failed.is_empty() {
        bail!("failed: {}", failed.join(", "));
    }
    if rows.iter().any(|row| row.outcome == Outcome::NotRun) {
        bail!("interrupted");
    }
    Ok(())
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Outcome {
    Passed,
    Failed,
    NotRun,
}

struct Row {
    name: &'static str,
    outcome: Outcome,
    took: Duration,
}

struct Table<'a> {
    rows: &'a [Row],
    took: Duration,
}

fn take(step: &Step, workspace: &Workspace, interrupt: &Interrupt) -> Row {
    let began = Instant::now();
    let result = (step.run)(workspace, interrupt);
    let took = began.elapsed();
    let outcome = match result {
        Ok(()) => {
            println!("{} passed in {}", step.name, duration(took));
            Outcome::Passed
        }
        Err(error) => {
            println!("{} failed after {}: {error:#}", step.name, duration(took));
            Outcome::Failed
        }
    };
    Row {
        name: step.name,
        outcome,
        took,
    }
}

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for row in self.rows {
            let (word, took) = match row.outcome {
                Outcome::Passed => ("passed", duration(row.took)),
                Outcome::Failed => ("FAILED", duration(row.took)),
                Outcome::NotRun => ("not run", String::new()),
            };
            writeln!(f, "  {:<10} {word:<8} {took:>13}", row.name)?;
        }
        let count = |outcome| {
            self.rows
                .iter()
                .filter(|row| row.outcome == outcome)
                .count()
        };
        let (passed, failed) = (count(Outcome::Passed), count(Outcome::Failed));
        writeln!(
            f,
            "\nsteps: {passed} passed, {failed} failed, {} skipped",
            count(Outcome::NotRun)
        )?;
        write!(f, "in {}", duration(self.took))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_names_are_unique_so_that_only_is_unambiguous() {
        let mut names: Vec<&str> = STEPS.iter().map(|step| step.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), STEPS.len());
    }

    #[test]
    fn the_table_names_every_step_and_counts_each_outcome() {
        let row = |name, outcome| Row {
            name,
            outcome,
            took: Duration::from_secs(3),
        };
        let rows = [
            row("format", Outcome::Passed),
            row("test", Outcome::Failed),
            row("demo", Outcome::NotRun),
        ];
        let text = Table {
            rows: &rows,
            took: Duration::from_secs(6),
        }
        .to_string();
        assert!(text.contains("test       FAILED"), "{text}");
        assert!(
            text.ends_with("steps: 1 passed, 1 failed, 1 skipped\nin 6.0 s"),
            "{text}"
        );
    }
}
