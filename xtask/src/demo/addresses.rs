//! Where server and handle listen and meet, checked before anything is built.

use std::fmt;
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener, ToSocketAddrs, UdpSocket};
use std::str::FromStr;

use anyhow::{Context, Result};

/// A free port's neighbour is nearly always free; so many pairs in vain mean that something else is wrong.
const PAIRS_TRIED: u32 = 64;

/// Where the server offers HTTP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HttpAddress(SocketAddr);

impl HttpAddress {
    /// A loopback port that is free now.
    pub(super) fn free() -> Result<Self> {
        Ok(Self(free_port()?))
    }

    /// Fails when another program listens there.
    pub(super) fn require_free(&self) -> Result<()> {
        match TcpListener::bind(self.0) {
            Ok(_) => Ok(()),
            Err(error) => Err(in_use(error, &self.to_string(), "--listen")),
        }
    }

    /// The address by which this machine reaches a server that listens there.
    pub(super) fn reachable(&self) -> SocketAddr {
        reachable(self.0)
    }
}

impl FromStr for HttpAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let address: SocketAddr = text
            .parse()
            .map_err(|_| format!("{text:?} is no address with a port, such as 127.0.0.1:8080"))?;
        if address.port() == 0 {
            return Err(
                "port 0 would be any free port, and then nobody knows where to look".to_owned(),
            );
        }
        Ok(Self(address))
    }
}

impl fmt::Display for HttpAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Where handle and server meet: a transport and an address.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ZenohEndpoint {
    transport: Transport,
    address: SocketAddr,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Transport {
    Tcp,
    Udp,
}

impl ZenohEndpoint {
    /// A loopback port that is free now, and the next one too.
    pub(super) fn free() -> Result<Self> {
        let free = (0..PAIRS_TRIED).find_map(|_| {
            let endpoint = Self {
                transport: Transport::Tcp,
                address: free_port().ok()?,
            };
            endpoint.require_free().ok().map(|()| endpoint)
        });
        free.context("no two neighbouring loopback ports are free")
    }

    /// Fails when another program listens there, or on the next port: the server carries slow state over that one.
    pub(super) fn require_free(&self) -> Result<()> {
        for endpoint in [self, &self.neighbour()?] {
            let bound = match endpoint.transport {
                Transport::Tcp => TcpListener::bind(endpoint.address).map(drop),
                Transport::Udp => UdpSocket::bind(endpoint.address).map(drop),
            };
            bound.map_err(|error| in_use(error, &endpoint.to_string(), "--zenoh-listen"))?;
        }
        Ok(())
    }

    fn neighbour(&self) -> Result<Self> {
        let next = self.address.port().checked_add(1);
        let port =
            next.with_context(|| format!("{self} has no next port, and the server needs it too"))?;
        Ok(Self {
            address: SocketAddr::new(self.address.ip(), port),
            ..*self
        })
    }

    /// The endpoint a handle on this machine connects to.
    pub(super) fn reachable(&self) -> String {
        let address = reachable(self.address);
        Self { address, ..*self }.to_string()
    }
}

impl FromStr for ZenohEndpoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wanted =
            || format!("{text:?} is no endpoint such as tcp/127.0.0.1:7547 or udp/127.0.0.1:7547");
        let (transport, address) = text.split_once('/').ok_or_else(wanted)?;
        let transport = match transport {
            "tcp" => Transport::Tcp,
            "udp" => Transport::Udp,
            _ => return Err(wanted()),
        };
        let address = address
            .to_socket_addrs()
            .ok()
            .and_then(|mut found| found.next())
            .filter(|address| address.port() != 0)
            .ok_or_else(wanted)?;
        Ok(Self { transport, address })
    }
}

impl fmt::Display for ZenohEndpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let transport = match self.transport {
            Transport::Tcp => "tcp",
            Transport::Udp => "udp",
        };
        write!(f, "{transport}/{}", self.address)
    }
}

fn free_port() -> Result<SocketAddr> {
    let listener =
        TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).context("no loopback port is free")?;
    Ok(listener.local_addr()?)
}

/// "Every address of this machine" is an address to listen on, not one to connect to.
fn reachable(listens: SocketAddr) -> SocketAddr {
    let ip = match listens.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, listens.port())
}

fn in_use(error: io::Error, address: &str, flag: &str) -> anyhow::Error {
    if error.kind() == io::ErrorKind::AddrInUse {
        return anyhow::anyhow!(
            "{address} is in use, perhaps by another demo: end that one, or choose another place with {flag}"
        );
    }
    anyhow::Error::new(error).context(format!("nothing can listen on {address}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_in_use_is_refused_with_the_flag_that_helps() {
        let taken = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let address = taken.local_addr().unwrap();
        let error = HttpAddress(address).require_free().unwrap_err().to_string();
        assert!(
            error.contains("in use") && error.contains("--listen"),
            "{error}"
        );
        let endpoint: ZenohEndpoint = format!("tcp/{address}").parse().unwrap();
        let error = endpoint.require_free().unwrap_err().to_string();
        assert!(
            error.contains("in use") && error.contains("--zenoh-listen"),
            "{error}"
        );
        drop(taken);
        HttpAddress(address).require_free().unwrap();
    }

    #[test]
    fn the_next_port_counts_as_well() {
        let endpoint = ZenohEndpoint::free().unwrap();
        let next = endpoint.neighbour().unwrap();
        let taken = TcpListener::bind(next.address).unwrap();
        let error = endpoint.require_free().unwrap_err().to_string();
        assert!(error.contains(&next.to_string()), "{error}");
        drop(taken);
        endpoint.require_free().unwrap();
        let last: ZenohEndpoint = "tcp/127.0.0.1:65535".parse().unwrap();
        assert!(
            last.require_free()
                .unwrap_err()
                .to_string()
                .contains("next port")
        );
    }

    #[test]
    fn every_address_is_reached_over_loopback() {
        let endpoint: ZenohEndpoint = "tcp/0.0.0.0:7547".parse().unwrap();
        assert_eq!(endpoint.reachable(), "tcp/127.0.0.1:7547");
        let endpoint: ZenohEndpoint = "udp/[::]:7547".parse().unwrap();
        assert_eq!(endpoint.reachable(), "udp/[::1]:7547");
        let address: HttpAddress = "192.0.2.7:80".parse().unwrap();
        assert_eq!(address.reachable().to_string(), "192.0.2.7:80");
    }

    #[test]
    fn typing_mistakes_are_told_what_was_wanted() {
        for wrong in ["8080", "127.0.0.1", "http://127.0.0.1:8080"] {
            let error = wrong.parse::<HttpAddress>().unwrap_err();
            assert!(
                error.contains("127.0.0.1:8080") && error.contains(wrong),
                "{error}"
            );
        }
        for wrong in [
            "127.0.0.1:7547",
            "tpc/127.0.0.1:7547",
            "tcp/127.0.0.1",
            "tcp/127.0.0.1:0",
        ] {
            let error = wrong.parse::<ZenohEndpoint>().unwrap_err();
            assert!(
                error.contains("tcp/127.0.0.1:7547") && error.contains(wrong),
                "{error}"
            );
        }
        assert!("127.0.0.1:0".parse::<HttpAddress>().is_err());
    }
}
