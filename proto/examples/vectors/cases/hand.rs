//! Texts by which a hand holds a tool on a WebSocket, and operators ask one another for it.

use serde_json::{Value, json};
use teleclay_proto::Axes;
use teleclay_proto::join::{LoopParameters, RefusalCode};
use teleclay_proto::watch::{ClientText, HandDevice, ServerText};

use super::texts::{clay, granted, text};

pub(super) fn texts() -> Value {
    json!({
        "about": "texts of a stream for those who hold a tool, or want one",
        "from_the_server": from_the_server(),
        "to_the_server": to_the_server(),
        "refused": [
            { "text": r#"{"type":"join"}"#, "pointer": "" },
            { "text": r#"{"type":"join","operator":"","device":{"name":"m","axes":2,"force_n":0,"rate_hz":60,"measures_force":false}}"#, "pointer": "/operator" },
            { "text": r#"{"type":"join","operator":"Ada","device":{"name":"m","axes":4,"force_n":0,"rate_hz":60,"measures_force":false}}"#, "pointer": "/device/axes" },
            { "text": r#"{"type":"join","operator":"Ada","device":{"name":"m","axes":2,"force_n":-1,"rate_hz":60,"measures_force":false}}"#, "pointer": "/device/force_n" },
            { "text": r#"{"type":"join","operator":"Ada","device":{"name":"m","axes":2,"force_n":0,"rate_hz":0,"measures_force":false}}"#, "pointer": "/device/rate_hz" },
            { "text": r#"{"type":"request","tool":0,"operator":"Ada"}"#, "pointer": "/tool" },
            { "text": r#"{"type":"grant","tool":1}"#, "pointer": "" },
            { "text": r#"{"type":"leave","tool":1}"#, "pointer": "" },
        ],
    })
}

fn from_the_server() -> Vec<Value> {
    let refused = |code, reason: &str, holder: Option<&str>| ServerText::Refused {
        code,
        reason: reason.to_owned(),
        holder: holder.map(str::to_owned),
    };
    vec![
        text(
            "a lease",
            &ServerText::Granted {
                keys: std::array::from_fn(|n| n as u8),
                granted: Box::new(granted()),
            },
        ),
        text(
            "no tool is free",
            &refused(
                RefusalCode::NoFreeTool,
                "all 1 tools of session `demo` are held, by Ada",
                Some("Ada"),
            ),
        ),
        text(
            "nobody stands in the way",
            &refused(RefusalCode::Busy, "the loop is late", None),
        ),
        text(
            "a farewell",
            &ServerText::Farewell {
                reason: "Eve has stopped the session: enough".to_owned(),
            },
        ),
        text("left", &ServerText::Left {}),
        text(
            "parameters",
            &ServerText::Parameters {
                parameters: Box::new(LoopParameters {
                    revision: 2,
                    ..LoopParameters::default()
                }),
            },
        ),
        text(
            "a snapshot",
            &ServerText::Snapshot {
                clay: clay(),
                messages: 3,
            },
        ),
        text("done", &ServerText::Done {}),
    ]
}

fn to_the_server() -> Vec<Value> {
    let device = HandDevice {
        name: "mouse".to_owned(),
        axes: Axes::Two,
        force_n: 0.0,
        rate_hz: 60.0,
        measures_force: false,
    };
    let (tool, operator) = (1, "Bob".to_owned());
    let join = |token: Option<&str>| ClientText::Join {
        operator: "Ada".to_owned(),
        device: device.clone(),
        token: token.map(str::to_owned),
    };
    vec![
        text("a join", &join(None)),
        text("a join with a token", &join(Some("a token"))),
        text("a leave", &ClientText::Leave {}),
        text("parameters", &ClientText::Parameters {}),
        text("a snapshot", &ClientText::Snapshot { epoch: u32::MAX }),
        text(
            "a request",
            &ClientText::Request {
                tool,
                operator: operator.clone(),
            },
        ),
        text(
            "a withdrawal",
            &ClientText::Withdraw {
                tool,
                operator: operator.clone(),
            },
        ),
        text(
            "a grant",
            &ClientText::Grant {
                tool,
                operator: operator.clone(),
            },
        ),
        text(
            "a denial",
            &ClientText::Deny {
                tool,
                operator,
                reason: Some("in a moment".to_owned()),
            },
        ),
        text("a release", &ClientText::Release { tool: 8 }),
        text(
            "a stop",
            &ClientText::Stop {
                operator: Some("Eve".to_owned()),
                reason: Some("enough".to_owned()),
            },
        ),
        text(
            "a stop without a word",
            &ClientText::Stop {
                operator: None,
                reason: None,
            },
        ),
        text(
            "the end of a stop",
            &ClientText::ClearStop { operator: None },
        ),
    ]
}
