//! The two WebSockets of the service, and the driver on them. What is said on them is the machine's.

use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::str::FromStr;
use std::time::{Duration, Instant};

use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, WebSocket};

use super::machine::{End, Law, Machine};
use super::message::LONGEST;
use crate::exchange::News;
use crate::fault::DeviceFault;
use crate::profile::Hardware;
use crate::thread::Driver;

/// Where the service listens unless it is told otherwise.
pub const SERVICE_PORT: u16 = 10001;
/// And its event channel.
pub const EVENTS_PORT: u16 = 10020;
/// A service on this machine answers within milliseconds.
const CONNECT_WITHIN: Duration = Duration::from_secs(1);
/// The last word is waited for no longer than this.
const CLOSE_WITHIN: Duration = Duration::from_millis(200);
/// A thousand exchanges a second.
const PERIOD: Duration = Duration::from_millis(1);
/// Messages that are taken in at one step; a service sends one.
const AT_ONCE: usize = 8;
const DEVICE: &str = Hardware::Haply.word();

/// Where the service is: on this machine, since it takes forces from whoever asks, in the clear.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServiceAddress {
    host: String,
    service: u16,
    /// Of the event channel.
    events: u16,
}

impl Default for ServiceAddress {
    fn default() -> Self {
        Self {
            host: "localhost".to_owned(),
            service: SERVICE_PORT,
            events: EVENTS_PORT,
        }
    }
}

impl FromStr for ServiceAddress {
    type Err = DeviceFault;

    fn from_str(got: &str) -> Result<Self, DeviceFault> {
        let refused = || DeviceFault::Address {
            got: got.to_owned(),
        };
        let rest = got.strip_prefix("ws://").ok_or_else(refused)?;
        let rest = rest.strip_suffix('/').unwrap_or(rest);
        let (host, port) = rest.rsplit_once(':').unwrap_or((rest, "10001"));
        if !["localhost", "127.0.0.1", "[::1]"].contains(&host) {
            return Err(refused());
        }
        let service = port.parse().ok().filter(|port| *port != 0);
        Ok(Self {
            host: host.to_owned(),
            service: service.ok_or_else(refused)?,
            events: EVENTS_PORT,
        })
    }
}

impl std::fmt::Display for ServiceAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.url(self.service))
    }
}

impl ServiceAddress {
    /// The same service with its event channel at another port.
    #[must_use]
    pub fn with_events_at(self, events: u16) -> Self {
        Self { events, ..self }
    }

    fn url(&self, port: u16) -> String {
        format!("ws://{}:{port}", self.host)
    }

    fn connect(&self, port: u16) -> Result<Socket, String> {
        let address = format!("{}:{port}", self.host);
        let addresses = address
            .to_socket_addrs()
            .map_err(|error| error.to_string())?;
        let mut refused = "the name has no address".to_owned();
        for address in addresses {
            match TcpStream::connect_timeout(&address, CONNECT_WITHIN) {
                Ok(stream) => return self.greet(port, stream),
                Err(error) => refused = error.to_string(),
            }
        }
        Err(refused)
    }

    fn greet(&self, port: u16, stream: TcpStream) -> Result<Socket, String> {
        let prepared = stream
            .set_nodelay(true)
            .and_then(|()| stream.set_read_timeout(Some(CONNECT_WITHIN)))
            .and_then(|()| stream.set_write_timeout(Some(CLOSE_WITHIN)));
        prepared.map_err(|error| error.to_string())?;
        let mut bounds = WebSocketConfig::default()
            .read_buffer_size(LONGEST)
            .write_buffer_size(0);
        bounds.max_write_buffer_size = LONGEST;
        bounds.max_message_size = Some(LONGEST);
        bounds.max_frame_size = Some(LONGEST);
        let greeted = tungstenite::client::client_with_config(self.url(port), stream, Some(bounds));
        match greeted {
            Ok((socket, _)) => Ok(Socket(socket)),
            Err(error) => Err(error.to_string()),
        }
    }
}

/// A WebSocket that never waits for long.
#[derive(Debug)]
struct Socket<S = TcpStream>(WebSocket<S>);

impl<S: Read + Write> Socket<S> {
    /// The next message, if one is there.
    fn read(&mut self) -> Result<Option<Message>, String> {
        match self.0.read() {
            Ok(Message::Close(_)) => Err("it said goodbye".to_owned()),
            Ok(message) => Ok(Some(message)),
            Err(tungstenite::Error::Io(error)) if is_patience(&error) => Ok(None),
            Err(error) => Err(error.to_string()),
        }
    }

    fn send(&mut self, text: String) -> Result<(), String> {
        match self.0.send(Message::text(text)) {
            Ok(()) => Ok(()),
            // It lies in the buffer, which is bounded, and goes out with the next.
            Err(tungstenite::Error::Io(error)) if is_patience(&error) => Ok(()),
            Err(error) => Err(error.to_string()),
        }
    }
}

fn is_patience(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted
    )
}

/// An Inverse3 at work.
#[derive(Debug)]
pub struct HaplyDriver {
    machine: Machine,
    service: Socket,
    events: Option<Socket>,
    law: Law,
    is_closed: bool,
}

