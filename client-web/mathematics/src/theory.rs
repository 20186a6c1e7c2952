//! The mathematics on the page: a loop under any round trip, a robot at any position.

use teleclay_control::analysis::{AnalysisError, LoopInput};
use teleclay_control::compensators::Sides;
use teleclay_control::{
    Characteristic, DelayedScheme, LoopError, Polynomial, PolynomialError, RationalError,
    RationalFunction, RootsError, paper,
};
use teleclay_kinematics::{Branch, BranchError, Dimensions, Geometry, GeometryError, Vector3};

/// Slower than this nothing is seen to grow within a minute, 1/s.
const SLOWEST_PER_S: f64 = 0.01;

/// Numbers of one arm in [`arms`].
pub const NUMBERS_OF_AN_ARM: usize = 13;

/// What has no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refused {
    /// Numbers that end before what they should describe, or after it.
    #[error("{got} numbers describe no {what}")]
    Numbers {
        /// What was to be described.
        what: &'static str,
        /// Numbers that came.
        got: usize,
    },
    /// No scheme has the number.
    #[error("scheme {got} is none of 0, position-force, and 1, force exchange")]
    Scheme {
        /// The number.
        got: u32,
    },
    /// A round trip that is none.
    #[error("round trip is {got} s, need a finite number not below zero")]
    RoundTrip {
        /// As given, s.
        got: f64,
    },
    /// No loop was set.
    #[error("there is no loop to look at")]
    NoLoop,
    /// A part of the loop is no rational function.
    #[error(transparent)]
    Rational(#[from] RationalError),
    /// The arm is no polynomial.
    #[error(transparent)]
    Polynomial(#[from] PolynomialError),
    /// The loop cannot be formed.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
    /// The loop has no characteristic function.
    #[error(transparent)]
    Loop(#[from] LoopError),
    /// Roots are not to be had.
    #[error(transparent)]
    Roots(#[from] RootsError),
    /// There is no such robot.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// There is no such branch.
    #[error(transparent)]
    Branch(#[from] BranchError),
}

/// A loop that is looked at.
#[derive(Default)]
pub struct Theory {
    looked_at: Option<Loop>,
}

struct Loop {
    position_force: Characteristic,
    force_exchange: Characteristic,
}

impl Theory {
    /// Takes another loop. Five lists of coefficients, highest power first, each after its length: numerator and
    /// denominator of `G_h`, the same of `C_h1`, the arm `T_h`; then position ratio, force ratio, damping of the clay
    /// in N·s/m, its stiffness in N/m.
    ///
    /// # Errors
    /// Numbers that describe no loop; the one before stays.
    pub fn set_loop(&mut self, numbers: &[f64]) -> Result<(), Refused> {
        let mut reader = Reader {
            what: "loop",
            numbers,
            at: 0,
        };
        let g_h = RationalFunction::new(reader.list()?, reader.list()?)?;
        let c_h1 = RationalFunction::new(reader.list()?, reader.list()?)?;
        let t_h = Polynomial::new(reader.list()?)?;
        let [
            position_ratio,
            force_ratio,
            clay_damping_n_s_per_m,
            clay_stiffness_n_per_m,
        ] = reader.rest()?;
        let input = LoopInput {
            sides: Sides {
                g_h,
                s_h: RationalFunction::zero(),
                // What moves the tool shapes its compensators, and drops out of the loop.
                g_t: paper::default_g_t(),
                s_t: RationalFunction::zero(),
                c_h1,
                position_ratio,
                force_ratio,
            },
            t_h,
            clay_damping_n_s_per_m,
            clay_stiffness_n_per_m,
            omegas_rad_s: Vec::new(),
        };
        let closed_loop = input.closed_loop()?;
        self.looked_at = Some(Loop {
            position_force: closed_loop.characteristic(DelayedScheme::PositionForce)?,
            force_exchange: closed_loop.characteristic(DelayedScheme::ForceExchange)?,
        });
        Ok(())
    }

    /// What the loop does at a round trip: peak gain of the path that the delay is in; rate in 1/s and frequency in Hz
    /// of the motion that grows fastest, and the gain at that frequency, all three not a number where none grows.
    ///
    /// # Errors
    /// No loop, no such scheme, no such round trip, or roots that are not to be had.
    pub fn outlook(&self, scheme: u32, round_trip_s: f64) -> Result<[f64; 4], Refused> {
        let characteristic = self.under(scheme, round_trip_s)?;
        let peak = characteristic.peak_gain()?;
        let growth = characteristic.fastest_growth(round_trip_s, SLOWEST_PER_S)?;
        Ok(
            growth.map_or([peak, f64::NAN, f64::NAN, f64::NAN], |growth| {
                let omega_rad_s = std::f64::consts::TAU * growth.frequency_hz;
                let gain = characteristic.gain_at(omega_rad_s, 0.0).norm();
                [peak, growth.rate_per_s, growth.frequency_hz, gain]
            }),
        )
    }

    /// The gain along ascending frequencies, in place of whatever `numbers` holds: all frequencies in rad/s, then all
    /// real parts, then all imaginary ones.
    ///
    /// # Errors
    /// As [`Theory::outlook`].
    pub fn curve(
        &self,
        scheme: u32,
        round_trip_s: f64,
        numbers: &mut Vec<f64>,
    ) -> Result<(), Refused> {
        let curve = self.under(scheme, round_trip_s)?.curve(round_trip_s);
        numbers.clear();
        numbers.extend(curve.iter().map(|at| at.omega_rad_s));
        numbers.extend(curve.iter().map(|at| at.gain.re));
        numbers.extend(curve.iter().map(|at| at.gain.im));
        Ok(())
    }

    fn under(&self, scheme: u32, round_trip_s: f64) -> Result<&Characteristic, Refused> {
        if !(round_trip_s.is_finite() && 0.0 <= round_trip_s) {
            return Err(Refused::RoundTrip { got: round_trip_s });
        }
        let looked_at = self.looked_at.as_ref().ok_or(Refused::NoLoop)?;
        match scheme {
            0 => Ok(&looked_at.position_force),
            1 => Ok(&looked_at.force_exchange),
            got => Err(Refused::Scheme { got }),
        }
    }
}

/// The arms of a robot, in place of whatever `found` holds. Numbers in: radii of base and platform, upper and lower
/// links, m; the arms' angles on the base, degrees; the platform's position, m; the signs `K_j`.
///
/// Numbers out, [`NUMBERS_OF_AN_ARM`] for each arm: its direction along x and y, its shoulder, where its rods end on
/// the platform, m; 1 if it reaches and 0 if it does not; its joint angle in rad and its elbow in m, not a number if it
/// does not reach.
///
/// # Errors
/// Numbers that describe no robot or no branch.
pub fn arms(numbers: &[f64], found: &mut Vec<f64>) -> Result<(), Refused> {
    let mut reader = Reader {
        what: "robot at a position",
        numbers,
        at: 0,
    };
    let [base_radius_m, platform_radius_m, upper_link_m, lower_link_m] = reader.some()?;
    let arm_angles_deg: [f64; 3] = reader.some()?;
    let position_m: [f64; 3] = reader.some()?;
    let signs: [f64; 3] = reader.rest()?;
    let geometry = Geometry::new(Dimensions {
        base_radius_m,
        platform_radius_m,
        upper_link_m,
        lower_link_m,
        arm_angles_rad: arm_angles_deg.map(f64::to_radians),
    })?;
    let branch = Branch::from_signs(signs.map(|sign| sign as i64))?;
    found.clear();
    for arm in geometry.arms(&Vector3::from(position_m), branch) {
        found.extend([arm.direction.x, arm.direction.y]);
        found.extend(arm.shoulder_m.iter().chain(&arm.wrist_m));
        match arm.bend {
            Ok(bend) => {
                found.extend([1.0, bend.joint_rad]);
                found.extend(bend.elbow_m.iter());
            }
            Err(_) => found.extend([0.0, f64::NAN, f64::NAN, f64::NAN, f64::NAN]),
        }
    }
    Ok(())
}

/// Numbers, one after the other.
struct Reader<'a> {
    what: &'static str,
    numbers: &'a [f64],
    at: usize,
}

impl<'a> Reader<'a> {
    /// A length, and as many numbers.
    fn list(&mut self) -> Result<&'a [f64], Refused> {
        let [length] = self.some()?;
        let from = self.at;
        self.at = from.saturating_add(length as usize);
        self.numbers.get(from..self.at).ok_or(self.refused())
    }

    fn some<const N: usize>(&mut self) -> Result<[f64; N], Refused> {
        let rest = self.numbers.get(self.at..).unwrap_or_default();
        let found = rest.first_chunk().copied().ok_or(self.refused())?;
        self.at += N;
        Ok(found)
    }

    /// All that are left.
    fn rest<const N: usize>(&mut self) -> Result<[f64; N], Refused> {
        let found = self.some()?;
        if self.at < self.numbers.len() {
            return Err(self.refused());
        }
        Ok(found)
    }

    const fn refused(&self) -> Refused {
        Refused::Numbers {
            what: self.what,
            got: self.numbers.len(),
        }
    }
}
