//! `/foxglove`, as a client of that protocol meets it.

use std::time::SystemTime;

use serde_json::{Value, json};
use teleclay_foxglove::SUBPROTOCOLS;
use teleclay_foxglove::server::ServerText;
use teleclay_proto::http::{Session, SessionState};
use teleclay_proto::invite::InviteToken;
use teleclay_ros::from_cdr;
use teleclay_ros::own::{Event, SetSchemeRequest, SetSchemeResponse, Settings};
use teleclay_ros::standard::{
    DiagnosticArray, SetBoolRequest, SetBoolResponse, TfMessage, TriggerRequest, WrenchStamped,
};
use tokio_tungstenite::tungstenite::Message;

use crate::guard::Guests;
use crate::hand::joined;
use crate::rig::{Rig, eventually, shared, small};
use crate::stream::Stream;
use crate::visitor::{Client, PATH};
use crate::wire::{Answer, Ask, Site};

fn refused(site: &Site, path: &str, headers: &[(&str, &str)]) -> Answer {
    let defaults = [
        ("Connection", "Upgrade"),
        ("Upgrade", "websocket"),
        ("Sec-WebSocket-Version", "13"),
        ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
    ];
    let ask = defaults
        .iter()
        .chain(headers)
        .fold(Ask::new("GET", path), |ask, (name, value)| {
            ask.with(name, value)
        });
    site.send(&ask)
}

fn tool_topic(session: &str, topic: &str) -> String {
    format!("/teleclay/{session}/tool_1/{topic}")
}

fn state(site: &Site, session: &str) -> Session {
    site.get(&format!("/api/v1/sessions/{session}")).json()
}

fn now_ns() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.unwrap().as_nanos() as u64
}

#[test]
fn either_name_of_the_protocol_is_spoken_and_no_other() {
    let site = shared().site();
    for name in SUBPROTOCOLS {
        let mut client = Client::offering(&format!("teleclay.v1, {name}"), PATH, &site);
        assert_eq!(client.protocol, name);
        client.until("the server's words", |client| client.info.clone());
        let Some(ServerText::ServerInfo {
            capabilities,
            supported_encodings,
            ..
        }) = client.info
        else {
            panic!()
        };
        assert!(
            capabilities.contains(&"services".to_owned()),
            "{capabilities:?}"
        );
        assert_eq!(supported_encodings, ["cdr"]);
    }
    let other = refused(&site, PATH, &[("Sec-WebSocket-Protocol", "teleclay.v1")]);
    assert_eq!((other.status, &*other.word()), (400, "subprotocol"));
    assert_eq!(site.get(PATH).status, 426);
    for (rate, words) in [("0", "above 0"), ("1000", "250"), ("fast", "rate_hz")] {
        let path = format!("{PATH}?rate_hz={rate}");
        let answer = refused(&site, &path, &[("Sec-WebSocket-Protocol", SUBPROTOCOLS[0])]);
        assert_eq!(answer.status, 422);
        assert!(answer.text().contains(words), "{answer:?}");
    }
}

#[test]
fn origins_and_tokens_are_looked_at_as_for_a_stream() {
    let open = shared().site();
    let speaks = ("Sec-WebSocket-Protocol", SUBPROTOCOLS[1]);
    let evil = refused(&open, PATH, &[speaks, ("Origin", "https://evil.example")]);
    assert_eq!((evil.status, &*evil.word()), (403, "origin"));
    let session = shared().session(&open);
    let guests = Guests::of(&session);
    let site = guests.site();
    let none = refused(&site, PATH, &[speaks]);
    assert_eq!((none.status, &*none.word()), (401, "token"));
    let offered = format!("{}, bearer.{}", SUBPROTOCOLS[1], guests.tokens[0]);
    Client::offering(&offered, PATH, &site).until_session(&session);
}

