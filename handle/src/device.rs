//! What a haptic device must do, whatever it is made of.
//!
//! The 1 kHz thread owns the device and, each tick, samples it once, commands it once and asks it once for requests.
//! None of these calls may block, allocate or lock. A device opens in [`open`], on another thread, and is at rest from
//! then until its first command; dropping it must leave it without power.

mod choice;
mod held;
pub mod list;
mod robot;
mod room;
mod simulated;

use std::fmt;
use std::str::FromStr;

use teleclay_device::{DeviceDescription, DeviceProfile, DeviceSample, Feedback};
use teleclay_devices::haply::ServiceAddress;
use teleclay_devices::{DeviceFault, Hardware};
use teleclay_operator::{IntentError, RobotError, RobotState, SimulatedHandleError};
use teleclay_proto::Axes;
use teleclay_proto::join::Granted;
use teleclay_proto::{ToolDescription, join::LoopParameters};

use crate::intent::Intent;

pub use choice::DeviceChoice;
pub use held::HeldDevice;
pub use robot::RobotDevice;
pub use simulated::SimulatedDevice;
pub use teleclay_device::DeviceCommand;

/// What whoever holds the device asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceRequest {
    /// A fresh block of clay: this one is cut.
    FreshClay,
    /// A fresh block of clay, because a hand asks for one, whatever it has cut.
    FreshClayForHand,
}

/// A haptic device.
pub trait Device: Send {
    /// What it is, for people to read; 1 to 64 characters.
    fn name(&self) -> &str;

    /// What its sensors read now.
    ///
    /// # Errors
    /// The device is gone or broken. Values that are not finite are no error here: the loop checks them.
    fn sample(&mut self) -> Result<DeviceSample, DeviceError>;

    /// Takes the command for the tick that begins now.
    ///
    /// # Errors
    /// The device is gone or broken.
    fn command(&mut self, command: &DeviceCommand) -> Result<(), DeviceError>;

    /// What whoever holds it asks for, each thing once.
    fn poll_request(&mut self) -> Option<DeviceRequest>;

    /// The loop that it works for ends or changes: a hand that holds it lets go, and nothing moves until it takes hold
    /// anew. A simulated operator needs no asking.
    fn let_go(&mut self) {}

    /// How its arms stand, when it has some.
    fn robot(&self) -> Option<RobotState> {
        None
    }
}

/// Why a device cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// It does not answer (any more).
    #[error("{device} is lost: {reason}")]
    Lost {
        /// Its name.
        device: String,
        /// In its driver's words.
        reason: String,
    },
    /// What its operator is to do cannot be done.
    #[error(transparent)]
    Intent(#[from] IntentError),
    /// The loop's parameters make no simulated handle.
    #[error(transparent)]
    Simulation(#[from] SimulatedHandleError),
    /// There is no such robot.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// A device that a hand holds cannot be used, or no longer.
    #[error(transparent)]
    Hardware(#[from] DeviceFault),
}

/// The devices there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceKind {
    /// The servo and arm of \[KHMH03\] in software, with an operator who follows an intent.
    #[default]
    Simulated,
    /// The same operator and servo on the three arms of the parallel robot, with joints that have limits.
    Robot,
    /// One that a hand holds.
    Held(Hardware),
}

impl DeviceKind {
    /// Every kind.
    pub const ALL: [Self; 5] = [
        Self::Simulated,
        Self::Robot,
        Self::Held(Hardware::Gamepad),
        Self::Held(Hardware::Haply),
        Self::Held(Hardware::Joystick),
    ];

    /// Whether a hand is on it, which has to take hold before anything moves.
    pub const fn is_held(self) -> bool {
        matches!(self, Self::Held(_))
    }

    /// What it may do to a hand, whatever it is told. A flag can only lower it.
    pub const fn profile(self) -> DeviceProfile {
        match self {
            // What a session asks for unless it is told otherwise; neither device is one that a hand is in.
            Self::Simulated | Self::Robot => DeviceProfile {
                force_n: 20.0,
                slew_n_per_s: 2000.0,
                speed_m_s: 2.0,
                power_w: 15.0,
                silence_s: 0.1,
                ramp_s: 0.05,
            },
            Self::Held(hardware) => hardware.profile(),
        }
    }

    /// As it describes itself.
    pub const fn description(self) -> DeviceDescription {
        let workspace_m = match self {
            Self::Simulated => None,
            // What its joints leave for sure.
            Self::Robot => Some([0.045, 0.018, 0.012]),
            Self::Held(hardware) => return hardware.description(),
        };
        DeviceDescription {
            name: self.word(),
            axes: 3,
            workspace_m,
            feedback: Feedback::Force {
                axes: 3,
                most_n: self.profile().force_n,
            },
            rate_hz: 1000.0,
            measures_force: true,
        }
    }

    /// The word that stands for it in arguments.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Simulated => "simulated",
            Self::Robot => "robot",
            Self::Held(hardware) => hardware.word(),
        }
    }
}

