//! The 1 kHz thread: absolute deadlines, so that lateness never adds up.
//!
//! A tick that starts late is made up for at once, so the mean rate stays; behind by more than [`MOST_BEHIND`] periods
//! (a suspended machine) the missed ones are given up and counted. Each tick is told how late it started; what to count
//! is the caller's.

use std::fmt;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
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
#[derive(Clone, Copy, Debug)]
pub struct Tick {
    /// Number of the tick, from 0.
    pub number: u64,
    /// How long after its deadline the tick started.
    pub lateness: Duration,
    /// Deadlines given up just before this tick.
    pub given_up: u64,
}

/// Whether the thread goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Another tick.
    Continue,
    /// Another tick, whose deadline, and with it every later one, is so many ns later than it would have been; negative
    /// for sooner. A thousandth of the period counts at most.
    Shift(i64),
    /// End the thread.
    Stop,
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
            // A panic in the thread was printed by it; there is nothing to add here.
            let _ = thread.join();
        }
    }
}

fn run(config: &TickerConfig, stop: &AtomicBool, step: &mut impl FnMut(Tick) -> Next) {
    let period = config.period.as_nanos() as u64;
    let spin = config.spin.as_nanos() as u64;
    let mut deadline = platform::now_ns() + period;
    let mut number = 0;
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
        deadline += given_up * period;
        let lateness = Duration::from_nanos(late);
        let next = step(Tick {
            number,
            lateness,
            given_up,
        });
        number += 1;
        deadline += match next {
            Next::Stop => return,
            Next::Continue => period,
            Next::Shift(shift_ns) => shifted(period, shift_ns),
        };
    }
}

/// A period, longer by a shift; the rate stays within a thousandth of what was asked for whoever shifts.
fn shifted(period: u64, shift_ns: i64) -> u64 {
    let most = (period / 1000) as i64;
    period.saturating_add_signed(shift_ns.clamp(-most, most))
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
        let mut now = libc::timespec {
            tv_sec: 0,
            tv_nsec: 0,
        };
        // SAFETY: `now` is a valid timespec; CLOCK_MONOTONIC always exists.
        unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut now) };
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
    use super::{FIFO_PRIORITY, shifted};

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
