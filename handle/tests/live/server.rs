//! A tool side over real Zenoh that answers each handle frame with one of its own, and fails in the ways a server can.

use std::net::TcpListener;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{self, Sender};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use serde::Serialize;
use serde::de::DeserializeOwned;
use teleclay_channel::{
    Answering, Challenge, Challenges, Channel, Context, Purpose, Secret, TRAILER,
};
use teleclay_proto::frame::{Engagement, HandleFrame, LoopStatus, MAX_FRAME, ToolFrame};
use teleclay_proto::http::ClayShape;
use teleclay_proto::join::{
    ChallengeReply, ChallengeRequest, ClayDescription, Farewell, FreshReply, Granted, JoinReply,
    JoinRequest, LeaseRequest, LeaveReply, LoopParameters, SealedJoin, SealedReply,
};
use teleclay_proto::keys::SessionKeys;
use teleclay_proto::{NodeName, RealmName, Scheme, SessionId};
use teleclay_shell::Clock;
use teleclay_shell::endpoint::Endpoint;
use teleclay_shell::network::{self, CONTROL_QOS, Endpoints};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use zenoh::pubsub::Subscriber;
use zenoh::query::Queryable;
use zenoh::{Session, Wait};

/// Force of the clay on the tool along x, N, whatever the tool does.
pub(crate) const PUSH_N: f64 = 0.6;
/// What handles and server know.
pub(crate) const TOKEN: &str = "let me in";
/// The one tool of each node.
pub(crate) const TOOL: u32 = 1;

/// What the server has seen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Seen {
    Join(JoinRequest),
    Leave(u32),
    Fresh(u32),
    /// The first frame under this lease.
    FirstFrame(u32),
    /// The first frame that says goodbye.
    Goodbye(u32),
}

/// How it answers to a join.
#[derive(Clone)]
pub(crate) enum Door {
    /// A lease under these parameters.
    Open(Box<LoopParameters>),
    /// These very bytes, in the server's own answer.
    Says(Vec<u8>),
    /// These very bytes, as anybody could say them.
    Shouts(Vec<u8>),
}

/// What goes down for each frame that comes up.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Speech {
    /// A tool frame.
    Frames,
    /// A tool frame after others that are of no use or under no lease of ours.
    FramesAmidGarbage,
    /// A tool frame with a force that is not a number.
    NotANumber,
    /// No frame at all.
    Silence,
}

/// What a test may change while the server runs.
pub(crate) struct Mood {
    pub(crate) door: Mutex<Door>,
    pub(crate) speech: Mutex<Speech>,
    pub(crate) fresh: Mutex<FreshReply>,
    pub(crate) status: Mutex<LoopStatus>,
    /// How far the session has come.
    progress: Mutex<Progress>,
    /// Number of the first frame that came under the present lease, and of the newest.
    pub(crate) numbers: Mutex<[u32; 2]>,
}

/// How far a session has come.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Progress {
    /// Counts the servers that have run it.
    pub(crate) ownership_epoch: u32,
    /// Counts its changes; a lease is one.
    pub(crate) revision: u32,
}

/// A session that was just made.
const FRESH: Progress = Progress {
    ownership_epoch: 1,
    revision: 0,
};

/// The server. Dropping it ends its sessions; [`kill`](Self::kill) waits for that.
pub(crate) struct Server {
    pub(crate) mood: Arc<Mood>,
    pub(crate) slow: Session,
    seen: UnboundedReceiver<Seen>,
    control: Session,
    served: Vec<ServedSession>,
    _queryables: Vec<Queryable<()>>,
    _subscribers: Vec<Subscriber<()>>,
}

/// The parameters it gives unless told otherwise.
pub(crate) fn parameters() -> LoopParameters {
    LoopParameters {
        scheme: Scheme::ForceExchange,
        ..LoopParameters::default()
    }
}

pub(crate) fn keys() -> SessionKeys {
    SessionKeys::new(
        RealmName::new("local").expect("a name"),
        SessionId::new("demo").expect("a name"),
    )
}

