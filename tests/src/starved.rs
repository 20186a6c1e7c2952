//! Live tests on a machine that has no time for them.
//!
//! A live test lets real programs run against a clock. Where something else takes the processor away from them for
//! long, they rightly let go of hands and give up ticks, and the test fails without anything being wrong. [`live`]
//! tells the two apart: beside the test runs a thread that wants to wake every millisecond, and whose waking says how
//! much time the machine had to give. A failure with time enough is a failure. One without is said to be none, and the
//! same scenario is run on virtual time, where it has all the time it needs, and has to pass.

#![expect(
    clippy::print_stdout,
    reason = "the verdict is part of what a test says"
)]

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// How often the gauge wants to wake.
const PERIOD: Duration = Duration::from_millis(1);
/// A waking this late is longer than half the silence after which either side lets go.
const LONG: Duration = Duration::from_millis(50);
/// A waking this late leaves several ticks without a frame.
const LATE: Duration = Duration::from_millis(5);
/// So large a share of late wakings is no accident.
const LATE_SHARE: f64 = 0.01;

/// How late a thread woke that wanted to wake every millisecond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lateness {
    /// How often it woke.
    pub wakings: u64,
    /// How often it woke more than 5 ms late.
    pub late: u64,
    /// The latest waking.
    pub longest: Duration,
}

impl Lateness {
    fn add(&mut self, late_by: Duration) {
        self.wakings += 1;
        self.late += u64::from(LATE < late_by);
        self.longest = self.longest.max(late_by);
    }

    /// Whether programs that need to run every millisecond were kept from it.
    #[must_use]
    pub fn is_starved(&self) -> bool {
        LONG <= self.longest || LATE_SHARE * (self.wakings as f64) < self.late as f64
    }
}

struct Gauge {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Lateness>,
}

impl Gauge {
    fn start() -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&stop);
        let thread = thread::spawn(move || {
            let mut lateness = Lateness::default();
            while !seen.load(Ordering::Relaxed) {
                let wanted = Instant::now() + PERIOD;
                thread::sleep(PERIOD);
                lateness.add(wanted.elapsed());
            }
            lateness
        });
        Self { stop, thread }
    }

    fn end(self) -> Lateness {
        self.stop.store(true, Ordering::Relaxed);
        self.thread
            .join()
            .expect("the gauge only sleeps and counts")
    }
}

/// Runs a live scenario. Where it fails on a machine that starved it, says so and runs `on_virtual_time` instead.
///
/// # Panics
/// The scenario fails though the machine had time for it, or fails on virtual time.
pub fn live(scenario: impl FnOnce(), on_virtual_time: impl FnOnce()) {
    let gauge = Gauge::start();
    let outcome = catch_unwind(AssertUnwindSafe(scenario));
    judge(outcome, gauge.end(), on_virtual_time);
}

fn judge(outcome: thread::Result<()>, lateness: Lateness, on_virtual_time: impl FnOnce()) {
    let Err(failure) = outcome else { return };
    if !lateness.is_starved() {
        resume_unwind(failure);
    }
    println!(
        "starved: a thread beside this test woke up to {:.0} ms late, and more than 5 ms late {} times of {}; what failed above says \
         nothing about the programs. The same scenario on virtual time:",
        lateness.longest.as_secs_f64() * 1e3,
        lateness.late,
        lateness.wakings
    );
    on_virtual_time();
    println!("on virtual time it holds");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lateness(late: &[u64]) -> Lateness {
        let mut all = Lateness::default();
        for &late_ms in late {
            all.add(Duration::from_millis(late_ms));
        }
        all
    }

    fn failure() -> thread::Result<()> {
        Err(Box::new("the scenario failed"))
    }

    #[test]
    fn one_long_pause_or_many_late_wakings_are_starvation() {
        let mut wakings = vec![0; 10_000];
        assert!(!lateness(&wakings).is_starved());
        wakings[0] = 49;
        assert!(!lateness(&wakings).is_starved());
        wakings[0] = 50;
        assert!(lateness(&wakings).is_starved());
        wakings[..100].fill(6);
        assert!(!lateness(&wakings).is_starved());
        wakings[..101].fill(6);
        assert!(lateness(&wakings).is_starved());
    }

    #[test]
    fn a_failure_with_time_enough_stays_one() {
        let judged = catch_unwind(|| judge(failure(), lateness(&[0; 1000]), || ()));
        assert!(judged.is_err());
    }

    #[test]
    fn a_starved_failure_is_judged_on_virtual_time() {
        let starved = lateness(&[200; 1000]);
        let mut has_run = false;
        judge(failure(), starved, || has_run = true);
        assert!(has_run);
        let judged = catch_unwind(|| judge(failure(), starved, || panic!("there too")));
        assert!(judged.is_err());
    }

    #[test]
    fn what_passes_is_not_run_again() {
        let again = || panic!("it passed");
        judge(Ok(()), lateness(&[200; 1000]), again);
    }

    #[test]
    fn the_gauge_counts_as_long_as_the_scenario_lasts() {
        let gauge = Gauge::start();
        let began = Instant::now();
        while began.elapsed() < Duration::from_millis(50) {
            thread::yield_now();
        }
        let lateness = gauge.end();
        assert!((1..=60).contains(&lateness.wakings), "{lateness:?}");
    }
}
