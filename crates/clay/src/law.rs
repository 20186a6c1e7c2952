//! The cutting law: what the clay answers to a tool that moves in it.
//!
//! While it flows, clay answers as a Bingham solid over the engaged area `A` ([`crate::engage`]):
//!
//! ```text
//! F = -(sigma_y + k |v|) A v / |v|
//! ```
//!
//! with yield stress `sigma_y` (Pa) and viscosity `k` (Pa s/m). With `sigma_y = 0` this is the viscous clay of
//! \[KHMH03\]. Below yield the clay is a spring between the tool and the place where the clay last gave way. Its
//! stiffness is that of a flat round punch of the same area on an elastic half space of modulus `E` (Pa):
//!
//! ```text
//! K = 2 E sqrt(A / pi)
//! ```
//!
//! The spring stretches by `u` until `K |u| = sigma_y A`; from there on its far end slides along.
//!
//! # Several materials
//!
//! Where the clay ahead is of several [classes](crate::classes), each answers over its own part `A_c` of the area. Flow
//! adds up: `F = -sum_c (sigma_c + k_c |v|) A_c v / |v|`. There is one spring, of all classes that have one. It bears
//! `Y = sum_c sigma_c A_c` before it slides, and it is as stiff as a punch on the mean of their moduli, by area:
//!
//! ```text
//! K = 2 E sqrt(A / pi),  A = sum_c A_c,  E = sum_c E_c A_c / A
//! ```
//!
//! With one class these are the formulas above.
//!
//! # Passivity
//!
//! Let a tick move the tool by `D` and answer with `F`. The work the tool does is `-F . D`; the spring's energy is
//! `S = K |u|^2 / 2`. When the area grows, so would the energy of a stretch already there: the stretch is then
//! shortened to keep the energy, `u0 = u sqrt(K_old / K)`. With `u = u0 + D` less the slide `p`, which points along
//! `u`, `K u . D >= K (|u|^2 - |u0|^2) / 2 + K u . p >= S - S_old`. So over any closed cycle the tool gives at least
//! what it takes. Nothing in this asks where `K` and the bound on `K |u|` come from, only that neither is below zero:
//! it holds whatever happens to the area, and whatever the classes in it.

use thiserror::Error;

use crate::pose::Pose;

/// Largest coefficient of a material, in its unit: keeps every force finite.
pub const MAX_COEFFICIENT: f64 = 1e12;
/// Largest speed of a tool along an axis, m/s.
pub const MAX_SPEED_M_S: f64 = 1e3;

/// Without stiffness, the yield force grows in proportion up to this speed, m/s, instead of jumping at rest. It is the
/// slowest speed at which the law is promised.
pub const RIGID_YIELD_SPEED_M_S: f64 = 5e-4;

/// Coefficients of the clay. Invariant: each finite, not below zero, at most [`MAX_COEFFICIENT`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    coefficients: Coefficients,
}

/// Coefficients of the clay, before they are checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    /// Force per engaged area and speed, Pa s/m.
    pub viscosity_pa_s_per_m: f64,
    /// Force per engaged area below which the clay does not flow, Pa.
    pub yield_stress_pa: f64,
    /// Modulus of the clay below yield, Pa. 0 means rigid: nothing gives before it flows, and the yield force is
    /// spread over speeds up to [`RIGID_YIELD_SPEED_M_S`].
    pub stiffness_pa: f64,
}

/// A coefficient that no clay has.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("{coefficient} is {got}, wanted 0 to {MAX_COEFFICIENT}")]
pub struct MaterialError {
    /// Which coefficient, with its unit.
    pub coefficient: &'static str,
    /// Its value as it came.
    pub got: f64,
}

impl Material {
    /// A material of these coefficients.
    ///
    /// # Errors
    /// When a coefficient is not finite, below zero or above [`MAX_COEFFICIENT`].
    pub fn new(coefficients: Coefficients) -> Result<Self, MaterialError> {
        let Coefficients {
            viscosity_pa_s_per_m,
            yield_stress_pa,
            stiffness_pa,
        } = coefficients;
        for (coefficient, got) in [
            ("viscosity_pa_s_per_m", viscosity_pa_s_per_m),
            ("yield_stress_pa", yield_stress_pa),
            ("stiffness_pa", stiffness_pa),
        ] {
            if !(0.0..=MAX_COEFFICIENT).contains(&got) {
                return Err(MaterialError { coefficient, got });
            }
        }
        Ok(Self { coefficients })
    }

    /// The coefficients.
    #[must_use]
    pub const fn coefficients(&self) -> Coefficients {
        self.coefficients
    }

