//! The parallel robot as a handle: the paper's servos and arm, on three joints that have limits. Source: [KHMH03]
//! (1)–(19) in docs/papers.md.
//!
//! ```text
//!   v_h ──G_h──> setpoint ──fence──> place ──inverse kinematics──> joint servos ──tau──> arms ──> platform
//!                  └──resistance──> (+) <──f_h── sensor <── hand ──J^T──> joints
//!                                    └──> what the loop takes for the hand's force
//! ```
//!
//! While nothing limits it, the platform moves as the paper's identified servo `G_h` says, like
//! [`SimulatedHandle`](crate::SimulatedHandle): the joints are sent where inverse kinematics put them, one tick ahead,
//! and hold the hand's force by `tau = -J^T f_h`. Where a joint would have to turn too fast it lags; where a hand is
//! stronger than the servos, it moves them.
//!
//! Near a singularity the robot slows down before its fence and resists: what the loop asks for beyond it becomes a
//! spring's force on it, so that the loop feels the hand balanced, goes no further, and comes back at once. It says so
//! in its [`RobotState`].

mod fence;
mod joints;

use teleclay_control::{DiscreteStateSpace, State, StateSpace, paper};
use teleclay_kinematics::{Assembly, Geometry, KinematicsError, Singularity};

use crate::intent::Intent;
use crate::person::Person;
use teleclay_device::DeviceSample;

use crate::{Axes, SimulatedHandleError, Vec3};
use fence::{Fence, clearance, nearest};
use joints::{Grip, Joints};

/// Pull towards the fence per metre that the loop asks for beyond it, N/m: a palm's width holds the strongest hand of
/// the simulated person, and the loop with the paper's servos keeps 50 degrees of phase.
const RESISTANCE_N_PER_M: f64 = 200.0;
/// Beside it, N s/m, once the setpoint is as far out as [`ENTRY_M`].
const RESISTANCE_N_S_PER_M: f64 = 25.0;
const ENTRY_M: f64 = 0.02;

/// What a joint's servo can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoLimits {
    /// Fastest turn of a joint, rad/s.
    pub speed_rad_s: f64,
    /// Greatest torque on a joint, N·m.
    pub torque_n_m: f64,
    /// What turns with a joint, link and motor, kg·m².
    pub inertia_kg_m2: f64,
    /// How fast a servo that lags plans to slow down, rad/s².
    pub braking_rad_s2: f64,
}

impl Default for ServoLimits {
    /// Small geared motors: at home they hold 25 N and move the platform at 1 m/s, more than a calm hand needs.
    fn default() -> Self {
        Self {
            speed_rad_s: 12.0,
            torque_n_m: 2.0,
            inertia_kg_m2: 1e-3,
            braking_rad_s2: 100.0,
        }
    }
}

/// A robot and where it starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotSetup {
    /// Its dimensions.
    pub geometry: Geometry,
    /// Where the handle's home is in the robot's frame, m; its elbows point outwards there.
    pub home_m: [f64; 3],
    /// Its servos.
    pub limits: ServoLimits,
    /// It goes no nearer to a singularity than this clearance, above 0 and below 1.
    pub least_clearance: f64,
}

impl Default for RobotSetup {
    /// The desk-top robot of the project, at home where it moves alike in all directions (condition number 1.01). Down
    /// to a clearance of 0.3 its joints turn at most four times as fast as at home.
    fn default() -> Self {
        Self {
            geometry: Geometry::default(),
            home_m: [0.0, 0.0, 0.17],
            limits: ServoLimits::default(),
            least_clearance: 0.3,
        }
    }
}

