//! Child processes: started from the workspace's root with a clean environment, stopped in order, never left behind.

use std::collections::VecDeque;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::progress::Progress;

/// How often a wait looks whether it is over. Short for a person, long for a processor.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Someone who wants us to end: Ctrl-C, a closed terminal, or SIGTERM.
#[derive(Clone)]
pub(crate) struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Listens from now on. A second signal ends this program at once; the kernel then ends its children.
    pub(crate) fn listen() -> Result<Self> {
        let heard = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            // In this order: the first signal only raises the flag, the second finds it raised.
            signal_hook::flag::register_conditional_shutdown(
                signal,
                128 + signal,
                Arc::clone(&heard),
            )
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&heard)))
            .with_context(|| format!("signal {signal} cannot be heard"))?;
        }
        Ok(Self(heard))
    }

    /// Whether one came.
    pub(crate) fn heard(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Waits that long, less when interrupted.
    pub(crate) fn wait(&self, time: Duration) {
        let end = Instant::now() + time;
        while !self.heard() {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            std::thread::sleep(left.min(LOOK_EVERY));
        }
    }
}

/// A command that runs in the workspace's root and ends when we do.
pub(crate) fn command(program: impl AsRef<OsStr>) -> Command {
    let mut command = plain_command(program);
    die_with_us(&mut command, SIGTERM);
    command
}

/// Runs a command that talks to the person itself.
pub(crate) fn run(command: &mut Command, interrupt: &Interrupt) -> Result<()> {
    let mut child = command
        .stdin(Stdio::null())
        .spawn()
        .with_context(|| format!("{} cannot be started", shown(command)))?;
    let status = wait(&mut child, interrupt, || {})?;
    ensure!(status.success(), "{} failed ({status})", shown(command));
    Ok(())
}

/// Runs a command whose output only matters when it fails: it goes to `log`, and its end is shown then.
pub(crate) fn run_quietly(
    mut command: Command,
    label: &str,
    log: &Path,
    interrupt: &Interrupt,
) -> Result<()> {
    let progress = Progress::start(label, None);
    let mut child = command
        .stdin(Stdio::null())
        .stdout(create_log(log)?)
        .stderr(append_to(log)?)
        .spawn()
        .with_context(|| format!("{} cannot be started", shown(&command)))?;
    let status = wait(&mut child, interrupt, || progress.tick())?;
    if !status.success() {
        progress.finish("failed");
        bail!(
            "{} failed ({status}); the end of {}:\n{}",
            shown(&command),
            log.display(),
            tail(log, 30)
        );
    }
    progress.finish("done");
    Ok(())
}

/// A program of ours that runs beside us until it is told to stop. Its output goes to a log.
pub(crate) struct Service {
    name: &'static str,
    child: Child,
    log: PathBuf,
    ended: bool,
}

impl Service {
    /// Starts `program` with `arguments`.
    pub(crate) fn start(
        name: &'static str,
        program: &Path,
        arguments: &[String],
        log: PathBuf,
    ) -> Result<Self> {
        let mut command = plain_command(program);
        // Its own group, so that Ctrl-C reaches us alone and the stop is in order; and when we are killed outright it
        // must not stay behind holding a port.
        die_with_us(&mut command, libc::SIGKILL);
        let child = command
            .process_group(0)
            .args(arguments)
            // A log is read in an editor as often as on a terminal.
            .env("NO_COLOR", "1")
            .stdin(Stdio::null())
            .stdout(create_log(&log)?)
            .stderr(append_to(&log)?)
            .spawn()
            .with_context(|| format!("{} cannot be started", program.display()))?;
        Ok(Self {
            name,
            child,
            log,
            ended: false,
        })
    }

    /// Fails when the process has ended by itself, with the end of its log.
    pub(crate) fn expect_alive(&mut self) -> Result<()> {
        let Some(status) = self.child.try_wait()? else {
            return Ok(());
        };
        self.ended = true;
        bail!(
            "{} ended by itself ({status}); the end of {}:\n{}",
            self.name,
            self.log.display(),
            tail(&self.log, 20)
        );
    }

    /// Asks the process to end, and insists when it has not within `patience`. Fails when it had to be killed, or ended
    /// with an error.
    pub(crate) fn stop(mut self, patience: Duration) -> Result<()> {
        self.expect_alive()?;
        send(&self.child, SIGTERM);
        let deadline = Instant::now() + patience;
        loop {
            if let Some(status) = self.child.try_wait()? {
                self.ended = true;
                return self.accept(status);
            }
            if deadline <= Instant::now() {
                bail!(
                    "{} did not stop within {patience:?} of SIGTERM and was killed",
                    self.name
                );
            }
            std::thread::sleep(LOOK_EVERY);
        }
    }

    fn accept(&self, status: ExitStatus) -> Result<()> {
        if status.success() {
            return Ok(());
        }
        bail!(
            "{} stopped with an error ({status}); the end of {}:\n{}",
            self.name,
            self.log.display(),
            tail(&self.log, 20)
        );
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        if !self.ended {
            // It may have ended in between; there is nobody left to tell.
            self.child.kill().ok();
            self.child.wait().ok();
        }
    }
}

