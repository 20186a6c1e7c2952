//! What was done to a session's clay, and what may be done about it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{FieldError, MAX_TOOLS, Session, SessionId, StorageReport, Validate};
use crate::word::words;

/// Beyond this number JSON readers may round.
const MOST_EXACT: u64 = (1 << 53) - 1;

/// The strokes of a session's present block.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct History {
    /// The strokes, oldest first, those that were undone too.
    pub strokes: Vec<StrokeReport>,
    /// The earliest moment at which the clay can be had, s: since the session began, while its loop ran.
    pub from_s: f64,
    /// The last moment that is on disk, s.
    pub to_s: f64,
}

/// A span of contact: from where a tool begins to remove clay until it has removed none for a quarter of a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StrokeReport {
    /// Its number in the session, from 1.
    pub number: u64,
    /// The tool, from 1.
    pub tool: u32,
    /// Who held it.
    pub operator: String,
    /// When it first removed clay, s.
    pub from_s: f64,
    /// When it last did, s.
    pub to_s: f64,
    /// What it removed then, m³.
    pub removed_volume_m3: f64,
    /// Whether it was undone.
    pub undone: bool,
}

/// Asks for clay without a stroke.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Undo {
    /// The tool whose last stroke is meant, from 1; that of any tool when left out.
    #[schema(nullable = false, minimum = 1, maximum = 8)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub tool: Option<u32>,
    /// Without the stroke of this number and all later ones, in place of the last one.
    #[schema(nullable = false, minimum = 1, maximum = 9007199254740991_u64)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub since: Option<u64>,
}

/// Asks for clay with the stroke again that was undone last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Redo {
    /// The tool whose stroke is meant, from 1; that of any tool when left out.
    #[schema(nullable = false, minimum = 1, maximum = 8)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub tool: Option<u32>,
}

/// Asks for another session with the same clay and settings.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Duplicate {
    /// Its name.
    pub id: SessionId,
}

/// A session in the list of all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum ListedSession {
    /// One that is there.
    Session(Box<Session>),
    /// One whose files are damaged. They are left as they are.
    Damaged(DamagedSession),
}

/// A session that cannot be gone on with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DamagedSession {
    /// Its name.
    pub id: SessionId,
    /// Always `damaged`.
    pub state: DamagedState,
    /// Its files, with what is wrong with them.
    pub storage: StorageReport,
}

words! {
    /// The state of a session whose files are damaged.
    #[derive(ToSchema)]
    #[schema(rename_all = "snake_case")]
    pub enum DamagedState: "state of a damaged session" {
        /// It cannot be gone on with.
        Damaged "damaged",
    }
}

impl ListedSession {
    /// Its name.
    #[must_use]
    pub const fn id(&self) -> &SessionId {
        match self {
            Self::Session(session) => &session.id,
            Self::Damaged(damaged) => &damaged.id,
        }
    }
}

impl Validate for Undo {
    fn validate(&self) -> Result<(), FieldError> {
        check_tool(self.tool)?;
        match self.since {
            Some(number) if !(1..=MOST_EXACT).contains(&number) => {
                let detail = format!("{number} is no stroke, they are numbered from 1");
                Err(FieldError::new("/since", detail))
            }
            Some(_) if self.tool.is_some() => Err(FieldError::new(
                "/since",
                "a stroke and all later ones are those of every tool: leave `tool` out",
            )),
            _ => Ok(()),
        }
    }
}

impl Validate for Redo {
    fn validate(&self) -> Result<(), FieldError> {
        check_tool(self.tool)
    }
}

impl Validate for Duplicate {
    fn validate(&self) -> Result<(), FieldError> {
        Ok(())
    }
}

fn check_tool(tool: Option<u32>) -> Result<(), FieldError> {
    match tool {
        Some(number) if !(1..=u32::from(MAX_TOOLS)).contains(&number) => Err(FieldError::new(
            "/tool",
            format!("{number} is no tool, they are numbered from 1 to {MAX_TOOLS}"),
        )),
        _ => Ok(()),
    }
}
