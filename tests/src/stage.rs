//! The programs as processes: a server, handles, a relay between them.

use std::ffi::OsStr;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::Duration;

use anyhow::{Context as _, Result};
use serde_json::Value;

use crate::client::Client;
use crate::process::{PATIENCE, Process, program, wait_for};
use crate::recording::{Row, read};

/// The session that a server starts with.
pub const DEMO: &str = "demo";

/// The token of servers that listen beyond loopback.
pub const TOKEN: &str = "a-token-for-tests-only";

/// Which transport handles use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Retransmits: what is lost comes late.
    Tcp,
    /// Does not: what is lost is lost.
    Udp,
    /// Does for what must arrive, and not for frames; encrypted.
    Quic,
}

/// Ports that nobody uses now: one for HTTP, two neighbours for Zenoh.
#[derive(Clone, Copy, Debug)]
pub struct Ports {
    /// HTTP and WebSocket.
    pub http: u16,
    /// Zenoh's control session; slow state is on the next one.
    pub zenoh: u16,
}

impl Ports {
    /// Looks for them.
    ///
    /// # Errors
    /// All are taken.
    pub fn free() -> Result<Self> {
        Ok(Self {
            http: free_ports(1)?,
            zenoh: free_ports(2)?,
        })
    }
}

/// A UDP port of loopback that nobody uses now.
///
/// # Errors
/// The system has none.
pub fn free_udp() -> Result<SocketAddr> {
    Ok(UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?.local_addr()?)
}

/// The first of `count` ports in a row that nobody uses. Connections take theirs from 32768 on, and a test that has
/// made thousands keeps them for a minute; so these lie below, and every process looks elsewhere first.
fn free_ports(count: u16) -> Result<u16> {
    const FIRST: u16 = 12_000;
    const PORTS: u16 = 20_000;
    static LOOKS: AtomicU16 = AtomicU16::new(0);
    let own = std::process::id().wrapping_mul(37) % u32::from(PORTS);
    let is_free = |port: u16| {
        TcpListener::bind((Ipv4Addr::LOCALHOST, port)).is_ok()
            && UdpSocket::bind((Ipv4Addr::LOCALHOST, port)).is_ok()
    };
    (0..1000)
        .find_map(|_| {
            let look = u32::from(LOOKS.fetch_add(count, Ordering::Relaxed));
            let port = FIRST + ((own + look) % u32::from(PORTS)) as u16;
            (port..port + count).all(is_free).then_some(port)
        })
        .with_context(|| format!("no {count} ports in a row are free"))
}

/// A running server.
#[derive(Debug)]
pub struct Server {
    /// The process.
    pub process: Process,
    /// Its HTTP interface.
    pub client: Client,
    host: Ipv4Addr,
    ports: Ports,
    transport: Transport,
    data: PathBuf,
}

/// What a server that was killed has left.
#[derive(Debug)]
pub struct Remains {
    /// Its ports.
    pub ports: Ports,
    /// Its data folder.
    pub data: PathBuf,
}

impl Server {
    /// Starts one on these ports of loopback, and waits until it is ready.
    ///
    /// # Errors
    /// It does not become ready.
    pub fn start(ports: Ports, transport: Transport) -> Result<Self> {
        Self::start_on(Ipv4Addr::LOCALHOST, ports, transport)
    }

    /// Starts one on free ports of loopback, with TCP, that has the token [`TOKEN`].
    ///
    /// # Errors
    /// As [`start`](Self::start).
    pub fn with_token() -> Result<Self> {
        let host = Ipv4Addr::LOCALHOST;
        Self::start_as(host, Ports::free()?, Transport::Tcp, Some(TOKEN))
    }

    /// Starts one whose Zenoh listens on `host`; beyond loopback it has the token [`TOKEN`]. HTTP stays on loopback.
    ///
    /// # Errors
    /// It does not become ready.
    pub fn start_on(host: Ipv4Addr, ports: Ports, transport: Transport) -> Result<Self> {
        let token = (!host.is_loopback()).then_some(TOKEN);
        Self::start_as(host, ports, transport, token)
    }

    /// Starts one where an earlier one was killed, on loopback, with TCP.
    ///
    /// # Errors
    /// As [`start`](Self::start).
    pub fn start_again(remains: Remains) -> Result<Self> {
        let Remains { ports, data } = remains;
        Self::start_in(data, Ipv4Addr::LOCALHOST, ports, Transport::Tcp, None)
    }

