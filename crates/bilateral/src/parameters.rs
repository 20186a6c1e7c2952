//! From the parameters of a session to what both sides step with: sampled plants, limits, bounds. Parsed once.

use std::sync::Arc;
use std::time::Duration;

use teleclay_clay::classes::Layer;
use teleclay_clay::{
    Ball, Blade, BladeDimensions, Classes, ClassesError, Clay, Coefficients, Cylinder, Material,
    MaterialError, Operation, Shape, ShapeError, SteppedBlock, SteppedDimensions, Tool, ToolError,
    ToolShape, WireLoop,
};
use teleclay_control::{
    DiscreteStateSpace, DiscretiseError, Inverse, InverseError, RationalError, RationalFunction,
    StateSpace, StateSpaceError, paper,
};
use teleclay_link::Vec3;
use teleclay_link::deadband::{Deadband, DeadbandError, DeadbandSettings};
use teleclay_link::motion_limiter::MotionLimits;
use teleclay_link::replica::{CorrectionLimits, ToolSetup};
use teleclay_link::safety::{ForceLimits, WatchdogTimes};
use teleclay_link::scheme::{Coupling, SchemeContext};
use teleclay_proto::http::{self, ClayShape, ClaySpec};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Axes, ToolDescription};

/// Why a loop cannot be built from its parameters.
#[derive(Debug, thiserror::Error)]
pub enum ParameterError {
    /// A plant has no transfer function.
    #[error("plant {plant}: {source}")]
    Plant {
        /// The paper's name of it.
        plant: &'static str,
        /// What makes the numbers no rational function.
        source: RationalError,
    },
    /// A plant has no state space.
    #[error("plant {plant}: {source}")]
    StateSpace {
        /// The paper's name of it.
        plant: &'static str,
        /// What keeps the function from a state space.
        source: StateSpaceError,
    },
    /// A plant cannot be sampled.
    #[error("plant {plant}: {source}")]
    Sampling {
        /// The paper's name of it.
        plant: &'static str,
        /// What keeps the plant from being sampled.
        source: DiscretiseError,
    },
    /// The tool's plant cannot be followed.
    #[error("the tool cannot follow: {0}")]
    Inverse(#[from] InverseError),
    /// There is no such tool.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// There is no such clay.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// Frames cannot be left out like this.
    #[error(transparent)]
    Deadband(#[from] DeadbandError),
}

/// The shape that a description describes.
///
/// # Errors
/// A dimension is not finite, not above zero, or too large.
pub fn tool_shape(description: &ToolDescription) -> Result<ToolShape, ToolError> {
    Ok(match *description {
        ToolDescription::Ball { radius_m } => ToolShape::Ball(Ball::new(radius_m)?),
        ToolDescription::Blade {
            width_m,
            height_m,
            thickness_m,
        } => ToolShape::Blade(Blade::new(BladeDimensions {
            width_m,
            height_m,
            thickness_m,
        })?),
        ToolDescription::Cylinder { radius_m, height_m } => {
            ToolShape::Cylinder(Cylinder::new(radius_m, height_m)?)
        }
        ToolDescription::Loop {
            ring_radius_m,
            wire_diameter_m,
        } => ToolShape::Loop(WireLoop::new(ring_radius_m, wire_diameter_m)?),
    })
}

/// What tools do that are told to do this.
#[must_use]
pub const fn operation(of: http::Operation) -> Operation {
    match of {
        http::Operation::Cut => Operation::Cut,
        http::Operation::Add => Operation::Add,
        http::Operation::Smooth => Operation::Smooth,
    }
}

/// The clay that a description describes.
///
/// # Errors
/// A coefficient is not finite, below zero, or too large.
pub fn material(description: &teleclay_proto::Material) -> Result<Material, MaterialError> {
    Material::new(Coefficients {
        viscosity_pa_s_per_m: description.viscosity_pa_s_per_m,
        yield_stress_pa: description.yield_stress_pa,
        stiffness_pa: description.stiffness_pa,
    })
}

/// The block that a description describes, fresh.
///
/// # Errors
/// Steps that do not ascend, or lengths that are none.
pub fn clay_shape(description: &ClayShape) -> Result<Shape, ShapeError> {
    Ok(match description {
        ClayShape::Block { size_m } => Shape::Block { size_m: *size_m },
        ClayShape::Stepped {
            edges_m,
            depths_of_cut_m,
            base_m,
            width_m,
        } => Shape::Stepped(SteppedBlock::new(SteppedDimensions {
            edges_m: edges_m.clone(),
            depths_of_cut_m: depths_of_cut_m.clone(),
            base_m: *base_m,
            width_m: *width_m,
        })?),
    })
}

/// Why there is no block as a specification describes it.
#[derive(Debug, thiserror::Error)]
pub enum FreshClayError {
    /// Steps that do not ascend, lengths that are none, or too many voxels.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// Layers that cannot be.
    #[error(transparent)]
    Classes(#[from] ClassesError),
}

/// The block that a specification describes, fresh, with its layers.
///
/// # Errors
/// There is none of this shape, or its layers cannot be.
pub fn fresh_clay(spec: &ClaySpec) -> Result<Clay, FreshClayError> {
    let shape = clay_shape(&spec.shape)?;
    let mut clay = Clay::new(&shape, spec.voxel_size_m)?;
    if spec.layers.is_empty() {
        return Ok(clay);
    }
    let mut layers = Vec::with_capacity(spec.layers.len());
    for layer in &spec.layers {
        layers.push(Layer {
            thickness_m: layer.thickness_m,
            material: material(&layer.material).map_err(ClassesError::from)?,
        });
    }
    let classes = Classes::layers(clay.grid(), shape.size_m()[2], &layers)?;
    clay.assign_classes(Some(Arc::new(classes)))?;
    Ok(clay)
}

/// Where, with what and in what a tool works. Shared, so that it can be exchanged on a tick without being copied or
/// dropped there.
///
/// # Errors
/// The tool or the clay cannot be.
pub fn tool_setup(parameters: &LoopParameters) -> Result<Arc<ToolSetup>, ParameterError> {
    let home = Vec3::from(parameters.home_m);
    Ok(Arc::new(ToolSetup {
        home,
        motion_limits: MotionLimits {
            tick_s: parameters.tick_s,
            reach: parameters.reach_m.map(|bound| Vec3::from(bound) - home),
            speed_m_s: parameters.speed_limit_m_s,
        },
        is_lifted: parameters.axes == Axes::Two,
        tool: Tool::new(tool_shape(&parameters.tool)?),
        material: material(&parameters.material)?,
        force_limit_n: parameters.force_limit_n,
        ramp_s: parameters.ramp_s,
    }))
}

/// Everything that the two sides compute with, from one [`LoopParameters`].
#[derive(Clone, Debug)]
pub struct LoopModel {
    /// What the schemes see.
    pub(crate) context: SchemeContext,
    /// The tool's plant `G_t` by zero-order hold, and its inverse.
    pub(crate) tool_inverse: Inverse,
    pub(crate) watchdog: WatchdogTimes,
    pub(crate) limits: ForceLimits,
    pub(crate) axes: usize,
}

impl LoopModel {
    /// Samples the plants.
    ///
    /// # Errors
    /// A plant that is not one, or a tool that cannot be followed.
    pub fn new(parameters: &LoopParameters) -> Result<Self, ParameterError> {
        let tick_s = parameters.tick_s;
        let c_h1 = paper::c_h1(
            parameters.virtual_mass_kg,
            parameters.virtual_damping_n_s_per_m,
        );
        let g_t = paper::g_t(
            parameters.tool_mass_kg,
            parameters.tool_damping_n_s_per_m,
            parameters.tool_stiffness_n_per_m,
        );
        let servo_x = zoh("G_hx", &paper::g_hx(), tick_s)?;
        let servo_y = zoh("G_hy", &paper::g_hy(), tick_s)?;
        let coupling = Coupling {
            tick_s,
            position_ratio: parameters.position_ratio,
            force_ratio: -parameters.force_ratio.abs(),
            admittance: sampled("C_h1", &named("C_h1", c_h1)?, |system| {
                system.tustin(tick_s)
            })?,
            servo: [servo_x.clone(), servo_y, servo_x],
            tool_mass_kg: parameters.tool_mass_kg,
            wave_impedance_n_s_per_m: parameters.wave_impedance_n_s_per_m,
        };
        Ok(Self {
            context: SchemeContext {
                coupling,
                setup: tool_setup(parameters)?,
            },
            tool_inverse: Inverse::new(&zoh("G_t", &named("G_t", g_t)?, tick_s)?)?,
            watchdog: WatchdogTimes {
                silence: Duration::from_secs_f64(parameters.silence_s),
                ramp: Duration::from_secs_f64(parameters.ramp_s),
            },
            limits: ForceLimits {
                // What could not be let go of within the ramp is not built up.
                force_n: (parameters.slew_limit_n_per_s * parameters.ramp_s)
                    .min(parameters.force_limit_n),
                slew_n_per_s: parameters.slew_limit_n_per_s,
            },
            axes: match parameters.axes {
                Axes::Two => 2,
                Axes::Three => 3,
            },
        })
    }

    /// What decides which frames go out, where not every one does. The heartbeat is a quarter of the allowed silence at
    /// most.
    pub(crate) fn deadband(&self, fraction: f64) -> Result<Option<Deadband>, DeadbandError> {
        if fraction <= 0.0 {
            return Ok(None);
        }
        let settings = DeadbandSettings::default();
        let settings = DeadbandSettings {
            fraction,
            heartbeat: settings.heartbeat.min(self.watchdog.silence / 4),
            ..settings
        };
        Deadband::new(settings, self.watchdog.silence).map(Some)
    }

    /// What the schemes' controllers are made from.
    pub fn context(&self) -> &SchemeContext {
        &self.context
    }

    /// Tick, s.
    pub fn tick_s(&self) -> f64 {
        self.context.coupling.tick_s
    }

    pub(crate) fn coupling(&self) -> &Coupling {
        &self.context.coupling
    }

    pub(crate) fn setup(&self) -> &ToolSetup {
        &self.context.setup
    }

    /// What clay that changes by itself may do to the device, as the tool's side of the ratios has it.
    pub(crate) fn correction_limits(&self) -> CorrectionLimits {
        let at_device = CorrectionLimits::for_range(self.setup().force_limit_n);
        CorrectionLimits {
            step_n: at_device.step_n * -self.coupling().force_ratio,
            tank_j: at_device.tank_j * self.coupling().power_ratio(),
        }
    }

    /// The part of `v` on the axes that reflect force.
    pub(crate) fn reflected(&self, v: Vec3) -> Vec3 {
        Vec3::from_fn(|axis, _| if axis < self.axes { v[axis] } else { 0.0 })
    }

    /// The handle's travel on `axis`, m, as displacement from home: what maps into the tool's reach.
    pub(crate) fn handle_travel(&self, axis: usize) -> [f64; 2] {
        let [least, greatest] = self.setup().motion_limits.reach;
        [least, greatest].map(|bound| bound[axis] / self.coupling().position_ratio)
    }
}

fn named(
    plant: &'static str,
    function: Result<RationalFunction, RationalError>,
) -> Result<RationalFunction, ParameterError> {
    function.map_err(|source| ParameterError::Plant { plant, source })
}

fn zoh(
    plant: &'static str,
    function: &RationalFunction,
    tick_s: f64,
) -> Result<DiscreteStateSpace, ParameterError> {
    sampled(plant, function, |system| system.zoh(tick_s))
}

fn sampled(
    plant: &'static str,
    function: &RationalFunction,
    sample: impl FnOnce(&StateSpace<1>) -> Result<DiscreteStateSpace, DiscretiseError>,
) -> Result<DiscreteStateSpace, ParameterError> {
    let system = StateSpace::from_rational(function)
        .map_err(|source| ParameterError::StateSpace { plant, source })?;
    sample(&system).map_err(|source| ParameterError::Sampling { plant, source })
}
