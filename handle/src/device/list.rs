//! `--device list`: which devices there are.

use std::fmt::Write;
use std::path::Path;

use teleclay_devices::haply::{ServiceAddress, socket};
use teleclay_devices::{DeviceFault, Hardware, pad};

use super::DeviceKind;

/// Every kind of device: whether one is there, where it was looked for, what it is.
#[must_use]
pub fn list(haply: &ServiceAddress) -> String {
    written(|hardware| match hardware {
        Hardware::Gamepad | Hardware::Joystick => pad::look(hardware, Path::new(pad::FOLDER)),
        Hardware::Haply => socket::look(haply),
    })
}

fn written(look: impl Fn(Hardware) -> Result<String, DeviceFault>) -> String {
    let mut list = String::new();
    for kind in DeviceKind::ALL {
        let (there, tried) = match kind {
            DeviceKind::Simulated | DeviceKind::Robot => {
                ("there: it is software".to_owned(), "needs no hardware")
            }
            DeviceKind::Held(hardware) => {
                let there = match look(hardware) {
                    Ok(found) => format!("there: {found}"),
                    Err(fault) => fault.to_string(),
                };
                (there, "not tried on hardware: tested against a stand-in")
            }
        };
        let description = kind.description();
        // Writing to a string cannot fail.
        let _ = writeln!(list, "{kind}\n  {there}\n  {description}\n  {tried}");
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_is_listed_with_where_it_was_looked_for_and_what_it_is() {
        let list = written(|hardware| match hardware {
            Hardware::Gamepad => Ok("`Pad` at /dev/input/event3".to_owned()),
            hardware => Err(DeviceFault::NotFound {
                device: hardware.word(),
                looked: "somewhere".to_owned(),
                advice: "plug one in",
            }),
        });
        let want = "\
simulated
  there: it is software
  moves 3 axes, without limits; force 0 to 20 N on 3 axes; 1000 Hz; measures force
  needs no hardware
robot
  there: it is software
  moves 3 axes, ±0.045 x ±0.018 x ±0.012 m; force 0 to 20 N on 3 axes; 1000 Hz; measures force
  needs no hardware
gamepad
  there: `Pad` at /dev/input/event3
  moves 3 axes, ±0.06 x ±0.06 x ±0.06 m; rumble, no force; 100 Hz; cannot measure force
  not tried on hardware: tested against a stand-in
haply
  no haply is there, looked somewhere: plug one in
  moves 3 axes, ±0.1 x ±0.1 x ±0.1 m; force 0 to 5 N on 3 axes; 250 Hz; cannot measure force
  not tried on hardware: tested against a stand-in
joystick
  no joystick is there, looked somewhere: plug one in
  moves 3 axes, ±0.044 x ±0.044 x ±0.044 m; force 0 to 2 N on 2 axes; 100 Hz; cannot measure force
  not tried on hardware: tested against a stand-in
";
        assert_eq!(list, want);
    }
}
