//! The demo's view of the server, over HTTP like any other client.
//!
//! The types here name what the summary needs, and are not those of the server on purpose: when a name of the public
//! interface changes by accident, the demo fails.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use ureq::Agent;

/// The session that a server without flags opens.
pub(super) const SESSION: &str = "demo";

/// A healthy server answers in milliseconds.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);

/// Asks one server.
pub(super) struct Client {
    agent: Agent,
    origin: String,
    token: Option<String>,
}

impl Client {
    /// For the server at `address`. A token in the environment is what the server asks for, too.
    pub(super) fn new(address: &SocketAddr) -> Self {
        let agent = Agent::config_builder()
            .timeout_global(Some(ANSWER_WITHIN))
            .build()
            .into();
        Self {
            agent,
            origin: format!("http://{address}"),
            token: std::env::var("TELECLAY_TOKEN").ok(),
        }
    }

    /// Whether the loop runs and Zenoh is up.
    pub(super) fn is_ready(&self) -> bool {
        self.agent
            .get(format!("{}/readyz", self.origin))
            .call()
            .is_ok()
    }

    /// The demo's session as it is now.
    pub(super) fn session(&self) -> Result<SessionView> {
        let path = format!("/api/v1/sessions/{SESSION}");
        serde_json::from_str(&self.read(&path)?)
            .with_context(|| format!("GET {path} answered something unknown"))
    }

    /// The session, and the moment it describes: half way between question and answer.
    pub(super) fn session_and_time(&self) -> Result<(Instant, SessionView)> {
        let asked = Instant::now();
        let session = self.session()?;
        Ok((asked + asked.elapsed() / 2, session))
    }

    fn read(&self, path: &str) -> Result<String> {
        let mut request = self.agent.get(format!("{}{path}", self.origin));
        if let Some(token) = &self.token {
            request = request.header("Authorization", format!("Bearer {token}"));
        }
        let mut response = request
            .call()
            .with_context(|| format!("GET {path} failed"))?;
        ensure!(
            response.status() == 200,
            "GET {path} answered {}",
            response.status()
        );
        response
            .body_mut()
            .read_to_string()
            .with_context(|| format!("the answer to GET {path} broke off"))
    }
}

/// A session, as far as the demo reads it.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct SessionView {
    pub(super) state: String,
    pub(super) fault: Option<String>,
    pub(super) scheme: String,
    pub(super) clay: ClayView,
    pub(super) tools: Vec<ToolView>,
    #[serde(rename = "loop")]
    pub(super) control_loop: LoopView,
}

impl SessionView {
    /// Whether an operator's frames come in.
    pub(super) fn is_operated(&self) -> bool {
        self.tools.iter().any(|tool| tool.connected)
    }

    /// The greatest force of the clay on any tool, N.
    pub(super) fn force_n(&self) -> f64 {
        let length = |f: [f64; 3]| f[0].hypot(f[1]).hypot(f[2]);
        self.tools
            .iter()
            .map(|tool| length(tool.force_n))
            .fold(0.0, f64::max)
    }
}

/// The clay's books. Units are 255ths of a voxel.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct ClayView {
    pub(super) initial_volume_m3: f64,
    pub(super) remaining_volume_m3: f64,
    pub(super) removed_volume_m3: f64,
    pub(super) initial_units: u64,
    pub(super) remaining_units: u64,
    pub(super) removed_units: u64,
}

/// A tool, and whether somebody holds it.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct ToolView {
    pub(super) connected: bool,
    pub(super) force_n: [f64; 3],
}

/// The loop and its link.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct LoopView {
    pub(super) ticks: u64,
    pub(super) late_ticks: u64,
    pub(super) tick_s: QuantilesView,
    pub(super) rtt_s: QuantilesView,
    pub(super) lost: u64,
    pub(super) scheduler: String,
}

/// Two quantiles of a time, s.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct QuantilesView {
    pub(super) p50: f64,
    pub(super) p99: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volumes of a real run, one of which a quick reader of decimals makes a bit too small.
    #[test]
    fn volumes_are_read_to_the_last_bit() {
        let session: SessionView = serde_json::from_str(
            r#"{"state": "running", "fault": null, "scheme": "force_exchange",
                "clay": {"initial_volume_m3": 0.000524288, "remaining_volume_m3": 0.00048262282205882356,
                         "removed_volume_m3": 4.166517794117647e-5,
                         "initial_units": 1069547520, "remaining_units": 984550557, "removed_units": 84996963},
                "tools": [],
                "loop": {"ticks": 1, "late_ticks": 0, "tick_s": {"p50": 0.0, "p99": 0.0},
                         "rtt_s": {"p50": 0.0, "p99": 0.0}, "lost": 0, "scheduler": ""}}"#,
        )
        .unwrap();
        let clay = &session.clay;
        let sum_m3 = clay.remaining_volume_m3 + clay.removed_volume_m3;
        assert_eq!(sum_m3.to_bits(), clay.initial_volume_m3.to_bits());
    }
}
