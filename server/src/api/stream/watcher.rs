//! One open socket.

use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::extract::ws::{Message, WebSocket};
use futures_util::StreamExt as _;
use teleclay_front::Peer;
use teleclay_proto::invite::Role;
use teleclay_proto::watch::{ClientText, Level, ServerText, Switch};
use teleclay_proto::{PROTOCOL, SessionId};
use tokio::sync::broadcast;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::mpsc::{self, Receiver};
use tokio::time::{MissedTickBehavior, interval};

use super::answer::{Answer, Change, problem, told};
use super::bricks::Follower;
use super::ear::{Ear, Heard, Shared};
use super::hand::{Hand, Hearing, due};
use super::operate::{Asker, Work};
use super::telemetry::Batcher;
use crate::api::guard::check_role;
use crate::api::socket::budget::Budget;
use crate::api::socket::end::End;
use crate::api::socket::heartbeat::{Due, Heartbeat};
use crate::api::socket::{Mouth, hand_over, say_goodbye};
use crate::api::{Api, see_through};
use crate::directory::Live;
use crate::doors::Pass;
use crate::{Event, Sample};

/// Bricks and telemetry go out this often: 25 Hz, which a page drawing at 60 Hz shows within 100 ms of the cut.
const TICK: Duration = Duration::from_millis(40);

/// Ticks from state to state: 5 Hz, as fast as people read numbers.
const TICKS_PER_STATE: u32 = 5;

/// Bytes of bricks that one tick may send, so that the clay is not held, nor telemetry kept waiting, for a keyframe.
const BRICKS_PER_TICK: usize = 64 * 1024;

/// What the audit log calls it.
const CHANGE: &str = "change by stream";

/// Texts that wait for their turn; while so many do, nothing more is read.
const TEXTS_WAITING: usize = 16;

/// Serves one socket.
pub(super) struct Watcher {
    api: Api,
    id: SessionId,
    live: Live,
    pass: Pass,
    peer: Option<Peer>,
    budget: Budget,
    telemetry: Batcher,
    samples: Option<broadcast::Receiver<Sample>>,
    events: broadcast::Receiver<Event>,
    bricks: Follower,
    wants_bricks: Switch,
    /// One at a time; until it is answered no other text is heard.
    change: Option<Change>,
    hand: Option<Hand>,
    /// What the ear knows, too.
    shared: Shared,
    /// When the last snapshot was asked for.
    snapshot_at: Option<Instant>,
    ticks_to_state: u32,
    heartbeat: Heartbeat,
}

impl Watcher {
    pub(super) fn new(api: Api, id: SessionId, live: Live, pass: Pass, peer: Option<Peer>) -> Self {
        Self {
            api,
            id,
            events: live.events(),
            live,
            pass,
            peer,
            budget: Budget::full(Instant::now()),
            telemetry: Batcher::default(),
            samples: None,
            bricks: Follower::default(),
            wants_bricks: Switch::Off,
            change: None,
            shared: Shared::default(),
            snapshot_at: None,
            hand: None,
            ticks_to_state: TICKS_PER_STATE,
            heartbeat: Heartbeat::new(Instant::now()),
        }
    }

    /// Serves the socket until it ends, and says goodbye.
    pub(super) async fn serve(mut self, socket: WebSocket) -> End {
        let (mut mouth, mut ear) = socket.split();
        let (heard, texts) = mpsc::channel(TEXTS_WAITING);
        let (api, id, live) = (self.api.clone(), self.id.clone(), self.live.clone());
        let pass = self.pass.clone();
        let listener = Ear {
            asker: Asker {
                api: &api,
                id: &id,
                live: &live,
                pass: &pass,
                peer: self.peer,
            },
            shared: self.shared.clone(),
            heard,
        };
        // Side by side: what is sent keeps nobody from being heard.
        let end = tokio::select! {
            Err(end) = self.converse(&mut mouth, texts) => end,
            end = listener.listen(&mut ear) => end,
        };
        // The tool is free at once.
        self.hold(None);
        if let Some(failure) = end.problem() {
            // Whoever cannot hear this cannot hear the close either.
            self.say(&mut mouth, &problem(failure)).await.ok();
        }
        say_goodbye(&mut mouth, &mut ear, end).await;
        end
    }

    /// The lease of this socket from now on, or none.
    fn hold(&mut self, lease: Option<(Hand, Hearing)>) {
        let (hand, hearing) = lease.unzip();
        self.shared.hold(hearing);
        self.hand = hand;
    }

