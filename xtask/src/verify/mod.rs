//! `cargo verify`: every check of every language, in the order in which a mistake shows soonest.

mod docker;
mod golden;
mod members;
mod steps;
mod unit;

use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use clap::Args;
use clap::builder::PossibleValuesParser;

use self::steps::{STEPS, Step};
use crate::process::duration;

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
pub(crate) fn run(options: &Options) -> Result<()> {
    if options.list {
        for step in &STEPS {
            println!("{:<10} {}", step.name, step.what);
        }
        return Ok(());
    }
    let is_asked =
        |step: &&Step| options.only.is_empty() || options.only.iter().any(|only| only == step.name);
    let chosen: Vec<&Step> = STEPS.iter().filter(is_asked).collect();
    let began = Instant::now();
    let mut rows = Vec::new();
    for (number, step) in (1..).zip(&chosen) {
        println!(
            "\n━━ {number} of {}: {} ━━ {}",
            chosen.len(),
            step.name,
            step.what
        );
        let outcome = take(step);
        let is_last = outcome.0 == FAILED && !options.keep_going;
        rows.push(outcome);
        if is_last {
            break;
        }
    }
    rows.resize(chosen.len(), (NOT_RUN, Duration::ZERO));
    let names: Vec<&str> = chosen.iter().map(|step| step.name).collect();
    println!(
        "\n{}\nin {}",
        table(&names, &rows),
        duration(began.elapsed())
    );
    let failed = names.iter().zip(&rows).filter(|(_, row)| row.0 == FAILED);
    let failed: Vec<&str> = failed.map(|(name, _)| *name).collect();
    ensure!(failed.is_empty(), "failed: {}", failed.join(", "));
    Ok(())
}

/// How a step ended, and how long it took.
type Outcome = (&'static str, Duration);

const PASSED: &str = "passed";
const FAILED: &str = "FAILED";
const NOT_RUN: &str = "not run";

fn take(step: &Step) -> Outcome {
    let began = Instant::now();
    let result = (step.run)();
    let took = began.elapsed();
    match result {
        Ok(()) => {
            println!("{} passed in {}", step.name, duration(took));
            (PASSED, took)
        }
        Err(error) => {
            println!("{} failed after {}: {error:#}", step.name, duration(took));
            (FAILED, took)
        }
    }
}

fn table(names: &[&str], rows: &[Outcome]) -> String {
    let mut text = String::new();
    for (name, (word, took)) in names.iter().zip(rows) {
        let took = if *word == NOT_RUN {
            String::new()
        } else {
            duration(*took)
        };
        text.push_str(&format!("  {name:<10} {word:<8} {took:>13}\n"));
    }
    let [passed, failed, skipped] = [PASSED, FAILED, NOT_RUN]
        .map(|wanted| rows.iter().filter(|(word, _)| *word == wanted).count());
    text + &format!("\nsteps: {passed} passed, {failed} failed, {skipped} skipped")
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
        let rows = [PASSED, FAILED, NOT_RUN].map(|word| (word, Duration::from_secs(3)));
        let text = table(&["format", "test", "demo"], &rows);
        assert!(text.contains("test       FAILED           3.0 s"), "{text}");
        assert!(
            text.ends_with("steps: 1 passed, 1 failed, 1 skipped"),
            "{text}"
        );
    }
}
