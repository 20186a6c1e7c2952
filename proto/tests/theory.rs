//! Requests of the theory: what must be there, what may be left out, and the field that each error names.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use teleclay_proto::http::theory::{
    CuttingRequest, ForwardRequest, InverseRequest, JacobianRequest, LoopRequest, RobotGeometry,
    TuningRequest, WorkspaceRequest,
};
use teleclay_proto::http::{BodyError, Validate, parse};

fn loop_request() -> Value {
    json!({
        "g_h": { "numerator": [18.0, 1.0], "denominator": [0.005, 0.4, 18.0, 1.0] },
        "t_h": [0.25, 2, 6],
        "c_h1": { "numerator": [1], "denominator": [1, 10, 0] },
        "g_t": { "numerator": [1], "denominator": [0.5, 20, 0] },
        "position_ratio": 1,
        "force_ratio": -1,
        "clay_damping_n_s_per_m": 20,
        "clay_stiffness_n_per_m": 0,
        "omegas_rad_s": [1, 2]
    })
}

fn cutting_request() -> Value {
    json!({
        "virtual_mass_kg": 1, "virtual_damping_n_s_per_m": 10, "position_ratio": 1, "force_ratio": -1,
        "hand_force_n": 2, "edges_m": [0.03, 0.06, 0.09], "clay_damping_n_s_per_m": [20, 40],
        "voxel_size_m": 5e-4, "trace_samples": 64
    })
}

fn tuning_request() -> Value {
    json!({
        "g_h": { "numerator": [1], "denominator": [0.1, 1] },
        "t_h": [2, 6],
        "g_t": { "numerator": [1], "denominator": [0.5, 20, 0] },
        "position_ratio": 1,
        "force_ratio": -1,
        "clay_damping_n_s_per_m": [0, 60],
        "clay_stiffness_n_per_m": [0, 100],
        "round_trip_s": 0.1,
        "distance": 0.5,
        "heaviest_n_s_per_m": 100
    })
}

fn jacobian_request() -> Value {
    json!({ "geometry": RobotGeometry::default(), "position_m": [0, 0, 0.15], "branch": [1, -1, 1] })
}

fn workspace_request() -> Value {
    json!({ "branch": [1, 1, 1], "region_m": [[-1, -1, -1], [1, 1, 1]], "cells": [4, 5, 6] })
}

/// `None` when the body is accepted, else the pointer of the field at fault.
fn verdict<T: DeserializeOwned + Serialize + Validate>(body: &Value) -> Option<String> {
    match parse::<T>(body.to_string().as_bytes()) {
        Ok(_) => None,
        Err(BodyError::Field(error)) => Some(error.pointer),
        Err(error) => panic!("{body}: {error}"),
    }
}

/// Everything that holds for any request: each field is needed unless listed, none may be null, a text or unknown, and
/// errors point at it.
fn every_field_is_minded<T: DeserializeOwned + Serialize + Validate>(
    sound: &Value,
    may_be_left_out: &[&str],
) {
    assert_eq!(verdict::<T>(sound), None, "{sound}");
    for name in sound.as_object().unwrap().keys() {
        let pointer = format!("/{name}");
        let mut without = sound.clone();
        without.as_object_mut().unwrap().remove(name);
        let wanted = (!may_be_left_out.contains(&name.as_str())).then(String::new);
        assert_eq!(verdict::<T>(&without), wanted, "without {name}");
        for bad in [
            Value::Null,
            json!("1"),
            json!(true),
            json!({ "a": 1 }),
            json!([[[1]]]),
        ] {
            let mut altered = sound.clone();
            altered[name] = bad.clone();
            let got =
                verdict::<T>(&altered).unwrap_or_else(|| panic!("{name} = {bad} is accepted"));
            assert!(got.starts_with(&pointer), "{name} = {bad} points at {got}");
        }
    }
    let mut more = sound.clone();
    more["more"] = json!(1);
    assert_eq!(verdict::<T>(&more), Some("/more".to_owned()));
    // Where it points depends on how far the array can be read as the fields in order.
    assert!(
        verdict::<T>(&json!([sound])).is_some(),
        "an array passes for an object"
    );
}

