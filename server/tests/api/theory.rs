//! The calls of the theory: their names, and answers held against the equations themselves.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use teleclay_control::Complex;

use crate::calls::{loop_body, theory_calls};
use crate::rig::{eventually, shared};
use crate::wire::{Answer, Ask, Site};

fn ask(site: &Site, path: &str, body: &Value) -> Value {
    let answer = site.post(&format!("/api/v1{path}"), body);
    assert_eq!(answer.status, 200, "{path} {body}: {answer:?}");
    answer.json()
}

fn refused(site: &Site, path: &str, body: &Value) -> (u16, String) {
    let answer = site.post(&format!("/api/v1{path}"), body);
    (answer.status, answer.word())
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    serde_json::from_value::<Vec<f64>>(value.clone())
        .unwrap()
        .try_into()
        .unwrap()
}

fn list(value: &Value) -> Vec<f64> {
    serde_json::from_value(value.clone()).unwrap()
}

fn complex(value: &Value) -> Complex<f64> {
    let [re, im] = numbers(value);
    Complex::new(re, im)
}

fn names(value: &Value) -> Vec<&str> {
    value
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3)
        .map(|axis| (a[axis] - b[axis]).powi(2))
        .sum::<f64>()
        .sqrt()
}

// The robot, as its drawing has it: r_b 0.12, r_p 0.04, l_1 0.10, l_2 0.20 m.

const ARMS_DEG: [f64; 3] = [0.0, 120.0, 240.0];

/// Length of the rods of each arm, by (1)–(5), m.
fn rods(position: [f64; 3], joints: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|arm| {
        let (sine, cosine) = ARMS_DEG[arm].to_radians().sin_cos();
        let out = 0.12 + 0.10 * joints[arm].cos();
        let elbow = [out * cosine, out * sine, 0.10 * joints[arm].sin()];
        let [x, y, z] = position;
        distance(elbow, [x + 0.04 * cosine, y + 0.04 * sine, z])
    })
}

#[test]
fn the_robot_closes_on_all_eight_branches_and_comes_back() {
    let site = shared().site();
    let position = [0.02, -0.03, 0.16];
    let answer = ask(
        &site,
        "/kinematics/inverse",
        &json!({ "position_m": position }),
    );
    assert_eq!(names(&answer), ["branches"]);
    let branches = answer["branches"].as_array().unwrap();
    let mut signs = Vec::new();
    for branch in branches {
        assert_eq!(names(branch), ["branch", "joints_rad"]);
        signs.push(numbers::<3>(&branch["branch"]).map(|sign| sign as i8));
        let joints = numbers(&branch["joints_rad"]);
        for rod in rods(position, joints) {
            assert!((rod - 0.2).abs() < 1e-12, "{rod} m on {branch}");
        }
        let forward = ask(
            &site,
            "/kinematics/forward",
            &json!({ "joints_rad": joints }),
        );
        let both: Vec<[f64; 3]> = serde_json::from_value(forward["positions_m"].clone()).unwrap();
        assert_eq!(both.len(), 2);
        for found in &both {
            for rod in rods(*found, joints) {
                assert!((rod - 0.2).abs() < 1e-9, "{rod} m at {found:?}");
            }
        }
        let nearest = both.iter().map(|found| distance(*found, position));
        assert!(nearest.fold(f64::INFINITY, f64::min) < 1e-9, "{forward}");
    }
    signs.sort_unstable();
    signs.dedup();
    assert_eq!(signs.len(), 8);
}

#[test]
fn the_jacobian_is_the_slope_of_the_forward_call() {
    let site = shared().site();
    let position = [0.02, -0.03, 0.16];
    let body = json!({ "position_m": position, "branch": [-1, -1, -1] });
    let answer = ask(&site, "/kinematics/jacobian", &body);
    let joints: [f64; 3] = numbers(&answer["joints_rad"]);
    let at = |joints: [f64; 3]| -> [f64; 3] {
        let forward = ask(
            &site,
            "/kinematics/forward",
            &json!({ "joints_rad": joints }),
        );
        let both: Vec<[f64; 3]> = serde_json::from_value(forward["positions_m"].clone()).unwrap();
        let near = |found: &[f64; 3]| distance(*found, position);
        *both
            .iter()
            .min_by(|a, b| near(a).total_cmp(&near(b)))
            .unwrap()
    };
    const STEP_RAD: f64 = 1e-5;
    for arm in 0..3 {
        let moved = |step: f64| {
            let mut moved = joints;
            moved[arm] += step;
            at(moved)
        };
        let (ahead, behind) = (moved(STEP_RAD), moved(-STEP_RAD));
        for axis in 0..3 {
            let slope = (ahead[axis] - behind[axis]) / (2.0 * STEP_RAD);
            let told = answer["jacobian"][axis][arm].as_f64().unwrap();
            assert!(
                (slope - told).abs() < 1e-6,
                "{axis} by {arm}: {slope}, told {told}"
            );
        }
    }
    assert!(1.0 <= answer["condition_number"].as_f64().unwrap());
}

