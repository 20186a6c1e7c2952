//! The workspace's own commands: `cargo demo`, `cargo verify`, `cargo figures`, `cargo xtask soak`.
//!
//! They are aliases in .cargo/config.toml for this program, so that a fresh clone needs nothing but cargo to start.

#![allow(clippy::print_stdout, reason = "a program for people talks to them")]

mod dashboard;
mod demo;
mod figures;
mod process;
mod progress;
mod promtool;
mod python;
mod release;
mod soak;
mod tools;
mod verify;
mod workspace;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::process::Interrupt;

/// What a shell answers for a program that Ctrl-C ended.
const INTERRUPTED: u8 = 130;

#[derive(Parser)]
#[command(
    name = "cargo xtask",
    bin_name = "cargo",
    about = "Builds, shows, checks and measures teleclay"
)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Build what changed, start a server and a simulated handle that cuts clay, and show where to look
    Demo(demo::Options),
    /// Install what the tests need and run every check of every language
    Verify(verify::Options),
    /// Measure what this machine reaches, beside the bare floor of the same run
    Figures(figures::Options),
    /// Let server and handle run for long, with watchers that read slowly, and watch their memory
    Soak(soak::Options),
}

fn main() -> ExitCode {
    let task = Cli::parse().task;
    let result = Interrupt::listen().and_then(|interrupt| {
        let result = match task {
            Task::Demo(options) => demo::run(&options, &interrupt),
            Task::Verify(options) => verify::run(&options, &interrupt),
            Task::Figures(options) => figures::run(&options, &interrupt),
            Task::Soak(options) => soak::run(&options, &interrupt),
        };
        match result {
            Err(error) if interrupt.heard() => {
                eprintln!("\n{error:#}");
                Ok(ExitCode::from(INTERRUPTED))
            }
            result => result.map(|()| ExitCode::SUCCESS),
        }
    });
    result.unwrap_or_else(|error| {
        eprintln!("\nerror: {error:#}");
        ExitCode::FAILURE
    })
}