#[test]
fn every_field_of_every_request_is_minded() {
    let robot = json!({ "geometry": RobotGeometry::default(), "position_m": [0, 0, 0.15] });
    every_field_is_minded::<InverseRequest>(&robot, &["geometry"]);
    let joints = json!({ "geometry": RobotGeometry::default(), "joints_rad": [0, 0, 0] });
    every_field_is_minded::<ForwardRequest>(&joints, &["geometry"]);
    every_field_is_minded::<JacobianRequest>(&jacobian_request(), &["geometry"]);
    every_field_is_minded::<WorkspaceRequest>(
        &workspace_request(),
        &["branch", "region_m", "cells"],
    );
    every_field_is_minded::<LoopRequest>(&loop_request(), &["omegas_rad_s"]);
    every_field_is_minded::<CuttingRequest>(&cutting_request(), &["voxel_size_m", "trace_samples"]);
    every_field_is_minded::<TuningRequest>(&tuning_request(), &[]);
    let geometry = json!(RobotGeometry::default());
    for name in geometry.as_object().unwrap().keys() {
        let mut request = jacobian_request();
        request["geometry"].as_object_mut().unwrap().remove(name);
        assert_eq!(
            verdict::<JacobianRequest>(&request),
            Some("/geometry".to_owned())
        );
    }
}

#[test]
fn what_is_out_of_range_is_pointed_at() {
    let points_at = |sound: Value, pointer: &str, bad: Value| {
        let mut altered = sound;
        *altered.pointer_mut(pointer).expect(pointer) = bad;
        altered
    };
    let cases: [(&str, Value); 8] = [
        ("/g_h/denominator", json!([0, 0.0])),
        ("/c_h1/numerator", json!([])),
        ("/t_h", json!(vec![1.0; 14])),
        ("/position_ratio", json!(0)),
        ("/force_ratio", json!(1)),
        ("/clay_damping_n_s_per_m", json!(-1e-9)),
        ("/omegas_rad_s/1", json!(0)),
        ("/omegas_rad_s", json!(vec![1.0; 2_001])),
    ];
    for (pointer, bad) in cases {
        let body = points_at(loop_request(), pointer, bad);
        assert_eq!(verdict::<LoopRequest>(&body).as_deref(), Some(pointer));
    }
    let cases: [(&str, Value, &str); 7] = [
        ("/edges_m/1", json!(0.03), "/edges_m/1"),
        ("/edges_m/0", json!(11), "/edges_m/0"),
        ("/edges_m", json!([0.03]), "/edges_m"),
        (
            "/clay_damping_n_s_per_m",
            json!([20]),
            "/clay_damping_n_s_per_m",
        ),
        (
            "/clay_damping_n_s_per_m/1",
            json!(-1),
            "/clay_damping_n_s_per_m/1",
        ),
        ("/trace_samples", json!(63), "/trace_samples"),
        ("/hand_force_n", json!(0), "/hand_force_n"),
    ];
    for (pointer, bad, wanted) in cases {
        let body = points_at(cutting_request(), pointer, bad);
        assert_eq!(verdict::<CuttingRequest>(&body).as_deref(), Some(wanted));
    }
    for (pointer, bad) in [
        ("/branch/1", json!(0)),
        ("/geometry/lower_link_m", json!(0)),
    ] {
        let body = points_at(jacobian_request(), pointer, bad);
        assert_eq!(verdict::<JacobianRequest>(&body).as_deref(), Some(pointer));
    }
    for (pointer, bad, wanted) in [
        ("/cells/2", json!(0), "/cells/2"),
        ("/cells/0", json!(4_294_967_295_u32), "/cells"),
        ("/cells", json!([47, 47, 47]), "/cells"),
        ("/region_m/1/0", json!(-1.5), "/region_m/1/0"),
    ] {
        let body = points_at(workspace_request(), pointer, bad);
        assert_eq!(verdict::<WorkspaceRequest>(&body).as_deref(), Some(wanted));
    }
    for (pointer, bad) in [
        ("/clay_damping_n_s_per_m/1", json!(-1)),
        ("/distance", json!(1)),
        ("/round_trip_s", json!(11)),
        ("/scheme", json!("wave")),
    ] {
        let mut body = tuning_request();
        body["scheme"] = json!("force_exchange");
        let body = points_at(body, pointer, bad);
        assert_eq!(verdict::<TuningRequest>(&body).as_deref(), Some(pointer));
    }
}

#[test]
fn numbers_that_json_cannot_hold_are_refused_too() {
    let mut request: CuttingRequest = serde_json::from_value(cutting_request()).unwrap();
    request.edges_m[2] = f64::NAN;
    assert_eq!(request.validate().unwrap_err().pointer, "/edges_m/2");
    let mut request: LoopRequest = serde_json::from_value(loop_request()).unwrap();
    request.g_h.numerator[0] = f64::INFINITY;
    assert_eq!(request.validate().unwrap_err().pointer, "/g_h/numerator/0");
}
