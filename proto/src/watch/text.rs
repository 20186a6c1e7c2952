//! Text messages: JSON objects, told apart by their `type`.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::http::{
    BodyError, ClayReset, FieldError, MAX_TOOLS, Problem, Session, SessionPatch, Validate,
    check_name, check_reason, parse,
};
use crate::join::{ClayDescription, Granted, LoopParameters, RefusalCode};
use crate::legible::check_length;
use crate::validate::check;
use crate::word::words;
use crate::{Axes, SessionId};

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
    /// Answers a `join`: from now on this socket is the handle's.
    Granted {
        /// Keys of the trailers, 64 bytes: that of the handle's frames, then that of the server's.
        #[serde(with = "hex::serde")]
        #[schema(value_type = String, min_length = 128, max_length = 128)]
        keys: [u8; 64],
        /// The lease, and how to run the loop under it, as a join over Zenoh is granted.
        #[schema(value_type = Object)]
        granted: Box<Granted>,
    },
    /// Answers a `join` that is not granted.
    Refused {
        /// Why, for programs.
        #[schema(value_type = String)]
        code: RefusalCode,
        /// Why, for people.
        reason: String,
        /// Who holds the tool, or for whom it is kept, where that is why.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        holder: Option<String>,
    },
    /// The lease of this socket has ended, for a reason of the server's.
    Farewell {
        /// Why, and by whom, for people.
        reason: String,
    },
    /// Answers a `leave`.
    Left {},
    /// Answers `parameters`.
    Parameters {
        /// How the loop is to be run now.
        #[schema(value_type = Object)]
        parameters: Box<LoopParameters>,
    },
    /// Answers `snapshot`: the next so many messages of bricks are the clay as it was at one moment.
    Snapshot {
        /// What the block is, but for its voxels.
        #[schema(value_type = Object)]
        clay: ClayDescription,
        /// How many messages of bricks follow.
        messages: u32,
    },
    /// Answers what was asked of a tool or of a stop: it is done.
    Done {},
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

/// What a hand in a browser holds, as it tells at a join.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct HandDevice {
    /// What it is, for people to read; 1 to 64 characters.
    #[schema(min_length = 1, max_length = 64, pattern = "^[^ ]+( [^ ]+)*$")]
    pub name: String,
    /// How many axes it moves in.
    pub axes: Axes,
    /// The greatest force that it can show the hand, N; 0 where it shows none.
    #[schema(minimum = 0, maximum = 1000)]
    pub force_n: f64,
    /// How often it is read, 1/s.
    #[schema(minimum = 1, maximum = 100000)]
    pub rate_hz: f64,
    /// Whether it measures the hand's force. Where it does not, the force is that of a coupling.
    pub measures_force: bool,
}

