//! The commands that need no server, as a person or a script types them.

use std::io::Write as _;
use std::process::{Command, Output, Stdio};

use serde_json::{Value, json};

fn run(arguments: &[&str]) -> Output {
    run_with(arguments, "")
}

/// Runs the program and writes `input` to it.
fn run_with(arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_teleclay-server"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A command that does not read it may have ended before it is written.
    child.stdin.take().unwrap().write_all(input.as_bytes()).ok();
    child.wait_with_output().unwrap()
}

fn text(arguments: &[&str]) -> String {
    let output = run(arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&text(arguments)).unwrap()
}

/// Rows of a CSV by column; `None` where a cell is empty.
fn column(csv: &str, name: &str) -> Vec<Option<f64>> {
    let mut lines = csv.lines().map(|line| line.split(','));
    let place = lines.next().unwrap().position(|heading| heading == name);
    let place = place.unwrap_or_else(|| panic!("no column {name} in {csv}"));
    lines
        .map(|mut line| line.nth(place).unwrap().parse().ok())
        .collect()
}

const COMMANDS: [&[&str]; 7] = [
    &["kinematics", "inverse", "--position-m", "0.02,-0.03,0.16"],
    &["kinematics", "forward", "--joints-rad", "0.1,-0.2,0.3"],
    &["kinematics", "jacobian", "--branch", "1,-1,1"],
    &["workspace", "--cells", "6,5,4"],
    &["analyse"],
    &["tune"],
    &["experiment", "--edges-m", "0.03,0.04,0.05,0.06"],
];

/// The three forms tell the same: every number of the CSV stands in the JSON.
#[test]
fn every_command_prints_a_table_csv_or_json() {
    for command in COMMANDS {
        let with =
            |flag: &'static str| -> Vec<&str> { command.iter().copied().chain([flag]).collect() };
        let table = text(command);
        assert!(2 < table.lines().count(), "{table}");
        assert!(!table.contains("NaN") && !table.contains("inf"), "{table}");
        let csv = text(&with("--csv"));
        let columns = csv.lines().next().unwrap().split(',').count();
        assert!(1 < columns && csv.lines().all(|line| line.split(',').count() == columns));
        let json = json(&with("--json"));
        let mut numbers = Vec::new();
        collect(&json, &mut numbers);
        let is_computed =
            |name: &str| ["x_m", "y_m", "z_m"].contains(&name) && command[0] == "workspace";
        for heading in csv.lines().next().unwrap().split(',') {
            if is_computed(heading) {
                continue;
            }
            for value in column(&csv, heading).into_iter().flatten() {
                // Plus zero: where the JSON has a zero below zero, the CSV has none.
                let is_told = |number: &f64| (number + 0.0).to_bits() == value.to_bits();
                assert!(
                    numbers.iter().any(is_told),
                    "{command:?}: {heading} {value}"
                );
            }
        }
    }
}

fn collect(value: &Value, numbers: &mut Vec<f64>) {
    match value {
        Value::Number(number) => numbers.extend(number.as_f64()),
        Value::Array(items) => items.iter().for_each(|item| collect(item, numbers)),
        Value::Object(fields) => fields.values().for_each(|field| collect(field, numbers)),
        _ => {}
    }
}

/// Without options the experiment is that of Fig. 7.
#[test]
fn the_experiment_prints_its_plateaus() {
    let answer = json(&["experiment", "--json"]);
    for (range, wanted) in [2.0 / 30.0, 2.0 / 50.0, 2.0 / 70.0].into_iter().enumerate() {
        let measured = answer["simulated_velocity_m_s"][range].as_f64().unwrap();
        assert!((measured / wanted - 1.0).abs() < 0.02, "{measured} m/s");
    }
    let csv = text(&["experiment", "--csv"]);
    let positions = column(&csv, "position_m");
    assert!(positions.is_sorted() && 1000 < positions.len());
}

