//! What a session was told to be, and what the loop runs with in consequence.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use teleclay_bilateral::{FreshClayError, clay_shape, fresh_clay, material, operation, tool_shape};
use teleclay_clay::{Clay, Material, Operation, ToolShape};
use teleclay_link::conditioner;
use teleclay_proto::ToolDescription;
use teleclay_proto::http::{
    self, ClayReset, ClayShape, FieldError, JitterDistribution, Network, NewSession, SessionPatch,
    Validate,
};
use teleclay_proto::join::LoopParameters;

/// The tool may leave the block by this much on every side, m.
const MARGIN_M: f64 = 0.1;

/// What the network does, in each direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lines {
    /// From handle to tool.
    pub up: conditioner::Impairment,
    /// Seed of that line.
    pub up_seed: u64,
    /// From tool to handle.
    pub down: conditioner::Impairment,
    /// Seed of that line.
    pub down_seed: u64,
}

/// What a session was told to be. Made once for each revision, and shared from then on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// The revision that made these settings.
    pub revision: u64,
    /// What was asked for, with every change since.
    pub spec: NewSession,
    /// How both sides run the loop.
    pub parameters: LoopParameters,
    /// Whether the tools are to rest.
    pub is_paused: bool,
}

/// Settings that cannot be.
pub type SettingsError = FieldError;

impl Settings {
    /// The settings of a new session.
    ///
    /// # Errors
    /// A field is out of its range, or the parts do not fit one another.
    pub fn new(spec: NewSession) -> Result<Self, SettingsError> {
        spec.validate()?;
        proven_material(&spec.material)?;
        proven_layers(&spec.clay.layers).map_err(|error| error.under("/clay"))?;
        proven_tool(&spec.tool)?;
        Ok(Self {
            revision: 0,
            parameters: parameters(&spec),
            spec,
            is_paused: false,
        })
    }

    /// The settings after `patch`.
    ///
    /// # Errors
    /// A field of the patch, or what the patch makes of a field, is out of its range. All of the patch is checked
    /// before any of it counts.
    pub fn patched(&self, patch: &SessionPatch) -> Result<Self, SettingsError> {
        patch.validate()?;
        let mut next = self.clone();
        if let Some(scheme) = patch.scheme {
            next.spec.scheme = scheme;
            next.parameters.scheme = scheme;
        }
        if let Some(change) = patch.material {
            let material = change.apply(self.spec.material);
            proven_material(&material)?;
            next.spec.material = material;
            next.parameters.material = material;
        }
        if let Some(deadband) = patch.deadband {
            next.spec.deadband = deadband;
            next.parameters.deadband = deadband;
        }
        if let Some(change) = patch.network {
            next.spec.network = change.apply(self.spec.network);
            next.spec.network.validate_under("/network")?;
        }
        if let Some(is_paused) = patch.paused {
            next.is_paused = is_paused;
        }
        if let Some(operation) = patch.operation {
            next.spec.operation = operation;
        }
        let checked = next.spec.operation.check_under(next.spec.scheme);
        checked.map_err(|error| match patch.operation {
            Some(_) => error,
            None => FieldError::new("/scheme", error.detail),
        })?;
        Ok(next)
    }

    /// The settings with the fresh block of `reset`.
    ///
    /// # Errors
    /// A field is out of its range.
    pub fn with_fresh_block(&self, reset: &ClayReset) -> Result<Self, SettingsError> {
        reset.validate()?;
        let mut next = self.clone();
        if let Some(shape) = &reset.shape {
            next.spec.clay.shape = shape.clone();
        }
        if let Some(material) = reset.material {
            proven_material(&material)?;
            next.spec.material = material;
        }
        if let Some(layers) = &reset.layers {
            proven_layers(layers)?;
            next.spec.clay.layers.clone_from(layers);
        }
        let LoopParameters {
            home_m, reach_m, ..
        } = parameters(&next.spec);
        next.parameters.home_m = home_m;
        next.parameters.reach_m = reach_m;
        next.parameters.material = next.spec.material;
        Ok(next)
    }

