//! Somebody else on the network, who knows every key and can send whatever they like, but not the token.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::json;
use teleclay_channel::{Asking, Challenge, Context, Secret, TRAILER};
use teleclay_proto::frame::{HandleFrame, MAX_FRAME, ToolFrame};
use teleclay_proto::join::{ChallengeReply, RefusalCode, SealedReply};
use teleclay_proto::keys::{SessionKeys, everything_in};
use teleclay_proto::{RealmName, Scheme, SessionId};
use teleclay_shell::network::{CONTROL_QOS, Endpoints, open};
use teleclay_tests::process::PATIENCE;
use teleclay_tests::recording::{Row, greatest_force_step_n};
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Ports, Server, TOKEN};
use zenoh::pubsub::Publisher;
use zenoh::query::{ConsolidationMode, Query, QueryTarget};
use zenoh::{Session, Wait};

use super::endings::{FORCE_STEP_N, cuts};

pub(super) fn keys() -> SessionKeys {
    let realm = RealmName::new("local").unwrap();
    SessionKeys::new(realm, SessionId::new(DEMO).unwrap())
}

/// As a client of the server's, which passes on between its clients and its peers; handles are peers.
pub(super) async fn connected_to(endpoint: &str) -> Session {
    let mut config = zenoh::Config::default();
    let connect = format!("[\"{endpoint}\"]");
    for (key, value) in [
        ("mode", "\"client\""),
        ("scouting/multicast/enabled", "false"),
        ("connect/endpoints", &connect),
    ] {
        config.insert_json5(key, value).unwrap();
    }
    zenoh::open(config).await.unwrap()
}

pub(super) fn ada(server: &Server) -> HandleOptions {
    HandleOptions::new(&server.endpoint()).with(&["--token", TOKEN])
}

/// Somebody in between, whom a handle takes for the server: frames and questions pass through them, and they add what
/// they like, on either side.
struct Between {
    /// Where the handle is.
    inside: Session,
    /// Where the server is.
    outside: Session,
    endpoint: String,
}

impl Between {
    async fn of(server: &Server) -> Self {
        let endpoint = format!("tcp/127.0.0.1:{}", Ports::free().unwrap().zenoh);
        let listening = Endpoints::listening(endpoint.parse().unwrap());
        let inside = open(&listening).await.unwrap();
        let outside = connected_to(&server.endpoint()).await;
        pass_on(&inside, keys().tool_up(1), &outside).await;
        pass_on(&outside, keys().tool_down(1), &inside).await;
        let asks = outside.clone();
        let runtime = tokio::runtime::Handle::current();
        inside
            .declare_queryable(everything_in(keys().realm()))
            .callback(move |query| {
                let asks = asks.clone();
                runtime.spawn(async move {
                    let key = query.key_expr().as_str().to_owned();
                    for answer in ask(&asks, key.clone(), bytes(&query)).await {
                        // Whoever asked may have gone.
                        let _ = query.reply(&key, answer).await;
                    }
                });
            })
            .background()
            .await
            .unwrap();
        Self {
            inside,
            outside,
            endpoint,
        }
    }

    /// Ada, who was sent the wrong way.
    fn ada(&self) -> HandleOptions {
        HandleOptions::new(&self.endpoint).with(&["--token", TOKEN])
    }
}

/// Puts what comes on `key` of one session on the same key of another.
async fn pass_on(from: &Session, key: String, to: &Session) {
    let publisher = publisher(to, key.clone()).await;
    from.declare_subscriber(key)
        .callback(move |sample| {
            let payload = sample.payload().to_bytes().into_owned();
            publisher.put(payload).wait().unwrap();
        })
        .background()
        .await
        .unwrap();
}

async fn publisher(session: &Session, key: String) -> Publisher<'static> {
    let (congestion, priority, express, reliability) = CONTROL_QOS;
    session
        .declare_publisher(key)
        .congestion_control(congestion)
        .priority(priority)
        .express(express)
        .reliability(reliability)
        .await
        .unwrap()
}

/// Every payload that a stranger gets to see.
type Seen = Arc<Mutex<Vec<Vec<u8>>>>;

fn shows(seen: &Seen, secret: &[u8]) -> bool {
    let seen = seen.lock().unwrap();
    let mut messages = seen.iter();
    messages.any(|message| message.windows(secret.len()).any(|part| part == secret))
}

