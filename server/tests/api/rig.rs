//! A server to ask, and routers around its directory.
//!
//! One server, with its loop and its Zenoh sessions, is shared by the tests of a process. A test that needs other
//! settings of the interface puts a router of its own around the same sessions; one that needs other sessions starts a
//! server of its own.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use teleclay_proto::{NodeName, RealmName};
use teleclay_server::api::{self, ApiConfig};
use teleclay_server::directory::Directory;
use teleclay_server::doors::Doors;
use teleclay_server::doors::certificates::Source;
use teleclay_server::settings::Settings;
use teleclay_server::{Server, api::bind};
use teleclay_shell::log::LogFormat;
use teleclay_shell::ticker::Scheduling;
use tokio::runtime::Runtime;

use crate::wire::Site;

/// Long enough for a machine that is busy with all the other tests; nothing waits this long unless it fails.
pub(crate) const PATIENCE: Duration = Duration::from_secs(30);

pub(crate) struct Rig {
    runtime: Runtime,
    server: Server,
}

static SHARED: LazyLock<Rig> = LazyLock::new(Rig::start);

/// The server that tests share. Sessions have names of their own: see [`Rig::session`].
pub(crate) fn shared() -> &'static Rig {
    &SHARED
}

impl Rig {
    /// A server of one's own.
    pub(crate) fn start() -> Self {
        Self::start_with(|_| ())
    }

    /// A server of one's own, with other settings.
    pub(crate) fn start_with(change: impl FnOnce(&mut Settings)) -> Self {
        static STARTED: AtomicU32 = AtomicU32::new(0);
        let number = STARTED.fetch_add(1, Ordering::Relaxed);
        let folder = format!("data-{}-{number}", std::process::id());
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .unwrap();
        let mut settings = Settings {
            realm: RealmName::new("local").unwrap(),
            listen: loopback(),
            zenoh_control: "tcp/127.0.0.1:0".parse().unwrap(),
            zenoh_slow: "tcp/127.0.0.1:0".parse().unwrap(),
            certificate: Source::Own,
            is_https: false,
            hosts: Vec::new(),
            data_dir: PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(folder),
            demo_session: false,
            is_ephemeral: true,
            clay_bytes: 4 << 30,
            node: NodeName::new("api-tests").unwrap(),
            token: None,
            ros2: None,
            allow_origins: Vec::new(),
            scheduling: Scheduling::Normal,
            spin: Duration::ZERO,
            tick_threads: 2,
            tick_budget: 0.0,
            log_format: LogFormat::default(),
        };
        change(&mut settings);
        let server = runtime.block_on(Server::start(settings)).unwrap();
        Self { runtime, server }
    }

    pub(crate) fn directory(&self) -> &Directory {
        self.server.directory()
    }

    /// Has a session live on another tick thread.
    pub(crate) fn move_to(&self, session: &str, thread: usize) {
        let id = teleclay_proto::SessionId::new(session).unwrap();
        let moved = self.directory().move_to(&id, thread);
        self.runtime.block_on(moved).unwrap();
    }

    /// Serves the interface with other settings, for as long as the process lives.
    pub(crate) fn serve(&self, change: impl FnOnce(&mut ApiConfig)) -> Site {
        let _context = self.runtime.enter();
        let listener = bind(loopback()).unwrap();
        let address = listener.local_addr().unwrap();
        let mut config = ApiConfig {
            doors: Arc::new(Doors::open()),
            allowed_origins: Vec::new(),
            listen: address,
            node: NodeName::new("api-tests").unwrap(),
            version: "9.8.7".to_owned(),
            started: Instant::now(),
            ros2: None,
        };
        change(&mut config);
        let service = api::service(self.directory().clone(), config);
        self.runtime
            .spawn(api::serve(listener, service, None, std::future::pending()));
        Site::at(address)
    }

    /// The interface as it is without settings.
    pub(crate) fn site(&self) -> Site {
        self.serve(|_| ())
    }

    /// A session with little clay, its name unique in this process.
    pub(crate) fn session(&self, site: &Site) -> String {
        static MADE: AtomicU32 = AtomicU32::new(0);
        let id = format!("t{}", MADE.fetch_add(1, Ordering::Relaxed));
        let answer = site.post("/api/v1/sessions", &small(&id));
        assert_eq!(answer.status, 201, "{answer:?}");
        id
    }
}

/// A session of 32 bricks.
pub(crate) fn small(id: &str) -> Value {
    json!({
        "id": id,
        "scheme": "force_exchange",
        "clay": { "shape": { "kind": "block", "size_m": [0.064, 0.064, 0.032] }, "voxel_size_m": 1e-3 },
        "tool": { "kind": "ball", "radius_m": 0.006 },
    })
}

fn loopback() -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], 0))
}

/// Asks again and again until it holds.
///
/// # Panics
/// When it does not for too long.
pub(crate) fn eventually(what: &str, mut holds: impl FnMut() -> bool) {
    let began = Instant::now();
    while !holds() {
        assert!(began.elapsed() < PATIENCE, "waited in vain: {what}");
    }
}
