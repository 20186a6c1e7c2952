//! One open socket.

use std::collections::BTreeMap;
use std::pin::Pin;
use std::time::{Duration, Instant, SystemTime};

use axum::body::Bytes;
use axum::extract::ws::{Message, WebSocket};
use futures_util::StreamExt as _;
use teleclay_foxglove::Connection;
use teleclay_foxglove::connection::{self as protocol, Call, Flow, Rate, SERVICE_ENCODING};
use teleclay_foxglove::server::{ServerBinary, ServerText};
use teleclay_ros::names;
use tokio::sync::watch;
use tokio::time::{Interval, MissedTickBehavior, interval};

use super::followed::{Followed, Numbers, Piece, channel};
use super::line::Line;
use super::services::Errand;
use super::trail::Trail;
use crate::api::problem::Failure;
use crate::api::socket::budget::Budget;
use crate::api::socket::end::{End, end_of};
use crate::api::socket::heartbeat::{Due, Heartbeat};
use crate::api::socket::{Source, say_goodbye};
use crate::api::{Api, see_through};
use crate::doors::Pass;
use crate::ros;

/// Samples are taken out of the loop's this often, and all transforms are told: 50 Hz.
const TICK: Duration = Duration::from_millis(20);

/// Ticks from look to look at who there is and may look: 5 Hz.
const TICKS_PER_LOOK: u32 = 10;

/// Looks from diagnosis to diagnosis: 1 Hz, as ROS 2 has it.
const LOOKS_PER_DIAGNOSIS: u32 = 5;

/// Messages that are handed to the connection at once. What is more important waits for no more than these.
const BURST: usize = 16;

/// Bytes after which a burst ends.
const BURST_BYTES: usize = 64 * 1024;

/// A client is told that samples were left out once in this time.
const TELL_LEFT_OUT_EVERY: Duration = Duration::from_secs(10);

/// What the audit log calls it.
const CHANGE: &str = "change by foxglove";

/// ROS 2's distribution whose types the messages are of.
const DISTRIBUTION: &str = "jazzy";

/// A call under way, and what comes of it.
type Work = Pin<Box<dyn Future<Output = (Call, Errand, Result<String, Failure>)> + Send>>;

/// Serves one socket.
pub(super) struct Visit {
    api: Api,
    pass: Pass,
    connection: Connection<Piece>,
    sessions: Vec<Followed>,
    numbers: Numbers,
    tf_id: u32,
    diagnostics_id: u32,
    changes: watch::Receiver<u64>,
    /// One at a time.
    work: Option<Work>,
    budget: Budget,
    heartbeat: Heartbeat,
    trail: Trail,
    ping_due: bool,
    ticks_to_look: u32,
    looks_to_diagnosis: u32,
    left_out: u64,
    told_left_out: Option<Instant>,
}

impl Visit {
    pub(super) fn new(api: Api, pass: Pass, rate: Rate) -> Self {
        let now = Instant::now();
        let mut numbers = Numbers::default();
        let (tf_id, diagnostics_id) = (numbers.next(), numbers.next());
        let mut connection = Connection::new(&info(&api), rate);
        let channels = vec![
            (channel(tf_id, &names::tf()), Flow::Samples),
            (channel(diagnostics_id, &names::diagnostics()), Flow::State),
        ];
        connection.offer(channels, Vec::new());
        let mut visit = Self {
            changes: api.directory().changes(),
            api,
            pass,
            connection,
            sessions: Vec::new(),
            numbers,
            tf_id,
            diagnostics_id,
            work: None,
            budget: Budget::full(now),
            heartbeat: Heartbeat::new(now),
            trail: Trail::default(),
            ping_due: false,
            ticks_to_look: TICKS_PER_LOOK,
            looks_to_diagnosis: LOOKS_PER_DIAGNOSIS,
            left_out: 0,
            told_left_out: None,
        };
        visit.follow();
        visit
    }

    /// Serves the socket until it ends, and says goodbye.
    pub(super) async fn serve(mut self, socket: WebSocket) -> End {
        let (mouth, mut ear) = socket.split();
        let mut line = Line::Idle(mouth);
        let mut ticks = interval(TICK);
        // A client that was slow does not get the ticks it has missed all at once.
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let end = loop {
            if let Err(end) = self.turn(&mut line, &mut ear, &mut ticks).await {
                break end;
            }
        };
        if let Some(mut mouth) = line.end().await {
            say_goodbye(&mut mouth, &mut ear, end).await;
        }
        end
    }