impl HaplyDriver {
    /// Connects, and waits for the inventory.
    ///
    /// # Errors
    /// No service is there, or no device that can be used.
    pub fn open(address: &ServiceAddress) -> Result<Self, DeviceFault> {
        let service =
            address
                .connect(address.service)
                .map_err(|reason| DeviceFault::NoService {
                    place: address.to_string(),
                    reason,
                })?;
        let mut driver = Self {
            machine: Machine::default(),
            service,
            // A service before 3.1 has none.
            events: address.connect(address.events).ok(),
            law: Law::default(),
            is_closed: false,
        };
        let began = Instant::now();
        loop {
            if let Some(end) = driver.machine.why() {
                return Err(fault_at(end, address));
            }
            if let Some(law) = driver.machine.law() {
                driver.law = law;
                break;
            }
            let now_ns = u64::try_from(began.elapsed().as_nanos()).unwrap_or(u64::MAX);
            // Nothing is due before the inventory but the end.
            let due = driver.machine.poll(now_ns, [0.0; 3]);
            debug_assert_eq!(due, None);
            driver.listen(now_ns, 1);
        }
        let streams = driver.events.iter().chain([&driver.service]);
        for socket in streams {
            let set = socket.0.get_ref().set_nonblocking(true);
            set.map_err(|error| DeviceFault::Lost {
                device: DEVICE,
                reason: error.to_string(),
            })?;
        }
        Ok(driver)
    }

    /// What the service does to forces, and what is not heard of it, a sentence each.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let mut said = self.law.sentences();
        if self.events.is_none() {
            said.push(format!(
                "no event channel at port {EVENTS_PORT}: an emergency brake is seen as a device that is not ready, or not at all"
            ));
        }
        said
    }

    fn listen(&mut self, now_ns: u64, at_once: usize) {
        for _ in 0..at_once {
            match self.service.read() {
                Ok(Some(Message::Text(text))) => {
                    self.machine.handle_message(now_ns, text.as_bytes());
                }
                Ok(Some(Message::Binary(bytes))) => self.machine.handle_message(now_ns, &bytes),
                Ok(Some(_)) => {}
                Ok(None) => break,
                Err(why) => {
                    self.is_closed = true;
                    self.machine.handle_closed(&why);
                    break;
                }
            }
        }
    }

    fn listen_for_events(&mut self) {
        for _ in 0..AT_ONCE {
            let Some(events) = &mut self.events else {
                return;
            };
            match events.read() {
                Ok(Some(Message::Text(text))) => self.machine.handle_event(text.as_bytes()),
                Ok(Some(_)) => {}
                Ok(None) => return,
                // Whoever no longer tells of brakes is not trusted with forces.
                Err(why) => {
                    self.events = None;
                    let event = format!("the event channel: {why}");
                    self.machine.handle_lost_events(&event);
                }
            }
        }
    }

    fn send(&mut self, text: String) {
        if let Err(why) = self.service.send(text) {
            self.is_closed = true;
            self.machine.handle_closed(&why);
        }
    }
}

impl Driver for HaplyDriver {
    fn device(&self) -> &'static str {
        DEVICE
    }

    fn period(&self) -> Duration {
        PERIOD
    }

    fn step(&mut self, now_ns: u64, force_n: [f64; 3]) -> Result<Option<News>, DeviceFault> {
        self.listen_for_events();
        self.listen(now_ns, AT_ONCE);
        let news = self.machine.take_news();
        if let Some(text) = self.machine.poll(now_ns, force_n) {
            self.send(text);
        }
        match self.machine.why() {
            Some(end) => Err(lost(end)),
            None => Ok(news),
        }
    }

    fn rest(&mut self) {
        let last_word = self.machine.close();
        if self.is_closed {
            return;
        }
        // From here on it is all best effort: whoever is not there renders nothing for us.
        let _ = self.service.0.get_ref().set_nonblocking(false);
        if let Some(text) = last_word {
            self.send(text);
        }
        let _ = self.service.0.close(None);
        let _ = self.service.0.flush();
        self.is_closed = true;
    }
}

fn lost(end: &End) -> DeviceFault {
    match end {
        End::Busy => DeviceFault::Busy {
            device: DEVICE,
            place: "the Haply Inverse Service".to_owned(),
        },
        end => DeviceFault::Lost {
            device: DEVICE,
            reason: end.to_string(),
        },
    }
}

fn fault_at(end: &End, address: &ServiceAddress) -> DeviceFault {
    match end {
        End::NoDevice => DeviceFault::NotFound {
            device: DEVICE,
            looked: format!("in the inventory of the Haply Inverse Service at {address}"),
            advice: "plug the Inverse3 in, give it power and wait until the Haply Hub shows it",
        },
        end => lost(end),
    }
}

/// Whether a device is there, for a list: where it was found.
///
/// # Errors
/// No service is there, or no device that can be used.
pub fn look(address: &ServiceAddress) -> Result<String, DeviceFault> {
    let mut driver = HaplyDriver::open(address)?;
    driver.rest();
    Ok(format!("an Inverse3 behind {address}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_this_machine_is_spoken_to() {
        for good in [
            "ws://localhost:10001",
            "ws://127.0.0.1:4000/",
            "ws://[::1]:10001",
        ] {
            let address: ServiceAddress = good.parse().unwrap();
            assert_eq!(address.to_string(), good.trim_end_matches('/'));
        }
        assert_eq!("ws://localhost".parse(), Ok(ServiceAddress::default()));
        for bad in [
            "ws://192.0.2.7:10001",
            "wss://localhost:10001",
            "http://localhost:10001",
            "ws://localhost:0",
            "ws://localhost:99999",
            "localhost:10001",
        ] {
            let refused = bad.parse::<ServiceAddress>().unwrap_err().to_string();
            assert!(
                refused.contains(bad) && refused.contains("want ws://"),
                "{refused}"
            );
        }
    }
}
