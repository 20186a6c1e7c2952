//! Blocks of clay: what they start as, and the hash that says whether two are the same.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::{PartialSchema, ToSchema};

use super::{FieldError, Material, Validate, check};

/// Most voxels along one axis.
pub const MAX_VOXELS_PER_AXIS: u32 = 512;

/// Extent of a block that is not told otherwise, m.
const DEFAULT_SIZE_M: [f64; 3] = [0.128, 0.064, 0.064];
/// Where the steps of the cutting experiment begin and end, [KHMH03] Fig. 7.
const DEFAULT_EDGES_M: [f64; 4] = [0.03, 0.06, 0.09, 0.12];
/// Depths of cut that give the experiment's 20, 40 and 60 N·s/m with its 10 mm blade in the default clay.
const DEFAULT_DEPTHS_M: [f64; 3] = [0.01, 0.02, 0.03];
/// Clay below the blade, thick enough that the blade's lower edge stays inside of the block.
const DEFAULT_BASE_M: f64 = 0.02;

/// The shape of a fresh block. In JSON `{"kind": "block", "size_m": [0.128, 0.064, 0.064]}`.
///
/// The block's frame has its origin at a corner, z up; it fills `[0, size]` along each axis. Whatever is left out takes
/// its default.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", try_from = "RawShape")]
pub enum ClayShape {
    /// A full block.
    Block {
        /// Extent along x, y, z, m.
        size_m: [f64; 3],
    },
    /// The block of the cutting experiment: along x the clay rises in three steps, so that a blade which moves level
    /// cuts three depths one after the other.
    Stepped {
        /// Extent of the grid along x, y, z, m.
        size_m: [f64; 3],
        /// Where along x the first, second and third step begin, and where the third ends, m.
        edges_m: [f64; 4],
        /// Height of each step above the base, m.
        depths_m: [f64; 3],
        /// Height of the clay that no step adds to, m: the blade's lower edge runs along its top.
        base_m: f64,
    },
}

/// What a session's clay starts as.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ClaySpec {
    /// Its shape.
    pub shape: ClayShape,
    /// Edge of a voxel, m.
    #[schema(minimum = 1e-4, maximum = 0.01)]
    pub voxel_size_m: f64,
}

/// Asks for a fresh block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ClayReset {
    /// Its shape; the shape of the last block when left out.
    #[serde(
        skip_serializing_if = "Option::is_none",
        deserialize_with = "super::patch::present"
    )]
    pub shape: Option<ClayShape>,
    /// Its material; the material of the last block when left out.
    #[serde(
        skip_serializing_if = "Option::is_none",
        deserialize_with = "super::patch::present"
    )]
    pub material: Option<Material>,
}

/// Hash of a whole block: equal hashes mean equal clay. 16 hexadecimal digits in JSON, which cannot hold 64 bits as a number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ClayHash(pub u64);

/// A text that is not 16 lower-case hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{got}` is not 16 lower-case hexadecimal digits")]
pub struct ClayHashError {
    /// The text.
    pub got: String,
}

impl ClayShape {
    /// A full block of the default size.
    pub const DEFAULT_BLOCK: Self = Self::Block {
        size_m: DEFAULT_SIZE_M,
    };

    /// The stepped block of the cutting experiment.
    pub const DEFAULT_STEPPED: Self = Self::Stepped {
        size_m: DEFAULT_SIZE_M,
        edges_m: DEFAULT_EDGES_M,
        depths_m: DEFAULT_DEPTHS_M,
        base_m: DEFAULT_BASE_M,
    };

    /// Extent along x, y, z, m.
    #[must_use]
    pub const fn size_m(&self) -> [f64; 3] {
        match *self {
            Self::Block { size_m } | Self::Stepped { size_m, .. } => size_m,
        }
    }
}

impl Default for ClayShape {
    fn default() -> Self {
        Self::DEFAULT_BLOCK
    }
}

impl Default for ClaySpec {
    /// A block of 128 × 64 × 64 mm in voxels of half a millimetre.
    fn default() -> Self {
        Self {
            shape: ClayShape::default(),
            voxel_size_m: 5e-4,
        }
    }
}

