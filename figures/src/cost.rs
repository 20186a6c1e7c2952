//! What a live session costs its server, from outside: processor time of the whole process, beside an echo that does
//! nothing but send frames of the same length back over the same transport at the same rate.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use serde_json::{Value, json};
use teleclay_doors::Authority;
use teleclay_shell::network::{Endpoints, open};

use crate::network::{Held, PACE, PATIENCE, PAYLOAD, failed, folder, myself, publisher, runtime};
use crate::row::{self, Row};

/// Processor time is counted over this long.
const LOOKED_AT: Duration = Duration::from_secs(8);
/// What has begun settles for this long before.
const SETTLING: Duration = Duration::from_secs(2);
/// A server may cost this many times what an echo costs.
const MOST_OF_AN_ECHO: f64 = 2.0;
/// An echo answers from Zenoh's own thread, and drops two thirds of what eight send to it at once. So eight sessions
/// are held against a line of four.
const MOST_LINES: usize = 4;
/// More sessions are never asked for.
const MOST_SESSIONS: usize = 8;
/// What an idle session may take of a core.
const MOST_IDLE: f64 = 0.01;
/// A change of force or velocity that a hand does not notice.
const UNNOTICED: f64 = 0.07;
/// Sessions beside `demo` when idle ones are counted.
const IDLE: usize = 8;

const HTTP: &str = "127.0.0.1:18098";
const TOKEN: &str = "figures-figures-figures-figures";
const PORT: u16 = 17479;
const ECHO_PORT: u16 = 17469;

/// A transport of frames.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Transport {
    Tcp,
    Quic,
}

impl Transport {
    fn at(self, port: u16) -> String {
        let name = match self {
            Self::Tcp => "tcp",
            Self::Quic => "quic",
        };
        format!("{name}/127.0.0.1:{port}")
    }
}

/// Names of the rows: a session's share of a core, by transport, sessions and deadband. Eight over QUIC, with their
/// handles beside them, are more than two cores hold, so they are not asked for.
const LIVE: [(&str, Transport, usize, f64); 8] = [
    ("session_cost_tcp_1", Transport::Tcp, 1, 0.0),
    ("session_cost_tcp_4", Transport::Tcp, 4, 0.0),
    ("session_cost_tcp_8", Transport::Tcp, 8, 0.0),
    ("session_cost_tcp_deadband_1", Transport::Tcp, 1, UNNOTICED),
    ("session_cost_tcp_deadband_4", Transport::Tcp, 4, UNNOTICED),
    ("session_cost_tcp_deadband_8", Transport::Tcp, 8, UNNOTICED),
    ("session_cost_quic_1", Transport::Quic, 1, 0.0),
    ("session_cost_quic_4", Transport::Quic, 4, 0.0),
];

pub(crate) fn rows() -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    let mut echoes: Vec<(Transport, usize, f64)> = Vec::new();
    for (name, transport, sessions, deadband) in LIVE {
        let lines = sessions.min(MOST_LINES);
        let known = echoes
            .iter()
            .find(|(of, known, _)| *of == transport && *known == lines);
        let echo = match known {
            Some((_, _, cost)) => *cost,
            None => {
                let cost = echo_cost(transport, lines).context("an echo's cost")?;
                echoes.push((transport, lines, cost));
                cost
            }
        };
        let cost = live_cost(transport, sessions, deadband).with_context(|| name.to_owned())?;
        rows.push(Row::new(name, "1", MOST_OF_AN_ECHO * echo, cost).beside(echo));
    }
    let (empty, idle) = idle_costs()?;
    let each = (idle - empty) / IDLE as f64;
    rows.push(Row::new("idle_session_cost", "1", MOST_IDLE, each));
    rows.push(Row::new("idle_server_cost", "1", MOST_IDLE, empty));
    Ok(rows)
}

/// Share of a core that a process takes.
fn share_of_a_core(process: u32) -> anyhow::Result<f64> {
    std::thread::sleep(SETTLING);
    let (before, began) = (processor_s(process)?, Instant::now());
    std::thread::sleep(LOOKED_AT);
    Ok((processor_s(process)? - before) / began.elapsed().as_secs_f64())
}

/// Processor time of all threads of a process, s.
fn processor_s(process: u32) -> anyhow::Result<f64> {
    let mut sum_ns = 0.0;
    for thread in std::fs::read_dir(format!("/proc/{process}/task"))? {
        // Nanoseconds on a processor stand first; a thread may have ended meanwhile.
        let Ok(stat) = std::fs::read_to_string(thread?.path().join("schedstat")) else {
            continue;
        };
        let on_cpu: f64 = stat
            .split_whitespace()
            .next()
            .unwrap_or_default()
            .parse()
            .context("schedstat")?;
        sum_ns += on_cpu;
    }
    Ok(1e-9 * sum_ns)
}

fn scratch() -> PathBuf {
    std::env::temp_dir().join(format!("teleclay-figures-cost-{}", std::process::id()))
}

