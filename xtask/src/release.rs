//! The release build, with a line that says how far it is.

use std::collections::HashSet;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use crate::process::{Interrupt, command};
use crate::progress::Progress;
use crate::workspace::{Workspace, cargo, packages_to_build};

/// How long to wait for cargo's next word before the line is redrawn.
const REDRAW_AFTER: Duration = Duration::from_millis(100);

/// Builds the whole workspace. Always the whole: a selection of packages would have cargo choose other features for what
/// they share, and then the largest dependency is compiled a second time.
pub(crate) fn build(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    let total = packages_to_build(workspace, interrupt)?;
    let mut progress = Progress::start("building the release programs", Some(total));
    let mut child = command(cargo())
        .args([
            "build",
            "--release",
            "--message-format",
            "json-render-diagnostics",
        ])
        // Its status lines are read here, so they must come without colours.
        .env("CARGO_TERM_COLOR", "never")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .context("cargo build cannot be started")?;
    let finished = follow(&mut child, total, &mut progress, interrupt);
    if finished.is_err() {
        child.kill().ok();
    }
    let status = child.wait()?;
    if let Err(error) = finished {
        progress.finish("stopped");
        return Err(error);
    }
    if !status.success() {
        progress.finish("failed");
        bail!("cargo build failed ({status}); its errors stand above");
    }
    progress.finish("done");
    Ok(())
}

/// What cargo says, from both of its outputs.
#[derive(Debug, PartialEq)]
enum Word {
    /// A package is compiled, or was before.
    Built(String),
    /// What cargo is doing now.
    Doing(String),
    /// Anything else on the error output: warnings and errors.
    Said(String),
}

fn follow(
    child: &mut Child,
    total: u64,
    progress: &mut Progress,
    interrupt: &Interrupt,
) -> Result<()> {
    let (words, heard) = mpsc::channel();
    let messages = child.stdout.take().context("cargo has no output")?;
    let status = child.stderr.take().context("cargo has no error output")?;
    read_lines(messages, words.clone(), artifact);
    read_lines(status, words, status_line);
    let mut built: HashSet<String> = HashSet::new();
    let mut doing = "reading what is there".to_owned();
    loop {
        if interrupt.heard() {
            bail!("interrupted");
        }
        match heard.recv_timeout(REDRAW_AFTER) {
            Ok(Word::Built(package)) => {
                built.insert(package);
            }
            Ok(Word::Doing(what)) => doing = what,
            Ok(Word::Said(line)) => progress.say(&line),
            Err(RecvTimeoutError::Timeout) => progress.tick(),
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
        progress.show(built.len() as u64, total, &doing);
    }
}

fn read_lines(
    source: impl Read + Send + 'static,
    words: Sender<Word>,
    meaning: fn(&str) -> Option<Word>,
) {
    // Ends with the pipe; a listener that went away only ends it sooner.
    thread::spawn(move || {
        for line in BufReader::new(source).lines().map_while(Result::ok) {
            if let Some(word) = meaning(&line)
                && words.send(word).is_err()
            {
                return;
            }
        }
    });
}

#[derive(Deserialize)]
struct Message {
    reason: String,
    package_id: Option<String>,
    target: Option<Target>,
}

#[derive(Deserialize)]
struct Target {
    kind: Vec<String>,
}

/// A line of cargo's JSON: a package counts once its own code is compiled, not when its build script is.
fn artifact(line: &str) -> Option<Word> {
    let message: Message = serde_json::from_str(line).ok()?;
    let kinds = message.target?.kind;
    let own_code = !kinds.iter().any(|kind| kind == "custom-build");
    (message.reason == "compiler-artifact" && own_code).then_some(Word::Built(message.package_id?))
}

/// A line of cargo's own: `   Compiling name v1.2.3`, or a diagnostic.
fn status_line(line: &str) -> Option<Word> {
    let text = line.trim_start();
    let quiet = ["Finished ", "Downloaded "];
    if quiet.iter().any(|word| text.starts_with(word)) {
        return None;
    }
    let doing = [
        "Compiling ",
        "Blocking ",
        "Downloading ",
        "Updating ",
        "Locking ",
        "Adding ",
    ];
    // Cargo sets its verbs flush right, so an indent alone does not make a status line; the verb does.
    if doing.iter().any(|word| text.starts_with(word)) && text.len() < line.len() {
        let words: Vec<&str> = text.split(" (").next()?.split_whitespace().collect();
        return Some(Word::Doing(words.join(" ")));
    }
    Some(Word::Said(line.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_package_counts_when_its_own_code_is_compiled() {
        let line = |kind: &str, reason: &str| {
            format!(
                r#"{{"reason":"{reason}","package_id":"p","target":{{"kind":["{kind}"]}},"fresh":true}}"#
            )
        };
        assert_eq!(
            artifact(&line("lib", "compiler-artifact")),
            Some(Word::Built("p".to_owned()))
        );
        assert_eq!(artifact(&line("custom-build", "compiler-artifact")), None);
        assert_eq!(artifact(&line("lib", "compiler-message")), None);
        assert_eq!(artifact("not json"), None);
    }

    #[test]
    fn status_lines_become_the_moving_line_and_errors_stay() {
        let doing = |text: &str| Some(Word::Doing(text.to_owned()));
        let said = |text: &str| Some(Word::Said(text.to_owned()));
        assert_eq!(
            status_line("   Compiling zenoh v1.10.2 (/path/with space)"),
            doing("Compiling zenoh v1.10.2")
        );
        assert_eq!(
            status_line("    Blocking waiting for file lock on build directory"),
            doing("Blocking waiting for file lock on build directory")
        );
        assert_eq!(status_line("    Finished `release` profile"), None);
        assert_eq!(
            status_line("error[E0308]: mismatched types"),
            said("error[E0308]: mismatched types")
        );
        // A compiler note that happens to begin with the same word is not cargo's.
        assert_eq!(status_line("Compiling failed"), said("Compiling failed"));
    }
}