    /// Starts one with a data folder of the test's own.
    ///
    /// # Errors
    /// As [`start`](Self::start).
    pub fn start_on_data(data: PathBuf) -> Result<Self> {
        let ports = Ports::free()?;
        Self::start_again(Remains { ports, data })
    }

    /// Starts one on `host` whose Zenoh is encrypted and that has the token [`TOKEN`].
    ///
    /// # Errors
    /// As [`start`](Self::start).
    pub fn secure(host: Ipv4Addr) -> Result<Self> {
        Self::secure_at(host, Ports::free()?)
    }

    /// The same on these ports.
    ///
    /// # Errors
    /// As [`start`](Self::start).
    pub fn secure_at(host: Ipv4Addr, ports: Ports) -> Result<Self> {
        Self::start_as(host, ports, Transport::Quic, Some(TOKEN))
    }

    fn start_as(
        host: Ipv4Addr,
        ports: Ports,
        transport: Transport,
        token: Option<&str>,
    ) -> Result<Self> {
        let data = crate::process::scratch()?.join("data");
        Self::start_in(data, host, ports, transport, token)
    }

    fn start_in(
        data: PathBuf,
        host: Ipv4Addr,
        ports: Ports,
        transport: Transport,
        token: Option<&str>,
    ) -> Result<Self> {
        let mut command = Command::new(program("teleclay-server")?);
        command
            .env_remove("TELECLAY_TOKEN")
            .args(["--listen", &format!("127.0.0.1:{}", ports.http)])
            .args(["--zenoh-listen", &endpoint_on(host, transport, ports.zenoh)])
            .arg("--data-dir")
            .arg(&data);
        if transport != Transport::Quic {
            command.arg("--without-tls");
        }
        if let Some(token) = token {
            let config = crate::process::scratch()?.join("server.toml");
            std::fs::write(&config, format!("token = \"{token}\"\n"))?;
            command.arg("--config").arg(config);
        }
        let mut process = Process::start("the server", command)?;
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, ports.http));
        let client = Client::new(address, token);
        wait_for("the server to be ready", PATIENCE, || {
            let alive = process.expect_alive();
            (alive.is_err() || client.is_ready()).then_some(alive)
        })??;
        Ok(Self {
            process,
            client,
            host,
            ports,
            transport,
            data,
        })
    }

    /// Invites somebody, as a person beside the server would; gives what is printed, line by line.
    ///
    /// # Errors
    /// The command fails; then what it says.
    pub fn invite(&self, flags: &[&str]) -> Result<Vec<String>> {
        self.beside(&[&["invite", DEMO], flags].concat())
    }

    /// Takes an invite back, by its number.
    ///
    /// # Errors
    /// The command fails; then what it says.
    pub fn revoke(&self, number: &str) -> Result<Vec<String>> {
        self.beside(&["invites", "--revoke", number])
    }

    /// Ends it without a word, and keeps what it has written.
    ///
    /// # Errors
    /// It cannot be waited for.
    pub fn kill_and_keep(mut self) -> Result<Remains> {
        self.process.kill()?;
        // Dropped, the server removes its folder; it goes on under another name.
        let data = std::mem::take(&mut self.data);
        Ok(Remains {
            ports: self.ports,
            data,
        })
    }

    /// Runs a command of the server's program on its data folder; gives what it prints, line by line.
    ///
    /// # Errors
    /// The command fails; then what it says.
    pub fn beside(&self, words: &[&str]) -> Result<Vec<String>> {
        let ran = Command::new(program("teleclay-server")?)
            .args(words)
            .arg("--data-dir")
            .arg(&self.data)
            .output()?;
        anyhow::ensure!(
            ran.status.success(),
            "{}",
            String::from_utf8_lossy(&ran.stderr)
        );
        let said = String::from_utf8(ran.stdout)?;
        Ok(said.lines().map(str::to_owned).collect())
    }

    /// Its data folder.
    pub fn data(&self) -> &Path {
        &self.data
    }

    /// Starts one on free ports, with TCP.
    ///
    /// # Errors
    /// As [`start`](Self::start).
    pub fn on_free_ports() -> Result<Self> {
        Self::start(Ports::free()?, Transport::Tcp)
    }

    /// Ends it without a word; give the ports to [`start`](Self::start) to have it back.
    ///
    /// # Errors
    /// It cannot be waited for.
    pub fn kill(mut self) -> Result<Ports> {
        self.process.kill()?;
        Ok(self.ports)
    }

    /// Where handles connect to.
    pub fn endpoint(&self) -> String {
        endpoint_on(self.host, self.transport, self.ports.zenoh)
    }

    /// Where everything but frames goes.
    pub fn slow_endpoint(&self) -> String {
        endpoint_on(self.host, self.transport, self.ports.zenoh + 1)
    }

    /// The address of the control session.
    pub fn zenoh_address(&self) -> SocketAddr {
        SocketAddr::from((self.host, self.ports.zenoh))
    }

    /// Its ports.
    pub fn ports(&self) -> Ports {
        self.ports
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // Nothing of a test is kept; what cannot be ended or removed is left to whoever started the test.
        let _ = self.process.kill();
        if !self.data.as_os_str().is_empty() {
            let _ = std::fs::remove_dir_all(&self.data);
        }
    }
}