/// Why there is no such robot.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RobotError {
    /// It does not reach its own home.
    #[error("the robot's home: {0}")]
    Home(#[from] KinematicsError),
    /// Home is too near to a singularity.
    #[error("the robot's home has clearance {got} from a singularity, need more than {need}")]
    NoRoom {
        /// Of home.
        got: f64,
        /// The fence's.
        need: f64,
    },
    /// A limit is none.
    #[error("{quantity} is {got}, need a finite number above zero{below}")]
    Limit {
        /// Its name.
        quantity: &'static str,
        /// As given.
        got: f64,
        /// Its upper bound, in words.
        below: &'static str,
    },
    /// The plants cannot be sampled.
    #[error(transparent)]
    Handle(#[from] SimulatedHandleError),
}

/// How the robot stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotState {
    /// `rho_j`, rad.
    pub joints_rad: [f64; 3],
    /// Their rates, rad/s.
    pub rates_rad_s: [f64; 3],
    /// Torques of the last tick, N·m.
    pub torques_n_m: [f64; 3],
    /// How far from the nearest singularity, from 1 down to 0: the least of how far each arm is from stretched or
    /// folded and how far the rods are from one plane.
    pub clearance: f64,
    /// Which is nearest.
    pub nearest: Singularity,
    /// The fence holds it: the loop asks for a place nearer.
    pub is_held: bool,
    /// A joint turned as fast as it may in the last tick, and the handle lags.
    pub is_slowed: bool,
    /// A joint's torque was not enough in the last tick: the hand is stronger.
    pub is_overpowered: bool,
}

/// A person's arm on the parallel robot.
#[derive(Clone, Debug)]
pub struct RobotHandle {
    tick_s: f64,
    fence: Fence,
    limits: ServoLimits,
    /// Position and velocity of the paper's servo.
    plants: [DiscreteStateSpace<2>; 3],
    states: [State; 3],
    commands: Vec3,
    /// How far the setpoint lies beyond the fence, m.
    beyond: Vec3,
    joints: Joints,
    arm: Arm,
    person: Person,
}

/// `T_h`: mass, damping, stiffness.
#[derive(Clone, Copy, Debug)]
struct Arm {
    mass_kg: f64,
    damping_n_s_per_m: f64,
    stiffness_n_per_m: f64,
}

impl RobotHandle {
    /// A robot at rest at home, with the paper's plants.
    ///
    /// # Errors
    /// `tick_s` is not a sample time, a limit is none, or home is out of reach or too near to a singularity.
    pub fn new(
        axes: Axes,
        tick_s: f64,
        intent: Intent,
        setup: &RobotSetup,
    ) -> Result<Self, RobotError> {
        let RobotSetup {
            geometry,
            home_m,
            limits,
            least_clearance,
        } = *setup;
        let ServoLimits {
            speed_rad_s,
            torque_n_m,
            inertia_kg_m2,
            braking_rad_s2,
        } = limits;
        let endless = f64::INFINITY;
        for (quantity, got, below, most) in [
            ("speed_rad_s", speed_rad_s, "", endless),
            ("torque_n_m", torque_n_m, "", endless),
            ("inertia_kg_m2", inertia_kg_m2, "", endless),
            ("braking_rad_s2", braking_rad_s2, "", endless),
            ("least_clearance", least_clearance, " and below 1", 1.0),
        ] {
            if !(0.0 < got && got < most) {
                return Err(RobotError::Limit {
                    quantity,
                    got,
                    below,
                });
            }
        }
        let home = Vec3::from(home_m);
        let branch = geometry.outward_branch(&home);
        let posture = geometry.posture(&home, branch)?;
        let got = clearance(&posture);
        if got <= least_clearance {
            let need = least_clearance;
            return Err(RobotError::NoRoom { got, need });
        }
        let [front, back] = geometry.forward(&posture.joints_rad())?;
        let assembly = if (front - home).norm() < (back - home).norm() {
            Assembly::Front
        } else {
            Assembly::Back
        };
        let [x, y] = [paper::g_hx(), paper::g_hy()];
        let (x, y) = (servo(&x, tick_s)?, servo(&y, tick_s)?);
        let arm = paper::t_hx();
        let coefficients = arm.coefficients();
        let arm = Arm {
            mass_kg: coefficients[0],
            damping_n_s_per_m: coefficients[1],
            stiffness_n_per_m: coefficients[2],
        };
        let learnt = (arm.stiffness_n_per_m, arm.damping_n_s_per_m);
        Ok(Self {
            tick_s,
            fence: Fence {
                geometry,
                branch,
                home,
                clearance: least_clearance,
            },
            limits,
            plants: [x.clone(), y, x],
            states: [State::default(); 3],
            commands: Vec3::zeros(),
            beyond: Vec3::zeros(),
            joints: Joints::at_rest(posture, assembly),
            arm,
            person: Person::new(axes, tick_s, intent, learnt),
        })
    }