/// The last `lines` lines of a text file, indented; says so when it is empty.
pub(crate) fn tail(path: &Path, lines: usize) -> String {
    let text = fs::read_to_string(path).unwrap_or_default();
    let mut last = VecDeque::with_capacity(lines);
    for line in text.lines() {
        if last.len() == lines {
            last.pop_front();
        }
        last.push_back(format!("    {line}"));
    }
    if last.is_empty() {
        return "    (nothing was written)".to_owned();
    }
    Vec::from(last).join("\n")
}

fn plain_command(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(crate::workspace::root());
    // `cargo run` describes xtask to us in these. Build scripts that watch them would run again for a nested cargo.
    for (name, _) in std::env::vars_os() {
        let name_text = name.to_string_lossy();
        if name_text.starts_with("CARGO_PKG_") || name_text.starts_with("CARGO_MANIFEST_") {
            command.env_remove(&name);
        }
    }
    command
}

/// Waits for the end of a child, which is asked to end when someone interrupts.
fn wait(child: &mut Child, interrupt: &Interrupt, each_look: impl Fn()) -> Result<ExitStatus> {
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status);
        }
        if interrupt.heard() {
            send(child, SIGTERM);
            child.wait()?;
            bail!("interrupted");
        }
        each_look();
        std::thread::sleep(LOOK_EVERY);
    }
}

/// The command as one would type it.
fn shown(command: &Command) -> String {
    let mut words = vec![command.get_program().to_string_lossy()];
    words.extend(command.get_args().map(OsStr::to_string_lossy));
    words.join(" ")
}

fn create_log(path: &Path) -> Result<File> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)
            .with_context(|| format!("{} cannot be made", folder.display()))?;
    }
    File::create(path).with_context(|| format!("{} cannot be written", path.display()))?;
    append_to(path)
}

/// Both outputs append, so that neither overwrites the other.
fn append_to(path: &Path) -> Result<File> {
    File::options()
        .append(true)
        .open(path)
        .with_context(|| format!("{} cannot be written", path.display()))
}

fn send(child: &Child, signal: i32) {
    let Ok(id) = i32::try_from(child.id()) else {
        return;
    };
    #[expect(
        unsafe_code,
        reason = "std can only kill; kill(2) takes two integers, and the child is ours and not yet waited for"
    )]
    unsafe {
        libc::kill(id, signal);
    }
}

/// Has the kernel send `signal` to the child when this process ends in whatever way.
#[cfg(target_os = "linux")]
fn die_with_us(command: &mut Command, signal: i32) {
    let us = std::process::id();
    #[expect(
        unsafe_code,
        reason = "runs between fork and exec: prctl and getppid are plain system calls, nothing is allocated or locked"
    )]
    unsafe {
        command.pre_exec(move || {
            if libc::prctl(libc::PR_SET_PDEATHSIG, signal) != 0 {
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

/// Only Linux has such a promise; elsewhere `Drop` covers every end but SIGKILL.
#[cfg(not(target_os = "linux"))]
fn die_with_us(_command: &mut Command, _signal: i32) {}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("teleclay-xtask-{}-{name}.log", std::process::id()))
    }

    fn shell(name: &str, script: &str) -> Service {
        let arguments = ["-c".to_owned(), script.to_owned()];
        Service::start("the shell", Path::new("/bin/sh"), &arguments, log(name)).unwrap()
    }

    /// Waits for what the service writes first, so that its traps are set.
    fn wait_for_output(service: &Service) {
        let deadline = Instant::now() + Duration::from_secs(10);
        while fs::read_to_string(&service.log).unwrap().is_empty() {
            assert!(Instant::now() < deadline, "the shell wrote nothing");
            std::thread::yield_now();
        }
    }

    #[test]
    fn a_service_that_ends_by_itself_is_reported_with_its_last_words() {
        let mut service = shell("ends", "echo out of clay >&2; exit 3");
        let end = service.child.wait().unwrap();
        assert_eq!(end.code(), Some(3));
        let error = service.expect_alive().unwrap_err().to_string();
        assert!(
            error.contains("out of clay") && error.contains('3'),
            "{error}"
        );
    }

    #[test]
    fn a_service_that_stops_cleanly_is_no_failure() {
        let service = shell(
            "clean",
            "trap 'exit 0' TERM; echo up; while :; do sleep 0.01; done",
        );
        wait_for_output(&service);
        service.stop(Duration::from_secs(10)).unwrap();
    }

    #[test]
    fn a_service_that_fails_on_its_way_out_is_a_failure() {
        let service = shell(
            "fails",
            "trap 'exit 9' TERM; echo up; while :; do sleep 0.01; done",
        );
        wait_for_output(&service);
        let error = service.stop(Duration::from_secs(10)).unwrap_err();
        assert!(error.to_string().contains('9'), "{error}");
    }

    #[test]
    fn a_service_that_will_not_stop_is_killed_and_that_is_a_failure() {
        let service = shell(
            "deaf",
            "trap '' TERM; echo up; while :; do sleep 0.01; done",
        );
        wait_for_output(&service);
        let id = service.child.id();
        let error = service.stop(Duration::from_millis(100)).unwrap_err();
        assert!(error.to_string().contains("killed"), "{error}");
        assert!(!Path::new(&format!("/proc/{id}/exe")).exists());
    }
}