#[test]
fn sessions_are_offered_with_their_schemas_as_they_come_and_go() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut client = Client::open(&site);
    client.until_session(&session);
    let wrench = client
        .channel(&tool_topic(&session, "felt_wrench"))
        .unwrap();
    let channel = &client.channels[&wrench];
    assert_eq!(
        (
            &*channel.encoding,
            &*channel.schema_encoding,
            &*channel.schema_name
        ),
        ("cdr", "ros2msg", "geometry_msgs/msg/WrenchStamped")
    );
    assert!(
        channel.schema.contains("MSG: geometry_msgs/Wrench"),
        "{}",
        channel.schema
    );
    assert!(client.channel("/tf").is_some() && client.channel("/diagnostics").is_some());
    assert!(
        client
            .channels
            .values()
            .all(|channel| !channel.schema.is_empty())
    );
    let later = rig.session(&site);
    client.until_session(&later);
    let subscription = client.subscribe(&format!("/teleclay/{later}/settings"));
    client.message(subscription);
    site.delete(&format!("/api/v1/sessions/{later}"));
    client.until("the session to go", |client| {
        client
            .channel(&format!("/teleclay/{later}/settings"))
            .is_none()
            .then_some(())
    });
    assert_eq!(
        client.channel(&tool_topic(&session, "felt_wrench")),
        Some(wrench)
    );
    client.until("its services to go", |client| {
        let pause = format!("/teleclay/{later}/pause");
        (!client.has_service(&pause)).then_some(())
    });
}

/// Two topics, two rates, counted over the stamps of two seconds, so that a busy machine does not matter.
#[test]
fn samples_come_at_the_rate_that_was_asked_for() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut hand = Stream::open(&site, &session);
    joined(&mut hand, "Ada");
    let mut client = Client::offering(SUBPROTOCOLS[0], "/foxglove?rate_hz=20", &site);
    client.until_session(&session);
    let pose = tool_topic(&session, "tool_pose");
    let name = format!("teleclay.rate_hz.{pose}");
    client.say(&json!({ "op": "setParameters", "parameters": [{ "name": name, "value": 50 }], "id": "set" }));
    let slow = client.subscribe(&tool_topic(&session, "felt_wrench"));
    let fast = client.subscribe(&pose);
    for (subscription, hz) in [(slow, 20_u64), (fast, 50)] {
        let times_ns: Vec<u64> = (0..=2 * hz)
            .map(|_| client.message(subscription).0)
            .collect();
        let took_ns = times_ns.last().unwrap() - times_ns[0];
        assert!(
            (1_950_000_000..2_100_000_000).contains(&took_ns),
            "{} samples at {hz} Hz took {took_ns} ns",
            2 * hz
        );
    }
    let Some(ServerText::ParameterValues { parameters, id }) = client.texts.first() else {
        panic!("{:?}", client.texts)
    };
    assert_eq!(
        (id.as_deref(), &parameters[0].value),
        (Some("set"), &Some(json!(50.0)))
    );
}

#[test]
fn a_wrench_a_frame_and_a_diagnosis_say_what_they_are_of() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut hand = Stream::open(&site, &session);
    joined(&mut hand, "Ada");
    let mut client = Client::open(&site);
    client.until_session(&session);
    let wrench = client.subscribe(&tool_topic(&session, "tool_wrench"));
    let (time_ns, bytes) = client.message(wrench);
    let read: WrenchStamped<'_> = from_cdr(&bytes).unwrap();
    assert_eq!(read.header.frame_id, format!("teleclay/{session}/tool_1"));
    assert!(now_ns().abs_diff(time_ns) < 5_000_000_000, "{time_ns}");
    let stamp = &read.header.stamp;
    assert_eq!(
        stamp.sec as u64 * 1_000_000_000 + u64::from(stamp.nanosec),
        time_ns
    );
    let tf = client.subscribe("/tf");
    let home_m = state(&site, &session).tools[0].home_m;
    let own = format!("teleclay/{session}/handle_1");
    loop {
        let (_, bytes) = client.message(tf);
        let read: TfMessage<'_> = from_cdr(&bytes).unwrap();
        let handle = read
            .transforms
            .iter()
            .find(|transform| transform.child_frame_id == own);
        if let Some(handle) = handle {
            let at = &handle.transform.translation;
            let bits = |at_m: [f64; 3]| at_m.map(f64::to_bits);
            assert_eq!(bits([at.x, at.y, at.z]), bits(home_m));
            break;
        }
    }
    let diagnostics = client.subscribe("/diagnostics");
    let (_, bytes) = client.message(diagnostics);
    let read: DiagnosticArray<'_> = from_cdr(&bytes).unwrap();
    let name = format!("teleclay: session {session}");
    assert!(
        read.status.iter().any(|status| status.name == name),
        "{read:?}"
    );
    assert!(
        read.status
            .iter()
            .any(|status| status.name == "teleclay: loop"),
        "{read:?}"
    );
}

