//! What a server grants, as far as a pointer takes it. A force must never rest on trust.

use teleclay_bilateral::{NotReceived, ParameterError, is_device_tick, lower};
use teleclay_device::DeviceProfile;
use teleclay_impedance::{CouplingSetup, Scale, SetupError};
use teleclay_proto::Axes;
use teleclay_proto::http::{BodyError, parse};
use teleclay_proto::join::{Granted, LoopParameters};

/// What a pointer may do to a hand, whatever it is told: the law of the simulated handle. Nothing raises it.
pub const PROFILE: DeviceProfile = DeviceProfile {
    force_n: 20.0,
    slew_n_per_s: 2000.0,
    speed_m_s: 2.0,
    power_w: 15.0,
    silence_s: 0.1,
    ramp_s: 0.05,
};

/// Spring by which a pointer draws the handle at most, N/m: hand and handle part by 13 mm under 2 N.
const STIFFNESS_N_PER_M: f64 = 150.0;
/// Share of the stiffest spring that lets go in time, where that is softer.
const MARGIN: f64 = 0.9;
/// Slower than this no page tells a pointer, and faster none does, 1/s.
const RATES_HZ: std::ops::RangeInclusive<f64> = 20.0..=1000.0;

/// Why a pointer does not move by what was granted.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// What came is no grant.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// No device keeps up with the loop.
    #[error("its loop ticks every {tick_s} s, wanted 0.0005 to 0.002 s")]
    Tick {
        /// As granted.
        tick_s: f64,
    },
    /// The page tells the pointer too seldom or too often.
    #[error("the pointer is told {got_hz} times a second, wanted 20 to 1000")]
    Rate {
        /// As given.
        got_hz: f64,
    },
    /// The parameters make no loop.
    #[error("the server's parameters make no loop: {0}")]
    Parameters(#[from] ParameterError),
    /// No coupling holds such a handle.
    #[error("no pointer can hold this handle: {0}")]
    Coupling(#[from] SetupError),
    /// The grant is not one of the same loop, later.
    #[error(
        "the grant is of another loop, tool or block, or of a session made anew: begin anew, too"
    )]
    AnotherLoop,
    /// What came is not the clay.
    #[error(transparent)]
    Clay(#[from] NotReceived),
    /// Bricks came, and nobody had said of what.
    #[error("no snapshot was begun")]
    NoSnapshot,
    /// The loop is in fault or on its way to rest.
    #[error("the handle is being brought to rest")]
    AtRest,
}

/// A lease, and how to run the loop under it, lowered to what the device allows.
#[derive(Clone, Debug, PartialEq)]
pub struct Grant(Granted);

impl Grant {
    /// From a `granted` of a join.
    ///
    /// # Errors
    /// It is none, or no device keeps up with the loop.
    pub fn parse(json: &[u8], profile: DeviceProfile) -> Result<Self, Refused> {
        let mut granted: Granted = parse(json)?;
        let tick_s = granted.parameters.tick_s;
        if !is_device_tick(tick_s) {
            return Err(Refused::Tick { tick_s });
        }
        lower(&mut granted.parameters, profile);
        Ok(Self(granted))
    }

    /// What was granted, lowered.
    #[must_use]
    pub fn granted(&self) -> &Granted {
        &self.0
    }
}

/// What the device is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointerSetup {
    /// Slowest rate at which the page tells where it is, 1/s.
    pub rate_hz: f64,
    /// What it may do to a hand.
    pub profile: DeviceProfile,
    /// Handle motion per motion of the pointer.
    pub motion: f64,
}

impl Default for PointerSetup {
    /// A mouse, a finger or a pen on a page that is drawn 60 times a second; it renders no force.
    fn default() -> Self {
        Self {
            rate_hz: 60.0,
            profile: PROFILE,
            motion: 1.0,
        }
    }
}

impl PointerSetup {
    pub(crate) fn coupling(&self, parameters: &LoopParameters) -> Result<CouplingSetup, Refused> {
        if !RATES_HZ.contains(&self.rate_hz) {
            return Err(Refused::Rate {
                got_hz: self.rate_hz,
            });
        }
        let damping = parameters.virtual_damping_n_s_per_m;
        let mut setup =
            CouplingSetup::without_feedback(self.rate_hz, damping, parameters.tick_s, self.profile);
        setup.axes = match parameters.axes {
            Axes::Two => 2,
            Axes::Three => 3,
        };
        setup.handle_speed_m_s = self.profile.speed_m_s;
        setup.scale = Scale {
            motion: self.motion,
            force: 0.0,
        };
        // What a spring stores is to be paid by the handle's damping while it is let go of.
        let softest = 2.0 * damping / (setup.hold_s + setup.ramp_s / 3.0);
        setup.stiffness_n_per_m = STIFFNESS_N_PER_M.min(MARGIN * softest);
        Ok(setup)
    }
}
