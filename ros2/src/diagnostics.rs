//! `/diagnostics`: how every session is doing, once a second.

use std::time::Duration;

use teleclay_ros::names::clay_frame;
use teleclay_ros::standard::{DiagnosticArray, DiagnosticStatus, Header, KeyValue, Time};
use tokio::time::{MissedTickBehavior, interval};

use crate::host::{Host, HostSession as _, Level, Look};
use crate::node::{Node, now_ns};

/// As often as others tell it, and as viewers expect it.
const EVERY: Duration = Duration::from_secs(1);

/// Tells of all sessions until it is dropped.
pub(crate) async fn tell(node: &Node, host: &impl Host) {
    let mut every = interval(EVERY);
    every.set_missed_tick_behavior(MissedTickBehavior::Delay);
    while !node.session().is_closed() {
        every.tick().await;
        let sessions: Vec<(String, Look)> = host
            .sessions()
            .iter()
            .map(|session| (clay_frame(session.name()), session.look()))
            .collect();
        let array = DiagnosticArray {
            header: Header {
                stamp: Time::from_ns(now_ns()),
                frame_id: "",
            },
            status: sessions
                .iter()
                .map(|(name, look)| status(name, look))
                .collect(),
        };
        node.diagnostics().put(&array).await;
    }
}

fn status<'a>(name: &'a str, look: &'a Look) -> DiagnosticStatus<'a> {
    DiagnosticStatus {
        level: match look.level {
            Level::Fine => DiagnosticStatus::OK,
            Level::Warning => DiagnosticStatus::WARN,
            Level::Error => DiagnosticStatus::ERROR,
        },
        name,
        message: &look.condition,
        hardware_id: "teleclay",
        values: look
            .figures
            .iter()
            .map(|(key, value)| KeyValue { key, value })
            .collect(),
    }
}
