//! `cargo demo` after the build: starts a server and a simulated handle, shows where to look, and says how it went.
//!
//! The two run as separate processes and meet over Zenoh, as they would on two machines.

use std::fmt;
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};
use clap::Args;
use teleclay_proto::http::{Session, SessionState};

use crate::client::Client;
use crate::process::{Process, program, wait_for};
use crate::stage::{DEMO, Ports, Transport, endpoint};

/// Loading the clay and opening Zenoh takes a fraction of a second; a loaded machine may need more.
const READY_WITHIN: Duration = Duration::from_secs(30);
/// A handle joins with its first query, and asks again when a query is lost.
const JOIN_WITHIN: Duration = Duration::from_secs(15);
/// How often the session is asked how it does.
const POLL_EVERY: Duration = Duration::from_millis(500);
/// Waits longer than this would make Ctrl-C feel deaf.
const LISTEN_EVERY: Duration = Duration::from_millis(50);
/// A clean stop says goodbye to the other side.
const STOP_WITHIN: Duration = Duration::from_secs(10);
/// The loop's rate, ticks per second, and how far a run may be from it. The ticks themselves are counted against an
/// absolute clock; the margin is for asking twice over HTTP on a busy machine.
const RATE_HZ: f64 = 1000.0;
const RATE_MARGIN_HZ: f64 = 15.0;

/// What a demo is told.
#[derive(Args, Debug)]
pub struct Options {
    /// Where the server offers HTTP; a free port when absent
    #[arg(long)]
    listen: Option<String>,
    /// Where handle and server meet; a free port when absent
    #[arg(long)]
    zenoh_listen: Option<String>,
    /// A folder for logs and the server's data, emptied first
    #[arg(long)]
    data: PathBuf,
    /// When to stop; with Ctrl-C when absent
    #[arg(long)]
    seconds: Option<u64>,
    /// What the simulated operator does
    #[arg(long, default_value = "cutting")]
    intent: String,
}

/// Starts both, and watches until the time is over or `interrupted` becomes true.
///
/// # Errors
/// A program did not start, or ended by itself; with `seconds` also whatever was not as it must be.
#[expect(clippy::print_stdout, reason = "the demo talks to a person")]
pub fn run(options: &Options, interrupted: &AtomicBool) -> Result<()> {
    if options.data.exists() {
        fs::remove_dir_all(&options.data).context("the last demo's folder cannot be emptied")?;
    }
    fs::create_dir_all(&options.data)?;
    let ports = Ports::free()?;
    let listen = options
        .listen
        .clone()
        .unwrap_or_else(|| format!("127.0.0.1:{}", ports.http));
    let zenoh = options
        .zenoh_listen
        .clone()
        .unwrap_or_else(|| endpoint(Transport::Tcp, ports.zenoh));
    let token = std::env::var("TELECLAY_TOKEN").ok();
    let address = reachable(&listen);
    let client = Client::new(
        address.parse().context("no address to listen on")?,
        token.as_deref(),
    );
    let start = |name: &str, file: &str, arguments: &[&str]| {
        let mut command = Command::new(program(&format!("teleclay-{file}"))?);
        command.args(arguments);
        let log = options.data.join(format!("{file}.log"));
        Process::start_with_log(name, command, log)
    };

    let data = options.data.join("server");
    let data = data.to_string_lossy();
    let arguments = [
        "--listen",
        &listen,
        "--zenoh-listen",
        &zenoh,
        "--data-dir",
        &data,
    ];
    let mut server = start("the server", "server", &arguments)?;
    await_with(
        &mut [&mut server],
        READY_WITHIN,
        interrupted,
        "the server to be ready",
        || client.is_ready(),
    )?;
    let mut record = Record::begin(Look::at(&client.session(DEMO)?));
    let (connect, intent) = (reachable(&zenoh), options.intent.as_str());
    let arguments = [
        "--connect",
        &connect,
        "--session",
        DEMO,
        "--device",
        "simulated",
        "--intent",
        intent,
        // Whoever tries the stop sees the tool move again once it is cleared; nobody's hand is on it.
        "--resume-after-stop",
    ];
    let mut handle = start("the handle", "handle", &arguments)?;
    await_with(
        &mut [&mut server, &mut handle],
        JOIN_WITHIN,
        interrupted,
        "the handle to join",
        || {
            client
                .session(DEMO)
                .is_ok_and(|session| Look::at(&session).is_operated)
        },
    )?;

    say_where_to_look(options, &address);
    let was_long_enough = loop {
        server.expect_alive()?;
        handle.expect_alive()?;
        let asked = Instant::now();
        let session = client.session(DEMO)?;
        // The session describes the moment half way between question and answer.
        record.add(asked + asked.elapsed() / 2, Look::at(&session));
        let is_over = || {
            options
                .seconds
                .is_some_and(|s| Duration::from_secs(s) <= record.time)
        };
        if is_over() || interrupted.load(Ordering::Relaxed) {
            break is_over();
        }
        while asked.elapsed() < POLL_EVERY && !interrupted.load(Ordering::Relaxed) {
            std::thread::sleep(LISTEN_EVERY);
        }
    };
    // The handle first, so that it can say goodbye to a server that still listens.
    let handle = handle.stop(STOP_WITHIN);
    server.stop(STOP_WITHIN).and(handle)?;
    println!("\n{record}");
    match options.seconds {
        Some(seconds) if !was_long_enough => bail!("interrupted before the {seconds} s were over"),
        Some(_) => record.judge(),
        // Someone who looked at the page and has seen enough wants no verdict.
        None => Ok(()),
    }
}

