//! `cargo demo`: builds what changed, then hands over to `teleclay-demo`, which starts a server and a simulated handle.

use std::io;
use std::net::{SocketAddr, TcpListener, ToSocketAddrs, UdpSocket};
use std::process::Command;

use anyhow::Result;
use clap::Args;

use crate::process::become_program;
use crate::workspace::{program, target};
use crate::{dashboard, release, tools};

/// What a demo runs.
pub(crate) const PROGRAMS: [&str; 3] = ["teleclay-demo", "teleclay-server", "teleclay-handle"];

/// What `cargo demo` can be told.
#[derive(Args)]
pub(crate) struct Options {
    /// Stop after that many seconds, print a summary, and fail if anything went wrong
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=86_400))]
    seconds: Option<u64>,
    /// Where the server offers the dashboard and its HTTP interface
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8080", value_parser = http)]
    listen: SocketAddr,
    /// Where handle and server meet
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:7547", value_parser = zenoh)]
    zenoh_listen: (Transport, SocketAddr),
    /// What the simulated operator does, as `teleclay-handle --intent`
    #[arg(long, default_value = "cutting")]
    intent: String,
}

/// What carries Zenoh's frames.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Transport {
    Tcp,
    Udp,
}

/// Builds, and becomes the program that starts and watches the others.
pub(crate) fn run(options: &Options) -> Result<()> {
    // Whatever can be known to fail is said before minutes of building.
    require_free((Transport::Tcp, options.listen), "--listen")?;
    let (transport, meeting) = options.zenoh_listen;
    require_free((transport, meeting), "--zenoh-listen")?;
    // The server carries slow state over the next port.
    let next = SocketAddr::new(meeting.ip(), meeting.port() + 1);
    require_free((transport, next), "--zenoh-listen")?;
    tools::require_node()?;
    dashboard::build()?;
    release::build(&PROGRAMS)?;

    let mut demo = Command::new(program("teleclay-demo"));
    demo.args(["--listen", &options.listen.to_string()])
        .args(["--zenoh-listen", &shown(options.zenoh_listen)])
        .args(["--intent", &options.intent])
        .arg("--data")
        .arg(target().join("demo-data"));
    if let Some(seconds) = options.seconds {
        demo.args(["--seconds", &seconds.to_string()]);
    }
    become_program(&mut demo)
}

fn http(text: &str) -> Result<SocketAddr, String> {
    match text.parse::<SocketAddr>() {
        Ok(address) if address.port() == 0 => {
            Err("port 0 would be any free port, and then nobody knows where to look".to_owned())
        }
        Ok(address) if !address.ip().is_loopback() => Err(elsewhere(text)),
        Ok(address) => Ok(address),
        Err(_) => Err(format!(
            "{text:?} is no address with a port, such as 127.0.0.1:8080"
        )),
    }
}

/// The demo speaks in the clear, and moves a hand.
fn elsewhere(text: &str) -> String {
    format!(
        "{text:?} lies beyond this machine, and the demo stays on it: start teleclay-server for others to reach, which \
         encrypts (docs/remote.md)"
    )
}

fn zenoh(text: &str) -> Result<(Transport, SocketAddr), String> {
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
        .ok_or_else(wanted)?;
    match address.port() {
        0 => Err(wanted()),
        _ if !address.ip().is_loopback() => Err(elsewhere(text)),
        u16::MAX => Err(format!(
            "{text} has no next port, and the server needs it too"
        )),
        _ => Ok((transport, address)),
    }
}

fn shown((transport, address): (Transport, SocketAddr)) -> String {
    match transport {
        Transport::Tcp => format!("tcp/{address}"),
        Transport::Udp => format!("udp/{address}"),
    }
}

/// Fails when another program listens there.
fn require_free((transport, address): (Transport, SocketAddr), flag: &str) -> Result<()> {
    let bound = match transport {
        Transport::Tcp => TcpListener::bind(address).map(drop),
        Transport::Udp => UdpSocket::bind(address).map(drop),
    };
    match bound {
        Ok(()) => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::AddrInUse => anyhow::bail!(
            "{address} is in use, perhaps by another demo: end that one, or choose another place with {flag}"
        ),
        Err(error) => {
            Err(anyhow::Error::new(error).context(format!("nothing can listen on {address}")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_in_use_is_refused_with_the_flag_that_helps() {
        let here = SocketAddr::from(([127, 0, 0, 1], 0));
        let tcp = TcpListener::bind(here).unwrap();
        let place = (Transport::Tcp, tcp.local_addr().unwrap());
        let error = require_free(place, "--listen").unwrap_err().to_string();
        assert!(
            error.contains("in use") && error.contains("--listen"),
            "{error}"
        );
        drop(tcp);
        require_free(place, "--listen").unwrap();
        let udp = UdpSocket::bind(here).unwrap();
        require_free((Transport::Udp, udp.local_addr().unwrap()), "").unwrap_err();
    }

    #[test]
    fn typing_mistakes_are_told_what_was_wanted() {
        for wrong in ["8080", "127.0.0.1", "http://127.0.0.1:8080"] {
            let error = http(wrong).unwrap_err();
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
            let error = zenoh(wrong).unwrap_err();
            assert!(
                error.contains("tcp/127.0.0.1:7547") && error.contains(wrong),
                "{error}"
            );
        }
        assert!(http("127.0.0.1:0").is_err());
        assert!(
            zenoh("tcp/127.0.0.1:65535")
                .unwrap_err()
                .contains("next port")
        );
        let endpoint = zenoh("udp/localhost:7547").unwrap();
        assert!(shown(endpoint).starts_with("udp/") && shown(endpoint).ends_with(":7547"));
    }
}
