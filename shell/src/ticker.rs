//! The 1 kHz thread: absolute deadlines, so that lateness never adds up.
//!
//! A tick that starts late is made up for at once, so the mean rate stays; behind by more than [`MOST_BEHIND`] periods
//! (a suspended machine) the missed ones are given up and counted. Each tick is told how late it started; what to count
//! is the caller's.
//!
//! A step without work may rest ([`Next::Rest`]): the thread then sleeps through a number of deadlines, or until its
//! [`Waker`] wakes it, and goes on at the deadline that comes next.

use std::fmt;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::{JoinHandle, Thread};
use std::time::Duration;

/// Ticks that are made up for at most: 50 ms at 1 kHz, shorter than any watchdog here.
pub const MOST_BEHIND: u32 = 50;

/// What is asked of the scheduler for the thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scheduling {
    /// The default policy with the least timer slack.
    Normal,
    /// `SCHED_FIFO` at a low real-time priority: above everything ordinary, below the kernel's own threads.
    #[default]
    Fifo,
}

impl std::str::FromStr for Scheduling {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        match word {
            "normal" => Ok(Self::Normal),
            "fifo" => Ok(Self::Fifo),
            other => Err(format!("scheduling is `{other}`, want normal or fifo")),
        }
    }
}

impl fmt::Display for Scheduling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Normal => "normal",
            Self::Fifo => "fifo",
        })
    }
}

/// How the thread should run.
#[derive(Clone, Debug)]
pub struct TickerConfig {
    /// Name of the thread, 15 bytes at most.
    pub name: &'static str,
    /// Time between deadlines.
    pub period: Duration,
    /// What to ask the scheduler for.
    pub scheduling: Scheduling,
    /// The last part of each wait that is spun, not slept: trades processor time for punctuality. Zero for none.
    pub spin: Duration,
}

/// One tick's circumstances.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tick {
    /// Number of its deadline, from 0. It grows by one from tick to tick, and by one more for each deadline that was
    /// given up or slept through.
    pub number: u64,
    /// When the deadline was, on the clock that all threads of a process share, ns.
    pub deadline_ns: u64,
    /// How long after its deadline the tick started.
    pub lateness: Duration,
    /// Deadlines given up just before this tick.
    pub given_up: u64,
    /// Deadlines slept through just before this tick, as the one before had asked.
    pub rested: u64,
}

/// Whether the thread goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Another tick.
    Continue,
    /// Another tick after so many deadlines that are slept through, or at the next deadline after a waking.
    Rest(u32),
    /// Another tick, whose deadline, and with it every later one, is so many ns later than it would have been; negative
    /// for sooner. A thousandth of the period counts at most.
    Shift(i64),
    /// End the thread.
    Stop,
}

/// Wakes a thread that rests. Copies wake the same thread.
#[derive(Clone, Debug, Default)]
pub struct Waker(Arc<OnceLock<Thread>>);

impl Waker {
    /// Ends the thread's rest, or its next one. Nothing allocates or waits here, so a tick may wake another's thread.
    pub fn wake(&self) {
        if let Some(thread) = self.0.get() {
            thread.unpark();
        }
    }

    /// What is woken. A waker that is told twice keeps to the first.
    pub fn set(&self, ticker: &Ticker) {
        if let Some(thread) = &ticker.thread {
            // See above.
            let _ = self.0.set(thread.thread().clone());
        }
    }
}

/// A running thread. Dropping it stops and joins it.
#[derive(Debug)]
pub struct Ticker {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    scheduler: String,
}

/// Priority asked for with [`Scheduling::Fifo`]: low, since nothing here competes with another real-time program.
const FIFO_PRIORITY: i32 = 10;

impl Ticker {
    /// Starts the thread; `step` is called once a tick.
    ///
    /// # Errors
    /// The system cannot make a thread.
    pub fn spawn(
        config: TickerConfig,
        mut step: impl FnMut(Tick) -> Next + Send + 'static,
    ) -> io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let asked_to_stop = Arc::clone(&stop);
        let (obtained, scheduler) = std::sync::mpsc::sync_channel(1);
        let thread = std::thread::Builder::new()
            .name(config.name.to_owned())
            .spawn(move || {
                // The receiver waits below, so this cannot fail.
                let _ = obtained.send(platform::schedule(config.scheduling));
                run(&config, &asked_to_stop, &mut step);
            })?;
        let scheduler = scheduler
            .recv()
            .unwrap_or_else(|_| "unknown: the thread ended at once".to_owned());
        Ok(Self {
            stop,
            thread: Some(thread),
            scheduler,
        })
    }

    /// What the scheduler granted, in words.
    pub fn scheduler(&self) -> &str {
        &self.scheduler
    }

    /// Whether the thread has ended, by [`Next::Stop`] or a panic.
    pub fn is_finished(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }
}

