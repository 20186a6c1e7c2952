//! How far a command has come, on standard error, once it has taken a while.

use std::io::{IsTerminal as _, Write as _};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Quicker commands show nothing.
const QUIET: Duration = Duration::from_secs(1);
/// Between two lines where nobody sees a bar move.
const BETWEEN_LINES: Duration = Duration::from_secs(2);

/// A bar on a terminal, a line now and then elsewhere, nothing for what is quick.
pub(super) struct Showing {
    what: &'static str,
    began: Instant,
    last_line: Instant,
    bar: Option<ProgressBar>,
    is_terminal: bool,
}

impl Showing {
    /// Nothing to see yet.
    pub(super) fn new(what: &'static str) -> Self {
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
    pub(super) fn at(&mut self, share: f64) {
        if self.began.elapsed() < QUIET {
            return;
        }
        if self.is_terminal {
            const STEPS: u64 = 1000;
            let bar = self.bar.get_or_insert_with(|| {
                let style = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} % {eta}");
                let bar = ProgressBar::new(STEPS).with_message(self.what);
                bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
            });
            bar.set_position((share * STEPS as f64) as u64);
        } else if BETWEEN_LINES <= self.last_line.elapsed() {
            self.last_line = Instant::now();
            // Standard error that is closed is nobody's loss.
            let _ = writeln!(std::io::stderr(), "{}: {:.0} %", self.what, 100.0 * share);
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
