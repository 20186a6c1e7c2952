//! Manners among operators: a stop, and who asks whom for a tool.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::legible::{self, check_text, fitted};
use crate::validate::{FieldError, Validate};

/// Longest name of an operator or of a device, in characters.
pub const MAX_NAME: usize = 64;

/// Longest reason, in characters. With a name and the words between them it fits into a
/// [`Farewell`](crate::join::Farewell).
pub const MAX_REASON: usize = 128;

/// A stop that holds: nobody has a tool, and nobody gets one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// Who stopped the session.
    pub by: String,
    /// Why, for people.
    pub reason: String,
}

impl Stop {
    /// A stop whose words fit, whatever came: nothing is a reason not to stop. What is too long is cut off, what cannot
    /// be seen becomes a blank, and where nothing is left, another text says so.
    #[must_use]
    pub fn fitting(by: &str, reason: &str) -> Self {
        Self {
            by: fitted(by, MAX_NAME, "somebody"),
            reason: fitted(reason, MAX_REASON, NO_REASON),
        }
    }
}

/// Body of the call that stops a session. All of it may be left out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StopRequest {
    /// Who stops, for people; 1 to 64 characters. Left out, it is whoever the token is known as.
    #[serde(
        default,
        deserialize_with = "crate::validate::present",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(
        min_length = 1,
        max_length = 64,
        pattern = "^[^ ]+( [^ ]+)*$",
        nullable = false
    )]
    pub operator: Option<String>,
    /// Why, for people; 1 to 128 characters.
    #[serde(default = "no_reason")]
    #[schema(min_length = 1, max_length = 128, default = "no reason given")]
    pub reason: String,
}

/// Body of the call that clears a stop. All of it may be left out.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StopClearing {
    /// Who clears it, for people; 1 to 64 characters. Left out, it is whoever the token is known as.
    #[serde(
        default,
        deserialize_with = "crate::validate::present",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(
        min_length = 1,
        max_length = 64,
        pattern = "^[^ ]+( [^ ]+)*$",
        nullable = false
    )]
    pub operator: Option<String>,
}

/// Body of the calls that ask for a tool, withdraw that, and grant it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ControlRequest {
    /// Who wants the tool; 1 to 64 characters.
    #[schema(min_length = 1, max_length = 64, pattern = "^[^ ]+( [^ ]+)*$")]
    pub operator: String,
}

/// Body of the call that denies a tool to whoever has asked for it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Denial {
    /// Who wanted the tool; 1 to 64 characters.
    #[schema(min_length = 1, max_length = 64, pattern = "^[^ ]+( [^ ]+)*$")]
    pub operator: String,
    /// Why not, for people; 1 to 128 characters.
    #[serde(default = "no_reason")]
    #[schema(min_length = 1, max_length = 128, default = "no reason given")]
    pub reason: String,
}

/// Checks the name of an operator or a device at `pointer`: 1 to 64 characters, each of which is seen, without blanks
/// at its ends or several in a row.
///
/// # Errors
/// It is none.
pub fn check_name(pointer: &str, name: &str) -> Result<(), FieldError> {
    legible::check_name(pointer, name, MAX_NAME)
}

/// Checks a reason at `pointer`: 1 to 128 characters, each of which is seen, and not of blanks alone.
///
/// # Errors
/// It is none.
pub fn check_reason(pointer: &str, reason: &str) -> Result<(), FieldError> {
    check_text(pointer, reason, MAX_REASON)
}

impl Validate for Stop {
    fn validate(&self) -> Result<(), FieldError> {
        check_name("/by", &self.by)?;
        check_reason("/reason", &self.reason)
    }
}

impl Validate for StopRequest {
    fn validate(&self) -> Result<(), FieldError> {
        check_operator(self.operator.as_ref())?;
        check_reason("/reason", &self.reason)
    }
}

impl Validate for StopClearing {
    fn validate(&self) -> Result<(), FieldError> {
        check_operator(self.operator.as_ref())
    }
}

fn check_operator(operator: Option<&String>) -> Result<(), FieldError> {
    operator.map_or(Ok(()), |operator| check_name("/operator", operator))
}

impl Validate for ControlRequest {
    fn validate(&self) -> Result<(), FieldError> {
        check_name("/operator", &self.operator)
    }
}

impl Validate for Denial {
    fn validate(&self) -> Result<(), FieldError> {
        check_name("/operator", &self.operator)?;
        check_reason("/reason", &self.reason)
    }
}

/// What stands for a reason that nobody gave.
pub const NO_REASON: &str = "no reason given";

fn no_reason() -> String {
    NO_REASON.to_owned()
}
