//! Whoever ends without a word: what the one that is left does, and how soon.

use std::time::{Duration, Instant};

use serde_json::json;
use teleclay_proto::Scheme;
use teleclay_proto::http::Session;
use teleclay_tests::client::since;
use teleclay_tests::process::PATIENCE;
use teleclay_tests::recording::{Row, greatest_force_step_n, norm};
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Server, Transport};

/// The slew limit of a session's parameters, a tick's worth, N: no force steps by more, whatever happened.
pub(super) const FORCE_STEP_N: f64 = 2000.0 * 1e-3 + 1e-9;

/// The handle cuts: clay goes, and pushes back.
pub(super) fn cuts(session: &Session) -> bool {
    session
        .tools
        .iter()
        .any(|tool| tool.connected && 0.05 < norm(tool.force_n))
}

/// The hand feels it.
fn feels(session: &Session) -> bool {
    session
        .tools
        .iter()
        .any(|tool| 0.05 < norm(tool.felt_force_n))
}

/// The tools that somebody holds, by their ids.
pub(super) fn held(session: &Session) -> Vec<u32> {
    let held = session
        .tools
        .iter()
        .filter(|tool| !tool.operator.is_empty());
    held.map(|tool| tool.id).collect()
}

fn is_connected(session: &Session) -> bool {
    session.tools.iter().any(|tool| tool.connected)
}

#[test]
fn a_handle_that_is_killed_mid_cut_stops_the_cut_shows_within_a_second_and_a_half_and_joins_again()
{
    let server = Server::on_free_ports().unwrap();
    let options = HandleOptions::new(&server.endpoint());
    let mut handle = Handle::start(&options).unwrap();
    let client = &server.client;
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();

    let killed = handle.process.kill().unwrap();
    let within = Duration::from_millis(1500);
    client
        .session_when(DEMO, "it to show", within, |session| !is_connected(session))
        .unwrap();
    assert!(killed.elapsed() < within, "{}", since(killed));
    println!("shown after {}", since(killed));
    // Within the ramp of 50 ms after that the tool stands, and then nothing more is cut.
    let gone = client.let_pass(DEMO, 60).unwrap();
    assert!(killed.elapsed() < within, "{}", since(killed));
    let later = client.let_pass(DEMO, 500).unwrap();
    assert_eq!(later.clay.remaining_units, gone.clay.remaining_units);
    assert_eq!(later.tools[0].position_m, gone.tools[0].position_m);
    assert_eq!(later.tools[0].operator, "Ada", "the lease is still hers");

    let _again = Handle::start(&options).unwrap();
    let back = client
        .session_when(DEMO, "another cut", PATIENCE, |session| {
            cuts(session) && session.clay.remaining_units < gone.clay.remaining_units
        })
        .unwrap();
    assert_eq!(held(&back), [1], "she has her old tool again");
}

#[test]
fn a_server_that_is_killed_releases_the_hand_within_a_fifth_of_a_second_and_is_found_again() {
    let server = Server::on_free_ports().unwrap();
    let mut handle = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    server
        .client
        .session_when(DEMO, "a force on the hand", PATIENCE, feels)
        .unwrap();

    let killed = Instant::now();
    let ports = server.kill().unwrap();
    let said = handle
        .process
        .logs("the server has gone: force released", PATIENCE)
        .unwrap();
    println!("said after {}: {said}", since(killed));
    // Long enough that it has asked for another lease in vain.
    handle
        .status_when("it to look for a server", PATIENCE, |status| {
            status["state"] == "joining"
        })
        .unwrap();
    let alone = handle.process.stderr().len();

    let server = Server::start(ports, Transport::Tcp).unwrap();
    let back = Instant::now();
    let said = handle.process.logs_after(alone, "again", PATIENCE).unwrap();
    assert!(said.contains("joined session `demo`"), "{said}");
    server
        .client
        .session_when(DEMO, "another cut", PATIENCE, cuts)
        .unwrap();
    println!("cutting again {} after the server was ready", since(back));
    assert!(handle.process.end().unwrap().success());

    let ticks = handle.ticks().unwrap();
    assert_released(&ticks);
    let step_n = greatest_force_step_n(&ticks);
    assert!(step_n <= FORCE_STEP_N, "{step_n} N in a tick");
    let last = ticks.last().unwrap().lease;
    assert_ne!(ticks[0].lease, last);
    assert!(
        ticks
            .iter()
            .any(|tick| tick.lease == last && 0.05 < tick.felt_n()),
        "the hand feels the clay of the new server"
    );
}

#[test]
fn a_server_that_is_killed_under_a_pressing_hand_lets_it_go_under_every_scheme() {
    for &scheme in Scheme::ALL {
        let server = Server::on_free_ports().unwrap();
        let mut handle = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
        let client = &server.client;
        client.patch(DEMO, &json!({ "scheme": scheme })).unwrap();
        client
            .session_when(DEMO, "a force on the hand", PATIENCE, feels)
            .unwrap();
        server.kill().unwrap();
        let ticks = |status: &serde_json::Value| status["ticks"].as_u64().unwrap_or_default();
        let alone = handle.status().map_or(0, |status| ticks(&status));
        handle
            .status_when("two seconds alone", PATIENCE, |status| {
                alone + 2000 < ticks(status)
            })
            .unwrap();
        assert!(handle.process.end().unwrap().success());
        let rows = handle.ticks().unwrap();
        assert_released(&rows);
        let step_n = greatest_force_step_n(&rows);
        assert!(step_n <= FORCE_STEP_N, "{scheme}: {step_n} N in a tick");
        // From the last frame on: how much was felt then, and how long something was.
        let last = rows.iter().rposition(|row| row.silence_s < 2e-3).unwrap();
        let felt = rows[last..].iter().rposition(|row| 0.0 < row.felt_n());
        println!(
            "{scheme}: {:.2} N when the last frame came, nothing {} ms later",
            rows[last].felt_n(),
            felt.map_or(0, |ticks| ticks + 1)
        );
    }
}

/// After the hand has felt the clay, a tick that comes a fifth of a second after the last frame, or later, gives no
/// force; and there were such ticks.
pub(super) fn assert_released(ticks: &[Row]) {
    let felt = ticks
        .iter()
        .position(|tick| 0.05 < tick.felt_n())
        .expect("there was a force to release");
    let silent: Vec<&Row> = ticks[felt..]
        .iter()
        .filter(|tick| 0.2 <= tick.silence_s)
        .collect();
    assert!(100 < silent.len(), "only {} silent ticks", silent.len());
    let pressed = silent.iter().find(|tick| 0.0 < tick.felt_n());
    assert!(pressed.is_none(), "force after the silence: {pressed:?}");
}

#[test]
fn a_lease_ends_ten_seconds_after_the_last_frame() {
    let server = Server::on_free_ports().unwrap();
    let mut handle = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    let client = &server.client;
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    let killed = handle.process.kill().unwrap();
    client
        .session_when(DEMO, "the lease to end", PATIENCE, |session| {
            held(session).is_empty()
        })
        .unwrap();
    let lasted = killed.elapsed().as_secs_f64();
    assert!((9.9..11.5).contains(&lasted), "{lasted} s");
    assert_eq!(
        client.session(DEMO).unwrap().state,
        teleclay_proto::http::SessionState::Idle
    );
}
