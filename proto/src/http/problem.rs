//! Errors as every client sees them: RFC 9457 problem details.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{BodyError, FieldError};

/// An error as RFC 9457 writes it: the body of `application/problem+json`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    /// A URI reference that names the kind of problem, such as `/problems/field`. Stable: programs may match on it.
    #[serde(rename = "type")]
    pub kind: String,
    /// The kind of problem in a few words, the same each time.
    pub title: String,
    /// The HTTP status.
    #[schema(minimum = 400, maximum = 599)]
    pub status: u16,
    /// What happened this time.
    pub detail: String,
    /// JSON pointer of the field at fault, when it is a field's fault.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pointer: Option<String>,
}

impl Problem {
    /// Media type of problem details.
    pub const MEDIA_TYPE: &str = "application/problem+json";

    /// A problem of the kind `/problems/<word>`.
    pub fn new(
        word: &str,
        title: impl Into<String>,
        status: u16,
        detail: impl Into<String>,
    ) -> Self {
        Self {
            kind: format!("/problems/{word}"),
            title: title.into(),
            status,
            detail: detail.into(),
            pointer: None,
        }
    }
}

impl From<FieldError> for Problem {
    fn from(error: FieldError) -> Self {
        let problem = Self::new("field", "a field is not acceptable", 422, error.detail);
        Self {
            pointer: Some(error.pointer),
            ..problem
        }
    }
}

impl From<BodyError> for Problem {
    fn from(error: BodyError) -> Self {
        match error {
            BodyError::Syntax { .. } => {
                Self::new("syntax", "the body is not JSON", 400, error.to_string())
            }
            BodyError::Field(error) => error.into(),
        }
    }
}
