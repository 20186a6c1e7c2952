//! From the parameters of a session to what both sides step with: sampled plants, limits, bounds. Parsed once.

use std::time::Duration;

use teleclay_control::{
    DiscreteStateSpace, DiscretiseError, FollowerError, Inverse, RationalError, RationalFunction,
    StateSpace, StateSpaceError, paper,
};
use teleclay_link::Vec3;
use teleclay_link::safety::{ForceLimits, WatchdogTimes};
use teleclay_link::scheme::{Coupling, SchemeUnavailable};
use teleclay_proto::Axes;
use teleclay_proto::join::LoopParameters;

/// Why a loop cannot be built from its parameters.
#[derive(Debug, thiserror::Error)]
pub enum ParameterError {
    /// A plant has no transfer function.
    #[error("plant {plant}: {source}")]
    Plant {
        /// The paper's name of it.
        plant: &'static str,
        /// Why.
        source: RationalError,
    },
    /// A plant has no state space.
    #[error("plant {plant}: {source}")]
    StateSpace {
        /// The paper's name of it.
        plant: &'static str,
        /// Why.
        source: StateSpaceError,
    },
    /// A plant cannot be sampled.
    #[error("plant {plant}: {source}")]
    Sampling {
        /// The paper's name of it.
        plant: &'static str,
        /// Why.
        source: DiscretiseError,
    },
    /// The tool's plant cannot be followed.
    #[error("the tool cannot follow: {0}")]
    Follower(#[from] FollowerError),
    /// The scheme is not available.
    #[error(transparent)]
    Scheme(#[from] SchemeUnavailable),
}

/// Everything that the two sides compute with, from one [`LoopParameters`].
#[derive(Clone, Debug)]
pub struct LoopModel {
    /// What the schemes see.
    pub(crate) coupling: Coupling,
    /// The tool's plant `G_t` by zero-order hold, and its inverse.
    pub(crate) tool_inverse: Inverse,
    pub(crate) watchdog: WatchdogTimes,
    pub(crate) limits: ForceLimits,
    pub(crate) home: Vec3,
    pub(crate) reach: [Vec3; 2],
    pub(crate) speed_limit_m_s: f64,
    pub(crate) axes: usize,
    pub(crate) ramp_s: f64,
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
        };
        Ok(Self {
            coupling,
            tool_inverse: Inverse::new(&zoh("G_t", &named("G_t", g_t)?, tick_s)?)?,
            watchdog: WatchdogTimes {
                silence: Duration::from_secs_f64(parameters.silence_s),
                ramp: Duration::from_secs_f64(parameters.ramp_s),
            },
            limits: ForceLimits {
                force_n: parameters.force_limit_n,
                slew_n_per_s: parameters.slew_limit_n_per_s,
            },
            home: Vec3::from(parameters.home_m),
            reach: parameters.reach_m.map(Vec3::from),
            speed_limit_m_s: parameters.speed_limit_m_s,
            axes: match parameters.axes {
                Axes::Two => 2,
                Axes::Three => 3,
            },
            ramp_s: parameters.ramp_s,
        })
    }

    /// Tick, s.
    pub fn tick_s(&self) -> f64 {
        self.coupling.tick_s
    }

    /// The handle's travel on `axis`, m, as displacement from home: what maps into the tool's reach.
    pub(crate) fn handle_travel(&self, axis: usize) -> [f64; 2] {
        self.reach
            .map(|bound| (bound[axis] - self.home[axis]) / self.coupling.position_ratio)
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