/// A request from a file or a pipe is the body of the call, and is refused with the field that is wrong.
#[test]
fn a_request_may_come_from_a_pipe() {
    let body = json!({ "position_m": [0.02, -0.03, 0.16] });
    let arguments = ["kinematics", "inverse", "--json", "--input", "-"];
    let output = run_with(&arguments, &body.to_string());
    assert!(output.status.success());
    let piped: Value = serde_json::from_slice(&output.stdout).unwrap();
    let typed = json(&[
        "kinematics",
        "inverse",
        "--json",
        "--position-m",
        "0.02,-0.03,0.16",
    ]);
    assert_eq!(piped, typed);
    for (bad, word) in [
        (json!({ "position_m": [0, 0, 1e12] }), "/position_m/2"),
        (json!({ "position": [0, 0, 0] }), "/position"),
        (json!([1, 2]), "no request"),
    ] {
        let output = run_with(&arguments, &bad.to_string());
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && output.stdout.is_empty());
        assert!(told.contains(word), "{told}");
    }
    let output = run(&["analyse", "--input", "/does/not/exist"]);
    assert!(!output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("/does/not/exist"));
}

#[test]
fn what_has_no_answer_says_why_and_fails() {
    let cases: [(&[&str], &str); 15] = [
        (&["kinematics", "inverse", "--position-m", "1,0,0"], "reach"),
        (&["kinematics", "inverse", "--position-m", "1,0"], "three"),
        (
            &["kinematics", "jacobian", "--branch", "1,2,1"],
            "neither 1 nor -1",
        ),
        (
            &["kinematics", "inverse", "--upper-link-m", "-1"],
            "--upper-link-m: -1 is not a number from 0.000001 to 1000000",
        ),
        (
            &[
                "kinematics",
                "inverse",
                "--input",
                "-",
                "--position-m",
                "0,0,0",
            ],
            "'--input <FILE>' cannot be used with",
        ),
        (
            &["analyse", "--force-ratio", "1"],
            "--force-ratio: 1 is not a number from -1000000 to",
        ),
        (
            &["analyse", "--clay-damping-n-s-per-m", "lots"],
            "`lots` is not a number",
        ),
        (
            &["analyse", "--omegas-rad-s", "0"],
            "--omegas-rad-s: 0 is not a number from 1e-",
        ),
        (&["analyse", "--g-h", "z"], "wanted x, y, or coefficients"),
        (
            &["analyse", "--g-h", "1/0,0"],
            "--g-h: every coefficient is zero",
        ),
        (
            &["workspace", "--from-m", "0,0,1", "--to-m", "1,1,0"],
            "--from-m, --to-m: 0 is not a number from 1",
        ),
        (
            &["tuning", "--round-trip-s", "-1"],
            "--round-trip-s: -1 is not",
        ),
        (&["tune", "--heaviest-n-s-per-m", "0.001"], "N s/m"),
        (&["experiment", "--virtual-mass-kg", "0.1"], "unstable"),
        // Flags of the server have no meaning without one.
        (&["--no-demo-session", "analyse"], "analyse"),
    ];
    for (arguments, word) in cases {
        let output = run(arguments);
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success(), "{arguments:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        assert!(told.contains(word), "{arguments:?}: {told}");
    }
}

/// Whoever has seen enough closes the pipe; that is no error.
#[test]
fn a_reader_that_leaves_is_no_error() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_teleclay-server"))
        .args(["workspace", "--cells", "40", "--csv"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}");
}

/// What the dashboard takes its types from, without a server to ask.
#[test]
fn the_description_of_the_interface_is_printed() {
    let printed = json(&["openapi"]);
    let version = env!("CARGO_PKG_VERSION");
    let served = teleclay_server::api::description(version);
    assert_eq!(printed, serde_json::to_value(served).unwrap());
    assert_eq!(printed["info"]["version"], version);
}
