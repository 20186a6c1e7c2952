//! Real processes under test: the release programs, on ports of their own, with their words kept and their ends
//! certain.

use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};

/// Whatever is waited for happens within this on a machine that does ten other things; a test that asks for less says
/// so itself.
pub const PATIENCE: Duration = Duration::from_secs(60);
/// How often something is looked at that tells nobody when it changes.
const LOOK_EVERY: Duration = Duration::from_millis(2);

/// Calls `look` until it gives something.
///
/// # Errors
/// It gave nothing within `patience`.
pub fn wait_for<T>(
    what: &str,
    patience: Duration,
    mut look: impl FnMut() -> Option<T>,
) -> Result<T> {
    let began = Instant::now();
    loop {
        if let Some(found) = look() {
            return Ok(found);
        }
        if patience < began.elapsed() {
            bail!("waited {:.1} s in vain for {what}", patience.as_secs_f64());
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

/// A program of this workspace that was built with this test.
///
/// # Errors
/// It is not there, or older than this test: then it is not what is to be tested.
pub fn program(name: &str) -> Result<PathBuf> {
    let test = std::env::current_exe()?;
    // target/release/deps/test-1234 or target/release/program
    let folder = test
        .ancestors()
        .skip(1)
        .find(|folder| folder.file_name().is_some_and(|name| name != "deps"))
        .context("a test lies in a folder")?;
    let path = folder.join(name);
    ensure!(
        path.is_file(),
        "{} is missing: cargo build --release first",
        path.display()
    );
    Ok(path)
}

/// A folder for one test's files, emptied when the process ends well.
pub(crate) fn scratch() -> Result<PathBuf> {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let folder =
        std::env::temp_dir().join(format!("teleclay-test-{}-{number}", std::process::id()));
    fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    Ok(folder)
}

/// A process under test. Dropped, it is killed; in a test that fails its last words are printed.
#[derive(Debug)]
pub struct Process {
    name: String,
    child: Child,
    stdout: PathBuf,
    stderr: PathBuf,
    /// The folder of a test's files, which goes with the process.
    scratch: Option<PathBuf>,
    has_ended: bool,
}

impl Process {
    /// Starts `command`, whatever it is; `name` is for people. What it says lies in a folder of its own, which ends
    /// with it.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(name: &str, command: Command) -> Result<Self> {
        let folder = scratch()?;
        let [stdout, stderr] = ["stdout", "stderr"].map(|file| folder.join(file));
        Self::spawn(name, command, stdout, stderr, Some(folder))
    }

    /// Starts `command` with all that it says in `log`, which stays. Ctrl-C reaches us alone, so that we stop it in
    /// order.
    ///
    /// # Errors
    /// It cannot be started, or the log cannot be written.
    pub fn start_with_log(name: &str, mut command: Command, log: PathBuf) -> Result<Self> {
        command.process_group(0);
        Self::spawn(name, command, log.clone(), log, None)
    }

    fn spawn(
        name: &str,
        mut command: Command,
        stdout: PathBuf,
        stderr: PathBuf,
        scratch: Option<PathBuf>,
    ) -> Result<Self> {
        let open = |path: &Path| {
            // Both outputs append, so that neither overwrites the other in a common log.
            File::create(path)
                .and_then(|_| File::options().append(true).open(path))
                .with_context(|| format!("{} cannot be written", path.display()))
        };
        command
            .env("NO_COLOR", "1")
            .stdin(Stdio::piped())
            .stdout(open(&stdout)?)
            .stderr(open(&stderr)?);
        end_with_us(&mut command);
        let child = command
            .spawn()
            .with_context(|| format!("{name} cannot be started"))?;
        Ok(Self {
            name: name.to_owned(),
            child,
            stdout,
            stderr,
            scratch,
            has_ended: false,
        })
    }

    /// What it has printed.
    pub fn stdout(&self) -> String {
        read(&self.stdout)
    }

    /// What it has logged.
    pub fn stderr(&self) -> String {
        read(&self.stderr)
    }

    /// Its id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Its standard input.
    ///
    /// # Errors
    /// Taken before.
    pub fn take_stdin(&mut self) -> Result<std::process::ChildStdin> {
        self.child.stdin.take().context("taken before")
    }

    /// Waits for a line of its log with `text` in it.
    ///
    /// # Errors
    /// None came in time, or the process has ended without one.
    pub fn logs(&mut self, text: &str, patience: Duration) -> Result<String> {
        self.logs_after(0, text, patience)
    }

    /// As [`logs`](Self::logs), from byte `from` of the log on.
    ///
    /// # Errors
    /// As there.
    pub fn logs_after(&mut self, from: usize, text: &str, patience: Duration) -> Result<String> {
        let began = Instant::now();
        loop {
            // In this order: what it said before it ended counts.
            let has_ended = self.poll_end()?;
            let log = self.stderr();
            if let Some(line) = log
                .get(from..)
                .and_then(|log| log.lines().find(|line| line.contains(text)))
            {
                return Ok(line.to_owned());
            }
            if let Some(status) = has_ended {
                bail!("{} ended ({status}) without saying `{text}`", self.name);
            }
            if patience < began.elapsed() {
                bail!(
                    "{} did not say `{text}` within {:.1} s",
                    self.name,
                    patience.as_secs_f64()
                );
            }
            std::thread::sleep(LOOK_EVERY);
        }
    }

    /// Sends a signal.
    pub fn signal(&self, signal: i32) {
        if self.has_ended {
            return;
        }
        let Ok(id) = i32::try_from(self.child.id()) else {
            return;
        };
        #[allow(
            unsafe_code,
            reason = "std can only kill; kill(2) takes two integers, and the child is ours and not yet waited for"
        )]
        // SAFETY: see the reason.
        unsafe {
            libc::kill(id, signal);
        }
    }

    /// Stops it where it stands: its connections stay, and nothing answers.
    pub fn freeze(&self) {
        self.signal(libc::SIGSTOP);
    }

    /// Lets it go on.
    pub fn thaw(&self) {
        self.signal(libc::SIGCONT);
    }

    /// Ends it without a word, as a crash does, and waits until it is gone. Gives the instant just before.
    ///
    /// # Errors
    /// It cannot be waited for.
    pub fn kill(&mut self) -> Result<Instant> {
        let at = Instant::now();
        if self.has_ended {
            return Ok(at);
        }
        self.signal(libc::SIGKILL);
        self.child.wait()?;
        self.has_ended = true;
        Ok(at)
    }

    /// Asks it to end, and gives its status.
    ///
    /// # Errors
    /// It did not end in time.
    pub fn end(&mut self) -> Result<ExitStatus> {
        self.signal(libc::SIGTERM);
        self.ends()
    }

    /// Asks it to end, as an operating system does, and insists that it does so well.
    ///
    /// # Errors
    /// It had ended before, did not end within `patience`, or ended with an error.
    pub fn stop(mut self, patience: Duration) -> Result<()> {
        self.expect_alive()?;
        self.signal(libc::SIGTERM);
        let status = self.ends_within(patience)?;
        ensure!(
            status.success(),
            "{} stopped with an error ({status}); {}",
            self.name,
            self.last_words()
        );
        Ok(())
    }

    /// Waits for it to end by itself.
    ///
    /// # Errors
    /// It did not end in time.
    pub fn ends(&mut self) -> Result<ExitStatus> {
        self.ends_within(PATIENCE)
    }

    fn ends_within(&mut self, patience: Duration) -> Result<ExitStatus> {
        let began = Instant::now();
        loop {
            if let Some(status) = self.poll_end()? {
                return Ok(status);
            }
            if patience < began.elapsed() {
                bail!("{} did not end within {patience:?}", self.name);
            }
            std::thread::sleep(LOOK_EVERY);
        }
    }

    /// Fails when it has ended by itself, with its last words.
    ///
    /// # Errors
    /// It has ended.
    pub fn expect_alive(&mut self) -> Result<()> {
        let Some(status) = self.poll_end()? else {
            return Ok(());
        };
        bail!(
            "{} ended by itself ({status}); {}",
            self.name,
            self.last_words()
        );
    }

    /// Its status, once it has ended.
    ///
    /// # Errors
    /// It cannot be asked for.
    pub fn poll_end(&mut self) -> Result<Option<ExitStatus>> {
        let status = self.child.try_wait()?;
        self.has_ended |= status.is_some();
        Ok(status)
    }

    fn last_words(&self) -> String {
        let text = self.stderr();
        let lines = text.lines().count();
        let mut words = format!("the end of {}:", self.stderr.display());
        for line in text.lines().skip(lines.saturating_sub(40)) {
            words.push_str("\n    ");
            words.push_str(line);
        }
        if lines == 0 {
            words.push_str(" nothing was written");
        }
        words
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if !self.has_ended {
            // A stopped process hears nothing but this; it may have ended in between, and there is nobody to tell.
            self.child.kill().ok();
            self.child.wait().ok();
        }
        if std::thread::panicking() {
            eprintln!("--- {}, {}", self.name, self.last_words());
        } else if let Some(folder) = &self.scratch {
            // What is left behind here is only untidy.
            fs::remove_dir_all(folder).ok();
        }
    }
}

