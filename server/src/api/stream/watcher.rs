//! One open socket.

use std::pin::Pin;
use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket, close_code};
use teleclay_proto::http::Session;
use teleclay_proto::invite::Role;
use teleclay_proto::watch::{ClientText, Level, ServerText, Switch};
use teleclay_proto::{PROTOCOL, SessionId};
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::{MissedTickBehavior, interval, timeout};
use tokio_tungstenite::tungstenite;

use super::MAX_INCOMING;
use super::bricks::Follower;
use super::budget::Budget;
use super::heartbeat::{Due, Heartbeat};
use super::telemetry::Batcher;
use crate::api::guard::check_role;
use crate::api::problem::{Failure, SYNTAX, TOO_LARGE};
use crate::api::sessions::change_failure;
use crate::api::{Api, see_through};
use crate::directory::{ChangeError, Live};
use crate::doors::Pass;
use crate::{Event, Sample};

/// Bricks and telemetry go out this often: 25 Hz, which a page drawing at 60 Hz shows within 100 ms of the cut.
const TICK: Duration = Duration::from_millis(40);

/// Ticks from state to state: 5 Hz, as fast as people read numbers.
const TICKS_PER_STATE: u32 = 5;

/// Bytes of bricks that one tick may send, so that the clay is not held, nor telemetry kept waiting, for a keyframe.
const BRICKS_PER_TICK: usize = 64 * 1024;

/// A watcher that does not take a message within this is gone, or as good as gone.
const SEND_TIMEOUT: Duration = Duration::from_secs(10);

/// What the audit log calls it.
const CHANGE: &str = "change by stream";

/// How long a watcher may take to answer a close.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);

/// Why a stream has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// The watcher closed it.
    Left,
    /// The connection broke.
    Lost,
    /// The watcher did not read for too long.
    Slow,
    /// The watcher gave no sign of life for too long.
    Silent,
    /// The session has ended.
    Deleted,
    /// The invite that let the watcher in has ended.
    Uninvited,
    /// The watcher sent a message that was too long.
    TooLong,
    /// The watcher sent a text that is not UTF-8.
    NotText,
    /// The watcher broke the protocol.
    Protocol,
}

impl End {
    /// What metrics and logs call it.
    pub(super) const fn word(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Lost => "lost",
            Self::Slow => "slow",
            Self::Silent => "silent",
            Self::Deleted => "session-ended",
            Self::Uninvited => "invite-ended",
            Self::TooLong => "too-long",
            Self::NotText => "not-text",
            Self::Protocol => "protocol",
        }
    }

    /// Whether what comes next may be the middle of a message.
    const fn lost_the_thread(self) -> bool {
        matches!(self, Self::TooLong | Self::Protocol)
    }

    /// What was wrong with the watcher's last message, when that ends the stream.
    fn problem(self) -> Option<Failure> {
        match self {
            Self::TooLong => {
                Some(TOO_LARGE.because(format!("the message has more than {MAX_INCOMING} bytes")))
            }
            Self::NotText => Some(SYNTAX.because("a text message came that is not UTF-8")),
            Self::Left
            | Self::Lost
            | Self::Slow
            | Self::Silent
            | Self::Deleted
            | Self::Uninvited
            | Self::Protocol => None,
        }
    }

    /// How the stream is closed to the watcher, when it can still hear.
    fn close_frame(self) -> Option<CloseFrame> {
        let (code, reason) = match self {
            Self::Left | Self::Lost => return None,
            Self::Slow => (4408, "messages were not read for ten seconds"),
            Self::Silent => (4408, "pings were not answered for 25 seconds"),
            Self::Deleted => (4404, "the session has ended"),
            Self::Uninvited => (4403, "the invite has ended"),
            Self::TooLong => (close_code::SIZE, "messages have at most 16384 bytes"),
            Self::NotText => (close_code::INVALID, "text messages are UTF-8"),
            Self::Protocol => (close_code::PROTOCOL, "that was no WebSocket frame"),
        };
        Some(CloseFrame {
            code,
            reason: Utf8Bytes::from_static(reason),
        })
    }
}

/// A change on its way through the loop; its answer.
type Change = Pin<Box<dyn Future<Output = ServerText> + Send>>;

/// Serves one socket.
pub(super) struct Watcher {
    api: Api,
    id: SessionId,
    live: Live,
    pass: Pass,
    budget: Budget,
    telemetry: Batcher,
    samples: Option<Receiver<Sample>>,
    events: Receiver<Event>,
    bricks: Follower,
    wants_bricks: Switch,
    /// One at a time; until it is answered nothing more is read.
    change: Option<Change>,
    ticks_to_state: u32,
    heartbeat: Heartbeat,
}

impl Watcher {
    pub(super) fn new(api: Api, id: SessionId, live: Live, pass: Pass) -> Self {
        Self {
            api,
            id,
            events: live.events(),
            live,
            pass,
            budget: Budget::full(Instant::now()),
            telemetry: Batcher::default(),
            samples: None,
            bricks: Follower::default(),
            wants_bricks: Switch::Off,
            change: None,
            ticks_to_state: TICKS_PER_STATE,
            heartbeat: Heartbeat::new(Instant::now()),
        }
    }

    /// Serves the socket until it ends, and says goodbye.
    pub(super) async fn serve(mut self, mut socket: WebSocket) -> End {
        let Err(end) = self.converse(&mut socket).await;
        if let Some(failure) = end.problem() {
            // Whoever cannot hear this cannot hear the close either.
            self.say(&mut socket, &problem(failure)).await.ok();
        }
        if let Some(close_frame) = end.close_frame() {
            let goodbye = async {
                let sent = socket.send(Message::Close(Some(close_frame))).await;
                // Where frames still begin and end where they should, the answer to the close can be told. The rest is
                // the connection's to throw away, so that the reason is not lost with it.
                while sent.is_ok()
                    && !end.lost_the_thread()
                    && matches!(socket.recv().await, Some(Ok(_)))
                {}
            };
            // Whoever does not answer has heard it, or never will.
            timeout(CLOSE_TIMEOUT, goodbye).await.ok();
        }
        end
    }

