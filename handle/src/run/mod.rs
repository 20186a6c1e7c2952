//! The course of a run: join, drive the device, notice what is lost, join again, leave.
//!
//! | module | does |
//! |---|---|
//! | `lease` | looks for a server and takes the lease that it grants into use |
//! | `ticks` | reads what the tick has recorded, and does what follows from it |
//! | `failure` | why a run ended that was not asked to |

mod failure;
mod lease;
mod ticks;

use std::future::Future;
use std::pin::Pin;
use std::time::Duration;

use teleclay_bilateral::{Known, LinkState};
use teleclay_device::DeviceProfile;
use teleclay_link::scheme::SchemeContext;
use teleclay_proto::invite::InviteId;
use teleclay_proto::join::{FreshReply, LoopParameters};
use teleclay_proto::{RealmName, SessionId};
use teleclay_shell::endpoint::Endpoint;
use teleclay_shell::network::{self, Endpoints};
use teleclay_shell::realtime::Ends;
use teleclay_shell::ticker::{Scheduling, Ticker};
use teleclay_shell::{Clock, Drift};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::sync::watch;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval, sleep_until, timeout};
use zenoh::Session;

use crate::device::{Device, DeviceError, DeviceSetup};
use crate::door::Door;
use crate::engine::{Engine, Mode, Order};
use crate::event::Event;
use crate::grant::JoinGrant;
use crate::join::{self, JoinError};
use crate::line::{Gone, Line};
use crate::recording::Recording;
use crate::refresh::Fresh;
use crate::singularity::SingularityMonitor;
use crate::status::{Metrics, State, Status};

pub use failure::{EXIT_CODES, Failure};

/// How often the tick's records are read: soon enough for a person, and the ring holds two hundred times as many.
const READ_EVERY: Duration = Duration::from_millis(20);
/// How often the state is told.
const STATUS_EVERY: Duration = Duration::from_secs(1);
/// Bringing the handle to rest takes 0.3 s at most.
const REST_WITHIN: Duration = Duration::from_millis(500);
/// Ticks that say goodbye at least: enough for one of them to get through a line that loses every second frame.
const GOODBYES: u64 = 10;
/// A session that will not close is left to the end of the process.
const CLOSE_WITHIN: Duration = Duration::from_secs(1);

/// Opens the device for a setup.
pub type OpenDevice =
    Box<dyn Fn(&DeviceSetup) -> Result<Box<dyn Device>, DeviceError> + Send + Sync>;

/// What to run.
pub struct Options {
    /// The way to the server.
    pub door: Door,
    /// The session to join.
    pub session: SessionId,
    /// The realm that it belongs to.
    pub realm: RealmName,
    /// Who holds the handle.
    pub operator: String,
    /// The server's token, when it asks for one, or that of an invite.
    pub token: Option<String>,
    /// Which invite, if the token is that of one.
    pub invite: Option<InviteId>,
    /// What the handle is, for people to read.
    pub device: String,
    /// What it may do to the hand. What a server asks for is taken only below it.
    pub profile: DeviceProfile,
    /// Whether it joins again once a stop is cleared: only where that moves nothing by itself, or where it is asked
    /// for.
    pub waits_out_stops: bool,
    /// Opens it, once the session is known; again when a later lease brings another setup.
    pub open_device: OpenDevice,
    /// What to ask the scheduler for.
    pub scheduling: Scheduling,
    /// The last part of each wait that is spun.
    pub spin: Duration,
    /// How much faster the handle's clock runs than the system's; for tests of what another machine's crystal does.
    pub clock_drift: Drift,
    /// Where every tick is written down.
    pub recording: Option<Recording>,
}

/// When to end a run.
pub struct Until {
    /// Becomes true when somebody wants it to end.
    pub stop: watch::Receiver<bool>,
    /// And it ends at this instant by itself.
    pub deadline: Option<Instant>,
}

/// How a run ended.
#[derive(Debug)]
pub struct Ending {
    /// The whole run in figures.
    pub summary: Status,
    /// Why it ended, unless it was asked to and all was well.
    pub outcome: Result<(), Failure>,
}

/// Runs until the end that was asked for, or until a failure. Needs a runtime of several threads.
pub async fn run(options: Options, mut until: Until, events: UnboundedSender<Event>) -> Ending {
    let started = Instant::now();
    let (control, trusted) = match reach(&options, &mut until, &events).await {
        Ok(Some(reached)) => reached,
        not => {
            return Ending {
                summary: Status::default(),
                outcome: not.map(|_| ()),
            };
        }
    };
    let mut run = Run::new(options, control, trusted, events, started);
    let outcome = run.attend(&mut until).await;
    let is_over = run.leave().await;
    // A fault met while leaving is one all the same.
    let outcome = outcome.and(is_over);
    let state = outcome.is_ok().then_some(State::Leaving);
    let summary = run.metrics.summary(started.elapsed(), state);
    run.close().await;
    Ending { summary, outcome }
}

