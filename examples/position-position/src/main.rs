//! The latency table with this crate's scheme beside those that sessions have; see `--help`.

use std::process::ExitCode;

use teleclay_position_position::SCHEME;

fn main() -> ExitCode {
    teleclay_latency::program::main(&[&SCHEME])
}
