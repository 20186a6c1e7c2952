//! A router, a server with one session, and somebody at the other side of the router.

use std::net::TcpListener;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use teleclay_ros2::host::{Call, Event, Host, HostSession, Level, Look, Sample, ToolLook};
use teleclay_ros2::{Commands, Config, Ros2};
use teleclay_wire::TelemetrySample;
use tokio::sync::{broadcast, watch};
use zenoh::bytes::ZBytes;
use zenoh::query::ConsolidationMode;
use zenoh::query::QueryTarget;
use zenoh::{Config as ZenohConfig, Session};

/// Nothing in these tests takes as long.
const LONGEST: Duration = Duration::from_secs(30);

pub(crate) struct Rig {
    pub(crate) router: Router,
    pub(crate) client: Session,
    pub(crate) host: FakeHost,
    pub(crate) demo: FakeSession,
    pub(crate) ros2: Ros2,
}

impl Rig {
    pub(crate) async fn start(commands: Commands) -> Self {
        let port = free_port();
        let router = Router::open(port).await;
        let host = FakeHost::default();
        let demo = host.add("demo", 1);
        let ros2 = Ros2::start(config(port, commands), host.clone());
        let client = client(port).await;
        Self {
            router,
            client,
            host,
            demo,
            ros2,
        }
    }

    /// Waits until a topic or service is in the graph, or no more.
    pub(crate) async fn is_shown(&self, name: &str, wanted: bool) {
        let started = Instant::now();
        loop {
            let tokens = self.client.liveliness().get("@ros2_lv/0/**").await.unwrap();
            let mut is_there = false;
            while let Ok(reply) = tokens.recv_async().await {
                let sample = reply.into_result().unwrap();
                let token = sample.key_expr().as_str().to_owned();
                assert!(token.contains("/%/%/teleclay_test"), "{token}");
                is_there |= token.split('/').any(|part| part == name);
            }
            if is_there == wanted {
                return;
            }
            assert!(started.elapsed() < LONGEST, "{name}");
            pause().await;
        }
    }

    pub(crate) async fn end(self) {
        self.ros2.close().await;
        self.client.close().await.unwrap();
        self.router.close().await;
    }
}

pub(crate) struct Router(Session);

impl Router {
    pub(crate) async fn open(port: u16) -> Self {
        let listen = format!("[\"tcp/127.0.0.1:{port}\"]");
        let config = zenoh_config(&[("mode", "\"router\""), ("listen/endpoints", &listen)]);
        Self(zenoh::open(config).await.unwrap())
    }

    pub(crate) async fn close(self) {
        self.0.close().await.unwrap();
    }
}

pub(crate) async fn client(port: u16) -> Session {
    let connect = format!("[\"tcp/127.0.0.1:{port}\"]");
    let config = zenoh_config(&[("mode", "\"client\""), ("connect/endpoints", &connect)]);
    zenoh::open(config).await.unwrap()
}

fn zenoh_config(settings: &[(&str, &str)]) -> ZenohConfig {
    let mut config = ZenohConfig::default();
    for (key, value) in settings.iter().copied().chain([
        ("scouting/multicast/enabled", "false"),
        ("scouting/gossip/enabled", "false"),
    ]) {
        config.insert_json5(key, value).unwrap();
    }
    config
}

pub(crate) fn config(port: u16, commands: Commands) -> Config {
    Config {
        router: format!("tcp/127.0.0.1:{port}"),
        domain: 0,
        node: "teleclay_test".to_owned(),
        commands,
    }
}

pub(crate) fn free_port() -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().port()
}

/// Waits for something that comes about by itself.
pub(crate) async fn until(what: &str, is_so: impl Fn() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < LONGEST, "not in time: {what}");
        pause().await;
    }
}

/// Between two looks.
pub(crate) async fn pause() {
    tokio::time::sleep(Duration::from_millis(4)).await;
}

/// Makes calls all at once, and waits for their answers.
pub(crate) async fn together<T>(calls: impl Iterator<Item = impl Future<Output = T>>) -> Vec<T> {
    let mut waiting: Vec<_> = calls.map(Box::pin).collect();
    let mut answers = Vec::new();
    std::future::poll_fn(|context| {
        waiting.retain_mut(|call| match call.as_mut().poll(context) {
            std::task::Poll::Ready(answer) => {
                answers.push(answer);
                false
            }
            std::task::Poll::Pending => true,
        });
        if waiting.is_empty() {
            std::task::Poll::Ready(())
        } else {
            std::task::Poll::Pending
        }
    })
    .await;
    answers
}