    async fn converse(&mut self, socket: &mut WebSocket) -> Result<Never, End> {
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
            tokio::select! {
                _ = ticks.tick() => self.tick(socket).await?,
                answer = answer_of(&mut self.change) => {
                    self.change = None;
                    self.say(socket, &answer).await?;
                }
                event = self.events.recv() => self.on_event(socket, event).await?,
                // Whoever asks for so much that the answers use up the share is heard more slowly.
                message = socket.recv(), if self.change.is_none() && self.budget.may_hear() => {
                    self.budget.on_request();
                    self.heartbeat.on_heard(Instant::now());
                    let message = message.ok_or(End::Left)?.map_err(end_of)?;
                    self.on_message(socket, message).await?;
                }
            }
        }
    }

    async fn tick(&mut self, socket: &mut WebSocket) -> Result<(), End> {
        if !self.live.is_there() {
            // What was said last may say why.
            while let Ok(event) = self.events.try_recv() {
                self.on_event(socket, Ok(event)).await?;
            }
            return Err(End::Deleted);
        }
        self.budget.refill(Instant::now());
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
        socket: &mut WebSocket,
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

    async fn on_message(&mut self, socket: &mut WebSocket, message: Message) -> Result<(), End> {
        let text = match message {
            Message::Text(text) => text,
            Message::Binary(_) => {
                let failure = SYNTAX.because("a binary message came, wanted JSON text");
                return self.say(socket, &problem(failure)).await;
            }
            // The library answers pings.
            Message::Ping(_) | Message::Pong(_) => return Ok(()),
            Message::Close(_) => return Err(End::Left),
        };
        let asked = ClientText::parse(&text);
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
                self.change = Some(Box::pin(async move { told(change.await, "/session", &id) }));
                Ok(())
            }
            Ok(ClientText::Reset { clay }) => {
                self.tell_change();
                let (live, id) = (self.live.clone(), self.id.clone());
                let change = see_through(async move { live.reset(clay, None).await });
                self.change = Some(Box::pin(async move { told(change.await, "/clay", &id) }));
                Ok(())
            }
            Ok(ClientText::Ping { nonce }) => self.say(socket, &ServerText::Pong { nonce }).await,
            Err(error) => self.say(socket, &problem(error.into())).await,
        }
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

    async fn send_state(&mut self, socket: &mut WebSocket) -> Result<(), End> {
        if !self.api.config().doors.is_good(&self.pass) {
            return Err(End::Uninvited);
        }
        self.ticks_to_state = TICKS_PER_STATE;
        let session = Box::new(self.live.state());
        self.say(socket, &ServerText::State { session }).await
    }

    async fn say(&mut self, socket: &mut WebSocket, text: &ServerText) -> Result<(), End> {
        let text = serde_json::to_string(text).expect("every map in it has strings as keys");
        self.send(socket, Message::Text(text.into())).await
    }

    /// Hands one message over to the connection, all of it.
    async fn send(&mut self, socket: &mut WebSocket, message: Message) -> Result<(), End> {
        let bytes = match &message {
            Message::Text(text) => text.len(),
            Message::Binary(bytes) => bytes.len(),
            _ => 0,
        };
        self.budget.spend(bytes);
        self.api.metrics().count_sent(bytes);
        match timeout(SEND_TIMEOUT, socket.send(message)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) => Err(End::Lost),
            Err(_) => Err(End::Slow),
        }
    }
}

/// A conversation does not end by itself.
enum Never {}

/// Waits for the change that is under way; for ever when there is none.
async fn answer_of(change: &mut Option<Change>) -> ServerText {
    match change {
        Some(change) => change.await,
        None => std::future::pending().await,
    }
}

/// What a watcher is told about its change. Fields are named as in its message, where the change stands at `prefix`.
fn told(
    changed: Result<Result<Session, ChangeError>, Failure>,
    prefix: &str,
    id: &SessionId,
) -> ServerText {
    match changed {
        Ok(Ok(session)) => ServerText::State {
            session: Box::new(session),
        },
        Ok(Err(ChangeError::Field(error))) => problem(error.under(prefix).into()),
        Ok(Err(error)) => problem(change_failure(error, id)),
        Err(failure) => problem(failure),
    }
}

fn problem(failure: Failure) -> ServerText {
    ServerText::Problem {
        problem: failure.into_problem(),
    }
}

fn end_of(error: axum::Error) -> End {
    use tungstenite::Error;
    let error = error.into_inner();
    match error.downcast_ref::<Error>() {
        Some(Error::Capacity(_)) => End::TooLong,
        Some(Error::Utf8(_)) => End::NotText,
        Some(Error::Protocol(tungstenite::error::ProtocolError::ResetWithoutClosingHandshake)) => {
            End::Lost
        }
        Some(Error::Protocol(_)) => End::Protocol,
        Some(Error::ConnectionClosed | Error::AlreadyClosed) => End::Left,
        _ => End::Lost,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_farewell_states_the_limit_that_holds() {
        let reason = End::TooLong.close_frame().unwrap().reason;
        assert!(reason.contains(&MAX_INCOMING.to_string()), "{reason}");
        let reason = End::Slow.close_frame().unwrap().reason;
        assert!(reason.contains("ten") && SEND_TIMEOUT.as_secs() == 10);
    }
}
