//! The course of a run: join, drive the device, notice what is lost, join again, leave.

use std::future::Future;
use std::pin::Pin;
use std::time::Duration;

use teleclay_bilateral::Contact;
use teleclay_link::safety::NotFinite;
use teleclay_proto::join::{FreshReply, JoinRequest};
use teleclay_proto::{NodeName, PROTOCOL, SessionId};
use teleclay_shell::network::{self, Endpoints, NetworkError};
use teleclay_shell::ticker::{Scheduling, Ticker, TickerConfig};
use teleclay_shell::{Clock, Drift};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::sync::watch;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval, sleep_until, timeout};
use zenoh::Session;

use crate::device::{Device, DeviceError, DeviceRequest, Workplace};
use crate::engine::{Ends, Engine, Mode, Order, Record};
use crate::event::Event;
use crate::join::{self, Invitation, JoinError, OldLease, Welcome};
use crate::line::{Line, LineError};
use crate::recording::Recording;
use crate::refresh::{self, Fresh, Wishes};
use crate::singularity::Lookout;
use crate::status::{State, Status, Tally};
use teleclay_link::time::Timestamp;

/// How often the tick's records are read: soon enough for a person, and the ring holds two hundred times as many.
const READ_EVERY: Duration = Duration::from_millis(20);
/// How often the state is told.
const TELL_EVERY: Duration = Duration::from_secs(1);
/// Without frames for this long a lease counts as lost. Shorter gaps mend themselves.
const LOST_AFTER: Duration = Duration::from_secs(1);
/// A copy of the clay goes on without frames, and what was cut since waits for the line: a new lease would give that up. The server holds a lease for
/// 10 s of silence, so the old one is asked back for until shortly before.
const LOST_ON_COPY_AFTER: Duration = Duration::from_secs(8);
/// A server whose end is seen was heard shortly before: a tick's records wait 20 ms, and the network's delay may be as long as sessions allow.
const HEARD_WITHIN: Duration = Duration::from_secs(1);
/// Bringing the handle to rest takes 0.3 s at most.
const REST_WITHIN: Duration = Duration::from_millis(500);
/// Ticks that say goodbye at least: enough for one of them to get through a line that loses every second frame.
const GOODBYES: u64 = 10;
/// A session that will not close is left to the end of the process.
const CLOSE_WITHIN: Duration = Duration::from_secs(1);

/// Opens the device for a workplace.
pub type OpenDevice = Box<dyn Fn(&Workplace) -> Result<Box<dyn Device>, DeviceError> + Send + Sync>;

/// What to run.
pub struct Options {
    /// Zenoh endpoint of the server.
    pub connect: String,
    /// The session to join.
    pub session: SessionId,
    /// The server, when several can be reached.
    pub node: Option<NodeName>,
    /// Who holds the handle.
    pub operator: String,
    /// The server's token, when it asks for one.
    pub token: Option<String>,
    /// What the handle is, for people to read.
    pub device: String,
    /// Opens it, once the session is known; again when a later lease brings another workplace.
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

/// Why a run ended that was not asked to, or had nothing to show.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Zenoh cannot be opened.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The session cannot be joined.
    #[error("session `{session}`: {source}")]
    Join {
        /// The session.
        session: SessionId,
        /// Why.
        source: JoinError,
    },
    /// The lease cannot be used.
    #[error(transparent)]
    Line(#[from] LineError),
    /// The device cannot be opened.
    #[error("the device: {0}")]
    Open(DeviceError),
    /// The device was lost on the way.
    #[error("{0}; force released")]
    Device(DeviceError),
    /// The system has no thread to give.
    #[error("the 1 kHz thread: {0}")]
    Thread(#[from] std::io::Error),
    /// The 1 kHz thread ended without a word.
    #[error("the 1 kHz thread has ended")]
    ThreadEnded,
    /// A value that no loop can work with.
    #[error("fault: {0}; force released")]
    Fault(NotFinite),
    /// The time is over and there was no server at the end.
    #[error("no server answers on {endpoint} for session `{session}`, asked for {waited_s:.1} s")]
    NoServer {
        /// Where it should have been.
        endpoint: String,
        /// The session.
        session: SessionId,
        /// How long it was looked for, s.
        waited_s: f64,
    },
}

impl Failure {
    /// The exit code of the program, see [`EXIT_CODES`].
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Join { .. } => 2,
            Self::Fault(_) | Self::ThreadEnded | Self::Device(_) => 3,
            Self::NoServer { .. } => 4,
            Self::Network(_) | Self::Line(_) | Self::Open(_) | Self::Thread(_) => 1,
        }
    }
}

