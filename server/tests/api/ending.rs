//! How a stream ends, and that whoever is at fault can read why.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::Instant;

use serde_json::json;
use teleclay_proto::watch::ServerText;
use tokio_tungstenite::tungstenite::protocol::frame::Frame;
use tokio_tungstenite::tungstenite::protocol::frame::coding::{Data, OpCode};
use tokio_tungstenite::tungstenite::{Error, Message, WebSocket};

use crate::rig::{PATIENCE, shared};
use crate::stream::Stream;

/// Longest message that is read, bytes.
const LONGEST: usize = 16 * 1024;

/// What a stream said before it ended.
#[derive(Debug, Default)]
struct LastWords {
    /// Type and detail of each problem.
    problems: Vec<(String, String)>,
    code: u16,
    reason: String,
}

/// Reads to the very end of the connection, which must be a proper one.
fn last_words(socket: &mut WebSocket<TcpStream>) -> LastWords {
    let began = Instant::now();
    let mut words = LastWords::default();
    loop {
        assert!(
            began.elapsed() < PATIENCE,
            "the stream does not end: {words:?}"
        );
        match socket.read() {
            Ok(Message::Text(text)) => {
                if let ServerText::Problem { problem } = serde_json::from_str(&text).unwrap() {
                    words.problems.push((problem.kind, problem.detail));
                }
            }
            Ok(Message::Close(frame)) => {
                let frame = frame.expect("a reason");
                (words.code, words.reason) = (frame.code.into(), frame.reason.to_string());
            }
            Ok(_) => {}
            Err(Error::ConnectionClosed) => return words,
            Err(error) => panic!("{error}, after {words:?}"),
        }
    }
}

/// A text in pieces of a length, each a frame.
fn pieces(length: usize, piece: usize) -> Vec<Frame> {
    let count = length.div_ceil(piece);
    (0..count)
        .map(|n| {
            let opcode = if n == 0 { Data::Text } else { Data::Continue };
            let length = piece.min(length - n * piece);
            Frame::message(" ".repeat(length), OpCode::Data(opcode), n + 1 == count)
        })
        .collect()
}

/// The whole message is written before anything is read, as a client does that does not expect to be interrupted.
#[test]
fn whoever_sends_too_long_a_text_can_read_why_the_stream_ends() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    const MEGABYTE: usize = 1_000_000;
    for (what, frames) in [
        ("one byte too long", pieces(LONGEST + 1, LONGEST + 1)),
        (
            "one byte too long, in two pieces",
            pieces(LONGEST + 1, LONGEST),
        ),
        ("ten times too long", pieces(10 * LONGEST, 10 * LONGEST)),
        (
            "ten times too long, in small pieces",
            pieces(10 * LONGEST, 100),
        ),
        ("a megabyte", pieces(MEGABYTE, MEGABYTE)),
        ("a megabyte in pieces that fit", pieces(MEGABYTE, LONGEST)),
        (
            "a megabyte in pieces that do not fit",
            pieces(MEGABYTE, 3 * LONGEST),
        ),
    ] {
        let mut stream = Stream::open(&site, &session);
        // What is said meanwhile must not be in the way.
        stream.say(&json!({ "type": "subscribe", "telemetry": "on", "bricks": "on" }));
        let socket = stream.socket();
        for frame in frames {
            let sent = socket.send(Message::Frame(frame));
            assert!(sent.is_ok(), "{what}: {sent:?}");
        }
        let words = last_words(socket);
        assert_eq!(words.code, 1009, "{what}: {words:?}");
        assert_eq!(words.reason, "messages have at most 16384 bytes", "{what}");
        let [(kind, detail)] = &words.problems[..] else {
            panic!("{what}: {words:?}");
        };
        assert_eq!(kind, "/problems/too-large", "{what}");
        assert_eq!(detail, "the message has more than 16384 bytes", "{what}");
    }
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn whoever_breaks_the_protocol_can_read_that_too() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    // A frame with reserved bits, and much more behind it.
    let mut stream = Stream::open(&site, &session);
    let mut nonsense = vec![0xf1, 0x80, 0, 0, 0, 0];
    nonsense.resize(500_000, 0x5a);
    stream.socket().get_mut().write_all(&nonsense).unwrap();
    let words = last_words(stream.socket());
    assert_eq!((words.code, words.problems.len()), (1002, 0), "{words:?}");
    // Bytes that are not UTF-8, said to be a text.
    let mut stream = Stream::open(&site, &session);
    let not_text = Frame::message(vec![0xff, 0xfe], OpCode::Data(Data::Text), true);
    stream.socket().send(Message::Frame(not_text)).unwrap();
    let words = last_words(stream.socket());
    assert_eq!(
        (words.code, &*words.problems[0].0),
        (1007, "/problems/syntax"),
        "{words:?}"
    );
    site.delete(&format!("/api/v1/sessions/{session}"));
}

/// Not only streams: a request that is refused before its body is read is answered so that the answer can be read.
#[test]
fn whoever_sends_too_large_a_body_can_read_the_answer() {
    let site = shared().site();
    let body = " ".repeat(4_000_000);
    let head = format!(
        "POST /api/v1/sessions HTTP/1.1\r\nHost: {}\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n",
        site.address,
        body.len()
    );
    let mut connection = site.connect();
    connection.write_all(head.as_bytes()).unwrap();
    connection.write_all(body.as_bytes()).unwrap();
    let mut answer = String::new();
    connection.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 413 "), "{answer}");
    assert!(answer.contains("/problems/too-large"), "{answer}");
}
