//! Zenoh sessions that open nothing they were not told to open: peers on named endpoints, no multicast scouting, no
//! gossip.
//!
//! Control frames have a session of their own, since a blocking message of the same transport would hold them up; slow
//! state and bricks use another.

use std::fmt::Write as _;

use zenoh::qos::{CongestionControl, Priority, Reliability};
use zenoh::{Config, Session};

/// Where to listen and whom to call.
#[derive(Clone, Debug, Default)]
pub struct Endpoints {
    /// Endpoints to listen on, such as `tcp/127.0.0.1:7547`.
    pub listen: Vec<String>,
    /// Endpoints to connect to; tried again until they answer.
    pub connect: Vec<String>,
}

/// Why a session could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// An endpoint is not understood.
    #[error("zenoh endpoint `{got}` is not of the form tcp/ADDRESS:PORT or udp/ADDRESS:PORT")]
    Endpoint {
        /// As given.
        got: String,
    },
    /// There is no port for slow state.
    #[error(
        "zenoh endpoint `{got}` leaves no room for slow state, which uses port {port} + {steps}: take a port up to {most}"
    )]
    NoNeighbour {
        /// As given.
        got: String,
        /// Its port.
        port: u16,
        /// How far above it the other one lies.
        steps: u16,
        /// The last port that has such a neighbour.
        most: u16,
    },
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
/// An endpoint is malformed or cannot be listened on. Endpoints to connect to are tried in the background.
pub async fn open(endpoints: &Endpoints) -> Result<Session, NetworkError> {
    let all = endpoints.listen.iter().chain(&endpoints.connect);
    for endpoint in all {
        check_endpoint(endpoint)?;
    }
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

/// Checks the form of an endpoint; whether anybody is there shows later.
///
/// # Errors
/// The endpoint is not `tcp/ADDRESS:PORT` or `udp/ADDRESS:PORT`.
pub fn check_endpoint(endpoint: &str) -> Result<(), NetworkError> {
    let malformed = || NetworkError::Endpoint {
        got: endpoint.to_owned(),
    };
    let (protocol, address) = endpoint.split_once('/').ok_or_else(malformed)?;
    let (host, port) = address.rsplit_once(':').ok_or_else(malformed)?;
    let is_port = port.parse::<u16>().is_ok();
    // What a name, an IPv4 address, and a bracketed IPv6 address with its scope are written with; endpoints are quoted
    // into Zenoh's configuration, so nothing else may pass.
    let is_host = !host.is_empty()
        && host
            .chars()
            .all(|letter| letter.is_ascii_alphanumeric() || ".-_:[]%".contains(letter));
    if matches!(protocol, "tcp" | "udp") && is_host && is_port {
        Ok(())
    } else {
        Err(malformed())
    }
}

/// The endpoint `steps` ports above `endpoint`; port 0 (any) stays.
///
/// # Errors
/// The endpoint is malformed, or the port above the last one.
pub fn neighbour(endpoint: &str, steps: u16) -> Result<String, NetworkError> {
    let malformed = || NetworkError::Endpoint {
        got: endpoint.to_owned(),
    };
    let (head, port) = endpoint.rsplit_once(':').ok_or_else(malformed)?;
    let port: u16 = port.parse().map_err(|_| malformed())?;
    if port == 0 {
        return Ok(endpoint.to_owned());
    }
    let above = port
        .checked_add(steps)
        .ok_or_else(|| NetworkError::NoNeighbour {
            got: endpoint.to_owned(),
            port,
            steps,
            most: u16::MAX - steps,
        })?;
    Ok(format!("{head}:{above}"))
}

/// Whether an endpoint names a loopback address (or `localhost`).
pub fn is_loopback(endpoint: &str) -> bool {
    let address = endpoint
        .split_once('/')
        .map_or(endpoint, |(_, address)| address);
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost"
        || host
            .parse::<std::net::IpAddr>()
            .is_ok_and(|ip| ip.is_loopback())
}

fn config(endpoints: &Endpoints) -> Result<Config, zenoh::Error> {
    let mut config = Config::default();
    let quoted = |list: &[String]| {
        let mut json = String::from("[");
        for (index, endpoint) in list.iter().enumerate() {
            let comma = if index == 0 { "" } else { "," };
            // Writing to a string cannot fail.
            let _ = write!(json, "{comma}\"{endpoint}\"");
        }
        json.push(']');
        json
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
        // A greeting that the network lost is repeated after four of the longest round trips.
        ("transport/unicast/open_timeout", "2000"),
    ] {
        config.insert_json5(key, value)?;
    }
    Ok(config)
}

fn failed(endpoints: &Endpoints, reason: zenoh::Error) -> NetworkError {
    let what = endpoints
        .listen
        .iter()
        .chain(&endpoints.connect)
        .map(String::as_str)
        .collect::<Vec<_>>()
        .join(", ");
    NetworkError::Open {
        what,
        reason: reason.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loopback_is_told_from_the_rest() {
        for inside in [
            "tcp/127.0.0.1:7547",
            "udp/[::1]:1",
            "tcp/localhost:0",
            "tcp/127.8.9.1:7",
        ] {
            assert!(is_loopback(inside), "{inside}");
        }
        for outside in [
            "tcp/0.0.0.0:7547",
            "tcp/[::]:7547",
            "tcp/192.168.1.2:7547",
            "tcp/example.org:1",
        ] {
            assert!(!is_loopback(outside), "{outside}");
        }
    }

    #[test]
    fn malformed_endpoints_are_named() {
        for bad in [
            "127.0.0.1:7547",
            "tcp/127.0.0.1",
            "http/127.0.0.1:1",
            "tcp/:7547",
            "tcp/127.0.0.1:99999",
            "tcp/a\",\"b:1",
            "tcp/a b:1",
        ] {
            assert!(
                check_endpoint(bad).unwrap_err().to_string().contains(bad),
                "{bad}"
            );
        }
        assert!(check_endpoint("udp/[::1]:7547").is_ok());
    }

    #[test]
    fn the_neighbour_is_the_next_port() {
        assert_eq!(
            neighbour("tcp/127.0.0.1:7547", 1).unwrap(),
            "tcp/127.0.0.1:7548"
        );
        assert_eq!(neighbour("tcp/127.0.0.1:0", 1).unwrap(), "tcp/127.0.0.1:0");
        assert!(neighbour("tcp/127.0.0.1:65535", 1).is_err());
    }
}