#[test]
fn what_changes_and_happens_is_told_to_whoever_asks_and_the_latest_at_once() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let path = format!("/api/v1/sessions/{session}");
    let mut client = Client::open(&site);
    client.until_session(&session);
    let settings = client.subscribe(&format!("/teleclay/{session}/settings"));
    let events = client.subscribe(&format!("/teleclay/{session}/events"));
    let told = |bytes: &[u8]| -> Value {
        let read: Settings<'_> = from_cdr(bytes).unwrap();
        serde_json::from_str(read.json).unwrap()
    };
    let (_, bytes) = client.message(settings);
    assert_eq!(told(&bytes)["spec"]["scheme"], "force_exchange");
    site.patch(&path, &json!({ "scheme": "wave" }));
    let (_, bytes) = client.message(settings);
    assert_eq!(told(&bytes)["spec"]["scheme"], "wave");
    site.post(&format!("{path}/stop"), &json!({ "reason": "a test" }));
    let (_, bytes) = client.message(events);
    let read: Event<'_> = from_cdr(&bytes).unwrap();
    assert_eq!(read.level, Event::WARNING);
    assert!(
        read.text.contains("has stopped the session: a test"),
        "{}",
        read.text
    );
    client.say(&json!({ "op": "getParameters", "parameterNames": [], "id": "all" }));
    let shown = format!("teleclay.session.{session}.stopped_by");
    client.until("who has stopped it", |client| {
        client.say(&json!({ "op": "getParameters", "parameterNames": [&shown], "id": "q" }));
        let told = client.texts.pop()?;
        let ServerText::ParameterValues { parameters, .. } = told else {
            panic!("{told:?}")
        };
        let mut parameters = parameters.iter();
        parameters
            .any(|one| one.name == shown && one.value != Some(json!("")))
            .then_some(())
    });
}

#[test]
fn services_do_what_the_calls_of_the_interface_do() {
    let rig = shared();
    let site = rig.site();
    let session = rig.session(&site);
    let mut client = Client::open(&site);
    client.until_session(&session);
    let service = |name: &str| format!("/teleclay/{session}/{name}");
    for paused in [true, false] {
        let response = client
            .call(&service("pause"), &SetBoolRequest { data: paused })
            .unwrap();
        let response: SetBoolResponse<'_> = from_cdr(&response).unwrap();
        assert!(response.success, "{}", response.message);
        assert_eq!(state(&site, &session).state == SessionState::Paused, paused);
    }
    let before = state(&site, &session).clay.epoch;
    client
        .call(&service("reset_clay"), &TriggerRequest)
        .unwrap();
    eventually("a fresh block", || {
        state(&site, &session).clay.epoch == before + 1
    });
    let response = client
        .call(&service("set_scheme"), &SetSchemeRequest { scheme: "tdpa" })
        .unwrap();
    assert!(
        from_cdr::<SetSchemeResponse<'_>>(&response)
            .unwrap()
            .success
    );
    assert_eq!(state(&site, &session).scheme.word(), "tdpa");
    let response = client
        .call(
            &service("set_scheme"),
            &SetSchemeRequest { scheme: "magic" },
        )
        .unwrap();
    let response: SetSchemeResponse<'_> = from_cdr(&response).unwrap();
    assert!(
        !response.success && response.message.contains("`magic`"),
        "{}",
        response.message
    );
    assert_eq!(state(&site, &session).scheme.word(), "tdpa");
}

#[test]
fn a_guest_sees_one_session_and_only_an_admin_changes_it() {
    let open = shared().site();
    let session = shared().session(&open);
    let other = shared().session(&open);
    let guests = Guests::of(&session);
    let site = guests.site();
    let [spectator, operator, admin] = [0, 1, 2].map(|role| {
        let offered = format!("{}, bearer.{}", SUBPROTOCOLS[0], guests.tokens[role]);
        let mut client = Client::offering(&offered, PATH, &site);
        client.until_session(&session);
        assert!(
            !client
                .channels
                .values()
                .any(|channel| channel.topic.contains(&other))
        );
        client
    });
    let pause = format!("/teleclay/{session}/pause");
    for (mut client, role) in [(spectator, "spectator"), (operator, "operator")] {
        let said = client
            .call(&pause, &SetBoolRequest { data: true })
            .unwrap_err();
        assert!(said.contains("admin") && said.contains(role), "{said}");
        let reset = format!("/teleclay/{session}/reset_clay");
        assert!(client.call(&reset, &TriggerRequest).is_err());
        assert_ne!(state(&open, &session).state, SessionState::Paused);
    }
    let mut admin = admin;
    admin.call(&pause, &SetBoolRequest { data: true }).unwrap();
    assert_eq!(state(&open, &session).state, SessionState::Paused);
    let id = guests.tokens[2].parse::<InviteToken>().unwrap().id();
    guests.invites.revoke(SystemTime::now(), id).unwrap();
    assert_eq!(admin.ending(), 4403);
}