#[test]
fn what_the_robot_cannot_do_has_a_name() {
    let site = shared().site();
    let far = json!({ "position_m": [1, 0, 0] });
    assert_eq!(
        refused(&site, "/kinematics/inverse", &far),
        (422, "unreachable".to_owned())
    );
    let far = json!({ "position_m": [1, 0, 0], "branch": [1, 1, 1] });
    assert_eq!(
        refused(&site, "/kinematics/jacobian", &far),
        (422, "unreachable".to_owned())
    );
    // Elbows straight outwards, 0.30 m from the axis each: rods of 0.20 m do not reach a platform of 0.04 m.
    let mut body = json!({ "joints_rad": [0, 0, 0], "geometry": robot() });
    body["geometry"]["base_radius_m"] = json!(0.2);
    assert_eq!(
        refused(&site, "/kinematics/forward", &body),
        (422, "no-assembly".to_owned())
    );
    // Arms 60 degrees up, and rods just so long that they lie flat: the platform can move off either way.
    let mut robot = robot();
    robot["lower_link_m"] = json!(0.12 + 0.05 - 0.04);
    let position = [0.0, 0.0, 0.1 * 60.0_f64.to_radians().sin()];
    let body = json!({ "position_m": position, "geometry": robot });
    let branches = ask(&site, "/kinematics/inverse", &body)["branches"].clone();
    let is_up = |branch: &&Value| {
        numbers::<3>(&branch["joints_rad"])
            .iter()
            .all(|joint| (joint - 60.0_f64.to_radians()).abs() < 1e-9)
    };
    let up = branches.as_array().unwrap().iter().find(is_up).unwrap();
    let body = json!({ "position_m": position, "geometry": robot, "branch": up["branch"] });
    assert_eq!(
        refused(&site, "/kinematics/jacobian", &body),
        (422, "singular".to_owned())
    );
}

fn robot() -> Value {
    json!({
        "base_radius_m": 0.12, "platform_radius_m": 0.04, "upper_link_m": 0.1, "lower_link_m": 0.2, "arm_angles_deg": [0, 120, 240],
    })
}

#[test]
fn a_map_of_the_workspace_agrees_with_the_other_calls_cell_by_cell() {
    let site = shared().site();
    let body = json!({ "region_m": [[-0.3, -0.2, 0.05], [0.3, 0.2, 0.3]], "cells": [5, 4, 3] });
    let map = ask(&site, "/kinematics/workspace", &body);
    let cells = map["dexterity"].as_array().unwrap();
    assert_eq!(cells.len(), 60);
    let mut reached = 0;
    for (index, cell) in cells.iter().enumerate() {
        let place = [index % 5, index / 5 % 4, index / 20];
        let centre = [
            -0.3 + 0.6 * (place[0] as f64 + 0.5) / 5.0,
            -0.2 + 0.4 * (place[1] as f64 + 0.5) / 4.0,
            0.05 + 0.25 * (place[2] as f64 + 0.5) / 3.0,
        ];
        let body = json!({ "position_m": centre, "branch": [-1, -1, -1] });
        let answer = site.post("/api/v1/kinematics/jacobian", &body);
        match cell.as_f64() {
            Some(dexterity) => {
                reached += 1;
                let told: Value = answer.json();
                let condition = told["condition_number"].as_f64().unwrap();
                assert!((dexterity * condition - 1.0).abs() < 1e-9, "{centre:?}");
            }
            None => assert_eq!(answer.word(), "unreachable", "{centre:?}"),
        }
    }
    assert!(0 < reached && reached < 60);
    let share = map["reachable_share"].as_f64().unwrap();
    assert!((share - f64::from(reached) / 60.0).abs() < 1e-12);
}

