//! Which of the input devices is to be taken, and why none is.

use std::path::{Path, PathBuf};

use super::layout::{Layout, is_of};
use super::port::{PadNature, PortError};
use crate::fault::DeviceFault;
use crate::profile::Hardware;

/// What was found where: each file with what it is, or why nobody knows.
pub type Scan = Vec<(PathBuf, Result<PadNature, PortError>)>;

/// A device that does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Its file.
    pub path: PathBuf,
    /// What it calls itself.
    pub name: String,
}

/// The first device of this kind that does what is needed.
///
/// # Errors
/// None does: the reason of the one that comes nearest.
pub fn pick(hardware: Hardware, folder: &Path, scan: &Scan) -> Result<Found, DeviceFault> {
    let device = hardware.word();
    let mut unfit = None;
    for (path, nature) in scan {
        let Ok(nature) = nature else {
            continue;
        };
        if !is_of(hardware, nature) {
            continue;
        }
        let (name, place) = (nature.name.clone(), path.display().to_string());
        if hardware == Hardware::Joystick && !nature.pushes {
            unfit = unfit.or(Some(DeviceFault::CannotForce { name, place }));
        } else if Layout::of(hardware, nature).is_none() {
            unfit = unfit.or(Some(DeviceFault::CannotLift {
                device,
                name,
                place,
            }));
        } else {
            let path = path.clone();
            return Ok(Found { path, name });
        }
    }
    if let Some(unfit) = unfit {
        return Err(unfit);
    }
    // What may not be read may be the one.
    let nearest = [PortError::Busy, PortError::NoPermission]
        .into_iter()
        .find_map(|wanted| {
            let mut such = scan
                .iter()
                .filter(|(_, nature)| nature.as_ref().err() == Some(&wanted));
            let (path, _) = such.next()?;
            Some(wanted.at_opening(hardware, &path.display().to_string()))
        });
    Err(nearest.unwrap_or_else(|| DeviceFault::NotFound {
        device,
        looked: format!(
            "through the {} input devices of {}",
            scan.len(),
            folder.display()
        ),
        advice: "plug one in or pair it; `teleclay-handle --device list` shows when it is there",
    }))
}

/// There is none, because the system has no evdev.
#[must_use]
pub fn not_on_this_system(hardware: Hardware) -> DeviceFault {
    DeviceFault::NotFound {
        device: hardware.word(),
        looked: "nowhere, since this system has no evdev".to_owned(),
        advice: "run teleclay-handle on Linux, or take another device",
    }
}

#[cfg(test)]
mod tests {
    use super::super::layout::{RY, RZ, SOUTH, THROTTLE, TRIGGER, X, Y};
    use super::*;

    fn nature(name: &str, key: u16, axes: &[u16], pushes: bool) -> PadNature {
        PadNature {
            name: name.to_owned(),
            keys: vec![key],
            axes: axes.to_vec(),
            rumbles: true,
            pushes,
        }
    }

    fn said(hardware: Hardware, scan: &[(&str, Result<PadNature, PortError>)]) -> String {
        let scan = scan
            .iter()
            .map(|(path, nature)| (PathBuf::from(path), nature.clone()))
            .collect();
        match pick(hardware, Path::new("/dev/input"), &scan) {
            Ok(found) => found.name,
            Err(fault) => fault.to_string(),
        }
    }

    #[test]
    fn the_first_that_does_is_taken_past_those_that_do_not() {
        let scan = [
            ("/dev/input/event0", Ok(nature("keyboard", 30, &[], false))),
            ("/dev/input/event1", Err(PortError::NoPermission)),
            (
                "/dev/input/event2",
                Ok(nature("plain stick", TRIGGER, &[X, Y, RZ], false)),
            ),
            (
                "/dev/input/event3",
                Ok(nature("force stick", TRIGGER, &[X, Y, THROTTLE], true)),
            ),
            (
                "/dev/input/event4",
                Ok(nature("pad", SOUTH, &[X, Y, RY], false)),
            ),
        ];
        assert_eq!(said(Hardware::Joystick, &scan), "force stick");
        assert_eq!(said(Hardware::Gamepad, &scan), "pad");
    }

    #[test]
    fn what_is_missing_is_said_with_where_it_was_looked_for_and_what_to_do() {
        let none = said(Hardware::Gamepad, &[]);
        assert_eq!(
            none,
            "no gamepad is there, looked through the 0 input devices of /dev/input: plug one in or pair it; `teleclay-handle --device list` shows when it is there"
        );
        let plain = Ok(nature("plain", TRIGGER, &[X, Y, RZ], false));
        let refused = said(Hardware::Joystick, &[("/dev/input/event2", plain)]);
        assert_eq!(
            refused,
            "the joystick `plain` at /dev/input/event2 has no constant force (FF_CONSTANT), and nothing else renders a force: take one that has"
        );
        let level = Ok(nature("level", TRIGGER, &[X, Y], true));
        let refused = said(Hardware::Joystick, &[("/dev/input/event2", level)]);
        assert!(
            refused.contains("neither lever, twist nor trigger"),
            "{refused}"
        );
        let barred = [("/dev/input/event7", Err(PortError::NoPermission))];
        let refused = said(Hardware::Gamepad, &barred);
        assert!(
            refused.starts_with("no permission to open the gamepad at /dev/input/event7: add"),
            "{refused}"
        );
    }
}