    /// Stiffness below yield over an engaged area, N/m: that of a flat round punch. 0 for rigid clay.
    #[must_use]
    pub fn stiffness_n_per_m(&self, area_m2: f64) -> f64 {
        punch_n_per_m(self.coefficients.stiffness_pa, area_m2)
    }

    /// Whether the clay springs back below yield, and so needs the area in the direction of the stretch.
    pub(crate) fn springs(&self) -> bool {
        0.0 < self.coefficients.stiffness_pa && 0.0 < self.coefficients.yield_stress_pa
    }
}

impl Default for Material {
    /// The viscous clay of the published experiment: 2e5 Pa s/m, so 20 N s/m over a square centimetre; no yield, no
    /// stiffness.
    fn default() -> Self {
        let coefficients = Coefficients {
            viscosity_pa_s_per_m: 2e5,
            yield_stress_pa: 0.0,
            stiffness_pa: 0.0,
        };
        Self { coefficients }
    }
}

/// What the clay under one tool remembers from tick to tick. One per tool; the default is a tool that touches nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactState {
    /// From the place where the clay last gave way to the tool, m.
    pub stretch_m: [f64; 3],
    /// Stiffness at which the stretch was last held, N/m.
    pub stiffness_n_per_m: f64,
}

impl ContactState {
    /// Energy in the stretch, J.
    #[must_use]
    pub fn stored_j(&self) -> f64 {
        0.5 * self.stiffness_n_per_m * dot(self.stretch_m, self.stretch_m)
    }

    /// Force of the stretch on the tool, N: the part of the clay's last answer that does not depend on the speed.
    #[must_use]
    pub fn force_n(&self) -> [f64; 3] {
        self.stretch_m.map(|m| -self.stiffness_n_per_m * m)
    }
}

/// One tick of a tool: the sweep's poses, and the velocity, which poses on a lattice would give too coarsely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    from: Pose,
    to: Pose,
    velocity_m_s: [f64; 3],
}

/// A velocity that is not one.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "velocity {axis} is {got_m_s} m/s, wanted finite and at most {MAX_SPEED_M_S} m/s in magnitude"
)]
pub struct MotionError {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// The velocity as it came, m/s.
    pub got_m_s: f64,
}

impl Motion {
    /// A tool that moved straight from one pose to another and has this velocity now.
    ///
    /// # Errors
    /// When a velocity is not finite or above [`MAX_SPEED_M_S`] in magnitude.
    pub fn new(from: Pose, to: Pose, velocity_m_s: [f64; 3]) -> Result<Self, MotionError> {
        for (axis, got_m_s) in velocity_m_s.into_iter().enumerate() {
            let valid = got_m_s.abs() <= MAX_SPEED_M_S;
            if !valid {
                return Err(MotionError { axis, got_m_s });
            }
        }
        Ok(Self {
            from,
            to,
            velocity_m_s,
        })
    }

    /// Pose at the start of the tick.
    #[must_use]
    pub const fn from(&self) -> Pose {
        self.from
    }

    /// Pose at the end of the tick.
    #[must_use]
    pub const fn to(&self) -> Pose {
        self.to
    }

    /// Velocity at the end of the tick, m/s.
    #[must_use]
    pub const fn velocity_m_s(&self) -> [f64; 3] {
        self.velocity_m_s
    }
}

/// What the clay is doing under a tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Regime {
    /// No clay ahead of the tool.
    Free,
    /// The clay holds, and springs back when let go.
    Elastic,
    /// The clay gives way.
    Flowing,
}

/// What the clay answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Force on the tool, N.
    pub force_n: [f64; 3],
    /// Engaged area in the direction of motion, or of the stretch when the tool is at rest, m².
    pub engaged_area_m2: f64,
    /// What the clay is doing.
    pub regime: Regime,
    /// Energy that the clay would give back, J.
    pub stored_j: f64,
    /// Energy turned into heat during the tick, J.
    pub dissipated_j: f64,
}

/// Stiffness of a flat round punch of an area on an elastic half space, N/m.
fn punch_n_per_m(modulus_pa: f64, area_m2: f64) -> f64 {
    2.0 * modulus_pa * (area_m2 / std::f64::consts::PI).sqrt()
}

/// What stands ahead of a tool in a direction, as the law adds it up: of one material, or of several.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Engaged {
    area_m2: f64,
    /// Force per speed while the clay flows, N s/m. The yield of what does not spring is in it.
    resistance_n_s_per_m: f64,
    /// Yield force of what springs, N.
    springs_up_to_n: f64,
    /// Stiffness of what springs, N/m.
    stiffness_n_per_m: f64,
}

impl Engaged {
    /// Clay of one material.
    pub(crate) fn one(material: &Material, area_m2: f64, motion: &Motion) -> Self {
        let mut engaged = Self::default();
        engaged.add(material, area_m2, norm(motion.velocity_m_s));
        if material.springs() {
            engaged.stiffness_n_per_m = material.stiffness_n_per_m(area_m2);
        }
        engaged
    }

