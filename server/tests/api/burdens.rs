//! What one watcher may cost, and what ends its stream.

use std::io::Write as _;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use teleclay_proto::watch::{Message as Binary, ServerText};
use tokio_tungstenite::tungstenite::protocol::frame::Frame;
use tokio_tungstenite::tungstenite::protocol::frame::coding::{Data, OpCode};
use tokio_tungstenite::tungstenite::{Error, Message};

use crate::rig::{PATIENCE, eventually, shared};
use crate::stream::Stream;

#[test]
fn a_message_that_is_too_long_ends_the_stream() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut stream = Stream::open(&site, &session);
    // As long as may be.
    let fits = format!("{:<16384}", "{\"type\":\"ping\",\"nonce\":4711}");
    stream.socket().send(Message::text(fits)).unwrap();
    stream.until("a pong", |text| {
        matches!(text, ServerText::Pong { .. }).then_some(())
    });
    stream
        .socket()
        .send(Message::text(" ".repeat(16_385)))
        .unwrap();
    assert_eq!(stream.ending().0, 1009);
    // And in pieces that are each short enough.
    let mut stream = Stream::open(&site, &session);
    for (opcode, is_final) in [(Data::Text, false), (Data::Continue, true)] {
        let part = Frame::message(" ".repeat(9000), OpCode::Data(opcode), is_final);
        stream.socket().send(Message::Frame(part)).unwrap();
    }
    assert_eq!(stream.ending().0, 1009);
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn what_breaks_the_protocol_ends_the_stream_with_its_code() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut stream = Stream::open(&site, &session);
    let not_text = Frame::message(vec![0xff, 0xfe], OpCode::Data(Data::Text), true);
    stream.socket().send(Message::Frame(not_text)).unwrap();
    assert_eq!(stream.ending().0, 1007);
    let mut stream = Stream::open(&site, &session);
    // A frame with reserved bits, written past the library.
    stream
        .socket()
        .get_mut()
        .write_all(&[0xf1, 0x80, 0, 0, 0, 0])
        .unwrap();
    assert_eq!(stream.ending().0, 1002);
    // A connection that is simply gone is noticed too.
    drop(Stream::open(&site, &session));
    eventually("a lost stream is counted", || {
        site.get("/metrics")
            .text()
            .contains("streams_ended_total{reason=\"lost\"} 1")
    });
    site.delete(&format!("/api/v1/sessions/{session}"));
}

/// Fresh blocks without pause, each of 4096 bricks: a keyframe of 32 kB, wanted many times a second.
fn fresh_block(thickness_m: f64) -> Value {
    json!({ "shape": { "kind": "block", "size_m": [0.512, 0.512, thickness_m] } })
}

#[test]
fn a_watcher_costs_no_more_than_its_share() {
    const MEASURED: Duration = Duration::from_secs(3);
    /// 2 Mbit/s.
    const SHARE_B_PER_S: f64 = 250_000.0;
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    // What a watcher may cost counts from the moment at which it connects.
    let began = Instant::now();
    let mut stream = Stream::open(&site, &session);
    stream.subscribe("on", "on");
    let mut bytes = 0;
    let mut epochs = std::collections::BTreeSet::new();
    stream.say(&json!({ "type": "reset", "clay": fresh_block(0.063) }));
    while began.elapsed() < MEASURED {
        let message = stream.next();
        bytes += message.len();
        match message {
            Message::Text(text) if text.contains("a fresh block") => {
                stream.say(&json!({ "type": "reset", "clay": fresh_block(0.064) }));
            }
            Message::Binary(bytes) => {
                if let Binary::Bricks(view) = Binary::decode(&bytes).unwrap() {
                    epochs.insert(view.header.clay_epoch);
                }
            }
            _ => {}
        }
    }
    assert!(
        3 < epochs.len(),
        "only {} blocks in three seconds",
        epochs.len()
    );
    let took = began.elapsed();
    println!("{} blocks, {bytes} B in {took:?}", epochs.len());
    // A second's worth may be saved up.
    let most_bytes = SHARE_B_PER_S * (took.as_secs_f64() + 1.0);
    assert!((bytes as f64) < 1.05 * most_bytes, "{bytes} B");
    site.delete(&format!("/api/v1/sessions/{session}"));
}

/// Memory of this process that is in use, bytes.
fn resident() -> usize {
    let status = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: usize = status.split(' ').nth(1).unwrap().parse().unwrap();
    pages * 4096
}

/// A watcher that reads nothing at all: what waits for it is bounded, others do not notice, and in the end it is let
/// go.
#[test]
fn a_watcher_that_does_not_read_is_let_go_and_holds_up_nobody() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let path = format!("/api/v1/sessions/{session}");
    let mut deaf = Stream::open(&site, &session);
    deaf.subscribe("on", "on");
    let mut other = Stream::open(&site, &session);
    other.subscribe("on", "on");

    let began = Instant::now();
    let mut before = None;
    let mut slowest = Duration::ZERO;
    loop {
        let reset = site.post(&format!("{path}/clay/reset"), &fresh_block(0.064));
        assert_eq!(reset.status, 200, "{reset:?}");
        let asked = Instant::now();
        other.catch_up();
        slowest = slowest.max(asked.elapsed());
        let before = *before.get_or_insert_with(resident);
        assert!(resident() < before + (128 << 20), "memory grows");
        if site
            .get("/metrics")
            .text()
            .contains("streams_ended_total{reason=\"slow\"} 1")
        {
            break;
        }
        assert!(began.elapsed() < 2 * PATIENCE, "it is still there");
    }
    println!(
        "let go after {:?}; the other waited at most {slowest:?}",
        began.elapsed()
    );
    assert!(
        slowest < Duration::from_secs(5),
        "the other waited {slowest:?}"
    );
    // What was on its way can still be read, and then it ends.
    let mut read = 0;
    let end = loop {
        match deaf.socket().read() {
            Ok(message) => read += message.len(),
            Err(end) => break end,
        }
    };
    assert!(
        !matches!(end, Error::Io(ref io) if io.kind() == std::io::ErrorKind::WouldBlock),
        "{end}"
    );
    assert!(read < 16 << 20, "{read} B were waiting");
    println!("{read} B were waiting for it");
    site.delete(&path);
}
