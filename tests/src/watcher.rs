//! A watcher of the WebSocket that reads as slowly as one likes: no library in between that would read ahead.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::fd::AsRawFd;
use std::time::Duration;

use anyhow::{Context as _, Result, ensure};

/// Room for what has not been read, bytes: small, so that a slow reader is felt at the other end soon.
const RECEIVE_BUFFER: i32 = 4096;
/// A healthy server shakes hands at once.
const ANSWER_WITHIN: Duration = Duration::from_secs(20);

/// An open stream.
#[derive(Debug)]
pub struct Watcher {
    stream: TcpStream,
}

/// What a read gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Got {
    /// So many bytes.
    Bytes(usize),
    /// Nothing for now.
    Nothing,
    /// The server has closed the stream.
    End,
}

impl Watcher {
    /// Opens the stream of a session and asks for everything there is.
    ///
    /// # Errors
    /// The server does not shake hands.
    pub fn open(address: SocketAddr, session: &str) -> Result<Self> {
        let mut stream = TcpStream::connect(address)?;
        limit_receive_buffer(&stream)?;
        stream.set_read_timeout(Some(ANSWER_WITHIN))?;
        write!(
            stream,
            "GET /api/v1/sessions/{session}/stream HTTP/1.1\r\nHost: {address}\r\nUpgrade: websocket\r\n\
             Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
             Sec-WebSocket-Protocol: teleclay.v1\r\n\r\n"
        )?;
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte)?;
            head.push(byte[0]);
        }
        let head = String::from_utf8_lossy(&head);
        ensure!(head.starts_with("HTTP/1.1 101"), "answered {head}");
        stream.write_all(&text_frame(
            r#"{"type":"subscribe","telemetry":"on","bricks":"on"}"#,
        ))?;
        Ok(Self { stream })
    }

    /// Reads `most` bytes at most, whatever they are, and waits no longer than `patience` for the first.
    ///
    /// # Errors
    /// The connection broke.
    pub fn read(&mut self, most: usize, patience: Duration) -> Result<Got> {
        self.stream.set_read_timeout(Some(patience))?;
        let mut buffer = vec![0; most];
        match self.stream.read(&mut buffer) {
            Ok(0) => Ok(Got::End),
            Ok(length) => Ok(Got::Bytes(length)),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                Ok(Got::Nothing)
            }
            // A server that gives a slow reader up may have unread bytes of ours, and then the connection is reset.
            Err(error) if error.kind() == ErrorKind::ConnectionReset => Ok(Got::End),
            Err(error) => Err(error).context("the stream broke"),
        }
    }
}

/// A masked text frame of less than 126 bytes, as clients send them. The mask is zero: it hides nothing, which nobody
/// forbids.
fn text_frame(text: &str) -> Vec<u8> {
    const FINAL_TEXT: u8 = 0x81;
    const MASKED: u8 = 0x80;
    let length = u8::try_from(text.len()).expect("the one text is short");
    let mut frame = vec![FINAL_TEXT, MASKED | length, 0, 0, 0, 0];
    frame.extend_from_slice(text.as_bytes());
    frame
}

fn limit_receive_buffer(stream: &TcpStream) -> Result<()> {
    let size: libc::c_int = RECEIVE_BUFFER;
    #[allow(unsafe_code, reason = "std has no way to ask for it")]
    // SAFETY: the descriptor is open, the pointer valid for the length given.
    let refused = unsafe {
        libc::setsockopt(
            stream.as_raw_fd(),
            libc::SOL_SOCKET,
            libc::SO_RCVBUF,
            (&raw const size).cast(),
            size_of::<libc::c_int>() as libc::socklen_t,
        )
    };
    ensure!(refused == 0, std::io::Error::last_os_error());
    Ok(())
}