    /// Clay of several materials, each over an area of its own.
    pub(crate) fn several<'a>(
        parts: impl Iterator<Item = (&'a Material, f64)>,
        motion: &Motion,
    ) -> Self {
        let speed_m_s = norm(motion.velocity_m_s);
        let mut engaged = Self::default();
        let (mut modulus_n, mut springing_m2) = (0.0, 0.0);
        for (material, area_m2) in parts {
            engaged.add(material, area_m2, speed_m_s);
            if material.springs() {
                modulus_n += material.coefficients.stiffness_pa * area_m2;
                springing_m2 += area_m2;
            }
        }
        if 0.0 < springing_m2 {
            engaged.stiffness_n_per_m = punch_n_per_m(modulus_n / springing_m2, springing_m2);
        }
        engaged
    }

    fn add(&mut self, material: &Material, area_m2: f64, speed_m_s: f64) {
        let Coefficients {
            viscosity_pa_s_per_m,
            yield_stress_pa,
            ..
        } = material.coefficients;
        let mut pressure_per_speed = viscosity_pa_s_per_m;
        if material.springs() {
            self.springs_up_to_n += yield_stress_pa * area_m2;
        } else {
            pressure_per_speed += yield_stress_pa / speed_m_s.max(RIGID_YIELD_SPEED_M_S);
        }
        self.area_m2 += area_m2;
        self.resistance_n_s_per_m += pressure_per_speed * area_m2;
    }
}

/// The unit directions in which the area matters: of the motion, and of the stretch. Zero where it does not matter.
pub(crate) fn directions(springs: bool, contact: &ContactState, motion: &Motion) -> [[f64; 3]; 2] {
    let moving = unit(motion.velocity_m_s);
    if !springs {
        return [moving, [0.0; 3]];
    }
    let way_m = motion.to.displacement_from_m(motion.from);
    let stretch_m = std::array::from_fn(|axis| contact.stretch_m[axis] + way_m[axis]);
    [moving, unit(stretch_m)]
}

/// One tick of the law over what stands ahead in the [`directions`].
pub(crate) fn respond(
    contact: &mut ContactState,
    motion: &Motion,
    [moving, stretched]: [Engaged; 2],
) -> Response {
    let way_m = motion.to.displacement_from_m(motion.from);
    let before_j = contact.stored_j();
    let speed_m_s = norm(motion.velocity_m_s);

    let mut regime = stretch(contact, way_m, &stretched);
    let flows = 0.0 < moving.area_m2 && 0.0 < speed_m_s;
    if regime == Regime::Free && flows {
        regime = Regime::Flowing;
    }
    let force_n: [f64; 3] = std::array::from_fn(|axis| {
        -moving.resistance_n_s_per_m * motion.velocity_m_s[axis]
            - contact.stiffness_n_per_m * contact.stretch_m[axis]
    });
    let stored_j = contact.stored_j();
    // A velocity that does not point along the way could show a gain here; the clay itself has none to give.
    let dissipated_j = (-dot(force_n, way_m) - (stored_j - before_j)).max(0.0);
    Response {
        force_n,
        engaged_area_m2: if 0.0 < speed_m_s {
            moving.area_m2
        } else {
            stretched.area_m2
        },
        regime,
        stored_j,
        dissipated_j,
    }
}

/// Stretches the spring by the tool's way and lets it slide where it exceeds what the clay bears.
fn stretch(contact: &mut ContactState, way_m: [f64; 3], engaged: &Engaged) -> Regime {
    let stiffness_n_per_m = engaged.stiffness_n_per_m;
    if stiffness_n_per_m <= 0.0 {
        *contact = ContactState::default();
        return Regime::Free;
    }
    let kept = if contact.stiffness_n_per_m < stiffness_n_per_m {
        (contact.stiffness_n_per_m / stiffness_n_per_m).sqrt()
    } else {
        1.0
    };
    let trial_m: [f64; 3] =
        std::array::from_fn(|axis| contact.stretch_m[axis] * kept + way_m[axis]);
    let most_m = engaged.springs_up_to_n / stiffness_n_per_m;
    let length_m = norm(trial_m);
    let (held, regime) = if most_m < length_m {
        (most_m / length_m, Regime::Flowing)
    } else {
        (1.0, Regime::Elastic)
    };
    *contact = ContactState {
        stretch_m: trial_m.map(|m| m * held),
        stiffness_n_per_m,
    };
    regime
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

/// The direction of a vector; zero for one too short to have one.
fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = norm(a);
    if length <= 1e-12 {
        return [0.0; 3];
    }
    a.map(|a| a / length)
}