// The loop.

struct Loop(Value);

impl Loop {
    fn polynomial(&self, pointer: &str, s: Complex<f64>) -> Complex<f64> {
        let coefficients = list(self.0.pointer(pointer).unwrap());
        coefficients
            .iter()
            .fold(Complex::from(0.0), |sum, c| sum * s + c)
    }

    fn at(&self, name: &str, s: Complex<f64>) -> Complex<f64> {
        self.polynomial(&format!("/{name}/numerator"), s)
            / self.polynomial(&format!("/{name}/denominator"), s)
    }

    fn number(&self, name: &str) -> f64 {
        self.0[name].as_f64().unwrap()
    }

    /// `G_h C_h1 + S_h`.
    fn admittance(&self, s: Complex<f64>) -> Complex<f64> {
        self.at("g_h", s) * self.at("c_h1", s) + self.at("s_h", s)
    }

    /// What the arm and what the clay feeds back, `H` and `E`.
    fn returns(&self, s: Complex<f64>) -> [Complex<f64>; 2] {
        let clay =
            s * self.number("clay_damping_n_s_per_m") + self.number("clay_stiffness_n_per_m");
        let rho = self.number("position_ratio") / -self.number("force_ratio");
        let p = self.admittance(s);
        [p * self.polynomial("/t_h", s), p * clay * rho]
    }
}

#[test]
fn a_loop_is_answered_under_the_names_of_its_inputs() {
    let site = shared().site();
    let body = loop_body();
    let answer = ask(&site, "/analysis/loop", &body);
    let parts = Loop(body.clone());
    for (point, omega) in answer["compensators"]
        .as_array()
        .unwrap()
        .iter()
        .zip([0.5, 5.0])
    {
        assert_eq!(point["omega_rad_s"], omega);
        let s = Complex::new(0.0, omega);
        let (p, a_h1, a_h2) = (
            parts.admittance(s),
            parts.number("position_ratio"),
            parts.number("force_ratio"),
        );
        // (30)–(32).
        for (name, wanted) in [
            ("c_h1", parts.at("c_h1", s)),
            ("c_t1", p / (parts.at("g_h", s) * a_h2)),
            ("c_h2", -p * a_h1 / parts.at("g_t", s)),
            (
                "c_t2",
                (-p * a_h1 / a_h2 - parts.at("s_t", s)) / parts.at("g_t", s),
            ),
        ] {
            let told = complex(&point[name]);
            assert!(
                (told - wanted).norm() < 1e-12 * wanted.norm(),
                "{name}: {told}, wanted {wanted}"
            );
        }
    }
    assert!(answer["stable_without_delay"].as_bool().unwrap());
    let poles = answer["closed_loop_poles"].as_array().unwrap();
    for pole in poles {
        let s = complex(pole);
        let [h, e] = parts.returns(s);
        assert!(
            (1.0 + h + e).norm() < 1e-6 * (1.0 + h.norm() + e.norm()),
            "{s}"
        );
        assert!(s.re < 0.0);
    }
    // At the margin, and only there, the loop with the delay in it has a root on the axis.
    let margin = answer["delay_margin_position_force_s"].as_f64().unwrap();
    let least = |delay: f64| {
        (0..400_000)
            .map(|step| 10.0_f64.powf(-2.0 + 5.0 * f64::from(step) / 400_000.0))
            .map(|omega| {
                let s = Complex::new(0.0, omega);
                let [h, e] = parts.returns(s);
                (1.0 + h + e * (-s * delay).exp()).norm()
            })
            .fold(f64::INFINITY, f64::min)
    };
    assert!(least(margin) < 1e-3, "{}", least(margin));
    assert!(1e-2 < least(0.9 * margin) && 1e-2 < least(1.1 * margin));
    assert_eq!(answer["delay_verdict_position_force"], "finite");
    assert!(answer["small_gain_holds"].is_boolean());
    let nearest = answer["nyquist_min_distance"].as_f64().unwrap();
    assert!(
        (nearest - least(0.0)).abs() < 1e-4,
        "{nearest}, {}",
        least(0.0)
    );

    let curve = &answer["nyquist"];
    assert_eq!(names(curve), ["im", "omega_rad_s", "re"]);
    let (omegas, re, im) = (
        list(&curve["omega_rad_s"]),
        list(&curve["re"]),
        list(&curve["im"]),
    );
    let (db, phase) = (
        list(&answer["bode"]["magnitude_db"]),
        list(&answer["bode"]["phase_rad"]),
    );
    assert_eq!(answer["bode"]["omega_rad_s"], curve["omega_rad_s"]);
    assert!(50 < omegas.len() && [re.len(), im.len(), db.len(), phase.len()] == [omegas.len(); 4]);
    for (index, &omega) in omegas.iter().enumerate() {
        let [h, e] = parts.returns(Complex::new(0.0, omega));
        let gain = h + e;
        assert!((gain - Complex::new(re[index], im[index])).norm() < 1e-9 * gain.norm());
        assert!((20.0 * gain.norm().log10() - db[index]).abs() < 1e-9);
        assert!((Complex::from_polar(1.0, phase[index]) - gain / gain.norm()).norm() < 1e-9);
    }
}

