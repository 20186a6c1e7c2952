//! The WebSocket, as a watcher meets it.

use std::net::TcpStream;
use std::time::{Instant, SystemTime};

use serde_json::{Value, json};
use teleclay_proto::http::{Problem, Session};
use teleclay_proto::invite::InviteToken;
use teleclay_proto::watch::{BrickBody, BricksKind, Message as Binary, ServerText};
use tokio_tungstenite::tungstenite::handshake::client::generate_key;
use tokio_tungstenite::tungstenite::http::Request;
use tokio_tungstenite::tungstenite::{Message, WebSocket, client};

use crate::guard::Guests;
use crate::rig::{PATIENCE, eventually, shared};
use crate::wire::{Answer, Ask, Site};

/// An open stream, read with patience.
pub(crate) struct Stream(WebSocket<TcpStream>);

impl Stream {
    pub(crate) fn open(site: &Site, session: &str) -> Self {
        Self::open_on(site.connect(), site, session)
    }

    fn open_on(connection: TcpStream, site: &Site, session: &str) -> Self {
        Self::open_offering("other, teleclay.v1", connection, site, session)
    }

    /// For whoever shows this token.
    pub(crate) fn open_with(token: &str, site: &Site, session: &str) -> Self {
        let offered = format!("teleclay.v1, bearer.{token}");
        Self::open_offering(&offered, site.connect(), site, session)
    }

    fn open_offering(offered: &str, connection: TcpStream, site: &Site, session: &str) -> Self {
        let request = Request::builder()
            .uri(format!(
                "ws://{}/api/v1/sessions/{session}/stream",
                site.address
            ))
            .header("Host", site.address.to_string())
            .header("Connection", "Upgrade")
            .header("Upgrade", "websocket")
            .header("Sec-WebSocket-Version", "13")
            .header("Sec-WebSocket-Key", generate_key())
            .header("Sec-WebSocket-Protocol", offered)
            .body(())
            .unwrap();
        let (socket, answer) = client(request, connection).unwrap();
        assert_eq!(answer.headers()["sec-websocket-protocol"], "teleclay.v1");
        Self(socket)
    }

    /// A handshake that is complete but for the headers given, and that is not accepted.
    pub(crate) fn refused(site: &Site, session: &str, headers: &[(&str, &str)]) -> Answer {
        let defaults = [
            ("Connection", "Upgrade"),
            ("Upgrade", "websocket"),
            ("Sec-WebSocket-Version", "13"),
            ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
        ];
        let is_given = |name: &str| headers.iter().any(|(other, _)| *other == name);
        let mut ask = Ask::new("GET", &format!("/api/v1/sessions/{session}/stream"));
        for (name, value) in defaults
            .iter()
            .filter(|(name, _)| !is_given(name))
            .chain(headers)
        {
            ask = ask.with(name, value);
        }
        site.send(&ask)
    }

    pub(crate) fn next(&mut self) -> Message {
        self.0.read().unwrap()
    }

    pub(crate) fn socket(&mut self) -> &mut WebSocket<TcpStream> {
        &mut self.0
    }

    pub(crate) fn say(&mut self, text: &Value) {
        self.0.send(Message::text(text.to_string())).unwrap();
    }

    pub(crate) fn subscribe(&mut self, telemetry: &str, bricks: &str) {
        self.say(&json!({ "type": "subscribe", "telemetry": telemetry, "bricks": bricks }));
    }

    /// Reads on until a text is what is wanted.
    pub(crate) fn until<T>(
        &mut self,
        what: &str,
        mut wanted: impl FnMut(ServerText) -> Option<T>,
    ) -> T {
        let began = Instant::now();
        loop {
            assert!(began.elapsed() < PATIENCE, "waited in vain: {what}");
            if let Message::Text(text) = self.next()
                && let Some(found) = wanted(serde_json::from_str(&text).unwrap())
            {
                return found;
            }
        }
    }

    pub(crate) fn problem(&mut self) -> Problem {
        self.until("a problem", |text| match text {
            ServerText::Problem { problem } => Some(problem),
            _ => None,
        })
    }

