//! The directory: which sessions there are, and every way to change one. The API and Zenoh both come here.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use rtrb::Producer;
use teleclay_bilateral::{FreshBlock, ParameterError, SessionLoop, ToolSide, workplace};
use teleclay_clay::Clay;
use teleclay_link::scheme::replica::Turn;
use teleclay_proto::http::{
    ClayReset, ClaySpec, FieldError, NewSession, Readiness, Session, SessionPatch, Validate,
};
use teleclay_proto::join::{ClayDescription, Granted, JoinRequest, LoopParameters, RefusalCode};
use teleclay_proto::watch::Level;
use teleclay_proto::{PROTOCOL, SessionId};
use tokio::sync::broadcast;

use crate::collector::{Finding, LoopStats, Notice, notify};
use crate::convert;
use crate::engine::{Incoming, MAX_PLACES, MAX_SESSIONS, Order, Running, Shared, TICK};
use crate::session::{Event, Lease, Mirror, Sample, SessionShared, parameters, tool_id};

/// Longest wait for the tick to carry out an order. It takes one tick; this is for a machine that is badly overloaded.
const ORDER_TIMEOUT: Duration = Duration::from_secs(2);
/// Silence after which another operator may take a tool over, s.
const TAKEOVER_AFTER_S: f64 = 0.15;
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

/// Why a session was not changed.
#[derive(Debug, thiserror::Error)]
pub enum ChangeError {
    /// A field cannot be.
    #[error("{}: {}", .0.pointer, .0.detail)]
    Field(FieldError),
    /// The session is gone.
    #[error("the session is gone")]
    Gone,
    /// The loop did not take the order in time.
    #[error("the loop did not take the order within {} s", ORDER_TIMEOUT.as_secs())]
    Timeout,
}

/// All sessions of this server. Copies are the same directory.
#[derive(Clone)]
pub struct Directory(Arc<Inner>);