/// Answers whoever asks for a challenge or a lease, as a server of theirs would, and never lets a question end.
async fn pose_as_the_server(stranger: &Session, seen: &Seen) {
    let held: Arc<Mutex<Vec<Query>>> = Arc::default();
    let (saw, holds) = (Arc::clone(seen), Arc::clone(&held));
    stranger
        .declare_queryable(keys().challenge())
        .callback(move |query| {
            let own = ChallengeReply::Given {
                challenge: [9; 32],
                needs_token: false,
            };
            let refused = ChallengeReply::Refused {
                code: RefusalCode::NoSuchSession,
                reason: "there is no such session".to_owned(),
            };
            for reply in [refused, own] {
                let reply = serde_json::to_vec(&reply).unwrap();
                query.reply(keys().challenge(), reply).wait().unwrap();
            }
            saw.lock().unwrap().push(bytes(&query));
            holds.lock().unwrap().push(query);
        })
        .background()
        .await
        .unwrap();
    let saw = Arc::clone(seen);
    stranger
        .declare_queryable(keys().join())
        .callback(move |query| {
            let challenge = Challenge::from_bytes([9; 32]);
            let key = keys().join();
            let context = Context {
                key: &key,
                challenge: &challenge,
            };
            let (_, first) = Asking::begin(&Secret::none(), context, b"");
            let rejected = SealedReply::Refused {
                code: RefusalCode::TokenRejected,
                reason: "the token is not the server's".to_owned(),
            };
            let messages = [first, vec![0; 48], vec![7; 2000]];
            let answers = messages.map(|message| SealedReply::Answered { message });
            for reply in answers.iter().chain([&rejected]) {
                let reply = serde_json::to_vec(reply).unwrap();
                query.reply(keys().join(), reply).wait().unwrap();
            }
            saw.lock().unwrap().push(bytes(&query));
            held.lock().unwrap().push(query);
        })
        .background()
        .await
        .unwrap();
}

