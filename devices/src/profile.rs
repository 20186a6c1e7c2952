//! What each device is, what it may do to a hand, and how it is coupled to the loop's handle.
//!
//! A coupling's stiffness is a share of what sampling, latency and damping of both sides leave passive (`max_stiffness`
//! of `teleclay-impedance`), of what letting go allows and of what the slew allows: no stiffness stands here.

use teleclay_device::{DeviceDescription, DeviceProfile, Feedback};
use teleclay_impedance::{CouplingSetup, DeviceTiming, LoopHandle, Playback, Scale, series};

use crate::fault::DeviceFault;

/// Share of the stiffest spring that is taken: what is told of a device is never quite what it is.
const MARGIN: f64 = 0.9;
/// Share of the dampings in series that the coupling's own damper takes: the spring lives on the rest.
const DAMPER_SHARE: f64 = 0.3;
/// Share of the slew that the damper may use; the rest is the spring's.
const DAMPER_SLEW: f64 = 0.25;
/// One sample may be missing, and the next one late, in intervals.
const HOLD_INTERVALS: f64 = 2.5;

/// The devices that a hand holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hardware {
    /// Two sticks, triggers, rumble.
    Gamepad,
    /// One stick with motors.
    Joystick,
    /// The Inverse3 of Haply Robotics.
    Haply,
}

/// What a session asks of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SessionNeeds {
    /// Tick of the loop, s.
    pub tick_s: f64,
    /// How many axes reflect force, 2 or 3.
    pub axes: usize,
    /// Damping of the loop's handle, N·s/m.
    pub handle_damping_n_s_per_m: f64,
    /// How far a stick's full deflection moves the handle to either side of home, m.
    pub reach_m: [f64; 3],
}

impl Hardware {
    /// Every one.
    pub const ALL: [Self; 3] = [Self::Gamepad, Self::Haply, Self::Joystick];

    /// The word that stands for it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Gamepad => "gamepad",
            Self::Joystick => "joystick",
            Self::Haply => "haply",
        }
    }

    /// How far it reaches to either side of home at most, m.
    #[must_use]
    pub const fn workspace_m(self) -> [f64; 3] {
        match self {
            Self::Gamepad => [0.06; 3],
            // The way of a grip of usual length, 0.05 m, less its dead zone: the place is never faster than the grip.
            Self::Joystick => [0.044; 3],
            // The sphere that the maker's tutorial on position control keeps its targets in.
            Self::Haply => [0.1; 3],
        }
    }

    /// As it describes itself.
    #[must_use]
    pub const fn description(self) -> DeviceDescription {
        let most_n = self.profile().force_n;
        let feedback = match self {
            Self::Gamepad => Feedback::Rumble,
            Self::Joystick => Feedback::Force { axes: 2, most_n },
            Self::Haply => Feedback::Force { axes: 3, most_n },
        };
        DeviceDescription {
            name: self.word(),
            axes: 3,
            workspace_m: Some(self.workspace_m()),
            feedback,
            rate_hz: self.rate_hz(),
            measures_force: false,
        }
    }

    /// What it may do to a hand, whatever it is told.
    #[must_use]
    pub const fn profile(self) -> DeviceProfile {
        match self {
            // It renders no force; the bounds are those of the hand that it lends to the loop.
            Self::Gamepad => DeviceProfile {
                force_n: 5.0,
                slew_n_per_s: 1000.0,
                speed_m_s: 0.5,
                power_w: 2.0,
                silence_s: 0.1,
                ramp_s: 0.05,
            },
            Self::Joystick => DeviceProfile {
                force_n: 2.0,
                slew_n_per_s: 200.0,
                speed_m_s: 0.3,
                power_w: 0.5,
                silence_s: 0.1,
                ramp_s: 0.05,
            },
            // The maker's pages on the service name no greatest force. This one is ours, and low for a device whose
            // arms are made to render walls.
            Self::Haply => DeviceProfile {
                force_n: 5.0,
                slew_n_per_s: 1000.0,
                speed_m_s: 0.5,
                power_w: 2.0,
                silence_s: 0.1,
                ramp_s: 0.02,
            },
        }
    }

    /// The virtual coupling between it and a session's handle, within `profile`.
    ///
    /// # Errors
    /// The session reflects an axis that the device could not render, or no coupling keeps its promises.
    pub fn coupling(
        self,
        needs: &SessionNeeds,
        profile: DeviceProfile,
    ) -> Result<CouplingSetup, DeviceFault> {
        self.check_axes(needs.axes)?;
        let damping = needs.handle_damping_n_s_per_m;
        let mut setup =
            CouplingSetup::without_feedback(self.rate_hz(), damping, needs.tick_s, profile);
        // What lets a handle without feedback settle after one swing; behind feedback the bounds below are lower.
        let mut most_n_per_m = setup.stiffness_n_per_m;
        setup.axes = needs.axes;
        setup.handle_speed_m_s = profile.speed_m_s;
        setup.device_speed_m_s = self.speed_m_s();
        setup.handle = LoopHandle {
            tick_s: needs.tick_s,
            damping_n_s_per_m: damping,
            latency_s: needs.tick_s,
        };
        if let Some(timing) = self.timing() {
            most_n_per_m = f64::INFINITY;
            setup.device = timing;
            setup.playback = Playback::Held;
            setup.filter_s = timing.interval_s();
            setup.scale = Scale::default();
            setup.damping_n_s_per_m = DAMPER_SHARE * series(timing.damping_n_s_per_m, damping);
        }
        setup.hold_s = HOLD_INTERVALS * setup.device.interval_s();
        let damper_slew =
            DAMPER_SLEW * profile.slew_n_per_s * setup.filter_s / (2.0 * setup.device_speed_m_s);
        setup.damping_n_s_per_m = setup.damping_n_s_per_m.min(damper_slew);
        let fault = |source| DeviceFault::Coupling {
            device: self.word(),
            source,
        };
        let passive = setup.stiffness_bound_n_per_m(&setup.scale).map_err(fault)?;
        setup.stiffness_n_per_m = most_n_per_m.min(
            MARGIN
                * passive
                    .min(lets_go_in_time(&setup))
                    .min(within_the_slew(&setup)),
        );
        Ok(setup)
    }

    /// Every scheme takes the hand's force, and the coupling's is one, so none is refused for want of a sensor. What a
    /// device cannot do is push where it has no motor: the force along that axis would be felt nowhere, and the hand
    /// would take what it feels sideways for all there is. A gamepad pushes nowhere, and shows every axis alike.
    fn check_axes(self, wanted: usize) -> Result<(), DeviceFault> {
        match self.description().feedback {
            Feedback::Force { axes, .. } if axes < wanted => Err(DeviceFault::TooFewAxes {
                device: self.word(),
                axes,
                wanted,
            }),
            _ => Ok(()),
        }
    }

    /// Slowest rate of news and forces, 1/s. Their threads are asked for more; a desktop does not always give it.
    const fn rate_hz(self) -> f64 {
        match self {
            Self::Gamepad | Self::Joystick => 100.0,
            Self::Haply => 250.0,
        }
    }

    /// Greatest speed of a hand with it, m/s. A gamepad's place follows its stick more slowly than this.
    const fn speed_m_s(self) -> f64 {
        match self {
            Self::Gamepad => 0.5,
            Self::Joystick => 2.0,
            Self::Haply => 1.0,
        }
    }

    /// The device as a coupling sees it, where it renders force. No damping was measured: these are what a light grip
    /// of two fingers is taken for. A sample is an interval old when it counts, and its force another.
    fn timing(self) -> Option<DeviceTiming> {
        let damping_n_s_per_m = match self {
            Self::Gamepad => return None,
            Self::Joystick => 1.0,
            Self::Haply => 2.0,
        };
        let rate_hz = self.rate_hz();
        Some(DeviceTiming {
            rate_hz,
            damping_n_s_per_m,
            latency_s: 1.0 / rate_hz,
        })
    }
}

