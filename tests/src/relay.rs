//! UDP through a bad network: what comes on one side leaves on the other as a seeded conditioner says, each direction
//! apart.
//!
//! It runs as a process of its own (`teleclay-relay`), is told what to do in lines on its standard input, and answers
//! there what it has really done: how many datagrams came, left, were lost, doubled or overtaken, and how long it held
//! them by its own clock. A test that rests on an impairment asks this first.

use std::collections::HashMap;
use std::fmt;
use std::io::{self, BufRead, Write};
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::AsRawFd;
use std::process::Command;
use std::str::FromStr;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};
use serde::{Deserialize, Serialize};
use teleclay_link::conditioner::{Conditioner, Fates, Impairment};
use teleclay_link::time::Timestamp;

use crate::process::{PATIENCE, Process, program, wait_for};

/// Datagrams in flight each way at most: seconds of frames and everything else beside them.
const IN_FLIGHT: usize = 65_536;
/// No datagram of UDP is longer.
const LONGEST: usize = 65_536;
/// Delays that are kept for the report, each way: the newest ten minutes of frames.
const DELAYS_KEPT: usize = 600_000;

/// What one direction does, in words: `delay_ms=20 jitter_ms=5 loss=0.05 duplicate=0.1 reorder=0.1`. What is left out
/// is perfect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Line(pub Impairment);

impl FromStr for Line {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut impairment = Impairment::default();
        for word in text.split_whitespace() {
            let wanted = || format!("`{word}` is no NAME=NUMBER that a line knows");
            let (name, number) = word.split_once('=').ok_or_else(wanted)?;
            let number: f64 = number.parse().map_err(|_| wanted())?;
            let is_share = (0.0..=1.0).contains(&number);
            let is_time = (0.0..=60_000.0).contains(&number);
            let time = Duration::from_secs_f64(if is_time { number * 1e-3 } else { 0.0 });
            match name {
                "delay_ms" if is_time => impairment.delay = time,
                "jitter_ms" if is_time => impairment.jitter = time,
                "loss" if is_share => impairment.loss = number,
                "duplicate" if is_share => impairment.duplicate = number,
                "reorder" if is_share => impairment.reorder = number,
                _ => return Err(wanted()),
            }
        }
        Ok(Self(impairment))
    }
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Impairment {
            delay,
            jitter,
            loss,
            duplicate,
            reorder,
            ..
        } = self.0;
        write!(
            f,
            "delay_ms={} jitter_ms={} loss={loss} duplicate={duplicate} reorder={reorder}",
            delay.as_secs_f64() * 1e3,
            jitter.as_secs_f64() * 1e3
        )
    }
}

/// What a direction has really done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Done {
    /// Datagrams that came.
    pub came: u64,
    /// Datagrams that left, copies included.
    pub left: u64,
    /// Datagrams that were lost.
    pub lost: u64,
    /// Extra copies made.
    pub doubled: u64,
    /// Datagrams that left after one that had come later.
    pub overtaken: u64,
    /// Half of those that left since the line was last changed were held no longer than this, s.
    pub delay_p50_s: f64,
    /// One in a hundred of them was held longer than this, s.
    pub delay_p99_s: f64,
}

impl Done {
    /// What was done after `before`.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        Self {
            came: self.came - before.came,
            left: self.left - before.left,
            lost: self.lost - before.lost,
            doubled: self.doubled - before.doubled,
            overtaken: self.overtaken - before.overtaken,
            ..*self
        }
    }
}

/// Both directions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Towards the server.
    pub up: Done,
    /// Towards the handle.
    pub down: Done,
}

impl Report {
    /// What was done after `before`.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        Self {
            up: self.up.since(&before.up),
            down: self.down.since(&before.down),
        }
    }
}

/// A datagram on its way.
#[derive(Clone, Debug)]
struct Datagram {
    bytes: Vec<u8>,
    /// Whose it is: index of the socket towards the server.
    client: usize,
    number: u64,
    came_at: Instant,
}

struct Direction {
    line: Conditioner<Datagram>,
    impairment: Impairment,
    is_cut: bool,
    came: u64,
    newest_left: Option<u64>,
    overtaken: u64,
    delays_s: Vec<f32>,
}