    /// The block as it is when fresh, its memory committed.
    ///
    /// # Errors
    /// The shape is none, there are too many voxels, or too few for the tool.
    pub fn fresh_block(&self) -> Result<Clay, SettingsError> {
        let clay = &self.spec.clay;
        let at = |field: &'static str| {
            move |error: &dyn std::fmt::Display| FieldError::new(field, error.to_string())
        };
        let mut block = fresh_clay(clay).map_err(|error| match error {
            FreshClayError::Shape(error) => at("/shape")(&error),
            FreshClayError::Classes(error) => at("/layers")(&error),
        })?;
        block
            .admits(&proven_tool(&self.spec.tool)?)
            .map_err(|error| at("/voxel_size_m")(&error))?;
        block.commit_pages();
        Ok(block)
    }

    /// How many voxels the block has, clay or air: a byte each, in every copy of it.
    ///
    /// # Errors
    /// The settings describe no block.
    pub fn voxels(&self) -> Result<u64, SettingsError> {
        let clay = &self.spec.clay;
        let no_block = |error: &dyn std::fmt::Display| FieldError::new("/shape", error.to_string());
        let shape = clay_shape(&clay.shape).map_err(|error| no_block(&error))?;
        let grid = shape
            .grid(clay.voxel_size_m)
            .map_err(|error| no_block(&error))?;
        Ok(grid
            .voxels()
            .iter()
            .map(|count| u64::from(*count))
            .product())
    }

    /// What the clay resists with.
    pub fn material(&self) -> Material {
        proven_material(&self.spec.material).expect("settings hold materials that were proven")
    }

    /// The shape of every tool.
    pub fn tool_shape(&self) -> ToolShape {
        proven_tool(&self.spec.tool).expect("settings hold tools that were proven")
    }

    /// What every tool does to the clay.
    pub fn operation(&self) -> Operation {
        operation(self.spec.operation)
    }

    /// What the lines do.
    pub fn lines(&self) -> Lines {
        lines(&self.spec.network)
    }

    /// How many tools there are.
    pub fn tools(&self) -> usize {
        usize::from(self.spec.tools)
    }

    /// The loop's parameters as the session tells them at `revision`. Frames carry the low 32 bits of it.
    pub fn parameters_at(&self, revision: u64) -> LoopParameters {
        LoopParameters {
            revision: revision as u32,
            ..self.parameters
        }
    }
}

fn proven_material(raw: &http::Material) -> Result<Material, FieldError> {
    material(raw).map_err(|error| FieldError::new("/material", error.to_string()))
}

fn proven_layers(raw: &[http::Layer]) -> Result<(), FieldError> {
    for (index, layer) in raw.iter().enumerate() {
        proven_material(&layer.material)
            .map_err(|error| error.under(&format!("/layers/{index}")))?;
    }
    Ok(())
}

fn proven_tool(raw: &ToolDescription) -> Result<ToolShape, FieldError> {
    tool_shape(raw).map_err(|error| FieldError::new("/tool", error.to_string()))
}

/// Where the handle's home maps to, and how far the tool may go: over the middle of a block with the tool just touching
/// it; before the first step of a stepped block with the tool's leading face at x = 0.
fn parameters(spec: &NewSession) -> LoopParameters {
    let size = spec.clay.shape.size_m();
    let lowest_m = spec.tool.below_position_m();
    let [half_depth_m, _] = spec.tool.beside_position_m();
    let home_m = match &spec.clay.shape {
        ClayShape::Block { .. } => [size[0] / 2.0, size[1] / 2.0, size[2] + lowest_m],
        ClayShape::Stepped { base_m, .. } => [-half_depth_m, size[1] / 2.0, base_m + lowest_m],
    };
    LoopParameters {
        axes: spec.axes,
        scheme: spec.scheme,
        deadband: spec.deadband,
        home_m,
        reach_m: [[-MARGIN_M; 3], size.map(|edge| edge + MARGIN_M)],
        tool: spec.tool,
        material: spec.material,
        ..LoopParameters::default()
    }
}

fn lines(raw: &Network) -> Lines {
    Lines {
        up: line(&raw.up),
        up_seed: raw.up.seed,
        down: line(&raw.down),
        down_seed: raw.down.seed,
    }
}

fn line(raw: &http::Impairment) -> conditioner::Impairment {
    conditioner::Impairment {
        delay: Duration::from_secs_f64(raw.delay_s),
        jitter: Duration::from_secs_f64(raw.jitter_s),
        distribution: match raw.jitter_distribution {
            JitterDistribution::Normal => conditioner::JitterDistribution::Normal,
            JitterDistribution::HeavyTailed => conditioner::JitterDistribution::HeavyTailed,
        },
        loss: raw.loss,
        duplicate: raw.duplicate,
        reorder: raw.reorder,
        bursts: raw.burst.map(|burst| conditioner::Bursts {
            enter: burst.enter,
            leave: burst.leave,
            loss: burst.loss_in_burst,
        }),
        outages: raw.outage.map(|outage| conditioner::Outages {
            every: Duration::from_secs_f64(outage.every_s),
            length: Duration::from_secs_f64(outage.length_s),
        }),
        ..conditioner::Impairment::default()
    }
}