/// What the program's exit codes mean, for its help.
pub const EXIT_CODES: &str = "\
Exit codes:
  0   ended as asked, by --seconds, Ctrl-C or SIGTERM
  1   could not run: an endpoint, thread or device is not to be had
  2   not let in: the server refuses, or its answer cannot be used; the reason is on stderr
  3   fault: a value that is not finite, or the device is lost; force was released
  4   no server: the time is over and none answered at its end
  64  the command line is wrong";

/// Runs until the end that was asked for, or until a failure. Needs a runtime of several threads.
pub async fn run(options: Options, mut until: Until, events: UnboundedSender<Event>) -> Ending {
    let started = Instant::now();
    let endpoints = Endpoints {
        connect: vec![options.connect.clone()],
        ..Endpoints::default()
    };
    let control = match network::open(&endpoints).await {
        Ok(control) => control,
        Err(error) => {
            return Ending {
                summary: Status::default(),
                outcome: Err(error.into()),
            };
        }
    };
    let mut run = Run::new(options, control, events, started);
    let outcome = run.attend(&mut until).await;
    let is_over = run.leave().await;
    // A fault met while leaving is one all the same.
    let outcome = outcome.and(is_over);
    let state = outcome.is_ok().then_some(State::Leaving);
    let summary = run.tally.summary(started.elapsed(), state);
    run.close().await;
    Ending { summary, outcome }
}

type Searching = Pin<Box<dyn Future<Output = Result<Box<Welcome>, JoinError>> + Send>>;
type Refreshing = Pin<Box<dyn Future<Output = Result<Fresh, String>> + Send>>;
type Freshening = Pin<Box<dyn Future<Output = Result<FreshReply, String>> + Send>>;

/// A device in motion.
struct Rig {
    workplace: Workplace,
    ticker: Ticker,
    ends: Ends,
}

struct Run {
    options: Options,
    clock: Clock,
    started: Instant,
    control: Session,
    /// Queries and liveliness while frames fly, on an endpoint of its own.
    slow: Option<(String, Session)>,
    events: UnboundedSender<Event>,
    tally: Tally,
    rig: Option<Rig>,
    line: Option<Line>,
    searching: Option<Searching>,
    searching_since: Instant,
    lost_at: Option<Instant>,
    freshening: Option<Freshening>,
    /// What the tick wants to know is being fetched, for this lease.
    refreshing: Option<Refreshing>,
    refreshing_for: u32,
    /// Nothing is fetched before.
    refresh_from: Instant,
    /// Revision of the parameters that the tick works with.
    revision: u16,
    /// Time without a frame, as of the last record of the lease that is held.
    silence: Duration,
    /// Gets the lease whose server has gone.
    gone: (UnboundedSender<u32>, UnboundedReceiver<u32>),
    /// Of the last record: lease, contact, and since when it lasts.
    contact: (u32, Contact, Instant),
    mode: Mode,
    lookout: Lookout,
    is_leaving: bool,
}

