//! Another certificate while the server runs, and a hand that presses meanwhile.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use serde_json::json;
use teleclay_doors::Authority;
use teleclay_proto::{NodeName, RealmName};
use teleclay_server::doors::certificates::Source;
use teleclay_server::settings::Settings;
use teleclay_shell::log::LogFormat;
use teleclay_shell::ticker::Scheduling;
use teleclay_tests::client::Client;
use teleclay_tests::process::{PATIENCE, program};
use teleclay_tests::recording::{Row, greatest_force_step_n};
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Ports, TOKEN};

use super::endings::{FORCE_STEP_N, cuts};

/// Whoever lost its line is let go of within this, s: silence and ramp.
const LET_GO_S: f64 = 0.15;

fn settings(data: PathBuf, ports: Ports) -> Settings {
    let quic = |port: u16| format!("quic/127.0.0.1:{port}").parse().unwrap();
    Settings {
        realm: RealmName::new("local").unwrap(),
        listen: SocketAddr::from((Ipv4Addr::LOCALHOST, ports.http)),
        zenoh_control: quic(ports.zenoh),
        zenoh_slow: quic(ports.zenoh + 1),
        certificate: Source::Own,
        is_https: false,
        hosts: Vec::new(),
        data_dir: data,
        demo_session: true,
        is_ephemeral: true,
        clay_bytes: 4 << 30,
        node: NodeName::new("rotation").unwrap(),
        token: Some(TOKEN.to_owned()),
        allow_origins: Vec::new(),
        scheduling: Scheduling::Normal,
        spin: Duration::ZERO,
        tick_threads: 1,
        tick_budget: 0.0,
        ros2: None,
        log_format: LogFormat::Text,
    }
}

fn invite(data: &Path) -> String {
    let ran = Command::new(program("teleclay-server").unwrap())
        .args(["invite", DEMO, "--role", "operator", "--data-dir"])
        .arg(data)
        .output()
        .unwrap();
    let printed = String::from_utf8(ran.stdout).unwrap();
    let line = printed.lines().find(|line| line.starts_with("teleclay:"));
    line.unwrap_or_else(|| panic!("{printed}")).to_owned()
}

/// Every line breaks for a moment. The hand is let go of by the ramp and goes on by itself, and the invite that it came
/// with is good for the new certificate, too.
#[test]
fn a_new_certificate_lets_go_of_a_pressing_hand_for_a_moment_and_whoever_comes_later_sees_it() {
    let ports = Ports::free().unwrap();
    let data = std::env::temp_dir().join(format!("teleclay-rotation-{}", std::process::id()));
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let server = runtime
        .block_on(teleclay_server::Server::start(settings(
            data.clone(),
            ports,
        )))
        .unwrap();
    let client = Client::new(server.address, Some(TOKEN));
    client
        .patch(DEMO, &json!({ "scheme": "force_exchange" }))
        .unwrap();
    let line = invite(&data);
    let mut handle = Handle::start(&HandleOptions::invited(&line)).unwrap();
    let before = client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();

    let authority = Authority::open(&data).unwrap();
    let other = authority.issue(&["127.0.0.1".to_owned()]).unwrap();
    runtime.block_on(server.show_to_handles(&other));
    // It cuts again, on the new line.
    client
        .session_when(DEMO, "a further cut", PATIENCE, |session| {
            cuts(session) && session.clay.remaining_units < before.clay.remaining_units
        })
        .unwrap();
    let mut later = Handle::start(&HandleOptions::invited(&line).by("Bob")).unwrap();
    client
        .session_when(DEMO, "Bob's tool", PATIENCE, |session| {
            let mut tools = session.tools.iter();
            tools.any(|tool| tool.operator == "Bob" && tool.connected)
        })
        .unwrap();
    assert!(later.process.end().unwrap().success());
    assert!(handle.process.end().unwrap().success());

    let rows = handle.ticks().unwrap();
    let step_n = greatest_force_step_n(&rows);
    assert!(step_n <= FORCE_STEP_N, "{step_n} N in a tick");
    let longest_s = rows.iter().map(|row| row.silence_s).fold(0.0, f64::max);
    println!("the line was down for {longest_s:.3} s");
    let is_felt_without_a_line = |row: &Row| LET_GO_S + 2e-3 < row.silence_s && 0.0 < row.felt_n();
    assert!(!rows.iter().any(is_felt_without_a_line));
    runtime.block_on(server.stop());
    std::fs::remove_dir_all(data).ok();
}
