//! Every call that takes a body, with a good body that has every field there is.

use serde_json::{Value, json};

use crate::wire::{Answer, Ask, Site};

/// A call that takes a body.
#[derive(Clone)]
pub(crate) struct Call {
    pub(crate) method: &'static str,
    /// As the description of the interface has it.
    pub(crate) route: &'static str,
    pub(crate) path: String,
    /// A good body with every field there is.
    pub(crate) full: Value,
    /// Where an empty object is good, because everything in it has a default.
    pub(crate) may_be_empty: &'static [&'static str],
    /// Where `null` is good, because it is a value.
    pub(crate) may_be_null: &'static [&'static str],
    /// Where any list of numbers may stand.
    pub(crate) may_be_any_list: &'static [&'static str],
    /// Below which any finite number may stand, small or large, as far as its own range goes.
    pub(crate) may_be_any_number: &'static [&'static str],
    /// How a body may be refused whose every field is in range.
    pub(crate) refusals: &'static [&'static str],
}

/// What a call must make of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It is good.
    Good,
    /// It is in range; whether it has an answer is for the calculation to find out.
    InRange,
    /// The field must be refused, and named.
    Bad,
}

impl Call {
    /// What the call must make of its full body with `value` at `pointer`, where it had another kind of value.
    pub(crate) fn verdict(&self, pointer: &str, value: &Value) -> Verdict {
        let is_below = |prefix: &&&str| pointer.starts_with(**prefix);
        if (value == &json!({}) && self.may_be_empty.contains(&pointer))
            || (value.is_null() && self.may_be_null.contains(&pointer))
            || (value == &json!(true) && pointer == "/paused")
        {
            return Verdict::Good;
        }
        let is_list = value
            .as_array()
            .is_some_and(|items| items.iter().all(Value::is_number));
        if is_list && self.may_be_any_list.contains(&pointer) {
            return Verdict::InRange;
        }
        let was_number = self.full.pointer(pointer).is_some_and(Value::is_number);
        // A tiny number is a good probability or coefficient, and a length of 0 where one may be 0.
        let is_tiny = value.as_f64().is_some_and(|number| number.abs() < 1e-200);
        let is_free = self
            .may_be_any_number
            .iter()
            .any(|prefix| is_below(&prefix));
        if was_number && value.is_number() && (is_tiny || is_free) {
            return Verdict::InRange;
        }
        Verdict::Bad
    }

    /// Sends a body; takes back whatever it made.
    pub(crate) fn send(&self, site: &Site, body: impl Into<Vec<u8>>) -> Answer {
        let answer = site.send(&Ask::new(self.method, &self.path).json(body));
        if answer.status == 201 {
            let location = answer.header("location").unwrap();
            assert_eq!(site.delete(location).status, 204);
        }
        answer
    }

    pub(crate) fn with(&self, pointer: &str, value: Value) -> Value {
        let mut body = self.full.clone();
        *body.pointer_mut(pointer).unwrap() = value;
        body
    }
}

/// Every call with a body; `session` is one that they may change.
pub(crate) fn calls(session: &str) -> Vec<Call> {
    let mut all = session_calls(session);
    all.extend(theory_calls());
    all
}

const NULLS: &[&str] = &[
    "/network/up/burst",
    "/network/up/outage",
    "/network/down/burst",
    "/network/down/outage",
];

