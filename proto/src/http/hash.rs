//! The hash that says whether two blocks of clay are the same.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::{PartialSchema, ToSchema};

/// Hash of a whole block: equal hashes mean equal clay. 16 hexadecimal digits in JSON, which cannot hold 64 bits as a
/// number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ClayHash(pub u64);

/// A text that is not 16 lower-case hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{got}` is not 16 lower-case hexadecimal digits")]
pub struct ClayHashError {
    /// The text.
    pub got: String,
}

impl fmt::Display for ClayHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

impl FromStr for ClayHash {
    type Err = ClayHashError;

    fn from_str(text: &str) -> Result<Self, ClayHashError> {
        let digits = text
            .bytes()
            .all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        match u64::from_str_radix(text, 16) {
            Ok(hash) if digits && text.len() == 16 => Ok(Self(hash)),
            _ => Err(ClayHashError {
                got: text.to_owned(),
            }),
        }
    }
}

impl TryFrom<String> for ClayHash {
    type Error = ClayHashError;

    fn try_from(text: String) -> Result<Self, ClayHashError> {
        text.parse()
    }
}

impl From<ClayHash> for String {
    fn from(hash: ClayHash) -> Self {
        hash.to_string()
    }
}

impl PartialSchema for ClayHash {
    fn schema() -> RefOr<Schema> {
        ObjectBuilder::new()
            .schema_type(Type::String)
            .pattern(Some("^[0-9a-f]{16}$"))
            .into()
    }
}

impl ToSchema for ClayHash {
    fn name() -> Cow<'static, str> {
        Cow::Borrowed("ClayHash")
    }
}
