//! What stops the tools of a session: a pause, and a number that is none.

use std::time::Duration;

use serde_json::json;
use teleclay_proto::frame::{Engagement, HandleFrame, MAX_FRAME};
use teleclay_proto::http::SessionState;
use teleclay_proto::keys::SessionKeys;
use teleclay_proto::{RealmName, SessionId};
use teleclay_shell::network::{CONTROL_QOS, Endpoints, open};
use teleclay_tests::process::{PATIENCE, wait_for};
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

/// A frame under the handle's own lease that says its velocity is not a number, from somebody else on the network.
async fn inject(endpoint: &str, lease: u32, sequence: u32) -> zenoh::Session {
    let endpoints = Endpoints {
        connect: vec![endpoint.to_owned()],
        ..Endpoints::default()
    };
    let session = open(&endpoints).await.unwrap();
    let keys = SessionKeys::new(
        RealmName::new("local").unwrap(),
        SessionId::new(DEMO).unwrap(),
    );
    let (congestion, priority, express, reliability) = CONTROL_QOS;
    let up = session
        .declare_publisher(keys.tool_up(1))
        .congestion_control(congestion)
        .priority(priority)
        .express(express)
        .reliability(reliability)
        .await
        .unwrap();
    let mut frame = HandleFrame {
        engagement: Engagement::Engaged,
        velocity_m_s: [0.0, f64::NAN, 0.0],
        ..HandleFrame::default()
    };
    frame.header.lease = lease;
    frame.header.ownership_epoch = 1;
    frame.header.sent_ns = 1;
    frame.header.sequence = sequence;
    let mut buffer = [0; MAX_FRAME];
    let bytes = frame.encode(&mut buffer).to_vec();
    wait_for("the server to listen", PATIENCE, || {
        let listens = tokio::task::block_in_place(|| {
            tokio::runtime::Handle::current().block_on(async { up.matching_status().await })
        });
        listens.is_ok_and(|status| status.matching()).then_some(())
    })
    .unwrap();
    up.put(bytes).await.unwrap();
    drop(up);
    session
}

#[tokio::test(flavor = "multi_thread")]
async fn a_number_that_is_none_puts_the_session_into_fault_with_its_reason_until_a_fresh_block() {
    let server = Server::on_free_ports().unwrap();
    let client = server.client.clone();
    let mut handle = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    let status = handle
        .status_when("a lease", PATIENCE, |status| status["lease"] != 0)
        .unwrap();
    let number = |name: &str| u32::try_from(status[name].as_u64().unwrap()).unwrap();
    // Newer than what the handle has sent when it comes; the handle's own frames count again once they have passed this
    // number.
    let other = inject(&server.endpoint(), number("lease"), number("ticks") + 3000).await;

    let fault = client
        .session_when(DEMO, "the fault", Duration::from_secs(5), |session| {
            session.state == SessionState::Fault
        })
        .unwrap();
    assert_eq!(
        fault.fault.as_deref(),
        Some("velocity_m_s is not finite"),
        "the reason is shown"
    );
    handle
        .process
        .logs("the session is in fault: force released", PATIENCE)
        .unwrap();
    let held = client.let_pass(DEMO, 200).unwrap();
    let later = client.let_pass(DEMO, 500).unwrap();
    assert_eq!(later.clay.remaining_units, held.clay.remaining_units);
    assert_eq!(later.state, SessionState::Fault, "time alone ends no fault");
    let stranger = HandleOptions::new(&server.endpoint()).by("Bob");
    let mut stranger = Handle::start(&stranger).unwrap();
    assert_eq!(stranger.process.ends().unwrap().code(), Some(2));
    let said = stranger.process.stderr();
    assert!(
        said.contains("velocity_m_s is not finite") && said.contains("a fresh block ends it"),
        "{said}"
    );

    client.reset(DEMO).unwrap();
    let fresh = client.session(DEMO).unwrap();
    assert_eq!(fresh.fault, None);
    client
        .session_when(DEMO, "another cut", PATIENCE, cuts)
        .unwrap();
    other.close().await.unwrap();
    assert!(handle.process.end().unwrap().success());
    let ticks = handle.ticks().unwrap();
    let step_n = greatest_force_step_n(&ticks);
    assert!(step_n <= FORCE_STEP_N, "{step_n} N in a tick");
    let in_fault: Vec<_> = ticks
        .iter()
        .filter(|tick| tick.link_state == "fault")
        .collect();
    assert!(
        100 < in_fault.len() && in_fault[100..].iter().all(|tick| tick.felt_n() <= 0.0),
        "no force in a fault"
    );
}
