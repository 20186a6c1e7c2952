//! What stops the tools of a session: a pause.

use serde_json::json;
use teleclay_proto::http::SessionState;
use teleclay_tests::process::PATIENCE;
use teleclay_tests::recording::greatest_force_step_n;
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
