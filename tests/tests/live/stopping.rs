//! What stops the tools of a session: a pause, and a stop that holds.

use serde_json::json;
use teleclay_proto::http::SessionState;
use teleclay_tests::process::PATIENCE;
use teleclay_tests::recording::{Row, greatest_force_step_n};
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Server};

use super::endings::{FORCE_STEP_N, cuts};

#[test]
fn a_pause_holds_the_tool_and_releases_the_hand_until_it_ends() {
    let server = Server::on_free_ports().unwrap();
    let client = &server.client;
    let mut handle = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    client.patch(DEMO, &json!({"paused": true})).unwrap();
    handle
        .process
        .logs("the session is paused: force released", PATIENCE)
        .unwrap();
    // The ramp takes 50 ms; the record of it is there 4 ms later.
    let held = client.let_pass(DEMO, 100).unwrap();
    assert_eq!(held.state, SessionState::Paused);
    let later = client.let_pass(DEMO, 500).unwrap();
    assert_eq!(later.clay.remaining_units, held.clay.remaining_units);
    assert_eq!(later.tools[0].position_m, held.tools[0].position_m);
    assert_eq!(later.tools[0].felt_force_n, [0.0; 3]);
    assert!(later.tools[0].connected, "a pause loses nobody");

    client.patch(DEMO, &json!({"paused": false})).unwrap();
    let again = client
        .session_when(DEMO, "another cut", PATIENCE, |session| {
            cuts(session) && session.clay.remaining_units < held.clay.remaining_units
        })
        .unwrap();
    assert_eq!(again.state, SessionState::Running);
    assert!(handle.process.end().unwrap().success());
    let step_n = greatest_force_step_n(&handle.ticks().unwrap());
    assert!(step_n <= FORCE_STEP_N, "{step_n} N in a tick");
}

/// A lease that is over is let go of by this ramp, s.
const RAMP_S: f64 = 0.05;

#[test]
fn a_stop_lets_go_of_a_pressing_hand_and_nothing_moves_until_it_is_cleared() {
    let server = Server::on_free_ports().unwrap();
    let client = &server.client;
    let options = HandleOptions::new(&server.endpoint()).with(&["--resume-after-stop"]);
    let mut handle = Handle::start(&options).unwrap();
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    let from = handle.process.stderr().len();
    let stop = json!({ "operator": "Eve", "reason": "enough" });
    let (status, _) = client.post("/sessions/demo/stop", &stop).unwrap();
    assert_eq!(status, 200);
    let why = "Eve has stopped the session: enough";
    handle.process.logs_after(from, why, PATIENCE).unwrap();
    let waits = "asking until that is cleared";
    handle.process.logs_after(from, waits, PATIENCE).unwrap();
    let before = client.session(DEMO).unwrap();
    let after = client.let_pass(DEMO, 1000).unwrap();
    assert_eq!(after.state, SessionState::Stopped);
    assert_eq!(before.clay, after.clay, "a stopped session cuts nothing");
    assert!(after.tools.iter().all(|tool| tool.operator.is_empty()));
    let rows = handle.ticks().unwrap();
    let silent = still_felt_after_it_was_over_s(&rows);
    assert!(silent <= RAMP_S + 2e-3, "felt for {silent} s more");

    let cleared = json!({ "operator": "Eve" });
    let (status, _) = client.post("/sessions/demo/stop/clear", &cleared).unwrap();
    assert_eq!(status, 200);
    // The simulated operator was told to take hold again by itself.
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    assert!(handle.process.end().unwrap().success());
    let step_n = greatest_force_step_n(&handle.ticks().unwrap());
    assert!(step_n <= FORCE_STEP_N, "{step_n} N in a tick");
}

#[test]
fn a_simulated_operator_that_was_not_told_to_come_back_ends_with_the_stop() {
    let server = Server::on_free_ports().unwrap();
    let client = &server.client;
    let mut handle = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    let (status, _) = client.post("/sessions/demo/stop", &json!({})).unwrap();
    assert_eq!(status, 200);
    assert_eq!(handle.process.ends().unwrap().code(), Some(2));
    let said = handle.process.stderr();
    assert!(
        said.contains("stopped by somebody: no reason given"),
        "{said}"
    );
}

/// From the first tick that knew of the end until the last that felt anything, s.
fn still_felt_after_it_was_over_s(rows: &[Row]) -> f64 {
    let over = rows.iter().position(|row| row.link_state == "gone");
    let over = over.expect("the handle has heard that its lease is over");
    let last = rows.iter().rposition(|row| 0.0 < row.felt_n());
    let last = last.expect("the hand has pressed");
    rows[last.max(over)].clock_s - rows[over].clock_s
}
