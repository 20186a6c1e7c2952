//! From bytes to a checked type, or to an error that says where.

use serde::Serialize;
use serde::de::{DeserializeOwned, DeserializeSeed as _};
use serde_json::Value;
use serde_json::error::Category;

use super::read::{Document, ReadError, Reader, segment};
use crate::validate::{FieldError, Validate};

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
/// When it is not JSON, when a field is unknown, missing, doubled or of another type, or when a value is out of its
/// range.
pub fn parse<T>(body: &[u8]) -> Result<T, BodyError>
where
    T: DeserializeOwned + Serialize + Validate,
{
    let document = document(body)?;
    require_object(&document)?;
    let value = T::deserialize(Reader(&document)).map_err(|ReadError(error)| error)?;
    // Serde also reads a struct from an array of its fields in order. The reader does not let it, but for what is
    // inside of an enumeration that is told apart by one of its fields. Nobody documents such a body, and a field added
    // later would change its meaning: wherever the value is an object, the body must have one.
    compare(
        &document,
        &serde_json::to_value(&value).map_err(syntax_error)?,
    )?;
    value.validate()?;
    Ok(value)
}

/// Every body is an object. What it is instead is told before its parts are looked at: of an array, serde would read
/// the fields in order.
fn require_object(document: &Value) -> Result<(), FieldError> {
    let came = match document {
        Value::Object(_) => return Ok(()),
        Value::Array(_) => "an array",
        Value::String(_) => "a text",
        Value::Number(_) => "a number",
        Value::Bool(_) => "a truth value",
        Value::Null => "null",
    };
    Err(FieldError::new(
        "",
        format!("{came} came, wanted an object"),
    ))
}

/// The document that a text holds, and nothing after it.
fn document(body: &[u8]) -> Result<Value, BodyError> {
    let mut text = serde_json::Deserializer::from_slice(body);
    let mut place = String::new();
    let read = Document(&mut place).deserialize(&mut text);
    let document = read.map_err(|error| match error.classify() {
        Category::Data => FieldError::new(place, without_position(&error)).into(),
        _ => syntax_error(error),
    })?;
    text.end().map_err(syntax_error)?;
    Ok(document)
}

fn syntax_error(error: serde_json::Error) -> BodyError {
    BodyError::Syntax {
        line: error.line(),
        column: error.column(),
        detail: without_position(&error),
    }
}

fn compare(got: &Value, want: &Value) -> Result<(), FieldError> {
    match (got, want) {
        (Value::Array(_), Value::Object(_)) => {
            Err(FieldError::new("", "an array came, wanted an object"))
        }
        (Value::Object(got), Value::Object(want)) => got.iter().try_for_each(|(key, got)| {
            let below = want.get(key).map_or(Ok(()), |want| compare(got, want));
            below.map_err(|error| error.under(&segment(key)))
        }),
        (Value::Array(got), Value::Array(want)) => {
            got.iter()
                .zip(want)
                .enumerate()
                .try_for_each(|(index, (got, want))| {
                    compare(got, want).map_err(|error| error.under(&format!("/{index}")))
                })
        }
        _ => Ok(()),
    }
}

/// `serde_json` ends its text with the position, which the error carries as fields.
fn without_position(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let position = format!(" at line {} column {}", error.line(), error.column());
    text.strip_suffix(&position).unwrap_or(&text).to_owned()
}
