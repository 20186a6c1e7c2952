//! A hand on a socket: the loop that runs in a page, here driven by this test, and those who have no business with it.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use teleclay_channel::Keys;
use teleclay_pointer::{MadePath, Pointer, PointerSetup};
use teleclay_proto::frame::CopyState;
use teleclay_proto::http::{Session, SessionState};
use teleclay_proto::join::{Granted, RefusalCode};
use teleclay_proto::watch::ServerText;
use tokio_tungstenite::tungstenite::{Error, Message};

use crate::guard::Guests;
use crate::rig::{PATIENCE, Rig, eventually, shared, small};
use crate::stream::Stream;
use crate::wire::{Ask, Site};

/// The reading of a socket waits so long: a tick.
const TICK: Duration = Duration::from_millis(1);

fn device() -> Value {
    json!({ "name": "test pointer", "axes": 2, "force_n": 0, "rate_hz": 60, "measures_force": false })
}

fn join(stream: &mut Stream, operator: &str) {
    stream.say(&json!({ "type": "join", "operator": operator, "device": device() }));
}

pub(crate) fn joined(stream: &mut Stream, operator: &str) -> ([u8; 64], Granted) {
    join(stream, operator);
    stream.until("a lease", |text| match text {
        ServerText::Granted { keys, granted } => Some((keys, *granted)),
        ServerText::Refused { reason, .. } => panic!("{reason}"),
        _ => None,
    })
}

pub(crate) fn refused(
    stream: &mut Stream,
    operator: &str,
) -> (RefusalCode, String, Option<String>) {
    join(stream, operator);
    stream.until("a refusal", |text| match text {
        ServerText::Granted { .. } => panic!("{operator} got a lease"),
        ServerText::Refused {
            code,
            reason,
            holder,
        } => Some((code, reason, holder)),
        _ => None,
    })
}

fn farewell(stream: &mut Stream) -> String {
    stream.until("a farewell", |text| match text {
        ServerText::Farewell { reason } => Some(reason),
        _ => None,
    })
}

fn done(stream: &mut Stream) {
    stream.until("an answer", |text| match text {
        ServerText::Problem { problem } => panic!("{problem:?}"),
        text => (text == ServerText::Done {}).then_some(()),
    });
}

fn state(site: &Site, session: &str) -> Session {
    site.get(&format!("/api/v1/sessions/{session}")).json()
}

fn holder(site: &Site, session: &str) -> String {
    let tools = state(site, session).tools;
    tools
        .first()
        .map_or(String::new(), |tool| tool.operator.clone())
}

fn replica(rig: &Rig, site: &Site, tools: u32) -> String {
    let session = rig.session(site);
    site.delete(&format!("/api/v1/sessions/{session}"));
    let mut spec = small(&session);
    spec["scheme"] = json!("replica");
    spec["tools"] = json!(tools);
    let made = site.post("/api/v1/sessions", &spec);
    assert_eq!(made.status, 201, "{made:?}");
    session
}

/// The loop of a page, on this process's clock.
struct Page {
    stream: Stream,
    pointer: Pointer,
    path: std::iter::Peekable<MadePath>,
    began: Instant,
    asked: bool,
    awaited: u32,
}

impl Page {
    fn open(site: &Site, session: &str, operator: &str) -> Self {
        let mut stream = Stream::open(site, session);
        let (keys, granted) = joined(&mut stream, operator);
        let (of_handle, of_server) = keys.split_at(32);
        let keys = Keys::new(of_handle.try_into().unwrap(), of_server.try_into().unwrap());
        let granted = serde_json::to_vec(&granted).unwrap();
        let pointer = Pointer::new(0, PointerSetup::default(), &granted, &keys).unwrap();
        stream
            .socket()
            .get_ref()
            .set_read_timeout(Some(TICK))
            .unwrap();
        Self {
            stream,
            pointer,
            path: MadePath::new(3).peekable(),
            began: Instant::now(),
            asked: false,
            awaited: 0,
        }
    }

    fn now_ns(&self) -> u64 {
        self.began.elapsed().as_nanos() as u64
    }

