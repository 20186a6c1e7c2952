//! Answers of the theory where figures have no value: each is as the OpenAPI document describes it.

use serde_json::{Value, json};

use crate::calls::theory_calls;
use crate::rig::shared;
use crate::schema::differences;

/// A loop through the arm or the clay alone, and what differs in it.
fn odd_loop(differing: &Value) -> Value {
    let one = json!({ "numerator": [1], "denominator": [1] });
    let mut body = json!({
        "g_h": one, "t_h": [0], "c_h1": one, "g_t": one, "position_ratio": 1, "force_ratio": -1,
        "clay_damping_n_s_per_m": 0, "clay_stiffness_n_per_m": 0,
    });
    for (name, value) in differing.as_object().unwrap() {
        body[name] = value.clone();
    }
    body
}

fn fraction(numerator: &[f64], denominator: &[f64]) -> Value {
    json!({ "numerator": numerator, "denominator": denominator })
}

/// Loops whose figures have no value here and there: nothing in the loop, poles and zeros on the grid and at rest,
/// gains and frequencies at the ends of the range of numbers.
fn odd_loops() -> Vec<Value> {
    let (two, three) = (2f64.sqrt(), 3f64.sqrt());
    let resonant = fraction(&[1.0], &[1.0, 0.0, 3.0]);
    [
        json!({ "c_h1": fraction(&[1.0], &[1.0, 2.0, 0.0]) }),
        json!({ "c_h1": fraction(&[0.0], &[1.0]), "t_h": [1] }),
        json!({ "c_h1": resonant, "t_h": [1], "omegas_rad_s": [three, 2.0, 1.0] }),
        json!({ "c_h1": resonant, "t_h": [1, 0, 3], "omegas_rad_s": [three] }),
        json!({ "c_h1": resonant, "t_h": [1, 0, 2], "omegas_rad_s": [two, three] }),
        json!({ "c_h1": fraction(&[1.0, 0.0, 2.0], &[1.0, 2.0, 1.0]), "t_h": [1], "omegas_rad_s": [two, 1e-100, 1e100] }),
        json!({ "c_h1": fraction(&[1.0], &[1.0, 0.0, 0.0]), "t_h": [1], "omegas_rad_s": [1e-100, 1e100] }),
        json!({ "c_h1": fraction(&[1.0, 0.0, 0.0], &[1.0]), "t_h": [1, 0, 0], "omegas_rad_s": [1e-100, 1e100] }),
        json!({ "c_h1": fraction(&[1e200], &[1.0, 1.0]), "t_h": [1e100, 1], "omegas_rad_s": [1e-100, 1e100] }),
        json!({ "c_h1": fraction(&[1e-200], &[1.0, 1.0]), "t_h": [1e-120], "omegas_rad_s": [1e-100, 1e100] }),
        json!({ "c_h1": fraction(&[-1.0, 10.0], &[1.0, 10.0]), "clay_stiffness_n_per_m": 1 }),
        json!({ "g_h": fraction(&[1e6], &[1.0, 200.0, 2e4, 1e6]), "c_h1": fraction(&[2e-3], &[1.0]), "clay_stiffness_n_per_m": 500 }),
        json!({ "g_h": fraction(&[1.0], &[0.0, 1.0]), "g_t": fraction(&[1.0, 0.0, 3.0], &[1.0, 1.0, 1.0]), "omegas_rad_s": [three] }),
    ]
    .iter()
    .map(odd_loop)
    .collect()
}

/// What the document says of each answer holds for it, null by null.
#[test]
fn every_answer_of_the_theory_is_as_described() {
    let site = shared().site();
    let document: Value = site.get("/api/v1/openapi.json").json();
    let plain = theory_calls()
        .into_iter()
        .map(|call| (call.route, call.full));
    let loops = odd_loops()
        .into_iter()
        .map(|body| ("/api/v1/analysis/loop", body));
    let others = [
        // Mostly out of reach, and wholly.
        (
            "/api/v1/kinematics/workspace",
            json!({ "region_m": [[-1, -1, -1], [1, 1, 1]], "cells": [9, 9, 9] }),
        ),
        (
            "/api/v1/kinematics/workspace",
            json!({ "region_m": [[5, 5, 5], [6, 6, 6]], "cells": [2, 2, 2] }),
        ),
    ];
    let mut answered = 0;
    for (route, body) in plain.chain(loops).chain(others) {
        let answer = site.post(route, &body);
        let told: Value = answer.json();
        let responses = &document["paths"][route]["post"]["responses"];
        let media = if answer.status == 200 {
            "application/json"
        } else {
            "application/problem+json"
        };
        let schema = &responses[answer.status.to_string()]["content"][media]["schema"];
        let wrong = differences(&document, schema, &told);
        assert!(
            wrong.is_empty(),
            "{route} {body}: {} {:?}",
            wrong.len(),
            wrong.first()
        );
        answered += usize::from(answer.status == 200);
    }
    assert!(18 < answered, "only {answered} had an answer to look at");
}

/// A curve that leaves the unit circle at rest does not cross it; a pole on the axis has no peak, and a zero is no
/// crossover.
#[test]
fn what_touches_is_not_taken_for_what_crosses() {
    let site = shared().site();
    let ask = |differing: Value| -> Value {
        let answer = site.post("/api/v1/analysis/loop", &odd_loop(&differing));
        assert_eq!(answer.status, 200, "{differing}: {answer:?}");
        answer.json()
    };
    let touching = ask(json!({
        "g_h": fraction(&[1e6], &[1.0, 200.0, 2e4, 1e6]), "c_h1": fraction(&[2e-3], &[1.0]), "clay_stiffness_n_per_m": 500,
    }));
    assert_eq!(touching["phase_margin"], Value::Null);
    assert_eq!(touching["delay_verdict_position_force"], "unbounded");
    assert_eq!(touching["delay_margin_position_force_s"], Value::Null);
    let resonant = ask(json!({ "c_h1": fraction(&[1.0], &[1.0, 0.0, 1.0]), "t_h": [1] }));
    assert_eq!(resonant["small_gain_peak"], Value::Null);
    let with_zero = ask(json!({
        "c_h1": fraction(&[4.0, 2.0, 2.0, 1.0], &[1.0, 1.0, 5.0, 4.0, 4.0]), "clay_stiffness_n_per_m": 1,
    }));
    assert_eq!(with_zero["gain_margin_increase"], Value::Null);
}
