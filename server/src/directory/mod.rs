//! The directory: which sessions there are, and every way to change one. The API and Zenoh both come here.
//!
//! A change is an order to the tick, and is done when the tick has carried it out.

mod live;
mod orders;

use std::collections::HashMap;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use rtrb::Producer;
use teleclay_bilateral::SessionLoop;
use teleclay_proto::http::{FieldError, NewSession, Readiness, Session, Validate};
use teleclay_proto::join::{Granted, JoinRequest, RefusalCode};
use teleclay_proto::watch::Level;
use teleclay_proto::{PROTOCOL, SessionId};

use crate::collector::{Finding, LoopStats, Notice, notify};
use crate::convert;
use crate::engine::{Incoming, MAX_SESSIONS, MAX_TOOLS, Order, Running, Shared};
use crate::session::SessionShared;

pub use live::{ClayView, Live};
pub use orders::ChangeError;

use live::build_clay;
use orders::Orders;

/// The loop is called running when it ticked within this time.
const LOOP_ALIVE: Duration = Duration::from_secs(1);

/// Why a session was not made.
#[derive(Debug, thiserror::Error)]
pub enum CreateError {
    /// There is one of this name.
    #[error("session {id} exists")]
    Exists {
        /// Its name.
        id: SessionId,
    },
    /// There are enough.
    #[error("there are {most} sessions, which is the limit")]
    TooMany {
        /// The limit.
        most: usize,
    },
    /// A field cannot be.
    #[error("{}: {}", .0.pointer, .0.detail)]
    Field(FieldError),
    /// The loop does not take orders.
    #[error("{reason}")]
    Unavailable {
        /// Why.
        reason: String,
    },
}

/// There is no session of this name.
#[derive(Debug, thiserror::Error)]
#[error("there is no such session")]
pub struct NoSuchSession;

/// All sessions of this server. Copies are the same directory.
#[derive(Clone)]
pub struct Directory(Arc<Inner>);

struct Inner {
    sessions: Mutex<HashMap<SessionId, Entry>>,
    orders: Orders,
    loop_stats: Arc<Mutex<LoopStats>>,
    notices: Sender<Notice>,
    scheduler: std::sync::OnceLock<String>,
    zenoh_is_up: std::sync::atomic::AtomicBool,
    next_number: AtomicU32,
    next_lease: AtomicU32,
    token: Option<String>,
    slow_endpoint: Option<String>,
}

struct Entry {
    live: Live,
    frames: Arc<Mutex<Producer<Incoming>>>,
}

/// What the directory is made of.
pub(crate) struct Parts {
    pub(crate) orders: Producer<Order>,
    pub(crate) shared: Arc<Shared>,
    pub(crate) loop_stats: Arc<Mutex<LoopStats>>,
    pub(crate) notices: Sender<Notice>,
    pub(crate) token: Option<String>,
    pub(crate) slow_endpoint: Option<String>,
}

impl Directory {
    pub(crate) fn new(parts: Parts) -> Self {
        // Leases of an earlier run of the server must not be taken for ones of this run.
        let seed = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        let first_lease = seed.map_or(1, |since| (since.as_millis() as u32) | 1);
        Self(Arc::new(Inner {
            sessions: Mutex::new(HashMap::new()),
            orders: Orders::new(parts.orders, parts.shared),
            loop_stats: parts.loop_stats,
            notices: parts.notices,
            scheduler: std::sync::OnceLock::new(),
            zenoh_is_up: std::sync::atomic::AtomicBool::new(false),
            next_number: AtomicU32::new(1),
            next_lease: AtomicU32::new(first_lease),
            token: parts.token,
            slow_endpoint: parts.slow_endpoint,
        }))
    }

    /// What the scheduler granted the loop, once known.
    pub(crate) fn set_scheduler(&self, words: &str) {
        // Set once, by main.
        let _ = self.0.scheduler.set(words.to_owned());
    }

    pub(crate) fn set_zenoh_up(&self) {
        self.0.zenoh_is_up.store(true, Ordering::Relaxed);
    }

    /// Every session, by name.
    pub fn sessions(&self) -> Vec<Session> {
        let mut lives: Vec<Live> = self
            .0
            .entries()
            .values()
            .map(|entry| entry.live.clone())
            .collect();
        lives.sort_by(|a, b| a.id().as_str().cmp(b.id().as_str()));
        lives.iter().map(Live::state).collect()
    }

    /// One session.
    pub fn session(&self, id: &SessionId) -> Option<Live> {
        self.0.entries().get(id).map(|entry| entry.live.clone())
    }

