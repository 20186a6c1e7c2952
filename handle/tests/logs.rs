//! What the program writes on standard error, for programs that collect such lines.

use std::process::Command;

use serde_json::Value;

/// Nobody listens on the first port, which only root could have: the handle asks in vain, and ends.
#[test]
fn each_line_of_a_log_in_json_says_when_how_grave_and_of_which_session() {
    let said = Command::new(env!("CARGO_BIN_EXE_teleclay-handle"))
        .args(["--connect", "tcp/127.0.0.1:1", "--session", "clay"])
        .args(["--seconds", "0.5", "--log-format", "json"])
        .output()
        .unwrap();
    let lines = String::from_utf8(said.stderr).unwrap();
    let mut levels = Vec::new();
    for line in lines.lines() {
        let told: Value =
            serde_json::from_str(line).unwrap_or_else(|error| panic!("{line}: {error}"));
        let text = |field: &str| told[field].as_str().unwrap_or_else(|| panic!("{line}"));
        assert!(text("timestamp").ends_with('Z'), "{line}");
        assert_eq!(text("session"), "clay", "{line}");
        assert!(!text("message").is_empty(), "{line}");
        levels.push(text("level").to_owned());
    }
    assert_eq!(levels.last().map(String::as_str), Some("ERROR"), "{lines}");
}
