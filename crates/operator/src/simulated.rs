//! The simulated handle: servo `G_h` and arm `T_h` on each axis, driven by an intent.
//!
//! Both plants share one state, sampled with a zero-order hold: position `G_h v`, velocity `s G_h v` and the arm's pull
//! `T_h G_h v` belong to one motion. The arm's pull has a direct term (900 N/m for the x servo); the sensor is read
//! before the new command takes hold, so it sees the command of the tick before, as a real sensor would.

use teleclay_control::{
    DiscreteStateSpace, DiscretiseError, Polynomial, PolynomialError, State, StateSpace,
    StateSpaceError, paper,
};

use crate::intent::Intent;
use crate::person::Person;
use teleclay_device::DeviceSample;

use crate::{Axes, Vec3};

/// Why a handle cannot be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulatedHandleError {
    /// Plant and arm do not multiply.
    #[error("arm and servo do not combine: {0}")]
    Polynomial(#[from] PolynomialError),
    /// The arm outweighs the servo.
    #[error("arm and servo have no state space: {0}")]
    StateSpace(#[from] StateSpaceError),
    /// Not a sample time.
    #[error("cannot sample: {0}")]
    Discretise(#[from] DiscretiseError),
}

/// A person's arm on the paper's handle.
#[derive(Clone, Debug)]
pub struct SimulatedHandle {
    /// Outputs: position, velocity, arm's pull.
    plants: [DiscreteStateSpace<3>; 3],
    states: [State; 3],
    commands: [f64; 3],
    person: Person,
}

impl SimulatedHandle {
    /// A handle at rest at home, with the paper's plants.
    ///
    /// # Errors
    /// `tick_s` is not a sample time.
    pub fn new(axes: Axes, tick_s: f64, intent: Intent) -> Result<Self, SimulatedHandleError> {
        let arm = paper::t_hx();
        let x = with_arm(&paper::g_hx(), &arm)?.zoh(tick_s)?;
        let y = with_arm(&paper::g_hy(), &arm)?.zoh(tick_s)?;
        let coefficients = arm.coefficients();
        let arm_stiffness_damping = (coefficients[2], coefficients[1]);
        Ok(Self {
            // A third axis takes the x plant.
            plants: [x.clone(), y, x],
            states: [State::default(); 3],
            commands: [0.0; 3],
            person: Person::new(axes, tick_s, intent, arm_stiffness_damping),
        })
    }

    /// What the sensors read now.
    pub fn sample(&self) -> DeviceSample {
        let outputs: [[f64; 3]; 3] = std::array::from_fn(|axis| {
            self.plants[axis].outputs(&self.states[axis], self.commands[axis])
        });
        let mut position = Vec3::from(outputs.map(|output| output[0]));
        let mut velocity = Vec3::from(outputs.map(|output| output[1]));
        let pull = Vec3::from(outputs.map(|output| output[2]));
        let muscle = self.person.muscle_force_n(position, velocity);
        let mut force = self.person.sensor_force_n().unwrap_or(muscle - pull);
        if self.person.axes() == Axes::Two {
            position.z = self.person.lift_m();
            velocity.z = 0.0;
            force.z = 0.0;
        }
        DeviceSample {
            position_m: position.into(),
            velocity_m_s: velocity.into(),
            hand_force_n: force.into(),
        }
    }

    /// Applies the position command `v_h`, m, and lets one tick pass.
    pub fn command(&mut self, command_m: [f64; 3]) {
        for axis in 0..self.person.axes().count() {
            self.plants[axis].advance(&mut self.states[axis], command_m[axis]);
            self.commands[axis] = command_m[axis];
        }
        self.person.pass_tick();
    }

    /// Rounds of a cutting intent that are finished.
    pub fn finished_rounds(&self) -> u64 {
        self.person.finished_rounds()
    }

    /// Changes what the person wants, from its beginning; the handle stays where it is.
    pub fn intend(&mut self, intent: Intent) {
        self.person.intend(intent);
    }

    /// Time since the intent began, s.
    pub fn time_s(&self) -> f64 {
        self.person.time_s()
    }
}

fn with_arm(
    servo: &teleclay_control::RationalFunction,
    arm: &Polynomial,
) -> Result<StateSpace<3>, SimulatedHandleError> {
    let rate = servo.numerator().times(&Polynomial::new(&[1.0, 0.0])?)?;
    let pull = servo.numerator().times(arm)?;
    Ok(StateSpace::with_outputs(
        servo.denominator(),
        [servo.numerator(), &rate, &pull],
    )?)
}

#[cfg(test)]
#[allow(
    clippy::float_cmp,
    reason = "zero and one are meant exactly: a ramp ends, a gain is full"
)]
mod tests {
    use super::*;
    use crate::person::LIFT_SPEED_M_S;