/// What the reference of the paper's loops leaves out may be left out: the gives of both sides, and where to evaluate.
#[test]
fn a_loop_without_the_optional_fields_is_the_papers() {
    let site = shared().site();
    let mut body = loop_body();
    for name in ["s_h", "s_t", "omegas_rad_s"] {
        body.as_object_mut().unwrap().remove(name);
    }
    let answer = ask(&site, "/analysis/loop", &body);
    let asked: Vec<f64> = answer["compensators"]
        .as_array()
        .unwrap()
        .iter()
        .map(|point| point["omega_rad_s"].as_f64().unwrap())
        .collect();
    assert_eq!(asked, [0.1, 1.0, 10.0, 60.0, 300.0]);
    body["s_h"] = json!({ "numerator": [0], "denominator": [1] });
    body["s_t"] = body["s_h"].clone();
    assert_eq!(ask(&site, "/analysis/loop", &body), answer);
}

#[test]
fn a_target_is_met_by_the_loops_own_measure_or_refused_with_the_reason() {
    let site = shared().site();
    let tuning = theory_calls()
        .into_iter()
        .find(|call| call.route.ends_with("/tuning"))
        .unwrap();
    let answer = ask(&site, "/analysis/tuning", &tuning.full);
    for clay in [0.0, 30.0, 60.0] {
        let mut body = loop_body();
        for name in ["s_h", "s_t"] {
            body[name] = tuning.full[name].clone();
        }
        body["c_h1"] = answer["c_h1"].clone();
        body["clay_damping_n_s_per_m"] = json!(clay);
        let analysis = ask(&site, "/analysis/loop", &body);
        assert_eq!(analysis["stable_without_delay"], true);
        assert!(0.4 <= analysis["nyquist_min_distance"].as_f64().unwrap() + 1e-9);
        if let Some(margin) = analysis["delay_margin_position_force_s"].as_f64() {
            assert!(0.05 < margin, "{margin} s at {clay} N s/m");
        }
    }
    let mut impossible = tuning.full.clone();
    impossible["heaviest_n_s_per_m"] = json!(1e-3);
    let answer = site.post("/api/v1/analysis/tuning", &impossible);
    assert_eq!((answer.status, &*answer.word()), (422, "untunable"));
    let mut improper = tuning.full;
    improper["g_t"] = json!({ "numerator": [1], "denominator": [1, 1, 1, 1, 1, 1, 1] });
    let answer = site.post("/api/v1/analysis/tuning", &improper);
    assert_eq!((answer.status, &*answer.word()), (422, "untunable"));
    assert!(answer.problem().detail.contains("C_h2"), "{answer:?}");
}

// The experiment.

/// Fig. 7 with the values of the paper's experiment.
fn figure_7() -> Value {
    json!({
        "virtual_mass_kg": 1, "virtual_damping_n_s_per_m": 10, "position_ratio": 1, "force_ratio": -1, "hand_force_n": 2,
        "edges_m": [0.03, 0.06, 0.09, 0.12], "clay_damping_n_s_per_m": [20, 40, 60],
    })
}

