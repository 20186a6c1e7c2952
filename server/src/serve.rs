//! Putting it together, and taking it apart again in the right order.

use std::net::SocketAddr;
use std::sync::mpsc;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use anyhow::Context as _;
use teleclay_proto::SessionId;
use teleclay_proto::http::{ClayShape, ClaySpec, NewSession, ToolDescription};
use teleclay_shell::Clock;
use teleclay_shell::realtime::Realtime;
use teleclay_shell::ticker::{Ticker, TickerConfig};
use tokio::sync::watch;
use tokio::task::JoinHandle;

use crate::api::{self, ApiConfig};
use crate::collector::{Collector, Sources};
use crate::directory::{Directory, Parts};
use crate::engine::{CAPACITIES, Engine, TICK};
use crate::network::{Network, Sender};
use crate::settings::Settings;
use crate::statistics::LoopStats;

/// Name of the session that is there from the start.
const DEMO: &str = "demo";
/// The demo's ball: 12.8 voxels of the default clay.
const DEMO_BALL_M: f64 = 0.0064;

/// A running server.
pub struct Server {
    /// Address that HTTP really listens on.
    pub address: SocketAddr,
    directory: Directory,
    network: Network,
    // Field order is drop order: first the tick, then who empties its rings.
    ticker: Ticker,
    _collector: Collector,
    http: JoinHandle<()>,
    stop: watch::Sender<bool>,
}

impl Server {
    /// Starts everything.
    ///
    /// # Errors
    /// A port is taken, a folder cannot be made, a thread cannot be started.
    pub async fn start(settings: Settings) -> anyhow::Result<Self> {
        let started = Instant::now();
        std::fs::create_dir_all(&settings.data_dir)
            .with_context(|| format!("data folder {}", settings.data_dir.display()))?;
        let listener = api::bind(settings.listen).with_context(|| {
            format!(
                "cannot listen on {} (is another server running? --listen takes another address)",
                settings.listen
            )
        })?;
        let address = listener.local_addr()?;

        let clock = Clock::start();
        let sender = Sender::spawn()?;
        let collector = Collector::spawn()?;
        let (engine, sessions) = Engine::new(Some(sender.thread()));
        let (realtime, ends) = Realtime::new(engine, clock, CAPACITIES);
        let loop_stats = Arc::new(Mutex::new(LoopStats::default()));
        let (notices, notices_out) = mpsc::channel();
        let realtime = realtime.waking(collector.thread());
        let sources = Sources {
            timings: ends.records,
            sessions: sessions.sessions,
            events: sessions.events,
            done: ends.done,
            notices: notices_out,
        };
        let collector = collector.start(sources, Arc::clone(&loop_stats));
        let directory = Directory::new(Parts {
            orders: ends.orders,
            loop_stats,
            notices,
            node: settings.node.clone(),
            token: settings.token.clone(),
            slow_endpoint: Some(settings.zenoh_slow.clone()),
        });
        let config = TickerConfig {
            name: "teleclay-loop",
            period: TICK,
            scheduling: settings.scheduling,
            spin: settings.spin,
        };
        let ticker = realtime.spawn(config)?;
        directory.set_scheduler(ticker.scheduler());
        tracing::info!(scheduler = ticker.scheduler(), "the loop runs at 1 kHz");
        if settings.demo_session {
            directory
                .create(demo_session())
                .await
                .context("session demo")?;
        }
        let network = Network::open(
            &settings.realm,
            &settings.zenoh_control,
            &settings.zenoh_slow,
            &directory,
            sender.feed(sessions.outgoing),
            clock,
        )
        .await?;
        tracing::info!(
            control = settings.zenoh_control,
            slow = settings.zenoh_slow,
            "zenoh listens"
        );

        let router = api::router(
            directory.clone(),
            ApiConfig {
                token: settings.token,
                allowed_origins: settings.allow_origins,
                listen: address,
                node: settings.node,
                version: env!("CARGO_PKG_VERSION").to_owned(),
                started,
            },
        );
        let (stop, mut stopped) = watch::channel(false);
        let http = tokio::spawn(async move {
            let until = async move {
                // An error means that the sender is gone, which is a stop as well.
                let _ = stopped.wait_for(|stop| *stop).await;
            };
            api::serve(listener, router, until).await;
        });
        Ok(Self {
            address,
            directory,
            network,
            ticker,
            _collector: collector,
            http,
            stop,
        })
    }

    /// The sessions.
    pub fn directory(&self) -> &Directory {
        &self.directory
    }

    /// Whether the loop has ended by itself, which only a defect brings about.
    pub fn has_failed(&self) -> bool {
        self.ticker.is_finished()
    }

    /// Stops everything. Open WebSockets do not hold it up.
    pub async fn stop(self) {
        // An error means that HTTP is gone already.
        let _ = self.stop.send(true);
        self.http.abort();
        self.network.close().await;
    }
}

/// Runs a server until it is asked to end.
///
/// # Errors
/// What [`Server::start`] says; a loop that ended by itself.
pub async fn run(settings: Settings) -> anyhow::Result<()> {
    let server = Server::start(settings).await?;
    tracing::info!("dashboard at http://{}/", server.address);
    let mut terminate = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?;
    let mut check = tokio::time::interval(std::time::Duration::from_millis(500));
    let failed = loop {
        tokio::select! {
            _ = tokio::signal::ctrl_c() => break false,
            _ = terminate.recv() => break false,
            _ = check.tick() => if server.has_failed() { break true },
        }
    };
    tracing::info!("stopping");
    server.stop().await;
    anyhow::ensure!(
        !failed,
        "the 1 kHz loop ended by itself; its panic stands above"
    );
    Ok(())
}

/// The session that a server starts with: a block, a ball, the scheme that is the default.
fn demo_session() -> NewSession {
    let id = SessionId::new(DEMO).expect("a constant name is valid");
    NewSession {
        clay: ClaySpec {
            shape: ClayShape::default(),
            ..ClaySpec::default()
        },
        tool: ToolDescription::Ball {
            radius_m: DEMO_BALL_M,
        },
        tools: 4,
        ..NewSession::new(id)
    }
}
