//! The tool's shape, as it is told to handles and watchers.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::validate::{FieldError, Validate, check};
use crate::word::words;

/// Radius of a ball.
const RADIUS_M: RangeInclusive<f64> = 1e-4..=0.1;
/// Side of a blade.
const SIDE_M: RangeInclusive<f64> = 1e-4..=0.5;

/// The shape of a tool. In JSON `{"kind": "ball", "radius_m": 0.0064}`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", try_from = "RawTool")]
pub enum ToolDescription {
    /// A ball; its position is its centre.
    Ball {
        /// Radius, m.
        #[schema(minimum = 1e-4, maximum = 0.1)]
        radius_m: f64,
    },
    /// A flat blade; its position is the centre of its lower edge.
    Blade {
        /// Width along y, m.
        #[schema(minimum = 1e-4, maximum = 0.5)]
        width_m: f64,
        /// Height along z, m.
        #[schema(minimum = 1e-4, maximum = 0.5)]
        height_m: f64,
        /// Thickness along x, m.
        #[schema(minimum = 1e-4, maximum = 0.5)]
        thickness_m: f64,
    },
}

impl Default for ToolDescription {
    /// The blade of the cutting experiment, 10 mm wide, 40 mm tall and 2 mm thick.
    fn default() -> Self {
        Self::Blade {
            width_m: 0.010,
            height_m: 0.040,
            thickness_m: 0.002,
        }
    }
}

impl Validate for ToolDescription {
    /// # Errors
    /// A radius outside of 0.1 mm to 0.1 m; a blade with a side outside of 0.1 mm to 0.5 m.
    fn validate(&self) -> Result<(), FieldError> {
        match *self {
            Self::Ball { radius_m } => check("/radius_m", radius_m, RADIUS_M),
            Self::Blade {
                width_m,
                height_m,
                thickness_m,
            } => {
                check("/width_m", width_m, SIDE_M)?;
                check("/height_m", height_m, SIDE_M)?;
                check("/thickness_m", thickness_m, SIDE_M)
            }
        }
    }
}

/// A tool as it is spelt, flat: an error then names the very field, which serde's own tagged enumerations cannot.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object that describes a tool")]
struct RawTool {
    kind: RawKind,
    #[serde(default, deserialize_with = "crate::validate::present")]
    radius_m: Option<f64>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    width_m: Option<f64>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    height_m: Option<f64>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    thickness_m: Option<f64>,
}

words! {
    enum RawKind: "kind of tool" {
        Ball "ball",
        Blade "blade",
    }
}

impl TryFrom<RawTool> for ToolDescription {
    type Error = &'static str;

    fn try_from(raw: RawTool) -> Result<Self, Self::Error> {
        let lengths = [raw.radius_m, raw.width_m, raw.height_m, raw.thickness_m];
        match (raw.kind, lengths) {
            (RawKind::Ball, [Some(radius_m), None, None, None]) => Ok(Self::Ball { radius_m }),
            (RawKind::Ball, _) => Err("a ball has a radius_m and nothing else"),
            (RawKind::Blade, [None, Some(width_m), Some(height_m), Some(thickness_m)]) => {
                Ok(Self::Blade {
                    width_m,
                    height_m,
                    thickness_m,
                })
            }
            (RawKind::Blade, _) => {
                Err("a blade has a width_m, a height_m, a thickness_m and nothing else")
            }
        }
    }
}
