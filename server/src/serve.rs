//! Putting it together, and taking it apart again in the right order.

use std::net::SocketAddr;
use std::sync::mpsc;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use teleclay_doors::audit::Audit;
use teleclay_doors::{Identity, Invites};
use teleclay_front::Security;
use teleclay_keeping::Home;
use teleclay_proto::SessionId;
use teleclay_proto::http::{ClayShape, ClaySpec, NewSession, ToolDescription};
use teleclay_recording::Shelf;
use teleclay_ros2::Ros2;
use teleclay_shell::Clock;
use teleclay_shell::realtime::Realtime;
use teleclay_shell::ticker::{Ticker, TickerConfig};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;
use tokio::task::JoinHandle;

use crate::api::{self, ApiConfig};
use crate::collector::{Collector, FromThread, Sources};
use crate::directory::{Directory, Parts, ThreadParts};
use crate::doors::Doors;
use crate::doors::certificates::{self, Source};
use crate::doors::command::Address;
use crate::engine::{CAPACITIES, Engine, THREAD_NAMES, TICK, Threaded};
use crate::network::{Lines, Network, Sender};
use crate::placing::Budget;
use crate::ros2::OnRos2;
use crate::settings::Settings;
use crate::statistics::LoopStats;

/// Name of the session that is there from the start.
const DEMO: &str = "demo";
/// The demo's ball: 12.8 voxels of the default clay.
const DEMO_BALL_M: f64 = 0.0064;

/// The audit log is waited for so long at the end.
const LAST_WORDS_WITHIN: Duration = Duration::from_secs(1);

/// A running server.
pub struct Server {
    /// Address that HTTP really listens on.
    pub address: SocketAddr,
    /// The dashboard's address, as others may reach it.
    pub page: String,
    directory: Directory,
    network: Network,
    ros2: Option<Ros2>,
    follows: Option<JoinHandle<()>>,
    looks_after: JoinHandle<()>,
    balances: JoinHandle<()>,
    // Field order is drop order: first the ticks, then who empties their rings.
    tickers: Vec<Ticker>,
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

        let names = certificates::names(&names_told(&settings));
        let is_secure = settings.is_https || settings.zenoh_control.protocol.is_secure();
        let identity = is_secure
            .then(|| settings.certificate.identity(&settings.data_dir, &names))
            .transpose()
            .context("the server's certificate")?;
        let security = match &identity {
            Some(identity) if settings.is_https => {
                let security = Security::new(&identity.chain_pem, &identity.key_pem);
                Some(security.context("the server's certificate")?)
            }
            _ => None,
        };
        let doors = open_doors(&settings)?;

        let clock = Clock::start();
        let sender = Sender::spawn()?;
        let collector = Collector::spawn()?;
        let (notices, notices_out) = mpsc::channel();
        let (engines, outgoing) = Engine::threads(settings.tick_threads, Some(sender.waking()));
        let (mut loops, mut threads, mut from_threads) = (Vec::new(), Vec::new(), Vec::new());
        for Threaded { engine, waker } in engines {
            let (realtime, ends) = Realtime::new(engine, clock, CAPACITIES);
            let realtime = realtime.waking(collector.thread());
            loops.push(realtime.resting(waker.clone()));
            let stats = Arc::new(Mutex::new(LoopStats::default()));
            from_threads.push(FromThread {
                timings: ends.records,
                done: ends.done,
                stats: Arc::clone(&stats),
            });
            threads.push(ThreadParts {
                orders: ends.orders,
                waker,
                stats,
            });
        }
        let collector = collector.start(Sources {
            threads: from_threads,
            notices: notices_out,
        });
        let directory = Directory::new(Parts {
            threads,
            budget: Budget::new(TICK, settings.tick_budget)?,
            notices,
            node: settings.node.clone(),
            doors: Arc::clone(&doors),
            home: open_home(&settings)?,
            recordings: Arc::new(shelf(&settings)),
            clay_bytes: settings.clay_bytes,
            slow_endpoint: Some(settings.zenoh_slow.to_string()),
            clock,
        });
        let mut tickers = Vec::new();
        for (thread, realtime) in loops.into_iter().enumerate() {
            let ticker = realtime.spawn(TickerConfig {
                name: THREAD_NAMES[thread],
                period: TICK,
                scheduling: settings.scheduling,
                spin: settings.spin,
            })?;
            let scheduler = ticker.scheduler();
            directory.set_scheduler(thread, scheduler);
            tracing::info!(thread, scheduler, "the loop runs at 1 kHz");
            tickers.push(ticker);
        }
        directory
            .recover(clock)
            .await
            .with_context(|| format!("data folder {}", settings.data_dir.display()))?;
        let has_demo =
            directory.session(&demo_id()).is_some() || directory.damaged(&demo_id()).is_some();
        if settings.demo_session && !has_demo {
            directory
                .create(demo_session())
                .await
                .context("session demo")?;
        }
        let network = Network::open(
            &settings.realm,
            Lines {
                control: &settings.zenoh_control,
                slow: &settings.zenoh_slow,
                identity: identity.as_ref(),
            },
            &directory,
            sender.feed(outgoing),
            clock,
        )
        .await?;
        tracing::info!(
            control = %settings.zenoh_control,
            slow = %settings.zenoh_slow,
            "zenoh listens"
        );

