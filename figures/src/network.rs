//! Round trips: the product's, beside a bare Zenoh ping-pong and a bare UDP one between the same two cores.

use std::net::{SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use serde_json::Value;
use teleclay_doors::Authority;
use teleclay_journal::{Disk, Reader};
use teleclay_shell::network::{CONTROL_QOS, Endpoints, open};

use crate::row::{Row, quantile};

/// Exchanges of each kind, and the time between them: the loop's own rhythm, so that caches and cores are as cold as
/// they are for it.
const EXCHANGES: u32 = 3_000;
pub(crate) const PACE: Duration = Duration::from_millis(1);
/// As long as a frame with a few sweeps.
pub(crate) const PAYLOAD: usize = 240;
/// A tick's wait is half a millisecond on average; the rest is what this project may add.
const ALLOWANCE_S: f64 = 0.6e-3;
/// What encryption may add: both ways, both ends.
const FOR_ENCRYPTION_S: f64 = 0.15e-3;
/// What writing history may add to a tick.
const FOR_THE_JOURNAL_S: f64 = 1e-6;
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

const HTTP: &str = "127.0.0.1:18099";
const ZENOH: &str = "tcp/127.0.0.1:17499";
const ZENOH_ECHO: &str = "tcp/127.0.0.1:17489";
const ENCRYPTED_ECHO: &str = "quic/127.0.0.1:17495";
const LATENESS_P99: &str = "teleclay_lateness_seconds{quantile=\"0.99\"}";
const UDP_ECHO: &str = "127.0.0.1:17488";

/// A child that ends with this value.
pub(crate) struct Held(pub(crate) Child);

impl Drop for Held {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

pub(crate) fn rows() -> anyhow::Result<Vec<Row>> {
    let mut udp = udp_round_trips().context("bare UDP")?;
    let mut bare = zenoh_round_trips(ZENOH_ECHO).context("bare Zenoh")?;
    let mut encrypted = zenoh_round_trips(ENCRYPTED_ECHO).context("bare Zenoh over QUIC")?;
    std::fs::remove_dir_all(folder())?;
    let product = product_round_trips(Keeping::Journal).context("server and handle")?;
    let ephemeral = product_round_trips(Keeping::Nothing).context("a server that keeps nothing")?;
    let (udp_p50, bare_p50) = (quantile(&mut udp, 0.5), quantile(&mut bare, 0.5));
    Ok(vec![
        Row::new("bare_udp_round_trip_p50_s", "s", bare_p50, udp_p50),
        Row::new("bare_zenoh_round_trip_p50_s", "s", bare_p50, bare_p50).beside(udp_p50),
        Row::new(
            "bare_zenoh_encrypted_round_trip_p50_s",
            "s",
            bare_p50 + FOR_ENCRYPTION_S,
            quantile(&mut encrypted, 0.5),
        )
        .beside(bare_p50),
        Row::new("round_trip_p50_s", "s", bare_p50 + ALLOWANCE_S, product.p50).beside(bare_p50),
        Row::new(
            "round_trip_p99_s",
            "s",
            quantile(&mut bare, 0.99) + 1e-3,
            product.p99,
        )
        .beside(quantile(&mut bare, 0.99)),
        Row::new("loop_tick_work_p50_s", "s", 10e-6 + 10e-6, product.tick_p50),
        Row::new("loop_late_tick_share", "1", 0.001, product.late_share),
        Row::new(
            "loop_tick_work_with_journal_p50_s",
            "s",
            ephemeral.tick_p50 + FOR_THE_JOURNAL_S,
            product.tick_p50,
        )
        .beside(ephemeral.tick_p50),
        Row::new(
            "loop_lateness_with_journal_p99_s",
            "s",
            1.1 * ephemeral.lateness_p99,
            product.lateness_p99,
        )
        .beside(ephemeral.lateness_p99),
        Row::new(
            "journal_bytes_per_sweep",
            "B",
            64.0,
            product.bytes_per_sweep,
        ),
    ])
}

pub(crate) fn myself(arguments: &[&str]) -> anyhow::Result<Held> {
    let program = std::env::current_exe()?;
    Ok(Held(
        Command::new(program)
            .args(arguments)
            .stdin(Stdio::null())
            .spawn()?,
    ))
}

pub(crate) fn echo_udp(address: SocketAddr) -> anyhow::Result<()> {
    let socket = UdpSocket::bind(address)?;
    socket.set_read_timeout(Some(PATIENCE))?;
    let mut buffer = [0; 2048];
    while let Ok((length, from)) = socket.recv_from(&mut buffer) {
        socket.send_to(&buffer[..length], from)?;
    }
    Ok(())
}

fn udp_round_trips() -> anyhow::Result<Vec<u64>> {
    let _echo = myself(&["--echo-udp", UDP_ECHO])?;
    let socket = UdpSocket::bind("127.0.0.1:0")?;
    socket.connect(UDP_ECHO)?;
    socket.set_read_timeout(Some(Duration::from_millis(100)))?;
    let mut buffer = [0; PAYLOAD];
    let started = Instant::now();
    while socket
        .send(&buffer)
        .and_then(|_| socket.recv(&mut buffer))
        .is_err()
    {
        anyhow::ensure!(started.elapsed() < PATIENCE, "the echo does not answer");
    }
    let mut times = Vec::new();
    for _ in 0..EXCHANGES {
        std::thread::sleep(PACE);
        let sent = Instant::now();
        socket.send(&buffer)?;
        if socket.recv(&mut buffer).is_ok() {
            times.push(sent.elapsed().as_nanos() as u64);
        }
    }
    Ok(times)
}

pub(crate) fn runtime() -> anyhow::Result<tokio::runtime::Runtime> {
    Ok(tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()?)
}

pub(crate) fn failed(error: zenoh::Error) -> anyhow::Error {
    anyhow::anyhow!("zenoh: {error}")
}

pub(crate) async fn publisher(
    session: &zenoh::Session,
    key: impl Into<String>,
) -> anyhow::Result<zenoh::pubsub::Publisher<'static>> {
    let (congestion, priority, is_express, reliability) = CONTROL_QOS;
    session
        .declare_publisher(key.into())
        .congestion_control(congestion)
        .priority(priority)
        .express(is_express)
        .reliability(reliability)
        .await
        .map_err(failed)
}

pub(crate) fn echo_zenoh(endpoint: &str) -> anyhow::Result<()> {
    use zenoh::Wait as _;
    runtime()?.block_on(async {
        let authority = Authority::open(&folder())?;
        let identity = authority.issue(&["127.0.0.1".to_owned()])?;
        let endpoints = Endpoints {
            identity: Some((identity.chain_pem, identity.key_pem)),
            ..Endpoints::listening(endpoint.parse()?)
        };
        let session = open(&endpoints).await?;
        let back = publisher(&session, "figures/pong").await?;
        let _echo = session
            .declare_subscriber("figures/ping")
            .callback(move |sample| {
                // An error means that the session is closing.
                let _ = back.put(sample.payload().to_bytes().into_owned()).wait();
            })
            .await
            .map_err(failed)?;
        tokio::time::sleep(PATIENCE).await;
        Ok(())
    })
}

/// The authority of echoes that are encrypted: theirs, and trusted by whoever asks them.
pub(crate) fn folder() -> PathBuf {
    std::env::temp_dir().join("teleclay-figures-authority")
}

fn zenoh_round_trips(endpoint: &str) -> anyhow::Result<Vec<u64>> {
    use zenoh::Wait as _;
    let _echo = myself(&["--echo-zenoh", endpoint])?;
    let runtime = runtime()?;
    runtime.block_on(async {
        let authority = Authority::open(&folder())?;
        let endpoints = Endpoints {
            trusted: Some(authority.pem().to_owned()),
            ..Endpoints::connecting(endpoint.parse()?)
        };
        let session = open(&endpoints).await?;
        let out = publisher(&session, "figures/ping").await?;
        let (arrived, arrivals) = std::sync::mpsc::channel();
        let _pong = session
            .declare_subscriber("figures/pong")
            .callback(move |_| {
                // It fails when the measurement is over.
                let _ = arrived.send(Instant::now());
            })
            .await
            .map_err(failed)?;
        let payload = vec![0_u8; PAYLOAD];
        let started = Instant::now();
        loop {
            out.put(payload.clone()).wait().map_err(failed)?;
            if arrivals.recv_timeout(Duration::from_millis(50)).is_ok() {
                break;
            }
            anyhow::ensure!(started.elapsed() < PATIENCE, "the echo does not answer");
        }
        while arrivals.try_recv().is_ok() {}
        let mut times = Vec::new();
        for _ in 0..EXCHANGES {
            std::thread::sleep(PACE);
            let sent = Instant::now();
            out.put(payload.clone()).wait().map_err(failed)?;
            if let Ok(came) = arrivals.recv_timeout(Duration::from_millis(100)) {
                times.push(came.duration_since(sent).as_nanos() as u64);
            }
        }
        Ok(times)
    })
}

/// Whether a server keeps what happens.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Keeping {
    Journal,
    Nothing,
}

