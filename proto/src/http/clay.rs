//! Blocks of clay: what they start as.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::schema::{BlockEdge, BlockPlace, EDGE_M, PLACE_M};
use super::{Material, MaterialChoice};
use crate::validate::{FieldError, Validate, check};
use crate::word::words;

/// Most voxels along one axis.
pub const MAX_VOXELS_PER_AXIS: u32 = 1024;

/// Most voxels in all: 1024 by 1024 by 512 of them.
pub const MAX_VOXELS: u64 = 1 << 29;

/// Most steps of a stepped block.
pub const MAX_STEPS: usize = 64;

/// Most layers of a block: its classes of material are 8 at most, and one is below them.
pub const MAX_LAYERS: usize = 7;

/// Edge of a voxel.
const VOXEL_M: RangeInclusive<f64> = 1e-5..=0.1;
/// Extent of a block that is not told otherwise, m.
const DEFAULT_SIZE_M: [f64; 3] = [0.128, 0.064, 0.064];
/// Where the steps of the cutting experiment begin and end, `[KHMH03]` Fig. 7.
const DEFAULT_EDGES_M: [f64; 4] = [0.03, 0.06, 0.09, 0.12];
/// Depths of cut that give the experiment's 20, 40 and 60 N·s/m with its 10 mm blade in the default clay.
const DEFAULT_DEPTHS_OF_CUT_M: [f64; 3] = [0.01, 0.02, 0.03];
/// Clay below the blade, so that a cut has a floor.
const DEFAULT_BASE_M: f64 = 0.01;
/// As wide as the default block.
const DEFAULT_WIDTH_M: f64 = 0.064;

/// The shape of a fresh block. In JSON `{"kind": "block", "size_m": [0.128, 0.064, 0.064]}`.
///
/// The clay's frame has its origin at a corner of the block, z up; the block fills `[0, size]` along each axis.
/// Whatever is left out takes its default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", try_from = "RawShape")]
pub enum ClayShape {
    /// A full block.
    Block {
        /// Extent along x, y, z, m.
        #[schema(required = false, value_type = Vec<BlockEdge>, min_items = 3, max_items = 3)]
        size_m: [f64; 3],
    },
    /// The block of the cutting experiment: its top rises in steps along x, so that a blade which moves level cuts one
    /// depth after the other.
    Stepped {
        /// Where the steps begin and end along x, m: ascending, one more than there are depths. Nothing stands outside.
        #[schema(required = false, value_type = Vec<BlockPlace>, min_items = 2, max_items = 65)]
        edges_m: Vec<f64>,
        /// Height of each step above the blade's lower edge, m; 1 to 64 steps.
        #[schema(required = false, value_type = Vec<BlockEdge>, min_items = 1, max_items = 64)]
        depths_of_cut_m: Vec<f64>,
        /// Height of the clay below the blade's lower edge, m.
        #[schema(required = false, value_type = BlockPlace)]
        base_m: f64,
        /// Extent along y, m.
        #[schema(required = false, value_type = BlockEdge)]
        width_m: f64,
    },
}

/// What a session's clay starts as.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ClaySpec {
    /// Its shape.
    pub shape: ClayShape,
    /// Edge of a voxel, m.
    #[schema(minimum = 1e-5, maximum = 0.1)]
    pub voxel_size_m: f64,
    /// Layers of other materials, from the top of the block downwards; what is below them resists with the session's
    /// material. At most 7.
    #[schema(max_items = 7)]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<Layer>,
}

/// A layer of a block. In JSON `{"thickness_m": 0.01, "material": {"preset": "foam"}}`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Layer {
    /// How thick it is, m. It ends at the boundary between voxels that is nearest.
    #[schema(value_type = BlockEdge)]
    pub thickness_m: f64,
    /// What it resists with.
    #[schema(value_type = MaterialChoice)]
    pub material: Material,
}

