//! Recordings of a session.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::legible::check_text;
use crate::names::SessionId;
use crate::validate::{FieldError, Validate};

/// Topics that a recording may be asked for by name.
pub const MAX_TOPICS: usize = 64;

/// Longest name of a topic, in characters.
const MAX_TOPIC: usize = 256;

/// Ticks a second, and so messages of a topic at most.
pub const MAX_RATE_HZ: f64 = 1000.0;

/// Body of the call that begins a recording. All of it may be left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewRecording {
    /// Its name among the session's recordings. Left out, it is the time.
    #[serde(
        default,
        deserialize_with = "crate::validate::present",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(value_type = String, min_length = 1, max_length = 64, pattern = "^[a-z0-9_-]{1,64}$", nullable = false)]
    pub name: Option<SessionId>,
    /// How often motion and force are written, Hz: that of the loop over a whole number, as near as there is one. Left
    /// out, it is every tick.
    #[serde(
        default,
        deserialize_with = "crate::validate::present",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(exclusive_minimum = 0.0, maximum = 1000.0, nullable = false)]
    pub rate_hz: Option<f64>,
    /// Which topics of motion, force and link are written, by whole or last name. Left out, it is all of them. What a
    /// replay needs is written whatever stands here.
    #[serde(
        default,
        deserialize_with = "crate::validate::present",
        skip_serializing_if = "Option::is_none"
    )]
    #[schema(max_items = 64, nullable = false)]
    pub topics: Option<Vec<String>>,
}

impl Validate for NewRecording {
    fn validate(&self) -> Result<(), FieldError> {
        if let Some(rate_hz) = self.rate_hz
            && !(0.0 < rate_hz && rate_hz <= MAX_RATE_HZ)
        {
            let detail = format!("{rate_hz} is not above 0 and up to {MAX_RATE_HZ} Hz");
            return Err(FieldError::new("/rate_hz", detail));
        }
        let Some(topics) = &self.topics else {
            return Ok(());
        };
        if MAX_TOPICS < topics.len() {
            let detail = format!("{} topics, at most {MAX_TOPICS} can be named", topics.len());
            return Err(FieldError::new("/topics", detail));
        }
        for (index, topic) in topics.iter().enumerate() {
            check_text(&format!("/topics/{index}"), topic, MAX_TOPIC)?;
        }
        Ok(())
    }
}

/// What a recording does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordingState {
    /// It goes on.
    Recording,
    /// It has ended, and its file is whole.
    Ended,
    /// Its server ended before it did: its file has all but the last second.
    Interrupted,
    /// It could not go on, for its reason. Its file has what came before.
    Failed,
}

/// A recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Recording {
    /// Its name.
    #[schema(value_type = String)]
    pub id: SessionId,
    /// What it does.
    pub state: RecordingState,
    /// Why it has ended, if it has.
    pub reason: Option<String>,
    /// Bytes of its file.
    pub bytes: u64,
    /// Ticks that are written.
    pub ticks: u64,
    /// Ticks that found no room on their way to the file.
    pub dropped: u64,
    /// Whether its file goes when the server ends, which is so where the server keeps nothing.
    pub is_temporary: bool,
}
