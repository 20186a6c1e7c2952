//! What a haptic device is to the loop. SI units throughout; a position is the handle's displacement from its home.

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
