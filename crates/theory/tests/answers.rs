//! Any request: an answer that can be written down as its type says, or a typed refusal.
//!
//! JSON has no infinity: a figure without a value must be `null` where its type allows that, and must not come up
//! elsewhere.

use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::ops::ControlFlow;
use teleclay_proto::http::theory::{
    ForwardRequest, InverseRequest, JacobianRequest, LoopRequest, RobotGeometry, TransferFunction,
    TunedScheme, TuningRequest, WorkspaceRequest,
};
use teleclay_theory::{Unanswered, analyse, forward, inverse, jacobian, tune, workspace};

/// Writes an answer down and reads it again; a number that JSON cannot hold comes back as a `null`, which is no number.
fn survives<T>(answer: Result<T, Unanswered>) -> Result<(), TestCaseError>
where
    T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug,
{
    if let Ok(answer) = answer {
        let written = serde_json::to_value(&answer).unwrap();
        match serde_json::from_value::<T>(written) {
            Ok(read) => prop_assert_eq!(read, answer),
            Err(error) => prop_assert!(false, "{error} in {answer:?}"),
        }
    }
    Ok(())
}

fn coefficients(longest: usize) -> impl Strategy<Value = Vec<f64>> {
    let coefficient = prop_oneof![
        4 => -10.0..10.0f64,
        2 => Just(0.0),
        2 => Just(1.0),
        1 => (-1.0..1.0f64, -60..60i32).prop_map(|(m, d)| m * 10.0_f64.powi(d)),
    ];
    proptest::collection::vec(coefficient, 1..=longest)
}

/// Swings without damping, so that poles and zeros lie on the axis, beside anything.
fn part(longest: usize) -> impl Strategy<Value = Vec<f64>> {
    let swing = (1..5u32).prop_map(f64::from);
    prop_oneof![
        3 => coefficients(longest),
        1 => swing.clone().prop_map(|k| vec![1.0, 0.0, k]),
        1 => swing.prop_map(|k| vec![1.0, 0.0, 2.0 * k, 0.0, k * k]),
    ]
}

fn function(longest: usize) -> impl Strategy<Value = TransferFunction> {
    (part(longest), part(longest)).prop_map(|(numerator, denominator)| TransferFunction {
        numerator,
        denominator,
    })
}

/// Frequencies on the swings, beside them, and as far out as a request may go.
fn omegas() -> impl Strategy<Value = Vec<f64>> {
    let omega = prop_oneof![
        3 => (1..5u32).prop_map(|k| f64::from(k).sqrt()),
        2 => (-3.0..3.0f64).prop_map(|x| 10f64.powf(x)),
        1 => Just(1e-100),
        1 => Just(1e100),
    ];
    proptest::collection::vec(omega, 0..6)
}

fn or_none(most: f64) -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), 0.0..most]
}

fn loops() -> impl Strategy<Value = LoopRequest> {
    let sides = (
        function(4),
        function(3),
        function(5),
        function(3),
        function(3),
    );
    let rest = (0.1..10.0f64, -10.0..-0.1f64, or_none(100.0), or_none(1e3));
    (sides, part(4), rest, omegas()).prop_map(
        |((g_h, s_h, c_h1, g_t, s_t), t_h, rest, omegas_rad_s)| LoopRequest {
            g_h,
            s_h,
            t_h,
            c_h1,
            g_t,
            s_t,
            position_ratio: rest.0,
            force_ratio: rest.1,
            clay_damping_n_s_per_m: rest.2,
            clay_stiffness_n_per_m: rest.3,
            omegas_rad_s,
        },
    )
}

fn geometries() -> impl Strategy<Value = RobotGeometry> {
    let lengths = proptest::array::uniform4(0.01..0.4f64);
    let other = lengths.prop_map(|lengths_m| RobotGeometry {
        base_radius_m: lengths_m[0],
        platform_radius_m: lengths_m[1],
        upper_link_m: lengths_m[2],
        lower_link_m: lengths_m[3],
        ..RobotGeometry::default()
    });
    prop_oneof![Just(RobotGeometry::default()), other]
}

fn places() -> impl Strategy<Value = [f64; 3]> {
    proptest::array::uniform3(prop_oneof![4 => -0.3..0.3f64, 1 => Just(0.0)])
}

fn branches() -> impl Strategy<Value = [i64; 3]> {
    proptest::array::uniform3(prop_oneof![Just(1), Just(-1)])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_loop_is_answered_in_numbers_that_can_be_written_down(request in loops()) {
        survives(analyse(&request))?;
    }

    #[test]
    fn a_robot_is_answered_in_numbers_that_can_be_written_down(
        geometry in geometries(), position_m in places(), joints_rad in proptest::array::uniform3(-4.0..4.0f64),
        branch in branches(),
    ) {
        survives(inverse(&InverseRequest { geometry, position_m }))?;
        survives(jacobian(&JacobianRequest { geometry, position_m, branch }))?;
        survives(forward(&ForwardRequest { geometry, joints_rad }))?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn a_map_is_answered_in_numbers_that_can_be_written_down(
        geometry in geometries(), branch in branches(), cells in proptest::array::uniform3(1..8u32), low in places(),
        wide in 0.01..0.5f64, is_given in any::<bool>(),
    ) {
        let region_m = is_given.then(|| [low, low.map(|x| x + wide)]);
        survives(workspace(&WorkspaceRequest { geometry, branch, region_m, cells }))?;
    }

    /// Plants of many sharp resonances take a minute: after so many candidates the search is called off.
    #[test]
    fn a_wish_is_answered_in_numbers_that_can_be_written_down(
        g_h in function(3), t_h in coefficients(3), g_t in function(3), damping in 0.0..60.0f64, stiffness in 0.0..200.0f64,
        round_trip_s in or_none(0.2), distance in 0.01..0.9f64, forwards in any::<bool>(),
    ) {
        let request = TuningRequest {
            g_h,
            s_h: TransferFunction::zero(),
            t_h,
            g_t,
            s_t: TransferFunction::zero(),
            position_ratio: 1.0,
            force_ratio: -1.0,
            clay_damping_n_s_per_m: [0.0, damping],
            clay_stiffness_n_per_m: [0.0, stiffness],
            scheme: if forwards { TunedScheme::PositionForce } else { TunedScheme::ForceExchange },
            round_trip_s,
            distance,
            heaviest_n_s_per_m: 300.0,
        };
        let mut left = 3000;
        let go_on = || {
            left -= 1;
            if 0 < left { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        survives(tune(&request, go_on))?;
    }
}

/// What is refused is not looked at above: of loops and robots a good part must have an answer.
#[test]
fn many_requests_have_an_answer() {
    let mut runner = TestRunner::deterministic();
    let mut draw_loop = || loops().new_tree(&mut runner).unwrap().current();
    let loops = (0..300).filter(|_| analyse(&draw_loop()).is_ok()).count();
    let mut runner = TestRunner::deterministic();
    let mut draw_place = || {
        let drawn = (geometries(), places()).new_tree(&mut runner).unwrap();
        let (geometry, position_m) = drawn.current();
        InverseRequest {
            geometry,
            position_m,
        }
    };
    let robots = (0..300).filter(|_| inverse(&draw_place()).is_ok()).count();
    assert!(
        100 < loops && 50 < robots,
        "{loops} loops and {robots} robots of 300"
    );
}