/// With both shapes of clay and of tool among them.
fn session_calls(session: &str) -> Vec<Call> {
    let network = json!({ "up": impairment(), "down": impairment() });
    let stepped = json!({
        "kind": "stepped", "edges_m": [0.01, 0.02, 0.03], "depths_of_cut_m": [0.01, 0.02], "base_m": 0.01, "width_m": 0.02,
    });
    let block = json!({ "kind": "block", "size_m": [0.03, 0.02, 0.01] });
    let plain = Call {
        method: "POST",
        route: "",
        path: String::new(),
        full: Value::Null,
        may_be_empty: &[],
        may_be_null: &[],
        may_be_any_list: &[],
        may_be_any_number: &[],
        refusals: &[],
    };
    let new = |shape: &Value, tool: Value| Call {
        route: "/api/v1/sessions",
        path: "/api/v1/sessions".to_owned(),
        full: json!({
            "id": format!("made-by-{session}"), "axes": 2, "scheme": "force_exchange", "material": material(), "network": network,
            "clay": { "shape": shape, "voxel_size_m": 1e-3 }, "tool": tool, "tools": 3,
        }),
        may_be_empty: &[
            "/material",
            "/network",
            "/network/up",
            "/network/down",
            "/clay",
        ],
        may_be_null: NULLS,
        ..plain.clone()
    };
    let reset = |shape: &Value| Call {
        route: "/api/v1/sessions/{id}/clay/reset",
        path: format!("/api/v1/sessions/{session}/clay/reset"),
        full: json!({ "shape": shape, "material": material() }),
        may_be_empty: &["", "/material"],
        ..plain.clone()
    };
    vec![
        new(&block, json!({ "kind": "ball", "radius_m": 0.004 })),
        new(
            &stepped,
            json!({ "kind": "blade", "width_m": 0.01, "height_m": 0.04, "thickness_m": 0.002 }),
        ),
        reset(&block),
        reset(&stepped),
        Call {
            method: "PATCH",
            route: "/api/v1/sessions/{id}",
            path: format!("/api/v1/sessions/{session}"),
            full: json!({
                "scheme": "force_exchange", "material": material(), "network": network, "paused": false,
            }),
            may_be_empty: &["", "/material", "/network", "/network/up", "/network/down"],
            may_be_null: NULLS,
            ..plain
        },
    ]
}

fn impairment() -> Value {
    json!({
        "delay_s": 0.02, "jitter_s": 0.003, "loss": 0.01, "seed": 7, "jitter_distribution": "heavy_tailed",
        "duplicate": 0.001, "reorder": 0.002,
        "burst": { "enter": 0.01, "leave": 0.3, "loss_in_burst": 0.9 },
        "outage": { "every_s": 10, "length_s": 0.2 },
    })
}

fn material() -> Value {
    json!({ "viscosity_pa_s_per_m": 1e5, "yield_stress_pa": 10, "stiffness_pa": 1000 })
}