impl Drop for Ticker {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // A panic in the thread was printed by it; there is nothing to add here.
            let _ = thread.join();
        }
    }
}

/// The time that deadlines are told in, ns.
pub(crate) fn now_ns() -> u64 {
    platform::now_ns()
}

/// Processor time that the calling thread has taken so far, ns: what others take from it meanwhile is not in it.
pub fn thread_time_ns() -> u64 {
    platform::thread_time_ns()
}

fn run(config: &TickerConfig, stop: &AtomicBool, step: &mut impl FnMut(Tick) -> Next) {
    let period = (config.period.as_nanos() as u64).max(1);
    let spin = config.spin.as_nanos() as u64;
    let mut deadline = platform::now_ns() + period;
    let (mut number, mut rested) = (0, 0);
    while !stop.load(Ordering::Relaxed) {
        platform::sleep_until(deadline.saturating_sub(spin));
        while platform::now_ns() < deadline {
            std::hint::spin_loop();
        }
        let late = platform::now_ns().saturating_sub(deadline);
        let behind = late / period;
        let given_up = if u64::from(MOST_BEHIND) < behind {
            behind
        } else {
            0
        };
        number += given_up;
        deadline += given_up * period;
        let next = step(Tick {
            number,
            deadline_ns: deadline,
            lateness: Duration::from_nanos(late),
            given_up,
            rested,
        });
        number += 1;
        rested = 0;
        deadline += match next {
            Next::Stop => return,
            Next::Continue => period,
            Next::Shift(shift_ns) => shifted(period, shift_ns),
            Next::Rest(most) => {
                let next = deadline + period;
                rest_until(next + u64::from(most) * period);
                rested = slept_through(next, period, platform::now_ns());
                period + rested * period
            }
        };
        number += rested;
    }
}

/// A period, longer by a shift; the rate stays within a thousandth of what was asked for whoever shifts.
fn shifted(period: u64, shift_ns: i64) -> u64 {
    let most = (period / 1000) as i64;
    period.saturating_add_signed(shift_ns.clamp(-most, most))
}

/// Sleeps, unless the thread is woken.
fn rest_until(until_ns: u64) {
    let asleep_ns = until_ns.saturating_sub(platform::now_ns());
    // It may end for no reason: that is a rest cut short.
    std::thread::park_timeout(Duration::from_nanos(asleep_ns));
}

/// How many deadlines are over at `now_ns`, of which `next_ns` is the first.
fn slept_through(next_ns: u64, period: u64, now_ns: u64) -> u64 {
    now_ns.saturating_sub(next_ns).div_ceil(period)
}

#[cfg(target_os = "linux")]
mod platform {
    //! `clock_nanosleep` with `TIMER_ABSTIME`, which std does not offer, and the scheduler calls.
    #![allow(
        unsafe_code,
        reason = "libc calls; each is given valid pointers to locals and its result is checked"
    )]

    use super::{FIFO_PRIORITY, Scheduling};
    use std::io;

    const NS_PER_S: u64 = 1_000_000_000;

    pub(super) fn now_ns() -> u64 {
        read(libc::CLOCK_MONOTONIC)
    }

    pub(super) fn thread_time_ns() -> u64 {
        read(libc::CLOCK_THREAD_CPUTIME_ID)
    }

    fn read(clock: libc::clockid_t) -> u64 {
        let mut now = libc::timespec {
            tv_sec: 0,
            tv_nsec: 0,
        };
        // SAFETY: `now` is a valid timespec; both clocks always exist.
        unsafe { libc::clock_gettime(clock, &raw mut now) };
        now.tv_sec as u64 * NS_PER_S + now.tv_nsec as u64
    }

    pub(super) fn sleep_until(deadline_ns: u64) {
        let deadline = libc::timespec {
            tv_sec: (deadline_ns / NS_PER_S) as libc::time_t,
            tv_nsec: (deadline_ns % NS_PER_S) as libc::c_long,
        };
        // SAFETY: `deadline` is valid; a null remainder is allowed with TIMER_ABSTIME. Interrupted: sleep on.
        while unsafe {
            libc::clock_nanosleep(
                libc::CLOCK_MONOTONIC,
                libc::TIMER_ABSTIME,
                &raw const deadline,
                std::ptr::null_mut(),
            )
        } == libc::EINTR
        {}
    }

    pub(super) fn schedule(asked: Scheduling) -> String {
        // SAFETY: plain integers. The default slack of 50 us would be added to every sleep of a normal thread.
        let slack = unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1_u64, 0_u64, 0_u64, 0_u64) };
        let slack = if slack == 0 {
            "timer slack 1 ns"
        } else {
            "default timer slack"
        };
        if asked == Scheduling::Normal {
            return format!("normal, as asked; {slack}");
        }
        let parameters = libc::sched_param {
            sched_priority: FIFO_PRIORITY,
        };
        // SAFETY: `parameters` is valid; 0 is the calling thread.
        if unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) } == 0 {
            return format!("SCHED_FIFO {FIFO_PRIORITY}, as asked");
        }
        format!(
            "normal; SCHED_FIFO refused ({}); {slack}",
            io::Error::last_os_error()
        )
    }
}

