//! The handle of \[KHMH03\] in software, held by somebody who follows an intent.

use teleclay_device::DeviceSample;
use teleclay_operator::SimulatedHandle;

use super::room::cutting_room;
use super::{Device, DeviceCommand, DeviceError, DeviceRequest, DeviceSetup, Rounds};
use crate::intent::Intent;

/// A simulated handle, and its operator's request for fresh clay after each finished round of cutting.
#[derive(Debug)]
pub struct SimulatedDevice {
    handle: SimulatedHandle,
    rounds: Rounds,
}

impl SimulatedDevice {
    /// A handle at rest at home.
    ///
    /// # Errors
    /// The intent does not fit this setup, or the tick is no sample time.
    pub fn new(intent: &Intent, setup: &DeviceSetup) -> Result<Self, DeviceError> {
        let intent = intent.within(cutting_room(setup))?;
        Ok(Self {
            handle: SimulatedHandle::new(setup.handle_axes(), setup.tick_s, intent)?,
            rounds: Rounds::default(),
        })
    }
}

impl Device for SimulatedDevice {
    fn name(&self) -> &str {
        "simulated"
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::room::tests::carving;
    use teleclay_proto::ToolDescription;

    #[test]
    fn no_setup_leaves_no_room_at_all() {
        let cramped = DeviceSetup {
            reach_m: [[0.0; 3], [0.0; 3]],
            home_m: [0.0; 3],
            tool: ToolDescription::Ball { radius_m: 0.1 },
            ..carving()
        };
        assert!(SimulatedDevice::new(&Intent::Cutting, &cramped).is_ok());
    }

    #[test]
    fn a_finished_round_asks_once_for_fresh_clay() {
        let mut device = SimulatedDevice::new(&Intent::Cutting, &carving()).unwrap();
        let round_s = Intent::Cutting
            .within(cutting_room(&carving()))
            .unwrap()
            .round_s()
            .unwrap();
        let mut asked_at_s = Vec::new();
        for tick in 0..(2.5 * round_s / 1e-3) as u32 {
            device.command(&DeviceCommand::default()).unwrap();
            if device.poll_request() == Some(DeviceRequest::FreshClay) {
                asked_at_s.push(f64::from(tick + 1) * 1e-3);
            }
        }
        assert_eq!(asked_at_s.len(), 2, "{asked_at_s:?}");
        assert!(
            (asked_at_s[0] - round_s).abs() < 2e-3 && (asked_at_s[1] - 2.0 * round_s).abs() < 2e-3
        );
    }
}
