//! Whoever floods is heard more slowly, and keeps nobody from a stop.

use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::json;
use teleclay_proto::http::{Session, SessionState};
use teleclay_proto::watch::ServerText;
use teleclay_server::doors::Doors;
use tokio_tungstenite::tungstenite::Message;

use crate::rig::{eventually, shared};
use crate::stream::Stream;
use crate::wire::{Answer, Ask};

const TOKEN: &str = "the right token, long";

/// What one socket is heard of at once, and in a second.
const AT_ONCE: u32 = 1000;
const PER_S: u32 = 100;

#[test]
fn a_stop_is_heard_from_an_address_that_has_used_up_its_tries() {
    let rig = shared();
    let session = rig.session(&rig.site());
    let site = rig.serve(|config| config.doors = Arc::new(Doors::with_token(TOKEN)));
    let ask = |method: &str, path: &str, token: &str| -> Answer {
        let path = format!("/api/v1/sessions/{session}{path}");
        let ask = Ask::new(method, &path).with("Authorization", &format!("Bearer {token}"));
        site.send(&ask)
    };
    let guess = |method: &str, path: &str| {
        let statuses = (0..100).map(|number| ask(method, path, &format!("guess {number}")).status);
        assert!(statuses.into_iter().any(|status| status == 429), "{path}");
    };
    guess("GET", "");
    let stopped = ask("POST", "/stop", TOKEN);
    assert_eq!(stopped.status, 200, "{stopped:?}");
    assert_eq!(stopped.json::<Session>().state, SessionState::Stopped);
    // The stop told nothing of the token to whoever guesses elsewhere: to clear is as limited as all the rest.
    guess("POST", "/stop/clear");
    // Whoever guesses at stops themselves uses up their budget, and keeps nobody from one who is known there.
    guess("POST", "/stop");
    assert_eq!(ask("POST", "/stop", TOKEN).status, 200);
}

#[test]
fn a_stop_finds_a_place_where_every_connection_is_taken() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let crowded = rig.site();
    // Bodies that never come: each keeps its connection for as long as a body may take.
    let slow = Ask::new("POST", "/api/v1/sessions")
        .json("{")
        .with("Content-Length", "100");
    let mut held: Vec<TcpStream> = Vec::new();
    while held.len() < 300 {
        let connection = crowded.connect();
        crowded.begin(&connection, &slow);
        held.push(connection);
        // Those whose request has not been read yet would have to go for the next.
        if held.len().is_multiple_of(16) {
            crowded.get("/healthz");
        }
    }
    let refused = crowded.get("/api/v1/sessions");
    assert_eq!(refused.status, 503, "{refused:?}");
    assert_eq!(refused.text(), "every connection is taken\n");
    let stopped = crowded.post(&format!("/api/v1/sessions/{session}/stop"), &json!({}));
    assert_eq!(stopped.status, 200, "{stopped:?}");
    assert_eq!(stopped.json::<Session>().state, SessionState::Stopped);
    drop(held);
    eventually("there is room again", || {
        crowded.get("/api/v1/sessions").status == 200
    });
}

fn ping(stream: &mut Stream, nonce: u32) {
    stream.say(&json!({ "type": "ping", "nonce": nonce }));
}

/// The next text that is answered is the one of this number.
fn is_heard(stream: &mut Stream, wanted: u32) {
    let nonce = stream.until("a pong", |text| match text {
        ServerText::Pong { nonce } => Some(nonce),
        _ => None,
    });
    assert_eq!(nonce, wanted);
}

#[test]
fn a_watcher_that_floods_texts_is_heard_at_its_pace_and_others_are_not_kept_waiting() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut flooder = Stream::open(&site, &session);
    let mut other = Stream::open(&site, &session);
    let began = Instant::now();
    let sent = AT_ONCE + PER_S;
    for nonce in 0..sent {
        ping(&mut flooder, nonce);
    }
    let asked = Instant::now();
    ping(&mut other, 7);
    is_heard(&mut other, 7);
    let waited = asked.elapsed();
    for nonce in 0..sent {
        is_heard(&mut flooder, nonce);
    }
    // What may not come at once takes its second.
    assert!(Duration::from_millis(900) < began.elapsed());
    assert!(waited < Duration::from_secs(5), "{waited:?}");
}

#[test]
fn a_watcher_that_floods_pings_is_heard_at_its_pace() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut flooder = Stream::open(&site, &session);
    let began = Instant::now();
    for _ in 0..AT_ONCE + 2 * PER_S {
        flooder
            .socket()
            .send(Message::Ping(Vec::new().into()))
            .unwrap();
    }
    ping(&mut flooder, 0);
    is_heard(&mut flooder, 0);
    assert!(Duration::from_millis(1900) < began.elapsed());
}
