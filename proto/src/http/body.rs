//! From bytes to a checked type, or to an error that says where.

use serde::de::DeserializeOwned;
use serde_path_to_error::{Path, Segment};

use super::{FieldError, Validate};

/// Why a body was not accepted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BodyError {
    /// It is not JSON.
    #[error("line {line}, column {column}: {detail}")]
    Syntax {
        /// Line, from 1.
        line: usize,
        /// Column, from 1; 0 at the end of an empty body.
        column: usize,
        /// What is wrong there.
        detail: String,
    },
    /// It is JSON, but a field does not hold what it should.
    #[error(transparent)]
    Field(#[from] FieldError),
}

/// Parses a body and checks every range.
///
/// # Errors
/// When it is not JSON, when a field is unknown, missing, doubled or of another type, or when a value is out of its range.
pub fn parse<T: DeserializeOwned + Validate>(body: &[u8]) -> Result<T, BodyError> {
    let mut deserializer = serde_json::Deserializer::from_slice(body);
    let value: T = serde_path_to_error::deserialize(&mut deserializer)
        .map_err(|error| body_error(&pointer(error.path()), error.inner()))?;
    deserializer.end().map_err(|error| body_error("", &error))?;
    value.validate()?;
    Ok(value)
}

fn body_error(pointer: &str, error: &serde_json::Error) -> BodyError {
    let detail = without_position(error);
    if error.is_data() {
        return FieldError::new(pointer, detail).into();
    }
    BodyError::Syntax {
        line: error.line(),
        column: error.column(),
        detail,
    }
}

/// `serde_json` ends its text with the position, which the error carries as fields.
fn without_position(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let position = format!(" at line {} column {}", error.line(), error.column());
    text.strip_suffix(&position).unwrap_or(&text).to_owned()
}

fn pointer(path: &Path) -> String {
    let mut pointer = String::new();
    for segment in path {
        match segment {
            Segment::Seq { index } => pointer.push_str(&format!("/{index}")),
            Segment::Map { key } => {
                pointer.push('/');
                pointer.push_str(&key.replace('~', "~0").replace('/', "~1"));
            }
            // A tagged enumeration adds no level to the document, and an unknown one cannot be named.
            Segment::Enum { .. } | Segment::Unknown => {}
        }
    }
    pointer
}