struct Product {
    p50: f64,
    p99: f64,
    tick_p50: f64,
    late_share: f64,
    lateness_p99: f64,
    bytes_per_sweep: f64,
}

/// The real server and the real handle, cutting; figures as the session tells them.
fn product_round_trips(keeping: Keeping) -> anyhow::Result<Product> {
    let folder = std::env::current_exe()?
        .parent()
        .context("a program lies in a folder")?
        .to_owned();
    let data = std::env::temp_dir().join(format!("teleclay-figures-{}", std::process::id()));
    let _server = Held(
        Command::new(folder.join("teleclay-server"))
            .args(["--listen", HTTP, "--zenoh-listen", ZENOH, "--data-dir"])
            .arg(&data)
            .args((keeping == Keeping::Nothing).then_some("--ephemeral"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .context("teleclay-server")?,
    );
    let _handle = Held(
        Command::new(folder.join("teleclay-handle"))
            .args([
                "--connect",
                ZENOH,
                "--session",
                "demo",
                "--device",
                "simulated",
                "--intent",
                "cutting",
            ])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .context("teleclay-handle")?,
    );
    let started = Instant::now();
    let connected = loop {
        let state = session();
        match state {
            Ok(state) if state["tools"][0]["connected"] == true => break state,
            _ if PATIENCE < started.elapsed() => bail!("no handle joined"),
            _ => std::thread::sleep(Duration::from_millis(50)),
        }
    };
    std::thread::sleep(Duration::from_secs(8));
    let state = session()?;
    let lateness_p99 = lateness_p99_s()?;
    let bytes = journal_bytes(&data, keeping)?;
    // The server may have made it, or not.
    let _ = std::fs::remove_dir_all(&data);
    let number = |path: &str| {
        state
            .pointer(path)
            .and_then(Value::as_f64)
            .with_context(|| format!("no number at {path}"))
    };
    let before = |path: &str| {
        connected
            .pointer(path)
            .and_then(Value::as_f64)
            .unwrap_or(0.0)
    };
    let ticks = number("/loop/ticks")? - before("/loop/ticks");
    let late = number("/loop/late_ticks")? - before("/loop/late_ticks");
    Ok(Product {
        p50: number("/loop/rtt_s/p50")?,
        p99: number("/loop/rtt_s/p99")?,
        tick_p50: number("/loop/tick_s/p50")?,
        late_share: late / ticks,
        lateness_p99,
        bytes_per_sweep: bytes / number("/tools/0/sweeps_durable")?,
    })
}

/// Bytes of records and what stands around them, without what is reserved for more.
fn journal_bytes(data: &Path, keeping: Keeping) -> anyhow::Result<f64> {
    if keeping == Keeping::Nothing {
        return Ok(0.0);
    }
    let reader = Reader::verify(Disk::existing(data.join("sessions/of/demo"))?)?;
    let bytes: u64 = reader.spare().map(|(_, used)| used).sum();
    Ok(bytes as f64)
}

fn lateness_p99_s() -> anyhow::Result<f64> {
    let shown = ureq::get(format!("http://{HTTP}/metrics"))
        .call()?
        .body_mut()
        .read_to_string()?;
    let line = shown
        .lines()
        .find(|line| line.starts_with(LATENESS_P99))
        .with_context(|| format!("no {LATENESS_P99} among the metrics"))?;
    let value = line.rsplit(' ').next().unwrap_or_default();
    Ok(value.parse()?)
}

fn session() -> anyhow::Result<Value> {
    Ok(ureq::get(format!("http://{HTTP}/api/v1/sessions/demo"))
        .call()?
        .body_mut()
        .read_json()?)
}