#[cfg(not(target_os = "linux"))]
mod platform {
    //! The portable fall-back: std's clock and sleep, no scheduler calls.

    use super::Scheduling;
    use std::sync::LazyLock;
    use std::time::{Duration, Instant};

    static START: LazyLock<Instant> = LazyLock::new(Instant::now);

    pub(super) fn now_ns() -> u64 {
        START.elapsed().as_nanos() as u64
    }

    /// The time that passes, which is what can be had everywhere.
    pub(super) fn thread_time_ns() -> u64 {
        now_ns()
    }

    pub(super) fn sleep_until(deadline_ns: u64) {
        let now = now_ns();
        if now < deadline_ns {
            std::thread::sleep(Duration::from_nanos(deadline_ns - now));
        }
    }

    pub(super) fn schedule(asked: Scheduling) -> String {
        match asked {
            Scheduling::Normal => "normal, as asked".to_owned(),
            Scheduling::Fifo => {
                "normal; real-time scheduling is only asked for on Linux".to_owned()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The deadline that comes next is not among them, nor is one that is now.
    #[test]
    fn deadlines_that_are_over_were_slept_through_and_no_other() {
        for (now_ns, slept) in [
            (6_900, 0),
            (7_000, 0),
            (7_001, 1),
            (8_000, 1),
            (8_001, 2),
            (57_000, 50),
        ] {
            assert_eq!(slept_through(7_000, 1000, now_ns), slept, "at {now_ns}");
        }
    }

    /// A rest of minutes ends when somebody wakes the thread; ticks and deadlines that were slept through are the time
    /// that has passed.
    #[test]
    fn a_rest_ends_early_for_whoever_wakes_and_its_deadlines_are_counted() {
        let (told, ticks) = std::sync::mpsc::channel();
        let config = TickerConfig {
            name: "resting",
            period: Duration::from_millis(1),
            scheduling: Scheduling::Normal,
            spin: Duration::ZERO,
        };
        let ticker = Ticker::spawn(config, move |tick| {
            // Nobody listens at the end.
            let _ = told.send(tick);
            Next::Rest(1_000_000)
        })
        .unwrap();
        let waker = Waker::default();
        waker.set(&ticker);
        let mut last: Option<Tick> = None;
        for _ in 0..5 {
            let tick = ticks.recv().unwrap();
            if let Some(last) = last {
                assert_eq!(tick.number, last.number + 1 + tick.rested + tick.given_up);
            }
            last = Some(tick);
            waker.wake();
        }
    }

    #[test]
    fn a_shift_changes_the_rate_by_a_thousandth_at_most() {
        for (shift_ns, expected) in [
            (0, 1_000_000),
            (-500, 999_500),
            (i64::MAX, 1_001_000),
            (i64::MIN, 999_000),
        ] {
            assert_eq!(shifted(1_000_000, shift_ns), expected);
        }
    }

    /// A lower limit has the thread refused; a higher one gives more than is asked for.
    #[test]
    fn the_unit_for_systemd_lets_the_thread_have_its_priority() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let unit = std::fs::read_to_string(folder.join("../ops/teleclay-server.service")).unwrap();
        let has = |line: &str| unit.lines().any(|has| has == line);
        assert!(has(&format!("LimitRTPRIO={FIFO_PRIORITY}")));
        assert!(has("RestrictRealtime=no"));
    }
}
