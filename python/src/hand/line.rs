//! The line to the server: a WebSocket that is opened with patience, and never waited for from then on.

use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::time::Duration;

use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};
use tungstenite::client::IntoClientRequest;
use tungstenite::handshake::HandshakeError;
use tungstenite::http::Uri;
use tungstenite::{Error, Message, WebSocket};

/// Nobody waits longer for a server that is there.
const PATIENCE: Duration = Duration::from_secs(5);

/// Why there is no line.
#[derive(Debug, thiserror::Error)]
pub(super) enum NoLine {
    /// The address names no server.
    #[error("{url:?} is no address of a server, such as http://127.0.0.1:8080: {detail}")]
    Address {
        /// As given.
        url: String,
        /// What it lacks.
        detail: String,
    },
    /// The keys of a hand go over its socket.
    #[error(
        "{host} is another machine, and the keys of a hand do not go there in the clear: need https"
    )]
    InTheClear {
        /// As given.
        host: String,
    },
    /// There is no certificate to trust.
    #[error("the server's authority cannot be read from {file:?}: {detail}")]
    Authority {
        /// As given.
        file: String,
        /// What is wrong with it.
        detail: String,
    },
    /// The server cannot be reached, or is another.
    #[error("no line to {host}: {detail}")]
    Unreached {
        /// Whom it went to.
        host: String,
        /// What was in the way.
        detail: String,
    },
    /// The server says no.
    #[error("{status}: {detail}")]
    Refused {
        /// Of HTTP.
        status: u16,
        /// In its words.
        detail: String,
    },
}

/// Whom to ask, and by what right.
pub(super) struct Address {
    pub(super) url: String,
    pub(super) session: String,
    pub(super) token: Option<String>,
    /// The authority that vouches for the server, a file of PEM.
    pub(super) authority: Option<String>,
}

enum Stream {
    Plain(TcpStream),
    Encrypted(Box<StreamOwned<ClientConnection, TcpStream>>),
}

impl Stream {
    fn socket(&self) -> &TcpStream {
        match self {
            Self::Plain(socket) => socket,
            Self::Encrypted(stream) => stream.get_ref(),
        }
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain(socket) => socket.read(buffer),
            Self::Encrypted(stream) => stream.read(buffer),
        }
    }
}

impl Write for Stream {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        match self {
            Self::Plain(socket) => socket.write(buffer),
            Self::Encrypted(stream) => stream.write(buffer),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Plain(socket) => socket.flush(),
            Self::Encrypted(stream) => stream.flush(),
        }
    }
}

/// An open WebSocket.
pub(super) struct Line {
    socket: WebSocket<Stream>,
    /// Something that was sent has not left: what is made now would be no news when it does.
    is_stuck: bool,
}

impl Line {
    /// Opens the stream of a session. Waits.
    pub(super) fn open(to: &Address) -> Result<Self, NoLine> {
        let of_address = |detail: &dyn std::fmt::Display| NoLine::Address {
            url: to.url.clone(),
            detail: detail.to_string(),
        };
        let uri: Uri = to.url.parse().map_err(|error| of_address(&error))?;
        let host = uri
            .host()
            .ok_or_else(|| of_address(&"it has no host"))?
            .trim_matches(['[', ']'])
            .to_owned();
        let is_encrypted = match uri.scheme_str() {
            Some("https") => true,
            Some("http") if is_this_machine(&host) => false,
            Some("http") => return Err(NoLine::InTheClear { host }),
            _ => return Err(of_address(&"it begins with neither http:// nor https://")),
        };
        let port = uri
            .port_u16()
            .unwrap_or(if is_encrypted { 443 } else { 80 });
        let unreached = |detail: &dyn std::fmt::Display| NoLine::Unreached {
            host: host.clone(),
            detail: detail.to_string(),
        };
        let encryption = if is_encrypted {
            let name = ServerName::try_from(host.clone()).map_err(|error| of_address(&error))?;
            let config = trust(to.authority.as_deref())?;
            Some(ClientConnection::new(config, name).map_err(|error| unreached(&error))?)
        } else {
            None
        };
        let socket = connect(&host, port).map_err(|error| unreached(&error))?;
        let stream = match encryption {
            Some(session) => Stream::Encrypted(Box::new(StreamOwned::new(session, socket))),
            None => Stream::Plain(socket),
        };
        let authority = uri.authority().map_or("", |authority| authority.as_str());
        let scheme = if is_encrypted { "wss" } else { "ws" };
        let stream_url = format!(
            "{scheme}://{authority}/api/v1/sessions/{}/stream",
            to.session
        );
        let mut request = stream_url
            .into_client_request()
            .map_err(|error| of_address(&error))?;
        let headers = request.headers_mut();
        let subprotocol = tungstenite::http::HeaderValue::from_static("teleclay.v1");
        headers.insert("Sec-WebSocket-Protocol", subprotocol);
        if let Some(token) = &to.token {
            let bearer = format!("Bearer {token}")
                .parse()
                .map_err(|error| of_address(&error))?;
            headers.insert("Authorization", bearer);
        }
        let (socket, _) = tungstenite::client(request, stream).map_err(|error| match error {
            HandshakeError::Failure(Error::Http(answer)) => NoLine::Refused {
                status: answer.status().as_u16(),
                detail: answer
                    .body()
                    .as_deref()
                    .map_or_else(|| answer.status().to_string(), detail_of_problem),
            },
            error => unreached(&error),
        })?;
        Ok(Self {
            socket,
            is_stuck: false,
        })
    }

