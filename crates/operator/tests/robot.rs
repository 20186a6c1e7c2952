//! The parallel robot as a handle, against the Cartesian handle, energy, and its own limits.

use proptest::prelude::*;
use teleclay_operator::{
    Axes, Intent, RobotError, RobotHandle, RobotSetup, RobotState, ServoLimits, SimulatedHandle,
    Vec3,
};

const TICK_S: f64 = 1e-3;
/// Setpoints beyond the fence are drawn back with this much; see the robot's module.
const RESISTANCE_N_PER_M: f64 = 200.0;

fn robot(intent: Intent) -> RobotHandle {
    RobotHandle::new(Axes::Three, TICK_S, intent, &RobotSetup::default()).unwrap()
}

fn position(robot: &RobotHandle) -> Vec3 {
    Vec3::from(robot.sample().position_m)
}

/// A calm figure in the room of the cutting strokes, that begins from rest.
fn figure(t_s: f64) -> [f64; 3] {
    let begin = t_s.min(1.0).powi(3) * (4.0 - 3.0 * t_s.min(1.0));
    [
        begin * 0.045 * (3.0 * t_s).sin(),
        begin * 0.018 * (4.3 * t_s).sin(),
        begin * 0.012 * (2.1 * t_s).cos(),
    ]
}

/// Where nothing limits it, the robot is the paper's handle: the same places to 1e-9 m, and the force of an arm,
/// `-(0.25 a + 2 v + 6 x)`, that moves as that handle does, half a tick late as differences are.
#[test]
fn a_robot_with_room_is_the_papers_handle() {
    let mut robot = robot(Intent::Idle);
    let mut handle = SimulatedHandle::new(Axes::Three, TICK_S, Intent::Idle).unwrap();
    let mut velocities = [Vec3::zeros(); 3];
    let (mut furthest, mut strongest) = (0.0_f64, 0.0_f64);
    for tick in 0..10_000 {
        let command = figure(f64::from(tick) * TICK_S);
        robot.command(command);
        handle.command(command);
        let (got, wanted) = (robot.sample(), handle.sample());
        let place = Vec3::from(wanted.position_m);
        let miss = (Vec3::from(got.position_m) - place).norm();
        assert!(miss < 1e-9, "tick {tick}: {miss} m");
        velocities = [wanted.velocity_m_s.into(), velocities[0], velocities[1]];
        let velocity = (velocities[0] + velocities[1]) * 0.5;
        let slip = (Vec3::from(got.velocity_m_s) - velocity).norm();
        assert!(slip < 1e-4, "tick {tick}: {slip} m/s");
        let acceleration = (velocities[0] - velocities[2]) / (2.0 * TICK_S);
        let force = -(acceleration * 0.25 + velocity * 2.0 + place * 6.0);
        let slip = (Vec3::from(got.hand_force_n) - force).norm();
        assert!(slip < 2e-3, "tick {tick}: {slip} N");
        let state = robot.state();
        assert!(!(state.is_held || state.is_slowed || state.is_overpowered));
        furthest = furthest.max(place.norm());
        strongest = strongest.max(force.norm());
    }
    assert!(0.04 < furthest, "the handle hardly moved: {furthest} m");
    assert!(0.3 < strongest, "the arm hardly pulled: {strongest} N");
}

