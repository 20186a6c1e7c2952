//! Our end of the graph: a node, topics that it publishes, services that it answers.

use std::fmt::Display;
use std::sync::atomic::{AtomicI64, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::SystemTime;

use teleclay_ros::names::{self, Topic};
use teleclay_ros::{Message, to_cdr};
use tokio::sync::mpsc;
use tokio::sync::mpsc::error::TrySendError;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Reliability};
use zenoh::query::{Query, Queryable};
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait as _};

use crate::graph::Graph;
use crate::wire::{Attachment, Gid, Kind, NodeName, Quality, Typed, every_token, gid};
use crate::{Commands, Config, Status};

/// Calls of one service that may wait; a caller beyond is told that we are busy.
const CALLS_WAITING: usize = 8;

/// A node on a session of Zenoh's.
pub(crate) struct Node {
    session: Session,
    name: NodeName,
    commands: Commands,
    status: Arc<Status>,
    graph: Arc<Mutex<Graph>>,
    next_end: AtomicU32,
    tf: PublishedTopic,
    diagnostics: PublishedTopic,
    // What shows the node, and what looks at others: gone when they are dropped.
    _token: LivelinessToken,
    _watch: Subscriber<()>,
}

impl Node {
    /// Shows itself, and looks who else is there.
    pub(crate) async fn open(
        session: Session,
        config: &Config,
        status: Arc<Status>,
    ) -> zenoh::Result<Self> {
        let name = NodeName {
            domain: config.domain,
            zid: session.zid().to_string(),
            name: names::spelled(&config.node),
        };
        let graph = Arc::new(Mutex::new(Graph::new(name.zid.clone())));
        let ends = Ends {
            session: &session,
            name: &name,
            graph: &graph,
            status: &status,
        };
        // Before others are looked at: what they are compared with.
        let tf = ends.publish(1, &names::tf(), Quality::BestEffort).await?;
        let diagnostics = ends
            .publish(2, &names::diagnostics(), Quality::Reliable)
            .await?;
        let token = session.liveliness().declare_token(name.token()).await?;
        let watch = watch(&session, name.domain, &graph, &status).await?;
        Ok(Self {
            commands: config.commands,
            next_end: AtomicU32::new(3),
            session,
            name,
            status,
            graph,
            tf,
            diagnostics,
            _token: token,
            _watch: watch,
        })
    }

    pub(crate) fn session(&self) -> &Session {
        &self.session
    }

    pub(crate) fn commands(&self) -> Commands {
        self.commands
    }

    pub(crate) fn status(&self) -> &Status {
        &self.status
    }

    /// What shows where frames lie.
    pub(crate) fn tf(&self) -> &PublishedTopic {
        &self.tf
    }

    /// What shows how the parts are doing.
    pub(crate) fn diagnostics(&self) -> &PublishedTopic {
        &self.diagnostics
    }

    /// Publishes a topic until what comes back is dropped.
    pub(crate) async fn publish(
        &self,
        topic: &Topic,
        quality: Quality,
    ) -> zenoh::Result<PublishedTopic> {
        self.ends().publish(self.next_end(), topic, quality).await
    }

    /// Answers a service until what comes back is dropped; with `busy` where too many calls wait.
    pub(crate) async fn answer(
        &self,
        service: &str,
        interface: &str,
        busy: Vec<u8>,
    ) -> zenoh::Result<AnsweredService> {
        self.ends()
            .answer(self.next_end(), service, interface, busy)
            .await
    }

    fn next_end(&self) -> u32 {
        self.next_end.fetch_add(1, Ordering::Relaxed)
    }

    fn ends(&self) -> Ends<'_> {
        Ends {
            session: &self.session,
            name: &self.name,
            graph: &self.graph,
            status: &self.status,
        }
    }
}

/// What ends of topics and services are made with.
struct Ends<'a> {
    session: &'a Session,
    name: &'a NodeName,
    graph: &'a Arc<Mutex<Graph>>,
    status: &'a Arc<Status>,
}