/// Asks for a fresh block.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ClayReset {
    /// Its shape; the shape of the last block when left out.
    #[schema(nullable = false)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub shape: Option<ClayShape>,
    /// Its material; the material of the last block when left out.
    #[schema(nullable = false, value_type = Option<MaterialChoice>)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub material: Option<Material>,
    /// Its layers; those of the last block when left out, and none when empty.
    #[schema(nullable = false, max_items = 7)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub layers: Option<Vec<Layer>>,
}

impl ClayShape {
    /// A full block of the default size.
    #[must_use]
    pub const fn block() -> Self {
        Self::Block {
            size_m: DEFAULT_SIZE_M,
        }
    }

    /// The stepped block of the cutting experiment.
    #[must_use]
    pub fn stepped() -> Self {
        Self::Stepped {
            edges_m: DEFAULT_EDGES_M.to_vec(),
            depths_of_cut_m: DEFAULT_DEPTHS_OF_CUT_M.to_vec(),
            base_m: DEFAULT_BASE_M,
            width_m: DEFAULT_WIDTH_M,
        }
    }

    /// Extent of the whole along x, y, z, m.
    #[must_use]
    pub fn size_m(&self) -> [f64; 3] {
        match self {
            Self::Block { size_m } => *size_m,
            Self::Stepped {
                edges_m,
                depths_of_cut_m,
                base_m,
                width_m,
            } => {
                let far_m = edges_m.last().copied().unwrap_or(0.0);
                let deepest_m = depths_of_cut_m.iter().copied().fold(0.0, f64::max);
                [far_m, *width_m, base_m + deepest_m]
            }
        }
    }
}

impl Default for ClayShape {
    fn default() -> Self {
        Self::block()
    }
}

impl Default for ClaySpec {
    /// A block of 128 × 64 × 64 mm in voxels of half a millimetre.
    fn default() -> Self {
        Self {
            shape: ClayShape::default(),
            voxel_size_m: 5e-4,
            layers: Vec::new(),
        }
    }
}

impl Validate for ClayShape {
    fn validate(&self) -> Result<(), FieldError> {
        match self {
            Self::Block { size_m } => {
                for (axis, size) in size_m.iter().enumerate() {
                    check_length(&format!("/size_m/{axis}"), *size)?;
                }
                Ok(())
            }
            Self::Stepped {
                edges_m,
                depths_of_cut_m,
                base_m,
                width_m,
            } => {
                let (edges, depths) = (edges_m.len(), depths_of_cut_m.len());
                if !(1..=MAX_STEPS).contains(&depths) {
                    let detail = format!("{depths} depths, wanted 1 to {MAX_STEPS}");
                    return Err(FieldError::new("/depths_of_cut_m", detail));
                }
                if edges != depths + 1 {
                    let detail = format!("{edges} edges for {depths} depths, wanted one more");
                    return Err(FieldError::new("/edges_m", detail));
                }
                check("/edges_m/0", edges_m[0], PLACE_M)?;
                for (index, pair) in edges_m.windows(2).enumerate() {
                    let pointer = format!("/edges_m/{}", index + 1);
                    check_length(&pointer, pair[1])?;
                    if pair[1] <= pair[0] {
                        let detail = format!("{} does not come after {}", pair[1], pair[0]);
                        return Err(FieldError::new(pointer, detail));
                    }
                }
                for (index, depth) in depths_of_cut_m.iter().enumerate() {
                    check_length(&format!("/depths_of_cut_m/{index}"), *depth)?;
                }
                check("/base_m", *base_m, PLACE_M)?;
                check_length("/width_m", *width_m)
            }
        }
    }
}

