//! Changes of a running session. Whatever is left out keeps its value.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::network::{Burst, Impairment, JitterDistribution, Network, Outage};
use super::{Material, MaterialChoice, Operation, Scheme};
use crate::validate::{FieldError, Validate, check};

/// Body of `PATCH /sessions/{id}`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SessionPatch {
    /// Another scheme.
    #[schema(nullable = false)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub scheme: Option<Scheme>,
    /// Another material.
    #[schema(nullable = false, value_type = Option<MaterialChoice>)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub material: Option<MaterialPatch>,
    /// Another network.
    #[schema(nullable = false)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub network: Option<NetworkPatch>,
    /// Share of a force or velocity below which its change is not sent; 0 sends every frame.
    #[schema(nullable = false, minimum = 0, maximum = 0.5)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub deadband: Option<f64>,
    /// What the tools do to the clay from now on. Under the `replica` scheme they cut: it carries nothing else.
    #[schema(nullable = false)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub operation: Option<Operation>,
    /// Whether the tool is to rest.
    #[schema(nullable = false)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub paused: Option<bool>,
}

/// Changes of a material: its numbers, or a [preset](super::Preset) with numbers of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "MaterialChoice")]
pub struct MaterialPatch {
    /// Stress per speed, Pa·s/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub viscosity_pa_s_per_m: Option<f64>,
    /// Stress below which clay only bends, Pa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yield_stress_pa: Option<f64>,
    /// Modulus of the elastic part, Pa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_pa: Option<f64>,
}

/// Changes of a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NetworkPatch {
    /// From the handle to the server.
    #[schema(nullable = false)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub up: Option<ImpairmentPatch>,
    /// From the server to the handle.
    #[schema(nullable = false)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub down: Option<ImpairmentPatch>,
}

/// Changes of one direction's impairment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ImpairmentPatch {
    /// Mean delay, s.
    #[schema(nullable = false, minimum = 0, maximum = 2)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub delay_s: Option<f64>,
    /// Standard deviation of the delay, s.
    #[schema(nullable = false, minimum = 0, maximum = 1)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub jitter_s: Option<f64>,
    /// Share of packets lost.
    #[schema(nullable = false, minimum = 0, maximum = 1)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub loss: Option<f64>,
    /// Seed of every random draw of this direction.
    #[schema(nullable = false, maximum = 9007199254740991_u64)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub seed: Option<u64>,
    /// How delays scatter.
    #[schema(nullable = false)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub jitter_distribution: Option<JitterDistribution>,
    /// Share of packets delivered twice.
    #[schema(nullable = false, minimum = 0, maximum = 1)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub duplicate: Option<f64>,
    /// Share of packets that overtake.
    #[schema(nullable = false, minimum = 0, maximum = 1)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub reorder: Option<f64>,
    /// Losses in bursts; `null` ends them.
    #[schema(value_type = Option<BurstPatch>)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub burst: Option<Option<BurstPatch>>,
    /// Outages; `null` ends them.
    #[schema(value_type = Option<OutagePatch>)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub outage: Option<Option<OutagePatch>>,
}

/// Changes of losses in bursts. Where there were none, all of it must be there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BurstPatch {
    /// Probability per packet that a good channel turns bad.
    #[schema(nullable = false, minimum = 0, maximum = 1)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub enter: Option<f64>,
    /// Probability per packet that a bad channel turns good.
    #[schema(nullable = false, minimum = 0, maximum = 1)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub leave: Option<f64>,
    /// Share of packets lost while the channel is bad.
    #[schema(nullable = false, minimum = 0, maximum = 1)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub loss_in_burst: Option<f64>,
}

/// Changes of outages. Where there were none, all of it must be there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct OutagePatch {
    /// From the start of one outage to the start of the next, s.
    #[schema(nullable = false, minimum = 0.01, maximum = 3600)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub every_s: Option<f64>,
    /// Length of each, s; shorter than `every_s`.
    #[schema(nullable = false, minimum = 0, maximum = 60)]
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "crate::validate::present"
    )]
    pub length_s: Option<f64>,
}

