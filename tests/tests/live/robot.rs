//! The parallel robot as the handle of a session whose three axes all reflect force.

use serde_json::{Value, json};
use teleclay_tests::process::PATIENCE;
use teleclay_tests::recording::{Row, norm};
use teleclay_tests::stage::{Handle, HandleOptions, Server};

use super::endings::cuts;

/// Clearance from singularities at which the robot's fence stands.
const FENCE: f64 = 0.3;

fn server_with_three_axes() -> Server {
    let server = Server::on_free_ports().unwrap();
    let session = json!({"id": "robot", "axes": 3, "scheme": "force_exchange"});
    server.client.create(&session).unwrap();
    server
}

fn robot(server: &Server, more: &[&str]) -> Handle {
    let options = HandleOptions::new(&server.endpoint()).in_session("robot");
    Handle::start(&options.with(&["--device", "robot"]).with(more)).unwrap()
}

fn number(status: &Value, name: &str) -> f64 {
    status["robot"][name].as_f64().unwrap()
}

#[test]
fn a_robot_cuts_on_three_axes_and_tells_how_it_stands() {
    let server = server_with_three_axes();
    let mut handle = robot(&server, &[]);
    let client = &server.client;
    client
        .session_when("robot", "a cut", PATIENCE, cuts)
        .unwrap();
    let status = handle
        .status_when("a robot's status", PATIENCE, |status| {
            status["robot"].is_object()
        })
        .unwrap();
    assert!(FENCE < number(&status, "clearance_min"), "{status}");
    assert_eq!(status["robot"]["held"], json!(false));
    // The third axis reflects force, and the tool stands where the handle does on it as on the others.
    client
        .session_when("robot", "force from below", PATIENCE, |session| {
            session
                .tools
                .iter()
                .any(|tool| 0.02 < tool.felt_force_n[2].abs())
        })
        .unwrap();
    assert!(handle.process.end().unwrap().success());
    let last = handle.status().unwrap();
    assert_eq!(last["kind"], json!("summary"));
    assert_eq!(last["robot"]["overpowered_ticks"], json!(0));
}

#[test]
fn a_robot_pushed_to_its_edge_resists_says_so_and_comes_back() {
    let server = server_with_three_axes();
    // Upwards, into the air over the block.
    let push = ["--intent", "constant-force", "--force-n", "0,0,5"];
    let mut handle = robot(&server, &push);
    handle
        .process
        .logs("the robot comes near a singularity", PATIENCE)
        .unwrap();
    let status = handle
        .status_when("the robot at its fence", PATIENCE, |status| {
            status["robot"]["held"] == json!(true)
        })
        .unwrap();
    assert!(FENCE - 1e-9 <= number(&status, "clearance_min"), "{status}");
    assert!(handle.process.end().unwrap().success());
    let ticks = handle.ticks().unwrap();
    // Nowhere on the way did the handle jump, a millimetre in a tick is a metre a second, nor what the sensor read.
    let greatest = |of: fn(&Row) -> [f64; 3]| {
        let steps = ticks.windows(2).map(|pair| {
            let (before, after) = (of(&pair[0]), of(&pair[1]));
            norm(std::array::from_fn(|axis| after[axis] - before[axis]))
        });
        steps.fold(0.0, f64::max)
    };
    let (moved_m, jolt_n) = (
        greatest(|row| row.position_m),
        greatest(|row| row.hand_force_n),
    );
    assert!(moved_m < 1e-3, "{moved_m} m in a tick");
    assert!(jolt_n < 0.5, "{jolt_n} N in a tick");
}