#[expect(clippy::print_stdout, reason = "the demo talks to a person")]
fn say_where_to_look(options: &Options, address: &str) {
    println!("\nA simulated hand cuts clay, across Zenoh, a thousand times a second.");
    println!("  logs       {}", options.data.display());
    match options.seconds {
        Some(seconds) => println!("  ends       by itself after {seconds} s, or with Ctrl-C"),
        None => println!("  ends       with Ctrl-C"),
    }
    println!("  dashboard  http://{address}/");
}

/// Waits for something while all processes live and nobody interrupts.
fn await_with(
    processes: &mut [&mut Process],
    patience: Duration,
    interrupted: &AtomicBool,
    what: &str,
    is_there: impl Fn() -> bool,
) -> Result<()> {
    wait_for(what, patience, || {
        let alive = processes
            .iter_mut()
            .try_for_each(|process| process.expect_alive());
        if interrupted.load(Ordering::Relaxed) {
            return Some(Err(anyhow::anyhow!("interrupted")));
        }
        (alive.is_err() || is_there()).then_some(alive)
    })?
}

/// "Every address of this machine" is a place to listen on, not one to connect to.
fn reachable(listens: &str) -> String {
    listens
        .replace("0.0.0.0", "127.0.0.1")
        .replace("[::]", "[::1]")
}

/// The session at one moment, as far as the summary tells of it.
#[derive(Clone, Debug, Default)]
struct Look {
    /// Whether an operator's frames come in.
    is_operated: bool,
    fault: Option<String>,
    scheme: String,
    scheduler: String,
    ticks: u64,
    late_ticks: u64,
    lost: u64,
    /// Medians and 99th percentiles, s.
    tick_s: [f64; 2],
    rtt_s: [f64; 2],
    initial_m3: f64,
    remaining_m3: f64,
    initial_units: u64,
    removed_units: u64,
    /// The greatest force of the clay on any tool, N.
    force_n: f64,
}