    /// From now on nothing waits for it.
    pub(super) fn stop_waiting(&self) -> io::Result<()> {
        self.socket.get_ref().socket().set_nonblocking(true)
    }

    /// What has come, if anything has.
    pub(super) fn hear(&mut self) -> Result<Option<Message>, Error> {
        match self.socket.read() {
            Ok(message) => Ok(Some(message)),
            Err(Error::Io(error)) if is_later(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Sends a text: it leaves sooner or later.
    pub(super) fn say(&mut self, text: String) -> Result<(), Error> {
        self.put(Message::text(text))
    }

    /// Sends frames, unless earlier ones have not left yet. Whether it did.
    pub(super) fn send_fresh(&mut self, message: &[u8]) -> Result<bool, Error> {
        self.push()?;
        if self.is_stuck {
            return Ok(false);
        }
        self.put(Message::binary(message.to_vec()))?;
        Ok(true)
    }

    /// Moves on what has not left yet.
    pub(super) fn push(&mut self) -> Result<(), Error> {
        match self.socket.flush() {
            Ok(()) => self.is_stuck = false,
            Err(Error::Io(error)) if is_later(&error) => self.is_stuck = true,
            Err(error) => return Err(error),
        }
        Ok(())
    }

    fn put(&mut self, message: Message) -> Result<(), Error> {
        match self.socket.write(message) {
            Ok(()) => self.push(),
            Err(Error::Io(error)) if is_later(&error) => {
                self.is_stuck = true;
                Ok(())
            }
            Err(error) => Err(error),
        }
    }
}

fn is_later(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
    )
}

fn is_this_machine(host: &str) -> bool {
    let is_loopback = |address: std::net::IpAddr| address.is_loopback();
    host == "localhost" || host.parse().is_ok_and(is_loopback)
}

fn connect(host: &str, port: u16) -> io::Result<TcpStream> {
    let mut last = io::Error::other("it has no address");
    for address in (host, port).to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(socket) => {
                socket.set_nodelay(true)?;
                socket.set_read_timeout(Some(PATIENCE))?;
                socket.set_write_timeout(Some(PATIENCE))?;
                return Ok(socket);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

fn trust(authority: Option<&str>) -> Result<Arc<ClientConfig>, NoLine> {
    let file = authority.unwrap_or_default();
    let unread = |detail: &dyn std::fmt::Display| NoLine::Authority {
        file: file.to_owned(),
        detail: detail.to_string(),
    };
    if file.is_empty() {
        return Err(unread(
            &"https needs one; the server's own is doors/authority.pem of its data folder",
        ));
    }
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_file_iter(file).map_err(|error| unread(&error))? {
        let certificate = certificate.map_err(|error| unread(&error))?;
        roots.add(certificate).map_err(|error| unread(&error))?;
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(|error| unread(&error))?
        .with_root_certificates(roots)
        .with_no_client_auth();
    Ok(Arc::new(config))
}

/// What a body of `application/problem+json` says.
fn detail_of_problem(body: &[u8]) -> String {
    let problem: Option<serde_json::Value> = serde_json::from_slice(body).ok();
    let detail = problem
        .as_ref()
        .and_then(|problem| problem["detail"].as_str());
    detail.map_or_else(|| String::from_utf8_lossy(body).into_owned(), str::to_owned)
}
