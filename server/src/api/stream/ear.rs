//! The half of a socket that hears: never kept waiting by what is being sent, nor by what was asked before.
//!
//! Frames go to the tick from here, and a stop is carried out from here. Everything else waits its turn, and whoever
//! sends more than there is any use for is heard more slowly.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use axum::extract::ws::{Message, WebSocket};
use futures_util::StreamExt as _;
use futures_util::stream::SplitStream;
use serde_json::Value;
use teleclay_proto::http::NO_REASON;
use teleclay_proto::invite::Role;
use teleclay_proto::watch::{FramesView, ServerText};
use tokio::sync::mpsc::Sender;
use tokio::time::{Duration, sleep};

use super::answer::{problem, told_of_change};
use super::hand::Hearing;
use super::operate::Asker;
use super::pace::Pace;
use crate::api::problem::{NO_LEASE, SYNTAX};
use crate::api::see_through;
use crate::api::socket::MAX_INCOMING;
use crate::api::socket::end::{End, end_of};

/// Whoever sends more than there is any use for is looked at again so soon.
const PAUSE: Duration = Duration::from_millis(5);
/// Binary messages that make no sense are answered once in this time.
const SAID_EVERY: Duration = Duration::from_secs(1);

/// What was heard and is for others to do.
pub(super) enum Heard {
    /// A text, to be parsed in its turn.
    Text(String),
    /// To be said.
    Said(Box<ServerText>),
}

/// What both halves of a socket know.
#[derive(Clone, Default)]
pub(super) struct Shared(Arc<Known>);

#[derive(Default)]
struct Known {
    hearing: Mutex<Option<Hearing>>,
    /// Something has come since somebody looked.
    gave_a_sign: AtomicBool,
    stops: Stops,
}

impl Shared {
    /// The lease of this socket from now on, or none.
    pub(super) fn hold(&self, hearing: Option<Hearing>) {
        *self.hearing() = hearing;
    }

    /// Whether anything has come since the last look.
    pub(super) fn gave_a_sign(&self) -> bool {
        self.0.gave_a_sign.swap(false, Ordering::Relaxed)
    }

    fn hearing(&self) -> MutexGuard<'_, Option<Hearing>> {
        self.0
            .hearing
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

/// Hears until the socket ends.
pub(super) struct Ear<'a> {
    pub(super) asker: Asker<'a>,
    pub(super) shared: Shared,
    pub(super) heard: Sender<Heard>,
}

impl Ear<'_> {
    pub(super) async fn listen(&self, socket: &mut SplitStream<WebSocket>) -> End {
        let mut said: Option<Instant> = None;
        let mut pace = Pace::of_a_watcher(Instant::now());
        loop {
            let message = match socket.next().await {
                None => return End::Left,
                Some(Err(error)) => return end_of(error),
                Some(Ok(message)) => message,
            };
            self.shared.0.gave_a_sign.store(true, Ordering::Relaxed);
            let heard = match message {
                Message::Close(_) => return End::Left,
                // The library answers pings, and they count as messages.
                Message::Ping(_) | Message::Pong(_) => {
                    self.wait_for(&mut pace).await;
                    continue;
                }
                Message::Binary(bytes) => {
                    self.wait_for(&mut pace).await;
                    let now = Instant::now();
                    let is_time = said.is_none_or(|said| SAID_EVERY < now.duration_since(said));
                    match self.frames(&bytes) {
                        Some(text) if is_time => {
                            said = Some(now);
                            Heard::Said(Box::new(text))
                        }
                        _ => continue,
                    }
                }
                Message::Text(text) => {
                    if let Some((operator, reason)) = stop_in(&text) {
                        match self.stop(operator, reason) {
                            Some(text) => Heard::Said(Box::new(text)),
                            None => continue,
                        }
                    } else if MAX_INCOMING < text.len() {
                        return End::TooLong;
                    } else {
                        self.wait_for(&mut pace).await;
                        Heard::Text(text.to_string())
                    }
                }
            };
            // It is gone only where the socket is.
            if self.heard.send(heard).await.is_err() {
                return End::Left;
            }
        }
    }

    /// Waits where a hand sends more than any loop does, or somebody without one more than `pace`.
    async fn wait_for(&self, pace: &mut Pace) {
        loop {
            let now = Instant::now();
            let may_hear = match &mut *self.shared.hearing() {
                Some(hearing) => hearing.may_hear(now),
                None => pace.may_hear(now),
            };
            if may_hear {
                return;
            }
            sleep(PAUSE).await;
        }
    }

    /// Takes frames to the tick; what to say otherwise.
    fn frames(&self, bytes: &[u8]) -> Option<ServerText> {
        let failure = match &mut *self.shared.hearing() {
            Some(hearing) => SYNTAX.because(hearing.hear(bytes).err()?.to_string()),
            // Frames leave before a lease is there and after it has ended: a loop knows of neither at once.
            None if FramesView::decode(bytes).is_ok() => {
                self.asker.live.count_unheard();
                return None;
            }
            None => NO_LEASE.because("a binary message came from a socket that holds no tool"),
        };
        Some(problem(failure))
    }

    /// Stops the session, whatever else is under way on this socket; what to say otherwise.
    fn stop(&self, operator: Option<String>, reason: Option<String>) -> Option<ServerText> {
        let (by, pass) = match &*self.shared.hearing() {
            Some(hearing) => (Some(hearing.operator().to_owned()), Some(hearing.pass())),
            None => (None, None),
        };
        let asker = self.asker.with(pass.as_ref());
        if let Err(failure) = asker.check(Role::Operator, "stop by stream") {
            return Some(problem(failure));
        }
        if self.shared.0.stops.lock().ask() == Turn::Later {
            return None;
        }
        let by = by.unwrap_or_else(|| asker.name(operator));
        let reason = reason.unwrap_or_else(|| NO_REASON.to_owned());
        asker.tell("stop by stream");
        let (live, id) = (asker.live.clone(), asker.id.clone());
        let (shared, heard) = (self.shared.clone(), self.heard.clone());
        tokio::spawn(async move {
            let told = loop {
                let (live, by, reason) = (live.clone(), by.clone(), reason.clone());
                let stop = async move { live.stop(&by, &reason).await.map(drop) };
                let told = told_of_change(see_through(stop).await, &id);
                if shared.0.stops.lock().done() == Turn::Now {
                    break told;
                }
            };
            // Where so many texts wait that this finds no room, the state tells of the stop.
            heard.try_send(Heard::Said(Box::new(told))).ok();
        });
        None
    }
}