/// The session for frames, and the certificate that it trusts, if it must be told; nothing where the end came first.
async fn reach(
    options: &Options,
    until: &mut Until,
    events: &UnboundedSender<Event>,
) -> Result<Option<(Session, Option<String>)>, Failure> {
    let began = Instant::now();
    let tell = || {
        // Whoever listened has gone: then nobody needs to know.
        let _ = events.send(Event::Waiting {
            session: options.session.clone(),
            others: Vec::new(),
        });
    };
    let trusted = tokio::select! {
        trusted = options.door.wait(tell) => trusted?,
        () = end(until) => {
            if *until.stop.borrow() {
                return Ok(None);
            }
            return Err(Failure::NoServer {
                endpoint: options.door.endpoint.to_string(),
                session: options.session.clone(),
                waited_s: began.elapsed().as_secs_f64(),
            });
        }
    };
    let endpoints = Endpoints {
        trusted: trusted.clone(),
        ..Endpoints::connecting(options.door.endpoint.clone())
    };
    Ok(Some((network::open(&endpoints).await?, trusted)))
}

type Searching = Pin<Box<dyn Future<Output = Result<Box<JoinGrant>, JoinError>> + Send>>;
type Refreshing = Pin<Box<dyn Future<Output = Result<Fresh, String>> + Send>>;
type Freshening = Pin<Box<dyn Future<Output = Result<FreshReply, String>> + Send>>;

/// A device in motion.
struct Rig {
    setup: DeviceSetup,
    ticker: Ticker,
    ends: Ends<Engine>,
}

struct Run {
    options: Options,
    clock: Clock,
    started: Instant,
    control: Session,
    /// The certificate that Zenoh trusts beside those of public authorities, in PEM.
    trusted: Option<String>,
    /// Queries and liveliness while frames fly, on an endpoint of its own.
    slow: Option<(Endpoint, Session)>,
    events: UnboundedSender<Event>,
    metrics: Metrics,
    rig: Option<Rig>,
    line: Option<Line>,
    searching: Option<Searching>,
    searching_since: Instant,
    lost_at: Option<Instant>,
    /// Leases in a row, up to now, under which no frame came.
    unheard: u32,
    freshening: Option<Freshening>,
    /// What the tick wants to know is being fetched, for this lease.
    refreshing: Option<Refreshing>,
    refreshing_for: u32,
    /// Nothing is fetched before.
    refresh_from: Instant,
    /// The parameters that the tick works with.
    parameters: LoopParameters,
    /// The session, as the tick has last heard of it.
    known: Known,
    /// What controllers for the present lease are made from.
    context: Option<SchemeContext>,
    /// Time without a frame, as of the last record of the lease that is held.
    silence: Duration,
    /// Gets the lease that is over, or whose server has gone.
    gone: (UnboundedSender<Gone>, UnboundedReceiver<Gone>),
    /// The lease that the server itself has said is over.
    taken_back: Option<u32>,
    /// What was said of it last, and since when.
    said_gone: Option<(Gone, Instant)>,
    /// Of the last record: lease, state of the link, and since when it lasts.
    link_state: (u32, LinkState, Instant),
    mode: Mode,
    singularity: SingularityMonitor,
    is_leaving: bool,
}

impl Run {
    fn new(
        options: Options,
        control: Session,
        trusted: Option<String>,
        events: UnboundedSender<Event>,
        started: Instant,
    ) -> Self {
        let mut run = Self {
            clock: Clock::start_drifting(options.clock_drift),
            options,
            started,
            control,
            trusted,
            slow: None,
            events,
            metrics: Metrics::new(),
            rig: None,
            line: None,
            searching: None,
            searching_since: started,
            lost_at: None,
            unheard: 0,
            freshening: None,
            refreshing: None,
            refreshing_for: 0,
            refresh_from: started,
            parameters: LoopParameters::default(),
            known: Known::default(),
            context: None,
            silence: Duration::ZERO,
            gone: unbounded_channel(),
            taken_back: None,
            said_gone: None,
            link_state: (0, LinkState::NotYet, started),
            mode: Mode::Resting,
            singularity: SingularityMonitor::default(),
            is_leaving: false,
        };
        run.search();
        // Opening Zenoh has taken a part of the wait.
        run.searching_since = started;
        run
    }