    /// Makes a session.
    ///
    /// # Errors
    /// The name is taken, there are too many, a field cannot be, or the loop does not answer.
    pub async fn create(&self, new: NewSession) -> Result<Session, CreateError> {
        new.validate().map_err(CreateError::Field)?;
        let spec = new.clone();
        let built = tokio::task::spawn_blocking(move || build_clay(&spec.clay, &spec));
        let (clay, mirror) = built
            .await
            .map_err(|error| CreateError::Unavailable {
                reason: error.to_string(),
            })?
            .map_err(|error| CreateError::Field(error.under("/clay")))?;
        let material = convert::material(&new.material).map_err(CreateError::Field)?;
        let number = self.0.next_number.fetch_add(1, Ordering::Relaxed);
        let lines = convert::lines(&new.network);
        let session = SessionLoop::new(
            clay,
            material,
            usize::from(new.tools).min(MAX_TOOLS),
            &lines,
        );
        let (running, ends) = Running::new(number, session);
        let shared = Arc::new(SessionShared::new(number, new.clone(), mirror));
        let live = Live::new(Arc::clone(&shared), Arc::downgrade(&self.0));
        {
            let mut sessions = self.0.entries();
            if sessions.contains_key(&new.id) {
                return Err(CreateError::Exists { id: new.id });
            }
            if MAX_SESSIONS <= sessions.len() {
                return Err(CreateError::TooMany { most: MAX_SESSIONS });
            }
            let frames = Arc::new(Mutex::new(ends.frames));
            sessions.insert(
                new.id.clone(),
                Entry {
                    live: live.clone(),
                    frames,
                },
            );
        }
        notify(&self.0.notices, Notice::Added(shared, ends.bricks));
        let done = self.0.order(Order::Add(running)).await;
        if done.is_err() {
            self.0.entries().remove(&new.id);
            notify(&self.0.notices, Notice::Removed(number));
            return Err(CreateError::Unavailable {
                reason: ChangeError::Timeout.to_string(),
            });
        }
        live.first_record().await;
        Ok(live.state())
    }

    /// Ends a session.
    ///
    /// # Errors
    /// There is none of this name.
    pub async fn delete(&self, id: &SessionId) -> Result<(), NoSuchSession> {
        let entry = self.0.entries().remove(id).ok_or(NoSuchSession)?;
        let session = entry.live.shared.number;
        entry
            .live
            .shared
            .emit(Level::Warning, "the session was deleted".to_owned());
        notify(&self.0.notices, Notice::Removed(session));
        // The session is out of the directory either way; a loop that is late only keeps it a little longer.
        let _ = self.0.order(Order::Remove { session }).await;
        Ok(())
    }

    /// Whether the loop runs and Zenoh is up.
    pub fn readiness(&self) -> Readiness {
        let last = self
            .0
            .loop_stats
            .lock()
            .expect("no holder panics")
            .last_tick;
        let loop_running = last.is_some_and(|last| last.elapsed() < LOOP_ALIVE);
        let zenoh_up = self.0.zenoh_is_up.load(Ordering::Relaxed);
        Readiness {
            ready: loop_running && zenoh_up,
            loop_running,
            zenoh_up,
        }
    }

    /// Ring into which frames of a session's handles go.
    pub(crate) fn frames(&self, id: &SessionId) -> Option<Arc<Mutex<Producer<Incoming>>>> {
        self.0
            .entries()
            .get(id)
            .map(|entry| Arc::clone(&entry.frames))
    }

    /// Number by which the tick knows a session.
    pub(crate) fn live_by_number(&self, number: u32) -> Option<Live> {
        self.0
            .entries()
            .values()
            .map(|entry| &entry.live)
            .find(|live| live.shared.number == number)
            .cloned()
    }

    /// Acts on what the collector found.
    pub(crate) async fn act_on(&self, finding: Finding) {
        let Finding::LeaseEnded {
            session,
            slot,
            lease,
            because,
        } = finding;
        if let Some(live) = self.live_by_number(session) {
            live.end_lease(slot, lease, because).await;
        }
    }

    /// Gives a tool to an operator.
    ///
    /// # Errors
    /// Code and reason of the refusal.
    pub(crate) async fn join(
        &self,
        id: &SessionId,
        request: &JoinRequest,
    ) -> Result<Granted, (RefusalCode, String)> {
        let refuse = |code, reason: &str| Err((code, reason.to_owned()));
        if request.protocol != PROTOCOL {
            let reason = format!(
                "this server speaks protocol {PROTOCOL}, the request {}",
                request.protocol
            );
            return Err((RefusalCode::ProtocolMismatch, reason));
        }
        match (&self.0.token, &request.token) {
            (Some(_), None) => {
                return refuse(
                    RefusalCode::TokenRequired,
                    "this server wants a token: give one with --token",
                );
            }
            (Some(want), Some(got)) if !is_same_secret(want, got) => {
                return refuse(RefusalCode::TokenRejected, "the token is not the server's");
            }
            _ => {}
        }
        let Some(live) = self.session(id) else {
            let reason = format!("there is no session `{id}` on this server");
            return Err((RefusalCode::NoSuchSession, reason));
        };
        live.grant(request, &self.0).await
    }
}

