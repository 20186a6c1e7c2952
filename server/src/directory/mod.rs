//! The directory: which sessions there are, and the way to each. The API and Zenoh both come here. It knows no rule of
//! a session: those are in `crates/session`.

mod joining;
mod kept;
mod live;
mod manners;
mod not_granted;
mod orders;
mod recording;
mod room;
mod threads;

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use teleclay_clay::Clay;
use teleclay_keeping::{Archive, Home, HomeError, Keeper};
use teleclay_link::time::Timestamp;
use teleclay_proto::http::{
    DamagedSession, DamagedState, FieldError, ListedSession, NewSession, Readiness,
    Session as SessionJson, StorageReport, StorageState,
};
use teleclay_proto::watch::Level;
use teleclay_proto::{NodeName, SessionId};
use teleclay_recording::Shelf;
use teleclay_session::{Rules, Session, SessionSetup, Settings};
use teleclay_shell::Clock;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::sync::watch;
use tokio::time::timeout;

use crate::collector::{Notice, notify};
use crate::doors::Doors;
use crate::engine::{Answer, FramesIn, Running, Task};
use crate::placing::{Budget, NoTickTime};
use crate::session::{Departure, SessionShared};

pub(crate) use joining::SocketGrant;
pub use kept::{ImportError, PastFailure};
pub use live::{ClayView, Live};
pub(crate) use manners::Control;
pub(crate) use not_granted::NotGranted;
pub use orders::{ChangeError, NoMemory};
pub use recording::RecordingFailure;
pub(crate) use threads::ThreadParts;
pub use threads::ThreadReport;

use orders::ORDER_TIMEOUT;
use room::find_room;
use threads::Threads;

/// The loop is called running when each of its threads ticked within this time.
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
    /// Its clay does not fit beside that of the others.
    #[error(transparent)]
    NoMemory(NoMemory),
    /// There is no time to run it beside the others.
    #[error(transparent)]
    NoTickTime(NoTickTime),
    /// A field cannot be.
    #[error("{}: {}", .0.pointer, .0.detail)]
    Field(FieldError),
    /// The loop does not take orders.
    #[error("{reason}")]
    Unavailable {
        /// The reason, in words.
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
    /// Those whose files are damaged.
    damaged: Mutex<HashMap<SessionId, DamagedSession>>,
    /// Counts the sessions that came and went.
    changes: watch::Sender<u64>,
    threads: Threads,
    notices: Sender<Notice>,
    zenoh_is_up: AtomicBool,
    next_number: AtomicU32,
    first_lease: u32,
    node: NodeName,
    doors: Arc<Doors>,
    home: Option<Arc<Home>>,
    recordings: Arc<Shelf>,
    clay_bytes: u64,
    slow_endpoint: Option<String>,
    clock: Clock,
    /// Holders who are to be told that their lease has ended; they go to whoever has the lines.
    departures: UnboundedSender<Departure>,
    departed: Mutex<Option<UnboundedReceiver<Departure>>>,
}

struct Entry {
    live: Live,
    frames: FramesIn,
}

/// What the directory is made of.
pub(crate) struct Parts {
    /// One for each tick thread.
    pub(crate) threads: Vec<ThreadParts>,
    /// What sessions may take of a tick.
    pub(crate) budget: Budget,
    pub(crate) notices: Sender<Notice>,
    pub(crate) node: NodeName,
    pub(crate) doors: Arc<Doors>,
    /// Where sessions are kept, if they are.
    pub(crate) home: Option<Arc<Home>>,
    /// Where recordings lie.
    pub(crate) recordings: Arc<Shelf>,
    /// Memory for the clay of all sessions.
    pub(crate) clay_bytes: u64,
    pub(crate) slow_endpoint: Option<String>,
    pub(crate) clock: Clock,
}

