//! Materials by name.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{Material, Preset};

/// Every material that has a name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Materials {
    /// One entry for each.
    pub materials: Vec<MaterialPreset>,
}

/// A material that has a name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialPreset {
    /// What requests call it.
    pub preset: Preset,
    /// What it is like, for people.
    pub says: String,
    /// Where its numbers come from, and which of them are estimates. The keys in brackets are those of docs/papers.md.
    pub source: String,
    /// Its numbers.
    pub material: Material,
}

impl Materials {
    /// All of them.
    #[must_use]
    pub fn all() -> Self {
        let entry = |preset: Preset| MaterialPreset {
            preset,
            says: preset.says().to_owned(),
            source: preset.source().to_owned(),
            material: preset.material(),
        };
        Self {
            materials: Preset::ALL.map(entry).into(),
        }
    }
}
