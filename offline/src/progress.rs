//! How far a command has come, on standard error, once it has taken a while.

use std::io::{IsTerminal as _, Write as _};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Quicker commands show nothing.
const QUIET: Duration = Duration::from_secs(1);
/// Between two lines where nobody sees a bar move.
const BETWEEN_LINES: Duration = Duration::from_secs(2);

/// A bar on a terminal, a line now and then elsewhere, nothing for what is quick.
pub(crate) struct Showing {
    what: &'static str,
    began: Instant,
    last_line: Instant,
    bar: Option<ProgressBar>,
    is_terminal: bool,
}

impl Showing {
    /// Nothing to see yet.
    pub(crate) fn new(what: &'static str) -> Self {
        let now = Instant::now();
        Self {
            what,
            began: now,
            last_line: now,
            bar: None,
            is_terminal: std::io::stderr().is_terminal(),
        }
    }

    /// `share` of the work is done, 0 to 1.
    pub(crate) fn at(&mut self, share: f64) {
        const STEPS: u64 = 1000;
        self.show(format!("{:.0} %", 100.0 * share), |what| {
            let style = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} % {eta}");
            let bar = ProgressBar::new(STEPS).with_message(what);
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        if let Some(bar) = &self.bar {
            bar.set_position((share * STEPS as f64) as u64);
        }
    }

    /// The work goes on, and nobody knows for how long.
    pub(crate) fn still(&mut self) {
        let took = format!("{:.0} s", self.began.elapsed().as_secs_f64());
        self.show(took, |what| ProgressBar::new_spinner().with_message(what));
        if let Some(bar) = &self.bar {
            bar.tick();
        }
    }

    /// A bar on a terminal; elsewhere a line now and then that says how far it is.
    fn show(&mut self, how_far: String, bar: impl FnOnce(&'static str) -> ProgressBar) {
        if self.began.elapsed() < QUIET {
            return;
        }
        if self.is_terminal {
            self.bar.get_or_insert_with(|| bar(self.what));
        } else if BETWEEN_LINES <= self.last_line.elapsed() {
            self.last_line = Instant::now();
            // Standard error that is closed is nobody's loss.
            let _ = writeln!(std::io::stderr(), "{}: {how_far}", self.what);
        }
    }
}

impl Drop for Showing {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
