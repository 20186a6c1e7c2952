//! The plants that [KHMH03] identified, and values for what it leaves open.
//!
//! Numbers with an equation number are the paper's. The others are ours: the paper does not print them.

use crate::polynomial::Polynomial;
use crate::rational::{RationalError, RationalFunction};

/// Virtual mass of the handle's admittance `C_h1`, kg. Ours: a hand tool's weight.
pub const HANDLE_MASS_KG: f64 = 1.0;
/// Virtual damping of `C_h1`, N·s/m. Ours: 2 N then move the free handle at 0.2 m/s.
pub const HANDLE_DAMPING_N_S_PER_M: f64 = 10.0;
/// Virtual tool mass `M_t`, kg. Ours.
pub const TOOL_MASS_KG: f64 = 0.5;
/// Virtual tool damping `B_t`, N·s/m. Ours.
pub const TOOL_DAMPING_N_S_PER_M: f64 = 20.0;
/// Virtual tool stiffness `K_t`, N/m. Ours: a free tool has none.
pub const TOOL_STIFFNESS_N_PER_M: f64 = 0.0;
/// `A_h1`, tool position over handle position.
pub const POSITION_RATIO: f64 = 1.0;
/// `A_h2`, clay force over net hand force; below zero, because the clay resists.
pub const FORCE_RATIO: f64 = -1.0;

/// Hand force of the cutting experiment of Fig. 7, N. Ours.
pub const HAND_FORCE_N: f64 = 2.0;
/// Handle positions at which the clay's depth changes, m: 3, 6, 9 and 12 cm, as in Fig. 7.
pub const CUTTING_EDGES_M: [f64; 4] = [0.03, 0.06, 0.09, 0.12];
/// Clay damping in the three ranges per tool velocity, N·s/m. Ours: 1, 2 and 3 cm of a blade 1 cm wide in clay of
/// 2e5 N·s/m³.
pub const CUTTING_DAMPING_N_S_PER_M: [f64; 3] = [20.0, 40.0, 60.0];

/// Handle servo of the x axis (35): commanded to actual position, unit gain at rest.
#[must_use]
pub fn g_hx() -> RationalFunction {
    printed(&[18.0, 1.0], &[0.005, 0.4, 18.0, 1.0])
}

/// Handle servo of the y axis (36).
#[must_use]
pub fn g_hy() -> RationalFunction {
    printed(&[8.0, 1.0], &[0.002, 0.17, 8.0, 1.0])
}

/// The operator's arm in x (37): force in N per metre of motion, `0.25 s² + 2 s + 6`. The other axes take it too.
#[must_use]
pub fn t_hx() -> Polynomial {
    Polynomial::new(&[0.25, 2.0, 6.0]).expect("printed coefficients are finite")
}

/// Admittance `C_h1 = 1 / (M s² + B s)`: a virtual mass with damping, from hand force in N to commanded position in m.
///
/// # Errors
/// Mass and damping both zero, or not finite.
pub fn c_h1(mass_kg: f64, damping_n_s_per_m: f64) -> Result<RationalFunction, RationalError> {
    RationalFunction::new(&[1.0], &[mass_kg, damping_n_s_per_m, 0.0])
}

/// Virtual tool `G_t = 1 / (M_t s² + B_t s + K_t)` (20), from N to m.
///
/// # Errors
/// All three zero, or one not finite.
pub fn g_t(
    mass_kg: f64,
    damping_n_s_per_m: f64,
    stiffness_n_per_m: f64,
) -> Result<RationalFunction, RationalError> {
    RationalFunction::new(&[1.0], &[mass_kg, damping_n_s_per_m, stiffness_n_per_m])
}

/// [`c_h1`] with our default mass and damping.
#[must_use]
pub fn default_c_h1() -> RationalFunction {
    c_h1(HANDLE_MASS_KG, HANDLE_DAMPING_N_S_PER_M).expect("the defaults are finite and not zero")
}

/// [`g_t`] with our default mass, damping and stiffness.
#[must_use]
pub fn default_g_t() -> RationalFunction {
    g_t(TOOL_MASS_KG, TOOL_DAMPING_N_S_PER_M, TOOL_STIFFNESS_N_PER_M)
        .expect("the defaults are finite and not zero")
}

/// Clay as a linear answer `T_t = B s + K`, N per metre of tool motion.
///
/// # Errors
/// A value is not finite.
pub fn t_t(
    damping_n_s_per_m: f64,
    stiffness_n_per_m: f64,
) -> Result<Polynomial, crate::PolynomialError> {
    Polynomial::new(&[damping_n_s_per_m, stiffness_n_per_m])
}

/// Constant handle velocity, m/s, at which a hand force balances handle and clay damping: `f_h / (B + rho B_i)`, the
/// plateaus of Fig. 7. `force_per_position` is `rho = A_h1 / |A_h2|`.
///
/// Follows from [`c_h1`] at constant velocity: `B v = f_h - f_t / A_h2` with `f_t = -B_i A_h1 v`.
#[must_use]
pub fn plateau_velocity_m_s(
    hand_force_n: f64,
    handle_damping_n_s_per_m: f64,
    force_per_position: f64,
    clay_damping_n_s_per_m: f64,
) -> f64 {
    hand_force_n / (handle_damping_n_s_per_m + force_per_position * clay_damping_n_s_per_m)
}

fn printed(numerator: &[f64], denominator: &[f64]) -> RationalFunction {
    RationalFunction::new(numerator, denominator)
        .expect("printed coefficients are finite and not zero")
}