impl Direction {
    fn new(line: Line, seed: u64) -> Self {
        Self {
            line: Conditioner::new(line.0, seed, IN_FLIGHT),
            impairment: line.0,
            is_cut: false,
            came: 0,
            newest_left: None,
            overtaken: 0,
            delays_s: Vec::new(),
        }
    }

    fn change(&mut self, line: Line) {
        self.impairment = line.0;
        self.delays_s.clear();
    }

    fn settle(&mut self) {
        let loss = if self.is_cut {
            1.0
        } else {
            self.impairment.loss
        };
        self.line.impair(Impairment {
            loss,
            ..self.impairment
        });
    }

    fn push(&mut self, now: Timestamp, client: usize, bytes: &[u8]) {
        self.came += 1;
        let datagram = Datagram {
            bytes: bytes.to_vec(),
            client,
            number: self.came,
            came_at: Instant::now(),
        };
        self.line.push(now, datagram);
    }

    fn poll(&mut self, now: Timestamp) -> Option<Datagram> {
        let datagram = self.line.poll(now)?;
        if self
            .newest_left
            .is_some_and(|newest| datagram.number < newest)
        {
            self.overtaken += 1;
        } else {
            self.newest_left = Some(datagram.number);
        }
        if self.delays_s.len() < DELAYS_KEPT {
            self.delays_s.push(datagram.came_at.elapsed().as_secs_f32());
        }
        Some(datagram)
    }

    fn done(&self) -> Done {
        let Fates {
            delivered,
            lost,
            duplicated,
            overflowed,
            ..
        } = self.line.fates();
        let mut sorted = self.delays_s.clone();
        sorted.sort_by(f32::total_cmp);
        let at = |share: f64| {
            let index = (sorted.len() as f64 * share) as usize;
            sorted.get(index).map_or(0.0, |&delay| f64::from(delay))
        };
        Done {
            came: self.came,
            left: delivered,
            lost: lost + overflowed,
            doubled: duplicated,
            overtaken: self.overtaken,
            delay_p50_s: at(0.5),
            delay_p99_s: at(0.99),
        }
    }
}

/// What a relay is made of.
#[derive(Clone, Debug)]
pub struct Config {
    /// Where it takes datagrams.
    pub listen: SocketAddr,
    /// Where it sends them.
    pub to: SocketAddr,
    /// Of both directions' chance.
    pub seed: u64,
    /// Towards the server.
    pub up: Line,
    /// Towards the handle.
    pub down: Line,
}

/// Relays until standard input ends.
///
/// # Errors
/// A socket cannot be had, or a command is none.
pub fn run(config: &Config) -> Result<()> {
    sleep_precisely();
    let front = UdpSocket::bind(config.listen)
        .with_context(|| format!("cannot listen on {}", config.listen))?;
    front.set_nonblocking(true)?;
    let mut relay = Relaying {
        started: Instant::now(),
        front,
        to: config.to,
        clients: HashMap::new(),
        backs: Vec::new(),
        up: Direction::new(config.up, config.seed),
        down: Direction::new(config.down, config.seed.wrapping_add(1)),
    };
    say("ready")?;
    let mut heard = Vec::new();
    loop {
        relay.take_in()?;
        relay.let_out();
        if relay.wait()? {
            match hear(&mut heard)? {
                Heard::End => return Ok(()),
                Heard::Lines(lines) => lines.iter().try_for_each(|line| relay.obey(line))?,
            }
        }
    }
}

struct Relaying {
    started: Instant,
    front: UdpSocket,
    to: SocketAddr,
    clients: HashMap<SocketAddr, usize>,
    backs: Vec<(UdpSocket, SocketAddr)>,
    up: Direction,
    down: Direction,
}

impl Relaying {
    fn now(&self) -> Timestamp {
        Timestamp::ZERO.after(self.started.elapsed())
    }

