//! The half of a socket that hears: never kept waiting by what is being sent, nor by what was asked before.
//!
//! Frames go to the tick from here, and a stop is carried out from here. Everything else waits its turn.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use axum::extract::ws::{Message, WebSocket};
use futures_util::StreamExt as _;
use futures_util::stream::SplitStream;
use serde_json::Value;
use teleclay_proto::http::NO_REASON;
use teleclay_proto::invite::Role;
use teleclay_proto::watch::{ClientText, FramesView, ServerText};
use tokio::sync::mpsc::Sender;
use tokio::time::{Duration, sleep};

use super::MAX_INCOMING;
use super::answer::{problem, told_of_change};
use super::end::{End, end_of};
use super::hand::Hearing;
use super::operate::Asker;
use crate::api::problem::{NO_LEASE, SYNTAX};
use crate::api::see_through;

/// A hand that sends more than any loop does is looked at again so soon.
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
    /// A stop is being carried out.
    stops: AtomicBool,
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
        loop {
            let message = match socket.next().await {
                None => return End::Left,
                Some(Err(error)) => return end_of(error),
                Some(Ok(message)) => message,
            };
            self.shared.0.gave_a_sign.store(true, Ordering::Relaxed);
            let heard = match message {
                Message::Close(_) => return End::Left,
                // The library answers pings; they count as messages all the same.
                Message::Ping(_) | Message::Pong(_) => {
                    self.pace().await;
                    continue;
                }
                Message::Binary(bytes) => {
                    self.pace().await;
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
                        self.stop(operator, reason);
                        continue;
                    }
                    if MAX_INCOMING < text.len() {
                        return End::TooLong;
                    }
                    Heard::Text(text.to_string())
                }
            };
            // It is gone only where the socket is.
            if self.heard.send(heard).await.is_err() {
                return End::Left;
            }
        }
    }

    /// Waits where a hand sends more than any loop does.
    async fn pace(&self) {
        loop {
            let may_hear = match &mut *self.shared.hearing() {
                Some(hearing) => hearing.may_hear(Instant::now()),
                None => true,
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

    /// Stops the session, whatever else is under way on this socket.
    fn stop(&self, operator: Option<String>, reason: Option<String>) {
        let (by, pass) = match &*self.shared.hearing() {
            Some(hearing) => (Some(hearing.operator().to_owned()), Some(hearing.pass())),
            None => (None, None),
        };
        let asker = self.asker.with(pass.as_ref());
        let heard = self.heard.clone();
        if let Err(failure) = asker.check(Role::Operator, "stop by stream") {
            let said = Heard::Said(Box::new(problem(failure)));
            tokio::spawn(async move { heard.send(said).await.ok() });
            return;
        }
        if self.shared.0.stops.swap(true, Ordering::Relaxed) {
            // The one under way is as good.
            return;
        }
        let by = by.unwrap_or_else(|| asker.name(operator));
        let reason = reason.unwrap_or_else(|| NO_REASON.to_owned());
        asker.tell("stop by stream");
        let (live, id, shared) = (asker.live.clone(), asker.id.clone(), self.shared.clone());
        tokio::spawn(async move {
            let stopped = see_through(async move { live.stop(&by, &reason).await.map(drop) }).await;
            shared.0.stops.store(false, Ordering::Relaxed);
            let said = told_of_change(stopped, &id);
            // The socket may have gone.
            heard.send(Heard::Said(Box::new(said))).await.ok();
        });
    }
}

/// The words of a stop, where a text is one: nothing that is wrong with it is a reason not to stop.
fn stop_in(text: &str) -> Option<(Option<String>, Option<String>)> {
    const BEGINS: &str = "{\"type\":\"stop\"";
    if let Ok(ClientText::Stop { operator, reason }) = ClientText::parse(text) {
        return Some((operator, reason));
    }
    let is_stop = match serde_json::from_str::<Value>(text) {
        Ok(value) => value["type"] == "stop",
        Err(_) => {
            let start: String = text
                .chars()
                .filter(|part| !part.is_whitespace())
                .take(32)
                .collect();
            start.starts_with(BEGINS)
        }
    };
    is_stop.then(|| {
        let value: Value = serde_json::from_str(text).unwrap_or_default();
        let word = |name: &str| value[name].as_str().map(str::to_owned);
        (word("operator"), word("reason"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

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