impl Directory {
    pub(crate) fn new(parts: Parts) -> Self {
        // Leases of an earlier run of the server must not be taken for ones of this run.
        let seed = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        let first_lease = seed.map_or(1, |since| (since.as_millis() as u32) | 1);
        let (departures, departed) = unbounded_channel();
        Self(Arc::new(Inner {
            sessions: Mutex::new(HashMap::new()),
            damaged: Mutex::new(HashMap::new()),
            changes: watch::Sender::new(0),
            threads: Threads::new(parts.threads, parts.budget),
            notices: parts.notices,
            zenoh_is_up: AtomicBool::new(false),
            next_number: AtomicU32::new(1),
            first_lease,
            node: parts.node,
            doors: parts.doors,
            home: parts.home,
            recordings: parts.recordings,
            clay_bytes: parts.clay_bytes,
            slow_endpoint: parts.slow_endpoint,
            clock: parts.clock,
            departures,
            departed: Mutex::new(Some(departed)),
        }))
    }

    /// What the scheduler granted a tick thread, once known.
    pub(crate) fn set_scheduler(&self, thread: usize, words: &str) {
        self.0.threads.set_scheduler(thread, words);
    }

    pub(crate) fn set_zenoh_up(&self) {
        self.0.zenoh_is_up.store(true, Ordering::Relaxed);
    }

    /// Every session, by name.
    pub fn sessions(&self) -> Vec<SessionJson> {
        self.lives().iter().map(Live::state).collect()
    }

    /// Every session, by name; those whose files are damaged, too.
    pub fn listed(&self) -> Vec<ListedSession> {
        let lives = self.sessions().into_iter();
        let lives = lives.map(|session| ListedSession::Session(Box::new(session)));
        let damaged: Vec<DamagedSession> = self.0.damaged().values().cloned().collect();
        let damaged = damaged.into_iter().map(ListedSession::Damaged);
        let mut sessions: Vec<ListedSession> = lives.chain(damaged).collect();
        sessions.sort_by(|a, b| a.id().cmp(b.id()));
        sessions
    }

    /// A session whose files are damaged.
    pub fn damaged(&self, id: &SessionId) -> Option<DamagedSession> {
        self.0.damaged().get(id).cloned()
    }

    /// Every session, by name, without its state.
    pub(crate) fn lives(&self) -> Vec<Live> {
        let entries = self.0.entries();
        let mut lives: Vec<Live> = entries.values().map(|entry| entry.live.clone()).collect();
        drop(entries);
        lives.sort_by(|a, b| a.id().cmp(b.id()));
        lives
    }

