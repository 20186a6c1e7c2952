//! How motion and force are scaled between a device and the loop's handle.

use std::ops::RangeInclusive;

use crate::stiffness::DeviceTiming;

/// Least and greatest handle motion per device motion. Beyond a hundred either way a tremor is a blow, or a hand's
/// whole reach is less than a voxel.
pub const MOTION_RANGE: RangeInclusive<f64> = 0.01..=100.0;

/// Handle motion per device motion, and device force per handle force.
///
/// The device moves by `p`, the handle is drawn by `motion p`; the handle is pushed with `f`, the device with
/// `-force f`. A joule at the handle is `force / motion` joules at the device: the scale is a gear where the two are
/// equal, and otherwise one that also multiplies power. Energies are counted in the handle's joules, and multiplied by
/// that ratio are the device's. The ratio changes only while the coupling stores nothing, so neither count can be
/// cheated by a change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Handle motion per device motion, within [`MOTION_RANGE`].
    pub motion: f64,
    /// Device force per handle force, 0 to 1: the hand never feels more than the loop's handle is pushed with. 0 for a
    /// device that renders none.
    pub force: f64,
}

impl Default for Scale {
    fn default() -> Self {
        Self {
            motion: 1.0,
            force: 1.0,
        }
    }
}

impl Scale {
    /// Device joules for one of the handle's.
    pub fn power_ratio(&self) -> f64 {
        self.force / self.motion
    }

    /// The device as the handle sees it through the scale: what damps the device with `b` damps the handle's motion
    /// with `b / (motion · force)`. A device that no force reaches is moved by none.
    #[must_use]
    pub fn at_handle(&self, device: &DeviceTiming) -> DeviceTiming {
        let gear = self.motion * self.force;
        DeviceTiming {
            damping_n_s_per_m: if 0.0 < gear {
                device.damping_n_s_per_m / gear
            } else {
                f64::INFINITY
            },
            ..*device
        }
    }
}
