//! Which law couples the two sides, and on how many axes.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::{PartialSchema, ToSchema};

use crate::word::words;

/// Largest deadband: beyond half of a force nothing is felt as the same.
pub(crate) const MAX_DEADBAND: f64 = 0.5;

words! {
    /// The law that couples the handle and the tool.
    #[derive(Default, ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum Scheme: "scheme" {
        /// Each side integrates its own force and the last one received of the other side, `[KHMH03]` (21)–(22).
        ForceExchange = 0 "force_exchange",
        /// Position forward, force back: the classical baseline, unstable under delay.
        PositionForce = 1 "position_force",
        /// Wave variables, `[NS91]`.
        Wave = 2 "wave",
        /// Time-domain passivity, `[HR02]` and for two ports with delay `[RAP10]`.
        Tdpa = 3 "tdpa",
        /// The handle cuts its own copy of the clay; the server stays the authority.
        #[default]
        Replica = 4 "replica",
    }
}

impl Scheme {
    /// Whether the hand feels a copy of the clay that is kept on its side, once that has come.
    #[must_use]
    pub const fn keeps_a_copy(self) -> bool {
        matches!(self, Self::Replica)
    }
}

/// How many axes move: 2 are x and y, as in `[KHMH03]`, 3 adds z. An axis that does not move stays at its home.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "i64", into = "u8")]
pub enum Axes {
    /// Two axes.
    #[default]
    Two,
    /// Three axes.
    Three,
}

impl Axes {
    /// The number of axes, 2 or 3.
    #[must_use]
    pub const fn count(self) -> usize {
        match self {
            Self::Two => 2,
            Self::Three => 3,
        }
    }
}

/// A number of axes that is neither 2 nor 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{got} axes, wanted 2 or 3")]
pub struct AxesError {
    /// The number that came.
    pub got: i64,
}

impl TryFrom<i64> for Axes {
    type Error = AxesError;

    fn try_from(count: i64) -> Result<Self, AxesError> {
        match count {
            2 => Ok(Self::Two),
            3 => Ok(Self::Three),
            got => Err(AxesError { got }),
        }
    }
}

impl From<Axes> for u8 {
    fn from(axes: Axes) -> Self {
        match axes {
            Axes::Two => 2,
            Axes::Three => 3,
        }
    }
}

impl PartialSchema for Axes {
    fn schema() -> RefOr<Schema> {
        ObjectBuilder::new()
            .schema_type(Type::Integer)
            .enum_values(Some([2, 3]))
            .default(Some(2.into()))
            .into()
    }
}

impl ToSchema for Axes {
    fn name() -> Cow<'static, str> {
        Cow::Borrowed("Axes")
    }
}
