//! What probes ask for.

use crate::word::words;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The answer of `/healthz`: the process answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Health {
    /// Always `ok`: a process that is not well does not answer.
    pub status: HealthStatus,
    /// Version of the server.
    pub version: String,
    /// Since the process started, s.
    pub uptime_s: f64,
}

words! {
    /// See [`Health::status`].
    #[derive(Default, ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum HealthStatus: "health status" {
        /// The process answers.
        #[default]
        Ok "ok",
    }
}

/// The answer of `/readyz`, with status 200 when `ready` and 503 otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Readiness {
    /// Both of the below.
    pub ready: bool,
    /// The 1 kHz loop has ticked within the last tenth of a second.
    pub loop_running: bool,
    /// The Zenoh session is open and listens.
    pub zenoh_up: bool,
}