impl SessionPatch {
    /// Checks what only shows beside the network as it is: parts that are left out and that nothing has a value for,
    /// and parts that do not fit each other.
    ///
    /// # Errors
    /// The first field at fault.
    pub fn fits(&self, network: Network) -> Result<(), FieldError> {
        let Some(change) = self.network else {
            return Ok(());
        };
        let lines = [
            ("/network/up", change.up, network.up),
            ("/network/down", change.down, network.down),
        ];
        for (pointer, change, line) in lines {
            if let Some(change) = change {
                change
                    .is_whole(&line)
                    .map_err(|error| error.under(pointer))?;
            }
        }
        change.apply(network).validate_under("/network")
    }
}

impl MaterialPatch {
    /// The material after the change.
    #[must_use]
    pub fn apply(&self, to: Material) -> Material {
        Material {
            viscosity_pa_s_per_m: self.viscosity_pa_s_per_m.unwrap_or(to.viscosity_pa_s_per_m),
            yield_stress_pa: self.yield_stress_pa.unwrap_or(to.yield_stress_pa),
            stiffness_pa: self.stiffness_pa.unwrap_or(to.stiffness_pa),
        }
    }
}

impl NetworkPatch {
    /// The network after the change. Where an outage or a burst begins and a part of it is left out, that part is NaN,
    /// which no network may have; [`SessionPatch::fits`] says so beforehand.
    #[must_use]
    pub fn apply(&self, to: Network) -> Network {
        Network {
            up: self.up.map_or(to.up, |patch| patch.apply(to.up)),
            down: self.down.map_or(to.down, |patch| patch.apply(to.down)),
        }
    }
}

impl ImpairmentPatch {
    /// The impairment after the change.
    #[must_use]
    pub fn apply(&self, to: Impairment) -> Impairment {
        Impairment {
            delay_s: self.delay_s.unwrap_or(to.delay_s),
            jitter_s: self.jitter_s.unwrap_or(to.jitter_s),
            loss: self.loss.unwrap_or(to.loss),
            seed: self.seed.unwrap_or(to.seed),
            jitter_distribution: self.jitter_distribution.unwrap_or(to.jitter_distribution),
            duplicate: self.duplicate.unwrap_or(to.duplicate),
            reorder: self.reorder.unwrap_or(to.reorder),
            burst: self.burst.map_or(to.burst, |change| {
                change.map(|change| change.apply(to.burst.unwrap_or(NO_BURST)))
            }),
            outage: self.outage.map_or(to.outage, |change| {
                change.map(|change| change.apply(to.outage.unwrap_or(NO_OUTAGE)))
            }),
        }
    }

    /// Checks that nothing which begins with this change lacks a part.
    fn is_whole(&self, before: &Impairment) -> Result<(), FieldError> {
        if let (Some(Some(change)), None) = (self.burst, before.burst) {
            let parts = [
                ("enter", change.enter),
                ("leave", change.leave),
                ("loss_in_burst", change.loss_in_burst),
            ];
            all_there("/burst", "bursts", &parts)?;
        }
        if let (Some(Some(change)), None) = (self.outage, before.outage) {
            let parts = [("every_s", change.every_s), ("length_s", change.length_s)];
            all_there("/outage", "outages", &parts)?;
        }
        Ok(())
    }
}

/// What a change of bursts has where there are none to change.
const NO_BURST: Burst = Burst {
    enter: f64::NAN,
    leave: f64::NAN,
    loss_in_burst: f64::NAN,
};

/// What a change of outages has where there are none to change.
const NO_OUTAGE: Outage = Outage {
    every_s: f64::NAN,
    length_s: f64::NAN,
};

fn all_there(pointer: &str, what: &str, parts: &[(&str, Option<f64>)]) -> Result<(), FieldError> {
    match parts.iter().find(|(_, value)| value.is_none()) {
        Some((name, _)) => Err(FieldError::new(
            pointer,
            format!("missing field `{name}`: there are no {what} whose value it could keep"),
        )),
        None => Ok(()),
    }
}