/// The endpoint of a port of loopback.
pub fn endpoint(transport: Transport, port: u16) -> String {
    endpoint_on(Ipv4Addr::LOCALHOST, transport, port)
}

fn endpoint_on(host: Ipv4Addr, transport: Transport, port: u16) -> String {
    match transport {
        Transport::Tcp => format!("tcp/{host}:{port}"),
        Transport::Udp => format!("udp/{host}:{port}"),
        Transport::Quic => format!("quic/{host}:{port}"),
    }
}

/// A running handle that writes every tick down.
#[derive(Debug)]
pub struct Handle {
    /// The process.
    pub process: Process,
    recording: PathBuf,
}

/// What a handle is told.
#[derive(Clone, Debug)]
pub struct HandleOptions {
    /// Where the server is.
    pub connect: String,
    /// The session.
    pub session: String,
    /// Who holds it.
    pub operator: String,
    /// Further flags.
    pub more: Vec<String>,
}

impl HandleOptions {
    /// Ada, who cuts in the session `demo`.
    pub fn new(connect: &str) -> Self {
        Self {
            connect: connect.to_owned(),
            session: DEMO.to_owned(),
            operator: "Ada".to_owned(),
            more: Vec::new(),
        }
    }

    /// Ada, who was invited by this line.
    pub fn invited(line: &str) -> Self {
        Self {
            connect: String::new(),
            ..Self::new("").with(&["--invite", line])
        }
    }

    /// Somebody else.
    #[must_use]
    pub fn by(mut self, operator: &str) -> Self {
        operator.clone_into(&mut self.operator);
        self
    }

    /// In another session.
    #[must_use]
    pub fn in_session(mut self, session: &str) -> Self {
        session.clone_into(&mut self.session);
        self
    }

    /// With further flags.
    #[must_use]
    pub fn with(mut self, flags: &[&str]) -> Self {
        self.more.extend(flags.iter().map(|&flag| flag.to_owned()));
        self
    }
}

impl Handle {
    /// Starts one.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(options: &HandleOptions) -> Result<Self> {
        let command = Command::new(program("teleclay-handle")?);
        Self::start_as(command, options)
    }

    /// Starts one by way of another command, such as one that enters a network namespace.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start_as(mut command: Command, options: &HandleOptions) -> Result<Self> {
        let recording = crate::process::scratch()?.join("ticks.csv");
        command
            .env_remove("TELECLAY_TOKEN")
            .args(["--operator", &options.operator])
            .arg("--json")
            .arg("--record")
            .arg(&recording)
            .args(options.more.iter().map(OsStr::new));
        // An invite says where to.
        if !options.connect.is_empty() {
            let place = ["--connect", &options.connect, "--session", &options.session];
            command.args(place);
        }
        let process = Process::start(&options.operator, command)?;
        Ok(Self { process, recording })
    }

    /// What it wrote down so far.
    ///
    /// # Errors
    /// The file is not what it should be.
    pub fn ticks(&self) -> Result<Vec<Row>> {
        read(&std::fs::read_to_string(&self.recording)?)
    }

    /// Its last line of status, once there is one.
    pub fn status(&self) -> Option<Value> {
        let printed = self.process.stdout();
        // The last line may still be on its way.
        let whole = &printed[..printed.rfind('\n')?];
        serde_json::from_str(whole.lines().last()?).ok()
    }

    /// Waits for a status that `is_wanted`.
    ///
    /// # Errors
    /// None came in time.
    pub fn status_when(
        &self,
        what: &str,
        patience: Duration,
        is_wanted: impl Fn(&Value) -> bool,
    ) -> Result<Value> {
        wait_for(what, patience, || {
            self.status().filter(|status| is_wanted(status))
        })
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        if !std::thread::panicking()
            && let Some(folder) = self.recording.parent()
        {
            // What is left behind here is only untidy.
            std::fs::remove_dir_all(folder).ok();
        }
    }
}