    /// Lets one thing happen. What is sent keeps nothing from being heard, nor from being left out in time.
    async fn turn(
        &mut self,
        line: &mut Line,
        ear: &mut Source,
        ticks: &mut Interval,
    ) -> Result<(), End> {
        if self.connection.is_overfull() {
            return Err(End::Slow);
        }
        if line.is_idle() {
            let burst = self.burst(Instant::now());
            if !burst.is_empty() {
                line.begin(burst);
            }
        }
        let may_hear = self.connection.may_hear() && self.budget.may_hear();
        tokio::select! {
            done = line.is_done() => done?,
            _ = ticks.tick() => self.tick()?,
            changed = self.changes.changed() => match changed {
                Ok(()) => self.follow(),
                // The server ends.
                Err(_) => return Err(End::Lost),
            },
            (call, errand, done) = result_of(&mut self.work) => {
                self.work = None;
                self.answer(&call, errand, done);
                self.take_calls();
            }
            heard = ear.next(), if may_hear => match heard {
                None => return Err(End::Left),
                Some(Err(error)) => return Err(end_of(error)),
                Some(Ok(message)) => self.hear(message)?,
            },
        }
        Ok(())
    }

    /// The messages whose turn it is: state first, then the oldest samples, as far as the client keeps up.
    fn burst(&mut self, now: Instant) -> Vec<Message> {
        let mut burst = Vec::new();
        let mut bytes = 0;
        if std::mem::take(&mut self.ping_due) {
            burst.push(Message::Ping(Bytes::new()));
        }
        let mut payload = Vec::new();
        while burst.len() < BURST && bytes < BURST_BYTES {
            let message = match self.connection.poll_state() {
                Some(protocol::Message::Text(text)) => Message::Text(text.into()),
                Some(protocol::Message::Binary(bytes)) => Message::Binary(bytes.into()),
                None => {
                    let keeps_up = 0 < self.budget.left_bytes() && !self.trail.is_behind(now);
                    let sampled = keeps_up.then(|| self.connection.poll_sample()).flatten();
                    let Some(sampled) = sampled else { break };
                    sampled.sample.write(sampled.time_ns, &mut payload);
                    self.trail.on_sample();
                    let data = ServerBinary::MessageData {
                        subscription_id: sampled.subscription_id,
                        time_ns: sampled.time_ns,
                        payload: &payload,
                    };
                    Message::Binary(data.to_bytes().into())
                }
            };
            let length = match &message {
                Message::Text(text) => text.len(),
                Message::Binary(bytes) => bytes.len(),
                _ => 0,
            };
            bytes += length;
            self.budget.spend(length);
            self.api.metrics().count_sent(length);
            burst.push(message);
        }
        if let Some(ping) = self.trail.due(now) {
            burst.push(Message::Ping(Bytes::copy_from_slice(&ping)));
        }
        burst
    }

    fn tick(&mut self) -> Result<(), End> {
        let now = Instant::now();
        self.budget.refill(now);
        match self.heartbeat.due(now) {
            Due::Nothing => {}
            Due::Ping => self.ping_due = true,
            Due::Goodbye => return Err(End::Silent),
        }
        let now_ns = now_ns();
        for session in &mut self.sessions {
            session.tell_state(now_ns, &mut self.connection);
            session.tell_samples(now_ns, self.tf_id, &mut self.connection);
        }
        if self.connection.wants(self.tf_id) {
            let sessions = self.sessions.iter();
            let transforms: Vec<_> = sessions
                .flat_map(|session| session.transforms(now_ns))
                .collect();
            if !transforms.is_empty() {
                let piece = Piece::Written(ros::tf(transforms));
                let now_s = now_ns as f64 * 1e-9;
                self.connection
                    .push_sample(self.tf_id, now_s, now_ns, piece);
            }
        }
        self.ticks_to_look -= 1;
        if self.ticks_to_look == 0 {
            self.ticks_to_look = TICKS_PER_LOOK;
            self.look(now)?;
        }
        Ok(())
    }

    /// What is due more rarely.
    fn look(&mut self, now: Instant) -> Result<(), End> {
        if !self.api.config().doors.is_good(&self.pass) {
            return Err(End::Uninvited);
        }
        let mut facts = BTreeMap::new();
        for session in &self.sessions {
            session.facts(&mut facts);
        }
        self.connection.set_facts(facts);
        self.looks_to_diagnosis -= 1;
        if self.looks_to_diagnosis == 0 {
            self.looks_to_diagnosis = LOOKS_PER_DIAGNOSIS;
            self.diagnose();
        }
        let left_out = self.connection.take_left_out();
        self.api
            .metrics()
            .count_dropped(u32::try_from(left_out).unwrap_or(u32::MAX));
        self.left_out += left_out;
        let is_time = |told| TELL_LEFT_OUT_EVERY <= now.duration_since(told);
        if 0 < self.left_out && self.told_left_out.is_none_or(is_time) {
            let words = format!(
                "{} samples were left out: more came than was read, or than 2 Mbit/s carry",
                self.left_out
            );
            self.connection.warn(words);
            self.left_out = 0;
            self.told_left_out = Some(now);
        }
        Ok(())
    }

    fn diagnose(&mut self) {
        if !self.connection.wants(self.diagnostics_id) {
            return;
        }
        let states: Vec<_> = self
            .sessions
            .iter()
            .map(|session| session.live().state())
            .collect();
        let now_ns = now_ns();
        let message = ros::diagnostics(self.api.config().node.as_str(), &states, now_ns);
        self.connection
            .push_state(self.diagnostics_id, now_ns, &message);
    }