/// An endpoint whose port, and the one above it, nobody uses now. Below 32768, from where on connections take theirs;
/// every process looks elsewhere first.
pub(crate) fn free_endpoint() -> String {
    static LOOKS: AtomicU32 = AtomicU32::new(0);
    let own = std::process::id().wrapping_mul(37);
    let is_free = |port: u16| TcpListener::bind(("127.0.0.1", port)).is_ok();
    loop {
        let look = LOOKS.fetch_add(2, Ordering::Relaxed);
        let port = 12_000 + (own.wrapping_add(look) % 20_000) as u16;
        if is_free(port) && is_free(port + 1) {
            return format!("tcp/127.0.0.1:{port}");
        }
    }
}

impl Server {
    /// Session `demo`, as each of these nodes runs it; leases count from `first_lease`.
    pub(crate) async fn start(endpoint: &str, nodes: &[&str], first_lease: u32) -> Self {
        Self::start_with(endpoint, nodes, first_lease, parameters()).await
    }

    /// Under other parameters.
    pub(crate) async fn start_with(
        endpoint: &str,
        nodes: &[&str],
        first_lease: u32,
        parameters: LoopParameters,
    ) -> Self {
        Self::recover(endpoint, nodes, first_lease, parameters, FRESH).await
    }

    /// With a session that has come so far.
    pub(crate) async fn recover(
        endpoint: &str,
        nodes: &[&str],
        first_lease: u32,
        parameters: LoopParameters,
        progress: Progress,
    ) -> Self {
        let neighbour = endpoint
            .parse()
            .map(|endpoint: Endpoint| endpoint.neighbour(1));
        let slow_endpoint = neighbour
            .expect("it is one")
            .expect("the port was chosen so")
            .to_string();
        let control = network::open(&listening(endpoint))
            .await
            .expect("the port is free");
        let slow = network::open(&listening(&slow_endpoint))
            .await
            .expect("the port is free");
        let (saw, seen) = unbounded_channel();
        let mood = Arc::new(Mood {
            door: Mutex::new(Door::Open(Box::new(parameters))),
            speech: Mutex::new(Speech::Frames),
            fresh: Mutex::new(FreshReply::Fresh { epoch: 2 }),
            status: Mutex::new(LoopStatus::Running),
            progress: Mutex::new(progress),
            numbers: Mutex::default(),
        });
        let next_lease = Arc::new(AtomicU32::new(first_lease));
        let (mut queryables, mut subscribers) = (Vec::new(), Vec::new());
        let mut all_served = Vec::new();
        for node in nodes {
            let served = ServedSession {
                keys: keys(),
                node: NodeName::new(*node).expect("a name"),
                mood: Arc::clone(&mood),
                saw: saw.clone(),
                next_lease: Arc::clone(&next_lease),
                lease: Arc::new(AtomicU32::new(0)),
                challenges: Arc::new(Mutex::new(Challenges::new())),
                channel: Arc::default(),
                slow_endpoint: slow_endpoint.clone(),
            };
            for session in [&control, &slow] {
                queryables.extend(served.open(session).await);
            }
            subscribers.push(served.work(&control).await);
            all_served.push(served);
        }
        Self {
            mood,
            slow,
            seen,
            control,
            served: all_served,
            _queryables: queryables,
            _subscribers: subscribers,
        }
    }

    /// The next thing that it sees and `pick` wants, within half a minute.
    pub(crate) async fn sees<T>(
        &mut self,
        what: &str,
        mut pick: impl FnMut(Seen) -> Option<T>,
    ) -> T {
        let wanted = async {
            loop {
                let seen = self.seen.recv().await.expect("the server runs");
                if let Some(wanted) = pick(seen) {
                    return wanted;
                }
            }
        };
        tokio::time::timeout(super::PATIENCE, wanted)
            .await
            .unwrap_or_else(|_| panic!("the server never saw {what}"))
    }