    async fn converse(
        &mut self,
        socket: &mut Mouth,
        mut texts: Receiver<Heard>,
    ) -> Result<Never, End> {
        let mut ticks = interval(TICK);
        // A watcher that was slow does not get the ticks it has missed all at once.
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let hello = ServerText::Hello {
            protocol: PROTOCOL,
            session: self.id.clone(),
            server_version: self.api.config().version.clone(),
        };
        self.say(socket, &hello).await?;
        self.send_state(socket).await?;
        loop {
            let may_do = self.change.is_none() && self.budget.may_hear();
            tokio::select! {
                _ = ticks.tick() => self.tick(socket).await?,
                answer = answer_of(&mut self.change) => {
                    self.change = None;
                    self.answer(socket, answer).await?;
                }
                event = self.events.recv() => self.on_event(socket, event).await?,
                () = due(self.hand.as_ref()) => self.send_frames(socket).await?,
                // Whoever asks for so much that the answers use up the share is answered more slowly.
                Some(heard) = texts.recv(), if may_do => {
                    self.budget.on_request();
                    match heard {
                        Heard::Said(text) => self.say(socket, &text).await?,
                        Heard::Text(text) => self.on_text(socket, &text).await?,
                    }
                }
            }
        }
    }

    /// Tells what came of something; a lease is this socket's from then on.
    async fn answer(&mut self, socket: &mut Mouth, answer: Answer) -> Result<(), End> {
        let Answer { text, hand, bricks } = answer;
        if hand.is_some() {
            self.hold(hand);
        }
        self.say(socket, &text).await?;
        for message in bricks {
            self.send(socket, Message::Binary(message.into())).await?;
            // A large block takes its time, and a hand feels it.
            self.send_frames(socket).await?;
        }
        Ok(())
    }

    /// Hands over the frames that wait, and what the server has to say of the lease.
    async fn send_frames(&mut self, socket: &mut Mouth) -> Result<(), End> {
        let Some(hand) = &mut self.hand else {
            return Ok(());
        };
        let (message, farewell) = (hand.outgoing(), hand.farewell());
        self.api.metrics().count_forgotten(hand.take_forgotten());
        if let Some(message) = message {
            self.api.metrics().count_sent(message.len());
            hand_over(socket, Message::Binary(message.into())).await?;
        }
        if let Some(reason) = farewell {
            self.hold(None);
            self.say(socket, &ServerText::Farewell { reason }).await?;
        }
        Ok(())
    }

    async fn tick(&mut self, socket: &mut Mouth) -> Result<(), End> {
        if !self.live.is_there() {
            // What was said last may say why.
            while let Ok(event) = self.events.try_recv() {
                self.on_event(socket, Ok(event)).await?;
            }
            return Err(End::Deleted);
        }
        self.budget.refill(Instant::now());
        if self.shared.gave_a_sign() {
            self.heartbeat.on_heard(Instant::now());
        }
        match self.heartbeat.due(Instant::now()) {
            Due::Nothing => {}
            Due::Ping => self.send(socket, Message::Ping(Bytes::new())).await?,
            Due::Goodbye => return Err(End::Silent),
        }
        if let Some(samples) = &mut self.samples {
            for ready in self.telemetry.drain(samples) {
                self.api.metrics().count_dropped(ready.dropped);
                self.send(socket, Message::Binary(ready.message.into()))
                    .await?;
            }
        }
        self.ticks_to_state -= 1;
        if self.ticks_to_state == 0 {
            self.send_state(socket).await?;
        }
        if self.wants_bricks == Switch::On {
            let most_bytes = self.budget.left_bytes().min(BRICKS_PER_TICK);
            let bricks = &mut self.bricks;
            let messages = self
                .live
                .clay()
                .with(|clay, epoch| bricks.follow(clay, epoch, most_bytes));
            for message in messages {
                self.send(socket, Message::Binary(message.into())).await?;
            }
        }
        Ok(())
    }

    async fn on_event(
        &mut self,
        socket: &mut Mouth,
        event: Result<Event, RecvError>,
    ) -> Result<(), End> {
        let event = match event {
            Ok(event) => event,
            // The session holds the other end for as long as it lives.
            Err(RecvError::Closed) => return Err(End::Deleted),
            Err(RecvError::Lagged(missed)) => self.unread(missed),
        };
        let Event {
            level,
            text,
            time_s,
        } = event;
        self.say(
            socket,
            &ServerText::Event {
                level,
                text,
                time_s,
            },
        )
        .await
    }

    /// Takes the place of events that this watcher was too slow for.
    fn unread(&self, missed: u64) -> Event {
        let control_loop = self.live.state().control_loop;
        Event {
            level: Level::Warning,
            text: format!("{missed} events are not shown: they came faster than they were read"),
            time_s: control_loop.ticks as f64 / control_loop.rate_hz,
        }
    }