/// Power is equal at both ends, `tau . rho_dot = F . X_dot`: what the servos put into the joints beyond the arms' own
/// energy arrives at the hand, with the hand's travel taken from differences of the platform's place and the force from
/// the sensor. Once under a steady force, once with an arm whose mass has to be swung round.
#[test]
fn power_at_the_joints_is_power_at_the_hand() {
    let push = [6.0, -4.0, 8.0];
    for intent in [Intent::sensor_force(push), Intent::constant_force(push)] {
        let mut robot = robot(intent.unwrap());
        let (mut work_joints, mut work_hand, mut moved) = (0.0, 0.0, 0.0);
        for tick in 0..5_000 {
            let (was, felt) = (robot.state(), robot.sample());
            robot.command(figure(f64::from(tick) * TICK_S));
            let (state, sample) = (robot.state(), robot.sample());
            let squares = |state: &RobotState| Vec3::from(state.rates_rad_s).norm_squared();
            let inertia = ServoLimits::default().inertia_kg_m2;
            let kinetic_j = 0.5 * inertia * (squares(&state) - squares(&was));
            let turned = Vec3::from(state.joints_rad) - Vec3::from(was.joints_rad);
            let torques = Vec3::from(state.torques_n_m);
            let joints_j = torques.dot(&turned) - kinetic_j;
            let way = Vec3::from(sample.position_m) - Vec3::from(felt.position_m);
            let forces = [felt, sample].map(|sample| Vec3::from(sample.hand_force_n));
            let force = (forces[0] + forces[1]) * 0.5;
            let hand_j = -force.dot(&way);
            let slack_j = POWER_SLACK * torques.norm() * turned.norm() + 1e-8;
            assert!(
                (joints_j - hand_j).abs() < slack_j,
                "tick {tick}: {joints_j} J at the joints, {hand_j} J at the hand"
            );
            work_joints += joints_j;
            work_hand += hand_j;
            moved += hand_j.abs();
        }
        assert!(0.5 < moved, "hardly any power flowed: {moved} J");
        let gap = (work_joints - work_hand).abs();
        assert!(gap < 1e-3 * moved, "{work_joints} J, {work_hand} J");
    }
}

/// Where the arm's mass is swung round, the servos push it as mechanics says:
/// `tau = I rho_ddot + J^T (m X_ddot - f_0)`, with the joints' rates and the platform's places as they were,
/// differentiated here. A term of the acceleration is the turning of `J`; the faster the figure, the more of it.
#[test]
fn an_arm_that_is_swung_round_weighs_on_the_joints_by_its_true_acceleration() {
    const ARM_KG: f64 = 0.25;
    let setup = RobotSetup::default();
    let home = Vec3::from(setup.home_m);
    let branch = setup.geometry.outward_branch(&home);
    let mut robot = robot(Intent::Idle);
    let (mut places, mut rates) = ([home; 2], Vec3::zeros());
    let (mut worst, mut strongest, mut turning) = (0.0_f64, 0.0_f64, 0.0_f64);
    for tick in 0..5_000 {
        let sample = robot.sample();
        let here = home + Vec3::from(sample.position_m);
        robot.command(figure(4.0 * f64::from(tick) * TICK_S));
        let state = robot.state();
        let next = home + position(&robot);
        let acceleration = (next - here * 2.0 + places[0]) / TICK_S.powi(2);
        places = [here, places[0]];
        let turned = Vec3::from(state.rates_rad_s);
        let rate = (turned - std::mem::replace(&mut rates, turned)) / TICK_S;
        let carried = Vec3::from(sample.velocity_m_s) * 2.0 + (here - home) * 6.0;
        let posture = setup.geometry.posture(&here, branch).unwrap();
        let of = |force: Vec3| posture.torques_n_m(&force).unwrap();
        let wanted =
            rate * ServoLimits::default().inertia_kg_m2 + of(acceleration * ARM_KG + carried);
        if 100 < tick {
            worst = worst.max((Vec3::from(state.torques_n_m) - wanted).norm());
            strongest = strongest.max(wanted.norm());
            let of_turning = posture.acceleration_m_s2(&turned, &Vec3::zeros()).unwrap();
            turning = turning.max(of(of_turning * ARM_KG).norm());
        }
    }
    println!(
        "off by {worst:.2e} of {strongest:.3} N m, {turning:.2e} N m of it from the turning of J"
    );
    assert!(0.05 < turning, "too calm a figure to tell");
    assert!(worst < 1e-3, "off by {worst} N m");
}

/// A tick's power is known to the half tick by which force and motion differ in it.
const POWER_SLACK: f64 = 2e-3;