fn bytes(query: &Query) -> Vec<u8> {
    query
        .payload()
        .map_or(Vec::new(), |payload| payload.to_bytes().into_owned())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stranger_who_answers_first_is_neither_joined_nor_told_the_token() {
    let server = Server::with_token().unwrap();
    let between = Between::of(&server).await;
    let seen = Seen::default();
    pose_as_the_server(&between.inside, &seen).await;

    let mut handle = Handle::start(&between.ada()).unwrap();
    let client = &server.client;
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    let status = handle
        .status_when("a word of it", PATIENCE, |status| status["state"] == "live")
        .unwrap();
    assert_eq!(status["joins"], 1);
    assert!(handle.process.end().unwrap().success());

    assert!(
        2 <= seen.lock().unwrap().len(),
        "the stranger was asked, too"
    );
    assert!(!shows(&seen, TOKEN.as_bytes()));
    assert!(
        !shows(&seen, b"Ada"),
        "who asks is the server's business alone"
    );
}

/// What a stranger would like hand and tool to believe.
struct Lies {
    between: Between,
    /// Frames that were overheard, as they crossed: up, down.
    overheard: [Seen; 2],
}

impl Lies {
    async fn listening(between: Between) -> Self {
        let overheard = [Seen::default(), Seen::default()];
        for (key, seen) in [keys().tool_up(1), keys().tool_down(1)]
            .into_iter()
            .zip(&overheard)
        {
            let saw = Arc::clone(seen);
            let comes_from = if key.ends_with("/up") {
                &between.inside
            } else {
                &between.outside
            };
            comes_from
                .declare_subscriber(key)
                .callback(move |sample| {
                    let mut saw = saw.lock().unwrap();
                    if saw.len() < 500 {
                        saw.push(sample.payload().to_bytes().into_owned());
                    }
                })
                .background()
                .await
                .unwrap();
        }
        Self { between, overheard }
    }

    /// Sends lies both ways for `lasts`; gives how many.
    async fn tell(&self, lasts: Duration) -> usize {
        let [up, down] = self
            .overheard
            .clone()
            .map(|seen| seen.lock().unwrap().clone());
        assert!(!up.is_empty() && !down.is_empty(), "nothing was overheard");
        let up: Vec<Vec<u8>> = up.iter().flat_map(|frame| lies_up(frame)).collect();
        let down: Vec<Vec<u8>> = down.iter().flat_map(|frame| lies_down(frame)).collect();
        let Between {
            inside, outside, ..
        } = &self.between;
        let publishers = [
            publisher(outside, keys().tool_up(1)).await,
            publisher(inside, keys().tool_down(1)).await,
        ];
        let (began, mut told) = (Instant::now(), 0);
        while began.elapsed() < lasts {
            for (publisher, lies) in publishers.iter().zip([&up, &down]) {
                publisher.put(&lies[told % lies.len()][..]).await.unwrap();
            }
            told += 1;
            // Two thousand a second, twice what is true.
            let due = Duration::from_micros(500) * told as u32;
            tokio::time::sleep(due.saturating_sub(began.elapsed())).await;
        }
        2 * told
    }
}

/// The frame again; with its own trailer under another content; with a trailer of one's own; without one.
fn sealed_somehow(overheard: &[u8], lie: &[u8]) -> [Vec<u8>; 4] {
    let trailer = &overheard[overheard.len() - TRAILER..];
    [
        overheard.to_vec(),
        [lie, trailer].concat(),
        [lie, &[0x5a; TRAILER]].concat(),
        lie.to_vec(),
    ]
}

fn lies_down(overheard: &[u8]) -> Vec<Vec<u8>> {
    let mut buffer = [0; MAX_FRAME];
    let mut frame = ToolFrame::decode(&overheard[..overheard.len() - TRAILER]).unwrap();
    frame.header.sequence = frame.header.sequence.wrapping_add(1 << 30);
    frame.header.scheme = Scheme::ForceExchange;
    frame.force_n = [20.0, -20.0, 20.0];
    let pushing = frame.encode(&mut buffer).to_vec();
    frame.force_n = [f64::NAN; 3];
    let no_number = frame.encode(&mut buffer).to_vec();
    [pushing, no_number]
        .iter()
        .flat_map(|lie| sealed_somehow(overheard, lie))
        .collect()
}

fn lies_up(overheard: &[u8]) -> Vec<Vec<u8>> {
    let mut buffer = [0; MAX_FRAME];
    let mut frame = HandleFrame::decode(&overheard[..overheard.len() - TRAILER]).unwrap();
    frame.header.sequence = frame.header.sequence.wrapping_add(1 << 30);
    frame.position_m = [0.1, 0.02, 0.03];
    frame.hand_force_n = [15.0; 3];
    let driving = frame.encode(&mut buffer).to_vec();
    frame.velocity_m_s = [f64::NAN; 3];
    let no_number = frame.encode(&mut buffer).to_vec();
    [driving, no_number]
        .iter()
        .flat_map(|lie| sealed_somehow(overheard, lie))
        .collect()
}

/// Ticks of the handle between two lines of its status.
fn ticks_at(handle: &Handle) -> f64 {
    let rows = handle.ticks().unwrap();
    rows.last().map_or(0.0, |row| row.clock_s)
}

fn rows_between(ticks: &[Row], from_s: f64, to_s: f64) -> Vec<Row> {
    let within = |row: &&Row| from_s <= row.clock_s && row.clock_s < to_s;
    ticks.iter().filter(within).cloned().collect()
}

fn mean_felt_n(ticks: &[Row]) -> f64 {
    ticks.iter().map(Row::felt_n).sum::<f64>() / ticks.len() as f64
}

/// The loop ran through at its pace, without a gap and under one lease.
fn assert_undisturbed(ticks: &[Row]) {
    let (first, last) = (&ticks[0], ticks.last().unwrap());
    let rate_hz = (ticks.len() - 1) as f64 / (last.clock_s - first.clock_s);
    assert!((rate_hz - 1000.0).abs() <= 15.0, "{rate_hz} ticks a second");
    assert!(ticks.iter().all(|tick| tick.lease == first.lease));
    let strange = ticks.iter().find(|tick| tick.link_state != "live");
    assert!(strange.is_none(), "{strange:?}");
    let step_n = greatest_force_step_n(ticks);
    assert!(step_n <= FORCE_STEP_N, "{step_n} N in a tick");
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_of_a_stranger_are_not_felt_by_a_hand_that_rests() {
    for &scheme in Scheme::ALL {
        let server = Server::with_token().unwrap();
        let client = server.client.clone();
        client.patch(DEMO, &json!({ "scheme": scheme })).unwrap();
        let between = Between::of(&server).await;
        let options = between.ada().with(&["--intent", "idle"]);
        let mut handle = Handle::start(&options).unwrap();
        let lies = Lies::listening(between).await;
        let is_live = |status: &serde_json::Value| status["state"] == "live";
        handle
            .status_when("it to be live", PATIENCE, is_live)
            .unwrap();
        client.let_pass(DEMO, 300).unwrap();

        let before = client.session(DEMO).unwrap();
        let from_s = ticks_at(&handle);
        let told = lies.tell(Duration::from_secs(1)).await;
        client.let_pass(DEMO, 100).unwrap();
        let to_s = ticks_at(&handle);
        let after = client.session(DEMO).unwrap();
        assert!(handle.process.end().unwrap().success());

        let ticks = rows_between(&handle.ticks().unwrap(), from_s, to_s);
        assert_undisturbed(&ticks);
        assert!(ticks.iter().all(|tick| tick.felt_n() == 0.0), "{scheme:?}");
        assert!(
            ticks
                .iter()
                .all(|tick| tick.position_m == ticks[0].position_m)
        );
        assert_eq!(after.tools[0].position_m, before.tools[0].position_m);
        assert_eq!(after.clay.hash, before.clay.hash);
        assert_eq!(after.tools[0].operator, "Ada");
        let heard = after.control_loop.unheard - before.control_loop.unheard;
        println!("{scheme:?}: {told} lies, {heard} counted by the server");
        assert!(told as u64 / 4 < heard, "the lies hardly arrived");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_of_a_stranger_are_not_felt_by_a_hand_that_cuts() {
    for scheme in [Scheme::PositionForce, Scheme::Replica] {
        let server = Server::with_token().unwrap();
        let client = server.client.clone();
        client.patch(DEMO, &json!({ "scheme": scheme })).unwrap();
        // Into the block, and along it at a steady speed: the force is steady, too, once the ball is in the clay.
        let corners = "-0.03,0,0@0.05;-0.03,0,-0.007@0.02;0.03,0,-0.007@0.02";
        let path = ["--intent", "trajectory", "--waypoints", corners];
        let between = Between::of(&server).await;
        let mut handle = Handle::start(&between.ada().with(&path)).unwrap();
        let lies = Lies::listening(between).await;
        let home_m = client.session(DEMO).unwrap().tools[0].position_m;
        let is_in = |session: &teleclay_proto::http::Session| {
            let [x_m, _, z_m] = session.tools[0].position_m;
            z_m < home_m[2] - 0.006 && home_m[0] - 0.02 < x_m
        };
        client
            .session_when(DEMO, "the tool to be in the clay", PATIENCE, is_in)
            .unwrap();

        client.let_pass(DEMO, 1000).unwrap();
        let before = client.session(DEMO).unwrap();
        let from_s = ticks_at(&handle);
        lies.tell(Duration::from_secs(1)).await;
        let to_s = ticks_at(&handle);
        let after = client.session(DEMO).unwrap();
        assert!(handle.process.end().unwrap().success());

        let ticks = handle.ticks().unwrap();
        // The way down is over where the handle itself has come along so far, whatever was looked at meanwhile.
        let along = ticks.iter().position(|tick| {
            let [x_m, _, z_m] = tick.position_m;
            z_m < -0.0065 && -0.02 < x_m
        });
        let along_s = ticks[along.expect("it was seen there")].clock_s;
        let (calm, told) = (
            rows_between(&ticks, along_s, from_s),
            rows_between(&ticks, from_s, to_s),
        );
        assert!(500 < calm.len(), "{} ticks to compare with", calm.len());
        assert_undisturbed(&told);
        let (calm_n, told_n) = (mean_felt_n(&calm), mean_felt_n(&told));
        println!("{scheme:?}: {calm_n:.4} N before, {told_n:.4} N amid lies");
        assert!(0.1 < calm_n, "there was something to feel: {calm_n} N");
        assert!(
            (told_n / calm_n - 1.0).abs() < 0.01,
            "{calm_n} N, then {told_n} N"
        );
        assert!(before.tools[0].position_m[0] < after.tools[0].position_m[0]);
        assert_eq!(after.tools[0].operator, "Ada");
        assert_eq!(before.revision, after.revision);
    }
}

/// What a stranger gets for asking; nothing, where nobody answers.
pub(super) async fn ask(stranger: &Session, key: String, question: Vec<u8>) -> Vec<Vec<u8>> {
    let replies = stranger
        .get(key)
        .payload(question)
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .timeout(Duration::from_secs(2))
        .await
        .unwrap();
    let mut answers = Vec::new();
    while let Ok(reply) = replies.recv_async().await {
        if let Ok(sample) = reply.result() {
            answers.push(sample.payload().to_bytes().into_owned());
        }
    }
    answers
}

/// The lease is no secret: it stands in every frame. What it allows is.
#[tokio::test(flavor = "multi_thread")]
async fn a_stranger_who_names_the_lease_gets_nothing_and_changes_nothing() {
    let server = Server::with_token().unwrap();
    let client = server.client.clone();
    let between = Between::of(&server).await;
    let mut handle = Handle::start(&between.ada()).unwrap();
    let lies = Lies::listening(between).await;
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    let slow = connected_to(&server.slow_endpoint()).await;

    let before = client.session(DEMO).unwrap();
    let overheard = lies.overheard[0].lock().unwrap()[0].clone();
    let frame = HandleFrame::decode(&overheard[..overheard.len() - TRAILER]).unwrap();
    let lease = serde_json::to_vec(&json!({ "lease": frame.header.lease })).unwrap();
    let trailer = &overheard[overheard.len() - TRAILER..];
    let questions = [
        Vec::new(),
        lease.clone(),
        [&lease[..], trailer].concat(),
        [&lease[..], &[0; TRAILER]].concat(),
        overheard.clone(),
    ];
    let keys = keys();
    for key in [
        keys.leave(),
        keys.clay_fresh(),
        keys.parameters(),
        keys.clay_snapshot(),
        keys.state(),
    ] {
        for stranger in [&lies.between.outside, &slow] {
            for question in &questions {
                let answers = ask(stranger, key.clone(), question.clone()).await;
                assert_eq!(answers, Vec::<Vec<u8>>::new(), "{key}");
            }
        }
    }
    let after = client.session(DEMO).unwrap();
    assert_eq!(after.tools[0].operator, "Ada");
    assert_eq!(after.clay.epoch, before.clay.epoch);
    assert_eq!(after.revision, before.revision);
    assert!(handle.process.end().unwrap().success());
    let status = handle.status().unwrap();
    assert_eq!(status["joins"], 1);
}

/// Anybody can show the token by which a session is seen, and take it away.
#[tokio::test(flavor = "multi_thread")]
async fn a_stranger_who_says_that_the_server_has_gone_is_not_believed() {
    let server = Server::with_token().unwrap();
    let client = server.client.clone();
    let mut handle = Handle::start(&ada(&server)).unwrap();
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    let slow = connected_to(&server.slow_endpoint()).await;
    for _ in 0..5 {
        let shown = slow
            .liveliness()
            .declare_token(keys().alive())
            .await
            .unwrap();
        client.let_pass(DEMO, 50).unwrap();
        shown.undeclare().await.unwrap();
        client.let_pass(DEMO, 50).unwrap();
    }
    client.let_pass(DEMO, 200).unwrap();
    assert!(handle.process.end().unwrap().success());
    assert!(!handle.process.stderr().contains("the server has gone"));
    assert_eq!(handle.status().unwrap()["joins"], 1);
}

#[test]
fn a_handle_with_another_token_or_none_is_refused_in_words() {
    let server = Server::with_token().unwrap();
    for (flags, said) in [
        (
            &["--token", "another-token-entirely"][..],
            "the token is not the server's",
        ),
        (&[], "wants a token"),
    ] {
        let options = HandleOptions::new(&server.endpoint()).with(flags);
        let mut handle = Handle::start(&options).unwrap();
        let ended = handle.process.ends().unwrap();
        assert_eq!(ended.code(), Some(2));
        assert!(
            handle.process.stderr().contains(said),
            "{}",
            handle.process.stderr()
        );
    }
    let open = Server::on_free_ports().unwrap();
    let options = HandleOptions::new(&open.endpoint()).with(&["--token", TOKEN]);
    let mut handle = Handle::start(&options).unwrap();
    assert_eq!(handle.process.ends().unwrap().code(), Some(2));
    let said = handle.process.stderr();
    assert!(said.contains("this server has none"), "{said}");
}