        let ros2 = settings
            .ros2
            .clone()
            .map(|config| Ros2::start(config, OnRos2(directory.clone())));
        let page = tell_address(&settings, address, identity.as_ref())?;
        let follows = matches!(settings.certificate, Source::Given { .. })
            .then(|| follow_certificate(&settings, security.clone(), &network))
            .transpose()?;
        let service = api::service(
            directory.clone(),
            ApiConfig {
                doors,
                allowed_origins: settings.allow_origins,
                listen: address,
                node: settings.node,
                version: env!("CARGO_PKG_VERSION").to_owned(),
                started,
                ros2: ros2.as_ref().map(|ros2| Arc::clone(ros2.status())),
            },
        );
        let (stop, mut stopped) = watch::channel(false);
        let looks_after = directory.clone();
        let looks_after = tokio::spawn(async move { looks_after.look_after_archives().await });
        let balanced = directory.clone();
        let balances = tokio::spawn(async move { balanced.keep_balanced().await });
        let http = tokio::spawn(async move {
            let until = async move {
                // An error means that the sender is gone, which is a stop as well.
                let _ = stopped.wait_for(|stop| *stop).await;
            };
            api::serve(listener, service, security, until).await;
        });
        Ok(Self {
            address,
            page,
            follows,
            looks_after,
            directory,
            network,
            ros2,
            balances,
            tickers,
            _collector: collector,
            http,
            stop,
        })
    }

    /// The sessions.
    pub fn directory(&self) -> &Directory {
        &self.directory
    }

    /// Shows another certificate to whoever connects by Zenoh, at once: every line there is down for a moment.
    pub async fn show_to_handles(&self, identity: &Identity) {
        self.network.listening().renew(identity).await;
    }

    /// Whether the loop has ended by itself on some thread, which only a defect brings about.
    pub fn has_failed(&self) -> bool {
        self.tickers.iter().any(Ticker::is_finished)
    }

    /// Stops everything. Open WebSockets do not hold it up.
    pub async fn stop(self) {
        // An error means that HTTP is gone already.
        let _ = self.stop.send(true);
        self.http.abort();
        self.follows.iter().for_each(JoinHandle::abort);
        self.looks_after.abort();
        self.balances.abort();
        if let Some(ros2) = self.ros2 {
            ros2.close().await;
        }
        self.network.close().await;
        // No tick any more, so nothing more to keep.
        drop(self.tickers);
        let directory = self.directory.clone();
        // It fails only where the runtime ends.
        let _ = tokio::task::spawn_blocking(move || directory.end_writing()).await;
        let doors = Arc::clone(self.directory.doors());
        // It fails only where the runtime ends.
        let _ = tokio::task::spawn_blocking(move || doors.settle(LAST_WORDS_WITHIN)).await;
    }
}

