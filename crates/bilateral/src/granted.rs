//! What a handle takes of a server's word about how to run the loop, before a device moves by it.

use teleclay_device::DeviceProfile;
use teleclay_proto::join::LoopParameters;

/// Takes what a server says about the force on the hand, and about when it is let go, only below what the device
/// allows.
pub fn lower(parameters: &mut LoopParameters, profile: DeviceProfile) {
    parameters.force_limit_n = parameters.force_limit_n.min(profile.force_n);
    parameters.slew_limit_n_per_s = parameters.slew_limit_n_per_s.min(profile.slew_n_per_s);
    parameters.silence_s = parameters.silence_s.min(profile.silence_s);
    parameters.ramp_s = parameters.ramp_s.min(profile.ramp_s);
}

/// Ticks that a device keeps up with, and that hold what one command can change within what a hand bears.
#[must_use]
pub fn is_device_tick(tick_s: f64) -> bool {
    (0.5e-3..=2e-3).contains(&tick_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_loop_whose_tick_a_device_keeps_is_joined() {
        for tick_s in [0.5e-3, 1e-3, 2e-3] {
            assert!(is_device_tick(tick_s), "{tick_s}");
        }
        for tick_s in [1e-5, 0.49e-3, 2.01e-3, 0.1, f64::NAN] {
            assert!(!is_device_tick(tick_s), "{tick_s}");
        }
    }
}
