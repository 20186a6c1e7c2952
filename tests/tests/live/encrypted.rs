//! What can be read, changed and said again on the way, where everything is encrypted: nothing, nothing and nothing.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use teleclay_tests::namespaces::{self, Pair};
use teleclay_tests::process::{PATIENCE, program};
use teleclay_tests::recording::greatest_force_step_n;
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Ports, Server, TOKEN, Transport};

use super::endings::{FORCE_STEP_N, cuts};

/// How long is listened to while a hand cuts, in ticks.
const LISTENED: u64 = 60_000;

/// Long enough that it does not come about by chance.
const OPERATOR: &str = "Ada Lovelace of London";

fn line(printed: &[String]) -> &str {
    let line = printed.iter().find(|line| line.starts_with("teleclay:"));
    line.expect("an operator gets one")
}

fn contains(packets: &[Vec<u8>], word: &[u8]) -> bool {
    let mut packets = packets.iter();
    packets.any(|packet| packet.windows(word.len()).any(|part| part == word))
}

/// The share of the byte that comes most often, of everything behind the headers of long packets: a 256th where
/// nothing can be read, and a good part where numbers and clay cross as they are.
fn commonest_share(packets: &[Vec<u8>]) -> f64 {
    const HEADERS: usize = 14 + 20 + 32 + 40;
    let mut counts = [0_u64; 256];
    for packet in packets.iter().filter(|packet| 200 < packet.len()) {
        for byte in &packet[HEADERS..] {
            counts[usize::from(*byte)] += 1;
        }
    }
    let all: u64 = counts.iter().sum();
    assert!(100_000 < all, "only {all} bytes were overheard");
    counts.iter().copied().max().unwrap_or(0) as f64 / all as f64
}

/// An invite, a join and a while of cutting, between two hosts, with somebody at the cable.
#[test]
fn whoever_listens_between_two_hosts_reads_neither_secret_nor_clay() {
    for transport in [Transport::Tcp, Transport::Quic] {
        let pair = match Pair::make() {
            Ok(pair) => pair,
            Err(error) => {
                println!(
                    "this machine makes no network namespaces, so nothing was tested: {error:#}"
                );
                return;
            }
        };
        let scene = || {
            let overheard = pair.overhear().unwrap();
            let server = match transport {
                Transport::Quic => Server::secure(namespaces::SERVER).unwrap(),
                _ => {
                    Server::start_on(namespaces::SERVER, Ports::free().unwrap(), transport).unwrap()
                }
            };
            let printed = server
                .invite(&["--role", "operator", "--for", "1h"])
                .unwrap();
            let invite = line(&printed).to_owned();
            let handle = pair.at_the_handle(&program("teleclay-handle").unwrap());
            let options = HandleOptions::invited(&invite).by(OPERATOR);
            let mut handle = Handle::start_as(handle, &options).unwrap();
            server
                .client
                .session_when(DEMO, "a cut", PATIENCE, cuts)
                .unwrap();
            server.client.let_pass(DEMO, LISTENED).unwrap();
            assert!(handle.process.end().unwrap().success());
            (overheard.packets(), invite)
        };
        let (packets, invite) = pair.at_the_server(scene).unwrap();
        let (_, secret) = invite.rsplit_once('.').unwrap();
        let share = commonest_share(&packets);
        let count = packets.len();
        println!(
            "{transport:?}: {count} packets, the commonest byte has {:.2} %",
            100.0 * share
        );
        // The secret crosses neither way; everything else can be read where nothing is encrypted.
        for secret in [secret, TOKEN] {
            assert!(!contains(&packets, secret.as_bytes()), "{transport:?}");
        }
        for word in ["teleclay/local/session", OPERATOR] {
            let is_read = contains(&packets, word.as_bytes());
            assert_eq!(
                is_read,
                transport == Transport::Tcp,
                "{transport:?}: {word}"
            );
        }
        match transport {
            Transport::Quic => assert!(share < 0.006, "{share}"),
            _ => assert!(
                0.05 < share,
                "{share}: the measure would not see clay either"
            ),
        }
    }
}

/// Somebody in between who passes everything on, and beside it what crossed before, and what crosses with a bit
/// changed.
struct Forger {
    listens: SocketAddr,
    over: Arc<AtomicBool>,
    /// Sent again, and changed.
    told: Arc<[AtomicU64; 2]>,
}