/// A server, and handles that cut in sessions of their own.
struct Stage {
    server: Held,
    handles: Vec<Held>,
    data: PathBuf,
}

impl Drop for Stage {
    fn drop(&mut self) {
        self.handles.clear();
        let _ = self.server.0.kill();
        let _ = self.server.0.wait();
        // The server may have made it, or not.
        let _ = std::fs::remove_dir_all(&self.data);
        for number in 0..MOST_SESSIONS {
            let _ = std::fs::remove_file(self.words_of(&format!("s{number}")));
        }
    }
}

impl Stage {
    fn open(transport: Transport) -> anyhow::Result<Self> {
        let data = scratch();
        let server = Command::new(program("teleclay-server")?)
            .env("TELECLAY_TOKEN", TOKEN)
            .args(["--listen", HTTP, "--zenoh-listen"])
            .arg(transport.at(PORT))
            .arg("--data-dir")
            .arg(&data)
            .arg("--no-demo-session")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .context("teleclay-server")?;
        let stage = Self {
            server: Held(server),
            handles: Vec::new(),
            data,
        };
        let started = Instant::now();
        while ask("readyz").is_err() {
            ensure!(started.elapsed() < PATIENCE, "the server is not ready");
            std::thread::sleep(Duration::from_millis(50));
        }
        Ok(stage)
    }

    fn create(id: &str, deadband: f64) -> anyhow::Result<()> {
        ureq::post(format!("http://{HTTP}/api/v1/sessions"))
            .header("Authorization", format!("Bearer {TOKEN}"))
            .send_json(json!({ "id": id, "deadband": deadband }))?;
        Ok(())
    }

    /// What the handle of a session says.
    fn words_of(&self, id: &str) -> PathBuf {
        self.data.with_extension(id)
    }

    fn join(&mut self, id: &str) -> anyhow::Result<()> {
        let line = invite(&self.data, id)?;
        let handle = Command::new(program("teleclay-handle")?)
            .args([
                "--invite",
                &line,
                "--device",
                "simulated",
                "--intent",
                "cutting",
            ])
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(self.words_of(id))?)
            .spawn()
            .context("teleclay-handle")?;
        self.handles.push(Held(handle));
        Ok(())
    }
}

fn program(name: &str) -> anyhow::Result<PathBuf> {
    Ok(std::env::current_exe()?
        .parent()
        .context("a program lies in a folder")?
        .join(name))
}

/// The line by which a handle may come in.
fn invite(data: &Path, id: &str) -> anyhow::Result<String> {
    let out = Command::new(program("teleclay-server")?)
        .env("TELECLAY_TOKEN", TOKEN)
        .args(["invite", id, "--role", "operator", "--data-dir"])
        .arg(data)
        .output()?;
    let said = String::from_utf8_lossy(&out.stdout);
    said.lines()
        .find(|line| line.starts_with("teleclay:"))
        .map(str::to_owned)
        .with_context(|| format!("no invite: {said}{}", String::from_utf8_lossy(&out.stderr)))
}

fn ask(path: &str) -> anyhow::Result<String> {
    Ok(ureq::get(format!("http://{HTTP}/{path}"))
        .header("Authorization", format!("Bearer {TOKEN}"))
        .call()?
        .body_mut()
        .read_to_string()?)
}