/// A push at rest is held by `tau = -J^T f`, by the kinematics' own Jacobian.
#[test]
fn a_resting_push_is_held_by_the_transposed_jacobian() {
    let setup = RobotSetup::default();
    let force = Vec3::new(5.0, -3.0, 7.0);
    let mut robot = robot(Intent::sensor_force(force.into()).unwrap());
    for _ in 0..3_000 {
        robot.command([0.03, -0.02, 0.01]);
    }
    let home = Vec3::from(setup.home_m);
    let at = home + position(&robot);
    let branch = setup.geometry.outward_branch(&home);
    let posture = setup.geometry.posture(&at, branch).unwrap();
    let wanted = -posture.torques_n_m(&force).unwrap();
    let got = Vec3::from(robot.state().torques_n_m);
    // The paper's servo creeps at the rate of its slow zero, so rest is never quite reached.
    assert!(
        (got - wanted).norm() < 1e-5 && 0.3 < wanted.norm(),
        "{got} {wanted}"
    );
}

/// The loop around the handle as the paper has it without a tool: `v = f / (M s² + B s)` on each axis.
#[derive(Default)]
struct Loop {
    velocity: Vec3,
    command: Vec3,
}

impl Loop {
    fn step(&mut self, force: Vec3) -> [f64; 3] {
        let (mass_kg, damping_n_s_per_m) = (1.0, 10.0);
        self.velocity += (force - self.velocity * damping_n_s_per_m) * (TICK_S / mass_kg);
        self.command += self.velocity * TICK_S;
        self.command.into()
    }
}

/// A hand pushes from home towards the edge of reach until the robot holds it, and then pulls back. Returns how it was
/// held and how far it came back.
fn push_out_and_pull_back(push: Vec3) -> (RobotState, f64) {
    let mut robot = robot(Intent::constant_force(push.into()).unwrap());
    let mut outer = Loop::default();
    let mut before = (robot.sample(), robot.state());
    let mut tick = |robot: &mut RobotHandle| {
        // A new intent begins with slack muscles: that is the hand's doing.
        before.0 = robot.sample();
        robot.command(outer.step(Vec3::from(before.0.hand_force_n)));
        let after = (robot.sample(), robot.state());
        assert!(0.3 - 1e-9 <= after.1.clearance, "{:?}", after.1);
        let difference = |a: [f64; 3], b: [f64; 3]| Vec3::from(a) - Vec3::from(b);
        let way = difference(after.0.position_m, before.0.position_m);
        assert!(way.norm() < 1.0 * TICK_S, "{} m in a tick", way.norm());
        let turned = difference(after.1.joints_rad, before.1.joints_rad);
        let speed = ServoLimits::default().speed_rad_s;
        assert!(turned.amax() <= speed * TICK_S + 1e-12);
        let force = difference(after.0.hand_force_n, before.0.hand_force_n);
        // The push itself builds up, or turns round, at a fiftieth of itself a tick.
        assert!(
            force.norm() < JOLT_N * push.norm(),
            "{} N in a tick at {:?}, push {push}",
            force.norm(),
            after.0.position_m
        );
        before = after;
        after
    };
    for _ in 0..6_000 {
        tick(&mut robot);
    }
    let (rest, held) = tick(&mut robot);
    robot.intend(Intent::constant_force((-push).into()).unwrap());
    let mut back = rest;
    for _ in 0..400 {
        back = tick(&mut robot).0;
    }
    let way = Vec3::from(rest.position_m) - Vec3::from(back.position_m);
    (held, way.dot(&push.normalize()))
}

/// The greatest change of force in a tick, as a share of the push.
const JOLT_N: f64 = 0.1;

#[test]
fn near_a_singularity_the_robot_resists_and_says_so_and_lets_go_when_pulled_back() {
    for push in [
        Vec3::new(0.0, 0.0, 6.0),
        Vec3::new(0.0, 0.0, -6.0),
        Vec3::new(8.0, 0.0, 0.0),
        Vec3::new(-8.0, 0.0, 0.0),
        Vec3::new(0.0, -8.0, 3.0),
        Vec3::new(5.0, 5.0, 5.0),
        Vec3::new(-3.0, 6.0, -3.0),
    ] {
        let (held, back_m) = push_out_and_pull_back(push);
        assert!(held.is_held && held.clearance < 0.4, "{push}: {held:?}");
        assert!(0.005 < back_m, "{push}: came back {back_m} m in 0.4 s");
    }
}

