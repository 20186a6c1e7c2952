//! `cargo xtask soak`: builds, then runs the program that watches memory over a long run.

use anyhow::Result;
use clap::Args;

use crate::process::{Interrupt, command, run as run_command};
use crate::release;
use crate::workspace::Workspace;

/// What `cargo xtask soak` can be told.
#[derive(Args)]
pub(crate) struct Options {
    /// How long to watch, after warming up
    #[arg(long, value_name = "N", default_value_t = 600, value_parser = clap::value_parser!(u64).range(10..=86_400))]
    seconds: u64,
}

/// Watches the release build.
pub(crate) fn run(options: &Options, interrupt: &Interrupt) -> Result<()> {
    let workspace = Workspace::find()?;
    release::build(&workspace, interrupt)?;
    let mut soak = command(workspace.program("teleclay-soak"));
    run_command(
        soak.args(["--seconds", &options.seconds.to_string()]),
        interrupt,
    )
}
