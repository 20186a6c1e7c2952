//! What the vectors hold.

mod frames;
mod hand;
mod texts;
pub mod values;
mod watch;

use serde_json::Value;

/// Every file: its name and its text.
pub fn files() -> Vec<(&'static str, String)> {
    let files = [
        ("handle_frames.json", frames::handle_frames()),
        ("tool_frames.json", frames::tool_frames()),
        ("telemetry.json", watch::telemetry()),
        ("bricks.json", watch::bricks()),
        ("packed_bricks.json", watch::packed_bricks()),
        ("refused.json", watch::refused()),
        ("server_texts.json", texts::server_texts()),
        ("client_texts.json", texts::client_texts()),
        ("hand_texts.json", hand::texts()),
        ("join.json", texts::join()),
        ("keys.json", texts::keys()),
    ];
    files.map(|(name, file)| (name, pretty(&file))).to_vec()
}

/// One line per case, so that a change shows as the lines that changed.
fn pretty(file: &Value) -> String {
    let Value::Object(parts) = file else {
        unreachable!("every file is an object")
    };
    let parts: Vec<String> = parts
        .iter()
        .map(|(name, part)| match part {
            Value::Array(cases) => {
                let cases: Vec<String> = cases.iter().map(|case| format!("    {case}")).collect();
                format!("  {name:?}: [\n{}\n  ]", cases.join(",\n"))
            }
            other => format!("  {name:?}: {other}"),
        })
        .collect();
    format!("{{\n{}\n}}\n", parts.join(",\n"))
}