/// The spring of the fence balances the hand: the loop feels no force in the end, and its setpoint lies beyond by force
/// over stiffness.
#[test]
fn resistance_balances_the_hand() {
    let push = Vec3::new(0.0, 0.0, 6.0);
    let mut robot = robot(Intent::sensor_force(push.into()).unwrap());
    let mut outer = Loop::default();
    for _ in 0..10_000 {
        let force = Vec3::from(robot.sample().hand_force_n);
        robot.command(outer.step(force));
    }
    let left = Vec3::from(robot.sample().hand_force_n).norm();
    assert!(left < 1e-3, "{left} N are left");
    let beyond = outer.command.z - position(&robot).z;
    let wanted = push.z / RESISTANCE_N_PER_M;
    // The paper's servo follows to a thousandth and creeps the rest.
    assert!(
        (beyond - wanted).abs() < 2e-3 * outer.command.z,
        "{beyond} m, wanted {wanted} m"
    );
}

fn intents() -> impl Strategy<Value = Intent> {
    let force = prop::array::uniform3(-300.0..300.0f64);
    (force, 0.1..30.0f64, 0..3).prop_map(|(force, frequency_hz, kind)| {
        match kind {
            0 => Intent::constant_force(force),
            1 => Intent::sensor_force(force),
            _ => Intent::sinusoid(force, frequency_hz),
        }
        .unwrap()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Whatever is commanded and however strong the hand: speed, torque and stops are kept, the branch never changes,
    /// joints and place never jump, and every figure is a number.
    #[test]
    fn limits_hold_whatever_comes(
        intent in intents(),
        commands in prop::collection::vec((prop::array::uniform3(-0.4..0.4f64), 1..400u32), 1..12),
        spoil in any::<bool>(),
    ) {
        let setup = RobotSetup::default();
        let limits = setup.limits;
        let mut robot = robot(intent);
        let home = Vec3::from(setup.home_m);
        let branch = setup.geometry.outward_branch(&home);
        let mut before = robot.state();
        for (command, ticks) in commands {
            for tick in 0..ticks {
                let spoilt = spoil && tick % 7 == 0;
                robot.command(if spoilt { [f64::NAN, f64::INFINITY, 0.0] } else { command });
                let (state, sample) = (robot.state(), robot.sample());
                let largest = |values: [f64; 3]| Vec3::from(values).amax();
                prop_assert!(largest(state.rates_rad_s) <= limits.speed_rad_s);
                prop_assert!(largest(state.torques_n_m) <= limits.torque_n_m);
                prop_assert!(0.5 * setup.least_clearance <= state.clearance);
                let turned = Vec3::from(state.joints_rad) - Vec3::from(before.joints_rad);
                prop_assert!((turned - Vec3::from(state.rates_rad_s) * TICK_S).amax() < 1e-12);
                let at = home + Vec3::from(sample.position_m);
                let posture = setup.geometry.posture(&at, branch).unwrap();
                prop_assert!((posture.joints_rad() - Vec3::from(state.joints_rad)).amax() < 1e-9);
                let all = [sample.position_m, sample.velocity_m_s, sample.hand_force_n];
                prop_assert!(all.as_flattened().iter().all(|value| value.is_finite()));
                before = state;
            }
        }
    }
}

/// A hand stronger than the servos moves them, towards the stops and not through them; when it lets go, the robot goes
/// back to where it was sent.
#[test]
fn a_hand_stronger_than_the_servos_moves_them() {
    let mut robot = robot(Intent::sensor_force([0.0, 0.0, 200.0]).unwrap());
    let mut highest = 0.0_f64;
    let mut was_overpowered = false;
    for _ in 0..2_000 {
        robot.command([0.0; 3]);
        highest = highest.max(position(&robot).z);
        was_overpowered |= robot.state().is_overpowered;
    }
    assert!(was_overpowered && 0.04 < highest, "{highest} m");
    robot.intend(Intent::sensor_force([0.0; 3]).unwrap());
    for _ in 0..2_000 {
        robot.command([0.0; 3]);
    }
    assert!(position(&robot).norm() < 1e-6, "{}", position(&robot));
    assert!(!robot.state().is_overpowered);
}

/// Slow joints lag on the straight way and catch up.
#[test]
fn slow_joints_lag_and_catch_up() {
    let mut setup = RobotSetup::default();
    setup.limits.speed_rad_s = 0.2;
    let mut robot = RobotHandle::new(Axes::Three, TICK_S, Intent::Idle, &setup).unwrap();
    let mut slowed = 0;
    for _ in 0..4_000 {
        robot.command([0.0, 0.0, -0.03]);
        slowed += u32::from(robot.state().is_slowed);
        let at = position(&robot);
        assert!(at.xy().norm() < 1e-4, "{at}");
    }
    assert!(500 < slowed && slowed < 3_000, "{slowed} ticks");
    let z = position(&robot).z;
    assert!((z + 0.03).abs() < 1e-4, "{z}");
}

/// Where joints have ways of different lengths, the longest is turned at the limit and the others in proportion.
#[test]
fn slow_joints_keep_their_proportions() {
    let mut setup = RobotSetup::default();
    setup.limits.speed_rad_s = 0.2;
    let mut robot = RobotHandle::new(Axes::Three, TICK_S, Intent::Idle, &setup).unwrap();
    let mut slowed = 0;
    for _ in 0..500 {
        robot.command([0.03, -0.01, 0.01]);
        let state = robot.state();
        let at_limit = |rate: &&f64| 0.199 < rate.abs();
        let fastest = state.rates_rad_s.iter().filter(at_limit).count();
        if state.is_slowed && 0 < slowed {
            assert_eq!(fastest, 1, "{state:?}");
        }
        slowed += u32::from(state.is_slowed);
    }
    assert!(100 < slowed, "{slowed} ticks");
}

/// On two axes the robot carries the lift at the height at which the operator holds it.
#[test]
fn on_two_axes_the_third_is_a_lift() {
    let reach = teleclay_operator::Reach {
        x_m: 0.03,
        y_m: 0.01,
        depth_m: 0.01,
    };
    let cutting = Intent::cutting(reach).unwrap();
    let setup = RobotSetup::default();
    let mut robot = RobotHandle::new(Axes::Two, TICK_S, cutting.clone(), &setup).unwrap();
    let mut handle = SimulatedHandle::new(Axes::Two, TICK_S, cutting).unwrap();
    let mut lowest = 0.0_f64;
    for _ in 0..20_000 {
        robot.command([0.0; 3]);
        handle.command([0.0; 3]);
        let (got, wanted) = (robot.sample(), handle.sample());
        // A lift starts and stops at once, arms take some ticks to.
        let behind = got.position_m[2] - wanted.position_m[2];
        assert!(behind.abs() < 1e-3, "{behind} m");
        assert!(got.hand_force_n[2].abs() + got.velocity_m_s[2].abs() < f64::MIN_POSITIVE);
        lowest = lowest.min(got.position_m[2]);
    }
    assert!(lowest < -0.005, "{lowest}");
}

#[test]
fn what_is_no_robot_is_refused_by_name() {
    let with = |change: fn(&mut RobotSetup)| {
        let mut setup = RobotSetup::default();
        change(&mut setup);
        RobotHandle::new(Axes::Three, TICK_S, Intent::Idle, &setup)
            .unwrap_err()
            .to_string()
    };
    let far = with(|setup| setup.home_m = [0.0, 0.0, 0.9]);
    assert!(
        far.contains("the robot's home: position is out of reach"),
        "{far}"
    );
    let edge = with(|setup| setup.home_m = [0.0, 0.0, 0.287]);
    assert!(edge.contains("need more than 0.3"), "{edge}");
    let limp = with(|setup| setup.limits.torque_n_m = 0.0);
    assert_eq!(limp, "torque_n_m is 0, need a finite number above zero");
    let rigid = with(|setup| setup.limits.inertia_kg_m2 = f64::INFINITY);
    assert!(rigid.starts_with("inertia_kg_m2 is inf"), "{rigid}");
    let closed = with(|setup| setup.least_clearance = 1.0);
    assert!(closed.ends_with("above zero and below 1"), "{closed}");
    let tick = RobotHandle::new(Axes::Three, 0.0, Intent::Idle, &RobotSetup::default());
    assert!(matches!(tick, Err(RobotError::Handle(_))));
}