    /// Until the end that was asked for.
    async fn attend(&mut self, until: &mut Until) -> Result<(), Failure> {
        let mut read = steady(READ_EVERY);
        let mut status = steady(STATUS_EVERY);
        loop {
            tokio::select! {
                biased;
                () = end(until) => return self.judge_the_end(*until.stop.borrow()),
                grant = finished(&mut self.searching) => {
                    self.searching = None;
                    let grant = grant
                        .map_err(|source| Failure::Join { session: self.options.session.clone(), source })?;
                    self.attach(grant).await?;
                }
                reply = finished(&mut self.freshening) => {
                    self.freshening = None;
                    self.emit(match reply {
                        Ok(FreshReply::Fresh { epoch }) => Event::FreshClay { epoch },
                        Ok(FreshReply::Refused { reason }) | Err(reason) => Event::NoFreshClay { reason },
                    });
                }
                Some(gone) = self.gone.1.recv() => self.on_server_gone(gone),
                fresh = finished(&mut self.refreshing) => {
                    self.refreshing = None;
                    self.on_refreshed(fresh);
                }
                _ = read.tick() => self.read()?,
                _ = status.tick() => {
                    let state = self.searching.is_some().then_some(State::Joining);
                    let status = self.metrics.status(self.started.elapsed(), state);
                    self.emit(Event::Status(Box::new(status)));
                }
            }
        }
    }

    /// An end that somebody asked for is always fine; time that ran out is not when there was no server at the end.
    fn judge_the_end(&self, is_asked_for: bool) -> Result<(), Failure> {
        if is_asked_for || self.searching.is_none() {
            return Ok(());
        }
        Err(Failure::NoServer {
            endpoint: self.options.door.endpoint.to_string(),
            session: self.options.session.clone(),
            waited_s: self.searching_since.elapsed().as_secs_f64(),
        })
    }

    /// Brings the handle to rest, says goodbye in frames, and gives the lease back.
    async fn leave(&mut self) -> Result<(), Failure> {
        let mut outcome = Ok(());
        self.is_leaving = true;
        if let Some(rig) = &mut self.rig {
            // A full ring means a thread that has stopped: then there is nothing to bring to rest.
            let _ = rig.ends.orders.push(Order::Leave);
            outcome = self.read();
            self.mode = Mode::Braking;
            let enough = self.metrics.ticks() + GOODBYES;
            let patience = Instant::now() + REST_WITHIN;
            let mut read = steady(READ_EVERY);
            // The handle comes to rest and says goodbye whatever the fault; a thread that has ended cannot.
            while matches!(outcome, Ok(()) | Err(Failure::Fault(_)))
                && (self.mode != Mode::Resting || self.metrics.ticks() < enough)
                && Instant::now() < patience
            {
                read.tick().await;
                let met = self.read();
                outcome = outcome.and(met);
            }
        }
        self.rig = None;
        if let Some(line) = self.line.take() {
            let JoinGrant {
                keys,
                granted,
                channel,
            } = &*line.grant;
            join::leave(&self.control, keys, channel, granted.lease).await;
        }
        outcome
    }

    async fn close(self) {
        if let Some((_, slow)) = &self.slow {
            close(slow).await;
        }
        close(&self.control).await;
    }

    fn emit(&self, event: Event) {
        // Whoever listened has gone: then nobody needs to know.
        let _ = self.events.send(event);
    }
}

fn steady(period: Duration) -> Interval {
    let mut steady = interval(period);
    steady.set_missed_tick_behavior(MissedTickBehavior::Delay);
    steady
}

async fn end(until: &mut Until) {
    let deadline = until.deadline;
    let time_is_over = async {
        match deadline {
            Some(deadline) => sleep_until(deadline).await,
            None => std::future::pending().await,
        }
    };
    let stop = &mut until.stop;
    let asked = async {
        // Whoever could ask has gone: the run goes on until its time is over.
        if stop.wait_for(|stop| *stop).await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    tokio::select! {
        () = asked => {}
        () = time_is_over => {}
    }
}

/// Ready when the future in the slot is; never while the slot is empty.
async fn finished<T>(slot: &mut Option<Pin<Box<dyn Future<Output = T> + Send>>>) -> T {
    match slot {
        Some(future) => future.await,
        None => std::future::pending().await,
    }
}

async fn close(session: &Session) {
    // Either it closes in time or the end of the process does it.
    let _ = timeout(CLOSE_WITHIN, async { session.close().await }).await;
}