    /// Runs the loop, with the hand on its path where it `moves`, until something holds.
    fn run_until(&mut self, what: &str, moves: bool, mut holds: impl FnMut(&Self) -> bool) {
        let began = Instant::now();
        while !holds(self) {
            assert!(began.elapsed() < PATIENCE, "waited in vain: {what}");
            self.listen();
            let now_ns = self.now_ns();
            while let Some((at_ns, at_m)) = self.path.next_if(|(at_ns, _)| *at_ns <= now_ns) {
                let at_m = if moves { at_m } else { [0.0; 3] };
                self.pointer.handle_sample(now_ns, at_ns, at_m);
            }
            self.pointer.advance(now_ns);
            if let Some(message) = self.pointer.outgoing() {
                let message = Message::binary(message.to_vec());
                self.stream.socket().send(message).unwrap();
            }
            self.pointer.tidy();
            if let Some(wanted) = self.pointer.wanted().snapshot
                && !self.asked
            {
                self.asked = true;
                self.stream
                    .say(&json!({ "type": "snapshot", "epoch": wanted.epoch }));
            }
        }
    }

    fn listen(&mut self) {
        let now_ns = self.now_ns();
        let message = match self.stream.socket().read() {
            Err(Error::Io(_)) => return,
            message => message.unwrap(),
        };
        match message {
            Message::Text(text) => match serde_json::from_str(&text).unwrap() {
                ServerText::Snapshot { clay, messages } => {
                    let clay = serde_json::to_vec(&clay).unwrap();
                    self.pointer.begin_snapshot(&clay).unwrap();
                    self.awaited = messages;
                }
                ServerText::Problem { problem } => panic!("{problem:?}"),
                _ => {}
            },
            Message::Binary(bytes) if bytes[3] == 4 => {
                self.pointer.handle_frames(now_ns, &bytes).unwrap();
            }
            Message::Binary(bytes) => {
                self.pointer.handle_bricks(&bytes).unwrap();
                self.awaited -= 1;
                if self.awaited == 0 {
                    self.pointer.finish_snapshot().unwrap();
                    self.asked = false;
                }
            }
            _ => {}
        }
    }
}