impl BurstPatch {
    /// The bursts after the change.
    #[must_use]
    pub fn apply(&self, to: Burst) -> Burst {
        Burst {
            enter: self.enter.unwrap_or(to.enter),
            leave: self.leave.unwrap_or(to.leave),
            loss_in_burst: self.loss_in_burst.unwrap_or(to.loss_in_burst),
        }
    }
}

impl OutagePatch {
    /// The outages after the change.
    #[must_use]
    pub fn apply(&self, to: Outage) -> Outage {
        Outage {
            every_s: self.every_s.unwrap_or(to.every_s),
            length_s: self.length_s.unwrap_or(to.length_s),
        }
    }
}

impl From<MaterialChoice> for MaterialPatch {
    /// A preset stands for its numbers.
    fn from(choice: MaterialChoice) -> Self {
        if choice.preset.is_some() {
            return Material::from(choice).into();
        }
        Self {
            viscosity_pa_s_per_m: choice.viscosity_pa_s_per_m,
            yield_stress_pa: choice.yield_stress_pa,
            stiffness_pa: choice.stiffness_pa,
        }
    }
}

impl From<Material> for MaterialPatch {
    /// The change that gives exactly this material, whatever was before.
    fn from(material: Material) -> Self {
        Self {
            viscosity_pa_s_per_m: Some(material.viscosity_pa_s_per_m),
            yield_stress_pa: Some(material.yield_stress_pa),
            stiffness_pa: Some(material.stiffness_pa),
        }
    }
}

impl From<Network> for NetworkPatch {
    /// The change that gives exactly this network, whatever was before.
    fn from(network: Network) -> Self {
        Self {
            up: Some(network.up.into()),
            down: Some(network.down.into()),
        }
    }
}

impl From<Impairment> for ImpairmentPatch {
    /// The change that gives exactly this impairment, whatever was before.
    fn from(impairment: Impairment) -> Self {
        Self {
            delay_s: Some(impairment.delay_s),
            jitter_s: Some(impairment.jitter_s),
            loss: Some(impairment.loss),
            seed: Some(impairment.seed),
            jitter_distribution: Some(impairment.jitter_distribution),
            duplicate: Some(impairment.duplicate),
            reorder: Some(impairment.reorder),
            burst: Some(impairment.burst.map(BurstPatch::from)),
            outage: Some(impairment.outage.map(OutagePatch::from)),
        }
    }
}

impl From<Burst> for BurstPatch {
    /// The change that gives exactly these bursts, whatever was before.
    fn from(burst: Burst) -> Self {
        Self {
            enter: Some(burst.enter),
            leave: Some(burst.leave),
            loss_in_burst: Some(burst.loss_in_burst),
        }
    }
}

impl From<Outage> for OutagePatch {
    /// The change that gives exactly these outages, whatever was before.
    fn from(outage: Outage) -> Self {
        Self {
            every_s: Some(outage.every_s),
            length_s: Some(outage.length_s),
        }
    }
}

/// A range is kept by a change exactly when it is kept by the change of something that keeps it, so that the limits
/// stand in one place.
impl Validate for SessionPatch {
    fn validate(&self) -> Result<(), FieldError> {
        self.material.validate_under("/material")?;
        if let Some(deadband) = self.deadband {
            check("/deadband", deadband, 0.0..=crate::scheme::MAX_DEADBAND)?;
        }
        self.network.validate_under("/network")
    }
}

impl Validate for MaterialPatch {
    fn validate(&self) -> Result<(), FieldError> {
        self.apply(Material::default()).validate()
    }
}

impl Validate for NetworkPatch {
    fn validate(&self) -> Result<(), FieldError> {
        self.up.validate_under("/up")?;
        self.down.validate_under("/down")
    }
}

impl Validate for ImpairmentPatch {
    fn validate(&self) -> Result<(), FieldError> {
        // The longest period and the shortest outage: with them, only what the change itself names can be at fault.
        let outage = Outage {
            every_s: 3600.0,
            length_s: 0.0,
        };
        let burst = Burst {
            enter: 0.0,
            leave: 1.0,
            loss_in_burst: 0.0,
        };
        self.apply(Impairment {
            burst: Some(burst),
            outage: Some(outage),
            ..Impairment::default()
        })
        .validate()
    }
}
