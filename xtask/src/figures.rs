//! `cargo figures`: builds, then runs the program that measures what this machine reaches.

use std::ffi::OsString;

use anyhow::{Context, Result, ensure};
use clap::Args;

use crate::process::{Interrupt, command};
use crate::release;
use crate::workspace::Workspace;

/// What `cargo figures` can be told.
#[derive(Args)]
pub(crate) struct Options {
    /// Handed on to teleclay-figures, such as `-- --json FILE`
    #[arg(last = true)]
    arguments: Vec<OsString>,
}

/// Measures with the release build.
pub(crate) fn run(options: &Options, interrupt: &Interrupt) -> Result<()> {
    let workspace = Workspace::find()?;
    release::build(&workspace, interrupt)?;
    let program = workspace.program("teleclay-figures");
    let status = command(&program)
        // A relative file name is meant relative to where the person is, not to the workspace.
        .current_dir(std::env::current_dir()?)
        .args(&options.arguments)
        .status()
        .with_context(|| format!("{} cannot be started", program.display()))?;
    ensure!(status.success(), "teleclay-figures failed ({status})");
    Ok(())
}
