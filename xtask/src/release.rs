//! The release build, with a word now and then of how far it is.

use std::io::{BufReader, IsTerminal, Read};
use std::process::Stdio;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};

use crate::process::{command, duration, run};
use crate::workspace::cargo;

/// Off a terminal a line is said this often: a log stays short, and a person who follows it knows that work goes on.
const LINE_EVERY: Duration = Duration::from_secs(15);

/// Builds these programs, or everything when none is named. Cargo is told programs and no packages: it then chooses
/// features as for the whole workspace, and what the programs share with tests and tools is compiled once.
pub(crate) fn build(programs: &[&str]) -> Result<()> {
    println!("building the release programs …");
    let mut build = command(cargo());
    build.args(["build", "--release"]);
    build.args(programs.iter().flat_map(|program| ["--bin", program]));
    if std::io::stderr().is_terminal() {
        // Cargo shows a bar of its own there.
        return run(&mut build);
    }
    let began = Instant::now();
    let mut child = build
        .env("CARGO_TERM_PROGRESS_WHEN", "always")
        .env("CARGO_TERM_PROGRESS_WIDTH", "160")
        .env("CARGO_TERM_COLOR", "never")
        .stdin(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .context("cargo build cannot be started")?;
    let output = child.stderr.take().context("cargo has no error output")?;
    let mut last = began;
    read_parts(output, |part| match Word::from(part) {
        Word::Progress(how_far) if LINE_EVERY <= last.elapsed() => {
            last = Instant::now();
            println!("  {}: {how_far}", duration(began.elapsed()));
        }
        Word::Progress(_) | Word::Routine => {}
        Word::Other(line) => println!("{line}"),
    });
    let status = child.wait()?;
    ensure!(status.success(), "cargo build failed ({status})");
    println!("  done, {}", duration(began.elapsed()));
    Ok(())
}

/// What cargo says on its error output.
#[derive(Debug, PartialEq)]
enum Word<'a> {
    /// Its bar: how many of how many parts are done, and which are being worked on.
    Progress(&'a str),
    /// A package whose turn it is; the bar tells that as well.
    Routine,
    /// Errors, warnings, and that another cargo is in the way.
    Other(&'a str),
}

impl<'a> From<&'a str> for Word<'a> {
    fn from(part: &'a str) -> Self {
        let part = part.trim_start_matches("\x1b[K").trim_end();
        let word = part.trim_start();
        if let Some((_, how_far)) = word
            .strip_prefix("Building [")
            .and_then(|bar| bar.split_once("] "))
        {
            return Self::Progress(how_far);
        }
        // Cargo sets its verbs flush right, so a diagnostic that begins with the same word is told from them.
        let verbs = ["Compiling ", "Downloaded ", "Downloading ", "Finished "];
        let is_routine = part != word && verbs.iter().any(|verb| word.starts_with(verb));
        if is_routine || word.is_empty() {
            return Self::Routine;
        }
        Self::Other(part)
    }
}

/// Calls `heard` with each part that ends with a line feed, or with a carriage return as a bar that is drawn anew does.
fn read_parts(source: impl Read, mut heard: impl FnMut(&str)) {
    let mut part = Vec::new();
    for byte in BufReader::new(source).bytes().map_while(Result::ok) {
        if matches!(byte, b'\n' | b'\r') {
            heard(&String::from_utf8_lossy(&part));
            part.clear();
        } else {
            part.push(byte);
        }
    }
    heard(&String::from_utf8_lossy(&part));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_is_read_diagnostics_stay_and_packages_in_turn_are_left_out() {
        let said = "\x1b[K   Compiling zenoh v1.10.2 (/path with space)\n\
                    \u{20}   Building [==>    ] 49/540: zenoh, tokio(build)\r\x1b[K\
                    \u{20}   Blocking waiting for file lock on build directory\n\
                    error[E0308]: mismatched types\n  --> src/lib.rs:1:1\n\n\
                    Compiling failed\n    Finished `release` profile";
        let mut words = Vec::new();
        read_parts(said.as_bytes(), |part| match Word::from(part) {
            Word::Progress(how_far) => words.push(format!("bar {how_far}")),
            Word::Routine => {}
            Word::Other(line) => words.push(line.to_owned()),
        });
        assert_eq!(
            words,
            [
                "bar 49/540: zenoh, tokio(build)",
                "    Blocking waiting for file lock on build directory",
                "error[E0308]: mismatched types",
                "  --> src/lib.rs:1:1",
                "Compiling failed",
            ]
        );
    }
}
