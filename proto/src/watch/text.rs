//! Text messages: JSON objects, told apart by their `type`.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::SessionId;
use crate::http::{
    BodyError, ClayReset, FieldError, Problem, Session, SessionPatch, Validate, parse,
};
use crate::word::words;

/// From the server to a watcher.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum ServerText {
    /// The first message on every socket.
    Hello {
        /// The protocol that the server speaks, [`PROTOCOL`](crate::PROTOCOL).
        protocol: u32,
        /// The session that the socket watches.
        session: SessionId,
        /// Version of the server.
        server_version: String,
    },
    /// The session as it is: after `hello`, whenever something was changed, and a few times a second.
    State {
        /// The session.
        session: Box<Session>,
    },
    /// Something happened.
    Event {
        /// How grave it is.
        level: Level,
        /// What happened, for people.
        text: String,
        /// When, since the session began, s.
        time_s: f64,
    },
    /// A message of the watcher's was not acceptable. Nothing of it was done.
    Problem {
        /// What was wrong with the message.
        problem: Problem,
    },
    /// Answers a `ping`.
    Pong {
        /// The ping's number.
        nonce: u32,
    },
}

words! {
    /// How grave an event is.
    #[derive(ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum Level: "level" {
        /// Good to know.
        Info "info",
        /// Something is not as it should be, and the session goes on.
        Warning "warning",
        /// The session does not go on.
        Error "error",
    }
}

/// From a watcher to the server.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "type", rename_all = "snake_case", try_from = "RawClientText")]
pub enum ClientText {
    /// Which binary messages the watcher wants; none before the first `subscribe`.
    Subscribe {
        /// Telemetry of every tool.
        telemetry: Switch,
        /// Bricks: a keyframe, then deltas.
        bricks: Switch,
    },
    /// As `PATCH /sessions/{id}`.
    Patch {
        /// The changes.
        session: Box<SessionPatch>,
    },
    /// As `POST /sessions/{id}/clay/reset`.
    Reset {
        /// The fresh block.
        clay: ClayReset,
    },
    /// Asks for a `pong`.
    Ping {
        /// Comes back with the pong.
        #[schema(maximum = 4294967295_u32)]
        nonce: u32,
    },
}

words! {
    /// Whether something is sent.
    #[derive(Default, ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum Switch: "switch" {
        /// It is sent.
        On "on",
        /// It is not.
        #[default]
        Off "off",
    }
}

impl ClientText {
    /// Parses a text message and checks every range in it.
    ///
    /// # Errors
    /// As [`parse`].
    pub fn parse(text: &str) -> Result<Self, BodyError> {
        parse(text.as_bytes())
    }
}

impl Validate for ClientText {
    fn validate(&self) -> Result<(), FieldError> {
        match self {
            Self::Patch { session } => session.validate_under("/session"),
            Self::Reset { clay } => clay.validate_under("/clay"),
            Self::Subscribe { .. } | Self::Ping { .. } => Ok(()),
        }
    }
}

/// A message as it is spelt, flat: an error then names the very field, which serde's own tagged enumerations cannot.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a message object")]
struct RawClientText {
    #[serde(rename = "type")]
    kind: RawKind,
    #[serde(default, deserialize_with = "crate::validate::present")]
    telemetry: Option<Switch>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    bricks: Option<Switch>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    session: Option<Box<SessionPatch>>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    clay: Option<ClayReset>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    nonce: Option<u32>,
}

words! {
    enum RawKind: "type of message" {
        Subscribe "subscribe",
        Patch "patch",
        Reset "reset",
        Ping "ping",
    }
}

impl TryFrom<RawClientText> for ClientText {
    type Error = &'static str;

    fn try_from(raw: RawClientText) -> Result<Self, Self::Error> {
        let RawClientText {
            kind,
            telemetry,
            bricks,
            session,
            clay,
            nonce,
        } = raw;
        match (kind, telemetry, bricks, session, clay, nonce) {
            (RawKind::Subscribe, Some(telemetry), Some(bricks), None, None, None) => {
                Ok(Self::Subscribe { telemetry, bricks })
            }
            (RawKind::Subscribe, ..) => {
                Err("a subscribe has telemetry and bricks, and nothing else")
            }
            (RawKind::Patch, None, None, Some(session), None, None) => Ok(Self::Patch { session }),
            (RawKind::Patch, ..) => Err("a patch has a session and nothing else"),
            (RawKind::Reset, None, None, None, Some(clay), None) => Ok(Self::Reset { clay }),
            (RawKind::Reset, ..) => Err("a reset has a clay and nothing else"),
            (RawKind::Ping, None, None, None, None, Some(nonce)) => Ok(Self::Ping { nonce }),
            (RawKind::Ping, ..) => Err("a ping has a nonce and nothing else"),
        }
    }
}