#[test]
fn a_hand_on_a_socket_cuts_and_both_clays_are_equal_when_all_has_come() {
    let rig = shared();
    let site = rig.site();
    let session = replica(rig, &site, 1);
    let mut page = Page::open(&site, &session, "Ada");
    assert_eq!(state(&site, &session).tools[0].operator, "Ada");
    page.run_until("a copy", false, |page| {
        page.pointer.view().copy == CopyState::Live
    });
    page.pointer.hold();
    let removed = |page: &Page| {
        let copy = page.pointer.side().clay_copy().and_then(|end| end.copy());
        copy.map_or(0, |copy| copy.clay().removed_units())
    };
    page.run_until("a cut", true, |page| 2_000_000 < removed(page));
    assert!(0.1 < page.pointer.view().felt_force_n[0].abs());
    page.pointer.release();
    let equal = |page: &Page| {
        let clay = state(&site, &session).clay;
        0 < clay.removed_units
            && clay.removed_units == removed(page)
            && page.pointer.view().clay_hash == Some(clay.hash.0)
    };
    page.run_until("both clays to be equal", false, equal);
    let counts = *page.pointer.counts();
    assert_eq!(
        (counts.unheard, counts.undecodable, counts.foreign),
        (0, 0, 0)
    );
    assert_eq!(state(&site, &session).control_loop.unheard, 0);
    page.stream.leave();
    eventually("the tool to be free", || holder(&site, &session).is_empty());
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn frames_of_a_socket_without_the_lease_move_nothing() {
    let rig = shared();
    let site = rig.site();
    let session = replica(rig, &site, 2);
    let mut ada = Page::open(&site, &session, "Ada");
    ada.run_until("frames", false, |page| 100 < page.pointer.counts().sent);
    // The very next message of hers, which nobody has heard yet, by whoever has seen it.
    let message = loop {
        let now_ns = ada.now_ns();
        ada.pointer.advance(now_ns);
        if let Some(message) = ada.pointer.outgoing() {
            break message.to_vec();
        }
    };
    let mut stranger = Stream::open(&site, &session);
    stranger
        .socket()
        .send(Message::binary(message.clone()))
        .unwrap();
    stranger.catch_up();
    let before = state(&site, &session).control_loop.unheard;
    assert!(0 < before, "who holds no tool is not heard");
    let (_, granted) = joined(&mut stranger, "Eve");
    assert_eq!(granted.tool, 2);
    stranger
        .socket()
        .send(Message::binary(message.clone()))
        .unwrap();
    stranger.catch_up();
    let unheard = state(&site, &session).control_loop.unheard;
    assert!(
        before < unheard,
        "{before} {unheard}: under her lease it is Eve who is not heard"
    );
    // Hers twice: once is heard.
    ada.stream
        .socket()
        .send(Message::binary(message.clone()))
        .unwrap();
    ada.stream.socket().send(Message::binary(message)).unwrap();
    eventually("the second to be noticed", || {
        unheard < state(&site, &session).control_loop.unheard
    });
    // What is no message of frames is said to be none, once a second at most, and ends nothing.
    for nonsense in [&b""[..], b"no frames", &[0; 2000]] {
        let nonsense = Message::binary(nonsense.to_vec());
        stranger.socket().send(nonsense).unwrap();
    }
    assert_eq!(stranger.problem().kind, "/problems/syntax");
    stranger.catch_up();
    stranger.leave();
    ada.stream.leave();
    eventually("both tools to be free", || {
        state(&site, &session)
            .tools
            .iter()
            .all(|tool| tool.operator.is_empty())
    });
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn a_connection_that_breaks_frees_the_tool_and_so_does_a_second_join_of_the_same_socket() {
    let rig = shared();
    let site = rig.site();
    let session = replica(rig, &site, 1);
    let mut stream = Stream::open(&site, &session);
    let (_, first) = joined(&mut stream, "Ada");
    let (_, second) = joined(&mut stream, "Ada again");
    assert_ne!(first.lease, second.lease);
    assert_eq!(holder(&site, &session), "Ada again");
    stream.say(&json!({ "type": "leave" }));
    stream.until("an answer", |text| {
        (text == ServerText::Left {}).then_some(())
    });
    assert_eq!(holder(&site, &session), "");
    stream.say(&json!({ "type": "leave" }));
    assert_eq!(stream.problem().kind, "/problems/no-lease");
    joined(&mut stream, "Ada");
    // No close, no word.
    drop(stream);
    eventually("the tool to be free", || holder(&site, &session).is_empty());
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn a_stop_takes_every_tool_and_says_who_and_why_and_holds_until_it_is_cleared() {
    let rig = shared();
    let site = rig.site();
    let session = replica(rig, &site, 2);
    let path = |call: &str| format!("/api/v1/sessions/{session}/{call}");
    let (mut ada, mut bob) = (Stream::open(&site, &session), Stream::open(&site, &session));
    joined(&mut ada, "Ada");
    joined(&mut bob, "Bob");
    let stopped = site.post(
        &path("stop"),
        &json!({ "operator": "Cy", "reason": "a hand is in it" }),
    );
    let stopped: Session = stopped.json();
    assert_eq!(stopped.state, SessionState::Stopped);
    assert_eq!(stopped.stop.unwrap().by, "Cy");
    for stream in [&mut ada, &mut bob] {
        assert_eq!(
            farewell(stream),
            "Cy has stopped the session: a hand is in it"
        );
    }
    let (code, reason, by) = refused(&mut ada, "Ada");
    assert_eq!((code, by.as_deref()), (RefusalCode::Stopped, Some("Cy")));
    assert!(
        reason.ends_with("stopped by Cy: a hand is in it"),
        "{reason}"
    );
    // A second one changes no word of the first; none is refused for its body.
    let long = format!(r#"{{"reason": "{}"}}"#, "a".repeat(100_000));
    for body in ["", "{", r#"{"reason": 3}"#, r#"{"strange": true}"#, &long] {
        let ask = Ask::new("POST", &path("stop")).json(body);
        let answer = site.send(&ask);
        assert_eq!(answer.status, 200, "{body}: {answer:?}");
        let session: Session = answer.json();
        assert_eq!(session.stop.unwrap().reason, "a hand is in it");
    }
    bob.say(&json!({ "type": "clear_stop", "operator": "Bob" }));
    done(&mut bob);
    assert_eq!(state(&site, &session).stop, None);
    assert_eq!(holder(&site, &session), "", "nobody gets a tool back by it");
    assert_eq!(
        site.send(&Ask::new("POST", &path("stop/clear"))).word(),
        "not-stopped"
    );
    // Whoever holds a tool stops under the name that the tool is held by.
    joined(&mut ada, "Ada");
    ada.say(&json!({ "type": "stop", "operator": "Somebody else", "reason": "enough" }));
    done(&mut ada);
    let stop = state(&site, &session).stop.unwrap();
    assert_eq!((&*stop.by, &*stop.reason), ("Ada", "enough"));
    site.delete(&format!("/api/v1/sessions/{session}"));
}

/// A stop that comes as a lease is granted takes it away before there is a line to say so on.
#[test]
fn whoever_is_stopped_while_joining_is_told_so_too() {
    let rig = shared();
    let site = rig.site();
    let session = replica(rig, &site, 1);
    let (mut ada, mut eve) = (Stream::open(&site, &session), Stream::open(&site, &session));
    let (mut granted, mut refused) = (0, 0);
    for round_trips in 0..60 {
        join(&mut ada, "Ada");
        // The stop comes a little later each time: before the lease, with it, after it.
        for _ in 0..round_trips {
            eve.catch_up();
        }
        eve.say(&json!({ "type": "stop", "operator": "Eve", "reason": "now" }));
        done(&mut eve);
        let is_granted = ada.until("an answer", |text| match text {
            ServerText::Granted { .. } => Some(true),
            ServerText::Refused { .. } => Some(false),
            _ => None,
        });
        if is_granted {
            granted += 1;
            assert_eq!(farewell(&mut ada), "Eve has stopped the session: now");
        } else {
            refused += 1;
        }
        eve.say(&json!({ "type": "clear_stop" }));
        done(&mut eve);
    }
    println!("{granted} joins were granted, {refused} refused");
    assert!(0 < granted, "none of these joins came before its stop");
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn a_stop_waits_for_nothing_else_that_was_asked_on_its_socket() {
    let rig = shared();
    let site = rig.site();
    let session = replica(rig, &site, 1);
    let path = format!("/api/v1/sessions/{session}");
    let mut ada = Stream::open(&site, &session);
    // A block that takes a while to make, ten times.
    let big = json!({ "kind": "block", "size_m": [0.4, 0.4, 0.4] });
    for _ in 0..10 {
        ada.say(&json!({ "type": "reset", "clay": { "shape": big } }));
    }
    let asked = Instant::now();
    ada.say(&json!({ "type": "stop", "operator": "Ada", "reason": "too slow" }));
    eventually("the stop", || {
        let session: Session = site.get(&path).json();
        session.stop.is_some()
    });
    let stopped_s = asked.elapsed().as_secs_f64();
    ada.state(|session| 10 < session.clay.epoch);
    let made_s = asked.elapsed().as_secs_f64();
    println!("stopped after {stopped_s:.3} s, ten blocks made after {made_s:.3} s");
    assert!(stopped_s < made_s / 2.0);
    site.delete(&path);
}

#[test]
fn a_hand_that_reads_nothing_can_stop_and_is_heard() {
    let rig = shared();
    let site = rig.site();
    let session = replica(rig, &site, 1);
    let path = format!("/api/v1/sessions/{session}");
    let mut ada = Page::open(&site, &session, "Ada");
    // So much is asked for, and never read, that the way down is full.
    ada.stream.subscribe("on", "on");
    let (began, mut was_connected) = (Instant::now(), false);
    while began.elapsed() < Duration::from_secs(3) {
        let now_ns = ada.now_ns();
        if ada.pointer.next_ns() <= now_ns {
            ada.pointer.advance(now_ns);
            if let Some(message) = ada.pointer.outgoing() {
                let message = Message::binary(message.to_vec());
                ada.stream.socket().send(message).unwrap();
            }
        }
        let is_connected = state(&site, &session).tools[0].connected;
        was_connected |= is_connected;
        assert!(
            is_connected || !was_connected,
            "whoever reads nothing is heard"
        );
    }
    assert!(was_connected);
    ada.stream
        .say(&json!({ "type": "stop", "reason": "I cannot see" }));
    eventually("the stop", || {
        let session: Session = site.get(&path).json();
        session.stop.is_some_and(|stop| stop.by == "Ada")
    });
    site.delete(&path);
}

#[test]
fn a_tool_is_asked_for_denied_granted_and_kept_for_whoever_it_was_granted_to() {
    let rig = shared();
    let site = rig.site();
    let session = replica(rig, &site, 1);
    let path = |call: &str| format!("/api/v1/sessions/{session}/tools/{call}");
    let mut streams = [0; 3].map(|_| Stream::open(&site, &session));
    let [ada, bob, eve] = &mut streams;
    joined(ada, "Ada");
    let (code, reason, by) = refused(bob, "Bob");
    assert_eq!(
        (code, by.as_deref()),
        (RefusalCode::NoFreeTool, Some("Ada"))
    );
    assert!(reason.ends_with("are held, by Ada"), "{reason}");
    bob.say(&json!({ "type": "request", "tool": 1, "operator": "Bob" }));
    done(bob);
    assert_eq!(state(&site, &session).tools[0].requests, ["Bob"]);
    let again = site.post(&path("1/request"), &json!({ "operator": "Bob" }));
    assert_eq!((again.status, &*again.word()), (409, "control"));
    let denied = site.post(
        &path("1/deny"),
        &json!({ "operator": "Bob", "reason": "in a moment" }),
    );
    assert_eq!(denied.status, 200, "{denied:?}");
    assert!(state(&site, &session).tools[0].requests.is_empty());
    let not_asked = site.post(&path("1/grant"), &json!({ "operator": "Bob" }));
    assert_eq!((not_asked.status, &*not_asked.word()), (409, "control"));
    assert_eq!(
        site.post(&path("1/request"), &json!({ "operator": "Bob" }))
            .status,
        200
    );
    // Whoever has asked first is meant where nobody is named.
    assert_eq!(site.send(&Ask::new("POST", &path("1/deny"))).status, 200);
    let nobody = site.send(&Ask::new("POST", &path("1/grant")));
    assert_eq!((nobody.status, &*nobody.word()), (409, "control"));
    assert_eq!(
        site.post(&path("1/request"), &json!({ "operator": "Bob" }))
            .status,
        200
    );
    ada.say(&json!({ "type": "grant", "tool": 1, "operator": "Bob" }));
    assert_eq!(farewell(ada), "the tool was handed over to Bob");
    let (code, _, by) = refused(eve, "Eve");
    assert_eq!((code, by.as_deref()), (RefusalCode::Reserved, Some("Bob")));
    joined(bob, "Bob");
    assert_eq!(site.post(&path("1/release"), &json!({})).status, 200);
    assert_eq!(farewell(bob), "the tool was taken away");
    for (tool, status, word) in [
        ("2", 404, "no-such-tool"),
        ("x", 404, "no-such-tool"),
        ("1", 409, "control"),
    ] {
        let answer = site.post(&path(&format!("{tool}/release")), &json!({}));
        assert_eq!((answer.status, &*answer.word()), (status, word), "{tool}");
    }
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn an_operator_by_invite_decides_about_the_own_tool_and_a_spectator_about_nothing() {
    let open = shared().site();
    let session = replica(shared(), &open, 2);
    let guests = Guests::of(&session);
    let site = guests.site();
    let [mut spectator, mut operator, mut admin] =
        [0, 1, 2].map(|role| Stream::open_with(&guests.tokens[role], &site, &session));
    assert_eq!(refused(&mut spectator, "Sam").0, RefusalCode::NotAllowed);
    for asked in [
        json!({ "type": "stop" }),
        json!({ "type": "clear_stop" }),
        json!({ "type": "request", "tool": 1, "operator": "Sam" }),
        json!({ "type": "release", "tool": 1 }),
    ] {
        spectator.say(&asked);
        assert_eq!(spectator.problem().status, 403, "{asked}");
    }
    // A better token may come with the join; a worse one is told.
    spectator
        .say(&json!({ "type": "join", "operator": "Sam", "device": device(), "token": "no such" }));
    let code = spectator.until("a refusal", |text| match text {
        ServerText::Refused { code, .. } => Some(code),
        _ => None,
    });
    assert_eq!(code, RefusalCode::TokenRejected);
    // Whoever joins with a better one may do what that one is for, as long as the lease lasts.
    spectator.say(&json!({
        "type": "join", "operator": "Sam", "device": device(), "token": guests.tokens[1],
    }));
    spectator.until("a lease", |text| {
        matches!(text, ServerText::Granted { .. }).then_some(())
    });
    spectator.say(&json!({ "type": "stop" }));
    assert_eq!(
        farewell(&mut spectator),
        "Sam has stopped the session: no reason given"
    );
    assert_eq!(state(&open, &session).stop.unwrap().by, "Sam");
    spectator.say(&json!({ "type": "clear_stop" }));
    assert_eq!(spectator.problem().status, 403, "the lease is over");
    admin.say(&json!({ "type": "clear_stop" }));
    done(&mut admin);
    joined(&mut admin, "Ada");
    joined(&mut operator, "Bob");
    operator.say(&json!({ "type": "release", "tool": 1 }));
    assert_eq!(operator.problem().status, 403);
    let call = |token: &str, path: &str| {
        let ask = Ask::new("POST", &format!("/api/v1/sessions/{session}/{path}"));
        let ask = ask
            .with("Authorization", &format!("Bearer {token}"))
            .json("{}");
        site.send(&ask).status
    };
    let [spectators, operators, admins] = &guests.tokens[..] else {
        panic!("three were made");
    };
    assert_eq!(call(operators, "tools/1/release"), 403);
    assert_eq!(call(spectators, "stop"), 403);
    assert_eq!(call(operators, "tools/2/release"), 200);
    assert_eq!(farewell(&mut operator), "the tool was taken away");
    assert_eq!(call(admins, "tools/1/release"), 200);
    assert_eq!(call(operators, "stop"), 200);
    assert_eq!(call(operators, "stop/clear"), 200);
    open.delete(&format!("/api/v1/sessions/{session}"));
    std::fs::remove_dir_all(&guests.data).unwrap();
}
