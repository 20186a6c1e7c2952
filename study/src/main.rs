//! `teleclay-study`: see `--help`.

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use teleclay_study_program::commands::Arguments;

fn main() -> ExitCode {
    match Arguments::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Whoever closed stderr does not want to know.
            let _ = writeln!(std::io::stderr(), "teleclay-study: {error:#}");
            ExitCode::FAILURE
        }
    }
}
