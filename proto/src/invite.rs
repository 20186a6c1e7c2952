//! Invites: a secret, what whoever shows it may do, and where to go with it.
//!
//! | part | form |
//! |---|---|
//! | a token | `<number>.<secret>`, 8 and 32 hexadecimal digits |
//! | a line for a handle | `teleclay:<endpoint>,<realm>,<session>,<fingerprint or ->,<token>` |

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::word::words;
use crate::{NameError, RealmName, SessionId};

/// What a line for a handle begins with.
const LINE: &str = "teleclay:";
/// Stands for a fingerprint where there is none.
const NONE: &str = "-";
/// Longer lines are none.
const LONGEST_LINE: usize = 1024;

words! {
    /// What somebody may do; each role may do what the one before it may.
    #[derive(PartialOrd, Ord, ToSchema)]
    #[schema(rename_all = "snake_case")]
    pub enum Role: "role" {
        /// Reads and watches.
        Spectator "spectator",
        /// Holds a tool, too.
        Operator "operator",
        /// Changes sessions, too.
        Admin "admin",
    }
}

/// Tells invites apart. It is no secret.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct InviteId(u32);

impl InviteId {
    /// From its number.
    #[must_use]
    pub const fn new(number: u32) -> Self {
        Self(number)
    }
}

impl fmt::Display for InviteId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:08x}", self.0)
    }
}

impl FromStr for InviteId {
    type Err = InviteError;

    fn from_str(text: &str) -> Result<Self, InviteError> {
        let digits = digits(text, 8).ok_or(InviteError::Number)?;
        u32::from_str_radix(digits, 16)
            .map(Self)
            .map_err(|_| InviteError::Number)
    }
}

impl TryFrom<String> for InviteId {
    type Error = InviteError;

    fn try_from(text: String) -> Result<Self, InviteError> {
        text.parse()
    }
}

impl From<InviteId> for String {
    fn from(id: InviteId) -> Self {
        id.to_string()
    }
}

/// What whoever was invited shows. Shown as a text, and never in a log: its `Debug` keeps the secret.
#[derive(Clone, PartialEq, Eq)]
pub struct InviteToken {
    id: InviteId,
    secret: [u8; 16],
}

impl InviteToken {
    /// From its parts; the secret is to be drawn at random.
    #[must_use]
    pub const fn new(id: InviteId, secret: [u8; 16]) -> Self {
        Self { id, secret }
    }

    /// Which invite it belongs to.
    #[must_use]
    pub const fn id(&self) -> InviteId {
        self.id
    }
}

impl fmt::Display for InviteToken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.id, hex::encode(self.secret))
    }
}

impl fmt::Debug for InviteToken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "InviteToken({})", self.id)
    }
}

impl FromStr for InviteToken {
    type Err = InviteError;

    fn from_str(text: &str) -> Result<Self, InviteError> {
        let (id, secret) = text.split_once('.').ok_or(InviteError::Token)?;
        let digits = digits(secret, 32).ok_or(InviteError::Token)?;
        let mut secret = [0; 16];
        hex::decode_to_slice(digits, &mut secret).map_err(|_| InviteError::Token)?;
        Ok(Self::new(id.parse()?, secret))
    }
}

/// SHA-256 of a certificate as it crosses (DER): what a handle knows its server by, whatever else says that it is.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Fingerprint([u8; 32]);

impl Fingerprint {
    /// From its bytes.
    #[must_use]
    pub const fn new(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// Its bytes.
    #[must_use]
    pub const fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&hex::encode(self.0))
    }
}

impl fmt::Debug for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Fingerprint({self})")
    }
}

impl FromStr for Fingerprint {
    type Err = InviteError;

    /// Colons between the bytes, as other programs print them, are read over.
    fn from_str(text: &str) -> Result<Self, InviteError> {
        let text = text.replace(':', "").to_ascii_lowercase();
        let mut bytes = [0; 32];
        hex::decode_to_slice(&text, &mut bytes).map_err(|_| InviteError::Fingerprint)?;
        Ok(Self(bytes))
    }
}

/// Everything that a handle needs to join a session that it was invited to, on one line without spaces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InviteLine {
    /// Zenoh endpoint, such as `quic/192.0.2.7:7547`. Whether it is one is for whoever connects to say.
    pub endpoint: String,
    /// The realm of the session.
    pub realm: RealmName,
    /// The session.
    pub session: SessionId,
    /// What the server's certificate is known by; nothing where the endpoint has none.
    pub fingerprint: Option<Fingerprint>,
    /// What to show.
    pub token: InviteToken,
}

impl fmt::Display for InviteLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{LINE}{},{},{},",
            self.endpoint, self.realm, self.session
        )?;
        match self.fingerprint {
            Some(fingerprint) => write!(f, "{fingerprint}")?,
            None => f.write_str(NONE)?,
        }
        write!(f, ",{}", self.token)
    }
}

impl FromStr for InviteLine {
    type Err = InviteError;

    fn from_str(line: &str) -> Result<Self, InviteError> {
        if LONGEST_LINE < line.len() {
            return Err(InviteError::Line);
        }
        let line = line.trim().strip_prefix(LINE).ok_or(InviteError::Line)?;
        let mut parts = line.split(',');
        let mut part = || parts.next().ok_or(InviteError::Line);
        let read = Self {
            endpoint: part()?.to_owned(),
            realm: RealmName::new(part()?)?,
            session: SessionId::new(part()?)?,
            fingerprint: match part()? {
                NONE => None,
                text => Some(text.parse()?),
            },
            token: part()?.parse()?,
        };
        match parts.next() {
            None if !read.endpoint.is_empty() => Ok(read),
            _ => Err(InviteError::Line),
        }
    }
}

/// Why a text is no part of an invite. The text itself is not repeated: it may hold a secret.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InviteError {
    /// The whole line.
    #[error(
        "an invite is one line, teleclay:ENDPOINT,REALM,SESSION,FINGERPRINT,TOKEN, as teleclay-server invite prints it"
    )]
    Line,
    /// The name of the realm or of the session.
    #[error("the invite's realm or session: {0}")]
    Name(#[from] NameError),
    /// The fingerprint.
    #[error("a fingerprint has 64 hexadecimal digits")]
    Fingerprint,
    /// The number of the invite.
    #[error("an invite's number has 8 hexadecimal digits")]
    Number,
    /// The token.
    #[error("an invite's token has 8 hexadecimal digits, a point and 32 more")]
    Token,
}

/// `text` if it is so many hexadecimal digits in lower case, so that each token is written in one way.
fn digits(text: &str, length: usize) -> Option<&str> {
    let is_digit = |byte: u8| matches!(byte, b'0'..=b'9' | b'a'..=b'f');
    (text.len() == length && text.bytes().all(is_digit)).then_some(text)
}