impl Look {
    fn at(session: &Session) -> Self {
        let (clay, control_loop) = (&session.clay, &session.control_loop);
        let length = |f: [f64; 3]| f[0].hypot(f[1]).hypot(f[2]);
        let reason = || session.fault.clone().unwrap_or_default();
        Self {
            is_operated: session.tools.iter().any(|tool| tool.connected),
            fault: (session.state == SessionState::Fault).then(reason),
            scheme: session.scheme.word().to_owned(),
            scheduler: control_loop.scheduler.clone(),
            ticks: control_loop.ticks,
            late_ticks: control_loop.late_ticks,
            lost: control_loop.lost,
            tick_s: [control_loop.tick_s.p50, control_loop.tick_s.p99],
            rtt_s: [control_loop.rtt_s.p50, control_loop.rtt_s.p99],
            initial_m3: clay.initial_volume_m3,
            remaining_m3: clay.remaining_volume_m3,
            initial_units: clay.initial_units,
            removed_units: clay.removed_units,
            force_n: session
                .tools
                .iter()
                .map(|tool| length(tool.force_n))
                .fold(0.0, f64::max),
        }
    }
}

/// One run: the first and the newest look at the session, and what happened in between. That the books of the clay
/// balance is asked by [`Client::session`] at every look.
struct Record {
    first: Option<(Instant, Look)>,
    newest: Look,
    time: Duration,
    /// Sum of what was cut between looks, units. A fresh block in between takes nothing away from it.
    removed_units: u64,
    peak_force_n: f64,
    looks: u32,
    looks_without_operator: u32,
    fault: Option<String>,
}

impl Record {
    /// Begins with the session as it was before a handle joined.
    fn begin(before: Look) -> Self {
        Self {
            first: None,
            newest: before,
            time: Duration::ZERO,
            removed_units: 0,
            peak_force_n: 0.0,
            looks: 0,
            looks_without_operator: 0,
            fault: None,
        }
    }

    fn add(&mut self, at: Instant, look: Look) {
        let (began, _) = self.first.get_or_insert_with(|| (at, look.clone()));
        self.time = at.saturating_duration_since(*began);
        self.removed_units += look.removed_units.saturating_sub(self.newest.removed_units);
        self.peak_force_n = self.peak_force_n.max(look.force_n);
        self.looks += 1;
        self.looks_without_operator += u32::from(!look.is_operated);
        self.fault = self.fault.take().or_else(|| look.fault.clone());
        self.newest = look;
    }

    /// Fails with everything that is not as it must be.
    fn judge(&self) -> Result<()> {
        let mut wrong = Vec::new();
        let rate = self.rate_hz();
        // Asked this way round, a rate that is not a number fails too.
        let keeps_its_rate = (rate - RATE_HZ).abs() <= RATE_MARGIN_HZ;
        if !keeps_its_rate {
            wrong.push(format!(
                "the loop ran at {rate:.1} ticks/s, not {RATE_HZ} ± {RATE_MARGIN_HZ}"
            ));
        }
        if self.removed_units == 0 {
            wrong.push("no clay was removed".to_owned());
        }
        if 0 < self.looks_without_operator {
            wrong.push(format!(
                "no handle was connected in {} of {} looks",
                self.looks_without_operator, self.looks
            ));
        }
        if let Some(reason) = &self.fault {
            wrong.push(format!("the session went into fault: {reason}"));
        }
        if !wrong.is_empty() {
            bail!("the demo ran, but {}", wrong.join("; "));
        }
        Ok(())
    }

    fn since_first(&self, count: impl Fn(&Look) -> u64) -> u64 {
        let first = self.first.as_ref().map_or(0, |(_, first)| count(first));
        count(&self.newest).saturating_sub(first)
    }

    fn rate_hz(&self) -> f64 {
        self.since_first(|look| look.ticks) as f64 / self.time.as_secs_f64()
    }
}