impl Validate for ClayShape {
    fn validate(&self) -> Result<(), FieldError> {
        for (axis, size) in self.size_m().into_iter().enumerate() {
            check(&format!("/size_m/{axis}"), size, 1e-3..=1.0)?;
        }
        let Self::Stepped {
            size_m,
            edges_m,
            depths_m,
            base_m,
        } = *self
        else {
            return Ok(());
        };
        let mut least = 0.0;
        for (index, edge) in edges_m.into_iter().enumerate() {
            check(&format!("/edges_m/{index}"), edge, least..=size_m[0])?;
            least = edge;
        }
        check("/base_m", base_m, 0.0..=size_m[2])?;
        for (index, depth) in depths_m.into_iter().enumerate() {
            check(
                &format!("/depths_m/{index}"),
                depth,
                0.0..=size_m[2] - base_m,
            )?;
        }
        Ok(())
    }
}

impl Validate for ClaySpec {
    fn validate(&self) -> Result<(), FieldError> {
        self.shape.validate_under("/shape")?;
        check("/voxel_size_m", self.voxel_size_m, 1e-4..=0.01)?;
        for (axis, size) in self.shape.size_m().into_iter().enumerate() {
            let voxels = (size / self.voxel_size_m).round();
            if !(1.0..=f64::from(MAX_VOXELS_PER_AXIS)).contains(&voxels) {
                let detail = format!(
                    "{size} m in voxels of {} m are {voxels} voxels, wanted 1 to {MAX_VOXELS_PER_AXIS}",
                    self.voxel_size_m
                );
                return Err(FieldError::new(format!("/shape/size_m/{axis}"), detail));
            }
        }
        Ok(())
    }
}

impl Validate for ClayReset {
    fn validate(&self) -> Result<(), FieldError> {
        self.shape.validate_under("/shape")?;
        self.material.validate_under("/material")
    }
}

impl fmt::Display for ClayHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

impl FromStr for ClayHash {
    type Err = ClayHashError;

    fn from_str(text: &str) -> Result<Self, ClayHashError> {
        let digits = text
            .bytes()
            .all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        match u64::from_str_radix(text, 16) {
            Ok(hash) if digits && text.len() == 16 => Ok(Self(hash)),
            _ => Err(ClayHashError {
                got: text.to_owned(),
            }),
        }
    }
}

impl TryFrom<String> for ClayHash {
    type Error = ClayHashError;

    fn try_from(text: String) -> Result<Self, ClayHashError> {
        text.parse()
    }
}

impl From<ClayHash> for String {
    fn from(hash: ClayHash) -> Self {
        hash.to_string()
    }
}

impl PartialSchema for ClayHash {
    fn schema() -> RefOr<Schema> {
        ObjectBuilder::new()
            .schema_type(Type::String)
            .pattern(Some("^[0-9a-f]{16}$"))
            .into()
    }
}

impl ToSchema for ClayHash {
    fn name() -> Cow<'static, str> {
        Cow::Borrowed("ClayHash")
    }
}

/// A shape as it is spelt, flat: an error then names the very field, which serde's own tagged enumerations cannot.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawShape {
    kind: RawKind,
    size_m: Option<[f64; 3]>,
    edges_m: Option<[f64; 4]>,
    depths_m: Option<[f64; 3]>,
    base_m: Option<f64>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawKind {
    Block,
    Stepped,
}

impl TryFrom<RawShape> for ClayShape {
    type Error = &'static str;

    fn try_from(raw: RawShape) -> Result<Self, Self::Error> {
        let size_m = raw.size_m.unwrap_or(DEFAULT_SIZE_M);
        match raw.kind {
            RawKind::Block
                if raw.edges_m.is_some() || raw.depths_m.is_some() || raw.base_m.is_some() =>
            {
                Err("a block has a size_m and nothing else")
            }
            RawKind::Block => Ok(Self::Block { size_m }),
            RawKind::Stepped => Ok(Self::Stepped {
                size_m,
                edges_m: raw.edges_m.unwrap_or(DEFAULT_EDGES_M),
                depths_m: raw.depths_m.unwrap_or(DEFAULT_DEPTHS_M),
                base_m: raw.base_m.unwrap_or(DEFAULT_BASE_M),
            }),
        }
    }
}