    /// What the sensors read now. The force is the hand's and the robot's resistance together: the net force that moves
    /// the handle.
    pub fn sample(&self) -> DeviceSample {
        let (position, mut velocity) = (self.displacement(), self.velocity());
        let grip = self.grip();
        let held = self.joints.acceleration * grip.mass_kg;
        let mut force = grip.force - held + self.resistance();
        if self.person.axes() == Axes::Two {
            velocity.z = 0.0;
            force.z = 0.0;
        }
        DeviceSample {
            position_m: position.into(),
            velocity_m_s: velocity.into(),
            hand_force_n: force.into(),
        }
    }

    /// Applies the position command `v_h`, m, and lets one tick pass. A command that is not finite is not followed.
    pub fn command(&mut self, command_m: [f64; 3]) {
        let grip = self.grip();
        if command_m.iter().all(|v| v.is_finite()) {
            self.commands = Vec3::from(command_m);
        }
        for axis in 0..self.person.axes().count() {
            self.plants[axis].advance(&mut self.states[axis], self.commands[axis]);
        }
        self.person.pass_tick();
        let setpoint = self.setpoint();
        let (allowed, target) = self.fence.allow(setpoint);
        self.beyond = setpoint - allowed;
        let Self {
            limits,
            fence,
            tick_s,
            joints,
            ..
        } = self;
        joints.step(target, &grip, limits, fence, *tick_s);
    }

    /// How the robot stands.
    pub fn state(&self) -> RobotState {
        let joints = &self.joints;
        RobotState {
            joints_rad: joints.posture.joints_rad().into(),
            rates_rad_s: joints.rates.into(),
            torques_n_m: joints.torques.into(),
            clearance: clearance(&joints.posture),
            nearest: nearest(&joints.posture),
            is_held: self.beyond != Vec3::zeros() || joints.is_stopped,
            is_slowed: joints.is_slowed,
            is_overpowered: joints.is_overpowered,
        }
    }

    /// Rounds of a cutting intent that are finished.
    pub fn finished_rounds(&self) -> u64 {
        self.person.finished_rounds()
    }

    /// Changes what the person wants, from its beginning; the handle stays where it is.
    pub fn intend(&mut self, intent: Intent) {
        self.person.intend(intent);
    }

    fn displacement(&self) -> Vec3 {
        self.joints.posture.position_m() - self.fence.home
    }

    fn velocity(&self) -> Vec3 {
        let velocity = self.joints.posture.velocity_m_s(&self.joints.rates);
        velocity.expect("rates are finite and the stops keep the posture regular")
    }

    /// Where the paper's servo would have the handle, m from home.
    fn setpoint(&self) -> Vec3 {
        let mut setpoint = self.servos(0);
        if self.person.axes() == Axes::Two {
            setpoint.z = self.person.lift_m();
        }
        setpoint
    }

    fn servos(&self, output: usize) -> Vec3 {
        Vec3::from_fn(|axis, _| {
            self.plants[axis].outputs(&self.states[axis], self.commands[axis])[output]
        })
    }

    /// The hand as it is now.
    fn grip(&self) -> Grip {
        let (position, velocity) = (self.displacement(), self.velocity());
        let Arm {
            mass_kg,
            damping_n_s_per_m,
            stiffness_n_per_m,
        } = self.arm;
        self.person.sensor_force_n().map_or_else(
            || {
                let carried = velocity * damping_n_s_per_m + position * stiffness_n_per_m;
                let force = self.person.muscle_force_n(position, velocity) - carried;
                Grip { force, mass_kg }
            },
            |force| Grip {
                force,
                mass_kg: 0.0,
            },
        )
    }

    fn resistance(&self) -> Vec3 {
        let depth = self.beyond.norm();
        if depth == 0.0 {
            return Vec3::zeros();
        }
        let outwards = self.beyond / depth;
        let damping = RESISTANCE_N_S_PER_M * (depth / ENTRY_M).min(1.0);
        let drawn = RESISTANCE_N_PER_M * depth + damping * self.servos(1).dot(&outwards);
        // A fence holds and never pulls.
        outwards * -drawn.max(0.0)
    }
}

fn servo(
    plant: &teleclay_control::RationalFunction,
    tick_s: f64,
) -> Result<DiscreteStateSpace<2>, SimulatedHandleError> {
    let s = teleclay_control::Polynomial::new(&[1.0, 0.0])?;
    let rate = plant.numerator().times(&s)?;
    Ok(StateSpace::with_outputs(plant.denominator(), [plant.numerator(), &rate])?.zoh(tick_s)?)
}