/// Compares without telling by its duration where two secrets differ.
pub(crate) fn is_same_secret(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    let differing = a.iter().zip(b).fold(0_u8, |all, (x, y)| all | (x ^ y));
    a.len() == b.len() && std::hint::black_box(differing) == 0
}

impl Inner {
    fn entries(&self) -> std::sync::MutexGuard<'_, HashMap<SessionId, Entry>> {
        self.sessions.lock().expect("no holder panics")
    }

    /// Hands an order to the tick and waits until it is carried out.
    async fn order(&self, order: Order) -> Result<(), ChangeError> {
        self.orders.carry_out(order).await
    }

    fn scheduler(&self) -> &str {
        self.scheduler.get().map_or("not known yet", String::as_str)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicBool;
    use std::time::Instant;

    use teleclay_proto::Scheme;
    use teleclay_proto::http::SessionPatch;
    use teleclay_shell::Clock;
    use teleclay_shell::ticker::Tick;

    use crate::collector::{Collector, Sources};
    use crate::engine::Engine;

    /// Operators join just while somebody changes the scheme. Whichever comes first, the tool works with the session's scheme in the end.
    #[test]
    fn a_tool_that_is_seated_during_a_change_has_the_change() {
        const ROUNDS: u32 = 150;
        let (mut engine, ends) = Engine::new(Clock::start());
        let (notices, notices_out) = std::sync::mpsc::channel();
        let loop_stats = Arc::<Mutex<LoopStats>>::default();
        let sources = Sources {
            ticks: ends.ticks,
            sessions: ends.sessions,
            discarded: ends.discarded,
            notices: notices_out,
        };
        let findings = tokio::sync::mpsc::unbounded_channel().0;
        let _collector = Collector::spawn(sources, Arc::clone(&loop_stats), findings).unwrap();
        let directory = Directory::new(Parts {
            orders: ends.orders,
            shared: ends.shared,
            loop_stats,
            notices,
            token: None,
            slow_endpoint: None,
        });
        // The tick, as fast as it goes, and the newest frame that left it.
        let (mut outgoing, newest) = (ends.outgoing, Arc::new(Mutex::new((0, Scheme::Wave))));
        let stop = Arc::new(AtomicBool::new(false));
        let (seen, asked_to_stop) = (Arc::clone(&newest), Arc::clone(&stop));
        let ticking = std::thread::spawn(move || {
            for number in 0.. {
                if asked_to_stop.load(Ordering::Relaxed) {
                    return;
                }
                let lateness = Duration::ZERO;
                engine.tick(Tick {
                    number,
                    lateness,
                    given_up: 0,
                });
                while let Ok(out) = outgoing.pop() {
                    *seen.lock().unwrap() = (out.frame.header.lease, out.frame.header.scheme);
                }
                std::thread::sleep(Duration::from_micros(100));
            }
        });
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .unwrap();
        runtime.block_on(async {
            let mut new = NewSession::new(id());
            new.scheme = Scheme::Tdpa;
            directory.create(new).await.unwrap();
            let live = directory.session(&id()).unwrap();
            for round in 0..ROUNDS {
                let scheme = [Scheme::Wave, Scheme::Tdpa][round as usize % 2];
                let patch = SessionPatch {
                    scheme: Some(scheme),
                    ..SessionPatch::default()
                };
                let request = JoinRequest {
                    protocol: PROTOCOL,
                    operator: "Ada".to_owned(),
                    token: None,
                    device: "none".to_owned(),
                };
                let (joining, changing) = (directory.clone(), live.clone());
                let joined = tokio::spawn(async move { joining.join(&id(), &request).await });
                let changed = tokio::spawn(async move { changing.patch(patch).await });
                let lease = joined.await.unwrap().unwrap().lease;
                changed.await.unwrap().unwrap();
                let began = Instant::now();
                while *newest.lock().unwrap() != (lease, scheme) {
                    let last = *newest.lock().unwrap();
                    assert!(
                        began.elapsed() < Duration::from_secs(5),
                        "round {round}: {last:?}, wanted {scheme}"
                    );
                    tokio::task::yield_now().await;
                }
                live.end_lease(0, lease, "left").await;
            }
        });
        stop.store(true, Ordering::Relaxed);
        ticking.join().unwrap();
    }

    fn id() -> SessionId {
        "joins".parse().unwrap()
    }
}