/// The calls of the theory.
pub(crate) fn theory_calls() -> Vec<Call> {
    let theory = |route: &'static str, full: Value| Call {
        method: "POST",
        route,
        path: route.to_owned(),
        full,
        may_be_empty: &[],
        may_be_null: &[],
        may_be_any_list: &[],
        may_be_any_number: &["/geometry/arm_angles_deg"],
        refusals: &["unreachable", "no-assembly", "singular"],
    };
    let geometry = json!({
        "base_radius_m": 0.12, "platform_radius_m": 0.04, "upper_link_m": 0.1, "lower_link_m": 0.2, "arm_angles_deg": [0, 120, 240],
    });
    vec![
        Call {
            may_be_any_number: &["/geometry/arm_angles_deg", "/position_m"],
            ..theory(
                "/api/v1/kinematics/inverse",
                json!({ "geometry": geometry, "position_m": [0.01, -0.02, 0.15] }),
            )
        },
        Call {
            may_be_any_number: &["/geometry/arm_angles_deg", "/joints_rad"],
            ..theory(
                "/api/v1/kinematics/forward",
                json!({ "geometry": geometry, "joints_rad": [0.1, -0.2, 0.3] }),
            )
        },
        Call {
            may_be_any_number: &["/geometry/arm_angles_deg", "/position_m", "/branch"],
            ..theory(
                "/api/v1/kinematics/jacobian",
                json!({ "geometry": geometry, "position_m": [0.01, -0.02, 0.15], "branch": [1, -1, 1] }),
            )
        },
        Call {
            may_be_any_number: &["/geometry/arm_angles_deg", "/region_m", "/branch"],
            may_be_empty: &[""],
            ..theory(
                "/api/v1/kinematics/workspace",
                json!({
                    "geometry": geometry, "branch": [-1, -1, -1], "region_m": [[-0.1, -0.1, 0.1], [0.1, 0.1, 0.2]],
                    "cells": [4, 3, 2],
                }),
            )
        },
        Call {
            may_be_any_list: &[
                "/g_h/numerator",
                "/g_h/denominator",
                "/s_h/numerator",
                "/s_h/denominator",
                "/g_t/numerator",
                "/g_t/denominator",
                "/s_t/numerator",
                "/s_t/denominator",
                "/c_h1/numerator",
                "/c_h1/denominator",
                "/t_h",
                "/omegas_rad_s",
            ],
            may_be_any_number: &[
                "/g_h",
                "/s_h",
                "/g_t",
                "/s_t",
                "/c_h1",
                "/t_h",
                "/force_ratio",
                "/omegas_rad_s",
            ],
            refusals: &["no-loop"],
            ..theory("/api/v1/analysis/loop", loop_body())
        },
        Call {
            may_be_any_list: &[
                "/g_h/numerator",
                "/g_h/denominator",
                "/s_h/numerator",
                "/s_h/denominator",
                "/g_t/numerator",
                "/g_t/denominator",
                "/s_t/numerator",
                "/s_t/denominator",
                "/t_h",
                "/clay_damping_n_s_per_m",
                "/clay_stiffness_n_per_m",
            ],
            may_be_any_number: &["/g_h", "/s_h", "/g_t", "/s_t", "/t_h", "/force_ratio"],
            refusals: &["no-loop", "untunable"],
            ..theory("/api/v1/analysis/tuning", tuning_body())
        },
        Call {
            may_be_any_number: &["/edges_m", "/force_ratio"],
            refusals: &["infeasible"],
            ..theory("/api/v1/experiments/cutting", cutting_body())
        },
    ]
}

/// The paper's x axis in clay.
pub(crate) fn loop_body() -> Value {
    json!({
        "g_h": { "numerator": [18, 1], "denominator": [0.005, 0.4, 18, 1] },
        "s_h": { "numerator": [1e-4], "denominator": [0.01, 1] },
        "t_h": [0.25, 2, 6],
        "c_h1": { "numerator": [1], "denominator": [1, 10, 0] },
        "g_t": { "numerator": [1], "denominator": [0.5, 20, 0] },
        "s_t": { "numerator": [1e-4], "denominator": [0.01, 1] },
        "position_ratio": 1, "force_ratio": -1,
        "clay_damping_n_s_per_m": 20, "clay_stiffness_n_per_m": 5,
        "omegas_rad_s": [0.5, 5],
    })
}

fn tuning_body() -> Value {
    json!({
        "g_h": { "numerator": [18, 1], "denominator": [0.005, 0.4, 18, 1] },
        "s_h": { "numerator": [0], "denominator": [1] },
        "t_h": [0.25, 2, 6],
        "g_t": { "numerator": [1], "denominator": [0.5, 20, 0] },
        "s_t": { "numerator": [0], "denominator": [1] },
        "position_ratio": 1, "force_ratio": -1,
        "clay_damping_n_s_per_m": [0, 60], "clay_stiffness_n_per_m": [0, 10],
        "scheme": "position_force", "round_trip_s": 0.05, "distance": 0.4, "heaviest_n_s_per_m": 500,
    })
}

/// Short ranges, so that it is over soon.
fn cutting_body() -> Value {
    json!({
        "virtual_mass_kg": 1, "virtual_damping_n_s_per_m": 20, "position_ratio": 1, "force_ratio": -1, "hand_force_n": 2,
        "edges_m": [0.03, 0.04, 0.05, 0.06], "clay_damping_n_s_per_m": [20, 40, 60],
        "hand_force_at": "sensor", "voxel_size_m": 1e-3, "trace_samples": 64,
    })
}
