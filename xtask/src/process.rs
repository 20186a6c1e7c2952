//! Child processes: started from the workspace's root with a clean environment, and ended when we end.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};

/// A command that runs in the workspace's root and ends when we do.
pub(crate) fn command(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(crate::workspace::root());
    // `cargo run` describes xtask to us in these. Build scripts that watch them would run again for a nested cargo.
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        if text.starts_with("CARGO_PKG_") || text.starts_with("CARGO_MANIFEST_") {
            command.env_remove(&name);
        }
    }
    end_with_us(&mut command);
    command
}

/// Runs a command that talks to the person itself.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let status = command
        .stdin(Stdio::null())
        .status()
        .with_context(|| format!("{} cannot be started", shown(command)))?;
    ensure!(status.success(), "{} failed ({status})", shown(command));
    Ok(())
}

/// Runs a command whose output only matters when it fails: it goes to `log`, and its end is shown then.
pub(crate) fn run_quietly(mut command: Command, label: &str, log: &Path) -> Result<()> {
    if let Some(folder) = log.parent() {
        fs::create_dir_all(folder)
            .with_context(|| format!("{} cannot be made", folder.display()))?;
    }
    // Both outputs append, so that neither overwrites the other.
    let output = File::create(log)
        .and_then(|_| File::options().append(true).open(log))
        .with_context(|| format!("{} cannot be written", log.display()))?;
    println!("{label} …");
    let began = Instant::now();
    let result = run(command.stdout(output.try_clone()?).stderr(output));
    let took = duration(began.elapsed());
    if let Err(error) = result {
        println!("  failed, {took}");
        bail!("{error}; the end of {}:\n{}", log.display(), tail(log, 30));
    }
    println!("  done, {took}");
    Ok(())
}

/// What a command prints, when it can be started and succeeds.
pub(crate) fn answer(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    output.status.success().then_some(text)
}

/// Puts a program in our place: signals reach it alone, and its exit code is ours. For a plain command, whose end is
/// not tied to its parent's.
pub(crate) fn become_program(command: &mut Command) -> Result<()> {
    std::io::stdout().flush()?;
    Err(command.exec()).with_context(|| format!("{} cannot be started", shown(command)))
}

/// A time as a person says it: `0.4 s`, `12 s`, `3 min 05 s`.
pub(crate) fn duration(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    if seconds < 9.95 {
        return format!("{seconds:.1} s");
    }
    let whole = seconds.round() as u64;
    if whole < 60 {
        return format!("{whole} s");
    }
    format!("{} min {:02} s", whole / 60, whole % 60)
}

/// The last `most` lines of a text file, indented.
fn tail(path: &Path, most: usize) -> String {
    let text = fs::read_to_string(path).unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    let last = &lines[lines.len().saturating_sub(most)..];
    last.iter().map(|line| format!("    {line}\n")).collect()
}

/// The command as one would type it.
fn shown(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words
        .map(OsStr::to_string_lossy)
        .collect::<Vec<_>>()
        .join(" ")
}

/// Has the kernel send SIGTERM to the child when this process ends in whatever way.
#[cfg(target_os = "linux")]
fn end_with_us(command: &mut Command) {
    let us = std::process::id();
    #[expect(
        unsafe_code,
        reason = "runs between fork and exec: prctl and getppid are plain system calls, nothing is allocated or locked"
    )]
    unsafe {
        command.pre_exec(move || {
            if libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM) != 0 {
                return Err(std::io::Error::last_os_error());
            }
            // We may have ended before the call above: then no signal is coming.
            if u32::try_from(libc::getppid()) != Ok(us) {
                return Err(std::io::Error::from_raw_os_error(libc::ESRCH));
            }
            Ok(())
        });
    }
}

/// Only Linux has such a promise; elsewhere Ctrl-C reaches the children as it reaches us.
#[cfg(not(target_os = "linux"))]
fn end_with_us(_command: &mut Command) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_that_fails_is_shown_with_the_end_of_what_it_said() {
        let log = std::env::temp_dir().join(format!("teleclay-xtask-{}.log", std::process::id()));
        let shell = |script: &str| {
            let mut shell = command("/bin/sh");
            shell.args(["-c", script]);
            run_quietly(shell, "testing", &log)
        };
        shell("echo fine").unwrap();
        let error = shell("seq 100; echo out of clay >&2; exit 3").unwrap_err();
        let text = error.to_string();
        assert!(text.contains("exit status: 3"), "{text}");
        assert!(text.ends_with("    100\n    out of clay\n"), "{text}");
        assert!(!text.contains("\n    70\n"), "{text}");
        fs::remove_file(log).unwrap();
    }

    #[test]
    fn times_read_as_a_person_says_them() {
        let said = |s: f64| duration(Duration::from_secs_f64(s));
        assert_eq!(said(0.44), "0.4 s");
        assert_eq!(said(9.96), "10 s");
        assert_eq!(said(59.4), "59 s");
        assert_eq!(said(59.6), "1 min 00 s");
        assert_eq!(said(185.0), "3 min 05 s");
    }
}