/// One client reads nothing for a while. The loop ticks on, another client is served, and the one that comes back gets
/// every event, and of the samples those of the last second or two.
#[test]
fn a_client_that_stalls_costs_nobody_anything_and_is_not_flooded_afterwards() {
    let rig = Rig::start();
    let site = rig.site();
    let session = "stalled";
    assert_eq!(site.post("/api/v1/sessions", &small(session)).status, 201);
    let path = format!("/api/v1/sessions/{session}");
    let [mut stalled, mut reading] = [0, 1].map(|_| {
        let mut client = Client::offering(SUBPROTOCOLS[0], "/foxglove?rate_hz=250", &site);
        client.until_session(session);
        client
    });
    let of_stalled = stalled.subscribe(&tool_topic(session, "felt_wrench"));
    let events = stalled.subscribe(&format!("/teleclay/{session}/events"));
    let of_reading = reading.subscribe(&tool_topic(session, "felt_wrench"));
    // A lease without frames lasts ten seconds, which is enough.
    let mut hand = Stream::open(&site, session);
    joined(&mut hand, "Ada");
    stalled.message(of_stalled);
    let before = state(&site, session).control_loop.ticks;
    let (first_ns, _) = reading.message(of_reading);
    // A machine that is busy with other tests may leave some out; one that waits for the stalled one would have none.
    let mut resets = 0;
    let (mut last_ns, mut count) = (first_ns, 1);
    while last_ns - first_ns < 3_000_000_000 {
        if u128::from(last_ns - first_ns) / 1_000_000_000 == resets {
            site.post(&format!("{path}/clay/reset"), &json!({}));
            resets += 1;
        }
        last_ns = reading.message(of_reading).0;
        count += 1;
    }
    assert!(
        (500..=760).contains(&count),
        "{count} samples in three seconds"
    );
    let ticks = state(&site, session).control_loop.ticks - before;
    assert!((2500..7000).contains(&ticks), "{ticks}");
    // It reads again: what had been sent before it was noticed, then what is new.
    let resumed_ns = now_ns();
    let mut old = 0;
    loop {
        let (time_ns, _) = stalled.message(of_stalled);
        if resumed_ns < time_ns {
            break;
        }
        old += 1;
    }
    assert!(old < 2 * 250, "{old} old samples");
    for reset in 0..resets {
        let (_, bytes) = stalled.message(events);
        let read: Event<'_> = from_cdr(&bytes).unwrap();
        assert!(read.text.contains("fresh block"), "{reset}: {}", read.text);
    }
}

#[test]
fn clients_count_as_streams_do_and_end_in_words() {
    let rig = Rig::start();
    let site = rig.site();
    let shown = || site.get("/metrics").text().to_owned();
    let mut client = Client::open(&site);
    client.until("the server's words", |client| client.info.clone());
    assert!(
        shown().contains("teleclay_foxglove_clients 1"),
        "{}",
        shown()
    );
    client
        .socket
        .send(Message::text("{\"op\":\"dance\"}"))
        .unwrap();
    assert!(client.status().contains("not understood"));
    client
        .socket
        .send(Message::text(" ".repeat(20_000)))
        .unwrap();
    assert_eq!(client.ending(), 1009);
    eventually("the client to be gone", || {
        shown().contains("teleclay_foxglove_clients 0")
    });
    let clients: Vec<Client> = (0..64).map(|_| Client::open(&site)).collect();
    let full = refused(&site, PATH, &[("Sec-WebSocket-Protocol", SUBPROTOCOLS[0])]);
    assert_eq!((full.status, &*full.word()), (503, "too-many-watchers"));
    drop(clients);
}
