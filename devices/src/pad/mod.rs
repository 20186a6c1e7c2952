//! Gamepad and joystick, over Linux's evdev.
//!
//! | module | holds |
//! |---|---|
//! | [`port`] | what a driver needs of an input device: events in, effects out; tests feed a stand-in |
//! | [`layout`] | which axis and which button means what |
//! | [`sticks`] | from the values of axes to a place |
//! | [`driver`] | the driver, as a state machine over a port |
//! | [`effect`] | from a force to rumble, or to a constant force |
//! | [`scan`] | which of what lies in /dev/input is to be taken, and why none is |
//! | `evdev` | a port on a file of /dev/input; Linux only |
//!
//! | hand | gamepad | joystick |
//! |---|---|---|
//! | place, x and y | left stick | stick |
//! | lift | right stick up and down; left trigger up, right trigger down | lever, or else twist |
//! | takes hold | south button (A, cross) | trigger |
//! | lets go | east button (B, circle) | second thumb button |
//! | clutch, while pressed | left shoulder button | first thumb button |
//! | fresh clay | start | top button |

pub mod driver;
pub mod effect;
pub mod layout;
pub mod port;
pub mod scan;
pub mod sticks;

#[cfg(target_os = "linux")]
pub mod evdev;

use std::path::Path;

use crate::fault::DeviceFault;
use crate::profile::{Hardware, SessionNeeds};
use driver::PadDriver;

/// Where Linux puts input devices.
pub const FOLDER: &str = "/dev/input";

/// A gamepad or a joystick: one of the two that lie in `folder`, opened.
///
/// # Errors
/// None is there, or none that may be opened and does what is needed.
#[cfg(target_os = "linux")]
pub fn open(
    hardware: Hardware,
    folder: &Path,
    needs: &SessionNeeds,
) -> Result<PadDriver<evdev::EvdevPort>, DeviceFault> {
    let found = scan::pick(hardware, folder, &evdev::scan(folder))?;
    let place = found.path.display().to_string();
    let port =
        evdev::EvdevPort::open(&found.path).map_err(|error| error.at_opening(hardware, &place))?;
    PadDriver::new(hardware, port, needs)
}

/// Elsewhere there is no evdev.
///
/// # Errors
/// Always.
#[cfg(not(target_os = "linux"))]
pub fn open(
    hardware: Hardware,
    _folder: &Path,
    _needs: &SessionNeeds,
) -> Result<PadDriver<port::Nowhere>, DeviceFault> {
    Err(scan::not_on_this_system(hardware))
}

/// Whether one could be opened, for a list: its name and place.
///
/// # Errors
/// None is there, or none that may be opened and does what is needed.
pub fn look(hardware: Hardware, folder: &Path) -> Result<String, DeviceFault> {
    #[cfg(target_os = "linux")]
    {
        let found = scan::pick(hardware, folder, &evdev::scan(folder))?;
        Ok(format!("`{}` at {}", found.name, found.path.display()))
    }
    #[cfg(not(target_os = "linux"))]
    {
        let _ = folder;
        Err(scan::not_on_this_system(hardware))
    }
}