impl Validate for ClaySpec {
    fn validate(&self) -> Result<(), FieldError> {
        self.shape.validate_under("/shape")?;
        check("/voxel_size_m", self.voxel_size_m, VOXEL_M)?;
        let mut in_all = 1.0;
        for (axis, size) in ["x", "y", "z"].into_iter().zip(self.shape.size_m()) {
            // A millionth of a voxel is what the division's rounding may add.
            let voxels = (size / self.voxel_size_m - 1e-6).ceil();
            if f64::from(MAX_VOXELS_PER_AXIS) < voxels {
                let detail = format!(
                    "{size} m along {axis} take {voxels} voxels, wanted at most {MAX_VOXELS_PER_AXIS}"
                );
                return Err(FieldError::new("/voxel_size_m", detail));
            }
            in_all *= voxels.max(1.0);
        }
        if (MAX_VOXELS as f64) < in_all {
            let detail = format!("{in_all} voxels in all, wanted at most {MAX_VOXELS}");
            return Err(FieldError::new("/voxel_size_m", detail));
        }
        check_layers(&self.layers)
    }
}

impl Validate for Layer {
    fn validate(&self) -> Result<(), FieldError> {
        check_length("/thickness_m", self.thickness_m)?;
        self.material.validate_under("/material")
    }
}

fn check_layers(layers: &[Layer]) -> Result<(), FieldError> {
    if MAX_LAYERS < layers.len() {
        let detail = format!("{} layers, wanted at most {MAX_LAYERS}", layers.len());
        return Err(FieldError::new("/layers", detail));
    }
    let mut layers = layers.iter().enumerate();
    layers.try_for_each(|(index, layer)| layer.validate_under(&format!("/layers/{index}")))
}

fn check_length(pointer: &str, length: f64) -> Result<(), FieldError> {
    check(pointer, length, EDGE_M)
}

impl Validate for ClayReset {
    fn validate(&self) -> Result<(), FieldError> {
        self.shape.validate_under("/shape")?;
        self.material.validate_under("/material")?;
        check_layers(self.layers.as_deref().unwrap_or_default())
    }
}

/// A shape as it is spelt, flat: an error then names the very field, which serde's own tagged enumerations cannot.
#[derive(Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an object that describes a shape of clay"
)]
struct RawShape {
    kind: RawKind,
    #[serde(default, deserialize_with = "crate::validate::present")]
    size_m: Option<[f64; 3]>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    edges_m: Option<Vec<f64>>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    depths_of_cut_m: Option<Vec<f64>>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    base_m: Option<f64>,
    #[serde(default, deserialize_with = "crate::validate::present")]
    width_m: Option<f64>,
}

words! {
    enum RawKind: "shape of clay" {
        Block "block",
        Stepped "stepped",
    }
}

impl TryFrom<RawShape> for ClayShape {
    type Error = &'static str;

    fn try_from(raw: RawShape) -> Result<Self, Self::Error> {
        let only_size = raw.edges_m.is_none()
            && raw.depths_of_cut_m.is_none()
            && raw.base_m.is_none()
            && raw.width_m.is_none();
        match raw.kind {
            RawKind::Block if only_size => {
                let size_m = raw.size_m.unwrap_or(DEFAULT_SIZE_M);
                Ok(Self::Block { size_m })
            }
            RawKind::Block => Err("a block has a size_m and nothing else"),
            RawKind::Stepped if raw.size_m.is_some() => Err(
                "a stepped block has edges_m, depths_of_cut_m, a base_m and a width_m, and no size_m",
            ),
            RawKind::Stepped => {
                let list = |lengths_m: Option<Vec<f64>>, default_m: &[f64]| {
                    lengths_m.unwrap_or_else(|| default_m.to_vec())
                };
                Ok(Self::Stepped {
                    edges_m: list(raw.edges_m, &DEFAULT_EDGES_M),
                    depths_of_cut_m: list(raw.depths_of_cut_m, &DEFAULT_DEPTHS_OF_CUT_M),
                    base_m: raw.base_m.unwrap_or(DEFAULT_BASE_M),
                    width_m: raw.width_m.unwrap_or(DEFAULT_WIDTH_M),
                })
            }
        }
    }
}
