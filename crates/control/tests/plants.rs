//! Sampled plants against independent step responses, and the inverse of a sampled plant against the plant.

use proptest::prelude::*;
use teleclay_control::{Inverse, Polynomial, State, StateSpace, paper};

const DT_S: f64 = 0.001;

#[test]
fn step_responses_agree_with_the_reference() {
    let cases: serde_json::Value =
        serde_json::from_str(include_str!("reference/plants.json")).unwrap();
    let cases = cases.as_array().unwrap();
    assert_eq!(cases.len(), 8);
    for case in cases {
        let plant = if case["plant"] == "G_hx" {
            paper::g_hx()
        } else {
            paper::g_hy()
        };
        let continuous = StateSpace::from_rational(&plant).unwrap();
        let dt_s = case["dt_s"].as_f64().unwrap();
        let sampled = if case["method"] == "zoh" {
            continuous.zoh(dt_s).unwrap()
        } else {
            continuous.tustin(dt_s).unwrap()
        };
        let wanted: Vec<(u64, f64)> = case["k"]
            .as_array()
            .unwrap()
            .iter()
            .zip(case["y"].as_array().unwrap())
            .map(|(k, y)| (k.as_u64().unwrap(), y.as_f64().unwrap()))
            .collect();
        let last = wanted.iter().map(|(k, _)| *k).max().unwrap();
        let mut state = State::default();
        for k in 0..=last {
            let y = sampled.step(&mut state, 1.0);
            for (_, wanted) in wanted.iter().filter(|(at, _)| *at == k) {
                assert!(
                    (y - wanted).abs() < 1e-9,
                    "{case}: k {k}, got {y}, wanted {wanted}"
                );
            }
        }
    }
}

proptest! {
    /// The inverse reaches any reference one sample later, from any state.
    #[test]
    fn the_inverse_hits_the_next_sample(references in proptest::collection::vec(-0.1..0.1, 1..50)) {
        let g_t = StateSpace::from_rational(&paper::default_g_t()).unwrap().zoh(DT_S).unwrap();
        let inverse = Inverse::new(&g_t).unwrap();
        let (mut model, mut plant) = (State::default(), State::default());
        for reference in references {
            g_t.advance(&mut plant, inverse.step(&mut model, reference));
            prop_assert!((g_t.output(&plant, 0.0) - reference).abs() < 1e-12);
        }
    }

    /// Outputs over one state are the same numbers as two separate systems give.
    #[test]
    fn shared_state_changes_no_output(inputs in proptest::collection::vec(-1.0..1.0, 1..200)) {
        let (g_h, t_h) = (paper::g_hx(), paper::t_hx());
        let reaction = t_h.times(g_h.numerator()).unwrap();
        let both = StateSpace::with_outputs(g_h.denominator(), [g_h.numerator(), &reaction]).unwrap().zoh(DT_S).unwrap();
        let alone = StateSpace::from_rational(&g_h).unwrap().zoh(DT_S).unwrap();
        // 0.25 s² over 0.005 s³/18 s: the arm's mass reacts at once to what the servo does at once.
        prop_assert!((both.direct()[1] - 0.25 * 18.0 / 0.005).abs() < 1e-9 && both.direct()[0].abs() < 1e-15);
        let (mut x, mut y) = (State::default(), State::default());
        for u in inputs {
            let [position_m, _] = both.step_outputs(&mut x, u);
            prop_assert!((position_m - alone.step(&mut y, u)).abs() < 1e-12);
        }
    }
}

/// At rest the arm's answer is its stiffness times the position: 6 N/m (37) times unit gain (35).
#[test]
fn the_arm_answers_with_its_stiffness_at_rest() {
    let g_h = paper::g_hx();
    let reaction = paper::t_hx().times(g_h.numerator()).unwrap();
    let both = StateSpace::with_outputs(g_h.denominator(), [g_h.numerator(), &reaction])
        .unwrap()
        .zoh(DT_S)
        .unwrap();
    let mut state = State::default();
    for _ in 0..400_000 {
        both.advance(&mut state, 0.02);
    }
    let [position_m, force_n] = both.outputs(&state, 0.02);
    assert!(
        (position_m - 0.02).abs() < 1e-9 && (force_n - 0.12).abs() < 1e-9,
        "{position_m} {force_n}"
    );
}

/// A pure mass sampled by zero-order hold has a zero at -1: its inverse would ring for ever.
#[test]
fn a_tool_without_damping_cannot_be_inverted() {
    let mass = teleclay_control::RationalFunction::new(&[1.0], &[0.5, 0.0, 0.0]).unwrap();
    let sampled = StateSpace::from_rational(&mass).unwrap().zoh(DT_S).unwrap();
    assert!(Inverse::new(&sampled).is_err());
}

/// An integrator sampled by zero-order hold counts the area: y_k = k dt for a unit input.
#[test]
fn hold_integrates_exactly() {
    let integrator = teleclay_control::RationalFunction::new(&[1.0], &[1.0, 0.0]).unwrap();
    let sampled = StateSpace::from_rational(&integrator)
        .unwrap()
        .zoh(0.25)
        .unwrap();
    let mut state = State::default();
    for k in 0..8 {
        assert!((sampled.step(&mut state, 1.0) - 0.25 * f64::from(k)).abs() < 1e-15);
    }
}

/// What cannot be sampled says so, and ends.
#[test]
fn plants_out_of_all_proportion_are_refused() {
    use teleclay_control::{DiscretiseError, RationalFunction, StateSpaceError};
    let plant = |denominator: &[f64]| {
        StateSpace::from_rational(&RationalFunction::new(&[1.0], denominator).unwrap())
    };
    let explosive = plant(&[1.0, -1e6]).unwrap();
    assert_eq!(
        explosive.zoh(1.0),
        Err(DiscretiseError::Overflow { dt_s: 1.0 })
    );
    let fast = plant(&[1.0, 1e200, 1e300]).unwrap();
    assert_eq!(fast.zoh(1.0), Err(DiscretiseError::Overflow { dt_s: 1.0 }));
    let at_the_limit = plant(&[1.0, -2000.0]).unwrap();
    assert_eq!(
        at_the_limit.tustin(DT_S),
        Err(DiscretiseError::PoleAtInfinity { rad_s: 2000.0 })
    );
    assert_eq!(
        plant(&[1e-300, 1e300]),
        Err(StateSpaceError::IllScaled { leading: 1e-300 })
    );
}

#[test]
fn improper_and_timeless_systems_are_refused() {
    let mass = Polynomial::new(&[1.0, 0.0, 0.0]).unwrap();
    let lag = Polynomial::new(&[1.0, 1.0]).unwrap();
    assert!(StateSpace::with_outputs(&lag, [&mass]).is_err());
    let plant = StateSpace::from_rational(&paper::g_hx()).unwrap();
    for dt_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(plant.zoh(dt_s).is_err() && plant.tustin(dt_s).is_err());
    }
}
