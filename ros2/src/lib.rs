//! Sessions on ROS 2, as `rmw_zenoh` has them: a client of the Zenoh router that nodes of ROS 2 find each other by.
//!
//! | module | has |
//! |---|---|
//! | [`host`] | what a server has to be for it |
//! | `wire` | keys, tokens and attachments of `rmw_zenoh` |
//! | `graph` | who else is there, and who means another type by a name of ours |
//! | `node` | our end of it: topics that are published, services that are answered |
//! | `router` | the way to the router, and whether it is there |
//! | `session` | what is told of one session |
//! | `service` | what one session may be asked |
//! | `diagnostics` | how all of them are doing |
//!
//! Nothing here is on the tick's way: it reads what watchers read, at their rate, and what does not go at once is lost.
//! The router lets everybody in, so what ROS 2 asks for is refused in words unless [`Commands`] says otherwise; a stop
//! is nobody's to clear from there.

mod diagnostics;
mod graph;
pub mod host;
mod node;
mod router;
mod service;
mod session;
mod wire;

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

use tokio::sync::oneshot;
use tokio::task::{JoinHandle, JoinSet};
use zenoh::Session;

use host::{Host, HostSession as _};
use node::Node;

/// Where the router is, and who we are there.
#[derive(Clone, Debug)]
pub struct Config {
    /// Zenoh's endpoint of the router, such as `tcp/127.0.0.1:7447`.
    pub router: String,
    /// The domain, `ROS_DOMAIN_ID`.
    pub domain: u32,
    /// Name of our node.
    pub node: String,
    /// What ROS 2 may ask for.
    pub commands: Commands,
}

/// What ROS 2 may ask for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Commands {
    /// Nothing: each service says that it may not.
    #[default]
    Refused,
    /// Everything that there is a service for, whoever asks.
    Taken,
}

/// How it is going.
#[derive(Debug, Default)]
pub struct Status {
    router_is_up: AtomicBool,
    messages: AtomicU64,
    missed: AtomicU64,
    strangers: AtomicUsize,
}

impl Status {
    /// Whether the router is connected.
    pub fn router_is_up(&self) -> bool {
        self.router_is_up.load(Ordering::Relaxed)
    }

    /// Messages handed to Zenoh so far.
    pub fn messages(&self) -> u64 {
        self.messages.load(Ordering::Relaxed)
    }

    /// Samples that came faster than they could be told.
    pub fn missed(&self) -> u64 {
        self.missed.load(Ordering::Relaxed)
    }

    /// Ends of topics and services that are there now under a name of ours with another type or hash.
    pub fn strangers(&self) -> usize {
        self.strangers.load(Ordering::Relaxed)
    }
}

/// Sessions on ROS 2. They leave when it is dropped; [`Ros2::close`] waits for that.
#[derive(Debug)]
pub struct Ros2 {
    status: Arc<Status>,
    stop: oneshot::Sender<()>,
    task: JoinHandle<()>,
}

impl Ros2 {
    /// Begins; a router that is missing is waited for.
    pub fn start(config: Config, host: impl Host) -> Self {
        let status = Arc::new(Status::default());
        let (stop, stopped) = oneshot::channel();
        let task = tokio::spawn(run(config, host, Arc::clone(&status), stopped));
        Self { status, stop, task }
    }

    /// How it is going.
    #[must_use]
    pub fn status(&self) -> &Arc<Status> {
        &self.status
    }

    /// Leaves the graph.
    pub async fn close(self) {
        drop(self.stop);
        // A panic was printed by the task itself.
        let _ = self.task.await;
    }
}

async fn run(
    config: Config,
    host: impl Host,
    status: Arc<Status>,
    mut stopped: oneshot::Receiver<()>,
) {
    let session = tokio::select! {
        session = router::connect(&config, &status) => session,
        _ = &mut stopped => return,
    };
    tokio::select! {
        () = tell(session.clone(), &config, &host, status) => {}
        _ = &mut stopped => {}
    }
    if let Err(error) = session.close().await {
        tracing::warn!(%error, "the session with ROS 2's router did not close cleanly");
    }
}

async fn tell(session: Session, config: &Config, host: &impl Host, status: Arc<Status>) {
    let node = match Node::open(session, config, Arc::clone(&status)).await {
        Ok(node) => Arc::new(node),
        Err(error) => return tracing::error!(%error, "ROS 2 is not spoken"),
    };
    tokio::join!(
        router::watch(&node, &config.router, &status),
        diagnostics::tell(&node, host),
        follow(&node, host),
    );
}

/// Has each session told of, as they come and go.
async fn follow(node: &Arc<Node>, host: &impl Host) {
    let mut changes = host.changes();
    let mut followed: HashMap<u32, Followed> = HashMap::new();
    loop {
        changes.mark_unchanged();
        let there = host.sessions();
        let is_there = |number: &u32| there.iter().any(|session| session.number() == *number);
        for (_, mut gone) in followed.extract_if(|number, _| !is_there(number)) {
            // Withdrawn before another of the same name comes.
            gone.task.shutdown().await;
        }
        for session in there {
            if followed.contains_key(&session.number()) {
                continue;
            }
            let name = teleclay_ros::names::spelled(session.name());
            if followed.values().any(|other| other.name == name) {
                tracing::error!(
                    session = session.name(),
                    "another session is named `{name}` on ROS 2 already, which knows no difference between - and _: \
                     this one is not told of there"
                );
                continue;
            }
            let number = session.number();
            let mut task = JoinSet::new();
            task.spawn(session::tell(Arc::clone(node), session));
            followed.insert(number, Followed { name, task });
        }
        if changes.changed().await.is_err() {
            return;
        }
    }
}

/// A session that is told of.
struct Followed {
    /// As ROS 2 spells it.
    name: String,
    /// Ends when it is dropped.
    task: JoinSet<()>,
}
