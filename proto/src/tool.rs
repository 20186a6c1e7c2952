//! The tool's shape, as it is told to handles and watchers.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::validate::{FieldError, Validate, check};
use crate::word::words;

/// Radius of a ball.
const RADIUS_M: RangeInclusive<f64> = 1e-4..=0.1;
/// Side of a blade, height of a cylinder.
const SIDE_M: RangeInclusive<f64> = 1e-4..=0.5;
/// Radius of a loop's ring, and thickness of its wire.
const RING_M: RangeInclusive<f64> = 1e-4..=0.1;
const WIRE_M: RangeInclusive<f64> = 1e-4..=0.1;

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
    /// An upright rod with flat ends; its position is the centre of its lower end.
    Cylinder {
        /// Radius, m.
        #[schema(minimum = 1e-4, maximum = 0.1)]
        radius_m: f64,
        /// Height along z, m.
        #[schema(minimum = 1e-4, maximum = 0.5)]
        height_m: f64,
    },
    /// A ring of round wire, upright in the plane across x; its position is the centre of the ring. The wire is what
    /// feels force; what passes through the ring is severed and taken away, so the disc that the ring encloses removes.
    Loop {
        /// From the ring's centre to the middle of the wire, m.
        #[schema(minimum = 1e-4, maximum = 0.1)]
        ring_radius_m: f64,
        /// Thickness of the wire, m; at most the ring's radius.
        #[schema(minimum = 1e-4, maximum = 0.1)]
        wire_diameter_m: f64,
    },
}

impl ToolDescription {
    /// From the tool's position down to its lowest point, m.
    #[must_use]
    pub fn below_position_m(&self) -> f64 {
        match *self {
            Self::Ball { radius_m } => radius_m,
            Self::Blade { .. } | Self::Cylinder { .. } => 0.0,
            Self::Loop {
                ring_radius_m,
                wire_diameter_m,
            } => ring_radius_m + wire_diameter_m / 2.0,
        }
    }

    /// From the tool's position to its sides along x and y, m.
    #[must_use]
    pub fn beside_position_m(&self) -> [f64; 2] {
        match *self {
            Self::Ball { radius_m } | Self::Cylinder { radius_m, .. } => [radius_m; 2],
            Self::Blade {
                width_m,
                thickness_m,
                ..
            } => [thickness_m / 2.0, width_m / 2.0],
            Self::Loop {
                ring_radius_m,
                wire_diameter_m,
            } => [wire_diameter_m / 2.0, ring_radius_m + wire_diameter_m / 2.0],
        }
    }
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
    /// A radius or a wire outside of 0.1 mm to 0.1 m; a side of a blade or a height outside of 0.1 mm to 0.5 m; a wire
    /// thicker than its ring's radius.
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
            Self::Cylinder { radius_m, height_m } => {
                check("/radius_m", radius_m, RADIUS_M)?;
                check("/height_m", height_m, SIDE_M)
            }
            Self::Loop {
                ring_radius_m,
                wire_diameter_m,
            } => {
                check("/ring_radius_m", ring_radius_m, RING_M)?;
                check("/wire_diameter_m", wire_diameter_m, WIRE_M)?;
                if ring_radius_m < wire_diameter_m {
                    let detail = format!(
                        "{wire_diameter_m} is thicker than the ring's radius, {ring_radius_m}"
                    );
                    return Err(FieldError::new("/wire_diameter_m", detail));
                }
                Ok(())
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
    #[serde(default, deserialize_with = "crate::validate::present")]
    ring_radius_m: Option<f64>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    wire_diameter_m: Option<f64>,
}

words! {
    enum RawKind: "kind of tool" {
        Ball "ball",
        Blade "blade",
        Cylinder "cylinder",
        Loop "loop",
    }
}

impl TryFrom<RawTool> for ToolDescription {
    type Error = &'static str;

    fn try_from(raw: RawTool) -> Result<Self, Self::Error> {
        let lengths = [
            raw.radius_m,
            raw.width_m,
            raw.height_m,
            raw.thickness_m,
            raw.ring_radius_m,
            raw.wire_diameter_m,
        ];
        match (raw.kind, lengths) {
            (RawKind::Ball, [Some(radius_m), None, None, None, None, None]) => {
                Ok(Self::Ball { radius_m })
            }
            (RawKind::Ball, _) => Err("a ball has a radius_m and nothing else"),
            (
                RawKind::Blade,
                [
                    None,
                    Some(width_m),
                    Some(height_m),
                    Some(thickness_m),
                    None,
                    None,
                ],
            ) => Ok(Self::Blade {
                width_m,
                height_m,
                thickness_m,
            }),
            (RawKind::Blade, _) => {
                Err("a blade has a width_m, a height_m, a thickness_m and nothing else")
            }
            (RawKind::Cylinder, [Some(radius_m), None, Some(height_m), None, None, None]) => {
                Ok(Self::Cylinder { radius_m, height_m })
            }
            (RawKind::Cylinder, _) => Err("a cylinder has a radius_m, a height_m and nothing else"),
            (
                RawKind::Loop,
                [
                    None,
                    None,
                    None,
                    None,
                    Some(ring_radius_m),
                    Some(wire_diameter_m),
                ],
            ) => Ok(Self::Loop {
                ring_radius_m,
                wire_diameter_m,
            }),
            (RawKind::Loop, _) => {
                Err("a loop has a ring_radius_m, a wire_diameter_m and nothing else")
            }
        }
    }
}