    /// Is told whenever a session has come or gone.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.0.changes.subscribe()
    }

    /// One session.
    pub fn session(&self, id: &SessionId) -> Option<Live> {
        self.0.entries().get(id).map(|entry| entry.live.clone())
    }

    /// Makes a session.
    ///
    /// # Errors
    /// The name is taken, there are too many, a field cannot be, or the loop does not answer.
    pub async fn create(&self, new: NewSession) -> Result<SessionJson, CreateError> {
        self.0.find_room(&new.id)?;
        let settings = Settings::new(new).map_err(CreateError::Field)?;
        self.0.find_memory(&settings)?;
        let thread = self.find_thread()?;
        let (home, first_lease) = (self.0.home.clone(), self.0.first_lease);
        // A large block takes seconds.
        let built = tokio::task::spawn_blocking(move || begin(settings, None, home, first_lease));
        self.add(built.await.map_err(unavailable)??, thread).await
    }

    /// Makes a session with the clay and the settings of another one, and a history of its own.
    ///
    /// # Errors
    /// As [`Directory::create`].
    pub async fn duplicate(&self, of: &Live, id: SessionId) -> Result<SessionJson, CreateError> {
        self.0.find_room(&id)?;
        let mut settings = of.settings();
        settings.spec.id = id;
        settings.revision = 0;
        self.0.find_memory(&settings)?;
        let thread = self.find_thread()?;
        let (home, first_lease) = (self.0.home.clone(), self.0.first_lease);
        let clay = of.clay();
        let built = tokio::task::spawn_blocking(move || {
            let clay = clay.with(|clay, _| Clay::clone(clay));
            begin(settings, Some(clay), home, first_lease)
        });
        self.add(built.await.map_err(unavailable)??, thread).await
    }

    fn find_thread(&self) -> Result<usize, CreateError> {
        let found = self.0.find_time_for_another();
        found.map_err(CreateError::NoTickTime)
    }

    /// Goes on with the sessions that an earlier server has kept. One that cannot be gone on with is set aside with its
    /// reason, and the others begin.
    ///
    /// # Errors
    /// The folder of sessions cannot be read.
    pub(crate) async fn recover(&self, clock: Clock) -> Result<(), HomeError> {
        let Some(home) = &self.0.home else {
            return Ok(());
        };
        for id in home.names()? {
            let (from, name) = (Arc::clone(home), id.clone());
            let recovered = tokio::task::spawn_blocking(move || {
                let now = Timestamp::from_nanos(clock.now_ns());
                from.recover(&name, now)
                    .map(|(session, keeper, archive)| Begun {
                        mirror: session.clay().clone(),
                        session,
                        kept: Some((keeper, archive)),
                    })
            });
            let added = match recovered.await {
                Ok(Ok(begun)) => self
                    .add(begun, self.0.place())
                    .await
                    .map(drop)
                    .map_err(|error| error.to_string()),
                Ok(Err(error)) => Err(error.to_string()),
                Err(error) => Err(error.to_string()),
            };
            match added {
                Ok(()) => tracing::info!(session = %id, "goes on"),
                Err(reason) => {
                    tracing::error!(session = %id, "is set aside as it is: {reason}");
                    let damaged = DamagedSession {
                        id: id.clone(),
                        state: DamagedState::Damaged,
                        storage: StorageReport {
                            state: StorageState::Failed,
                            durable_revision: 0,
                            bytes: home.bytes(&id),
                            reason: Some(reason),
                        },
                    };
                    self.0.damaged().insert(id, damaged);
                }
            }
        }
        if self.0.is_short_of_time() {
            tracing::warn!(
                "the sessions that go on may take more of a tick than the budget has: ticks may start late"
            );
        }
        Ok(())
    }

    /// Lets a session run.
    async fn add(&self, begun: Begun, thread: usize) -> Result<SessionJson, CreateError> {
        let Begun {
            session,
            mirror,
            kept,
        } = begun;
        let id = session.settings().spec.id.clone();
        let (keeper, archive) = kept.unzip();
        let number = self.0.next_number.fetch_add(1, Ordering::Relaxed);
        let snapshot = session.snapshot();
        let shared = Arc::new(SessionShared::new(
            number,
            thread,
            snapshot,
            mirror,
            archive,
            self.0.departures.clone(),
        ));
        let (running, ends) = Running::new(number, session, keeper);
        let live = Live::new(Arc::clone(&shared), Arc::downgrade(&self.0));
        {
            let mut sessions = self.0.entries();
            find_room(&sessions, &id)?;
            sessions.insert(
                id.clone(),
                Entry {
                    live: live.clone(),
                    frames: Arc::new(Mutex::new(ends.frames)),
                },
            );
        }
        notify(
            &self.0.notices,
            Notice::Added(Arc::clone(&shared), ends.told),
        );
        let add = Task::Add(Some(running));
        let added = self.0.carry_out(&shared, add).await;
        if !matches!(added, Ok(Answer::Done)) {
            self.0.entries().remove(&id);
            notify(&self.0.notices, Notice::Removed(number));
            return Err(CreateError::Unavailable {
                reason: ChangeError::Timeout.to_string(),
            });
        }
        self.0.changes.send_modify(|changes| *changes += 1);
        live.first_record().await;
        live.is_kept().await;
        Ok(live.state())
    }

    /// Ends a session.
    ///
    /// # Errors
    /// There is none of this name.
    pub async fn delete(&self, id: &SessionId) -> Result<(), NoSuchSession> {
        if self.0.damaged().remove(id).is_some() {
            self.remove_files(id, None).await;
            return Ok(());
        }
        let live = self.session(id).ok_or(NoSuchSession)?;
        // It does not move from thread to thread meanwhile. A loop that does not answer keeps nobody from deleting.
        let _stays = timeout(ORDER_TIMEOUT, live.shared.moving.read()).await;
        let entry = self.0.entries().remove(id).ok_or(NoSuchSession)?;
        let shared = &entry.live.shared;
        // Handles hear of it first: they let go at once.
        self.0.changes.send_modify(|changes| *changes += 1);
        shared.emit(Level::Warning, "the session was deleted".to_owned());
        notify(&self.0.notices, Notice::Removed(shared.number));
        // The session is out of the directory either way; a loop that is late only keeps it a little longer.
        let remove = Task::Remove {
            session: shared.number,
            removed: None,
        };
        let _ = self.0.threads.carry_out(shared.thread(), remove).await;
        self.remove_files(id, Some(entry.live)).await;
        Ok(())
    }

    async fn remove_files(&self, id: &SessionId, live: Option<Live>) {
        let (Some(home), id) = (self.0.home.clone(), id.clone()) else {
            return;
        };
        let removed = tokio::task::spawn_blocking(move || {
            let archive = live.as_ref().and_then(|live| live.shared.archive.as_ref());
            archive.iter().for_each(|archive| archive.end());
            home.remove(&id)
        });
        // It is not joined only where the server ends.
        if let Ok(Err(error)) = removed.await {
            tracing::error!(%error, "the files of a deleted session cannot be removed");
        }
    }

    /// Whether the loop runs on every thread and Zenoh is up.
    pub fn readiness(&self) -> Readiness {
        let loop_running = self.0.threads.have_ticked_within(LOOP_ALIVE);
        let zenoh_up = self.0.zenoh_is_up.load(Ordering::Relaxed);
        Readiness {
            ready: loop_running && zenoh_up,
            loop_running,
            zenoh_up,
        }
    }

    /// Ring into which frames of a session's handles go.
    pub(crate) fn frames(&self, id: &SessionId) -> Option<FramesIn> {
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

    /// The clock that frames are stamped with.
    pub(crate) fn clock(&self) -> Clock {
        self.0.clock
    }

    /// The holders who are to be told that their lease has ended, for the first who asks.
    pub(crate) fn departed(&self) -> Option<UnboundedReceiver<Departure>> {
        self.0.departed.lock().expect("no holder panics").take()
    }

    /// What a join has to show.
    pub(crate) fn doors(&self) -> &Arc<Doors> {
        &self.0.doors
    }
}

