//! The workspace's own commands: `cargo demo`, `cargo verify`, `cargo figures`, `cargo xtask soak`.
//!
//! They are aliases in .cargo/config.toml for this program, so that a fresh clone needs nothing but cargo to start. It
//! builds and checks; what is shown and measured are programs of their own, which take this one's place once they are
//! built.

#![allow(clippy::print_stdout, reason = "a program for people talks to them")]

mod dashboard;
mod demo;
mod process;
mod promtool;
mod python;
mod release;
mod tools;
mod verify;
mod workspace;

use std::ffi::OsString;
use std::process::{Command, ExitCode};

use anyhow::Result;
use clap::{Parser, Subcommand};

use crate::process::become_program;
use crate::workspace::program;

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
    Figures {
        /// Handed on to teleclay-figures, such as `-- --json FILE`
        #[arg(last = true)]
        arguments: Vec<OsString>,
    },
    /// Let server and handle run for long, with watchers that read slowly, and watch their memory
    Soak {
        /// How long to watch, after warming up
        #[arg(long, value_name = "N", default_value_t = 600, value_parser = clap::value_parser!(u64).range(10..=86_400))]
        seconds: u64,
    },
}

fn main() -> ExitCode {
    match run(Cli::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("\nerror: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(task: Task) -> Result<()> {
    match task {
        Task::Demo(options) => demo::run(&options),
        Task::Verify(options) => verify::run(&options),
        Task::Figures { arguments } => {
            release::build(&[])?;
            become_program(Command::new(program("teleclay-figures")).args(arguments))
        }
        Task::Soak { seconds } => {
            release::build(&[])?;
            let mut soak = Command::new(program("teleclay-soak"));
            become_program(soak.args(["--seconds", &seconds.to_string()]))
        }
    }
}