/// Runs a server until it is asked to end.
///
/// # Errors
/// What [`Server::start`] says; a loop that ended by itself.
pub async fn run(settings: Settings) -> anyhow::Result<()> {
    let server = Server::start(settings).await?;
    tracing::info!("dashboard at {}/", server.page);
    let mut terminate = signal(SignalKind::terminate())?;
    let mut check = tokio::time::interval(Duration::from_millis(500));
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

/// Shows each certificate that takes the place of the one that was given; at once when the process is told to hang up.
fn follow_certificate(
    settings: &Settings,
    security: Option<Security>,
    network: &Network,
) -> anyhow::Result<JoinHandle<()>> {
    let (told, shown) = watch::channel(None);
    let data = settings.data_dir.clone();
    let tell = move |identity: Identity, when| {
        if let Err(error) = Address::renew(&data, identity.fingerprint) {
            tracing::warn!("invites name the certificate of before: {error:#}");
        }
        told.send_replace(Some((identity, when)));
    };
    let (ask, asked) = watch::channel(());
    let source = settings.certificate.clone();
    let follow = source.follow(security, certificates::LOOK_EVERY, asked, tell);
    let renew = network.listening().clone().follow(shown);
    let mut hangups = signal(SignalKind::hangup())?;
    let hear = async move {
        while hangups.recv().await.is_some() {
            ask.send_replace(());
        }
    };
    Ok(tokio::spawn(async move {
        tokio::join!(follow, renew, hear);
    }))
}

/// What the server was told that it is reached by.
fn names_told(settings: &Settings) -> Vec<String> {
    let mut told = settings.hosts.clone();
    if !settings.zenoh_control.is_everywhere() {
        told.push(settings.zenoh_control.bare_host().to_owned());
    }
    if !settings.listen.ip().is_unspecified() {
        told.push(settings.listen.ip().to_string());
    }
    told
}

/// Where sessions are kept, if they are.
fn open_home(settings: &Settings) -> anyhow::Result<Option<Arc<Home>>> {
    if settings.is_ephemeral {
        return Ok(None);
    }
    let home = Home::open(&settings.data_dir).context("the sessions that are kept")?;
    Ok(Some(Arc::new(home)))
}

/// Where recordings lie: beside the sessions that are kept, or where the system has what is temporary.
fn shelf(settings: &Settings) -> Shelf {
    if settings.is_ephemeral {
        return Shelf::temporary();
    }
    Shelf::lasting(settings.data_dir.join("recordings"))
}

/// Doors that are as wide as the settings say, and where it is written down who comes.
fn open_doors(settings: &Settings) -> anyhow::Result<Arc<Doors>> {
    let audit = Audit::open(&settings.data_dir)?;
    let doors = match &settings.token {
        Some(token) => Doors::with_token(token).and_guests(Invites::open(&settings.data_dir)?),
        None => Doors::open(),
    };
    Ok(Arc::new(doors.watched(audit)))
}

/// Writes down, for those who invite, where the server is reached; gives the page's address.
fn tell_address(
    settings: &Settings,
    listens: SocketAddr,
    identity: Option<&Identity>,
) -> anyhow::Result<String> {
    let known = || {
        settings
            .hosts
            .first()
            .cloned()
            .or_else(certificates::own_address)
    };
    let page_host = match listens.ip() {
        everywhere if everywhere.is_unspecified() => {
            known().unwrap_or_else(|| listens.ip().to_string())
        }
        ip => ip.to_string(),
    };
    let scheme = if settings.is_https { "https" } else { "http" };
    let page = format!("{scheme}://{}:{}", in_url(&page_host), listens.port());
    let mut endpoint = settings.zenoh_control.clone();
    if let (true, Some(host)) = (endpoint.is_everywhere(), known()) {
        endpoint = endpoint.on(&in_url(&host));
    }
    let is_secure = endpoint.protocol.is_secure();
    let address = Address {
        page: page.clone(),
        endpoint: endpoint.to_string(),
        realm: settings.realm.clone(),
        fingerprint: identity
            .filter(|_| is_secure)
            .map(|identity| identity.fingerprint.to_string()),
        needs_token: settings.token.is_some(),
    };
    address
        .write(&settings.data_dir)
        .with_context(|| format!("data folder {}", settings.data_dir.display()))?;
    Ok(page)
}

/// A host as it stands in an address: IPv6 in brackets.
fn in_url(host: &str) -> String {
    match host.parse::<std::net::Ipv6Addr>() {
        Ok(address) => format!("[{address}]"),
        Err(_) => host.to_owned(),
    }
}

fn demo_id() -> SessionId {
    SessionId::new(DEMO).expect("a constant name is valid")
}

/// The session that a server starts with: a block, a ball, the scheme that is the default.
fn demo_session() -> NewSession {
    let id = demo_id();
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
