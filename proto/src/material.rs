//! What clay resists with, in numbers or by name.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::validate::{FieldError, Validate, check};
use crate::word::words;

/// Bingham clay: force `-(yield_stress + viscosity · |v|) · area`; below yield elastic.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(from = "MaterialChoice")]
pub struct Material {
    /// Stress per speed, Pa·s/m.
    #[schema(minimum = 0, maximum = 1e7)]
    pub viscosity_pa_s_per_m: f64,
    /// Stress below which clay only bends, Pa.
    #[schema(minimum = 0, maximum = 1e6)]
    pub yield_stress_pa: f64,
    /// Modulus of the elastic part, Pa.
    #[schema(minimum = 0, maximum = 1e9)]
    pub stiffness_pa: f64,
}

words! {
    /// A material by name. Where the figures come from stands in docs/materials.md.
    #[derive(ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum Preset: "preset" {
        /// The viscous clay of the published experiment, `[KHMH03]`: force grows with speed alone.
        PaperClay "paper_clay",
        /// Oil clay warmed for modelling.
        SoftOilClay "soft_oil_clay",
        /// Water clay that keeps its shape.
        FirmClay "firm_clay",
        /// Modelling wax, warm.
        Wax "wax",
        /// Brittle foam that crushes, as florists use it.
        Foam "foam",
    }
}

/// A material as a request names it: by a preset, by numbers, or by a preset of which some numbers differ. In JSON
/// `{"preset": "firm_clay"}`. A request for something new takes what is left out from the paper's clay; a change leaves
/// it as it was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialChoice {
    /// The preset whose numbers hold where none is given. Answers tell the numbers.
    #[schema(nullable = false)]
    #[serde(default, deserialize_with = "crate::validate::present")]
    pub preset: Option<Preset>,
    /// Stress per speed, Pa·s/m.
    #[schema(nullable = false, minimum = 0, maximum = 1e7)]
    #[serde(default, deserialize_with = "crate::validate::present")]
    pub viscosity_pa_s_per_m: Option<f64>,
    /// Stress below which clay only bends, Pa.
    #[schema(nullable = false, minimum = 0, maximum = 1e6)]
    #[serde(default, deserialize_with = "crate::validate::present")]
    pub yield_stress_pa: Option<f64>,
    /// Modulus of the elastic part, Pa.
    #[schema(nullable = false, minimum = 0, maximum = 1e9)]
    #[serde(default, deserialize_with = "crate::validate::present")]
    pub stiffness_pa: Option<f64>,
}

impl Preset {
    /// Every preset, from the softest kind of answer to the hardest but for foam, which crushes.
    pub const ALL: [Self; 5] = [
        Self::PaperClay,
        Self::SoftOilClay,
        Self::FirmClay,
        Self::Wax,
        Self::Foam,
    ];

    /// Its numbers.
    #[must_use]
    pub const fn material(self) -> Material {
        let (viscosity_pa_s_per_m, yield_stress_pa, stiffness_pa) = match self {
            Self::PaperClay => (2e5, 0.0, 0.0),
            Self::SoftOilClay => (2e5, 3e4, 3e4),
            Self::FirmClay => (4e5, 7.5e4, 4e4),
            Self::Wax => (4e5, 1.2e5, 4e4),
            Self::Foam => (1e5, 3e4, 2e4),
        };
        Material {
            viscosity_pa_s_per_m,
            yield_stress_pa,
            stiffness_pa,
        }
    }

    /// What it is like, for people.
    #[must_use]
    pub const fn says(self) -> &'static str {
        match self {
            Self::PaperClay => "the cutting experiment's clay: force grows with speed alone",
            Self::SoftOilClay => "oil clay warmed for modelling: gives way to a light push",
            Self::FirmClay => "water clay that keeps its shape and gives way to a firm push",
            Self::Wax => "warm modelling wax: hard to cut, and harder the faster",
            Self::Foam => "brittle foam that crushes, at a force that hardly grows with speed",
        }
    }

    /// Where its numbers come from, and which of them are estimates, for people.
    #[must_use]
    pub const fn source(self) -> &'static str {
        match self {
            Self::PaperClay => "[KHMH03]: 20 N·s/m on each square centimetre of blade",
            Self::SoftOilClay => {
                "yield: estimate, a tenth of the flow stress of plasticine at room temperature [SR00], times 3 for a \
                 tool [T51]; viscosity and stiffness: what a handle can hold"
            }
            Self::FirmClay => {
                "yield: shear strength 12.5 kPa, between very soft and soft soil [TPM96], times 6 for a tool [S51]; \
                 viscosity and stiffness: what a handle can hold"
            }
            Self::Wax => {
                "yield: estimate for hand-warm wax, well below beeswax at room temperature [BBGO06], times 3 for a \
                 tool [T51]; viscosity and stiffness: what a handle can hold"
            }
            Self::Foam => {
                "yield: estimate, crushing strength of florists' foam, not raised for a tool, since foam does not \
                 spread [GA97]; viscosity and stiffness: what a handle can hold"
            }
        }
    }
}

impl Default for Material {
    /// The viscous clay of `[KHMH03]`: 20 N·s/m on each square centimetre of blade, without yield.
    fn default() -> Self {
        Preset::PaperClay.material()
    }
}

impl From<Preset> for Material {
    fn from(preset: Preset) -> Self {
        preset.material()
    }
}

/// Fills in what was left out. Never an error; ranges are [checked](Validate) where they count.
impl From<MaterialChoice> for Material {
    fn from(choice: MaterialChoice) -> Self {
        choice.over(Self::default())
    }
}

impl MaterialChoice {
    /// The material that is meant, where one that is left out leaves a number of `base` as it is.
    #[must_use]
    pub fn over(self, base: Material) -> Material {
        let base = self.preset.map_or(base, Material::from);
        Material {
            viscosity_pa_s_per_m: self
                .viscosity_pa_s_per_m
                .unwrap_or(base.viscosity_pa_s_per_m),
            yield_stress_pa: self.yield_stress_pa.unwrap_or(base.yield_stress_pa),
            stiffness_pa: self.stiffness_pa.unwrap_or(base.stiffness_pa),
        }
    }
}

impl Validate for Material {
    /// # Errors
    /// A viscosity outside of 0 to 10⁷ Pa·s/m, a yield stress outside of 0 to 10⁶ Pa, a stiffness outside of 0 to 10⁹
    /// Pa.
    fn validate(&self) -> Result<(), FieldError> {
        check(
            "/viscosity_pa_s_per_m",
            self.viscosity_pa_s_per_m,
            0.0..=1e7,
        )?;
        check("/yield_stress_pa", self.yield_stress_pa, 0.0..=1e6)?;
        check("/stiffness_pa", self.stiffness_pa, 0.0..=1e9)
    }
}
