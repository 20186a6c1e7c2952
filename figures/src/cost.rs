//! What a live session costs its server, from outside: processor time of the whole process, beside an echo that does
//! nothing but send frames of the same length back over the same transport at the same rate.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use serde_json::{Value, json};
use teleclay_doors::Authority;
use teleclay_shell::network::{Endpoints, open};

use crate::network::{Held, PACE, PATIENCE, PAYLOAD, failed, folder, myself, publisher, runtime};
use crate::row::Row;

/// Processor time is counted over this long.
const LOOKED_AT: Duration = Duration::from_secs(8);
/// What has begun settles for this long before.
const SETTLING: Duration = Duration::from_secs(2);
/// A server may cost this many times what an echo costs.
const MOST_OF_AN_ECHO: f64 = 2.0;
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

/// Names of the rows: a session's share of a core, by transport, sessions and deadband. Eight are left out: the echo's
/// callers share a process, which does not call eight times a millisecond on two cores.
const LIVE: [(&str, Transport, usize, f64); 6] = [
    ("session_cost_tcp_1_core", Transport::Tcp, 1, 0.0),
    ("session_cost_tcp_4_core", Transport::Tcp, 4, 0.0),
    (
        "session_cost_tcp_deadband_1_core",
        Transport::Tcp,
        1,
        UNNOTICED,
    ),
    (
        "session_cost_tcp_deadband_4_core",
        Transport::Tcp,
        4,
        UNNOTICED,
    ),
    ("session_cost_quic_1_core", Transport::Quic, 1, 0.0),
    ("session_cost_quic_4_core", Transport::Quic, 4, 0.0),
];

pub(crate) fn rows() -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    let mut echoes: Vec<(Transport, usize, f64)> = Vec::new();
    for (name, transport, sessions, deadband) in LIVE {
        let known = echoes
            .iter()
            .find(|(of, lines, _)| *of == transport && *lines == sessions);
        let echo = match known {
            Some((_, _, cost)) => *cost,
            None => {
                let cost = echo_cost(transport, sessions).context("an echo's cost")?;
                echoes.push((transport, sessions, cost));
                cost
            }
        };
        let cost = live_cost(transport, sessions, deadband).with_context(|| name.to_owned())?;
        rows.push(Row::new(name, "core", MOST_OF_AN_ECHO * echo, cost).beside(echo));
    }
    let (empty, idle) = idle_costs()?;
    let each = (idle - empty) / IDLE as f64;
    rows.push(Row::new("idle_session_cost_core", "core", MOST_IDLE, each));
    rows.push(Row::new("idle_server_cost_core", "core", MOST_IDLE, empty));
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
            .stderr(Stdio::null())
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
            bail!("not all of {sessions} handles joined");
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

/// What an echo takes for each of so many lines, in cores.
fn echo_cost(transport: Transport, lines: usize) -> anyhow::Result<f64> {
    let endpoint = transport.at(ECHO_PORT);
    let echo = myself(&["--echo-lines", &endpoint])?;
    let runtime = runtime()?;
    let authority = Authority::open(&folder())?;
    let echoed = Arc::new(AtomicU64::new(0));
    let mut callers = Vec::new();
    for line in 0..lines {
        let endpoints = Endpoints {
            trusted: Some(authority.pem().to_owned()),
            ..Endpoints::connecting(endpoint.parse()?)
        };
        let session = runtime.block_on(open(&endpoints))?;
        let out = runtime.block_on(publisher(&session, format!("figures/ping/{line}")))?;
        let heard = Arc::clone(&echoed);
        let pong = runtime
            .block_on(async {
                session
                    .declare_subscriber(format!("figures/pong/{line}"))
                    .callback(move |_| {
                        heard.fetch_add(1, Ordering::Relaxed);
                    })
                    .await
            })
            .map_err(failed)?;
        callers.push((session, out, pong));
    }
    let over = Arc::new(AtomicU64::new(0));
    let share = std::thread::scope(|scope| {
        for (_, out, _) in &callers {
            let over = Arc::clone(&over);
            scope.spawn(move || {
                use zenoh::Wait as _;
                let payload = vec![0_u8; PAYLOAD];
                let mut next = Instant::now();
                while over.load(Ordering::Relaxed) == 0 {
                    // An error means that the session is closing.
                    let _ = out.put(payload.clone()).wait();
                    next += PACE;
                    std::thread::sleep(next.saturating_duration_since(Instant::now()));
                }
            });
        }
        let started = Instant::now();
        while echoed.load(Ordering::Relaxed) < 100 && started.elapsed() < PATIENCE {
            std::thread::sleep(PACE);
        }
        let before = echoed.load(Ordering::Relaxed);
        let share = share_of_a_core(echo.0.id());
        let heard = echoed.load(Ordering::Relaxed) - before;
        over.store(1, Ordering::Relaxed);
        // Who does less has it easy: most of what was sent must have come back.
        let sent = (LOOKED_AT + SETTLING).as_millis() as usize * lines;
        ensure!(
            9 * sent / 10 < heard as usize,
            "{heard} of {sent} came back"
        );
        share
    })?;
    Ok(share / lines as f64)
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
