//! A long run of a server and a handle that cuts, with watchers that read slowly or not at all: memory must stay flat,
//! the volume balance of the clay must hold at every look, and late ticks are told.

use std::fmt;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, ensure};

use crate::process::PATIENCE;
use crate::stage::{DEMO, Handle, HandleOptions, Server};
use crate::watcher::{Got, Watcher};

/// How often memory and session are looked at.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// The slow watcher reads this many bytes this often: 4 kB/s, where 100 kB/s and more would come.
const SIP_BYTES: usize = 1024;
const SIP_EVERY: Duration = Duration::from_millis(250);

/// How much more the second half of a run may need than the first, KiB: what the allocator's arenas settle by, and less
/// than a snapshot of the clay that were kept for each of the watchers who come back.
const GROWTH_KIB: u64 = 2048;

/// What a run has shown.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// How long it was watched, after warming up, s.
    pub seconds: f64,
    /// Memory of the server.
    pub server: Memory,
    /// Memory of the handle.
    pub handle: Memory,
    /// Ticks of the server's loop a second.
    pub rate_hz: f64,
    /// Ticks of the server that started more than a period late, and all of them.
    pub late_ticks: [u64; 2],
    /// The same of the handle.
    pub handle_late_ticks: [u64; 2],
    /// Looks at the session, at each of which the volume balance held.
    pub looks: u64,
    /// Clay that was removed, fresh blocks included, units.
    pub removed_units: u64,
    /// Fresh blocks.
    pub blocks: u32,
    /// Bytes that the slow watcher took, and how often it had to come back.
    pub slow_bytes: u64,
    /// Times that a watcher was given up by the server and opened another stream.
    pub reopened: u64,
}

/// Resident memory over a run, KiB.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    samples: Vec<(f64, u64)>,
}

impl Memory {
    /// Greatest of the first half.
    pub fn early_kib(&self) -> u64 {
        self.greatest(0, 1)
    }

    /// Greatest of the second half.
    pub fn late_kib(&self) -> u64 {
        self.greatest(1, 2)
    }

    /// How much the second half needed beyond the first.
    pub fn growth_kib(&self) -> u64 {
        self.late_kib().saturating_sub(self.early_kib())
    }

    /// Slope of a straight line through all samples, KiB a minute.
    pub fn slope_kib_per_min(&self) -> f64 {
        let n = self.samples.len() as f64;
        let mean = |of: fn(&(f64, u64)) -> f64| self.samples.iter().map(of).sum::<f64>() / n;
        let (t0, m0) = (mean(|s| s.0), mean(|s| s.1 as f64));
        let (mut top, mut bottom) = (0.0, 0.0);
        for &(t, m) in &self.samples {
            top += (t - t0) * (m as f64 - m0);
            bottom += (t - t0) * (t - t0);
        }
        if bottom > 0.0 {
            60.0 * top / bottom
        } else {
            0.0
        }
    }

    fn greatest(&self, half: usize, end: usize) -> u64 {
        let middle = self.samples.len() / 2;
        let samples = &self.samples[half * middle..(end * middle).max(half * middle)];
        samples.iter().map(|sample| sample.1).max().unwrap_or(0)
    }

    fn look(&mut self, time_s: f64, process: u32) -> Result<()> {
        self.samples.push((time_s, resident_kib(process)?));
        Ok(())
    }
}

/// Runs for `seconds`, after `warm_up`.
///
/// # Errors
/// Something that should run does not, or the volume balance did not hold.
pub fn run(warm_up: Duration, seconds: Duration, emit: impl Fn(&Report)) -> Result<Report> {
    let server = Server::on_free_ports()?;
    let handle = Handle::start(&HandleOptions::new(&server.endpoint()))?;
    let client = &server.client;
    client.session_when(DEMO, "the handle to cut", PATIENCE, |session| {
        0 < session.clay.removed_units
    })?;
    let http = SocketAddr::from((Ipv4Addr::LOCALHOST, server.ports().http));
    let watchers = Watchers::start(http)?;

    let began = Instant::now();
    let mut report = Report::default();
    let mut first = None;
    let mut known = client.session(DEMO)?;
    let mut next_word = Duration::ZERO;
    while began.elapsed() < warm_up + seconds {
        std::thread::sleep(LOOK_EVERY);
        let session = client.session(DEMO)?;
        let status = handle.status();
        ensure!(session.fault.is_none(), "fault: {:?}", session.fault);
        report.looks += 1;
        let cut = session
            .clay
            .removed_units
            .saturating_sub(known.clay.removed_units);
        report.removed_units += cut;
        report.blocks += u32::from(session.clay.epoch != known.clay.epoch);
        known = session;
        if began.elapsed() < warm_up {
            continue;
        }
        let counted = |name: &str| status.as_ref().and_then(|status| status[name].as_u64());
        let now = Counts {
            at: Instant::now(),
            ticks: known.control_loop.ticks,
            late: known.control_loop.late_ticks,
            handle_ticks: counted("ticks").context("the handle tells its ticks")?,
            handle_late: counted("late_ticks").context("the handle tells its late ticks")?,
        };
        let first = *first.get_or_insert(now);
        let time = now.at - first.at;
        report.seconds = time.as_secs_f64();
        report.rate_hz = (now.ticks - first.ticks) as f64 / report.seconds.max(1e-9);
        report.late_ticks = [now.late - first.late, now.ticks - first.ticks];
        report.handle_late_ticks = [
            now.handle_late - first.handle_late,
            now.handle_ticks - first.handle_ticks,
        ];
        report.server.look(report.seconds, server.process.id())?;
        report.handle.look(report.seconds, handle.process.id())?;
        report.slow_bytes = watchers.bytes.load(Ordering::Relaxed);
        report.reopened = watchers.reopened.load(Ordering::Relaxed);
        if next_word <= time {
            next_word = time + Duration::from_secs(30);
            emit(&report);
        }
    }
    watchers.stop()?;
    Ok(report)
}

