//! Zenoh endpoints: `PROTOCOL/ADDRESS:PORT`, and for some protocols `?PARAMETER=VALUE`, several with `;` between them.

use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;

/// What an endpoint looks like, for messages and help.
pub const FORM: &str = "tcp, udp, tls or quic, then /ADDRESS:PORT";

/// How frames and the rest cross.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// In the clear, one stream.
    Tcp,
    /// In the clear, each frame a datagram of its own.
    Udp,
    /// Encrypted, one stream.
    Tls,
    /// Encrypted, frames as datagrams and the rest as streams.
    Quic,
}

impl Protocol {
    const ALL: [(Self, &str); 4] = [
        (Self::Tcp, "tcp"),
        (Self::Udp, "udp"),
        (Self::Tls, "tls"),
        (Self::Quic, "quic"),
    ];

    /// Whether the server shows a certificate and everything is encrypted.
    #[must_use]
    pub const fn is_secure(self) -> bool {
        matches!(self, Self::Tls | Self::Quic)
    }

    /// Parameters that mean something here, with their values; the first is taken where none is given.
    const fn parameters(self) -> &'static [(&'static str, &'static [&'static str])] {
        match self {
            Self::Quic => &[
                ("mixed_rel", &["1", "0", "auto"]),
                ("multistream", &["auto", "0", "1"]),
            ],
            Self::Udp => &[("rel", &["0", "1"])],
            Self::Tcp | Self::Tls => &[("rel", &["1"])],
        }
    }
}

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = Self::ALL.iter().find(|(protocol, _)| protocol == self);
        f.write_str(word.map_or("", |(_, word)| word))
    }
}

/// Why a text is no endpoint.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EndpointError {
    /// Its form.
    #[error("zenoh endpoint `{got}` is not of the form {FORM}")]
    Form {
        /// As given.
        got: String,
    },
    /// A parameter.
    #[error("zenoh endpoint `{got}`: {protocol} knows no parameter `{parameter}`, {wanted}")]
    Parameter {
        /// As given.
        got: String,
        /// Its protocol.
        protocol: Protocol,
        /// Parameter and value.
        parameter: String,
        /// What it would know.
        wanted: String,
    },
    /// An address that Zenoh's QUIC does not take.
    #[error(
        "zenoh endpoint `{got}`: quic takes an IPv4 address or a name, which may stand for an IPv6 address"
    )]
    NoSuchHost {
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
}

/// An endpoint that can be listened on or connected to, as far as its form goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Endpoint {
    /// How things cross.
    pub protocol: Protocol,
    /// A name, an IPv4 address, or an IPv6 address in brackets.
    pub host: String,
    /// The port; 0 is any.
    pub port: u16,
    parameters: Vec<(String, String)>,
}

impl Endpoint {
    /// The endpoint so many ports above; port 0 (any) stays.
    ///
    /// # Errors
    /// The port would lie above the last one.
    pub fn neighbour(&self, steps: u16) -> Result<Self, EndpointError> {
        let above = match self.port {
            0 => Some(0),
            port => port.checked_add(steps),
        };
        let port = above.ok_or_else(|| EndpointError::NoNeighbour {
            got: self.to_string(),
            port: self.port,
            steps,
            most: u16::MAX - steps,
        })?;
        Ok(Self {
            port,
            ..self.clone()
        })
    }

    /// The same endpoint on another host.
    #[must_use]
    pub fn on(&self, host: &str) -> Self {
        Self {
            host: host.to_owned(),
            ..self.clone()
        }
    }

    /// The address, if the host is one.
    #[must_use]
    pub fn address(&self) -> Option<IpAddr> {
        self.bare_host().parse().ok()
    }

    /// The host without brackets, as certificates name it.
    #[must_use]
    pub fn bare_host(&self) -> &str {
        self.host.trim_start_matches('[').trim_end_matches(']')
    }

    /// Whether it names a loopback address, or `localhost`.
    #[must_use]
    pub fn is_loopback(&self) -> bool {
        self.host == "localhost" || self.address().is_some_and(|address| address.is_loopback())
    }

    /// Whether it stands for every address of a machine.
    #[must_use]
    pub fn is_everywhere(&self) -> bool {
        self.address()
            .is_some_and(|address| address.is_unspecified())
    }

    /// As Zenoh is told: what a protocol should do and does not by itself is said.
    #[must_use]
    pub fn for_zenoh(&self) -> String {
        let mut whole = self.clone();
        if self.protocol == Protocol::Quic && !self.has("mixed_rel") {
            let datagrams = ("mixed_rel".to_owned(), "1".to_owned());
            whole.parameters.push(datagrams);
        }
        whole.to_string()
    }

    fn has(&self, parameter: &str) -> bool {
        self.parameters.iter().any(|(name, _)| name == parameter)
    }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}:{}", self.protocol, self.host, self.port)?;
        for (index, (name, value)) in self.parameters.iter().enumerate() {
            let before = if index == 0 { '?' } else { ';' };
            write!(f, "{before}{name}={value}")?;
        }
        Ok(())
    }
}

impl FromStr for Endpoint {
    type Err = EndpointError;

