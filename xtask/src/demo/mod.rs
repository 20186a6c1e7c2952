//! `cargo demo`: builds what changed, starts a server and a simulated handle, and shows where to look.
//!
//! The two run as separate processes and meet over Zenoh, as they would on two machines. Their logs and the server's data
//! lie in target/demo-data; each demo starts with fresh clay.

mod addresses;
mod client;
mod record;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use clap::Args;

use self::addresses::{HttpAddress, ZenohEndpoint};
use self::client::{Client, SESSION, SessionView};
use self::record::Record;
use crate::process::{Interrupt, Service};
use crate::workspace::Workspace;
use crate::{dashboard, release, tools};

/// Loading the clay and opening Zenoh takes a fraction of a second; a loaded machine may need more.
const READY_WITHIN: Duration = Duration::from_secs(30);
/// A handle joins with its first query, and asks again when a query is lost.
const JOIN_WITHIN: Duration = Duration::from_secs(15);
/// How often something that will soon be there is looked for.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// How often the session is asked how it does.
const POLL_EVERY: Duration = Duration::from_millis(500);
/// A clean stop says goodbye to the other side and writes the session down.
const STOP_WITHIN: Duration = Duration::from_secs(10);

/// What `cargo demo` can be told.
#[derive(Args, Clone)]
pub(crate) struct Options {
    /// Stop after that many seconds, print a summary, and fail if anything went wrong
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=86_400))]
    seconds: Option<u64>,
    /// Where the server offers the dashboard and its HTTP interface
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8080")]
    listen: HttpAddress,
    /// Where handle and server meet
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:7547")]
    zenoh_listen: ZenohEndpoint,
    /// What the simulated operator does, as `teleclay-handle --intent`
    #[arg(long, default_value = "cutting")]
    intent: String,
}

impl Options {
    /// A run of `seconds` on ports that nobody uses now.
    pub(crate) fn on_free_ports(seconds: u64) -> Result<Self> {
        Ok(Self {
            seconds: Some(seconds),
            listen: HttpAddress::free()?,
            zenoh_listen: ZenohEndpoint::free()?,
            intent: "cutting".to_owned(),
        })
    }
}

/// Builds, starts, and watches until the time is over or someone interrupts.
pub(crate) fn run(options: &Options, interrupt: &Interrupt) -> Result<()> {
    // Whatever can be known to fail is said before minutes of building.
    options.listen.require_free()?;
    options.zenoh_listen.require_free()?;
    tools::require_node()?;
    let workspace = Workspace::find()?;
    dashboard::build(&workspace, interrupt)?;
    release::build(&workspace, interrupt)?;

    let data = fresh_folder(&workspace)?;
    let client = Client::new(&options.listen.reachable());
    let mut processes = Processes {
        server: start_server(options, &workspace, &data)?,
        handle: None,
    };
    processes.wait_for(READY_WITHIN, interrupt, "the server to be ready", || {
        client.is_ready()
    })?;
    let before = client.session()?;
    processes.handle = Some(start_handle(options, &workspace, &data)?);
    processes.wait_for(JOIN_WITHIN, interrupt, "the handle to join", || {
        client.session().is_ok_and(|session| session.is_operated())
    })?;

    say_where_to_look(options, &data);
    let record = watch(options, &client, before, &mut processes, interrupt)?;
    processes.stop()?;
    println!("\n{record}");
    match options.seconds {
        Some(seconds) if interrupt.heard() => bail!("interrupted before the {seconds} s were over"),
        Some(_) => record.judge(),
        // Someone who looked at the page and has seen enough wants no verdict.
        None => Ok(()),
    }
}

/// Server and handle. Dropped, both are killed: no way out of the demo leaves one behind.
struct Processes {
    server: Service,
    handle: Option<Service>,
}

impl Processes {
    fn expect_alive(&mut self) -> Result<()> {
        self.server.expect_alive()?;
        self.handle.as_mut().map_or(Ok(()), Service::expect_alive)
    }

    fn wait_for(
        &mut self,
        time: Duration,
        interrupt: &Interrupt,
        what: &str,
        is_there: impl Fn() -> bool,
    ) -> Result<()> {
        let deadline = Instant::now() + time;
        while !is_there() {
            self.expect_alive()?;
            if interrupt.heard() {
                bail!("interrupted");
            }
            if deadline <= Instant::now() {
                bail!(
                    "waited {} s in vain for {what}; the logs are in target/demo-data",
                    time.as_secs()
                );
            }
            interrupt.wait(LOOK_EVERY);
        }
        Ok(())
    }

    /// The handle first, so that it can say goodbye to a server that still listens.
    fn stop(self) -> Result<()> {
        let handle = self
            .handle
            .map_or(Ok(()), |handle| handle.stop(STOP_WITHIN));
        self.server.stop(STOP_WITHIN).and(handle)
    }
}

fn start_server(options: &Options, workspace: &Workspace, data: &Path) -> Result<Service> {
    let arguments = [
        "--listen".to_owned(),
        options.listen.to_string(),
        "--zenoh-listen".to_owned(),
        options.zenoh_listen.to_string(),
        "--data-dir".to_owned(),
        data.join("server").display().to_string(),
    ];
    let program = workspace.program("teleclay-server");
    Service::start("the server", &program, &arguments, data.join("server.log"))
}

fn start_handle(options: &Options, workspace: &Workspace, data: &Path) -> Result<Service> {
    let arguments = [
        "--connect".to_owned(),
        options.zenoh_listen.reachable(),
        "--session".to_owned(),
        SESSION.to_owned(),
        "--device".to_owned(),
        "simulated".to_owned(),
        "--intent".to_owned(),
        options.intent.clone(),
    ];
    let program = workspace.program("teleclay-handle");
    Service::start("the handle", &program, &arguments, data.join("handle.log"))
}

fn fresh_folder(workspace: &Workspace) -> Result<PathBuf> {
    let folder = workspace.target.join("demo-data");
    if folder.exists() {
        std::fs::remove_dir_all(&folder)
            .with_context(|| format!("{} cannot be emptied", folder.display()))?;
    }
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("{} cannot be made", folder.display()))?;
    Ok(folder)
}

fn say_where_to_look(options: &Options, data: &Path) {
    println!("\nA simulated hand cuts clay, across Zenoh, a thousand times a second.");
    println!("  logs       {}", data.display());
    match options.seconds {
        Some(seconds) => println!("  ends       by itself after {seconds} s, or with Ctrl-C"),
        None => println!("  ends       with Ctrl-C"),
    }
    println!("  dashboard  http://{}/", options.listen.reachable());
}

fn watch(
    options: &Options,
    client: &Client,
    before: SessionView,
    processes: &mut Processes,
    interrupt: &Interrupt,
) -> Result<Record> {
    let (asked_at, first) = client.session_and_time()?;
    let end = options.seconds.map(|s| asked_at + Duration::from_secs(s));
    let mut record = Record::begin(before, asked_at, first);
    loop {
        let left = end.map(|end| end.saturating_duration_since(Instant::now()));
        interrupt.wait(left.map_or(POLL_EVERY, |left| left.min(POLL_EVERY)));
        processes.expect_alive()?;
        let (asked_at, session) = client.session_and_time()?;
        record.add(asked_at, session);
        if interrupt.heard() || end.is_some_and(|end| end <= Instant::now()) {
            return Ok(record);
        }
    }
}
