//! Zenoh sessions that open nothing they were not told to open: peers on named endpoints, no multicast scouting, no
//! gossip.
//!
//! Control frames have a session of their own, since a blocking message of the same transport would hold them up; slow
//! state and bricks use another.

use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::{Config, Session};

use crate::certificate::base64;
use crate::endpoint::Endpoint;

/// Where to listen and whom to call.
#[derive(Clone, Default)]
pub struct Endpoints {
    /// Endpoints to listen on, such as `tcp/127.0.0.1:7547`.
    pub listen: Vec<Endpoint>,
    /// Endpoints to connect to; tried again until they answer.
    pub connect: Vec<Endpoint>,
    /// Certificate, those that vouch for it, and private key, in PEM, that secure endpoints listen with.
    pub identity: Option<(String, String)>,
    /// Certificate in PEM that vouches for the servers that are connected to, beside those of public authorities.
    pub trusted: Option<String>,
    /// What others may do on this session.
    pub permissions: Permissions,
}

impl std::fmt::Debug for Endpoints {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Endpoints")
            .field("listen", &self.listen)
            .field("connect", &self.connect)
            .finish_non_exhaustive()
    }
}

impl Endpoints {
    /// Listens on one endpoint in the clear.
    #[must_use]
    pub fn listening(endpoint: Endpoint) -> Self {
        Self {
            listen: vec![endpoint],
            ..Self::default()
        }
    }

    /// Connects to one endpoint.
    #[must_use]
    pub fn connecting(endpoint: Endpoint) -> Self {
        Self {
            connect: vec![endpoint],
            ..Self::default()
        }
    }
}

/// What others may do on a session.
#[derive(Clone, Debug, Default)]
pub enum Permissions {
    /// Whatever they like.
    #[default]
    All,
    /// What these rules say, and nothing else.
    Only(Vec<Rule>),
}

/// Something that others may do.
#[derive(Clone, Debug)]
pub struct Rule {
    /// Zenoh's words for it, such as `put` and `query`.
    pub messages: Vec<&'static str>,
    /// Which way: what comes in, or what goes out.
    pub flow: Flow,
    /// The keys, as expressions.
    pub keys: Vec<String>,
}

/// Which way a message goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// From others.
    In,
    /// To others.
    Out,
}

/// Why a session could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// Zenoh refused.
    #[error("zenoh session on {what}: {reason}")]
    Open {
        /// Its endpoints.
        what: String,
        /// Zenoh's own words.
        reason: String,
    },
}

/// Hands all of Zenoh's work to one thread: on few cores its default of several loses more to wake-ups across cores
/// than it gains. The variable is read once, when the first session opens; a user's own setting wins.
///
/// Call first thing in `main`, before any thread exists.
pub fn prepare_runtime() {
    const NAME: &str = "ZENOH_RUNTIME";
    if std::env::var_os(NAME).is_some() {
        return;
    }
    let value = "(rx:(handover:app),tx:(handover:app),acc:(handover:app),net:(handover:app),app:(worker_threads:1))";
    #[allow(
        unsafe_code,
        reason = "no other thread exists yet, so nobody reads the environment meanwhile"
    )]
    // SAFETY: see the reason above; both strings are valid.
    unsafe {
        std::env::set_var(NAME, value);
    }
}

/// Opens a peer on exactly these endpoints.
///
/// # Errors
/// An endpoint cannot be listened on. Endpoints to connect to are tried in the background.
pub async fn open(endpoints: &Endpoints) -> Result<Session, NetworkError> {
    let config = config(endpoints).map_err(|reason| failed(endpoints, reason))?;
    zenoh::open(config)
        .await
        .map_err(|reason| failed(endpoints, reason))
}

/// What control frames are sent with: the newest matters, so a frame that cannot go at once is dropped and none is
/// batched or repeated.
pub const CONTROL_QOS: (CongestionControl, Priority, bool, Reliability) = (
    CongestionControl::Drop,
    Priority::RealTime,
    true,
    Reliability::BestEffort,
);

fn config(endpoints: &Endpoints) -> Result<Config, zenoh::Error> {
    let mut config = Config::default();
    let quoted = |list: &[Endpoint]| {
        let list: Vec<String> = list.iter().map(Endpoint::for_zenoh).collect();
        json(&list)
    };
    for (key, value) in [
        ("mode", "\"peer\""),
        ("scouting/multicast/enabled", "false"),
        ("scouting/gossip/enabled", "false"),
        ("listen/endpoints", quoted(&endpoints.listen).as_str()),
        ("connect/endpoints", quoted(&endpoints.connect).as_str()),
        // Keep calling: a server that went away may come back.
        ("connect/timeout_ms", "-1"),
        ("connect/exit_on_failure", "false"),
        (
            "connect/retry",
            "{ period_init_ms: 100, period_max_ms: 1000, period_increase_factor: 2 }",
        ),
        // A taken port is an error to tell now, not to wait for.
        ("listen/timeout_ms", "0"),
        ("listen/exit_on_failure", "true"),
        // A line may be down for longer than a copy of the clay goes on: whoever is silent is none of Zenoh's business,
        // the loop has watchdogs of its own. A process that dies closes its connections, and that is seen at once.
        ("transport/link/tx/lease", "10000"),
        ("transport/link/tx/keep_alive", "10"),
        // Whoever reads nothing is waited for no longer than that: a second is enough for a batch of 64 KiB on half a
        // megabit, and all of a process's lines wait meanwhile.
        (
            "transport/link/tx/queue/congestion_control/block/wait_before_close",
            "1000000",
        ),
        // A greeting that the network lost is repeated after four of the longest round trips.
        ("transport/unicast/open_timeout", "2000"),
    ] {
        config.insert_json5(key, value)?;
    }
    let mut secret = |key: &str, pem: &str| {
        let encoded = base64(pem.as_bytes());
        config.insert_json5(&format!("transport/link/tls/{key}_base64"), &json(&encoded))
    };
    if let Some((chain, key)) = &endpoints.identity {
        secret("listen_certificate", chain)?;
        secret("listen_private_key", key)?;
    }
    if let Some(trusted) = &endpoints.trusted {
        secret("root_ca_certificate", trusted)?;
    }
    if let Permissions::Only(rules) = &endpoints.permissions {
        config.insert_json5("access_control", &access_control(rules).to_string())?;
    }
    Ok(config)
}

/// Zenoh's access control: what no rule allows is not let through, whoever sends it.
fn access_control(rules: &[Rule]) -> serde_json::Value {
    let names: Vec<String> = (1..=rules.len())
        .map(|number| format!("rule {number}"))
        .collect();
    let rules: Vec<serde_json::Value> = names
        .iter()
        .zip(rules)
        .map(|(name, rule)| {
            serde_json::json!({
                "id": name,
                "permission": "allow",
                "messages": rule.messages,
                "flows": [match rule.flow { Flow::In => "ingress", Flow::Out => "egress" }],
                "key_exprs": rule.keys,
            })
        })
        .collect();
    serde_json::json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{ "id": "everybody" }],
        "policies": [{ "rules": names, "subjects": ["everybody"] }],
    })
}

fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).expect("texts have a JSON form")
}

fn failed(endpoints: &Endpoints, reason: zenoh::Error) -> NetworkError {
    let what = endpoints
        .listen
        .iter()
        .chain(&endpoints.connect)
        .map(ToString::to_string)
        .collect::<Vec<_>>()
        .join(", ");
    NetworkError::Open {
        what,
        reason: reason.to_string(),
    }
}