/// Calls a service as `rmw_zenoh` does, and gives the bytes of the answer.
pub(crate) async fn answer(client: &Session, key: &str, request: &[u8], sequence: i64) -> Vec<u8> {
    let gid = [5; 16];
    let mut number = sequence.to_le_bytes().to_vec();
    number.extend(1_i64.to_le_bytes());
    number.push(16);
    number.extend(gid);
    let replies = client
        .get(key)
        .target(QueryTarget::AllComplete)
        .consolidation(ConsolidationMode::None)
        .payload(request)
        .attachment(number)
        .timeout(LONGEST)
        .await
        .unwrap();
    let reply = replies.recv_async().await.unwrap();
    let sample = reply.into_result().unwrap();
    assert_eq!(sample.key_expr().as_str(), key);
    let (answered, _, to) = attachment(sample.attachment().unwrap());
    assert_eq!((answered, to), (sequence, gid));
    sample.payload().to_bytes().into_owned()
}

/// Number, time and name of who sent it.
pub(crate) fn attachment(bytes: &ZBytes) -> (i64, i64, [u8; 16]) {
    let bytes = bytes.to_bytes();
    assert_eq!((bytes.len(), bytes[16]), (33, 16));
    let number = |at: usize| i64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    (number(0), number(8), bytes[17..].try_into().unwrap())
}

pub(crate) fn sample(tool: u32, tick: u64) -> Sample {
    Sample {
        tool,
        time_s: tick as f64 * 0.004,
        sample: TelemetrySample {
            tool_force_n: [0.5, -1.25, 3.0],
            tool_position_m: [0.1, 0.2, 0.3],
            ..TelemetrySample::default()
        },
    }
}

#[derive(Clone, Default)]
pub(crate) struct FakeHost(Arc<Inner>);

#[derive(Default)]
struct Inner {
    sessions: Mutex<Vec<FakeSession>>,
    changes: watch::Sender<u64>,
}

impl FakeHost {
    pub(crate) fn add(&self, name: &'static str, number: u32) -> FakeSession {
        let session = FakeSession {
            name,
            number,
            samples: broadcast::Sender::new(64),
            events: broadcast::Sender::new(64),
            calls: Arc::default(),
        };
        self.0.sessions.lock().unwrap().push(session.clone());
        self.0.changes.send_modify(|changes| *changes += 1);
        session
    }

    pub(crate) fn remove(&self, number: u32) {
        let mut sessions = self.0.sessions.lock().unwrap();
        sessions.retain(|session| session.number != number);
        drop(sessions);
        self.0.changes.send_modify(|changes| *changes += 1);
    }
}

impl Host for FakeHost {
    type Session = FakeSession;

    fn sessions(&self) -> Vec<FakeSession> {
        self.0.sessions.lock().unwrap().clone()
    }

    fn changes(&self) -> watch::Receiver<u64> {
        self.0.changes.subscribe()
    }
}

#[derive(Clone)]
pub(crate) struct FakeSession {
    name: &'static str,
    number: u32,
    pub(crate) samples: broadcast::Sender<Sample>,
    events: broadcast::Sender<Event>,
    calls: Arc<Mutex<Vec<Call>>>,
}

impl FakeSession {
    pub(crate) fn calls(&self) -> Vec<Call> {
        self.calls.lock().unwrap().clone()
    }

    pub(crate) fn event(&self, level: Level, text: &str) {
        let event = Event {
            level,
            text: text.to_owned(),
            time_s: 1.0,
        };
        self.events.send(event).unwrap();
    }
}

impl HostSession for FakeSession {
    type Sample = Sample;
    type Event = Event;

    fn name(&self) -> &str {
        self.name
    }

    fn number(&self) -> u32 {
        self.number
    }

    fn telemetry(&self) -> broadcast::Receiver<Sample> {
        self.samples.subscribe()
    }

    fn events(&self) -> broadcast::Receiver<Event> {
        self.events.subscribe()
    }

    fn look(&self) -> Look {
        Look {
            tools: vec![ToolLook::default()],
            revision: 7,
            settings: "{\"axes\":3}".to_owned(),
            level: Level::Warning,
            condition: "stopped".to_owned(),
            figures: vec![("rtt_s", "0.08".to_owned())],
            ..Look::default()
        }
    }

    async fn carry_out(&self, call: Call) -> Result<String, String> {
        let is_scheme = matches!(call, Call::SetScheme(_));
        self.calls.lock().unwrap().push(call);
        if is_scheme {
            Err("no such scheme".to_owned())
        } else {
            Ok("done".to_owned())
        }
    }
}