impl Inner {
    fn entries(&self) -> std::sync::MutexGuard<'_, HashMap<SessionId, Entry>> {
        self.sessions.lock().expect("no holder panics")
    }

    fn damaged(&self) -> std::sync::MutexGuard<'_, HashMap<SessionId, DamagedSession>> {
        self.damaged.lock().expect("no holder panics")
    }
}

/// A session that can run.
struct Begun {
    session: Session,
    /// The watchers' clay.
    mirror: Clay,
    kept: Option<(Keeper, Archive)>,
}

/// With this clay, or with the block that the settings describe.
fn begin(
    settings: Settings,
    given: Option<Clay>,
    home: Option<Arc<Home>>,
    first_lease: u32,
) -> Result<Begun, CreateError> {
    let id = settings.spec.id.clone();
    if home.as_ref().is_some_and(|home| home.has(&id)) {
        // One that was set aside keeps its name.
        return Err(CreateError::Exists { id });
    }
    let is_given = given.is_some();
    let fresh = || {
        let fresh = settings.fresh_block();
        fresh.map_err(|error| CreateError::Field(error.under("/clay")))
    };
    let clay = given.map_or_else(fresh, Ok)?;
    let mut mirror = clay.clone();
    let mut session = Session::new(SessionSetup {
        lines: settings.lines(),
        settings,
        clay,
        rules: Rules::default(),
        first_lease,
        ownership_epoch: 1,
    });
    let given = is_given.then_some(&mut mirror);
    let kept = home
        .map(|home| home.begin(&mut session, given))
        .transpose()
        .map_err(unavailable)?;
    Ok(Begun {
        kept,
        session,
        mirror,
    })
}

fn unavailable(error: impl std::fmt::Display) -> CreateError {
    CreateError::Unavailable {
        reason: error.to_string(),
    }
}
