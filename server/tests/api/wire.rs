//! HTTP by hand: requests that a well-behaved client could not send, and answers looked at closely.

use std::fmt::Write as _;
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};

use serde::de::DeserializeOwned;
use serde_json::Value;
use teleclay_proto::http::Problem;

use crate::rig::PATIENCE;

/// Where an interface is served.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site {
    pub(crate) address: SocketAddr,
}

/// A request.
#[derive(Clone, Debug)]
pub(crate) struct Ask {
    method: String,
    path: String,
    headers: Vec<(String, String)>,
    body: Vec<u8>,
}

/// An answer.
#[derive(Clone, Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    headers: Vec<(String, String)>,
    pub(crate) body: Vec<u8>,
}

impl Ask {
    pub(crate) fn new(method: &str, path: &str) -> Self {
        Self {
            method: method.to_owned(),
            path: path.to_owned(),
            headers: Vec::new(),
            body: Vec::new(),
        }
    }

    /// Adds a header, or replaces one of the defaults, which are the right host and, with a body, its length.
    pub(crate) fn with(mut self, name: &str, value: &str) -> Self {
        self.headers.push((name.to_owned(), value.to_owned()));
        self
    }

    pub(crate) fn json(self, body: impl Into<Vec<u8>>) -> Self {
        self.with("Content-Type", "application/json").body(body)
    }

    pub(crate) fn body(mut self, body: impl Into<Vec<u8>>) -> Self {
        self.body = body.into();
        self
    }

    fn has(&self, name: &str) -> bool {
        self.headers
            .iter()
            .any(|(other, _)| other.eq_ignore_ascii_case(name))
    }

    /// The bytes of the request. A header without a value is left out, defaults too.
    fn bytes(&self, site: &Site) -> Vec<u8> {
        let mut head = format!("{} {} HTTP/1.1\r\n", self.method, self.path);
        let mut line = |name: &str, value: &str| write!(head, "{name}: {value}\r\n").unwrap();
        if !self.has("Host") {
            line("Host", &site.address.to_string());
        }
        if !self.has("Connection") {
            line("Connection", "close");
        }
        let is_framed = self.has("Content-Length") || self.has("Transfer-Encoding");
        if !is_framed && (!self.body.is_empty() || matches!(&*self.method, "POST" | "PATCH")) {
            line("Content-Length", &self.body.len().to_string());
        }
        for (name, value) in &self.headers {
            if !value.is_empty() {
                line(name, value);
            }
        }
        let mut bytes = head.into_bytes();
        bytes.extend_from_slice(b"\r\n");
        bytes.extend_from_slice(&self.body);
        bytes
    }
}

impl Site {
    pub(crate) fn at(address: SocketAddr) -> Self {
        Self { address }
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_write_timeout(Some(PATIENCE)).unwrap();
        stream.set_nodelay(true).unwrap();
        stream
    }

    pub(crate) fn send(&self, ask: &Ask) -> Answer {
        let mut stream = self.connect();
        // A server that has refused a body already may not read the rest of it; its answer counts.
        stream.write_all(&ask.bytes(self)).ok();
        Answer::read(&mut stream)
    }

    /// Sends a request, and does not wait for the answer.
    pub(crate) fn begin(&self, mut connection: &TcpStream, ask: &Ask) {
        connection.write_all(&ask.bytes(self)).unwrap();
    }

    pub(crate) fn get(&self, path: &str) -> Answer {
        self.send(&Ask::new("GET", path))
    }

    pub(crate) fn post(&self, path: &str, body: &Value) -> Answer {
        self.send(&Ask::new("POST", path).json(body.to_string()))
    }

    pub(crate) fn patch(&self, path: &str, body: &Value) -> Answer {
        self.send(&Ask::new("PATCH", path).json(body.to_string()))
    }

    pub(crate) fn delete(&self, path: &str) -> Answer {
        self.send(&Ask::new("DELETE", path))
    }
}

impl Answer {
    /// Reads an answer as long as it says that it is, or up to the end of the connection.
    pub(crate) fn read(stream: &mut TcpStream) -> Self {
        let mut bytes = Vec::new();
        let mut part = [0; 16 * 1024];
        let (end, ended) = loop {
            // A connection that is reset after the answer has still answered.
            let ended = stream.read(&mut part);
            bytes.extend_from_slice(&part[..*ended.as_ref().unwrap_or(&0)]);
            let end = bytes.windows(4).position(|four| four == b"\r\n\r\n");
            let is_whole =
                end.is_some_and(|end| announced(&bytes[..end]) == Some(bytes.len() - end - 4));
            if is_whole || !matches!(ended, Ok(1..)) {
                break (end, ended);
            }
        };
        let Some(end) = end else {
            panic!(
                "no answer: {ended:?}, {:?}",
                String::from_utf8_lossy(&bytes)
            );
        };
        let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
        let mut lines = head.split("\r\n");
        let status = lines.next().unwrap().split(' ').nth(1).unwrap();
        let headers: Vec<_> = lines
            .map(|line| line.split_once(": ").unwrap())
            .map(|(name, value)| (name.to_ascii_lowercase(), value.to_owned()))
            .collect();
        let answer = Self {
            status: status.parse().unwrap(),
            headers,
            body: bytes[end + 4..].to_vec(),
        };
        if let Some(length) = answer.header("content-length") {
            let is_empty = answer.body.is_empty();
            assert!(
                is_empty || answer.body.len().to_string() == length,
                "{head}"
            );
        }
        answer
    }

    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let mut values = self.headers.iter().filter(|(other, _)| other == name);
        let value = values.next().map(|(_, value)| value.as_str());
        assert!(values.next().is_none(), "{name} is there twice: {self:?}");
        value
    }

    pub(crate) fn text(&self) -> &str {
        std::str::from_utf8(&self.body).unwrap()
    }

    pub(crate) fn json<T: DeserializeOwned>(&self) -> T {
        assert_eq!(self.header("content-type"), Some("application/json"));
        serde_json::from_slice(&self.body).unwrap()
    }

    /// The answer as a problem. Everything that every problem keeps to is checked here.
    pub(crate) fn problem(&self) -> Problem {
        let media_type = self.header("content-type");
        assert_eq!(media_type, Some("application/problem+json"), "{self:?}");
        let problem: Problem = serde_json::from_slice(&self.body).unwrap();
        assert_eq!(problem.status, self.status, "{problem:?}");
        assert!((400..600).contains(&self.status), "{problem:?}");
        assert!(problem.kind.starts_with("/problems/"), "{problem:?}");
        assert!(
            !problem.title.is_empty() && !problem.detail.is_empty(),
            "{problem:?}"
        );
        let is_of_field = problem.kind == "/problems/field";
        assert_eq!(problem.pointer.is_some(), is_of_field, "{problem:?}");
        problem
    }

    /// The last part of the problem's type.
    pub(crate) fn word(&self) -> String {
        self.problem().kind["/problems/".len()..].to_owned()
    }
}

/// The length of the body that the head of an answer announces.
fn announced(head: &[u8]) -> Option<usize> {
    let head = std::str::from_utf8(head).ok()?.to_ascii_lowercase();
    let line = head
        .split("\r\n")
        .find_map(|line| line.strip_prefix("content-length: "))?;
    line.parse().ok()
}
