//! The parallel robot of \[KHMH03\] in software, held by somebody who follows an intent.

use teleclay_device::DeviceSample;
use teleclay_operator::{RobotHandle, RobotSetup, RobotState};

use super::room::cutting_room;
use super::{Device, DeviceCommand, DeviceError, DeviceRequest, DeviceSetup, Rounds};
use crate::intent::Intent;

/// A robot, and its operator's request for fresh clay after each finished round of cutting.
#[derive(Debug)]
pub struct RobotDevice {
    handle: RobotHandle,
    rounds: Rounds,
}

impl RobotDevice {
    /// The default robot at rest at home.
    ///
    /// # Errors
    /// The intent does not fit this setup, or the tick is no sample time.
    pub fn new(intent: &Intent, setup: &DeviceSetup) -> Result<Self, DeviceError> {
        let intent = intent.within(cutting_room(setup))?;
        let robot = RobotSetup::default();
        Ok(Self {
            handle: RobotHandle::new(setup.handle_axes(), setup.tick_s, intent, &robot)?,
            rounds: Rounds::default(),
        })
    }
}

impl Device for RobotDevice {
    fn name(&self) -> &str {
        "robot"
    }

    fn sample(&mut self) -> Result<DeviceSample, DeviceError> {
        Ok(self.handle.sample())
    }

    fn command(&mut self, command: &DeviceCommand) -> Result<(), DeviceError> {
        self.handle.command(command.position_m);
        Ok(())
    }

    fn poll_request(&mut self) -> Option<DeviceRequest> {
        self.rounds.request(self.handle.finished_rounds())
    }

    fn robot(&self) -> Option<RobotState> {
        Some(self.handle.state())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::room::tests::carving;

    /// The strokes of a cutting operator lie well within the robot's reach: its hand wants to go round without the
    /// fence.
    #[test]
    fn cutting_strokes_need_no_fence_on_two_and_on_three_axes() {
        for axes in [teleclay_proto::Axes::Two, teleclay_proto::Axes::Three] {
            let setup = DeviceSetup { axes, ..carving() };
            let room = cutting_room(&setup);
            let mut device = RobotDevice::new(&Intent::Idle, &setup).unwrap();
            for corner in 0..8 {
                let side = |bit: u32, most: f64, least: f64| {
                    if corner & (1 << bit) == 0 {
                        most
                    } else {
                        least
                    }
                };
                let position_m = [
                    side(0, room.x_m, -room.x_m),
                    side(1, room.y_m, -room.y_m),
                    side(2, 0.012, -room.depth_m),
                ];
                for _ in 0..2_000 {
                    device
                        .command(&DeviceCommand {
                            position_m,
                            ..DeviceCommand::default()
                        })
                        .unwrap();
                }
                let state = device.robot().unwrap();
                assert!(
                    !state.is_held && 0.6 < state.clearance,
                    "{position_m:?}: {state:?}"
                );
            }
        }
    }
}