    const TICK_S: f64 = 1e-3;

    fn handle(intent: Intent) -> SimulatedHandle {
        SimulatedHandle::new(Axes::Two, TICK_S, intent).unwrap()
    }

    /// At rest at a commanded position the sensor reads the arm's stiffness, 6 N/m, and nothing else.
    #[test]
    fn a_held_position_reads_the_arms_stiffness() {
        let mut device = handle(Intent::Idle);
        for _ in 0..200_000 {
            device.command([0.02, -0.03, 0.0]);
        }
        let sample = device.sample();
        assert!((sample.position_m[0] - 0.02).abs() < 1e-7, "{sample:?}");
        assert!((sample.hand_force_n[0] + 6.0 * 0.02).abs() < 1e-6);
        assert!((sample.hand_force_n[1] - 6.0 * 0.03).abs() < 1e-6);
        assert!(sample.velocity_m_s.iter().all(|v| v.abs() < 1e-7));
    }

    /// Velocity and arm's pull against differences of the position: the three outputs are one motion.
    #[test]
    fn velocity_and_pull_agree_with_differences_of_the_position() {
        let fine = 1e-5;
        let mut device = SimulatedHandle::new(Axes::Two, fine, Intent::Idle).unwrap();
        let mut trail = Vec::new();
        for k in 0..40_000 {
            let t = f64::from(k) * fine;
            trail.push(device.sample());
            device.command([0.01 * (30.0 * t).sin(), 0.0, 0.0]);
        }
        for k in (1000..39_000).step_by(997) {
            let x = |j: usize| trail[j].position_m[0];
            let velocity = (x(k + 1) - x(k - 1)) / (2.0 * fine);
            assert!((trail[k].velocity_m_s[0] - velocity).abs() < 1e-6, "at {k}");
            // The pull before the new command takes hold: the second difference one sample back.
            let acceleration = (trail[k].velocity_m_s[0] - trail[k - 1].velocity_m_s[0]) / fine;
            let pull = 0.25 * acceleration + 2.0 * velocity + 6.0 * x(k);
            assert!(
                (trail[k].hand_force_n[0] + pull).abs() < 2e-3,
                "at {k}: {} {}",
                trail[k].hand_force_n[0],
                -pull
            );
        }
    }

    #[test]
    fn the_lift_of_a_two_axis_handle_moves_at_its_own_speed_and_has_no_force() {
        let reach = crate::Reach {
            x_m: 0.03,
            y_m: 0.01,
            depth_m: 0.01,
        };
        let mut device = handle(Intent::cutting(reach).unwrap());
        let mut before = 0.0;
        for _ in 0..20_000 {
            device.command([0.0; 3]);
            let sample = device.sample();
            assert!((sample.position_m[2] - before).abs() <= LIFT_SPEED_M_S * TICK_S + 1e-12);
            assert_eq!(sample.hand_force_n[2], 0.0);
            before = sample.position_m[2];
        }
        assert!(device.finished_rounds() <= 1);
    }
}