impl fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.word())
    }
}

/// A word that names no device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{got}` is not a device, have simulated, robot, gamepad, haply and joystick; list shows them"
)]
pub struct UnknownDevice {
    /// The word.
    pub got: String,
}

impl FromStr for DeviceKind {
    type Err = UnknownDevice;

    fn from_str(word: &str) -> Result<Self, UnknownDevice> {
        let known = Self::ALL.into_iter().find(|kind| kind.word() == word);
        known.ok_or_else(|| UnknownDevice {
            got: word.to_owned(),
        })
    }
}

/// What a device needs to know of the session that it works in. A device goes on under another lease as long as these
/// stay the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceSetup {
    /// Length of a tick, s.
    pub tick_s: f64,
    /// How many axes reflect force.
    pub axes: Axes,
    /// Tool displacement per handle displacement.
    pub position_ratio: f64,
    /// Tool position in the clay's frame with the handle at home, m.
    pub home_m: [f64; 3],
    /// Least and greatest tool position, m.
    pub reach_m: [[f64; 3]; 2],
    /// The tool.
    pub tool: ToolDescription,
    /// Extent of the block, which starts at the origin of the clay's frame, m.
    pub block_m: [f64; 3],
    /// Damping of the loop's handle, N·s/m.
    pub handle_damping_n_s_per_m: f64,
}

impl DeviceSetup {
    /// The setup that a lease gives.
    pub fn of(granted: &Granted) -> Self {
        let LoopParameters {
            tick_s,
            axes,
            position_ratio,
            home_m,
            reach_m,
            tool,
            virtual_damping_n_s_per_m,
            ..
        } = granted.parameters;
        let block_m = granted.clay.shape.size_m();
        Self {
            tick_s,
            axes,
            position_ratio,
            home_m,
            reach_m,
            tool,
            block_m,
            handle_damping_n_s_per_m: virtual_damping_n_s_per_m,
        }
    }

    fn handle_axes(&self) -> teleclay_operator::Axes {
        match self.axes {
            Axes::Two => teleclay_operator::Axes::Two,
            Axes::Three => teleclay_operator::Axes::Three,
        }
    }
}

/// What a device is opened with beside the session's setup.
#[derive(Clone, Debug)]
pub struct Opening {
    /// Which device.
    pub kind: DeviceKind,
    /// What the operator of a simulated device does.
    pub intent: Intent,
    /// What the device may do to the hand.
    pub profile: DeviceProfile,
    /// Where the Haply Inverse Service is.
    pub haply: ServiceAddress,
}

impl Opening {
    /// Opens the device for a setup.
    ///
    /// # Errors
    /// The device is not there, or cannot do what is asked.
    pub fn open(&self, setup: &DeviceSetup) -> Result<Box<dyn Device>, DeviceError> {
        match self.kind {
            DeviceKind::Simulated => Ok(Box::new(SimulatedDevice::new(&self.intent, setup)?)),
            DeviceKind::Robot => Ok(Box::new(RobotDevice::new(&self.intent, setup)?)),
            DeviceKind::Held(hardware) => {
                let held = HeldDevice::open(hardware, setup, self.profile, &self.haply)?;
                Ok(Box::new(held))
            }
        }
    }
}

/// Opens a device for a setup, within its own profile.
///
/// # Errors
/// As [`Opening::open`].
pub fn open(
    kind: DeviceKind,
    intent: &Intent,
    setup: &DeviceSetup,
) -> Result<Box<dyn Device>, DeviceError> {
    let opening = Opening {
        kind,
        intent: intent.clone(),
        profile: kind.profile(),
        haply: ServiceAddress::default(),
    };
    opening.open(setup)
}

/// The rounds of a cutting operator, each of which ends with a request for fresh clay.
#[derive(Clone, Copy, Debug, Default)]
struct Rounds {
    asked_for: u64,
}

impl Rounds {
    /// The request that goes with so many finished rounds, each once.
    fn request(&mut self, finished: u64) -> Option<DeviceRequest> {
        if finished <= self.asked_for {
            return None;
        }
        self.asked_for = finished;
        Some(DeviceRequest::FreshClay)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_named_by_its_word() {
        for kind in DeviceKind::ALL {
            assert_eq!(kind.word().parse(), Ok(kind));
        }
        let error = "omega.7".parse::<DeviceKind>().unwrap_err();
        assert_eq!(
            error.to_string(),
            "`omega.7` is not a device, have simulated, robot, gamepad, haply and joystick; list shows them"
        );
    }
}