    pub(crate) fn state(&mut self, holds: impl Fn(&Session) -> bool) -> Session {
        self.until("a state", |text| match text {
            ServerText::State { session } if holds(&session) => Some(*session),
            _ => None,
        })
    }

    /// Everything that was said before is answered once this returns.
    pub(crate) fn catch_up(&mut self) {
        self.say(&json!({ "type": "ping", "nonce": 4711 }));
        self.until("a pong", |text| {
            (text == ServerText::Pong { nonce: 4711 }).then_some(())
        });
    }

    /// Reads the rest; the code and reason that the server closes with.
    pub(crate) fn ending(mut self) -> (u16, String) {
        let began = Instant::now();
        loop {
            assert!(began.elapsed() < PATIENCE, "the stream does not end");
            if let Message::Close(frame) = self.next() {
                let frame = frame.expect("a reason");
                // Answers the close.
                self.0.flush().ok();
                return (frame.code.into(), frame.reason.to_string());
            }
        }
    }

    /// Closes, and waits until the server has taken note.
    pub(crate) fn leave(mut self) {
        self.0.close(None).unwrap();
        while self.0.read().is_ok() {}
    }
}

#[test]
fn a_guest_watches_changes_what_the_role_allows_and_goes_when_the_invite_ends() {
    let open = shared().site();
    let session = shared().session(&open);
    let guests = Guests::of(&session);
    let site = guests.site();
    let change = json!({ "type": "patch", "session": { "deadband": 0.05 } });
    let fresh = json!({ "type": "reset", "clay": {} });
    let [spectator, operator, admin] = [0, 1, 2].map(|role| {
        let mut stream = Stream::open_with(&guests.tokens[role], &site, &session);
        stream.state(|_| true);
        stream
    });
    let mut watching = Vec::new();
    for mut stream in [spectator, operator] {
        for asked in [&change, &fresh] {
            stream.say(asked);
            assert_eq!(stream.problem().status, 403);
        }
        watching.push(stream);
    }
    let before: Session = open.get(&format!("/api/v1/sessions/{session}")).json();
    assert_eq!((before.deadband, before.clay.epoch), (0.0, 1));
    let mut admin = admin;
    admin.say(&change);
    admin.state(|session| 0.0 < session.deadband);
    for (token, stream) in guests.tokens.iter().zip(watching) {
        let id = token.parse::<InviteToken>().unwrap().id();
        guests.invites.revoke(SystemTime::now(), id).unwrap();
        assert_eq!(stream.ending(), (4403, "the invite has ended".to_owned()));
    }
    // Others stay.
    admin.catch_up();
    admin.leave();
    open.delete(&format!("/api/v1/sessions/{session}"));
    std::fs::remove_dir_all(&guests.data).unwrap();
}

