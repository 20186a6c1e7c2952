//! Ranges, checked at the one place where numbers come in.

use std::fmt::{self, Display};
use std::ops::RangeInclusive;

use serde::Deserialize;
use serde::de::{self, Deserializer, Unexpected, Visitor};

/// A field that does not hold what it should.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{pointer}: {detail}")]
pub struct FieldError {
    /// JSON pointer (RFC 6901) of the field; empty for the whole body.
    pub pointer: String,
    /// What came and what was wanted.
    pub detail: String,
}

impl FieldError {
    /// An error at `pointer`.
    pub fn new(pointer: impl Into<String>, detail: impl Into<String>) -> Self {
        Self {
            pointer: pointer.into(),
            detail: detail.into(),
        }
    }

    /// The same error, seen from the object that holds this one at `prefix`.
    #[must_use]
    pub fn under(mut self, prefix: &str) -> Self {
        self.pointer.insert_str(0, prefix);
        self
    }
}

/// What has ranges to keep to.
pub trait Validate {
    /// Checks every range.
    ///
    /// # Errors
    /// The first field that is out of its range or not finite, by its JSON pointer.
    fn validate(&self) -> Result<(), FieldError>;

    /// Checks every range of a part that stands at `prefix`.
    ///
    /// # Errors
    /// As [`validate`](Self::validate), with `prefix` in front of the pointer.
    fn validate_under(&self, prefix: &str) -> Result<(), FieldError> {
        self.validate().map_err(|error| error.under(prefix))
    }
}

/// Optional parts are checked where they are there.
impl<T: Validate> Validate for Option<T> {
    fn validate(&self) -> Result<(), FieldError> {
        self.as_ref().map_or(Ok(()), T::validate)
    }
}

/// A NaN lies in no range, so one comparison catches it too.
pub(crate) fn check(
    pointer: &str,
    value: f64,
    range: RangeInclusive<f64>,
) -> Result<(), FieldError> {
    if range.contains(&value) {
        return Ok(());
    }
    let (least, most) = range.into_inner();
    Err(FieldError::new(
        pointer,
        format!(
            "{} is not a number from {} to {}",
            readable(value),
            readable(least),
            readable(most)
        ),
    ))
}

/// Reads a field that is there. With serde's own `Option` a `null` would pass for a field left out; here it is an
/// error, except where `null` itself is a value.
pub(crate) fn present<'de, D, T>(deserializer: D) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    T::deserialize(deserializer).map(Some)
}

/// Reads a whole number within `range`.
pub(crate) fn whole_within<'de, D, T>(
    deserializer: D,
    range: RangeInclusive<T>,
) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: Copy + Display + PartialOrd + TryFrom<u64>,
{
    deserializer.deserialize_u64(WholeWithin { range })
}

struct WholeWithin<T> {
    range: RangeInclusive<T>,
}

impl<T> Visitor<'_> for WholeWithin<T>
where
    T: Copy + Display + PartialOrd + TryFrom<u64>,
{
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "a whole number from {} to {}",
            self.range.start(),
            self.range.end()
        )
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<T, E> {
        T::try_from(value)
            .ok()
            .filter(|value| self.range.contains(value))
            .ok_or_else(|| E::invalid_value(Unexpected::Unsigned(value), &self))
    }
}

/// A number as a person writes it: in powers of ten where it would be all zeros otherwise.
pub fn readable(value: f64) -> String {
    let is_plain = value.abs() <= 0.0 || (1e-6..1e10).contains(&value.abs());
    if is_plain || !value.is_finite() {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}
