//! Sessions as ROS 2 is told of them, and what it asks of them: the same commands as over HTTP. There is none that
//! clears a stop.

use teleclay_doors::audit::Deed;
use teleclay_proto::Scheme;
use teleclay_proto::http::{ClayReset, Session, SessionPatch, SessionState, StorageState};
use teleclay_proto::watch::Level as WatchLevel;
use teleclay_ros2::host::{self, Call, Host, HostSession, Level, Look, ToolLook};
use tokio::sync::{broadcast, watch};

use crate::directory::{Directory, Live};
use crate::session::{Event, Sample};

/// Who asks over ROS 2, in the audit log: more is not known.
const WHO: &str = "ros2";

/// A server's sessions.
pub(crate) struct OnRos2(pub(crate) Directory);

impl Host for OnRos2 {
    type Session = SessionOnRos2;

    fn sessions(&self) -> Vec<SessionOnRos2> {
        let lives = self.0.lives().into_iter();
        lives
            .map(|live| SessionOnRos2 {
                live,
                directory: self.0.clone(),
            })
            .collect()
    }

    fn changes(&self) -> watch::Receiver<u64> {
        self.0.changes()
    }
}

/// One session.
#[derive(Clone)]
pub(crate) struct SessionOnRos2 {
    live: Live,
    directory: Directory,
}

impl HostSession for SessionOnRos2 {
    type Sample = Sample;
    type Event = Event;

    fn name(&self) -> &str {
        self.live.id().as_str()
    }

    fn number(&self) -> u32 {
        self.live.number()
    }

    fn telemetry(&self) -> broadcast::Receiver<Sample> {
        self.live.telemetry()
    }

    fn events(&self) -> broadcast::Receiver<Event> {
        self.live.events()
    }

    fn look(&self) -> Look {
        let session = self.live.state();
        let settings = serde_json::to_string(&self.live.settings());
        let (level, condition) = condition(&session);
        Look {
            home_m: session.tools.first().map_or([0.0; 3], |tool| tool.home_m),
            tools: session
                .tools
                .iter()
                .map(|tool| ToolLook {
                    operator: tool.operator.clone(),
                    is_connected: tool.connected,
                })
                .collect(),
            revision: session.revision,
            settings: settings.expect("every map in it has strings as keys"),
            level,
            condition,
            figures: figures(&session),
        }
    }

    async fn carry_out(&self, call: Call) -> Result<String, String> {
        let did = call.to_string();
        let outcome = self.try_to(call).await;
        self.directory.doors().tell_deed(Deed {
            who: WHO.to_owned(),
            from: None,
            did,
            session: Some(self.live.id().to_string()),
            outcome: outcome.clone().unwrap_or_else(|why_not| why_not),
        });
        outcome
    }
}

impl SessionOnRos2 {
    async fn try_to(&self, call: Call) -> Result<String, String> {
        let changed = match call {
            Call::Pause(is_paused) => {
                let patch = SessionPatch {
                    paused: Some(is_paused),
                    ..SessionPatch::default()
                };
                self.live.patch(patch).await
            }
            Call::ResetClay => self.live.reset(ClayReset::default(), None).await,
            Call::SetScheme(word) => {
                let scheme: Scheme = word.parse().map_err(told)?;
                let patch = SessionPatch {
                    scheme: Some(scheme),
                    ..SessionPatch::default()
                };
                self.live.patch(patch).await
            }
        };
        let session = changed.map_err(told)?;
        let (_, condition) = condition(&session);
        Ok(format!("{}, {condition}", session.scheme.word()))
    }
}

fn told(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// How the session is, in a word and its reason.
fn condition(session: &Session) -> (Level, String) {
    let (level, word) = match session.state {
        SessionState::Idle => (Level::Fine, "idle"),
        SessionState::Running => (Level::Fine, "running"),
        SessionState::Paused => (Level::Fine, "paused"),
        SessionState::Stopped => (Level::Warning, "stopped"),
        SessionState::Fault => (Level::Error, "fault"),
    };
    let mut said = word.to_owned();
    if let Some(stop) = &session.stop {
        said += &format!(" by {}: {}", stop.by, stop.reason);
    }
    if let Some(fault) = &session.fault {
        said += &format!(": {fault}");
    }
    if session.storage.state == StorageState::Failed {
        let why = session.storage.reason.as_deref().unwrap_or("for no reason");
        return (Level::Error, format!("{said}; it is not kept: {why}"));
    }
    (level, said)
}

fn figures(session: &Session) -> Vec<(&'static str, String)> {
    let of_loop = &session.control_loop;
    vec![
        ("revision", session.revision.to_string()),
        ("scheme", session.scheme.word().to_owned()),
        ("rate_hz", of_loop.rate_hz.to_string()),
        ("ticks", of_loop.ticks.to_string()),
        ("late_ticks", of_loop.late_ticks.to_string()),
        ("tick_s_p99", of_loop.tick_s.p99.to_string()),
        ("rtt_s_p50", of_loop.rtt_s.p50.to_string()),
        ("rtt_s_p99", of_loop.rtt_s.p99.to_string()),
        ("lost", of_loop.lost.to_string()),
        ("clay_hash", session.clay.hash.to_string()),
        (
            "removed_volume_m3",
            session.clay.removed_volume_m3.to_string(),
        ),
    ]
}

impl From<Sample> for host::Sample {
    fn from(told: Sample) -> Self {
        Self {
            tool: told.tool,
            time_s: told.time_s,
            sample: told.sample,
        }
    }
}

impl From<Event> for host::Event {
    fn from(told: Event) -> Self {
        Self {
            level: match told.level {
                WatchLevel::Info => Level::Fine,
                WatchLevel::Warning => Level::Warning,
                WatchLevel::Error => Level::Error,
            },
            text: told.text,
            time_s: told.time_s,
        }
    }
}
