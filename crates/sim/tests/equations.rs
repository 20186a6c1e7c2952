//! The equations that a session runs, against the law that they were derived from.

use std::time::Duration;

use proptest::prelude::*;
use teleclay_clay::{Clay, Shape};
use teleclay_operator::Intent;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Scheme, ToolDescription};
use teleclay_session::Lines;
use teleclay_sim::rig::{Rig, Setup};

const HOME_M: [f64; 3] = [0.06, 0.03, 0.066];

/// A ball in a block under force exchange, with bounds that nothing here comes near.
fn session(parameters: LoopParameters) -> Rig {
    Rig::new(Setup {
        parameters: LoopParameters {
            scheme: Scheme::ForceExchange,
            home_m: HOME_M,
            reach_m: [[-10.0; 3], [10.0; 3]],
            speed_limit_m_s: 10.0,
            force_limit_n: 1e3,
            slew_limit_n_per_s: 1e6,
            tool: ToolDescription::Ball { radius_m: 0.004 },
            ..parameters
        },
        clay: Clay::new(
            &Shape::Block {
                size_m: [0.12, 0.06, 0.064],
            },
            1e-3,
        )
        .unwrap(),
        intent: Intent::sensor_force([0.0; 3]).unwrap(),
        lines: Lines::default(),
    })
    .unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// (27) in the session's own loop without delay, which (30)–(32) are there for: y_t = A_h1 y_h at every tick,
    /// whatever the hand does and however the clay answers.
    #[test]
    fn the_tool_stands_at_the_scaled_handle_position(
        tool_mass_kg in 0.2..2.0f64, tool_damping_n_s_per_m in 5.0..40.0f64, tool_stiffness_n_per_m in 0.0..200.0f64,
        position_ratio in 0.25..4.0f64, force_ratio in 0.5..4.0f64,
        forces in proptest::collection::vec(proptest::array::uniform3(-1.0..1.0f64), 1..12),
    ) {
        let mut rig = session(LoopParameters {
            tool_mass_kg, tool_damping_n_s_per_m, tool_stiffness_n_per_m, position_ratio, force_ratio,
            ..LoopParameters::default()
        });
        // Until both sides know each other, forces ramp up.
        rig.run_for(Duration::from_millis(200));
        for force_n in forces {
            rig.device_mut().intend(Intent::sensor_force(force_n).unwrap());
            for _ in 0..100 {
                rig.tick();
                let handle_m = rig.device().sample().position_m;
                let tool_m = rig.tool().view().position_m;
                for axis in 0..3 {
                    let (got, wanted) = (tool_m[axis] - HOME_M[axis], position_ratio * handle_m[axis]);
                    prop_assert!((got - wanted).abs() < 1e-9, "axis {axis}: {got}, wanted {wanted}");
                }
            }
        }
    }
}

/// The same law is broken where the hand's force arrives late: it is the law that the test above holds, and no bound
/// that anything would keep.
#[test]
fn the_tool_stands_elsewhere_when_the_force_is_late() {
    let mut rig = session(LoopParameters::default());
    let late = teleclay_link::conditioner::Impairment {
        delay: Duration::from_millis(5),
        ..Default::default()
    };
    rig.impair(Lines {
        up: late,
        up_seed: 1,
        down: late,
        down_seed: 2,
    });
    rig.run_for(Duration::from_millis(200));
    rig.device_mut()
        .intend(Intent::sensor_force([0.5, 0.0, -0.3]).unwrap());
    rig.run_for(Duration::from_millis(300));
    let (handle_m, tool_m) = (
        rig.device().sample().position_m,
        rig.tool().view().position_m,
    );
    assert!(1e-5 < (tool_m[0] - HOME_M[0] - handle_m[0]).abs());
}