    pub(crate) fn speak(&self, speech: Speech) -> Instant {
        *self.mood.speech.lock().unwrap() = speech;
        Instant::now()
    }

    /// Takes the first node's tool away from whoever holds it, and says so.
    pub(crate) async fn take_back(&self, reason: &str) {
        let served = &self.served[0];
        let lease = served.lease.swap(0, Ordering::Relaxed);
        let channel = served.channel.lock().unwrap().clone();
        let farewell = bytes(&Farewell {
            lease,
            reason: reason.to_owned(),
        });
        let sealed = channel
            .expect("it was made with the lease")
            .seal(Purpose::Leave, &farewell);
        let key = served.keys.tool_farewell(TOOL);
        self.control.put(key, sealed).await.expect("it is open");
    }

    /// Ends it, as the end of its process would: nobody is told.
    pub(crate) async fn kill(self) {
        self.control.close().await.expect("it closes");
        self.slow.close().await.expect("it closes");
    }
}

fn listening(endpoint: &str) -> Endpoints {
    Endpoints::listening(endpoint.parse().expect("it is one"))
}

/// One node's session.
#[derive(Clone)]
struct ServedSession {
    keys: SessionKeys,
    node: NodeName,
    mood: Arc<Mood>,
    saw: UnboundedSender<Seen>,
    next_lease: Arc<AtomicU32>,
    lease: Arc<AtomicU32>,
    challenges: Arc<Mutex<Challenges>>,
    /// Of the present lease.
    channel: Arc<Mutex<Option<Arc<Channel>>>>,
    slow_endpoint: String,
}

impl ServedSession {
    async fn open(&self, session: &Session) -> [Queryable<()>; 4] {
        let (challenge, join) = (self.clone(), self.clone());
        let (leave, fresh) = (self.clone(), self.clone());
        [
            answer(session, self.keys.challenge(), move |question| {
                let ChallengeRequest { .. } = read(question);
                let given = challenge.challenges.lock().unwrap().give(Duration::ZERO);
                Some(bytes(&ChallengeReply::Given {
                    challenge: *given.as_bytes(),
                    needs_token: true,
                }))
            })
            .await,
            answer(session, self.keys.join(), move |question| {
                join.join(read(question))
            })
            .await,
            answer(session, self.keys.leave(), move |question| {
                leave.under_lease(Purpose::Leave, question, |lease| bytes(&leave.leave(lease)))
            })
            .await,
            answer(session, self.keys.clay_fresh(), move |question| {
                fresh.under_lease(Purpose::ClayFresh, question, |lease| {
                    fresh.emit(Seen::Fresh(lease));
                    bytes(&*fresh.mood.fresh.lock().unwrap())
                })
            })
            .await,
        ]
    }

    /// Answers whoever holds the lease, sealed; nobody else.
    fn under_lease(
        &self,
        purpose: Purpose,
        question: &[u8],
        reply: impl FnOnce(u32) -> Vec<u8>,
    ) -> Option<Vec<u8>> {
        let channel = self.channel.lock().unwrap().clone()?;
        let asked = channel.open(purpose, question).ok()?;
        let LeaseRequest { lease } = read(asked);
        Some(channel.seal_answer(purpose, question, &reply(lease)))
    }