#[test]
fn the_experiment_reaches_its_plateaus_through_the_clay() {
    let site = shared().site();
    let answer = ask(&site, "/experiments/cutting", &figure_7());
    let theory = list(&answer["plateau_velocity_m_s"]);
    let measured = list(&answer["simulated_velocity_m_s"]);
    for (range, damping) in [20.0, 40.0, 60.0].into_iter().enumerate() {
        let wanted = 2.0 / (10.0 + damping);
        assert!((theory[range] / wanted - 1.0).abs() < 1e-12);
        assert!(
            (measured[range] / wanted - 1.0).abs() < 0.02,
            "{} m/s",
            measured[range]
        );
        assert!(answer["ripple"][range].as_f64().unwrap() < 0.02);
    }
    assert!((answer["duration_s"].as_f64().unwrap() / 2.267 - 1.0).abs() < 0.01);
    let trace = &answer["trace"];
    let lengths: Vec<usize> = [
        "t_s",
        "position_m",
        "velocity_m_s",
        "hand_force_n",
        "tool_force_n",
    ]
    .map(|name| list(&trace[name]).len())
    .to_vec();
    assert!(1000 < lengths[0] && lengths.iter().all(|length| *length == lengths[0]));
    // It is the clay that was cut: 1, 2 and 3 cm deep, 3 cm each, by a blade 1 cm wide, to half a voxel on each face.
    let removed = answer["removed_volume_m3"].as_f64().unwrap();
    assert!((removed / 18e-6 - 1.0).abs() < 0.05, "{removed} m3");
}

#[test]
fn an_experiment_without_an_end_is_refused_before_it_begins() {
    let site = shared().site();
    for (name, value) in [
        ("hand_force_n", json!(1e-3)),
        ("virtual_mass_kg", json!(0.1)),
        ("hand_force_n", json!(100)),
    ] {
        let mut body = figure_7();
        body[name] = value;
        let began = Instant::now();
        let answer = refused(&site, "/experiments/cutting", &body);
        assert_eq!(answer, (422, "infeasible".to_owned()), "{body}");
        assert!(began.elapsed() < Duration::from_secs(2));
    }
}

/// As many experiments at once as nobody would ask for: each is answered in time, and what is quick is not held up.
#[test]
fn a_crowd_of_experiments_is_answered_or_told_to_come_back() {
    const CROWD: usize = 12;
    const IN_TIME: Duration = Duration::from_secs(12);
    let site = shared().site();
    let mut long = figure_7();
    // About 40 s of virtual time.
    long["hand_force_n"] = json!(0.11);
    let began = Instant::now();
    let crowd: Vec<_> = (0..CROWD)
        .map(|_| {
            let long = long.clone();
            std::thread::spawn(move || site.post("/api/v1/experiments/cutting", &long))
        })
        .collect();
    let mut slowest = Duration::ZERO;
    while !crowd.iter().all(std::thread::JoinHandle::is_finished) {
        let asked = Instant::now();
        assert_eq!(site.get("/healthz").status, 200);
        ask(
            &site,
            "/kinematics/inverse",
            &json!({ "position_m": [0, 0, 0.15] }),
        );
        slowest = slowest.max(asked.elapsed());
        assert!(began.elapsed() < IN_TIME, "somebody still waits");
    }
    let answers: Vec<Answer> = crowd
        .into_iter()
        .map(|asker| asker.join().unwrap())
        .collect();
    let done = answers.iter().filter(|answer| answer.status == 200).count();
    for answer in answers.iter().filter(|answer| answer.status != 200) {
        assert_eq!(answer.status, 503, "{answer:?}");
        assert!(
            ["busy", "no-answer"].contains(&&*answer.word()),
            "{answer:?}"
        );
        assert_eq!(answer.header("retry-after"), Some("1"));
    }
    println!(
        "{done} of {CROWD} done in {:?}, others waited {slowest:?} at most",
        began.elapsed()
    );
    assert!(slowest < Duration::from_secs(1), "{slowest:?}");
}

/// Whoever hangs up ends the experiment: the next one does not wait for it.
#[test]
fn an_experiment_whose_asker_hangs_up_makes_room() {
    let site = shared().site();
    let mut long = figure_7();
    long["hand_force_n"] = json!(0.05);
    let body = long.to_string();
    let path = "/api/v1/experiments/cutting";
    for _ in 0..3 {
        let connection = site.connect();
        site.begin(&connection, &Ask::new("POST", path).json(body.clone()));
        drop(connection);
    }
    eventually("there is room", || {
        site.post(path, &figure_7()).status == 200
    });
}
