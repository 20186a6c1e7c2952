//! A driver on a thread of its own.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::exchange::{DriverEnds, Marks, News, TickEnds, exchange};
use crate::fault::DeviceFault;
use crate::gap::{Clocks, GapWatch};

/// What talks to a device. Every call has time as an argument, so that tests need no thread.
pub trait Driver: Send + 'static {
    /// What it drives.
    fn device(&self) -> &'static str;

    /// From one step to the next.
    fn period(&self) -> Duration;

    /// Renders `force_n` and reads where the device is; `None` where there is nothing new.
    ///
    /// # Errors
    /// The device is lost. [`rest`](Self::rest) follows, and nothing after that.
    fn step(&mut self, now_ns: u64, force_n: [f64; 3]) -> Result<Option<News>, DeviceFault>;

    /// Leaves the device without force, as far as it can still be told.
    fn rest(&mut self);
}

/// Whatever happens to a driver, a panic too, the device is left without force.
struct Resting<D: Driver>(D);

impl<D: Driver> Drop for Resting<D> {
    fn drop(&mut self) {
        self.0.rest();
    }
}

/// A driver that hangs in the kernel is not waited for longer than this.
const REST_WITHIN: Duration = Duration::from_secs(1);

/// A driver at work. Dropping it leaves the device without force, and waits a second for that.
#[derive(Debug)]
pub struct DriverThread {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    started: Instant,
}

impl DriverThread {
    /// Starts it. No force passes `most_n`.
    ///
    /// # Errors
    /// The system gave no thread.
    pub fn spawn<D: Driver>(driver: D, most_n: f64) -> Result<(Self, TickEnds), DeviceFault> {
        let (ends, tick) = exchange(most_n);
        let is_over = Arc::new(AtomicBool::new(false));
        let started = Instant::now();
        let device = driver.device();
        let over = Arc::clone(&is_over);
        let thread = std::thread::Builder::new()
            .name(device.to_owned())
            .spawn(move || drive(Resting(driver), ends, &over, started))
            .map_err(|error| DeviceFault::Thread {
                device,
                reason: error.to_string(),
            })?;
        let thread = Self {
            is_over,
            thread: Some(thread),
            started,
        };
        Ok((thread, tick))
    }

    /// The exchange's clock, ns.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        nanos(self.started.elapsed())
    }
}

impl Drop for DriverThread {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        let Some(thread) = self.thread.take() else {
            return;
        };
        let asked = Instant::now();
        while !thread.is_finished() && asked.elapsed() < REST_WITHIN {
            std::thread::sleep(Duration::from_millis(1));
        }
        if thread.is_finished() {
            // A thread that panicked has left the device without force all the same.
            let _ = thread.join();
        }
    }
}

fn drive<D: Driver>(
    mut driver: Resting<D>,
    mut ends: DriverEnds,
    is_over: &AtomicBool,
    started: Instant,
) {
    let mut gap = GapWatch::default();
    while !is_over.load(Ordering::Relaxed) {
        let began = Instant::now();
        let now_ns = nanos(began - started);
        let wall = SystemTime::now().duration_since(UNIX_EPOCH);
        let clocks = Clocks {
            now_ns,
            wall_ns: nanos(wall.unwrap_or_default()),
        };
        if let Err(fault) = turn(&mut driver.0, &mut ends, &mut gap, clocks) {
            driver.0.rest();
            ends.end(fault);
            return;
        }
        std::thread::sleep(driver.0.period().saturating_sub(began.elapsed()));
    }
}

/// One turn of a driver's thread: what it does at these clocks, without the thread.
///
/// # Errors
/// The device is lost.
pub fn turn<D: Driver>(
    driver: &mut D,
    ends: &mut DriverEnds,
    gap: &mut GapWatch,
    clocks: Clocks,
) -> Result<(), DeviceFault> {
    let slept = gap.step(clocks);
    let mut force_n = ends.force(clocks.now_ns);
    if slept {
        force_n = [0.0; 3];
        ends.mark(Marks {
            lets_go: true,
            ..Marks::default()
        });
    }
    if let Some(mut news) = driver.step(clocks.now_ns, force_n)? {
        // A button that was pressed in a gap was pressed at nobody knows what.
        news.marks.takes_hold &= !slept;
        ends.tell(news);
    }
    Ok(())
}

fn nanos(span: Duration) -> u64 {
    u64::try_from(span.as_nanos()).unwrap_or(u64::MAX)
}
