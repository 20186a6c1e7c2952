//! Names of realms, nodes and sessions. They stand in key expressions, in URLs and in file names, hence the narrow
//! alphabet.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize, Serializer};
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::{PartialSchema, ToSchema};

/// Longest name, in characters.
const MAX_LENGTH: usize = 64;

/// Why a text is no name. Names have 1 to 64 characters of `a`–`z`, `0`–`9`, `_` and `-`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// The text is empty.
    #[error("name is empty, wanted 1 to 64 characters")]
    Empty,
    /// The text is too long.
    #[error("name has {got} bytes, wanted 1 to 64")]
    TooLong {
        /// Its length in bytes.
        got: usize,
    },
    /// A character outside of the alphabet.
    #[error("name has {got:?} at byte {at}, wanted a-z, 0-9, _ or -")]
    WrongCharacter {
        /// The character.
        got: char,
        /// The byte it starts at.
        at: usize,
    },
}

macro_rules! name {
    ($(#[$meta:meta])* $name:ident) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
        #[serde(try_from = "String")]
        pub struct $name(String);

        /// As it stands: a derived one would copy it first, and a tick writes it.
        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(&self.0)
            }
        }

        impl $name {
            /// Parses a name.
            ///
            /// # Errors
            /// When the text is empty, longer than 64 characters, or holds anything but `a`–`z`, `0`–`9`, `_` and `-`.
            pub fn new(name: impl Into<String>) -> Result<Self, NameError> {
                let name = name.into();
                check(&name)?;
                Ok(Self(name))
            }

            /// The name as text.
            #[must_use]
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(&self.0)
            }
        }

        impl FromStr for $name {
            type Err = NameError;

            fn from_str(name: &str) -> Result<Self, NameError> {
                Self::new(name)
            }
        }

        impl TryFrom<String> for $name {
            type Error = NameError;

            fn try_from(name: String) -> Result<Self, NameError> {
                Self::new(name)
            }
        }

        impl From<$name> for String {
            fn from(name: $name) -> Self {
                name.0
            }
        }

        impl AsRef<str> for $name {
            fn as_ref(&self) -> &str {
                &self.0
            }
        }

        impl PartialSchema for $name {
            fn schema() -> RefOr<Schema> {
                ObjectBuilder::new()
                    .schema_type(Type::String)
                    .pattern(Some("^[a-z0-9_-]{1,64}$"))
                    .into()
            }
        }

        impl ToSchema for $name {
            fn name() -> Cow<'static, str> {
                Cow::Borrowed(stringify!($name))
            }
        }
    };
}

name! {
    /// A session's name, unique in its realm.
    SessionId
}

name! {
    /// The name of a realm: of a set of servers that share sessions. One server alone is a realm.
    RealmName
}

name! {
    /// A server's name, unique in its realm.
    NodeName
}

fn check(name: &str) -> Result<(), NameError> {
    if name.is_empty() {
        return Err(NameError::Empty);
    }
    if MAX_LENGTH < name.len() {
        return Err(NameError::TooLong { got: name.len() });
    }
    for (at, got) in name.char_indices() {
        if !matches!(got, 'a'..='z' | '0'..='9' | '_' | '-') {
            return Err(NameError::WrongCharacter { got, at });
        }
    }
    Ok(())
}