impl Run {
    fn new(
        options: Options,
        control: Session,
        events: UnboundedSender<Event>,
        started: Instant,
    ) -> Self {
        let mut run = Self {
            clock: Clock::start_drifting(options.clock_drift),
            options,
            started,
            control,
            slow: None,
            events,
            tally: Tally::new(),
            rig: None,
            line: None,
            searching: None,
            searching_since: started,
            lost_at: None,
            freshening: None,
            refreshing: None,
            refreshing_for: 0,
            refresh_from: started,
            revision: 0,
            silence: Duration::ZERO,
            gone: unbounded_channel(),
            contact: (0, Contact::NotYet, started),
            mode: Mode::Resting,
            lookout: Lookout::default(),
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
        let mut tell = steady(TELL_EVERY);
        loop {
            tokio::select! {
                biased;
                () = end(until) => return self.judge_the_end(*until.stop.borrow()),
                welcome = finished(&mut self.searching) => {
                    self.searching = None;
                    let welcome = welcome
                        .map_err(|source| Failure::Join { session: self.options.session.clone(), source })?;
                    self.sit(welcome).await?;
                }
                reply = finished(&mut self.freshening) => {
                    self.freshening = None;
                    self.tell(match reply {
                        Ok(FreshReply::Fresh { epoch }) => Event::FreshClay { epoch },
                        Ok(FreshReply::Refused { reason }) | Err(reason) => Event::NoFreshClay { reason },
                    });
                }
                Some(lease) = self.gone.1.recv() => self.on_server_gone(lease),
                fresh = finished(&mut self.refreshing) => {
                    self.refreshing = None;
                    self.on_refreshed(fresh);
                }
                _ = read.tick() => self.read()?,
                _ = tell.tick() => {
                    let state = self.searching.is_some().then_some(State::Joining);
                    let status = self.tally.status(self.started.elapsed(), state);
                    self.tell(Event::Status(Box::new(status)));
                }
            }
        }
    }

    /// Somebody's wish to end is always fine; time that ran out is not when there was no server at the end.
    fn judge_the_end(&self, is_wished: bool) -> Result<(), Failure> {
        if is_wished || self.searching.is_none() {
            return Ok(());
        }
        Err(Failure::NoServer {
            endpoint: self.options.connect.clone(),
            session: self.options.session.clone(),
            waited_s: self.searching_since.elapsed().as_secs_f64(),
        })
    }

    fn search(&mut self) {
        let invitation = Invitation {
            node: self.options.node.clone(),
            session: self.options.session.clone(),
            request: JoinRequest {
                protocol: PROTOCOL,
                operator: self.options.operator.clone(),
                token: self.options.token.clone(),
                device: self.options.device.clone(),
            },
        };
        let old = self.line.as_ref().map(|line| OldLease {
            keys: line.welcome.keys.clone(),
            lease: line.welcome.granted.lease,
            lease_s: line.welcome.granted.lease_s,
        });
        self.searching_since = Instant::now();
        self.searching = Some(Box::pin(join::search(
            self.control.clone(),
            invitation,
            old,
            self.events.clone(),
        )));
    }

    /// Takes a lease into use: by the running device when it fits, by a newly opened one when not.
    async fn sit(&mut self, welcome: Box<Welcome>) -> Result<(), Failure> {
        let (keys, lease) = (welcome.keys.clone(), welcome.granted.lease);
        let sat = self.try_to_sit(welcome).await;
        if sat.is_err() {
            // A lease that nobody will use should not hold the tool.
            join::leave(&self.control, &keys, lease).await;
        }
        sat
    }

    async fn try_to_sit(&mut self, welcome: Box<Welcome>) -> Result<(), Failure> {
        let workplace = Workplace::of(&welcome.granted);
        let parameters = welcome.granted.parameters;
        let joined = Event::Joined {
            node: welcome.keys.node().clone(),
            session: welcome.keys.session().clone(),
            tool: welcome.granted.tool,
            lease: welcome.granted.lease,
            scheme: parameters.scheme,
            after_s: self
                .lost_at
                .take()
                .map(|lost_at| lost_at.elapsed().as_secs_f64()),
        };
        self.open_slow(welcome.granted.slow_endpoint.as_deref())
            .await?;
        let (_, slow) = self.slow.as_ref().expect("it was opened in the line above");
        // The old line first: it may use the same keys.
        self.line = None;
        let gone = self.gone.0.clone();
        let (line, seat) = Line::open(&self.control, slow, self.clock, welcome, gone).await?;
        self.refreshing = None;
        self.revision = parameters.revision;
        self.tally.on_lease(line.welcome.granted.lease);
        self.line = Some(line);
        self.tell(joined);

        let fitting = self
            .rig
            .take_if(|rig| rig.workplace == workplace && !rig.ticker.is_finished());
        // A device that does not fit is let go before it is opened again.
        self.rig = None;
        if let Some(mut rig) = fitting {
            rig.ends
                .orders
                .push(Order::Take(seat))
                .map_err(|_| Failure::ThreadEnded)?;
            self.rig = Some(rig);
            return Ok(());
        }
        let device = (self.options.open_device)(&workplace).map_err(Failure::Open)?;
        let name = device.name().to_owned();
        let now = Timestamp::from_nanos(self.clock.now_ns());
        let (engine, ends) = Engine::new(now, workplace.tick_s, device, seat);
        let period = Duration::from_secs_f64(workplace.tick_s);
        let config = TickerConfig {
            name: "handle-tick",
            period: self.options.clock_drift.true_span(period),
            scheduling: self.options.scheduling,
            spin: self.options.spin,
        };
        let ticker = engine.spawn(self.clock, config)?;
        self.tally.on_thread(period, ticker.scheduler());
        let scheduler = ticker.scheduler().to_owned();
        self.tell(Event::Ticking {
            device: name,
            tick_s: workplace.tick_s,
            scheduler,
        });
        self.rig = Some(Rig {
            workplace,
            ticker,
            ends,
        });
        Ok(())
    }

    async fn open_slow(&mut self, granted: Option<&str>) -> Result<(), Failure> {
        let endpoint = granted.map_or_else(
            || self.options.connect.clone(),
            |slow| reachable(slow, &self.options.connect),
        );
        if self
            .slow
            .as_ref()
            .is_some_and(|(open, _)| *open == endpoint)
        {
            return Ok(());
        }
        let endpoints = Endpoints {
            connect: vec![endpoint.clone()],
            ..Endpoints::default()
        };
        let session = network::open(&endpoints).await?;
        if let Some((_, old)) = self.slow.replace((endpoint, session)) {
            close(&old).await;
        }
        Ok(())
    }

    /// Reads what the tick has recorded.
    fn read(&mut self) -> Result<(), Failure> {
        let Some(rig) = &mut self.rig else {
            return Ok(());
        };
        while rig.ends.discarded.pop().is_ok() {}
        let is_finished = rig.ticker.is_finished();
        let mut records = Vec::new();
        while let Ok(record) = rig.ends.records.pop() {
            records.push(record);
        }
        let failure = rig.ends.failures.pop().ok();
        if let Some(line) = &self.line {
            self.tally.observe(line);
        }
        self.write_down(&records);
        let mut outcome = Ok(());
        for record in &records {
            let met = self.on_record(record);
            outcome = outcome.and(met);
        }
        match failure {
            Some(error) => Err(Failure::Device(error)),
            None if is_finished => outcome.and(Err(Failure::ThreadEnded)),
            None => outcome,
        }
    }

    /// A recording that fails ends; the handle goes on.
    fn write_down(&mut self, records: &[Record]) {
        let Some(recording) = &mut self.options.recording else {
            return;
        };
        let written = records
            .iter()
            .try_for_each(|record| recording.write(record))
            .and_then(|()| recording.flush());
        if let Err(error) = written {
            self.options.recording = None;
            let reason = error.to_string();
            self.tell(Event::RecordingEnded { reason });
        }
    }

    fn on_record(&mut self, record: &Record) -> Result<(), Failure> {
        self.tally.add(record);
        self.mode = record.mode;
        if let Some(fault) = record.fault {
            return Err(Failure::Fault(fault));
        }
        if let Some(robot) = &record.robot
            && let Some(event) = self.lookout.watch(record.at_ns, robot)
        {
            self.tell(event);
        }
        if record.request == Some(DeviceRequest::FreshClay) {
            let rounds = self.tally.on_round();
            self.tell(Event::RoundFinished { rounds });
            self.ask_for_fresh_clay();
        }
        if self.is_leaving {
            // A server may stop speaking to whoever says goodbye.
            return Ok(());
        }
        let is_current = self
            .line
            .as_ref()
            .is_some_and(|line| line.welcome.granted.lease == record.lease);
        if !is_current {
            return Ok(());
        }
        self.silence = Duration::from_nanos(record.silence_ns);
        self.on_contact(record);
        self.refresh(record.lease, record.wishes);
        let is_on_copy = matches!(record.contact, Contact::OnCopy | Contact::OnStaleCopy);
        let lost_after = if is_on_copy {
            LOST_ON_COPY_AFTER
        } else {
            LOST_AFTER
        };
        let is_lost = lost_after.as_nanos() < u128::from(record.silence_ns);
        if is_lost && self.searching.is_none() {
            self.lost_at.get_or_insert_with(Instant::now);
            self.search();
        }
        Ok(())
    }

    /// Fetches what the tick wants to know, one thing after the other.
    fn refresh(&mut self, lease: u32, wishes: Wishes) {
        let wants_any = wishes.revision != self.revision || wishes.picture.is_some();
        let (Some(line), Some((_, slow)), None, true) =
            (&self.line, &self.slow, &self.refreshing, wants_any)
        else {
            return;
        };
        if Instant::now() < self.refresh_from {
            return;
        }
        self.refreshing_for = lease;
        self.refreshing = Some(Box::pin(refresh::refresh(
            slow.clone(),
            line.welcome.keys.clone(),
            self.revision,
            wishes,
        )));
    }

    fn on_refreshed(&mut self, fresh: Result<Fresh, String>) {
        self.refresh_from = Instant::now() + refresh::PAUSE;
        let lease = self.refreshing_for;
        let Some(rig) = &mut self.rig else { return };
        let orders = &mut rig.ends.orders;
        let Fresh {
            parameters,
            picture,
            took,
        } = match fresh {
            Ok(fresh) => fresh,
            Err(reason) => return self.tell(Event::NotRefreshed { reason }),
        };
        // Orders that find no room are lost, and what they carried is asked for again: the tick goes on wanting it.
        if let Some((revision, workplace)) = parameters
            && orders.push(Order::Move { lease, workplace }).is_ok()
        {
            self.revision = revision;
        }
        let Some(picture) = picture else { return };
        let epoch = picture.epoch;
        if orders.push(Order::Show { lease, picture }).is_ok() {
            self.tell(Event::Copied {
                epoch,
                took_s: took.as_secs_f64(),
            });
        }
    }

    /// The server's process has ended: the force goes, and another lease is asked for.
    fn on_server_gone(&mut self, lease: u32) {
        let is_current = self
            .line
            .as_ref()
            .is_some_and(|line| line.welcome.granted.lease == lease);
        // A token also goes when Zenoh gives up a line that has long been silent. A process that dies is seen at once.
        let was_heard = self.silence < HEARD_WITHIN;
        if !is_current || self.is_leaving || !was_heard {
            return;
        }
        if let Some(rig) = &mut self.rig {
            // A full ring means a thread that has stopped: nothing is felt then.
            let _ = rig.ends.orders.push(Order::Release { lease });
        }
        if self.searching.is_none() {
            self.lost_at.get_or_insert_with(Instant::now);
            self.tell(Event::ServerGone);
            self.search();
        }
    }

    fn on_contact(&mut self, record: &Record) {
        let (lease, before, since) = self.contact;
        if (lease, before) == (record.lease, record.contact) {
            return;
        }
        let now = Instant::now();
        self.contact = (record.lease, record.contact, now);
        let was_lost = lease == record.lease
            && matches!(
                before,
                Contact::Silent | Contact::OnCopy | Contact::OnStaleCopy | Contact::Gone
            );
        let was_held = lease == record.lease && matches!(before, Contact::Paused | Contact::Fault);
        match record.contact {
            // That the server has gone was told when it was seen.
            Contact::NotYet | Contact::Gone => {}
            Contact::Live => {
                let after_s = (was_lost || was_held).then(|| (now - since).as_secs_f64());
                if was_lost {
                    self.lost_at = None;
                }
                let was_on_copy = matches!(before, Contact::OnCopy | Contact::OnStaleCopy);
                self.tell(match after_s {
                    Some(after_s) if was_on_copy => Event::Together { after_s },
                    _ => Event::Live {
                        lease: record.lease,
                        after_s,
                    },
                });
            }
            Contact::Silent | Contact::OnCopy => {
                self.lost_at.get_or_insert(now);
                let silence_s = self
                    .line
                    .as_ref()
                    .map_or(0.0, |line| line.welcome.granted.parameters.silence_s);
                self.tell(if record.contact == Contact::Silent {
                    Event::Silent { silence_s }
                } else {
                    Event::OnCopy { silence_s }
                });
            }
            Contact::OnStaleCopy => self.tell(Event::OnStaleCopy),
            Contact::Paused => self.tell(Event::Paused),
            Contact::Fault => self.tell(Event::SessionFault),
        }
    }

    fn ask_for_fresh_clay(&mut self) {
        let (Some(line), Some((_, slow)), None) = (&self.line, &self.slow, &self.freshening) else {
            return;
        };
        let Welcome { keys, granted } = &*line.welcome;
        self.freshening = Some(Box::pin(join::fresh(
            slow.clone(),
            keys.clone(),
            granted.lease,
        )));
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
            let enough = self.tally.ticks() + GOODBYES;
            let patience = Instant::now() + REST_WITHIN;
            let mut read = steady(READ_EVERY);
            // The handle comes to rest and says goodbye whatever the fault; a thread that has ended cannot.
            while matches!(outcome, Ok(()) | Err(Failure::Fault(_)))
                && (self.mode != Mode::Resting || self.tally.ticks() < enough)
                && Instant::now() < patience
            {
                read.tick().await;
                let met = self.read();
                outcome = outcome.and(met);
            }
        }
        self.rig = None;
        if let Some(line) = self.line.take() {
            let Welcome { keys, granted } = &*line.welcome;
            join::leave(&self.control, keys, granted.lease).await;
        }
        outcome
    }