#[test]
fn it_says_hello_then_the_state_and_then_the_state_again() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut stream = Stream::open(&site, &session);
    let texts: Vec<ServerText> = (0..4)
        .map(|_| serde_json::from_str(stream.next().to_text().unwrap()).unwrap())
        .collect();
    let ServerText::Hello {
        protocol,
        session: of,
        server_version,
    } = &texts[0]
    else {
        panic!("{texts:?}");
    };
    assert_eq!(
        (*protocol, of.as_str(), &**server_version),
        (1, &*session, "9.8.7")
    );
    for text in &texts[1..] {
        assert!(matches!(text, ServerText::State { .. }), "{text:?}");
    }
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn a_handshake_that_is_not_complete_is_refused_with_a_reason() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let speaks = ("Sec-WebSocket-Protocol", "teleclay.v1");
    for (headers, status, word) in [
        (&[][..], 400, "subprotocol"),
        (
            &[("Sec-WebSocket-Protocol", "teleclay.v2")],
            400,
            "subprotocol",
        ),
        (
            &[("Sec-WebSocket-Protocol", "teleclay.v1x, Teleclay.V1")],
            400,
            "subprotocol",
        ),
        (&[speaks, ("Connection", "close")], 426, "upgrade"),
        (&[speaks, ("Upgrade", "h2c")], 426, "upgrade"),
        (&[speaks, ("Sec-WebSocket-Version", "8")], 400, "handshake"),
        (&[speaks, ("Sec-WebSocket-Key", "")], 400, "handshake"),
        (&[speaks, ("Origin", "https://evil.example")], 403, "origin"),
        (&[speaks, ("Host", "evil.example")], 421, "host"),
    ] {
        let answer = Stream::refused(&site, &session, headers);
        assert_eq!(
            (answer.status, &*answer.word()),
            (status, word),
            "{headers:?}"
        );
    }
    let answer = Stream::refused(&site, "none", &[speaks]);
    assert_eq!((answer.status, &*answer.word()), (404, "no-such-session"));
    let answer = site.get(&format!("/api/v1/sessions/{session}/stream"));
    assert_eq!((answer.status, &*answer.word()), (426, "upgrade"));
    assert_eq!(answer.header("upgrade"), Some("websocket"));
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn changes_are_answered_by_the_state_and_seen_by_others() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut mine = Stream::open(&site, &session);
    let mut other = Stream::open(&site, &session);
    mine.say(
        &json!({ "type": "patch", "session": { "network": { "down": { "delay_s": 0.25 } } } }),
    );
    for stream in [&mut mine, &mut other] {
        let state = stream.state(|session| 0.2 < session.network.down.delay_s);
        assert_eq!(state.network.up.delay_s.to_bits(), 0.0_f64.to_bits());
    }
    let epoch = mine.state(|_| true).clay.epoch;
    mine.say(&json!({ "type": "reset", "clay": { "shape": { "kind": "block", "size_m": [0.01, 0.01, 0.01] } } }));
    for stream in [&mut mine, &mut other] {
        let state = stream.state(|session| session.clay.epoch != epoch);
        assert_eq!(state.clay.initial_units, 255 * 1000);
    }
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn what_is_not_acceptable_is_answered_and_the_stream_goes_on() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut stream = Stream::open(&site, &session);
    for (message, word, pointer) in [
        (
            json!({ "type": "patch", "session": { "network": { "up": { "loss": 2 } } } }),
            "field",
            Some("/session/network/up/loss"),
        ),
        (
            json!({ "type": "patch", "session": { "surplus": 1 } }),
            "field",
            Some("/session/surplus"),
        ),
        (
            json!({ "type": "patch", "session": null }),
            "field",
            Some(""),
        ),
        (json!({ "type": "patch" }), "field", Some("")),
        (
            json!({ "type": "reset", "clay": { "shape": { "kind": "ball" } } }),
            "field",
            Some("/clay/shape/kind"),
        ),
        (
            json!({ "type": "reset", "clay": { "material": { "stiffness_pa": -1 } } }),
            "field",
            Some("/clay/material/stiffness_pa"),
        ),
        // In its range, and more voxels of this clay's size than there may be.
        (
            json!({ "type": "reset", "clay": { "shape": { "kind": "block", "size_m": [9, 9, 9] } } }),
            "field",
            Some("/clay/shape"),
        ),
        (json!({ "type": "subscribe" }), "field", Some("")),
        (
            json!({ "type": "subscribe", "telemetry": true, "bricks": "on" }),
            "field",
            Some("/telemetry"),
        ),
        (
            json!({ "type": "ping", "nonce": -1 }),
            "field",
            Some("/nonce"),
        ),
        (json!({ "type": "shutdown" }), "field", Some("/type")),
        (json!({}), "field", Some("")),
        (json!([1]), "field", Some("")),
        (json!(null), "field", Some("")),
    ] {
        stream.say(&message);
        let problem = stream.problem();
        assert_eq!(problem.kind, format!("/problems/{word}"), "{message}");
        let got = problem.pointer.as_deref();
        let is_near = got
            .zip(pointer)
            .is_some_and(|(got, want)| got.starts_with(want));
        assert!(is_near, "{message}: {got:?}, wanted {pointer:?}");
    }
    let deep = "[".repeat(16_000);
    for text in [
        "",
        "{",
        "hello",
        "{\"type\":\"ping\",\"nonce\":1e999}",
        "\u{0}",
        &deep,
    ] {
        stream.0.send(Message::text(text)).unwrap();
        assert_eq!(stream.problem().kind, "/problems/syntax", "{text:.20}");
    }
    stream.0.send(Message::binary(vec![1, 2, 3])).unwrap();
    assert_eq!(stream.problem().kind, "/problems/no-lease");
    stream.catch_up();
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn pings_of_either_sort_are_answered() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut stream = Stream::open(&site, &session);
    stream.catch_up();
    stream
        .0
        .send(Message::Ping("are you there".into()))
        .unwrap();
    let began = Instant::now();
    loop {
        assert!(began.elapsed() < PATIENCE);
        if let Message::Pong(echo) = stream.next() {
            assert_eq!(&*echo, b"are you there");
            break;
        }
    }
    site.delete(&format!("/api/v1/sessions/{session}"));
}

