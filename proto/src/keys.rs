//! Key expressions: where each thing is found on Zenoh.
//!
//! | key | form | carries |
//! |---|---|---|
//! | `teleclay/<realm>/session/<id>/alive` | liveliness token | a server runs the session |
//! | `…/challenge` | query | [`ChallengeRequest`](crate::join::ChallengeRequest) |
//! | `…/join` | query | [`SealedJoin`](crate::join::SealedJoin) |
//! | `…/leave` | query | [`LeaseRequest`](crate::join::LeaseRequest) |
//! | `…/parameters` | query | answers with [`LoopParameters`](crate::join::LoopParameters) |
//! | `…/tool/<tool>/up` | publication | [`HandleFrame`](crate::frame::HandleFrame) |
//! | `…/tool/<tool>/down` | publication | [`ToolFrame`](crate::frame::ToolFrame) |
//! | `…/tool/<tool>/farewell` | publication | [`Farewell`](crate::join::Farewell) |
//! | `…/clay/bricks` | publication | bricks that changed, [`watch`](crate::watch) |
//! | `…/clay/snapshot` | query | answers with every brick, [`watch`](crate::watch) |
//! | `…/clay/fresh` | query | [`LeaseRequest`](crate::join::LeaseRequest) |
//! | `…/state` | publication, query | [`Session`](crate::http::Session) |
//! | `…/operator/<lease>` | liveliness token | an operator is there |
//!
//! A *realm* is a set of servers that share sessions; one server alone is a realm. A session is keyed by its name
//! within the realm and not by the server that runs it, so that it can change servers without changing keys.

use std::fmt;
use std::str::FromStr;

use crate::{NameError, RealmName, SessionId};

/// One key, fully named: `teleclay/<realm>/session/<id>/<leaf>`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Key {
    /// The realm and the session.
    pub session: SessionKeys,
    /// What stands below them.
    pub leaf: Leaf,
}

/// What stands below a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Leaf {
    /// Liveliness of the server that runs the session.
    Alive,
    /// Query that asks for a challenge.
    Challenge,
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
    /// The server's last word to the holder of a tool.
    ToolFarewell(u32),
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
    realm: RealmName,
    session: SessionId,
}

impl SessionKeys {
    /// The keys of `session` in `realm`.
    #[must_use]
    pub const fn new(realm: RealmName, session: SessionId) -> Self {
        Self { realm, session }
    }

    /// The realm.
    #[must_use]
    pub const fn realm(&self) -> &RealmName {
        &self.realm
    }

    /// The session.
    #[must_use]
    pub const fn session(&self) -> &SessionId {
        &self.session
    }

    /// The key expression of `leaf`.
    #[must_use]
    pub fn key(&self, leaf: Leaf) -> String {
        format!("{ROOT}/{}/session/{}/{leaf}", self.realm, self.session)
    }

    /// The key `…/alive` by which a session shows that it is served.
    #[must_use]
    pub fn alive(&self) -> String {
        self.key(Leaf::Alive)
    }

    /// The key `…/challenge`, where handles ask for a challenge.
    #[must_use]
    pub fn challenge(&self) -> String {
        self.key(Leaf::Challenge)
    }

    /// The key `…/join`, where handles ask for a lease.
    #[must_use]
    pub fn join(&self) -> String {
        self.key(Leaf::Join)
    }

    /// The key `…/leave`, where handles give a lease back.
    #[must_use]
    pub fn leave(&self) -> String {
        self.key(Leaf::Leave)
    }

    /// The key `…/parameters`, where handles ask how to run the loop.
    #[must_use]
    pub fn parameters(&self) -> String {
        self.key(Leaf::Parameters)
    }

    /// The key `…/tool/<tool>/up` of frames from the handle to the tool.
    #[must_use]
    pub fn tool_up(&self, tool: u32) -> String {
        self.key(Leaf::ToolUp(tool))
    }

    /// The key `…/tool/<tool>/down` of frames from the tool to the handle.
    #[must_use]
    pub fn tool_down(&self, tool: u32) -> String {
        self.key(Leaf::ToolDown(tool))
    }

    /// The key `…/tool/<tool>/farewell` of the server's last word to its holder.
    #[must_use]
    pub fn tool_farewell(&self, tool: u32) -> String {
        self.key(Leaf::ToolFarewell(tool))
    }

    /// The key `…/clay/bricks` of bricks that changed.
    #[must_use]
    pub fn clay_bricks(&self) -> String {
        self.key(Leaf::ClayBricks)
    }

    /// The key `…/clay/snapshot`, where the whole clay is asked for.
    #[must_use]
    pub fn clay_snapshot(&self) -> String {
        self.key(Leaf::ClaySnapshot)
    }

    /// The key `…/clay/fresh`, where operators ask for a fresh block.
    #[must_use]
    pub fn clay_fresh(&self) -> String {
        self.key(Leaf::ClayFresh)
    }

    /// The key `…/state` of a session's state.
    #[must_use]
    pub fn state(&self) -> String {
        self.key(Leaf::State)
    }

    /// The key `…/operator/<lease>`, alive as long as the operator's program is.
    #[must_use]
    pub fn operator(&self, lease: u32) -> String {
        self.key(Leaf::Operator(lease))
    }
}

/// What every key begins with.
const ROOT: &str = "teleclay";