    fn join(&self, join: SealedJoin) -> Option<Vec<u8>> {
        let challenge = Challenge::from_bytes(join.challenge);
        let taken = self
            .challenges
            .lock()
            .unwrap()
            .take(Duration::ZERO, &challenge);
        // Another server's challenge.
        taken.ok()?;
        let key = self.keys.join();
        let context = Context {
            key: &key,
            challenge: &challenge,
        };
        let (request, answering) =
            Answering::hear(&Secret::of_token(TOKEN), context, &join.message)
                .expect("the handle knows the token");
        self.emit(Seen::Join(read(&request)));
        let mut parameters = match &*self.mood.door.lock().unwrap() {
            Door::Open(parameters) => **parameters,
            Door::Says(said) => {
                let (message, _) = answering.answer(said);
                return Some(bytes(&SealedReply::Answered { message }));
            }
            Door::Shouts(shouted) => return Some(shouted.clone()),
        };
        let lease = self.next_lease.fetch_add(1, Ordering::Relaxed);
        let progress = {
            let mut progress = self.mood.progress.lock().unwrap();
            progress.revision += 1;
            *progress
        };
        parameters.revision = progress.revision;
        let granted = bytes(&JoinReply::Granted(Box::new(Granted {
            lease,
            ownership_epoch: progress.ownership_epoch,
            node: self.node.clone(),
            tool: TOOL,
            lease_s: 5.0,
            parameters,
            clay: ClayDescription {
                shape: ClayShape::block(),
                voxel_size_m: 5e-4,
                epoch: 1,
                revision: 0,
            },
            slow_endpoint: Some(self.slow_endpoint.clone()),
        })));
        let (message, keys) = answering.answer(&granted);
        *self.channel.lock().unwrap() = Some(Arc::new(Channel::of_server(&keys)));
        self.lease.store(lease, Ordering::Relaxed);
        Some(bytes(&SealedReply::Answered { message }))
    }

    fn leave(&self, lease: u32) -> LeaveReply {
        self.emit(Seen::Leave(lease));
        let left = self
            .lease
            .compare_exchange(lease, 0, Ordering::Relaxed, Ordering::Relaxed);
        if left.is_ok() {
            LeaveReply::Left
        } else {
            LeaveReply::NoSuchLease
        }
    }

    /// Answers frames. Zenoh's thread only decodes and hands over, as everywhere.
    async fn work(&self, control: &Session) -> Subscriber<()> {
        let (congestion, priority, express, reliability) = CONTROL_QOS;
        let down = control
            .declare_publisher(self.keys.tool_down(TOOL))
            .congestion_control(congestion)
            .priority(priority)
            .express(express)
            .reliability(reliability)
            .await
            .expect("a publisher");
        let (arrived, frames) = mpsc::channel::<HandleFrame>();
        let served = self.clone();
        thread::spawn(move || {
            let mut tool = Tool {
                served,
                clock: Clock::start(),
                sequence: 0,
                greeted: 0,
                left: 0,
            };
            for frame in frames {
                // A session that is closed takes nothing any more; the thread ends with its subscriber.
                tool.answer(&frame, |payload| drop(down.put(payload).wait()));
            }
        });
        receive(control, self.keys.tool_up(TOOL), self.clone(), arrived).await
    }

    fn emit(&self, seen: Seen) {
        // A server that is being dropped has no eyes any more.
        let _ = self.saw.send(seen);
    }
}

struct Tool {
    served: ServedSession,
    clock: Clock,
    sequence: u32,
    greeted: u32,
    left: u32,
}

impl Tool {
    fn answer(&mut self, frame: &HandleFrame, put: impl Fn(&[u8])) {
        let lease = frame.header.lease;
        if lease != self.served.lease.load(Ordering::Relaxed) {
            return;
        }
        self.served.mood.numbers.lock().unwrap()[1] = frame.header.sequence;
        if self.greeted != lease {
            self.greeted = lease;
            self.served.mood.numbers.lock().unwrap()[0] = frame.header.sequence;
            self.served.emit(Seen::FirstFrame(lease));
        }
        if frame.engagement == Engagement::Leaving && self.left != lease {
            self.left = lease;
            self.served.emit(Seen::Goodbye(lease));
        }
        let speech = *self.served.mood.speech.lock().unwrap();
        if speech == Speech::Silence {
            return;
        }
        self.sequence += 1;
        let mut answer = ToolFrame {
            status: *self.served.mood.status.lock().unwrap(),
            force_n: [-PUSH_N, 0.0, 0.0],
            ..ToolFrame::default()
        };
        answer.header.lease = lease;
        let progress = *self.served.mood.progress.lock().unwrap();
        answer.header.ownership_epoch = progress.ownership_epoch;
        answer.header.revision = progress.revision;
        answer.header.sequence = self.sequence;
        answer.header.scheme = frame.header.scheme;
        answer.header.sent_ns = self.clock.now_ns();
        answer.header.echo_ns = frame.header.sent_ns;
        if speech == Speech::NotANumber {
            answer.force_n[2] = f64::NAN;
        }
        let mut buffer = [0; MAX_FRAME];
        let channel = self.served.channel.lock().unwrap().clone();
        let channel = channel.expect("it was made with the lease");
        if speech == Speech::FramesAmidGarbage {
            garbage(&channel, &answer, frame, &put);
        }
        put(&channel.seal(Purpose::Frame, answer.encode(&mut buffer)));
    }
}

