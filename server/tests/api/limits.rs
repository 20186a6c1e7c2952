//! As many as there may be, and not one more.

use serde_json::json;
use teleclay_proto::http::Session;
use teleclay_proto::join::RefusalCode;

use crate::hand::{joined, refused};
use crate::rig::{Rig, eventually, small};
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
    eventually("a place is free again", || {
        site.get("/metrics")
            .text()
            .contains("teleclay_streams_ended_total{reason=\"left\"} 1")
    });
    streams.push(Stream::open(&site, &session));
    site.delete(&format!("/api/v1/sessions/{session}"));
}

/// Clay has a bound of memory of its own: the last session that fits is made, the next is refused with the figures, and
/// a fresh block that is too large, too; smaller ones go on.
#[test]
fn clay_is_limited_and_a_refusal_says_what_is_free() {
    // 32 bricks of 4096 voxels, twice: a quarter of a MiB.
    let rig = Rig::start_with(|settings| settings.clay_bytes = 1 << 20);
    let site = rig.site();
    for number in 0..4 {
        let made = site.post("/api/v1/sessions", &small(&format!("s{number}")));
        assert_eq!(made.status, 201, "{made:?}");
    }
    let refusal = site.post("/api/v1/sessions", &small("s4"));
    assert_eq!((refusal.status, &*refusal.word()), (409, "clay-memory"));
    let detail = refusal.problem().detail;
    assert_eq!(
        detail,
        "the block takes 1 MiB, 0 of the 1 MiB for all sessions are free"
    );
    let path = "/api/v1/sessions/s0/clay/reset";
    let block =
        |size_m: f64| json!({ "shape": { "kind": "block", "size_m": [size_m, size_m, 0.032] } });
    let refusal = site.post(path, &block(0.128));
    assert_eq!((refusal.status, &*refusal.word()), (409, "clay-memory"));
    // In the place of its own clay there is room for as much, and a smaller one makes some.
    assert_eq!(site.post(path, &block(0.064)).status, 200);
    assert_eq!(site.post(path, &block(0.032)).status, 200);
    let twin = site.post("/api/v1/sessions/s0/duplicate", &json!({ "id": "twin" }));
    assert_eq!(twin.status, 201, "{twin:?}");
    let refusal = site.post("/api/v1/sessions/s1/duplicate", &json!({ "id": "more" }));
    assert_eq!((refusal.status, &*refusal.word()), (409, "clay-memory"));
}

/// With a microsecond for all sessions of a thread, whoever holds a tool has it to himself: another session is not
/// made, and nobody joins one that is there, until he lets go; each time with what it would take and what is free.
#[test]
fn who_would_make_others_late_is_refused_with_the_figures() {
    let rig = Rig::start_with(|settings| {
        settings.tick_threads = 1;
        settings.tick_budget = 0.001;
    });
    let site = rig.site();
    for id in ["one", "two"] {
        assert_eq!(site.post("/api/v1/sessions", &small(id)).status, 201);
    }
    let (mut ada, mut bob) = (Stream::open(&site, "one"), Stream::open(&site, "two"));
    joined(&mut ada, "Ada");
    let (code, reason, _) = refused(&mut bob, "Bob");
    assert_eq!(code, RefusalCode::NoTickTime, "{reason}");
    assert!(reason.contains("0 of its 1 µs free"), "{reason}");
    let refusal = site.post("/api/v1/sessions", &small("three"));
    assert_eq!((refusal.status, &*refusal.word()), (503, "no_tick_time"));
    assert_eq!(refusal.header("retry-after"), Some("1"));
    let detail = refusal.problem().detail;
    assert!(detail.contains("0 of its 1 µs free"), "{detail}");
    let shown = site.get("/metrics").text().to_owned();
    let told = |line: &str| assert!(shown.contains(line), "{line} in {shown}");
    told("teleclay_tick_time_refusals_total 2");
    told("teleclay_thread_sessions{thread=\"0\"} 2");

    ada.leave();
    eventually("there is time for another", || {
        site.post("/api/v1/sessions", &small("three")).status == 201
    });
    joined(&mut bob, "Bob");
}

/// A session goes from thread to thread while somebody watches: its ticks go on, and it says where it is.
#[test]
fn a_session_lives_where_it_was_told_and_goes_on_there() {
    let rig = Rig::start_with(|settings| settings.tick_threads = 3);
    let site = rig.site();
    assert_eq!(site.post("/api/v1/sessions", &small("one")).status, 201);
    let session = || -> Session { site.get("/api/v1/sessions/one").json() };
    let mut before = session().control_loop;
    for thread in [2, 0, 1, 2] {
        rig.move_to("one", thread);
        let now = session().control_loop;
        assert_eq!(now.thread as usize, thread);
        assert!(before.ticks <= now.ticks);
        before = now;
        // Orders find it there.
        let reset = site.post("/api/v1/sessions/one/clay/reset", &json!({}));
        assert_eq!(reset.status, 200, "{reset:?}");
    }
    eventually("it ticks on", || {
        before.ticks + 100 < session().control_loop.ticks
    });
}