/// `teleclay/<realm>/session/**`: everything of every session of a realm, for its queries.
#[must_use]
pub fn everything_in(realm: &RealmName) -> String {
    format!("{ROOT}/{realm}/session/**")
}

/// `teleclay/<realm>/session/*/tool/*/up`: the handle frames of every session of a realm.
#[must_use]
pub fn every_tool_up_in(realm: &RealmName) -> String {
    format!("{ROOT}/{realm}/session/*/tool/*/up")
}

/// `teleclay/<realm>/session/*/tool/*/down`: the tool frames of every session of a realm.
#[must_use]
pub fn every_tool_down_in(realm: &RealmName) -> String {
    format!("{ROOT}/{realm}/session/*/tool/*/down")
}

/// `teleclay/<realm>/session/*/tool/*/farewell`: last words to the holders of tools of every session of a realm.
#[must_use]
pub fn every_farewell_in(realm: &RealmName) -> String {
    format!("{ROOT}/{realm}/session/*/tool/*/farewell")
}

/// `teleclay/<realm>/session/*/operator/*`: whoever holds a tool of any session of a realm.
#[must_use]
pub fn every_operator_in(realm: &RealmName) -> String {
    format!("{ROOT}/{realm}/session/*/operator/*")
}

/// `teleclay/<realm>/session/*/<leaf>`: the same of every session of a realm.
#[must_use]
pub fn of_every_session_in(realm: &RealmName, leaf: Leaf) -> String {
    format!("{ROOT}/{realm}/session/*/{leaf}")
}

/// `teleclay/<realm>/session/*/alive`: selects the sessions of a realm that some server runs.
#[must_use]
pub fn every_session_alive_in(realm: &RealmName) -> String {
    of_every_session_in(realm, Leaf::Alive)
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
    /// The realm's or the session's part is no name.
    #[error("`{part}` in key `{got}`: {source}")]
    Name {
        /// The text.
        got: String,
        /// The part at fault.
        part: String,
        /// What the part breaks of the rules for names.
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
    /// What stands below the realm or the session is not known.
    #[error("key `{got}` names nothing that exists")]
    Unknown {
        /// The text.
        got: String,
    },
}

impl FromStr for Key {
    type Err = KeyError;

    fn from_str(key: &str) -> Result<Self, KeyError> {
        let name = |part: &str, source| KeyError::Name {
            got: key.to_owned(),
            part: part.to_owned(),
            source,
        };
        let parts: Vec<&str> = key.split('/').collect();
        match parts.as_slice() {
            [ROOT, realm, "session", session, leaf @ ..] => {
                let realm = RealmName::new(*realm).map_err(|why| name(realm, why))?;
                let session = SessionId::new(*session).map_err(|why| name(session, why))?;
                Ok(Self {
                    session: SessionKeys::new(realm, session),
                    leaf: parse_leaf(key, leaf)?,
                })
            }
            [ROOT, ..] => Err(KeyError::Unknown {
                got: key.to_owned(),
            }),
            _ => Err(KeyError::WrongRoot {
                got: key.to_owned(),
            }),
        }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.session.key(self.leaf))
    }
}

impl fmt::Display for Leaf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Alive => f.write_str("alive"),
            Self::Challenge => f.write_str("challenge"),
            Self::Join => f.write_str("join"),
            Self::Leave => f.write_str("leave"),
            Self::Parameters => f.write_str("parameters"),
            Self::ToolUp(tool) => write!(f, "tool/{tool}/up"),
            Self::ToolDown(tool) => write!(f, "tool/{tool}/down"),
            Self::ToolFarewell(tool) => write!(f, "tool/{tool}/farewell"),
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
        ["alive"] => Ok(Leaf::Alive),
        ["challenge"] => Ok(Leaf::Challenge),
        ["join"] => Ok(Leaf::Join),
        ["leave"] => Ok(Leaf::Leave),
        ["parameters"] => Ok(Leaf::Parameters),
        ["tool", tool, "up"] => Ok(Leaf::ToolUp(parse_number(key, tool)?)),
        ["tool", tool, "down"] => Ok(Leaf::ToolDown(parse_number(key, tool)?)),
        ["tool", tool, "farewell"] => Ok(Leaf::ToolFarewell(parse_number(key, tool)?)),
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
    fn selectors_match_the_keys_that_they_are_meant_for() {
        let realm = RealmName::new("lab-1").expect("a name");
        assert_eq!(everything_in(&realm), "teleclay/lab-1/session/**");
        assert_eq!(
            every_tool_up_in(&realm),
            "teleclay/lab-1/session/*/tool/*/up"
        );
        let keys = SessionKeys::new(realm, SessionId::new("demo").expect("a name"));
        assert_eq!(keys.tool_up(3), "teleclay/lab-1/session/demo/tool/3/up");
        assert_eq!(keys.alive(), "teleclay/lab-1/session/demo/alive");
    }

    #[test]
    fn errors_say_what_was_wrong() {
        let error = |key: &str| key.parse::<Key>().expect_err(key).to_string();
        assert_eq!(
            error("clay/x"),
            "key `clay/x` does not start with `teleclay/`"
        );
        assert_eq!(
            error("teleclay/Lab/session/demo/alive"),
            "`Lab` in key `teleclay/Lab/session/demo/alive`: name has 'L' at byte 0, wanted a-z, 0-9, _ or -"
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