struct Inner {
    sessions: Mutex<HashMap<SessionId, Entry>>,
    orders: Mutex<Producer<Order>>,
    orders_sent: AtomicU64,
    shared: Arc<Shared>,
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

/// A session that is there.
#[derive(Clone)]
pub struct Live {
    shared: Arc<SessionShared>,
    directory: std::sync::Weak<Inner>,
}

impl Directory {
    pub(crate) fn new(parts: Parts) -> Self {
        // Leases of an earlier run of the server must not be taken for ones of this run.
        let seed = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        let first_lease = seed.map_or(1, |since| (since.as_millis() as u32) | 1);
        Self(Arc::new(Inner {
            sessions: Mutex::new(HashMap::new()),
            orders: Mutex::new(parts.orders),
            orders_sent: AtomicU64::new(0),
            shared: parts.shared,
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
        lives.sort_by(|a, b| a.shared.id.as_str().cmp(b.shared.id.as_str()));
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
            usize::from(new.tools).min(MAX_PLACES),
            &lines,
        );
        let (running, ends) = Running::new(number, session);
        let shared = Arc::new(SessionShared::new(number, new.clone(), mirror));
        let live = Live {
            shared: Arc::clone(&shared),
            directory: Arc::downgrade(&self.0),
        };
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
            .tell(Level::Warning, "the session was deleted".to_owned());
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
            place,
            lease,
            because,
        } = finding;
        if let Some(live) = self.live_by_number(session) {
            live.end_lease(place, lease, because).await;
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
        let started = Instant::now();
        let mut order = Some(order);
        let number = loop {
            {
                let mut orders = self.orders.lock().expect("no holder panics");
                match orders.push(order.take().expect("taken once a round")) {
                    Ok(()) => break self.orders_sent.fetch_add(1, Ordering::Relaxed) + 1,
                    Err(rtrb::PushError::Full(back)) => order = Some(back),
                }
            }
            if ORDER_TIMEOUT < started.elapsed() {
                return Err(ChangeError::Timeout);
            }
            tokio::time::sleep(TICK).await;
        };
        while self.shared.orders_done.load(Ordering::Acquire) < number {
            if ORDER_TIMEOUT < started.elapsed() {
                return Err(ChangeError::Timeout);
            }
            tokio::time::sleep(TICK).await;
        }
        Ok(())
    }

    fn scheduler(&self) -> &str {
        self.scheduler.get().map_or("not known yet", String::as_str)
    }
}

impl Live {
    /// The session as it is.
    pub fn state(&self) -> Session {
        let directory = self.directory.upgrade();
        let (stats, scheduler) = directory.as_ref().map_or_else(
            || (Arc::new(Mutex::new(LoopStats::default())), "gone"),
            |inner| (Arc::clone(&inner.loop_stats), inner.scheduler()),
        );
        self.shared.state(&stats, scheduler)
    }

    /// Changes what is in the patch.
    ///
    /// # Errors
    /// A field cannot be, the session is gone, or the loop does not answer.
    pub async fn patch(&self, patch: SessionPatch) -> Result<Session, ChangeError> {
        patch.validate().map_err(ChangeError::Field)?;
        let session = self.shared.number;
        if let Some(scheme) = patch.scheme {
            let revision = {
                let mut settings = self.shared.settings();
                settings.spec.scheme = scheme;
                settings.parameters.scheme = scheme;
                settings.next_revision()
            };
            self.order(Order::SetScheme {
                session,
                scheme,
                revision,
            })
            .await?;
        }
        if let Some(change) = patch.material {
            let wanted = change.apply(self.shared.settings().spec.material);
            let material = convert::material(&wanted).map_err(ChangeError::Field)?;
            let revision = {
                let mut settings = self.shared.settings();
                settings.spec.material = wanted;
                settings.parameters.material = wanted;
                settings.next_revision()
            };
            self.order(Order::SetMaterial {
                session,
                material,
                revision,
            })
            .await?;
        }
        if let Some(change) = patch.network {
            let wanted = change.apply(self.shared.settings().spec.network);
            wanted
                .validate()
                .map_err(|error| ChangeError::Field(error.under("/network")))?;
            self.order(Order::SetLines {
                session,
                lines: convert::lines(&wanted),
            })
            .await?;
            self.shared.settings().spec.network = wanted;
        }
        if let Some(paused) = patch.paused {
            self.order(if paused {
                Order::Pause { session }
            } else {
                Order::Resume { session }
            })
            .await?;
            self.shared.settings().is_paused = paused;
        }
        Ok(self.state())
    }

    /// A fresh block.
    ///
    /// # Errors
    /// A field cannot be, the session is gone, or the loop does not answer.
    pub async fn reset(&self, reset: ClayReset) -> Result<Session, ChangeError> {
        reset.validate().map_err(ChangeError::Field)?;
        let mut spec = self.shared.settings().spec.clone();
        if let Some(shape) = reset.shape {
            spec.clay.shape = shape;
        }
        if let Some(material) = reset.material {
            spec.material = material;
        }
        let built = {
            let spec = spec.clone();
            tokio::task::spawn_blocking(move || build_clay(&spec.clay, &spec)).await
        };
        let (clay, mirror) = built
            .map_err(|_| ChangeError::Gone)?
            .map_err(ChangeError::Field)?;
        let session = self.shared.number;
        let moved = parameters(&spec);
        let workplace = workplace(&moved)
            .map_err(|error| ChangeError::Field(FieldError::new("/shape", error.to_string())))?;
        let clay_epoch = {
            let mut held = self.shared.mirror.lock().expect("no holder panics");
            let epoch = held.epoch.wrapping_add(1);
            *held = Mirror {
                clay: mirror,
                epoch,
            };
            epoch
        };
        let (revision, places) = {
            let mut settings = self.shared.settings();
            let revision = settings.next_revision();
            settings.parameters = LoopParameters { revision, ..moved };
            settings.spec = spec;
            (revision, settings.places.len())
        };
        self.order(Order::ReplaceClay {
            session,
            fresh: Box::new(FreshBlock {
                clay,
                workplace,
                turn: Turn {
                    since_revision: revision,
                    epoch: clay_epoch,
                },
                before: Vec::with_capacity(places),
            }),
        })
        .await?;
        self.shared.tell(Level::Info, "a fresh block".to_owned());
        self.record_of_epoch(clay_epoch).await;
        Ok(self.state())
    }

    /// The session's name.
    pub fn id(&self) -> &SessionId {
        &self.shared.id
    }

    /// The watchers' copy of the clay.
    pub fn clay(&self) -> ClayView {
        ClayView {
            shared: Arc::clone(&self.shared),
        }
    }

    /// Samples from now on.
    pub fn telemetry(&self) -> broadcast::Receiver<Sample> {
        self.shared.telemetry()
    }

    /// Events from now on.
    pub fn events(&self) -> broadcast::Receiver<Event> {
        self.shared.events()
    }

    /// Whether the session is still in the directory.
    pub fn is_there(&self) -> bool {
        self.directory.upgrade().is_some_and(|inner| {
            inner
                .entries()
                .get(&self.shared.id)
                .is_some_and(|entry| entry.live.shared.number == self.shared.number)
        })
    }

    pub(crate) fn loop_parameters(&self) -> LoopParameters {
        self.shared.settings().parameters
    }

    /// Whether `lease` is held in this session, and where.
    pub(crate) fn place_of(&self, lease: u32) -> Option<usize> {
        let settings = self.shared.settings();
        settings
            .places
            .iter()
            .position(|held| held.as_ref().is_some_and(|held| held.lease == lease))
    }

    pub(crate) async fn end_lease(&self, place: usize, lease: u32, because: &str) {
        let ended = {
            let mut settings = self.shared.settings();
            let is_held = settings
                .places
                .get(place)
                .and_then(Option::as_ref)
                .is_some_and(|held| held.lease == lease);
            if is_held {
                settings.places[place].take()
            } else {
                None
            }
        };
        let Some(ended) = ended else { return };
        self.shared.tell(
            Level::Info,
            format!(
                "{} {because}: tool {} is free",
                ended.operator,
                tool_id(place)
            ),
        );
        // A loop that does not answer has worse troubles, and says so elsewhere.
        let _ = self
            .order(Order::Vacate {
                session: self.shared.number,
                place,
                lease,
            })
            .await;
    }

    async fn grant(
        &self,
        request: &JoinRequest,
        inner: &Inner,
    ) -> Result<Granted, (RefusalCode, String)> {
        if let Some(field) = self
            .shared
            .stats
            .lock()
            .expect("no holder panics")
            .record
            .fault
        {
            let reason =
                format!("the session is in fault ({field} is not finite); a fresh block ends it");
            return Err((RefusalCode::Fault, reason));
        }
        let lease = inner.next_lease.fetch_add(1, Ordering::Relaxed);
        let (place, loop_parameters, spec) = {
            let mut settings = self.shared.settings();
            let Some(place) = self.place_for(&request.operator, &settings.places) else {
                let reason = format!(
                    "all {} tools of session `{}` are held",
                    settings.places.len(),
                    self.shared.id
                );
                return Err((RefusalCode::NoFreeTool, reason));
            };
            let operator = request.operator.clone();
            settings.places[place] = Some(Lease {
                lease,
                operator,
                granted: Instant::now(),
            });
            (place, settings.parameters, settings.spec.clay.clone())
        };
        let unavailable = |reason: String| (RefusalCode::ShuttingDown, reason);
        let side = ToolSide::new(&loop_parameters, lease)
            .map_err(|error: ParameterError| unavailable(error.to_string()))?;
        let seat = Order::Seat {
            session: self.shared.number,
            place,
            side: Box::new(side),
        };
        if let Err(error) = self.order(seat).await {
            self.shared.settings().places[place] = None;
            return Err(unavailable(error.to_string()));
        }
        let (epoch, revision) = {
            let mirror = self.shared.mirror.lock().expect("no holder panics");
            (mirror.epoch, mirror.clay.revision())
        };
        Ok(Granted {
            lease,
            tool: tool_id(place),
            lease_s: self.shared.lease_s(),
            parameters: loop_parameters,
            clay: ClayDescription {
                shape: spec.shape,
                voxel_size_m: spec.voxel_size_m,
                epoch,
                revision,
            },
            slow_endpoint: inner.slow_endpoint.clone(),
        })
    }

    /// The operator's own place if it has fallen silent; else one that nobody holds; else any that has fallen silent.
    fn place_for(&self, operator: &str, places: &[Option<Lease>]) -> Option<usize> {
        let stats = self.shared.stats.lock().expect("no holder panics");
        let is_silent = |place: usize, held: &Lease| {
            let silent = stats.record.tools[place].is_some_and(|tool| {
                tool.lease == held.lease && !tool.is_connected && TAKEOVER_AFTER_S < tool.silence_s
            });
            // A fresh lease gets a second to send its first frame.
            silent && Duration::from_secs(1) < held.granted.elapsed()
        };
        let silent = |of: Option<&str>| {
            places.iter().enumerate().position(|(place, held)| {
                held.as_ref().is_some_and(|held| {
                    of.is_none_or(|operator| operator == held.operator) && is_silent(place, held)
                })
            })
        };
        silent(Some(operator))
            .or_else(|| places.iter().position(Option::is_none))
            .or_else(|| silent(None))
    }

    async fn order(&self, order: Order) -> Result<(), ChangeError> {
        let inner = self.directory.upgrade().ok_or(ChangeError::Gone)?;
        inner.order(order).await
    }

    /// Waits until the statistics know of the session at all.
    async fn first_record(&self) {
        self.until(|record| 0 < record.ticks).await;
    }

    async fn record_of_epoch(&self, epoch: u32) {
        self.until(|record| record.clay_epoch == epoch).await;
    }

    async fn until(&self, holds: impl Fn(&crate::engine::SessionRecord) -> bool) {
        let started = Instant::now();
        while started.elapsed() < ORDER_TIMEOUT {
            if holds(&self.shared.stats.lock().expect("no holder panics").record) {
                return;
            }
            tokio::time::sleep(TICK * 4).await;
        }
    }
}

/// A look at the watchers' copy of the clay.
#[derive(Clone)]
pub struct ClayView {
    shared: Arc<SessionShared>,
}

impl ClayView {
    /// Calls `look` with the clay and its epoch. Keep it short: the copy is locked meanwhile.
    pub fn with<T>(&self, look: impl FnOnce(&Clay, u32) -> T) -> T {
        let mirror = self.shared.mirror.lock().expect("no holder panics");
        look(&mirror.clay, mirror.epoch)
    }
}

/// The block, its memory committed, and a copy for the watchers.
fn build_clay(clay: &ClaySpec, spec: &NewSession) -> Result<(Clay, Clay), FieldError> {
    let shape = convert::shape(&clay.shape)?;
    let mut block = Clay::new(&shape, clay.voxel_size_m)
        .map_err(|error| FieldError::new("/shape", error.to_string()))?;
    let tool = convert::tool(&spec.tool)?;
    block
        .admits(&tool)
        .map_err(|error| FieldError::new("/voxel_size_m", error.to_string()))?;
    let mirror = block.clone();
    block.commit_pages();
    Ok((block, mirror))
}
