//! What a haptic device is to the loop: what it measures, what it is told, and what it lets nobody tell it.
//!
//! SI units throughout; a position is the handle's displacement from its home.

mod brake;
mod description;
mod guard;

pub use brake::Brake;
pub use description::{DeviceDescription, Feedback};
pub use guard::{DeviceProfile, Guard};

/// What a handle measures at one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DeviceSample {
    /// Displacement from home, m. On a two-axis handle the third value is the lift the operator asks for.
    pub position_m: [f64; 3],
    /// Its rate, m/s.
    pub velocity_m_s: [f64; 3],
    /// Net force at the sensor, `f_h = u_h - T_h y_h` of \[KHMH03\] (16), N.
    pub hand_force_n: [f64; 3],
}

/// What a device is told each tick. A device that moves by position commands (the handle of \[KHMH03\] is one) follows
/// `position_m`; one that pushes renders `force_n`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DeviceCommand {
    /// Where the handle should be, displacement from home, m.
    pub position_m: [f64; 3],
    /// Force of the far side on the hand, N.
    pub force_n: [f64; 3],
}
