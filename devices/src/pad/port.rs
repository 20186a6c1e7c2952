//! What a driver needs of an input device. Codes are those of Linux's `input-event-codes.h`.

use std::io;

use crate::fault::DeviceFault;
use crate::profile::Hardware;

/// What came from an input device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PadEvent {
    /// An axis has another value.
    Axis {
        /// Which axis: `ABS_…`.
        code: u16,
        /// As the device counts.
        value: i32,
    },
    /// A button went down or came up.
    Key {
        /// Which button: `BTN_…`.
        code: u16,
        /// Whether it is down.
        is_down: bool,
    },
    /// The kernel had no room for more (`SYN_DROPPED`): what follows in this batch says nothing.
    Dropped,
}

/// An axis: its range, and where it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisInfo {
    /// Which axis: `ABS_…`.
    pub code: u16,
    /// Least value.
    pub least: i32,
    /// Greatest value.
    pub most: i32,
    /// Value now.
    pub value: i32,
}

/// What a device has and how it stands.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PadState {
    /// Its axes.
    pub axes: Vec<AxisInfo>,
    /// Codes of the buttons that are down.
    pub down: Vec<u16>,
}

/// What a device is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PadNature {
    /// In its own words.
    pub name: String,
    /// Its buttons.
    pub keys: Vec<u16>,
    /// Its axes.
    pub axes: Vec<u16>,
    /// Whether it has `FF_RUMBLE`.
    pub rumbles: bool,
    /// Whether it has `FF_CONSTANT`.
    pub pushes: bool,
}

/// What a device is told to render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Strength of the slow motor and of the fast one, 0 to 65535.
    Rumble {
        /// Of the slow, heavy motor.
        strong: u16,
        /// Of the fast, light motor.
        weak: u16,
    },
    /// A steady push.
    Constant {
        /// Where to: 0 is towards the hand, 0x4000 left, 0x8000 away, 0xc000 right.
        direction: u16,
        /// How strongly, 0 to 32767.
        level: i16,
    },
}

/// Why a port fails.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PortError {
    /// It is gone: `ENODEV`.
    #[error("unplugged")]
    Unplugged,
    /// `EACCES`, `EPERM`.
    #[error("no permission")]
    NoPermission,
    /// Somebody else has grabbed it: `EBUSY`.
    #[error("in use by another program")]
    Busy,
    /// Anything else.
    #[error("{0}")]
    Other(String),
}

impl PortError {
    /// Numbers that are the same on every Linux.
    const ENXIO: i32 = 6;
    const EBUSY: i32 = 16;
    const ENODEV: i32 = 19;

    /// What to say of an opening that failed.
    #[must_use]
    pub fn at_opening(self, hardware: Hardware, place: &str) -> DeviceFault {
        let device = hardware.word();
        let place = place.to_owned();
        match self {
            Self::NoPermission => DeviceFault::NoPermission { device, place },
            Self::Busy => DeviceFault::Busy { device, place },
            Self::Unplugged | Self::Other(_) => DeviceFault::Lost {
                device,
                reason: format!("{self} while it was opened at {place}"),
            },
        }
    }
}

impl From<io::Error> for PortError {
    fn from(error: io::Error) -> Self {
        match (error.kind(), error.raw_os_error()) {
            (io::ErrorKind::PermissionDenied, _) => Self::NoPermission,
            (_, Some(Self::ENODEV | Self::ENXIO)) => Self::Unplugged,
            (_, Some(Self::EBUSY)) => Self::Busy,
            _ => Self::Other(error.to_string()),
        }
    }
}

/// An input device.
pub trait InputPort: Send + 'static {
    /// What it is.
    fn nature(&self) -> PadNature;

    /// Everything that came since the last call, oldest first; nothing, where nothing came.
    ///
    /// # Errors
    /// The device is gone.
    fn read(&mut self, events: &mut Vec<PadEvent>) -> Result<(), PortError>;

    /// How it stands, read anew.
    ///
    /// # Errors
    /// The device is gone.
    fn state(&mut self) -> Result<PadState, PortError>;

    /// Renders this instead of what it renders, for [`LASTS_MS`](super::effect::LASTS_MS) at most.
    ///
    /// # Errors
    /// The device is gone, or does not take it.
    fn play(&mut self, effect: Effect) -> Result<(), PortError>;

    /// Renders nothing.
    ///
    /// # Errors
    /// The device is gone, and renders nothing for that reason.
    fn silence(&mut self) -> Result<(), PortError>;
}

/// The port of systems that have none.
#[derive(Debug)]
pub enum Nowhere {}

impl InputPort for Nowhere {
    fn nature(&self) -> PadNature {
        match *self {}
    }

    fn read(&mut self, _events: &mut Vec<PadEvent>) -> Result<(), PortError> {
        match *self {}
    }

    fn state(&mut self) -> Result<PadState, PortError> {
        match *self {}
    }

    fn play(&mut self, _effect: Effect) -> Result<(), PortError> {
        match *self {}
    }

    fn silence(&mut self) -> Result<(), PortError> {
        match *self {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_error_of_the_system_says_where_and_what_to_do() {
        let said = |number: i32| {
            let error = PortError::from(io::Error::from_raw_os_error(number));
            let fault = error.at_opening(Hardware::Gamepad, "/dev/input/event5");
            fault.to_string()
        };
        assert_eq!(
            said(13),
            "no permission to open the gamepad at /dev/input/event5: add this user to the group `input` and log in again, or start from the seat that the device is plugged into"
        );
        assert_eq!(
            said(16),
            "the gamepad at /dev/input/event5 is in use by another program: close that program and start again"
        );
        assert_eq!(
            said(19),
            "the gamepad is lost: unplugged while it was opened at /dev/input/event5"
        );
    }
}