/// The stops of a socket: one is carried out at a time, and one that comes meanwhile is carried out after it, since the
/// first may have been cleared by then.
#[derive(Default)]
struct Stops(Mutex<Asked>);

#[derive(Clone, Copy, Default)]
struct Asked {
    is_under_way: bool,
    again: bool,
}

#[derive(Debug, PartialEq, Eq)]
enum Turn {
    Now,
    Later,
}

impl Stops {
    fn lock(&self) -> MutexGuard<'_, Asked> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Asked {
    /// Whether a stop is to be begun, or left to the one that is under way.
    fn ask(&mut self) -> Turn {
        if self.is_under_way {
            self.again = true;
            return Turn::Later;
        }
        self.is_under_way = true;
        Turn::Now
    }

    /// One was carried out; whether that was all.
    fn done(&mut self) -> Turn {
        if std::mem::take(&mut self.again) {
            return Turn::Later;
        }
        self.is_under_way = false;
        Turn::Now
    }
}

/// The words of a stop, where a text is one: nothing that is wrong with it is a reason not to stop.
fn stop_in(text: &str) -> Option<(Option<String>, Option<String>)> {
    const BEGINS: &str = "{\"type\":\"stop\"";
    let Ok(value) = serde_json::from_str::<Value>(text) else {
        let printed = text.chars().filter(|part| !part.is_whitespace());
        let start: String = printed.take(BEGINS.len()).collect();
        return (start == BEGINS).then_some((None, None));
    };
    let word = |name: &str| value[name].as_str().map(str::to_owned);
    (value["type"] == "stop").then(|| (word("operator"), word("reason")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_that_comes_while_one_is_under_way_is_carried_out_after_it() {
        let mut asked = Asked::default();
        assert_eq!(asked.ask(), Turn::Now);
        assert_eq!((asked.ask(), asked.ask()), (Turn::Later, Turn::Later));
        assert_eq!((asked.done(), asked.done()), (Turn::Later, Turn::Now));
        assert_eq!(asked.ask(), Turn::Now);
    }

    #[test]
    fn nothing_that_is_wrong_with_a_stop_keeps_it_from_being_one() {
        let long = format!(r#"{{"type": "stop", "reason": "{}"}}"#, "a".repeat(50_000));
        for text in [
            r#"{"type":"stop"}"#,
            r#"{"reason":"enough","type":"stop"}"#,
            r#"{"type":"stop","operator":5}"#,
            r#"{"type":"stop","reason":null}"#,
            r#"{"type":"stop","strange":true}"#,
            r#"{"type" : "stop"} and more"#,
            r#"{"type":"stop","reason":"\ud800"}"#,
            &long,
        ] {
            assert!(stop_in(text).is_some(), "{text:.60}");
        }
        let words = stop_in(r#"{"type":"stop","operator":"Ada","reason":"enough"}"#);
        assert_eq!(
            words,
            Some((Some("Ada".to_owned()), Some("enough".to_owned())))
        );
        for text in [
            "",
            "stop",
            r#"{"type":"stopped"}"#,
            r#"{"type":"ping","nonce":1}"#,
            r#"{"type":"patch","session":{"type":"stop"}}"#,
            r#"["type","stop"]"#,
        ] {
            assert_eq!(stop_in(text), None, "{text}");
        }
    }
}