/// Stiffest spring whose energy the dampings take while it is held and let go of, N/m.
fn lets_go_in_time(setup: &CouplingSetup) -> f64 {
    let device = setup.scale.at_handle(&setup.device).damping_n_s_per_m;
    2.0 * series(device, setup.handle.damping_n_s_per_m) / (setup.hold_s + setup.ramp_s / 3.0)
}

/// Stiffest spring that motion within both speeds does not stretch faster than the slew, N/m.
fn within_the_slew(setup: &CouplingSetup) -> f64 {
    let device_m_s = setup.scale.motion * setup.device_speed_m_s;
    let damper_n_per_s = 2.0 * setup.damping_n_s_per_m * device_m_s / setup.filter_s;
    (setup.profile.slew_n_per_s - damper_n_per_s) / (device_m_s + setup.handle_speed_m_s)
}

#[cfg(test)]
mod tests {
    use teleclay_impedance::ImpedanceHandle;

    use super::*;

    fn needs(axes: usize) -> SessionNeeds {
        SessionNeeds {
            tick_s: 1e-3,
            axes,
            handle_damping_n_s_per_m: 10.0,
            reach_m: [0.05; 3],
        }
    }

    #[test]
    fn every_device_has_a_coupling_that_keeps_its_promises_and_a_spring_worth_the_name() {
        for hardware in Hardware::ALL {
            let setup = hardware.coupling(&needs(2), hardware.profile()).unwrap();
            ImpedanceHandle::new(setup).unwrap();
            let bound = setup.stiffness_bound_n_per_m(&setup.scale).unwrap();
            let stiffness = setup.stiffness_n_per_m;
            assert!(20.0 < stiffness && stiffness <= MARGIN * bound, "{setup:?}");
        }
    }

    #[test]
    fn a_lowered_profile_softens_the_coupling_and_never_breaks_it() {
        for hardware in Hardware::ALL {
            let own = hardware.profile();
            let stiffness = |slew_n_per_s: f64| {
                let profile = DeviceProfile {
                    slew_n_per_s,
                    ..own
                };
                let setup = hardware.coupling(&needs(2), profile).unwrap();
                ImpedanceHandle::new(setup).unwrap();
                setup.stiffness_n_per_m
            };
            assert!(stiffness(own.slew_n_per_s / 20.0) < stiffness(own.slew_n_per_s));
        }
    }

    #[test]
    fn a_stick_with_two_motors_is_refused_where_three_axes_reflect_and_a_gamepad_is_not() {
        let on_three = |hardware: Hardware| hardware.coupling(&needs(3), hardware.profile());
        assert!(on_three(Hardware::Gamepad).is_ok() && on_three(Hardware::Haply).is_ok());
        let said = on_three(Hardware::Joystick).unwrap_err().to_string();
        assert!(
            said.starts_with(
                "the joystick renders force on 2 axes and the session reflects 3: what pushes"
            ),
            "{said}"
        );
    }

    #[test]
    fn a_session_without_damping_is_refused_in_words() {
        let undamped = SessionNeeds {
            handle_damping_n_s_per_m: 0.0,
            ..needs(2)
        };
        let setup = Hardware::Haply.coupling(&undamped, Hardware::Haply.profile());
        let refused = setup.map(ImpedanceHandle::new).unwrap().unwrap_err();
        assert!(
            refused.to_string().contains("stiffness_n_per_m"),
            "{refused}"
        );
    }
}