/// Reads bricks until every one of them was told; the epoch, and whether they were all full.
fn keyframe(stream: &mut Stream, bricks: usize) -> (u32, bool) {
    let began = Instant::now();
    let mut told = Vec::new();
    let mut all_full = true;
    let mut epoch = None;
    while told.len() < bricks {
        assert!(
            began.elapsed() < PATIENCE,
            "{} of {bricks} bricks came",
            told.len()
        );
        let Message::Binary(bytes) = stream.next() else {
            continue;
        };
        let Binary::Bricks(view) = Binary::decode(&bytes).unwrap() else {
            continue;
        };
        if view.header.kind == BricksKind::Keyframe {
            told.clear();
            all_full = true;
            epoch = Some(view.header.clay_epoch);
        }
        assert_eq!(
            Some(view.header.clay_epoch),
            epoch,
            "a delta of what was never shown"
        );
        for brick in view.iter() {
            assert!(
                !told.contains(&brick.index),
                "brick {} is told twice",
                brick.index
            );
            told.push(brick.index);
            all_full &= brick.body == BrickBody::Full;
        }
    }
    (epoch.unwrap(), all_full)
}

#[test]
fn bricks_begin_with_a_keyframe_and_so_does_every_fresh_block() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut stream = Stream::open(&site, &session);
    stream.subscribe("off", "on");
    let (epoch, all_full) = keyframe(&mut stream, 4 * 4 * 2);
    assert!(all_full);
    stream.say(&json!({ "type": "reset", "clay": { "shape": { "kind": "block", "size_m": [0.032, 0.016, 0.016] } } }));
    let (after, all_full) = keyframe(&mut stream, 2);
    assert!(all_full && after != epoch);
    // Asked for anew, bricks begin with a keyframe again.
    stream.subscribe("off", "off");
    stream.subscribe("off", "on");
    assert_eq!(keyframe(&mut stream, 2), (after, true));
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn without_asking_nobody_gets_bricks_or_telemetry() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut stream = Stream::open(&site, &session);
    stream.say(&json!({ "type": "reset", "clay": {} }));
    let mut states = 0;
    while states < 5 {
        match stream.next() {
            Message::Text(text) => states += usize::from(text.contains("\"type\":\"state\"")),
            other => panic!("{other:?}"),
        }
    }
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn an_ended_session_ends_its_streams_and_says_so() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let streams = [Stream::open(&site, &session), Stream::open(&site, &session)];
    assert_eq!(
        site.delete(&format!("/api/v1/sessions/{session}")).status,
        204
    );
    // A new one of the same name is another one.
    let again = site.post("/api/v1/sessions", &crate::rig::small(&session));
    assert_eq!(again.status, 201);
    for stream in streams {
        assert_eq!(stream.ending(), (4404, "the session has ended".to_owned()));
    }
    let shown = site.get("/metrics");
    let line = "teleclay_streams_ended_total{reason=\"session-ended\"} 2";
    eventually("the streams are counted", || {
        site.get("/metrics").text().contains(line)
    });
    assert!(shown.text().contains("teleclay_stream_sent_bytes_total"));
    site.delete(&format!("/api/v1/sessions/{session}"));
}