#[derive(Clone, Copy)]
struct Counts {
    at: Instant,
    ticks: u64,
    late: u64,
    handle_ticks: u64,
    handle_late: u64,
}

/// One that sips and one that does not read at all.
struct Watchers {
    stop: Arc<AtomicBool>,
    bytes: Arc<AtomicU64>,
    reopened: Arc<AtomicU64>,
    threads: Vec<JoinHandle<Result<()>>>,
}

impl Watchers {
    fn start(address: SocketAddr) -> Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let (bytes, reopened) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicU64::new(0)));
        let mut threads = Vec::new();
        for sip in [SIP_BYTES, 0] {
            let stop = Arc::clone(&stop);
            let (bytes, reopened) = (Arc::clone(&bytes), Arc::clone(&reopened));
            let first = Watcher::open(address, DEMO)?;
            threads.push(std::thread::spawn(move || {
                watch(address, first, sip, &stop, &bytes, &reopened)
            }));
        }
        Ok(Self {
            stop,
            bytes,
            reopened,
            threads,
        })
    }

    fn stop(self) -> Result<()> {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads {
            thread.join().expect("a watcher does not panic")?;
        }
        Ok(())
    }
}

fn watch(
    address: SocketAddr,
    mut watcher: Watcher,
    sip: usize,
    stop: &AtomicBool,
    bytes: &AtomicU64,
    reopened: &AtomicU64,
) -> Result<()> {
    let mut opened = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(SIP_EVERY);
        // Whoever does not read does not learn of the end either, and comes back after a while.
        let is_over = if sip == 0 {
            Duration::from_secs(15) < opened.elapsed()
        } else {
            match watcher.read(sip, SIP_EVERY)? {
                Got::Bytes(length) => {
                    bytes.fetch_add(length as u64, Ordering::Relaxed);
                    false
                }
                Got::Nothing => false,
                Got::End => true,
            }
        };
        if is_over {
            watcher = Watcher::open(address, DEMO)?;
            opened = Instant::now();
            reopened.fetch_add(1, Ordering::Relaxed);
        }
    }
    Ok(())
}

fn resident_kib(process: u32) -> Result<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status"))?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|rest| rest.split_whitespace().next())
        .context("a process has a resident size")?
        .parse()
        .context("it is a number")
}

impl Report {
    /// Fails when memory grew, or when the loop did not keep its rate.
    ///
    /// # Errors
    /// Either.
    pub fn judge(&self) -> Result<()> {
        for (name, memory) in [("server", &self.server), ("handle", &self.handle)] {
            let grown_kib = memory.growth_kib();
            ensure!(
                grown_kib <= GROWTH_KIB,
                "the {name} needed {grown_kib} KiB more in the second half of the run than in the first, want {GROWTH_KIB} at most"
            );
        }
        ensure!(
            (self.rate_hz - 1000.0).abs() <= 15.0,
            "the loop ran at {:.2} ticks/s",
            self.rate_hz
        );
        ensure!(0 < self.removed_units, "no clay was removed");
        ensure!(0 < self.slow_bytes, "the slow watcher got nothing");
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let memory = |memory: &Memory| {
            format!(
                "{:.1} MiB at most in the first half, {:.1} MiB in the second, {:+.1} KiB a minute",
                memory.early_kib() as f64 / 1024.0,
                memory.late_kib() as f64 / 1024.0,
                memory.slope_kib_per_min()
            )
        };
        let late = |[late, all]: [u64; 2]| {
            format!(
                "{late} of {all} ticks late ({:.3} %)",
                100.0 * late as f64 / all.max(1) as f64
            )
        };
        writeln!(f, "  time      {:.0} s after warming up", self.seconds)?;
        writeln!(f, "  server    {}", memory(&self.server))?;
        writeln!(f, "  handle    {}", memory(&self.handle))?;
        writeln!(
            f,
            "  loop      {:.2} ticks/s, {}; handle {}",
            self.rate_hz,
            late(self.late_ticks),
            late(self.handle_late_ticks)
        )?;
        writeln!(
            f,
            "  clay      the volume balance held at all {} looks; {} units cut, {} fresh blocks",
            self.looks, self.removed_units, self.blocks
        )?;
        write!(
            f,
            "  watchers  {} bytes sipped, streams opened again {} times",
            self.slow_bytes, self.reopened
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn memory(kib: impl Iterator<Item = u64>) -> Memory {
        Memory {
            samples: kib.enumerate().map(|(i, m)| (i as f64, m)).collect(),
        }
    }

    #[test]
    fn a_leak_shows_in_growth_and_slope_and_a_saw_does_not_grow() {
        let leak = memory((0..120).map(|i| 10_000 + 5 * i));
        assert_eq!(leak.growth_kib(), 5 * 60);
        assert!((leak.slope_kib_per_min() - 300.0).abs() < 1e-6);
        let saw = memory((0..120).map(|i| 10_000 + 100 * (i % 20)));
        assert_eq!(saw.growth_kib(), 0);
    }
}