/// What each of so many sessions takes, in cores.
fn live_cost(transport: Transport, sessions: usize, deadband: f64) -> anyhow::Result<f64> {
    let mut stage = Stage::open(transport)?;
    for number in 0..sessions {
        let id = format!("s{number}");
        Stage::create(&id, deadband)?;
        stage.join(&id)?;
    }
    let started = Instant::now();
    loop {
        let all: Value = serde_json::from_str(&ask("api/v1/sessions")?)?;
        let all = all.as_array().context("no list of sessions")?;
        let connected = all
            .iter()
            .filter(|session| session["tools"][0]["connected"] == true);
        if connected.count() == sessions {
            break;
        }
        if PATIENCE < started.elapsed() {
            let words = (0..sessions).map(|number| stage.words_of(&format!("s{number}")));
            let words: Vec<_> = words.flat_map(std::fs::read_to_string).collect();
            bail!("not all of {sessions} handles joined: {}", words.join("\n"));
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    Ok(share_of_a_core(stage.server.0.id())? / sessions as f64)
}

/// What a server takes without a session, and with idle ones.
fn idle_costs() -> anyhow::Result<(f64, f64)> {
    let stage = Stage::open(Transport::Tcp)?;
    let empty = share_of_a_core(stage.server.0.id())?;
    for number in 0..IDLE {
        Stage::create(&format!("s{number}"), 0.0)?;
    }
    Ok((empty, share_of_a_core(stage.server.0.id())?))
}

/// What an echo takes for each of so many lines, in cores. Each is called by a process of its own, as each session is.
fn echo_cost(transport: Transport, lines: usize) -> anyhow::Result<f64> {
    let endpoint = transport.at(ECHO_PORT);
    // Made once, before all of them read it.
    Authority::open(&folder())?;
    let echo = myself(&["--echo-lines", &endpoint])?;
    let mut callers = (0..lines)
        .map(|line| Caller::begin(&endpoint, line))
        .collect::<anyhow::Result<Vec<_>>>()?;
    for caller in &mut callers {
        ensure!(caller.says()? == CALLS, "a caller hears no echo");
    }
    let share = share_of_a_core(echo.0.id())?;
    // An echo that does less has it easy: most of what was sent must have come back.
    for caller in callers {
        let came_back = caller.end()?;
        ensure!(0.9 < came_back, "of what was sent {came_back} came back");
    }
    Ok(share / lines as f64)
}

/// What a caller says once it has heard its echo.
const CALLS: &str = "calls";

/// Somebody who calls on a line, once a millisecond, until there is nobody to tell of it.
struct Caller {
    process: Held,
    said: std::io::Lines<BufReader<ChildStdout>>,
}

impl Caller {
    fn begin(endpoint: &str, line: usize) -> anyhow::Result<Self> {
        let mut process = Command::new(std::env::current_exe()?)
            .args(["--echo-lines", endpoint, "--call-line", &line.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let said = process.stdout.take().context("a caller says something")?;
        Ok(Self {
            process: Held(process),
            said: BufReader::new(said).lines(),
        })
    }

    fn says(&mut self) -> anyhow::Result<String> {
        Ok(self.said.next().context("a caller has ended")??)
    }

    /// The share of its calls that came back.
    fn end(mut self) -> anyhow::Result<f64> {
        drop(self.process.0.stdin.take());
        Ok(self.says()?.parse()?)
    }
}

/// Calls on a line until standard input ends, and tells the share of calls that came back.
pub(crate) fn call_line(endpoint: &str, line: usize) -> anyhow::Result<()> {
    use zenoh::Wait as _;
    let over = Arc::new(AtomicBool::new(false));
    let is_over = Arc::clone(&over);
    std::thread::spawn(move || {
        // What comes is nothing; that it ends is the end, as an error would be.
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        is_over.store(true, Ordering::Relaxed);
    });
    let runtime = runtime()?;
    let authority = Authority::open(&folder())?;
    let endpoints = Endpoints {
        trusted: Some(authority.pem().to_owned()),
        ..Endpoints::connecting(endpoint.parse()?)
    };
    let session = runtime.block_on(open(&endpoints))?;
    let out = runtime.block_on(publisher(&session, format!("figures/ping/{line}")))?;
    let heard = Arc::new(AtomicU64::new(0));
    let hears = Arc::clone(&heard);
    let listens = async {
        session
            .declare_subscriber(format!("figures/pong/{line}"))
            .callback(move |_| {
                hears.fetch_add(1, Ordering::Relaxed);
            })
            .await
    };
    let _pong = runtime.block_on(listens).map_err(failed)?;
    let payload = vec![0_u8; PAYLOAD];
    let (mut sent, mut next) = (0_u64, Instant::now());
    while !over.load(Ordering::Relaxed) {
        out.put(payload.clone()).wait().map_err(failed)?;
        if heard.load(Ordering::Relaxed) == 0 {
            ensure!(next.elapsed() < PATIENCE, "no echo");
            std::thread::sleep(PACE);
            continue;
        }
        if sent == 0 {
            row::say(CALLS);
            (next, sent) = (Instant::now(), 0);
            heard.store(1, Ordering::Relaxed);
        }
        sent += 1;
        next += PACE;
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    row::say(&(heard.load(Ordering::Relaxed) as f64 / sent.max(1) as f64).to_string());
    Ok(())
}

/// Sends back what comes on each line.
pub(crate) fn echo_lines(endpoint: &str) -> anyhow::Result<()> {
    use zenoh::Wait as _;
    const LINES: usize = 8;
    runtime()?.block_on(async {
        let authority = Authority::open(&folder())?;
        let identity = authority.issue(&["127.0.0.1".to_owned()])?;
        let endpoints = Endpoints {
            identity: Some((identity.chain_pem, identity.key_pem)),
            ..Endpoints::listening(endpoint.parse()?)
        };
        let session = open(&endpoints).await?;
        let mut echoes = Vec::new();
        for line in 0..LINES {
            let back = publisher(&session, format!("figures/pong/{line}")).await?;
            let echo = session
                .declare_subscriber(format!("figures/ping/{line}"))
                .callback(move |sample| {
                    // An error means that the session is closing.
                    let _ = back.put(sample.payload().to_bytes().into_owned()).wait();
                })
                .await
                .map_err(failed)?;
            echoes.push(echo);
        }
        tokio::time::sleep(10 * PATIENCE).await;
        Ok(())
    })
}
