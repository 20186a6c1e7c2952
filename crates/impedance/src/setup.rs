//! What a coupling is made of, checked once.

use teleclay_device::DeviceProfile;

use crate::reading::Playback;
use crate::scale::{MOTION_RANGE, Scale};
use crate::stiffness::{DeviceTiming, LoopHandle, TimingError, max_stiffness, series};

/// A virtual coupling and the two sides that it joins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingSetup {
    /// How many axes carry force, 2 or 3. The third axis of a two-axis handle is a lift: it is carried, without force.
    pub axes: usize,
    /// Spring `K`, N/m, in the handle's coordinates.
    pub stiffness_n_per_m: f64,
    /// Damper `B` beside it, N·s/m.
    pub damping_n_s_per_m: f64,
    /// Time constant of the filter of the device's velocity, s.
    pub filter_s: f64,
    /// The device.
    pub device: DeviceTiming,
    /// How its samples become places.
    pub playback: Playback,
    /// Greatest speed of a hand with this device, m/s. What is faster is a leap.
    pub device_speed_m_s: f64,
    /// The handle.
    pub handle: LoopHandle,
    /// Greatest speed of the handle, m/s. What is faster lets go.
    pub handle_speed_m_s: f64,
    /// What the device may do to the hand: force and slew of it bound the coupling's force.
    pub profile: DeviceProfile,
    /// Age of the newest sample beyond which the coupling lets go, s.
    pub hold_s: f64,
    /// Longest time that letting go takes, s: a force at its cap fades within it, a lesser one sooner.
    pub ramp_s: f64,
    /// Force that the coupling would want at which it stops: it lets go, and has to be taken hold of anew, N. Infinite
    /// for never.
    pub stop_force_n: f64,
    /// How motion and force are scaled at first.
    pub scale: Scale,
}

/// Why there is no such coupling.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// A number is out of its range.
    #[error("{quantity} is {got}, need a number {need}")]
    OutOfRange {
        /// Its name, with its unit.
        quantity: &'static str,
        /// As given.
        got: f64,
        /// Its range, in words.
        need: &'static str,
    },
    /// Device and handle have no such timing.
    #[error(transparent)]
    Timing(#[from] TimingError),
    /// The spring is stiffer than what the sampling of both sides leaves passive.
    #[error(
        "a stiffness of {got_n_per_m} N/m rings with this device, need {bound_n_per_m} N/m at most: sample it faster or with less delay, damp it more, or take less damping in the coupling"
    )]
    TooStiff {
        /// As given, N/m.
        got_n_per_m: f64,
        /// See [`max_stiffness`], N/m.
        bound_n_per_m: f64,
    },
    /// More could be drawn from the force while it is held and let go of than the spring stores.
    #[error(
        "holding for {hold_s} s and letting go within {ramp_s} s gives away more than a spring of {got_n_per_m} N/m stores, need {bound_n_per_m} N/m at most"
    )]
    LetsGoTooLate {
        /// As given, s.
        hold_s: f64,
        /// As given, s.
        ramp_s: f64,
        /// As given, N/m.
        got_n_per_m: f64,
        /// Greatest stiffness for these times, N/m.
        bound_n_per_m: f64,
    },
    /// Motion within the two speeds would change the force faster than the device's slew.
    #[error(
        "motion changes the force by up to {got_n_per_s} N/s, the device bears {slew_n_per_s} N/s"
    )]
    TooFast {
        /// `K (v_d + v_h) + 2 B v_d / filter`, N/s.
        got_n_per_s: f64,
        /// The profile's, N/s.
        slew_n_per_s: f64,
    },
}

impl CouplingSetup {
    /// For a device that renders no force and is read at `rate_hz` at the slowest: a mouse, a finger, a stick. The
    /// handle is one of mass 1 kg with `handle_damping_n_s_per_m`, at `tick_s`.
    ///
    /// The spring is as stiff as lets the hand's place and the handle's part by 13 mm under 2 N, and soft enough for
    /// the damper, half of what the handle has, to let it settle after one swing.
    pub fn without_feedback(
        rate_hz: f64,
        handle_damping_n_s_per_m: f64,
        tick_s: f64,
        profile: DeviceProfile,
    ) -> Self {
        let device = DeviceTiming {
            rate_hz,
            damping_n_s_per_m: f64::INFINITY,
            latency_s: 0.0,
        };
        Self {
            axes: 2,
            stiffness_n_per_m: 150.0,
            damping_n_s_per_m: 0.5 * handle_damping_n_s_per_m,
            filter_s: 0.016,
            device,
            playback: Playback::Interpolated,
            device_speed_m_s: 1.0,
            handle: LoopHandle {
                tick_s,
                damping_n_s_per_m: handle_damping_n_s_per_m,
                latency_s: tick_s,
            },
            handle_speed_m_s: 2.0,
            profile,
            // One sample may be missing, and the next one late.
            hold_s: 2.5 * device.interval_s(),
            ramp_s: profile.ramp_s.max(profile.force_n / profile.slew_n_per_s),
            stop_force_n: f64::INFINITY,
            scale: Scale {
                motion: 1.0,
                force: 0.0,
            },
        }
    }