/// Everything that must not reach a hand. From strangers: nothing, half a frame, one without a seal, one that is
/// changed on its way, one that comes again. From a server that is broken: a frame of the other direction, of another
/// version, of another lease, with something after its end.
fn garbage(channel: &Channel, answer: &ToolFrame, frame: &HandleFrame, put: impl Fn(&[u8])) {
    let mut buffer = [0; MAX_FRAME];
    let good = answer.encode(&mut buffer).to_vec();
    let mut strong = *answer;
    strong.header.sequence = u32::MAX / 2;
    strong.force_n = [1e3; 3];
    let strong_bytes = strong.encode(&mut buffer).to_vec();
    put(&[]);
    put(&good[..good.len() / 2]);
    put(&strong_bytes);
    put(&[&strong_bytes[..], &[7; TRAILER]].concat());
    let sealed = channel.seal(Purpose::Frame, &good);
    let mut changed = sealed.clone();
    changed[50] ^= 1;
    put(&changed);
    put(&channel.seal(Purpose::State, &strong_bytes));
    let mut version = good.clone();
    version[2] = version[2].wrapping_add(1);
    strong.header.lease = answer.header.lease.wrapping_add(1000);
    for broken in [
        &good[..good.len() / 2],
        &[&good[..], b"more"].concat(),
        frame.encode(&mut [0; MAX_FRAME]),
        &version,
        strong.encode(&mut buffer),
    ] {
        let sealed = channel.seal(Purpose::Frame, broken);
        put(&sealed);
        put(&sealed);
    }
}

async fn answer(
    session: &Session,
    key: String,
    reply: impl Fn(&[u8]) -> Option<Vec<u8>> + Send + Sync + 'static,
) -> Queryable<()> {
    let at = key.clone();
    session
        .declare_queryable(key)
        .callback(move |query| {
            let question = query
                .payload()
                .expect("every question has a body")
                .to_bytes();
            if let Some(reply) = reply(&question) {
                // Whoever asked may have gone.
                let _ = query.reply(at.as_str(), reply).wait();
            }
        })
        .await
        .expect("a queryable")
}

fn read<Q: DeserializeOwned>(question: &[u8]) -> Q {
    serde_json::from_slice(question).expect("questions are well formed")
}

async fn receive(
    control: &Session,
    key: String,
    served: ServedSession,
    arrived: Sender<HandleFrame>,
) -> Subscriber<()> {
    let arrived = Mutex::new(arrived);
    control
        .declare_subscriber(key)
        .callback(move |sample| {
            let sealed = sample.payload().to_bytes();
            let channel = served.channel.lock().unwrap().clone();
            // Under a lease that is over.
            let Some(channel) = channel else { return };
            let Ok(frame) = channel.open(Purpose::Frame, &sealed) else {
                return;
            };
            let frame = HandleFrame::decode(frame).expect("handle frames are well formed");
            // The thread ends after this callback does.
            let _ = arrived.lock().unwrap().send(frame);
        })
        .await
        .expect("a subscriber")
}

fn bytes(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("replies are JSON")
}
