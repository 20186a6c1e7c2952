//! What clay resists with.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::validate::{FieldError, Validate, check};

/// Bingham clay: force `-(yield_stress + viscosity · |v|) · area`; below yield elastic.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
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

impl Default for Material {
    /// The viscous clay of `[KHMH03]`: 20 N·s/m on each square centimetre of blade, without yield.
    fn default() -> Self {
        Self {
            viscosity_pa_s_per_m: 2e5,
            yield_stress_pa: 0.0,
            stiffness_pa: 0.0,
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