    fn take_in(&mut self) -> Result<()> {
        let mut buffer = vec![0; LONGEST];
        // A socket that complains (nobody listens at the other end) is a network that loses.
        loop {
            match self.front.recv_from(&mut buffer) {
                Ok((length, from)) => {
                    let client = self.client(from)?;
                    let now = self.now();
                    self.up.push(now, client, &buffer[..length]);
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(_) => {}
            }
        }
        for client in 0..self.backs.len() {
            loop {
                match self.backs[client].0.recv(&mut buffer) {
                    Ok(length) => {
                        let now = self.now();
                        self.down.push(now, client, &buffer[..length]);
                    }
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                    Err(_) => {}
                }
            }
        }
        Ok(())
    }

    /// Every handle's port gets a socket of its own towards the server, as a router would do.
    fn client(&mut self, from: SocketAddr) -> Result<usize> {
        if let Some(&client) = self.clients.get(&from) {
            return Ok(client);
        }
        let any: SocketAddr = if self.to.is_ipv4() {
            ([0, 0, 0, 0], 0).into()
        } else {
            ([0_u16; 8], 0).into()
        };
        let back = UdpSocket::bind(any)?;
        back.connect(self.to)?;
        back.set_nonblocking(true)?;
        self.backs.push((back, from));
        let client = self.backs.len() - 1;
        self.clients.insert(from, client);
        Ok(client)
    }

    fn let_out(&mut self) {
        let now = self.now();
        // A datagram that cannot be sent is one that the network lost.
        while let Some(datagram) = self.up.poll(now) {
            let _ = self.backs[datagram.client].0.send(&datagram.bytes);
        }
        while let Some(datagram) = self.down.poll(now) {
            let to = self.backs[datagram.client].1;
            let _ = self.front.send_to(&datagram.bytes, to);
        }
    }

    /// Until something comes or is due. Whether standard input has something to say.
    fn wait(&self) -> Result<bool> {
        let next = [&self.up, &self.down]
            .iter()
            .filter_map(|direction| direction.line.poll_timeout())
            .min();
        let timeout = next.map(|next| next.since(self.now()));
        let mut waiting = vec![io::stdin().as_raw_fd(), self.front.as_raw_fd()];
        waiting.extend(self.backs.iter().map(|(back, _)| back.as_raw_fd()));
        wait_for_any(&waiting, timeout)
    }

    fn obey(&mut self, line: &str) -> Result<()> {
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        let parse = |text: &str| text.parse::<Line>().map_err(anyhow::Error::msg);
        match word {
            "up" => self.up.change(parse(rest)?),
            "down" => self.down.change(parse(rest)?),
            "cut" | "mend" => {
                let is_cut = word == "cut";
                (self.up.is_cut, self.down.is_cut) = (is_cut, is_cut);
            }
            "report" => {
                let report = Report {
                    up: self.up.done(),
                    down: self.down.done(),
                };
                return say(&serde_json::to_string(&report)?);
            }
            _ => bail!("`{line}` is no command of a relay"),
        }
        self.up.settle();
        self.down.settle();
        say("done")
    }
}

enum Heard {
    Lines(Vec<String>),
    End,
}

/// The whole lines that standard input has ready.
fn hear(heard: &mut Vec<u8>) -> Result<Heard> {
    let mut stdin = io::stdin().lock();
    let came = stdin.fill_buf()?;
    if came.is_empty() {
        return Ok(Heard::End);
    }
    heard.extend_from_slice(came);
    let length = came.len();
    stdin.consume(length);
    let mut lines = Vec::new();
    while let Some(end) = heard.iter().position(|&byte| byte == b'\n') {
        let line: Vec<u8> = heard.drain(..=end).collect();
        lines.push(String::from_utf8_lossy(&line).trim().to_owned());
    }
    Ok(Heard::Lines(lines))
}

fn say(line: &str) -> Result<()> {
    let mut stdout = io::stdout().lock();
    writeln!(stdout, "{line}")?;
    Ok(stdout.flush()?)
}

/// The default slack of 50 us would be added to every delay.
fn sleep_precisely() {
    #[allow(unsafe_code, reason = "plain integers; std does not offer it")]
    // SAFETY: see the reason. Refused, delays are a little longer, and the report says so.
    unsafe {
        libc::prctl(libc::PR_SET_TIMERSLACK, 1_u64, 0_u64, 0_u64, 0_u64);
    }
}

/// Waits for any of these to be readable, no longer than `timeout`. Whether the first one is.
fn wait_for_any(descriptors: &[i32], timeout: Option<Duration>) -> Result<bool> {
    let mut entries: Vec<libc::pollfd> = descriptors
        .iter()
        .map(|&fd| libc::pollfd {
            fd,
            events: libc::POLLIN,
            revents: 0,
        })
        .collect();
    let timeout = timeout.map(|timeout| libc::timespec {
        tv_sec: timeout.as_secs() as libc::time_t,
        tv_nsec: libc::c_long::from(timeout.subsec_nanos()),
    });
    let pointer = timeout
        .as_ref()
        .map_or(std::ptr::null(), std::ptr::from_ref);
    #[allow(
        unsafe_code,
        reason = "poll(2) in milliseconds is too coarse, and std has no wait for several sockets"
    )]
    // SAFETY: `entries` is valid for its length; the time is null or valid; a null mask changes no signals.
    let ready = unsafe {
        libc::ppoll(
            entries.as_mut_ptr(),
            entries.len() as libc::nfds_t,
            pointer,
            std::ptr::null(),
        )
    };
    if ready < 0 {
        let error = io::Error::last_os_error();
        ensure!(error.kind() == io::ErrorKind::Interrupted, error);
        return Ok(false);
    }
    Ok(entries[0].revents != 0)
}

