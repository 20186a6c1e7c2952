//! A device that a hand holds: a driver's thread, and the virtual coupling that the tick steps.

use std::path::Path;

use teleclay_device::{DeviceProfile, DeviceSample};
use teleclay_devices::haply::{HaplyDriver, ServiceAddress};
use teleclay_devices::pad;
use teleclay_devices::thread::{Driver, DriverThread};
use teleclay_devices::{Coupled, DeviceFault, Hardware, SessionNeeds};
use teleclay_proto::Axes;
use tracing::warn;

use super::room::stick_room_m;
use super::{Device, DeviceCommand, DeviceError, DeviceRequest, DeviceSetup};

/// A gamepad, a joystick or an Inverse3. Dropping it leaves the device without force.
#[derive(Debug)]
pub struct HeldDevice {
    hardware: Hardware,
    coupled: Coupled,
    thread: DriverThread,
}

impl HeldDevice {
    /// Looks for the device and takes it into use, released: whoever holds it takes hold with a button.
    ///
    /// # Errors
    /// The device is not there, or does not do for this session.
    pub fn open(
        hardware: Hardware,
        setup: &DeviceSetup,
        profile: DeviceProfile,
        haply: &ServiceAddress,
    ) -> Result<Self, DeviceFault> {
        let needs = needs(setup);
        // What the session alone refuses is said before anything is looked for.
        hardware.coupling(&needs, profile)?;
        match hardware {
            Hardware::Gamepad | Hardware::Joystick => {
                let driver = pad::open(hardware, Path::new(pad::FOLDER), &needs)?;
                Self::drive(hardware, driver, &needs, profile)
            }
            Hardware::Haply => {
                let driver = HaplyDriver::open(haply)?;
                for remark in driver.remarks() {
                    warn!("{remark}");
                }
                Self::drive(hardware, driver, &needs, profile)
            }
        }
    }

    fn drive<D: Driver>(
        hardware: Hardware,
        driver: D,
        needs: &SessionNeeds,
        profile: DeviceProfile,
    ) -> Result<Self, DeviceFault> {
        let (thread, ends) = DriverThread::spawn(driver, profile.force_n)?;
        let coupled = Coupled::new(hardware, needs, profile, ends)?;
        Ok(Self {
            hardware,
            coupled,
            thread,
        })
    }
}

impl Device for HeldDevice {
    fn name(&self) -> &str {
        self.hardware.word()
    }

    fn sample(&mut self) -> Result<DeviceSample, DeviceError> {
        Ok(self.coupled.sample(self.thread.now_ns())?)
    }

    fn command(&mut self, command: &DeviceCommand) -> Result<(), DeviceError> {
        self.coupled.command(self.thread.now_ns(), command);
        Ok(())
    }

    fn poll_request(&mut self) -> Option<DeviceRequest> {
        let wants_clay = self.coupled.poll_wants_clay();
        wants_clay.then_some(DeviceRequest::FreshClayForHand)
    }

    fn let_go(&mut self) {
        self.coupled.let_go();
    }
}

fn needs(setup: &DeviceSetup) -> SessionNeeds {
    SessionNeeds {
        tick_s: setup.tick_s,
        axes: match setup.axes {
            Axes::Two => 2,
            Axes::Three => 3,
        },
        handle_damping_n_s_per_m: setup.handle_damping_n_s_per_m,
        reach_m: stick_room_m(setup),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use teleclay_devices::exchange::{Marks, News};

    use super::*;
    use crate::device::room::tests::carving;

    /// A driver whose device stays at home and asks for fresh clay, again and again.
    struct Echo {
        rested: std::sync::mpsc::Sender<()>,
    }

    impl Driver for Echo {
        fn device(&self) -> &'static str {
            "gamepad"
        }

        fn period(&self) -> Duration {
            Duration::from_millis(1)
        }

        fn step(&mut self, now_ns: u64, _force_n: [f64; 3]) -> Result<Option<News>, DeviceFault> {
            Ok(Some(News {
                at_ns: now_ns,
                position_m: [0.0; 3],
                marks: Marks {
                    wants_clay: true,
                    ..Marks::default()
                },
            }))
        }

        fn rest(&mut self) {
            // A test that is over listens no more.
            let _ = self.rested.send(());
        }
    }

    #[test]
    fn a_device_that_is_dropped_was_brought_to_rest_before() {
        let (rested, rest) = std::sync::mpsc::channel();
        let hardware = Hardware::Gamepad;
        let profile = hardware.profile();
        let mut device =
            HeldDevice::drive(hardware, Echo { rested }, &needs(&carving()), profile).unwrap();
        let sample = device.sample().unwrap();
        assert!(sample.position_m.iter().all(|part| part.abs() <= 0.0));
        device.command(&DeviceCommand::default()).unwrap();
        drop(device);
        assert_eq!(rest.try_recv(), Ok(()));
    }

    #[test]
    fn a_joystick_is_refused_by_a_session_of_three_axes_before_it_is_looked_for() {
        let setup = DeviceSetup {
            axes: Axes::Three,
            ..carving()
        };
        let hardware = Hardware::Joystick;
        let haply = ServiceAddress::default();
        let refused = HeldDevice::open(hardware, &setup, hardware.profile(), &haply).unwrap_err();
        assert!(
            matches!(
                refused,
                DeviceFault::TooFewAxes {
                    axes: 2,
                    wanted: 3,
                    ..
                }
            ),
            "{refused}"
        );
    }
}
