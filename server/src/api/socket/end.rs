//! How a stream ends.

use axum::extract::ws::{CloseFrame, Utf8Bytes, close_code};
use tokio_tungstenite::tungstenite;

use super::MAX_INCOMING;
use crate::api::problem::{Failure, SYNTAX, TOO_LARGE};

/// Why a stream has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::api) enum End {
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
    pub(in crate::api) const fn word(self) -> &'static str {
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
    pub(in crate::api) const fn lost_the_thread(self) -> bool {
        matches!(self, Self::TooLong | Self::Protocol)
    }

    /// What was wrong with the watcher's last message, when that ends the stream.
    pub(in crate::api) fn problem(self) -> Option<Failure> {
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
    pub(in crate::api) fn close_frame(self) -> Option<CloseFrame> {
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

pub(in crate::api) fn end_of(error: axum::Error) -> End {
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
        assert!(reason.contains("ten") && super::super::SEND_TIMEOUT.as_secs() == 10);
    }
}
