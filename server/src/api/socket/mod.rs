//! What every WebSocket of this server is held to, whatever is spoken on it.
//!
//! | part | does |
//! |---|---|
//! | [`budget`] | what a watcher may cost |
//! | [`heartbeat`] | whether it is still there |
//! | [`end`] | how a socket ends |

pub(super) mod budget;
pub(super) mod end;
pub(super) mod heartbeat;

use std::time::Duration;

use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{Message, WebSocket};
use axum::http::{HeaderValue, header};
use futures_util::stream::{self, SplitSink, SplitStream};
use futures_util::{SinkExt as _, StreamExt as _};
use tokio::time::timeout;

use self::end::End;
use super::problem::{Failure, HANDSHAKE, UPGRADE};

/// Longest text from a watcher, bytes. The longest that means something is a fresh stepped block.
pub(super) const MAX_INCOMING: usize = 16 * 1024;

/// A watcher that does not take a message within this is gone, or as good as gone.
const SEND_TIMEOUT: Duration = Duration::from_secs(10);

/// How long a watcher may take to answer a close.
pub(super) const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);

/// Read buffer of a socket: watchers say little.
pub(super) const READ_BUFFER: usize = 8 * 1024;

/// Above this the socket is written to; a message is flushed anyway.
pub(super) const WRITE_BUFFER: usize = 16 * 1024;

/// Where messages go.
pub(super) type Mouth = SplitSink<WebSocket, Message>;

/// Where they come from.
pub(super) type Source = SplitStream<WebSocket>;

/// Hands one message over to the connection, all of it.
pub(super) async fn hand_over(mouth: &mut Mouth, message: Message) -> Result<(), End> {
    match timeout(SEND_TIMEOUT, mouth.send(message)).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) => Err(End::Lost),
        Err(_) => Err(End::Slow),
    }
}

/// Hands messages over to the connection, all of them.
pub(super) async fn hand_over_all(mouth: &mut Mouth, messages: Vec<Message>) -> Result<(), End> {
    let mut messages = stream::iter(messages.into_iter().map(Ok));
    match timeout(SEND_TIMEOUT, mouth.send_all(&mut messages)).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) => Err(End::Lost),
        Err(_) => Err(End::Slow),
    }
}

/// Closes a socket and says why, where that can still be heard.
pub(super) async fn say_goodbye(mouth: &mut Mouth, ear: &mut Source, end: End) {
    let Some(close_frame) = end.close_frame() else {
        return;
    };
    let goodbye = async {
        let sent = mouth.send(Message::Close(Some(close_frame))).await;
        // Where frames still begin and end where they should, the answer to the close can be told. The rest is the
        // connection's to throw away, so that the reason is not lost with it.
        while sent.is_ok() && !end.lost_the_thread() && matches!(ear.next().await, Some(Ok(_))) {}
    };
    // Whoever does not answer has heard it, or never will.
    timeout(CLOSE_TIMEOUT, goodbye).await.ok();
}

/// What is said to a handshake that is none.
pub(super) fn refuse_handshake(rejection: &WebSocketUpgradeRejection) -> Failure {
    use WebSocketUpgradeRejection as Rejection;
    let detail = rejection.body_text();
    match rejection {
        Rejection::InvalidConnectionHeader(_)
        | Rejection::InvalidUpgradeHeader(_)
        | Rejection::ConnectionNotUpgradable(_) => UPGRADE
            .because(detail)
            .with_header(header::UPGRADE, HeaderValue::from_static("websocket")),
        _ => HANDSHAKE.because(detail),
    }
}