    async fn on_text(&mut self, socket: &mut Mouth, text: &str) -> Result<(), End> {
        let asked = ClientText::parse(text);
        if let Ok(ClientText::Patch { .. } | ClientText::Reset { .. }) = &asked
            && let Err(failure) = check_role(&self.pass, Role::Admin)
        {
            let doors = &self.api.config().doors;
            doors.tell_refused(&self.pass.who, CHANGE, Some(&self.id), "403");
            return self.say(socket, &problem(failure)).await;
        }
        match asked {
            Ok(ClientText::Subscribe { telemetry, bricks }) => {
                self.subscribe(telemetry, bricks);
                Ok(())
            }
            Ok(ClientText::Patch { session }) => {
                self.tell_change();
                if let Err(error) = session.fits(self.live.state().network) {
                    return self
                        .say(socket, &problem(error.under("/session").into()))
                        .await;
                }
                let (live, id) = (self.live.clone(), self.id.clone());
                let change = see_through(async move { live.patch(*session).await });
                self.begin(async move { told(change.await, "/session", &id).into() });
                Ok(())
            }
            Ok(ClientText::Reset { clay }) => {
                self.tell_change();
                let (live, id) = (self.live.clone(), self.id.clone());
                let change = see_through(async move { live.reset(clay, None).await });
                self.begin(async move { told(change.await, "/clay", &id).into() });
                Ok(())
            }
            Ok(ClientText::Ping { nonce }) => self.say(socket, &ServerText::Pong { nonce }).await,
            Ok(asked) => self.operate(socket, asked).await,
            Err(error) => self.say(socket, &problem(error.into())).await,
        }
    }

    /// What is for those who hold a tool, or want one.
    async fn operate(&mut self, socket: &mut Mouth, asked: ClientText) -> Result<(), End> {
        let asker = Asker {
            api: &self.api,
            id: &self.id,
            live: &self.live,
            pass: &self.pass,
            peer: self.peer,
        };
        let held = self.hand.is_some();
        let work = asker.work(asked, &mut self.hand, &mut self.snapshot_at);
        if held && self.hand.is_none() {
            self.shared.hold(None);
        }
        match work {
            Ok(Work::Said(text)) => self.say(socket, &text).await,
            Ok(Work::Begun(change)) => {
                self.change = Some(change);
                Ok(())
            }
            Err(failure) => self.say(socket, &problem(failure)).await,
        }
    }

    fn begin(&mut self, change: impl Future<Output = Answer> + Send + 'static) {
        self.change = Some(Box::pin(change));
    }

    /// Writes down that a change was asked for.
    fn tell_change(&self) {
        let doors = &self.api.config().doors;
        doors.tell(&self.pass.who, CHANGE, Some(&self.id), "asked");
    }

    fn subscribe(&mut self, telemetry: Switch, bricks: Switch) {
        match telemetry {
            Switch::On if self.samples.is_none() => self.samples = Some(self.live.telemetry()),
            Switch::On => {}
            Switch::Off => {
                self.samples = None;
                self.telemetry.rest();
            }
        }
        if bricks == Switch::Off {
            self.bricks.rest();
        }
        self.wants_bricks = bricks;
    }

    async fn send_state(&mut self, socket: &mut Mouth) -> Result<(), End> {
        if !self.api.config().doors.is_good(&self.pass) {
            return Err(End::Uninvited);
        }
        self.ticks_to_state = TICKS_PER_STATE;
        let session = Box::new(self.live.state());
        self.say(socket, &ServerText::State { session }).await
    }

    async fn say(&mut self, socket: &mut Mouth, text: &ServerText) -> Result<(), End> {
        let text = serde_json::to_string(text).expect("every map in it has strings as keys");
        self.send(socket, Message::Text(text.into())).await
    }

    /// Hands one message over to the connection, all of it.
    async fn send(&mut self, socket: &mut Mouth, message: Message) -> Result<(), End> {
        let bytes = match &message {
            Message::Text(text) => text.len(),
            Message::Binary(bytes) => bytes.len(),
            _ => 0,
        };
        self.budget.spend(bytes);
        self.api.metrics().count_sent(bytes);
        hand_over(socket, message).await
    }
}

/// A conversation does not end by itself.
enum Never {}

/// Waits for the change that is under way; for ever when there is none.
async fn answer_of(change: &mut Option<Change>) -> Answer {
    match change {
        Some(change) => change.await,
        None => std::future::pending().await,
    }
}