impl fmt::Display for Record {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let look = &self.newest;
        let cut_m3 = self.removed_units as f64 * look.initial_m3 / look.initial_units as f64;
        let ([tick_p50, tick_p99], [rtt_p50, rtt_p99]) = (look.tick_s, look.rtt_s);
        writeln!(
            f,
            "  loop         {:.1} ticks/s over {:.1} s, {} late, {:.1} µs p50 and {:.1} µs p99 a tick",
            self.rate_hz(),
            self.time.as_secs_f64(),
            self.since_first(|look| look.late_ticks),
            tick_p50 * 1e6,
            tick_p99 * 1e6
        )?;
        writeln!(
            f,
            "  round trip   {:.2} ms p50, {:.2} ms p99, {} frames lost",
            rtt_p50 * 1e3,
            rtt_p99 * 1e3,
            self.since_first(|look| look.lost)
        )?;
        writeln!(
            f,
            "  clay         {:.2} cm³ cut; {:.2} of {:.2} cm³ left",
            cut_m3 * 1e6,
            look.remaining_m3 * 1e6,
            look.initial_m3 * 1e6
        )?;
        writeln!(
            f,
            "  force        {:.2} N on the tool now, {:.2} N at most, scheme {}",
            look.force_n, self.peak_force_n, look.scheme
        )?;
        writeln!(f, "  scheduler    {}", look.scheduler)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(ticks: u64, removed_units: u64) -> Look {
        Look {
            is_operated: true,
            scheduler: "as it comes".to_owned(),
            ticks,
            tick_s: [3e-6, 9e-6],
            rtt_s: [4e-4, 9e-4],
            initial_m3: 1e-3,
            initial_units: 1000,
            removed_units,
            force_n: 5.0,
            ..Look::default()
        }
    }

    /// Ten seconds with `ticks` ticks, at the end of which `change` was seen.
    fn ten_seconds(ticks: u64, change: impl FnOnce(&mut Look)) -> Record {
        let began = Instant::now();
        let mut record = Record::begin(look(0, 0));
        record.add(began, look(500, 0));
        let mut last = look(500 + ticks, 10);
        change(&mut last);
        record.add(began + Duration::from_secs(10), last);
        record
    }

    fn complaint(record: &Record) -> String {
        record.judge().unwrap_err().to_string()
    }

    #[test]
    fn a_good_run_passes_at_both_ends_of_the_margin_and_not_beyond() {
        for ticks in [9_850, 10_000, 10_150] {
            ten_seconds(ticks, |_| {}).judge().unwrap();
        }
        for ticks in [0, 9_849, 10_151] {
            assert!(complaint(&ten_seconds(ticks, |_| {})).contains("ticks/s"));
        }
    }

    #[test]
    fn a_run_that_cuts_nothing_or_loses_its_handle_or_is_in_fault_fails() {
        let idle = ten_seconds(10_000, |last| last.removed_units = 0);
        assert!(complaint(&idle).contains("no clay was removed"));
        let alone = ten_seconds(10_000, |last| last.is_operated = false);
        assert!(complaint(&alone).contains("no handle was connected in 1 of 2"));
        let mut broken = ten_seconds(10_000, |last| last.fault = Some("not finite".to_owned()));
        broken.add(Instant::now(), look(10_500, 20));
        assert!(complaint(&broken).contains("fault: not finite"));
    }

    #[test]
    fn a_fresh_block_in_between_takes_nothing_away() {
        let mut record = ten_seconds(10_000, |_| {});
        record.add(Instant::now(), look(10_500, 0));
        record.add(Instant::now(), look(10_500, 7));
        assert_eq!(record.removed_units, 17);
    }

    #[test]
    fn the_summary_is_in_the_units_it_names() {
        let text = ten_seconds(10_000, |_| {}).to_string();
        for part in [
            "1000.0 ticks/s over 10.0 s",
            "3.0 µs p50",
            "0.40 ms p50",
            "10.00 cm³ cut",
            "5.00 N",
            "as it comes",
        ] {
            assert!(text.contains(part), "{part} in {text}");
        }
    }

    #[test]
    fn every_address_of_a_machine_is_reached_over_loopback() {
        assert_eq!(reachable("tcp/0.0.0.0:7547"), "tcp/127.0.0.1:7547");
        assert_eq!(reachable("udp/[::]:7547"), "udp/[::1]:7547");
        assert_eq!(reachable("192.0.2.7:80"), "192.0.2.7:80");
    }
}