impl Forger {
    fn before(server: SocketAddr) -> Self {
        let (inside, outside) = (
            UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap(),
            UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap(),
        );
        let forger = Self {
            listens: inside.local_addr().unwrap(),
            over: Arc::default(),
            told: Arc::default(),
        };
        outside.connect(server).unwrap();
        let (inside, outside) = (Arc::new(inside), Arc::new(outside));
        for socket in [&inside, &outside] {
            socket
                .set_read_timeout(Some(Duration::from_millis(100)))
                .unwrap();
        }
        let client = Arc::new(std::sync::Mutex::new(None::<SocketAddr>));
        for is_up in [true, false] {
            let (inside, outside) = (Arc::clone(&inside), Arc::clone(&outside));
            let (over, told) = (Arc::clone(&forger.over), Arc::clone(&forger.told));
            let client = Arc::clone(&client);
            std::thread::spawn(move || {
                let pass = |datagram: &[u8]| {
                    let to = *client.lock().unwrap();
                    // One that is not taken is lost, as some are.
                    let _ = match (is_up, to) {
                        (true, _) => outside.send(datagram),
                        (false, Some(to)) => inside.send_to(datagram, to),
                        (false, None) => Ok(0),
                    };
                };
                let mut buffer = vec![0; 1 << 16];
                let mut kept: Vec<Vec<u8>> = Vec::new();
                let mut number = 0_usize;
                while !over.load(Ordering::Relaxed) {
                    let length = if is_up {
                        inside.recv_from(&mut buffer).map(|(length, from)| {
                            *client.lock().unwrap() = Some(from);
                            length
                        })
                    } else {
                        outside.recv(&mut buffer)
                    };
                    let Ok(length) = length else { continue };
                    let datagram = &buffer[..length];
                    number += 1;
                    // Half of the lies come before the truth: that one is then the one that comes twice.
                    if number.is_multiple_of(4) {
                        let mut changed = datagram.to_vec();
                        let at = 1 + number % (length - 1).max(1);
                        changed[at.min(length - 1)] ^= 1 << (number % 8);
                        pass(&changed);
                        told[1].fetch_add(1, Ordering::Relaxed);
                    }
                    pass(datagram);
                    kept.push(datagram.to_vec());
                    if 2000 < kept.len() {
                        kept.remove(0);
                    }
                    if number.is_multiple_of(3) {
                        let ages = [1, 10, 100, 1000];
                        let age = ages[number / 3 % 4].min(kept.len());
                        pass(&kept[kept.len() - age]);
                        told[0].fetch_add(1, Ordering::Relaxed);
                    }
                }
            });
        }
        forger
    }
}

impl Drop for Forger {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

#[test]
fn a_datagram_that_is_changed_or_comes_again_is_never_acted_on() {
    let server = Server::secure(Ipv4Addr::LOCALHOST).unwrap();
    let printed = server.invite(&["--role", "operator"]).unwrap();
    let forger = Forger::before(server.zenoh_address());
    let endpoint = format!("quic/{}", forger.listens);
    let through = line(&printed).replace(&server.endpoint(), &endpoint);
    let mut handle = Handle::start(&HandleOptions::invited(&through)).unwrap();
    let client = &server.client;
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    let before = client.session(DEMO).unwrap();
    client.let_pass(DEMO, 3000).unwrap();
    let after = client.session(DEMO).unwrap();
    assert!(handle.process.end().unwrap().success());
    let [again, changed] = [0, 1].map(|kind| forger.told[kind].load(Ordering::Relaxed));
    println!("{again} datagrams came again, {changed} were changed");
    assert!(1000 < again && 1000 < changed);
    assert_eq!(after.tools[0].operator, "Ada");
    assert_eq!(after.revision, before.revision);
    // They do not even get as far as the trailer.
    assert_eq!(after.control_loop.unheard, 0);
    let ticks = handle.ticks().unwrap();
    let status = handle.status().unwrap();
    assert_eq!(status["joins"], 1);
    let live: Vec<_> = ticks
        .iter()
        .filter(|tick| tick.link_state == "live")
        .collect();
    assert!(2500 < live.len());
    let step_n = greatest_force_step_n(&ticks);
    assert!(step_n <= FORCE_STEP_N, "{step_n} N in a tick");
}
