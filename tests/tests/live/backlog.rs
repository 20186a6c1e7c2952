//! What waited while a program stood still, over TCP, which then delivers all of it at once: nothing of it is felt.

use serde_json::json;
use teleclay_proto::Scheme;
use teleclay_tests::process::PATIENCE;
use teleclay_tests::recording::{Row, greatest_force_step_n};
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Ports, Server, Transport};
use teleclay_tests::starved::live;

use super::endings::{FORCE_STEP_N, cuts};
use super::on_virtual_time;

/// The schemes without a copy: of these the hand feels frames, and the tool follows them.
const SCHEMES: [Scheme; 4] = [
    Scheme::ForceExchange,
    Scheme::PositionForce,
    Scheme::Wave,
    Scheme::Tdpa,
];
/// A cut gives up to 1.8 N as it goes, by waves or by frames that come two to a tick; a queue that is felt gave 4 to
/// 7 N.
const MOST_N: f64 = 2.5;
/// What comes after a return is looked at for so many ticks.
const LOOKED_AT: usize = 500;

fn cutting(scheme: Scheme) -> (Server, Handle) {
    let server = Server::start(Ports::free().unwrap(), Transport::Tcp).unwrap();
    let handle = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    let client = &server.client;
    client.patch(DEMO, &json!({"scheme": scheme})).unwrap();
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    client.let_pass(DEMO, 1500).unwrap();
    (server, handle)
}

fn greatest_n(rows: &[Row]) -> f64 {
    rows.iter().map(Row::felt_n).fold(0.0, f64::max)
}

/// Nothing but the ramp, from the tick at which frames came again.
fn assert_nothing_is_felt_of_it(case: &str, rows: &[Row], returned: usize) {
    let before_n = greatest_n(&rows[..returned]);
    let after = &rows[returned..rows.len().min(returned + LOOKED_AT)];
    let after_n = greatest_n(after);
    let step_n = greatest_force_step_n(rows);
    println!(
        "{case}: at most {before_n:.2} N before, {after_n:.2} N after, {step_n:.3} N in a tick"
    );
    assert!(
        100 < after.len(),
        "{case}: only {} ticks after",
        after.len()
    );
    assert!(0.1 < before_n, "{case}: hardly any force");
    assert!(
        after_n <= MOST_N,
        "{case}: {after_n} N after, {before_n} N before"
    );
    assert!(step_n <= FORCE_STEP_N, "{case}: {step_n} N in a tick");
}

fn a_server_is_stopped_and_continued(scheme: Scheme) {
    let (server, mut handle) = cutting(scheme);
    server.process.freeze();
    handle.process.logs("force released", PATIENCE).unwrap();
    let ticks = |status: &serde_json::Value| status["ticks"].as_u64().unwrap_or_default();
    let began = handle.status().map_or(0, |status| ticks(&status));
    handle
        .status_when("two seconds", PATIENCE, |status| {
            began + 2000 < ticks(status)
        })
        .unwrap();
    server.process.thaw();
    // Under the old lease, or under another one that it has asked for meanwhile.
    handle
        .status_when("frames again", PATIENCE, |status| status["state"] == "live")
        .unwrap();
    server
        .client
        .session_when(DEMO, "the hand again", PATIENCE, |session| {
            session.tools.iter().any(|tool| tool.connected)
        })
        .unwrap();
    server.client.let_pass(DEMO, 1000).unwrap();
    assert!(handle.process.end().unwrap().success());
    let rows = handle.ticks().unwrap();
    let silent = rows.iter().rposition(|row| 0.5 < row.silence_s);
    let returned = silent.expect("it was stopped for two seconds") + 1;
    let case = format!("{scheme}, server stopped");
    assert_nothing_is_felt_of_it(&case, &rows, returned);
}

fn a_handle_is_stopped_and_continued(scheme: Scheme) {
    let (server, mut handle) = cutting(scheme);
    handle.process.freeze();
    server.client.let_pass(DEMO, 1500).unwrap();
    let alone = server.client.session(DEMO).unwrap();
    assert!(!alone.tools[0].connected);
    handle.process.thaw();
    server
        .client
        .session_when(DEMO, "the hand again", PATIENCE, |session| {
            session.tools[0].connected
        })
        .unwrap();
    server.client.let_pass(DEMO, 1000).unwrap();
    assert!(handle.process.end().unwrap().success());
    let rows = handle.ticks().unwrap();
    let gap = |pair: &[Row]| 1.0 < pair[1].clock_s - pair[0].clock_s;
    let returned = rows.windows(2).position(gap).expect("it was stopped") + 1;
    let case = format!("{scheme}, handle stopped");
    assert_nothing_is_felt_of_it(&case, &rows, returned);
}

#[test]
fn what_waited_for_a_stopped_server_is_not_felt() {
    for scheme in SCHEMES {
        live(
            || a_server_is_stopped_and_continued(scheme),
            || on_virtual_time::a_program_that_stands_still(scheme),
        );
    }
}

#[test]
fn what_waited_for_a_stopped_handle_is_not_felt() {
    for scheme in SCHEMES {
        live(
            || a_handle_is_stopped_and_continued(scheme),
            || on_virtual_time::a_program_that_stands_still(scheme),
        );
    }
}
