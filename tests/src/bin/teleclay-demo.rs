//! What `cargo demo` runs once everything is built: see [`teleclay_tests::demo`].

#![allow(clippy::print_stdout, reason = "a program for people talks to them")]

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Result;
use clap::Parser;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use teleclay_tests::demo::{Options, run};

/// What a shell answers for a program that Ctrl-C ended.
const INTERRUPTED: u8 = 130;

/// Starts a server and a simulated handle that cuts clay, and shows where to look.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(flatten)]
    options: Options,
}

fn main() -> ExitCode {
    let Arguments { options } = Arguments::parse();
    let interrupted = Arc::new(AtomicBool::new(false));
    match listen(&interrupted).and_then(|()| run(&options, &interrupted)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if interrupted.load(Ordering::Relaxed) => {
            eprintln!("\n{error:#}");
            ExitCode::from(INTERRUPTED)
        }
        Err(error) => {
            eprintln!("\nerror: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Listens for Ctrl-C, a closed terminal and SIGTERM. A second one ends this program at once; the kernel then ends its
/// children.
fn listen(interrupted: &Arc<AtomicBool>) -> Result<()> {
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        // In this order: the first signal only raises the flag, the second finds it raised.
        signal_hook::flag::register_conditional_shutdown(
            signal,
            128 + signal,
            Arc::clone(interrupted),
        )?;
        signal_hook::flag::register(signal, Arc::clone(interrupted))?;
    }
    Ok(())
}
