//! Key expressions: where each thing is found on Zenoh.
//!
//! | key | form | carries |
//! |---|---|---|
//! | `teleclay/<node>/alive` | liveliness token | a server is there |
//! | `teleclay/<node>/session/<id>/join` | query | [`JoinRequest`](crate::join::JoinRequest) |
//! | `…/leave` | query | [`LeaveRequest`](crate::join::LeaveRequest) |
//! | `…/parameters` | query | answers with [`LoopParameters`](crate::join::LoopParameters) |
//! | `…/tool/<tool>/up` | publication | [`HandleFrame`](crate::frame::HandleFrame) |
//! | `…/tool/<tool>/down` | publication | [`ToolFrame`](crate::frame::ToolFrame) |
//! | `…/clay/bricks` | publication | bricks that changed, [`watch`](crate::watch) |
//! | `…/clay/snapshot` | query | answers with every brick, [`watch`](crate::watch) |
//! | `…/clay/fresh` | query | [`FreshRequest`](crate::join::FreshRequest) |
//! | `…/state` | publication, query | [`Session`](crate::http::Session) |
//! | `…/operator/<lease>` | liveliness token | an operator is there |

use std::fmt;
use std::str::FromStr;

use crate::{NameError, NodeName, SessionId};

/// Selects the liveliness tokens of every server.
pub const EVERY_NODE_ALIVE: &str = "teleclay/*/alive";

/// One key, fully named.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Key {
    /// `teleclay/<node>/alive`
    Alive(NodeName),
    /// `teleclay/<node>/session/<id>/…`
    Session(SessionKeys, Leaf),
}

/// What stands below a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Leaf {
    /// Query that asks for a lease.
    Join,
    /// Query that gives a lease back.
    Leave,
    /// Query for the loop's parameters.
    Parameters,
    /// Handle frames of a tool.
    ToolUp(u32),
    /// Tool frames of a tool.
    ToolDown(u32),
    /// Bricks as they change.
    ClayBricks,
    /// Query for every brick.
    ClaySnapshot,
    /// Query that asks for a fresh block.
    ClayFresh,
    /// The session as slow JSON.
    State,
    /// Liveliness of the operator who holds a lease.
    Operator(u32),
}

/// The keys of one session.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct SessionKeys {
    node: NodeName,
    session: SessionId,
}

impl SessionKeys {
    /// The keys of `session` on `node`.
    #[must_use]
    pub const fn new(node: NodeName, session: SessionId) -> Self {
        Self { node, session }
    }

    /// The server.
    #[must_use]
    pub const fn node(&self) -> &NodeName {
        &self.node
    }

    /// The session.
    #[must_use]
    pub const fn session(&self) -> &SessionId {
        &self.session
    }

    /// The key expression of `leaf`.
    #[must_use]
    pub fn key(&self, leaf: Leaf) -> String {
        format!("teleclay/{}/session/{}/{leaf}", self.node, self.session)
    }

    /// `…/join`
    #[must_use]
    pub fn join(&self) -> String {
        self.key(Leaf::Join)
    }

    /// `…/leave`
    #[must_use]
    pub fn leave(&self) -> String {
        self.key(Leaf::Leave)
    }

    /// `…/parameters`
    #[must_use]
    pub fn parameters(&self) -> String {
        self.key(Leaf::Parameters)
    }

    /// `…/tool/<tool>/up`
    #[must_use]
    pub fn tool_up(&self, tool: u32) -> String {
        self.key(Leaf::ToolUp(tool))
    }

    /// `…/tool/<tool>/down`
    #[must_use]
    pub fn tool_down(&self, tool: u32) -> String {
        self.key(Leaf::ToolDown(tool))
    }

    /// `…/clay/bricks`
    #[must_use]
    pub fn clay_bricks(&self) -> String {
        self.key(Leaf::ClayBricks)
    }

    /// `…/clay/snapshot`
    #[must_use]
    pub fn clay_snapshot(&self) -> String {
        self.key(Leaf::ClaySnapshot)
    }

    /// `…/clay/fresh`
    #[must_use]
    pub fn clay_fresh(&self) -> String {
        self.key(Leaf::ClayFresh)
    }

    /// `…/state`
    #[must_use]
    pub fn state(&self) -> String {
        self.key(Leaf::State)
    }

    /// `…/operator/<lease>`
    #[must_use]
    pub fn operator(&self, lease: u32) -> String {
        self.key(Leaf::Operator(lease))
    }

    /// `…/tool/*/up`: the handle frames of every tool.
    #[must_use]
    pub fn every_tool_up(&self) -> String {
        format!("teleclay/{}/session/{}/tool/*/up", self.node, self.session)
    }

    /// `…/operator/*`: the liveliness of every operator.
    #[must_use]
    pub fn every_operator(&self) -> String {
        format!("teleclay/{}/session/{}/operator/*", self.node, self.session)
    }
}

/// `teleclay/*/session/<id>/join`: asks whichever server has the session. The answer's key names the server.
#[must_use]
pub fn join_on_any_node(session: &SessionId) -> String {
    format!("teleclay/*/session/{session}/join")
}

/// `teleclay/<node>/session/**`: everything of every session of a server, for its queries.
#[must_use]
pub fn everything_on(node: &NodeName) -> String {
    format!("teleclay/{node}/session/**")
}

/// `teleclay/<node>/session/*/tool/*/up`: the handle frames of every session of a server.
#[must_use]
pub fn every_tool_up_on(node: &NodeName) -> String {
    format!("teleclay/{node}/session/*/tool/*/up")
}

/// `teleclay/<node>/alive`
#[must_use]
pub fn alive(node: &NodeName) -> String {
    format!("teleclay/{node}/alive")
}

