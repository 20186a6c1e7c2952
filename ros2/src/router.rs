//! The way to the router. Without one nobody on ROS 2 finds anybody, and nothing says so: here it is said.

use std::sync::atomic::Ordering;
use std::time::Duration;

use tokio::time::{MissedTickBehavior, interval, sleep};
use zenoh::{Config as ZenohConfig, Session};

use crate::node::Node;
use crate::{Config, Status};

/// How often a router that does not answer is asked again.
const AGAIN_EVERY: Duration = Duration::from_secs(1);
/// How often it is looked whether it is still there.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// Opens a session to the router, however long that takes.
pub(crate) async fn connect(config: &Config, status: &Status) -> Session {
    let router = &config.router;
    let mut is_told = false;
    loop {
        let opened = match zenoh_config(router) {
            Ok(config) => zenoh::open(config).await,
            Err(error) => Err(error),
        };
        match opened {
            Ok(session) => {
                status.router_is_up.store(true, Ordering::Relaxed);
                tracing::info!(
                    router,
                    domain = config.domain,
                    "sessions are told of on ROS 2"
                );
                return session;
            }
            Err(error) if !is_told => {
                is_told = true;
                tracing::error!(
                    router,
                    %error,
                    "no Zenoh router answers, so ROS 2 hears nothing: start one with \
                     `ros2 run rmw_zenoh_cpp rmw_zenohd`; it is asked again every second"
                );
            }
            Err(error) => tracing::debug!(router, %error, "no Zenoh router answers"),
        }
        sleep(AGAIN_EVERY).await;
    }
}

/// Says when the router goes and comes back. Zenoh itself connects again, and shows everything anew.
pub(crate) async fn watch(node: &Node, router: &str, status: &Status) {
    let mut every = interval(LOOK_EVERY);
    every.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut was_up = true;
    while !node.session().is_closed() {
        every.tick().await;
        let is_up = node.session().info().routers_zid().await.next().is_some();
        status.router_is_up.store(is_up, Ordering::Relaxed);
        match (was_up, is_up) {
            (true, false) => {
                tracing::error!(router, "the Zenoh router is gone, so ROS 2 hears nothing");
            }
            (false, true) => tracing::info!(router, "the Zenoh router is back"),
            _ => {}
        }
        was_up = is_up;
    }
}

/// A client: it listens nowhere, calls nobody but the router, and nobody calls it. Nodes of ROS 2 are peers and find
/// each other by the router; between clients and peers the router carries everything.
fn zenoh_config(router: &str) -> zenoh::Result<ZenohConfig> {
    let endpoints = serde_json::json!([router]).to_string();
    let mut config = ZenohConfig::default();
    for (key, value) in [
        ("mode", "\"client\""),
        ("scouting/multicast/enabled", "false"),
        ("scouting/gossip/enabled", "false"),
        ("listen/endpoints", "[]"),
        ("connect/endpoints", endpoints.as_str()),
        // One that does not answer is to be told of, not waited for in silence.
        ("connect/timeout_ms", "0"),
        ("connect/exit_on_failure", "true"),
        (
            "connect/retry",
            "{ period_init_ms: 100, period_max_ms: 1000, period_increase_factor: 2 }",
        ),
    ] {
        config.insert_json5(key, value)?;
    }
    Ok(config)
}
