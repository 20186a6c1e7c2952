//! Real processes under test: the release programs, on ports of their own, with their words kept and their ends certain.

use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};

/// Whatever is waited for happens within this on a machine that does ten other things; a test that asks for less says so itself.
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
    anyhow::ensure!(
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
    folder: PathBuf,
    has_ended: bool,
}

impl Process {
    /// Starts `command`, whatever it is; `name` is for people.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(name: &str, mut command: Command) -> Result<Self> {
        let folder = scratch()?;
        command
            .env("NO_COLOR", "1")
            .env_remove("TELECLAY_TOKEN")
            .stdin(Stdio::piped())
            .stdout(File::create(folder.join("stdout"))?)
            .stderr(File::create(folder.join("stderr"))?);
        end_with_us(&mut command);
        let child = command
            .spawn()
            .with_context(|| format!("{name} cannot be started"))?;
        Ok(Self {
            name: name.to_owned(),
            child,
            folder,
            has_ended: false,
        })
    }

    /// What it has printed.
    pub fn stdout(&self) -> String {
        self.read("stdout")
    }

    /// What it has logged.
    pub fn stderr(&self) -> String {
        self.read("stderr")
    }

    /// The folder that its output lies in; room for other files of the test.
    pub fn folder(&self) -> &Path {
        &self.folder
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

    /// Waits for it to end by itself.
    ///
    /// # Errors
    /// It did not end in time.
    pub fn ends(&mut self) -> Result<ExitStatus> {
        let began = Instant::now();
        loop {
            if let Some(status) = self.poll_end()? {
                return Ok(status);
            }
            if PATIENCE < began.elapsed() {
                bail!("{} did not end", self.name);
            }
            std::thread::sleep(LOOK_EVERY);
        }
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

    fn read(&self, file: &str) -> String {
        // A file that is being written may end within a letter.
        fs::read(self.folder.join(file))
            .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
            .unwrap_or_default()
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
            eprintln!("--- {}, {}:", self.name, self.folder.display());
            for line in tail(&self.stderr(), 40) {
                eprintln!("    {line}");
            }
        } else {
            // What is left behind here is only untidy.
            fs::remove_dir_all(&self.folder).ok();
        }
    }
}

fn tail(text: &str, most: usize) -> impl Iterator<Item = &str> {
    let lines = text.lines().count();
    text.lines().skip(lines.saturating_sub(most))
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