/// Why a text is no key of teleclay's.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KeyError {
    /// It does not start with `teleclay/`.
    #[error("key `{got}` does not start with `teleclay/`")]
    WrongRoot {
        /// The text.
        got: String,
    },
    /// The node's or the session's part is no name.
    #[error("`{part}` in key `{got}`: {source}")]
    Name {
        /// The text.
        got: String,
        /// The part at fault.
        part: String,
        /// Why.
        source: NameError,
    },
    /// The number of a tool or of a lease is no number, or is written in another way than its shortest.
    #[error("`{part}` in key `{got}` is not a number from 0 to 4294967295 in its shortest form")]
    Number {
        /// The text.
        got: String,
        /// The part at fault.
        part: String,
    },
    /// What stands below the node or the session is not known.
    #[error("key `{got}` names nothing that exists")]
    Unknown {
        /// The text.
        got: String,
    },
}

impl FromStr for Key {
    type Err = KeyError;

    fn from_str(key: &str) -> Result<Self, KeyError> {
        let Some(rest) = key.strip_prefix("teleclay/") else {
            return Err(KeyError::WrongRoot {
                got: key.to_owned(),
            });
        };
        let name = |part: &str, source| KeyError::Name {
            got: key.to_owned(),
            part: part.to_owned(),
            source,
        };
        let parts: Vec<&str> = rest.split('/').collect();
        let (node, below) = match parts.as_slice() {
            [node, below @ ..] => (NodeName::new(*node).map_err(|why| name(node, why))?, below),
            [] => {
                return Err(KeyError::Unknown {
                    got: key.to_owned(),
                });
            }
        };
        match below {
            ["alive"] => Ok(Self::Alive(node)),
            ["session", session, leaf @ ..] => {
                let session = SessionId::new(*session).map_err(|why| name(session, why))?;
                Ok(Self::Session(
                    SessionKeys::new(node, session),
                    parse_leaf(key, leaf)?,
                ))
            }
            _ => Err(KeyError::Unknown {
                got: key.to_owned(),
            }),
        }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Alive(node) => f.write_str(&alive(node)),
            Self::Session(keys, leaf) => f.write_str(&keys.key(*leaf)),
        }
    }
}

impl fmt::Display for Leaf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Join => f.write_str("join"),
            Self::Leave => f.write_str("leave"),
            Self::Parameters => f.write_str("parameters"),
            Self::ToolUp(tool) => write!(f, "tool/{tool}/up"),
            Self::ToolDown(tool) => write!(f, "tool/{tool}/down"),
            Self::ClayBricks => f.write_str("clay/bricks"),
            Self::ClaySnapshot => f.write_str("clay/snapshot"),
            Self::ClayFresh => f.write_str("clay/fresh"),
            Self::State => f.write_str("state"),
            Self::Operator(lease) => write!(f, "operator/{lease}"),
        }
    }
}

fn parse_leaf(key: &str, parts: &[&str]) -> Result<Leaf, KeyError> {
    match parts {
        ["join"] => Ok(Leaf::Join),
        ["leave"] => Ok(Leaf::Leave),
        ["parameters"] => Ok(Leaf::Parameters),
        ["tool", tool, "up"] => Ok(Leaf::ToolUp(parse_number(key, tool)?)),
        ["tool", tool, "down"] => Ok(Leaf::ToolDown(parse_number(key, tool)?)),
        ["clay", "bricks"] => Ok(Leaf::ClayBricks),
        ["clay", "snapshot"] => Ok(Leaf::ClaySnapshot),
        ["clay", "fresh"] => Ok(Leaf::ClayFresh),
        ["state"] => Ok(Leaf::State),
        ["operator", lease] => Ok(Leaf::Operator(parse_number(key, lease)?)),
        _ => Err(KeyError::Unknown {
            got: key.to_owned(),
        }),
    }
}

/// One number has one spelling: `7`, never `07` or `+7`, because two keys that differ are two resources to Zenoh.
fn parse_number(key: &str, part: &str) -> Result<u32, KeyError> {
    match part.parse::<u32>() {
        Ok(number) if number.to_string() == part => Ok(number),
        _ => Err(KeyError::Number {
            got: key.to_owned(),
            part: part.to_owned(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selectors_are_spelt_as_zenoh_wants_them() {
        let node = NodeName::new("lab-1").expect("a name");
        let session = SessionId::new("demo").expect("a name");
        assert_eq!(join_on_any_node(&session), "teleclay/*/session/demo/join");
        assert_eq!(everything_on(&node), "teleclay/lab-1/session/**");
        assert_eq!(
            every_tool_up_on(&node),
            "teleclay/lab-1/session/*/tool/*/up"
        );
        let keys = SessionKeys::new(node, session);
        assert_eq!(
            keys.every_tool_up(),
            "teleclay/lab-1/session/demo/tool/*/up"
        );
        assert_eq!(
            keys.every_operator(),
            "teleclay/lab-1/session/demo/operator/*"
        );
    }

    #[test]
    fn errors_say_what_was_wrong() {
        let error = |key: &str| key.parse::<Key>().expect_err(key).to_string();
        assert_eq!(
            error("clay/x"),
            "key `clay/x` does not start with `teleclay/`"
        );
        assert_eq!(
            error("teleclay/Lab/alive"),
            "`Lab` in key `teleclay/Lab/alive`: name has 'L' at byte 0, wanted a-z, 0-9, _ or -"
        );
        assert_eq!(
            error("teleclay/a/session/b/tool/07/up"),
            "`07` in key `teleclay/a/session/b/tool/07/up` is not a number from 0 to 4294967295 in its shortest form"
        );
        assert_eq!(
            error("teleclay/a/session/b/clay"),
            "key `teleclay/a/session/b/clay` names nothing that exists"
        );
    }
}