impl HandDevice {
    fn validate_under(&self, pointer: &str) -> Result<(), FieldError> {
        check_name(&format!("{pointer}/name"), &self.name)?;
        check(&format!("{pointer}/force_n"), self.force_n, 0.0..=1000.0)?;
        check(&format!("{pointer}/rate_hz"), self.rate_hz, 1.0..=1e5)
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
    /// Asks for a tool. A lease that this socket has ends first.
    Join {
        /// Who holds the handle, for people to read; 1 to 64 characters.
        #[schema(min_length = 1, max_length = 64, pattern = "^[^ ]+( [^ ]+)*$")]
        operator: String,
        /// What the handle is.
        device: HandDevice,
        /// The server's token or an invite's, where the one that the socket was opened with does not do.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(min_length = 1, max_length = 256, nullable = false)]
        token: Option<String>,
    },
    /// Gives the tool back.
    Leave {},
    /// Asks how the loop is to be run now.
    Parameters {},
    /// Asks for the clay, for the copy of it at the handle.
    Snapshot {
        /// The block that is wanted.
        #[schema(maximum = 4294967295_u32)]
        epoch: u32,
    },
    /// As `POST /sessions/{id}/tools/{tool}/request`.
    Request {
        /// The tool's number, from 1.
        #[schema(minimum = 1, maximum = 8)]
        tool: u32,
        /// Who wants it.
        #[schema(min_length = 1, max_length = 64, pattern = "^[^ ]+( [^ ]+)*$")]
        operator: String,
    },
    /// As `POST /sessions/{id}/tools/{tool}/withdraw`.
    Withdraw {
        /// The tool's number, from 1.
        #[schema(minimum = 1, maximum = 8)]
        tool: u32,
        /// Who had asked for it.
        #[schema(min_length = 1, max_length = 64, pattern = "^[^ ]+( [^ ]+)*$")]
        operator: String,
    },
    /// As `POST /sessions/{id}/tools/{tool}/grant`.
    Grant {
        /// The tool's number, from 1.
        #[schema(minimum = 1, maximum = 8)]
        tool: u32,
        /// Who has asked for it.
        #[schema(min_length = 1, max_length = 64, pattern = "^[^ ]+( [^ ]+)*$")]
        operator: String,
    },
    /// As `POST /sessions/{id}/tools/{tool}/deny`.
    Deny {
        /// The tool's number, from 1.
        #[schema(minimum = 1, maximum = 8)]
        tool: u32,
        /// Who has asked for it.
        #[schema(min_length = 1, max_length = 64, pattern = "^[^ ]+( [^ ]+)*$")]
        operator: String,
        /// Why not, for people.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(min_length = 1, max_length = 128, nullable = false)]
        reason: Option<String>,
    },
    /// As `POST /sessions/{id}/tools/{tool}/release`.
    Release {
        /// The tool's number, from 1.
        #[schema(minimum = 1, maximum = 8)]
        tool: u32,
    },
    /// As `POST /sessions/{id}/stop`.
    Stop {
        /// Who stops, for people; whoever holds a tool on this socket stops under that name.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(nullable = false)]
        operator: Option<String>,
        /// Why, for people. What is too long is cut off.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(nullable = false)]
        reason: Option<String>,
    },
    /// As `POST /sessions/{id}/stop/clear`.
    ClearStop {
        /// Who clears it, for people.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(
            min_length = 1,
            max_length = 64,
            pattern = "^[^ ]+( [^ ]+)*$",
            nullable = false
        )]
        operator: Option<String>,
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

/// Longest token, characters.
const MAX_TOKEN: usize = 256;

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
            Self::Join {
                operator,
                device,
                token,
            } => {
                check_name("/operator", operator)?;
                device.validate_under("/device")?;
                token
                    .as_ref()
                    .map_or(Ok(()), |token| check_length("/token", token, MAX_TOKEN))
            }
            Self::Request { tool, operator }
            | Self::Withdraw { tool, operator }
            | Self::Grant { tool, operator } => {
                check_tool(*tool)?;
                check_name("/operator", operator)
            }
            Self::Deny {
                tool,
                operator,
                reason,
            } => {
                check_tool(*tool)?;
                check_name("/operator", operator)?;
                reason
                    .as_ref()
                    .map_or(Ok(()), |reason| check_reason("/reason", reason))
            }
            Self::Release { tool } => check_tool(*tool),
            // A stop is never refused for its words: they are made to fit.
            Self::Stop { .. }
            | Self::Subscribe { .. }
            | Self::Ping { .. }
            | Self::Leave {}
            | Self::Parameters {}
            | Self::Snapshot { .. } => Ok(()),
            Self::ClearStop { operator } => operator
                .as_ref()
                .map_or(Ok(()), |operator| check_name("/operator", operator)),
        }
    }
}

fn check_tool(tool: u32) -> Result<(), FieldError> {
    if (1..=u32::from(MAX_TOOLS)).contains(&tool) {
        return Ok(());
    }
    Err(FieldError::new(
        "/tool",
        format!("{tool} is no tool, they are numbered from 1 to {MAX_TOOLS}"),
    ))
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
    #[serde(default, deserialize_with = "crate::validate::present")]
    operator: Option<String>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    device: Option<HandDevice>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    token: Option<String>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    epoch: Option<u32>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    tool: Option<u32>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    reason: Option<String>,
}

words! {
    enum RawKind: "type of message" {
        Subscribe "subscribe",
        Patch "patch",
        Reset "reset",
        Ping "ping",
        Join "join",
        Leave "leave",
        Parameters "parameters",
        Snapshot "snapshot",
        Request "request",
        Withdraw "withdraw",
        Grant "grant",
        Deny "deny",
        Release "release",
        Stop "stop",
        ClearStop "clear_stop",
    }
}

