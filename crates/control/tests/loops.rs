//! Loops against independently computed poles, margins and compensator values.

use serde_json::Value;
use teleclay_control::analysis::{DEFAULT_OMEGAS_RAD_S, LoopInput, analyse};
use teleclay_control::compensators::Sides;
use teleclay_control::{Complex, DelayMargin, Polynomial, RationalFunction};

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

fn function(value: &Value) -> RationalFunction {
    RationalFunction::new(&numbers(&value[0]), &numbers(&value[1])).unwrap()
}

fn input(case: &Value) -> LoopInput {
    LoopInput {
        sides: Sides {
            g_h: function(&case["g_h"]),
            s_h: RationalFunction::zero(),
            g_t: function(&case["g_t"]),
            s_t: RationalFunction::zero(),
            c_h1: function(&case["c_h1"]),
            position_ratio: case["position_ratio"].as_f64().unwrap(),
            force_ratio: case["force_ratio"].as_f64().unwrap(),
        },
        t_h: Polynomial::new(&numbers(&case["t_h"])).unwrap(),
        clay_damping_n_s_per_m: case["clay_damping_n_s_per_m"].as_f64().unwrap(),
        clay_stiffness_n_per_m: case["clay_stiffness_n_per_m"].as_f64().unwrap(),
        omegas_rad_s: DEFAULT_OMEGAS_RAD_S.to_vec(),
    }
}

/// Margins agree to 1e-4 relative, and are absent together.
fn assert_margin(got: DelayMargin, wanted: &Value, what: &str) {
    match (got.seconds(), wanted.as_f64()) {
        (None, None) => {}
        (Some(got), Some(wanted)) => assert!(
            (got - wanted).abs() <= 1e-4 * wanted,
            "{what}: {got}, wanted {wanted}"
        ),
        (got, wanted) => panic!("{what}: {got:?}, wanted {wanted:?}"),
    }
}

#[test]
fn analysis_agrees_with_the_reference() {
    let cases: Value = serde_json::from_str(include_str!("reference/loops.json")).unwrap();
    let cases = cases.as_array().unwrap();
    assert_eq!(cases.len(), 12);
    for (number, case) in cases.iter().enumerate() {
        let what = |part: &str| format!("case {number}, {part}");
        let got = analyse(&input(case)).unwrap();
        let poles = case["closed_loop_poles"].as_array().unwrap();
        assert_eq!(got.closed_loop_poles.len(), poles.len());
        for (got, wanted) in got.closed_loop_poles.iter().zip(poles) {
            let wanted = numbers(wanted);
            let distance = (got - Complex::new(wanted[0], wanted[1])).norm();
            assert!(distance < 1e-5, "{}: {got}", what("poles"));
        }
        assert_eq!(
            got.stable_without_delay,
            case["stable_without_delay"].as_bool().unwrap(),
            "{}",
            what("verdict")
        );
        assert_eq!(
            got.small_gain_holds,
            case["small_gain_holds"].as_bool().unwrap(),
            "{}",
            what("small gain")
        );
        let distance = case["nyquist_min_distance"].as_f64().unwrap();
        let error = (got.nyquist_min_distance - distance).abs() / distance;
        assert!(error < 1e-4, "{}: {error}", what("distance"));
        assert_margin(
            got.delay_margin_force_exchange,
            &case["delay_margin_force_exchange_s"],
            &what("force exchange"),
        );
        assert_margin(
            got.delay_margin_position_force,
            &case["delay_margin_position_force_s"],
            &what("position force"),
        );
        for (row, wanted) in got
            .compensators
            .iter()
            .zip(case["compensators"].as_array().unwrap())
        {
            assert!((row.omega_rad_s - wanted[0].as_f64().unwrap()).abs() < 1e-12);
            for (got, wanted) in [row.c_h1, row.c_t1, row.c_h2, row.c_t2]
                .iter()
                .zip(&wanted.as_array().unwrap()[1..])
            {
                let (got, wanted) = (got.unwrap(), numbers(wanted));
                let distance = (got - Complex::new(wanted[0], wanted[1])).norm();
                assert!(
                    distance <= 1e-12 * (1.0 + got.norm()),
                    "{}: {got}",
                    what("compensators")
                );
            }
        }
        assert!(got.improper_compensators.is_empty());
    }
}