    async fn close(self) {
        if let Some((_, slow)) = &self.slow {
            close(slow).await;
        }
        close(&self.control).await;
    }

    fn tell(&self, event: Event) {
        // Whoever listened has gone: then nobody needs to know.
        let _ = self.events.send(event);
    }
}

/// The slow endpoint as seen from here: a server that listens everywhere names no address of its own.
fn reachable(slow: &str, connect: &str) -> String {
    let host = |endpoint: &str| {
        let address = endpoint.split_once('/').map(|(_, address)| address)?;
        address.rsplit_once(':').map(|(host, _)| host.to_owned())
    };
    match (host(slow), host(connect)) {
        (Some(everywhere), Some(known)) if everywhere == "0.0.0.0" || everywhere == "[::]" => {
            slow.replacen(&everywhere, &known, 1)
        }
        _ => slow.to_owned(),
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
    let wished = async {
        // Whoever could wish has gone: the run goes on until its time is over.
        if stop.wait_for(|stop| *stop).await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    tokio::select! {
        () = wished => {}
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_endpoint_that_listens_everywhere_is_reached_where_the_server_is() {
        let connect = "tcp/192.0.2.7:7447";
        assert_eq!(reachable("tcp/0.0.0.0:7448", connect), "tcp/192.0.2.7:7448");
        assert_eq!(
            reachable("udp/[::]:7448", "tcp/[2001:db8::1]:7447"),
            "udp/[2001:db8::1]:7448"
        );
        assert_eq!(
            reachable("tcp/127.0.0.1:7448", connect),
            "tcp/127.0.0.1:7448"
        );
    }
}
