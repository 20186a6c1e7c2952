//! `teleclay-latency`: see `--help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    teleclay_latency::program::main(&[])
}