    /// Stiffest spring that this setup could have with `scale`, N/m: [`max_stiffness`] with the time that the playback
    /// costs.
    ///
    /// # Errors
    /// There is no such timing.
    pub fn stiffness_bound_n_per_m(&self, scale: &Scale) -> Result<f64, SetupError> {
        Ok(max_stiffness(
            &self.device_at_handle(scale),
            &self.handle,
            self.damping_n_s_per_m,
        )?)
    }

    pub(crate) fn device_at_handle(&self, scale: &Scale) -> DeviceTiming {
        let device = scale.at_handle(&self.device);
        DeviceTiming {
            latency_s: device.latency_s + self.playback.latency_s(&self.device),
            ..device
        }
    }

    /// Checks what does not depend on the scale, then the scale.
    pub(crate) fn check(&self) -> Result<(), SetupError> {
        let above =
            |quantity, got: f64| require(quantity, got, got.is_finite() && 0.0 < got, "above zero");
        require(
            "axes",
            self.axes as f64,
            self.axes == 2 || self.axes == 3,
            "that is 2 or 3",
        )?;
        above("stiffness_n_per_m", self.stiffness_n_per_m)?;
        let damping = self.damping_n_s_per_m;
        require(
            "damping_n_s_per_m",
            damping,
            damping.is_finite() && 0.0 <= damping,
            "not below zero",
        )?;
        above("filter_s", self.filter_s)?;
        above("device_speed_m_s", self.device_speed_m_s)?;
        above("handle_speed_m_s", self.handle_speed_m_s)?;
        above("force_n", self.profile.force_n)?;
        above("slew_n_per_s", self.profile.slew_n_per_s)?;
        require(
            "stop_force_n",
            self.stop_force_n,
            0.0 < self.stop_force_n,
            "above zero",
        )?;
        let interval_s = self.device.interval_s();
        let hold = self.hold_s;
        require(
            "hold_s",
            hold,
            hold.is_finite() && interval_s <= hold,
            "no shorter than an interval of the device",
        )?;
        let fastest_s = self.profile.force_n / self.profile.slew_n_per_s;
        let ramp = self.ramp_s;
        require(
            "ramp_s",
            ramp,
            ramp.is_finite() && fastest_s <= ramp,
            "no shorter than force over slew",
        )?;
        self.check_scale(&self.scale)
    }

    /// Whether the coupling keeps its promises behind this scale.
    pub(crate) fn check_scale(&self, scale: &Scale) -> Result<(), SetupError> {
        require(
            "motion scale",
            scale.motion,
            MOTION_RANGE.contains(&scale.motion),
            "from 0.01 to 100",
        )?;
        require(
            "force scale",
            scale.force,
            (0.0..=1.0).contains(&scale.force),
            "from 0 to 1",
        )?;
        let got_n_per_m = self.stiffness_n_per_m;
        let bound_n_per_m = self.stiffness_bound_n_per_m(scale)?;
        if bound_n_per_m < got_n_per_m {
            return Err(SetupError::TooStiff {
                got_n_per_m,
                bound_n_per_m,
            });
        }
        let pays = series(
            scale.at_handle(&self.device).damping_n_s_per_m,
            self.handle.damping_n_s_per_m,
        );
        let bound_n_per_m = 2.0 * pays / (self.hold_s + self.ramp_s / 3.0);
        if bound_n_per_m < got_n_per_m {
            let (hold_s, ramp_s) = (self.hold_s, self.ramp_s);
            return Err(SetupError::LetsGoTooLate {
                hold_s,
                ramp_s,
                got_n_per_m,
                bound_n_per_m,
            });
        }
        let device_speed = scale.motion * self.device_speed_m_s;
        let got_n_per_s = self.stiffness_n_per_m * (device_speed + self.handle_speed_m_s)
            + 2.0 * self.damping_n_s_per_m * device_speed / self.filter_s;
        let slew_n_per_s = self.profile.slew_n_per_s;
        if slew_n_per_s < got_n_per_s {
            return Err(SetupError::TooFast {
                got_n_per_s,
                slew_n_per_s,
            });
        }
        Ok(())
    }
}

fn require(
    quantity: &'static str,
    got: f64,
    is_good: bool,
    need: &'static str,
) -> Result<(), SetupError> {
    if is_good {
        Ok(())
    } else {
        Err(SetupError::OutOfRange {
            quantity,
            got,
            need,
        })
    }
}
