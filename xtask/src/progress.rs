//! Says what a long piece of work is doing: a line that moves on a terminal, plain lines everywhere else.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Off a terminal a line is said this often: a log stays short, and a person who follows it knows that work goes on.
const PLAIN_LINE_EVERY: Duration = Duration::from_secs(15);

/// A terminal is redrawn at most this many times a second.
const DRAWS_PER_S: u8 = 10;

/// One piece of work that is going on.
pub(crate) struct Progress {
    label: String,
    started: Instant,
    shown: Shown,
}

enum Shown {
    Bar(ProgressBar),
    Lines { last: Instant },
}

impl Progress {
    /// Starts to show work; with `total` its parts are counted.
    pub(crate) fn start(label: &str, total: Option<u64>) -> Self {
        let started = Instant::now();
        let shown = if std::io::stdout().is_terminal() {
            Shown::Bar(bar(label, total))
        } else {
            println!("{label} …");
            Shown::Lines { last: started }
        };
        Self {
            label: label.to_owned(),
            started,
            shown,
        }
    }

    /// Keeps the spinner turning.
    pub(crate) fn tick(&self) {
        if let Shown::Bar(bar) = &self.shown {
            bar.tick();
        }
    }

    /// `done` of about `total` parts are finished; `what` is being worked on.
    pub(crate) fn show(&mut self, done: u64, total: u64, what: &str) {
        match &mut self.shown {
            Shown::Bar(bar) => {
                // The total is an estimate: it may be passed, and then it grows.
                bar.set_length(total.max(done));
                bar.set_position(done);
                bar.set_message(what.to_owned());
            }
            Shown::Lines { last } if PLAIN_LINE_EVERY <= last.elapsed() => {
                *last = Instant::now();
                println!(
                    "  {done} of {total}, {}: {what}",
                    duration(self.started.elapsed())
                );
            }
            Shown::Lines { .. } => {}
        }
    }

    /// Prints a line that stays, above the one that moves.
    pub(crate) fn say(&self, line: &str) {
        match &self.shown {
            Shown::Bar(bar) => bar.suspend(|| println!("{line}")),
            Shown::Lines { .. } => println!("{line}"),
        }
    }

    /// Ends with a word and the time it took.
    pub(crate) fn finish(self, word: &str) {
        let took = duration(self.started.elapsed());
        match self.shown {
            Shown::Bar(bar) => {
                bar.finish_and_clear();
                println!("{}: {word}, {took}", self.label);
            }
            Shown::Lines { .. } => println!("  {word}, {took}"),
        }
    }
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

fn bar(label: &str, total: Option<u64>) -> ProgressBar {
    let target = ProgressDrawTarget::stdout_with_hz(DRAWS_PER_S);
    let template = if total.is_some() {
        "{spinner} {prefix} [{bar:24}] {pos} of {len}, {elapsed}  {msg}"
    } else {
        "{spinner} {prefix}, {elapsed}"
    };
    let style =
        ProgressStyle::with_template(template).expect("the templates above are well formed");
    ProgressBar::with_draw_target(total, target)
        .with_style(style.progress_chars("=> "))
        .with_prefix(label.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

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