    /// Takes note of sessions that have come and gone.
    fn follow(&mut self) {
        self.changes.mark_unchanged();
        let mut lives = self.api.directory().lives();
        lives.retain(|live| self.pass.covers(live.id()));
        let now_ns = now_ns();
        let (connection, numbers) = (&mut self.connection, &mut self.numbers);
        self.sessions.retain_mut(|session| {
            let number = session.live().number();
            let is_there = lives.iter().any(|live| live.number() == number);
            if !is_there {
                // What was said last may say why.
                session.tell_state(now_ns, connection);
                connection.withdraw(session.channel_ids(), session.service_ids());
            }
            is_there
        });
        for live in lives {
            let mut followed = self.sessions.iter();
            if followed.any(|session| session.live().number() == live.number()) {
                continue;
            }
            let (session, channels, services) = Followed::begin(live, numbers);
            connection.offer(channels, services);
            self.sessions.push(session);
        }
    }

    fn hear(&mut self, message: Message) -> Result<(), End> {
        self.heartbeat.on_heard(Instant::now());
        match message {
            Message::Close(_) => return Err(End::Left),
            // The library answers it.
            Message::Ping(_) => {}
            Message::Pong(payload) => self.trail.on_pong(&payload),
            Message::Text(text) => {
                self.budget.on_request();
                self.connection.handle_text(&text);
            }
            Message::Binary(bytes) => {
                self.budget.on_request();
                self.connection.handle_binary(&bytes);
            }
        }
        while let Some(channel_id) = self.connection.poll_subscribed() {
            if channel_id == self.diagnostics_id {
                self.diagnose();
            }
            for session in &self.sessions {
                session.on_subscribed(channel_id, now_ns(), &mut self.connection);
            }
        }
        self.take_calls();
        Ok(())
    }

    /// Begins with the next call, unless one is under way.
    fn take_calls(&mut self) {
        while self.work.is_none()
            && let Some(call) = self.connection.poll_call()
        {
            self.begin(call);
        }
    }

    fn begin(&mut self, call: Call) {
        let mut sessions = self.sessions.iter();
        let found = sessions.find_map(|session| {
            let errand = session.errand(call.service_id)?;
            Some((session.live().clone(), errand))
        });
        let Some((live, errand)) = found else {
            return self.connection.answer(&call, Err("the session has ended"));
        };
        let doors = &self.api.config().doors;
        if let Err(failure) = errand.check(&self.pass, live.id()) {
            doors.tell_refused(&self.pass.who, CHANGE, Some(live.id()), "403");
            return self.connection.answer(&call, Err(&failure.to_string()));
        }
        match errand.read(&call.payload) {
            Ok(change) => {
                doors.tell(&self.pass.who, CHANGE, Some(live.id()), "asked");
                let done = see_through(change.carry_out(live));
                self.work = Some(Box::pin(async move {
                    (call, errand, done.await.and_then(|done| done))
                }));
            }
            Err(reason) => {
                let response = errand.write(Err(&reason));
                self.connection.answer(&call, Ok(&response));
            }
        }
    }

    fn answer(&mut self, call: &Call, errand: Errand, done: Result<String, Failure>) {
        let done = done.map_err(|failure| failure.to_string());
        let response = errand.write(done.as_deref().map_err(String::as_str));
        self.connection.answer(call, Ok(&response));
    }
}

/// What the server says of itself.
fn info(api: &Api) -> ServerText {
    let config = api.config();
    let words = |words: &[&str]| words.iter().map(ToString::to_string).collect();
    let metadata = [
        // By this name a client knows whose types the messages are of.
        ("ROS_DISTRO", DISTRIBUTION.to_owned()),
        ("teleclay_node", config.node.to_string()),
        ("teleclay_version", config.version.clone()),
    ];
    let metadata = metadata.map(|(key, value)| (key.to_owned(), value));
    let runs_for = config.started.elapsed();
    let began = SystemTime::now().checked_sub(runs_for);
    let began = began.and_then(|began| began.duration_since(SystemTime::UNIX_EPOCH).ok());
    ServerText::ServerInfo {
        name: format!("teleclay {}", config.node),
        capabilities: words(&["services", "parameters", "parametersSubscribe"]),
        supported_encodings: words(&[SERVICE_ENCODING]),
        metadata: metadata.into(),
        // Another one for each run: the second in which it began.
        session_id: began.map_or_else(String::new, |began| began.as_secs().to_string()),
    }
}

/// Time since 1970, ns.
fn now_ns() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |since| {
        u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
    })
}

/// Waits for what comes of the call that is under way; for ever where none is.
async fn result_of(work: &mut Option<Work>) -> (Call, Errand, Result<String, Failure>) {
    match work {
        Some(work) => work.await,
        None => std::future::pending().await,
    }
}