/// A relay as a process.
#[derive(Debug)]
pub struct Relay {
    process: Process,
    stdin: std::process::ChildStdin,
    answers: usize,
    /// Where handles connect to.
    pub address: SocketAddr,
}

impl Relay {
    /// Starts one.
    ///
    /// # Errors
    /// It does not start.
    pub fn start(config: &Config) -> Result<Self> {
        Self::start_as(Command::new(program("teleclay-relay")?), config)
    }

    /// Starts one by way of another command, such as one that enters a network namespace.
    ///
    /// # Errors
    /// It does not start.
    pub fn start_as(mut command: Command, config: &Config) -> Result<Self> {
        command
            .args(["--listen", &config.listen.to_string()])
            .args(["--to", &config.to.to_string()])
            .args(["--seed", &config.seed.to_string()])
            .args(["--up", &config.up.to_string()])
            .args(["--down", &config.down.to_string()]);
        let mut process = Process::start("the relay", command)?;
        let stdin = process.take_stdin()?;
        let mut relay = Self {
            process,
            stdin,
            answers: 0,
            address: config.listen,
        };
        relay.answer()?;
        Ok(relay)
    }

    /// The endpoint that handles connect to.
    pub fn endpoint(&self) -> String {
        format!("udp/{}", self.address)
    }

    /// Changes what both directions do, for what comes from now on.
    ///
    /// # Errors
    /// The relay has gone.
    pub fn impair(&mut self, up: Line, down: Line) -> Result<()> {
        self.ask(&format!("up {up}"))?;
        self.ask(&format!("down {down}"))?;
        Ok(())
    }

    /// Lets nothing through any more. Gives the instant just after.
    ///
    /// # Errors
    /// The relay has gone.
    pub fn cut(&mut self) -> Result<Instant> {
        self.ask("cut")?;
        Ok(Instant::now())
    }

    /// Lets through what it did before. Gives the instant just before.
    ///
    /// # Errors
    /// The relay has gone.
    pub fn mend(&mut self) -> Result<Instant> {
        let at = Instant::now();
        self.ask("mend")?;
        Ok(at)
    }

    /// What it has done so far.
    ///
    /// # Errors
    /// The relay has gone.
    pub fn report(&mut self) -> Result<Report> {
        Ok(serde_json::from_str(&self.ask("report")?)?)
    }

    fn ask(&mut self, line: &str) -> Result<String> {
        writeln!(self.stdin, "{line}")?;
        self.stdin.flush()?;
        self.answer()
    }

    fn answer(&mut self) -> Result<String> {
        let number = self.answers;
        self.answers += 1;
        wait_for("the relay's answer", PATIENCE, || {
            if let Ok(Some(status)) = self.process.poll_end() {
                return Some(Err(anyhow::anyhow!("the relay ended: {status}")));
            }
            let printed = self.process.stdout();
            // The last line may still be on its way.
            let whole = &printed[..printed.rfind('\n')?];
            whole.lines().nth(number).map(|line| Ok(line.to_owned()))
        })?
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_reads_as_it_is_written() {
        let text = "delay_ms=20 jitter_ms=2.5 loss=0.05 duplicate=0.1 reorder=0.02";
        let line: Line = text.parse().unwrap();
        assert_eq!(line.0.delay, Duration::from_millis(20));
        assert_eq!(line.to_string(), text);
        assert_eq!("".parse(), Ok(Line::default()));
        for wrong in [
            "delay=20",
            "loss=1.5",
            "loss",
            "delay_ms=-1",
            "delay_ms=nan",
        ] {
            assert!(wrong.parse::<Line>().is_err(), "{wrong}");
        }
    }
}