    fn from_str(got: &str) -> Result<Self, EndpointError> {
        let malformed = || EndpointError::Form {
            got: got.to_owned(),
        };
        let (word, rest) = got.split_once('/').ok_or_else(malformed)?;
        let (address, parameters) = match rest.split_once('?') {
            Some((address, parameters)) => (address, Some(parameters)),
            None => (rest, None),
        };
        let (host, port) = address.rsplit_once(':').ok_or_else(malformed)?;
        let protocol = Protocol::ALL.iter().find(|(_, known)| *known == word);
        let (protocol, _) = protocol.ok_or_else(malformed)?;
        let port = port.parse().map_err(|_| malformed())?;
        if !is_host(host) {
            return Err(malformed());
        }
        if *protocol == Protocol::Quic && host.starts_with('[') {
            return Err(EndpointError::NoSuchHost {
                got: got.to_owned(),
            });
        }
        let mut endpoint = Self {
            protocol: *protocol,
            host: host.to_owned(),
            port,
            parameters: Vec::new(),
        };
        for parameter in parameters.into_iter().flat_map(|all| all.split(';')) {
            let (name, value) = parameter.split_once('=').unwrap_or((parameter, ""));
            let known = protocol.parameters().iter();
            let is_known = known
                .clone()
                .any(|(known, values)| *known == name && values.contains(&value));
            if !is_known || endpoint.has(name) {
                let wanted = known.map(|(name, values)| format!("{name}={}", values.join("|")));
                return Err(EndpointError::Parameter {
                    got: got.to_owned(),
                    protocol: *protocol,
                    parameter: parameter.to_owned(),
                    wanted: format!(
                        "want {}, each once",
                        wanted.collect::<Vec<_>>().join(" or ")
                    ),
                });
            }
            let parameter = (name.to_owned(), value.to_owned());
            endpoint.parameters.push(parameter);
        }
        Ok(endpoint)
    }
}

/// What a name, an IPv4 address, and a bracketed IPv6 address with its scope are written with. Endpoints are quoted
/// into Zenoh's configuration, so nothing else may pass.
fn is_host(host: &str) -> bool {
    let is_bare = !host.contains(['[', ']', ':', '%']);
    let is_bracketed = host
        .strip_prefix('[')
        .and_then(|host| host.strip_suffix(']'))
        .is_some_and(|host| !host.is_empty() && !host.contains(['[', ']']));
    let letter = |letter: char| letter.is_ascii_alphanumeric() || ".-_:[]%".contains(letter);
    !host.is_empty() && host.chars().all(letter) && (is_bare || is_bracketed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn endpoint(text: &str) -> Endpoint {
        text.parse().unwrap()
    }

    #[test]
    fn what_is_read_is_written_again() {
        for text in [
            "tcp/127.0.0.1:7547",
            "udp/[::1]:7547",
            "udp/[::1]:7547?rel=1",
            "tls/example.org:443",
            "quic/lab.example:0?mixed_rel=auto;multistream=0",
            "tls/[fe80::1%eth0]:0",
        ] {
            assert_eq!(endpoint(text).to_string(), text);
        }
    }

    #[test]
    fn loopback_is_told_from_the_rest() {
        for inside in [
            "tcp/127.0.0.1:7547",
            "udp/[::1]:1",
            "tls/localhost:0",
            "tcp/127.8.9.1:7?rel=1",
        ] {
            assert!(endpoint(inside).is_loopback(), "{inside}");
        }
        for outside in [
            "tcp/0.0.0.0:7547",
            "tcp/[::]:7547",
            "tcp/192.168.1.2:7547",
            "tcp/localhost.example.org:1",
        ] {
            assert!(!endpoint(outside).is_loopback(), "{outside}");
        }
        assert!(
            endpoint("tls/[::]:1").is_everywhere() && endpoint("tcp/0.0.0.0:1").is_everywhere()
        );
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
            "tcp/::1:7547",
            "tcp/[]:7547",
            "tcp/[::1:7547",
            "tcp/127.0.0.1:1#iface=lo",
            "tcp/127.0.0.1:1?",
            "tcp/127.0.0.1:1?mixed_rel=1",
            "quic/127.0.0.1:1?mixed_rel=2",
            "quic/127.0.0.1:1?mixed_rel=1;mixed_rel=1",
            "quic/127.0.0.1:1?mixed_rel=1;",
            "quic/127.0.0.1:1?\"=1",
            "quic/[::1]:1",
        ] {
            let said = bad.parse::<Endpoint>().unwrap_err().to_string();
            assert!(said.contains(bad), "{bad}: {said}");
        }
        let said = "quic/127.0.0.1:1?rel=1".parse::<Endpoint>().unwrap_err();
        assert!(said.to_string().contains("mixed_rel=1|0|auto"), "{said}");
    }

    #[test]
    fn the_neighbour_is_the_next_port_and_speaks_alike() {
        let neighbour = |text: &str| endpoint(text).neighbour(1).map(|next| next.to_string());
        assert_eq!(
            neighbour("tcp/127.0.0.1:7547").unwrap(),
            "tcp/127.0.0.1:7548"
        );
        assert_eq!(
            neighbour("quic/localhost:7547?mixed_rel=0").unwrap(),
            "quic/localhost:7548?mixed_rel=0"
        );
        assert_eq!(neighbour("tcp/127.0.0.1:0").unwrap(), "tcp/127.0.0.1:0");
        let said = neighbour("tcp/127.0.0.1:65535").unwrap_err().to_string();
        assert!(said.contains("65534"), "{said}");
    }

    #[test]
    fn frames_cross_quic_as_datagrams_unless_told_otherwise() {
        let told = |text: &str| endpoint(text).for_zenoh();
        assert_eq!(told("quic/127.0.0.1:1"), "quic/127.0.0.1:1?mixed_rel=1");
        assert_eq!(
            told("quic/127.0.0.1:1?mixed_rel=0"),
            "quic/127.0.0.1:1?mixed_rel=0"
        );
        assert_eq!(told("udp/127.0.0.1:1"), "udp/127.0.0.1:1");
    }
}