impl Ends<'_> {
    async fn publish(
        &self,
        end: u32,
        topic: &Topic,
        quality: Quality,
    ) -> zenoh::Result<PublishedTopic> {
        let typed = Typed::new(&topic.name, topic.message);
        let reliability = match quality {
            Quality::BestEffort => Reliability::BestEffort,
            Quality::Reliable => Reliability::Reliable,
        };
        let publisher = self
            .session
            .declare_publisher(typed.key(self.name.domain))
            // A router that does not read holds nobody up here.
            .congestion_control(CongestionControl::Drop)
            .reliability(reliability)
            .await?;
        let token = self.name.token_of(end, Kind::Publisher, &typed, quality);
        Ok(PublishedTopic {
            publisher,
            gid: gid(&token),
            sent: AtomicI64::new(0),
            message: topic.message,
            status: Arc::clone(self.status),
            _shown: self.show(token, typed).await?,
        })
    }

    async fn answer(
        &self,
        end: u32,
        service: &str,
        interface: &str,
        busy: Vec<u8>,
    ) -> zenoh::Result<AnsweredService> {
        let typed = Typed::new(service, interface);
        let key = typed.key(self.name.domain);
        let (calls, waiting) = mpsc::channel(CALLS_WAITING);
        let queryable = self
            .session
            .declare_queryable(key.clone())
            // Callers ask those who answer for all of a key.
            .complete(true)
            .callback(move |query| {
                if let Err(TrySendError::Full(query)) = calls.try_send(query) {
                    tracing::warn!(key, "more calls over ROS 2 than are carried out");
                    let asked = query.attachment().cloned();
                    // An error means that the caller is gone.
                    let _ = query
                        .reply(key.clone(), busy.clone())
                        .attachment(asked)
                        .wait();
                }
            })
            .await?;
        let token = self
            .name
            .token_of(end, Kind::Service, &typed, Quality::Reliable);
        Ok(AnsweredService {
            waiting,
            _queryable: queryable,
            _shown: self.show(token, typed).await?,
        })
    }

    async fn show(&self, token: String, typed: Typed) -> zenoh::Result<Shown> {
        let name = typed.name.clone();
        let strangers = look_at(self.graph).have(typed);
        strangers.iter().for_each(say);
        count(self.graph, self.status);
        Ok(Shown {
            name,
            graph: Arc::clone(self.graph),
            status: Arc::clone(self.status),
            _token: self.session.liveliness().declare_token(token).await?,
        })
    }
}

/// That an end of ours is there.
struct Shown {
    name: String,
    graph: Arc<Mutex<Graph>>,
    status: Arc<Status>,
    _token: LivelinessToken,
}

impl Drop for Shown {
    fn drop(&mut self) {
        look_at(&self.graph).lose(&self.name);
        count(&self.graph, &self.status);
    }
}

/// A topic that is published.
pub(crate) struct PublishedTopic {
    publisher: Publisher<'static>,
    gid: Gid,
    sent: AtomicI64,
    message: &'static str,
    status: Arc<Status>,
    _shown: Shown,
}

impl PublishedTopic {
    /// Hands a message to Zenoh; what cannot go at once is lost.
    pub(crate) async fn put<M: Message>(&self, message: &M) {
        debug_assert_eq!(M::NAME, self.message);
        let mut bytes = Vec::new();
        to_cdr(message, &mut bytes);
        let attachment = Attachment {
            sequence: self.sent.fetch_add(1, Ordering::Relaxed) + 1,
            sent_ns: now_ns() as i64,
            gid: self.gid,
        };
        let put = self
            .publisher
            .put(bytes)
            .attachment(attachment.to_bytes().to_vec());
        // An error means that the session is closing.
        if put.await.is_ok() {
            self.status.messages.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// A service that is answered.
pub(crate) struct AnsweredService {
    /// Calls, in the order in which they came.
    pub(crate) waiting: mpsc::Receiver<Query>,
    _queryable: Queryable<()>,
    _shown: Shown,
}

/// Looks who else is there, from now on and so far.
async fn watch(
    session: &Session,
    domain: u32,
    graph: &Arc<Mutex<Graph>>,
    status: &Arc<Status>,
) -> zenoh::Result<Subscriber<()>> {
    let (graph, status) = (Arc::clone(graph), Arc::clone(status));
    session
        .liveliness()
        .declare_subscriber(every_token(domain))
        .history(true)
        .callback(move |sample| {
            let token = sample.key_expr().as_str();
            match sample.kind() {
                SampleKind::Put => look_at(&graph).appear(token).iter().for_each(say),
                SampleKind::Delete => look_at(&graph).vanish(token),
            }
            count(&graph, &status);
        })
        .await
}

fn say(stranger: &impl Display) {
    tracing::error!("on ROS 2, {stranger}");
}

fn look_at(graph: &Mutex<Graph>) -> MutexGuard<'_, Graph> {
    graph.lock().expect("no holder panics")
}

fn count(graph: &Mutex<Graph>, status: &Status) {
    let strangers = look_at(graph).strangers();
    status.strangers.store(strangers, Ordering::Relaxed);
}

/// Time of day, ns since 1970.
pub(crate) fn now_ns() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |since| {
        u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
    })
}