fn read(path: &Path) -> String {
    // A file that is being written may end within a letter.
    fs::read(path)
        .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
        .unwrap_or_default()
}

/// Has the kernel kill the child when the thread that made it ends in whatever way.
fn end_with_us(command: &mut Command) {
    #[allow(
        unsafe_code,
        reason = "runs between fork and exec: prctl is a plain system call, nothing is allocated or locked"
    )]
    // SAFETY: see the reason.
    unsafe {
        command.pre_exec(|| {
            if libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) != 0 {
                return Err(std::io::Error::last_os_error());
            }
            Ok(())
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Process {
        let mut command = Command::new("/bin/sh");
        command.args(["-c", script]);
        Process::start("the shell", command).unwrap()
    }

    /// A shell that says that it is up once its trap is set, and then waits for signals.
    fn waiting(on_term: &str) -> Process {
        let script = format!("trap '{on_term}' TERM; echo up >&2; while :; do sleep 0.01; done");
        let mut process = shell(&script);
        process.logs("up", PATIENCE).unwrap();
        process
    }

    #[test]
    fn a_process_that_ends_by_itself_is_reported_with_its_last_words() {
        let mut process = shell("echo out of clay >&2; exit 3");
        process.ends().unwrap();
        let error = process.expect_alive().unwrap_err().to_string();
        assert!(
            error.contains("out of clay") && error.contains('3'),
            "{error}"
        );
    }

    #[test]
    fn only_a_clean_stop_is_no_failure() {
        waiting("exit 0").stop(PATIENCE).unwrap();
        let error = waiting("exit 9").stop(PATIENCE).unwrap_err();
        assert!(error.to_string().contains('9'), "{error}");
        let deaf = waiting("");
        let id = deaf.id();
        let error = deaf.stop(Duration::from_millis(100)).unwrap_err();
        assert!(error.to_string().contains("did not end"), "{error}");
        assert!(!Path::new(&format!("/proc/{id}/exe")).exists());
    }
}
