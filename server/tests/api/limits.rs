//! As many as there may be, and not one more.

use teleclay_proto::http::Session;

use crate::rig::{Rig, small};
use crate::stream::Stream;

#[test]
fn sessions_are_limited_and_ending_one_makes_room() {
    let rig = Rig::start();
    let site = rig.site();
    let mut made = Vec::new();
    let refusal = loop {
        let id = format!("s{}", made.len());
        let answer = site.post("/api/v1/sessions", &small(&id));
        if answer.status != 201 {
            break answer;
        }
        made.push(id);
        assert!(made.len() < 1000, "there is no limit");
    };
    assert_eq!(
        (refusal.status, &*refusal.word()),
        (409, "too-many-sessions")
    );
    assert!(8 <= made.len(), "a laboratory has that many tables");
    let listed: Vec<Session> = site.get("/api/v1/sessions").json();
    assert_eq!(listed.len(), made.len());

    assert_eq!(site.delete("/api/v1/sessions/s0").status, 204);
    assert_eq!(site.post("/api/v1/sessions", &small("again")).status, 201);
}

#[test]
fn watchers_are_limited_and_one_that_leaves_makes_room() {
    let rig = crate::rig::shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut streams: Vec<Stream> = (0..64).map(|_| Stream::open(&site, &session)).collect();
    let refusal = Stream::refused(
        &site,
        &session,
        &[("Sec-WebSocket-Protocol", "teleclay.v1")],
    );
    assert_eq!(
        (refusal.status, &*refusal.word()),
        (503, "too-many-watchers")
    );
    assert_eq!(refusal.header("retry-after"), Some("1"));
    let shown = site.get("/metrics");
    let line = format!("teleclay_watchers{{session=\"{session}\"}} 64");
    assert!(shown.text().contains(&line), "{}", shown.text());

    // Once the server has answered the close, the place is free at the latest when its end is counted.
    streams.pop().unwrap().leave();
    crate::rig::eventually("a place is free again", || {
        site.get("/metrics")
            .text()
            .contains("teleclay_streams_ended_total{reason=\"left\"} 1")
    });
    streams.push(Stream::open(&site, &session));
    site.delete(&format!("/api/v1/sessions/{session}"));
}
