//! A long run that watches its own memory, or kills its server: see `teleclay-soak --help`, or `cargo xtask soak`.

#![allow(clippy::print_stdout, reason = "a program for people talks to them")]

use std::time::Duration;

use clap::Parser;
use teleclay_tests::kills;
use teleclay_tests::soak::run;

/// Runs a server and a handle that cuts, with watchers that read slowly or not at all, and fails when memory grows; or
/// kills the server again and again.
#[derive(Debug, Parser)]
struct Arguments {
    /// How long to watch, after warming up
    #[arg(long, value_name = "N", default_value_t = 600, value_parser = clap::value_parser!(u64).range(10..=86_400))]
    seconds: u64,
    /// How long to warm up
    #[arg(long, value_name = "N", default_value_t = 30)]
    warm_up_seconds: u64,
    /// Kill the server so many times while two hands cut, and start it again, in place of all that
    #[arg(long, value_name = "N", conflicts_with = "seconds")]
    kills: Option<usize>,
    /// Chooses the moments of the kills
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    if let Some(count) = arguments.kills {
        let report = kills::run(count, arguments.seed, |kill, report| {
            if kill.is_multiple_of(10) {
                println!("{report}\n");
            }
        })?;
        println!("at the end:\n{report}");
        return Ok(());
    }
    let report = run(
        Duration::from_secs(arguments.warm_up_seconds),
        Duration::from_secs(arguments.seconds),
        |report| println!("{report}\n"),
    )?;
    println!("at the end:\n{report}");
    report.judge()
}