impl RawKind {
    /// The fields that a message of this kind must have, and those that it may have.
    const fn fields(self) -> (&'static [&'static str], &'static [&'static str]) {
        match self {
            Self::Subscribe => (&["telemetry", "bricks"], &[]),
            Self::Patch => (&["session"], &[]),
            Self::Reset => (&["clay"], &[]),
            Self::Ping => (&["nonce"], &[]),
            Self::Join => (&["operator", "device"], &["token"]),
            Self::Leave | Self::Parameters => (&[], &[]),
            Self::Snapshot => (&["epoch"], &[]),
            Self::Request | Self::Withdraw | Self::Grant => (&["tool", "operator"], &[]),
            Self::Deny => (&["tool", "operator"], &["reason"]),
            Self::Release => (&["tool"], &[]),
            Self::Stop => (&[], &["operator", "reason"]),
            Self::ClearStop => (&[], &["operator"]),
        }
    }

    /// What is wrong with a message of this kind.
    fn wanted(self) -> String {
        let (must, may) = self.fields();
        let must = match must {
            [] => "no field but its type".to_owned(),
            must => must.join(" and "),
        };
        match may {
            [] => format!("`{}` has {must}, and nothing else", self.word()),
            may => format!(
                "`{}` has {must}, may have {}, and nothing else",
                self.word(),
                may.join(" and ")
            ),
        }
    }
}

impl RawClientText {
    /// The names of the fields that are there.
    fn given(&self) -> impl Iterator<Item = &'static str> {
        [
            ("telemetry", self.telemetry.is_some()),
            ("bricks", self.bricks.is_some()),
            ("session", self.session.is_some()),
            ("clay", self.clay.is_some()),
            ("nonce", self.nonce.is_some()),
            ("operator", self.operator.is_some()),
            ("device", self.device.is_some()),
            ("token", self.token.is_some()),
            ("epoch", self.epoch.is_some()),
            ("tool", self.tool.is_some()),
            ("reason", self.reason.is_some()),
        ]
        .into_iter()
        .filter_map(|(name, is_there)| is_there.then_some(name))
    }

    fn has_its_fields(&self) -> bool {
        let (must, may) = self.kind.fields();
        let given: Vec<&str> = self.given().collect();
        must.iter().all(|name| given.contains(name))
            && given
                .iter()
                .all(|name| must.contains(name) || may.contains(name))
    }
}

impl TryFrom<RawClientText> for ClientText {
    type Error = String;

    fn try_from(raw: RawClientText) -> Result<Self, String> {
        let kind = raw.kind;
        if !raw.has_its_fields() {
            return Err(kind.wanted());
        }
        known(raw).ok_or_else(|| kind.wanted())
    }
}

/// The message; nothing where a field is missing that it must have.
fn known(raw: RawClientText) -> Option<ClientText> {
    Some(match raw.kind {
        RawKind::Subscribe => ClientText::Subscribe {
            telemetry: raw.telemetry?,
            bricks: raw.bricks?,
        },
        RawKind::Patch => ClientText::Patch {
            session: raw.session?,
        },
        RawKind::Reset => ClientText::Reset { clay: raw.clay? },
        RawKind::Ping => ClientText::Ping { nonce: raw.nonce? },
        RawKind::Join => ClientText::Join {
            operator: raw.operator?,
            device: raw.device?,
            token: raw.token,
        },
        RawKind::Leave => ClientText::Leave {},
        RawKind::Parameters => ClientText::Parameters {},
        RawKind::Snapshot => ClientText::Snapshot { epoch: raw.epoch? },
        RawKind::Request => ClientText::Request {
            tool: raw.tool?,
            operator: raw.operator?,
        },
        RawKind::Withdraw => ClientText::Withdraw {
            tool: raw.tool?,
            operator: raw.operator?,
        },
        RawKind::Grant => ClientText::Grant {
            tool: raw.tool?,
            operator: raw.operator?,
        },
        RawKind::Deny => ClientText::Deny {
            tool: raw.tool?,
            operator: raw.operator?,
            reason: raw.reason,
        },
        RawKind::Release => ClientText::Release { tool: raw.tool? },
        RawKind::Stop => ClientText::Stop {
            operator: raw.operator,
            reason: raw.reason,
        },
        RawKind::ClearStop => ClientText::ClearStop {
            operator: raw.operator,
        },
    })
}
