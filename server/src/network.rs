//! Zenoh: frames in and out on one session, everything slow on another.
//!
//! The callback for frames decodes, pushes into the session's ring and returns. A sender thread of its own puts what
//! the tick leaves: a put may block for longer than a tick even when it may drop.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, Thread};
use std::time::Duration;

use rtrb::Consumer;
use teleclay_clay::{BrickView, Clay};
use teleclay_proto::frame::{HandleFrame, MAX_FRAME};
use teleclay_proto::http::{ClayReset, parse};
use teleclay_proto::join::{
    FreshReply, FreshRequest, JoinReply, JoinRequest, LeaveReply, LeaveRequest, RefusalCode,
};
use teleclay_proto::keys::{self, Key, Leaf, SessionKeys};
use teleclay_proto::watch::{
    BRICK_VOXELS, BrickContent, BricksHeader, BricksKind, BricksWriter, MAX_MESSAGE,
};
use teleclay_proto::{RealmName, SessionId};
use teleclay_shell::Clock;
use teleclay_shell::network::{CONTROL_QOS, Endpoints, NetworkError, open};
use zenoh::Session;
use zenoh::Wait;
use zenoh::bytes::ZBytes;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::Query;

use crate::directory::{Directory, Live};
use crate::engine::{Incoming, Outgoing};

/// How often slow state is published, and bricks at most.
const STATE_PERIOD: Duration = Duration::from_millis(500);
const BRICKS_PERIOD: Duration = Duration::from_millis(100);
/// Longer questions are not read: a join has a hundredth of it.
const LONGEST_QUESTION: usize = 16 * 1024;
/// The sender looks into its ring at least this often, should a wake-up get lost.
const SENDER_NAP: Duration = Duration::from_millis(5);

/// The server's side of Zenoh. Dropping it closes nothing by itself: see [`Network::close`].
pub struct Network {
    control: Session,
    slow: Session,
    stop: Arc<AtomicBool>,
    sender: Option<JoinHandle<()>>,
}

/// The thread that puts frames, before it knows of Zenoh: the tick needs its handle to wake it.
pub(crate) struct Sender {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<()>,
    start: std::sync::mpsc::Sender<Sending>,
}

/// What that thread works with.
struct Sending {
    outgoing: Consumer<Outgoing>,
    session: Session,
    realm: RealmName,
    directory: Directory,
}

/// The same thread, with frames to put.
pub(crate) struct FedSender {
    sender: Sender,
    outgoing: Consumer<Outgoing>,
}

impl Sender {
    pub(crate) fn spawn() -> std::io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let asked_to_stop = Arc::clone(&stop);
        let (start, started) = std::sync::mpsc::channel::<Sending>();
        let thread = std::thread::Builder::new()
            .name("sender".to_owned())
            .spawn(move || {
                if let Ok(sending) = started.recv() {
                    send_until(&asked_to_stop, sending);
                }
            })?;
        Ok(Self {
            stop,
            thread,
            start,
        })
    }

    pub(crate) fn thread(&self) -> Thread {
        self.thread.thread().clone()
    }

    /// Frames come out of this ring.
    pub(crate) fn feed(self, outgoing: Consumer<Outgoing>) -> FedSender {
        FedSender {
            sender: self,
            outgoing,
        }
    }
}

impl Network {
    /// Opens both sessions and serves `directory` on them.
    ///
    /// # Errors
    /// An endpoint cannot be listened on.
    pub(crate) async fn open(
        realm: &RealmName,
        control_endpoint: &str,
        slow_endpoint: &str,
        directory: &Directory,
        sender: FedSender,
        clock: Clock,
    ) -> Result<Self, NetworkError> {
        let listen = |endpoint: &str| Endpoints {
            listen: vec![endpoint.to_owned()],
            connect: Vec::new(),
        };
        let control = open(&listen(control_endpoint)).await?;
        let slow = open(&listen(slow_endpoint)).await?;
        let failed = |reason: zenoh::Error| NetworkError::Open {
            what: control_endpoint.to_owned(),
            reason: reason.to_string(),
        };

        receive_frames(&control, realm, directory.clone(), clock)
            .await
            .map_err(failed)?;
        for session in [&control, &slow] {
            answer_queries(session, realm, directory.clone())
                .await
                .map_err(failed)?;
        }
        tokio::spawn(publish_state(
            slow.clone(),
            realm.clone(),
            directory.clone(),
        ));
        tokio::spawn(show_sessions(
            slow.clone(),
            realm.clone(),
            directory.clone(),
        ));
        tokio::spawn(publish_bricks(
            slow.clone(),
            realm.clone(),
            directory.clone(),
        ));
        let FedSender { sender, outgoing } = sender;
        let sending = Sending {
            outgoing,
            session: control.clone(),
            realm: realm.clone(),
            directory: directory.clone(),
        };
        // Fails only if the thread is gone; then nothing would be sent, and readiness would say so.
        let is_sending = sender.start.send(sending).is_ok();
        if is_sending {
            directory.set_zenoh_up();
        }
        Ok(Self {
            control,
            slow,
            stop: sender.stop,
            sender: Some(sender.thread),
        })
    }

    /// Closes both sessions and ends the sender.
    pub async fn close(mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(sender) = self.sender.take() {
            sender.thread().unpark();
            // A panic was printed by the thread itself.
            let _ = tokio::task::spawn_blocking(move || sender.join()).await;
        }
        for session in [self.control, self.slow] {
            if let Err(error) = session.close().await {
                tracing::warn!(%error, "a zenoh session did not close cleanly");
            }
        }
    }
}

fn send_until(stop: &AtomicBool, sending: Sending) {
    let Sending {
        mut outgoing,
        session,
        realm,
        directory,
    } = sending;
    let (congestion, priority, is_express, reliability) = CONTROL_QOS;
    let mut publishers: HashMap<(u32, usize), zenoh::pubsub::Publisher<'_>> = HashMap::new();
    let mut buffer = [0; MAX_FRAME];
    while !stop.load(Ordering::Relaxed) {
        while let Ok(Outgoing {
            session: number,
            slot,
            frame,
        }) = outgoing.pop()
        {
            let publisher = match publishers.entry((number, slot)) {
                std::collections::hash_map::Entry::Occupied(held) => held.into_mut(),
                std::collections::hash_map::Entry::Vacant(free) => {
                    let Some(live) = directory.live_by_number(number) else {
                        continue;
                    };
                    let key = SessionKeys::new(realm.clone(), live.id().clone())
                        .tool_down(crate::session::tool_id(slot));
                    let declared = session
                        .declare_publisher(key)
                        .congestion_control(congestion)
                        .priority(priority)
                        .express(is_express)
                        .reliability(reliability)
                        .wait();
                    match declared {
                        Ok(publisher) => free.insert(publisher),
                        Err(error) => {
                            tracing::error!(%error, "cannot publish frames");
                            continue;
                        }
                    }
                }
            };
            // An error means that the session is closing.
            let _ = publisher.put(frame.encode(&mut buffer)).wait();
        }
        std::thread::park_timeout(SENDER_NAP);
    }
}

/// The route of a key: into which ring, for which slot.
type Route = (Arc<Mutex<rtrb::Producer<Incoming>>>, usize);

async fn receive_frames(
    session: &Session,
    realm: &RealmName,
    directory: Directory,
    clock: Clock,
) -> Result<(), zenoh::Error> {
    let routes: Mutex<HashMap<String, Route>> = Mutex::new(HashMap::new());
    let broken = std::sync::atomic::AtomicU64::new(0);
    let callback = move |sample: zenoh::sample::Sample| {
        let arrived_ns = clock.now_ns();
        let payload = sample.payload().to_bytes();
        let frame = match HandleFrame::decode(&payload) {
            Ok(frame) => frame,
            Err(error) => {
                // The first of them is worth a line, all of them would be a flood.
                if broken.fetch_add(1, Ordering::Relaxed) == 0 {
                    tracing::warn!(%error, key = %sample.key_expr(), "a frame that is none");
                }
                return;
            }
        };
        let key = sample.key_expr().as_str();
        let mut routes = routes.lock().expect("no holder panics");
        let known = routes
            .get(key)
            .filter(|(ring, _)| !is_abandoned(ring))
            .cloned();
        let Some((ring, slot)) = known.or_else(|| route(key, &directory)) else {
            return;
        };
        if !routes.contains_key(key) || is_abandoned(&routes[key].0) {
            routes.insert(key.to_owned(), (Arc::clone(&ring), slot));
        }
        drop(routes);
        // A full ring means that the tick has stalled for a quarter of a second: what is newest is then as old as the
        // rest.
        let _ = ring.lock().expect("no holder panics").push(Incoming {
            slot,
            arrived_ns,
            frame,
        });
    };
    session
        .declare_subscriber(keys::every_tool_up_in(realm))
        .callback(callback)
        .background()
        .await
}

fn is_abandoned(ring: &Mutex<rtrb::Producer<Incoming>>) -> bool {
    ring.lock().expect("no holder panics").is_abandoned()
}

fn route(key: &str, directory: &Directory) -> Option<Route> {
    let Ok(Key {
        session: keys,
        leaf: Leaf::ToolUp(tool),
    }) = key.parse()
    else {
        return None;
    };
    let slot = usize::try_from(tool).ok()?.checked_sub(1)?;
    Some((directory.frames(keys.session())?, slot))
}

async fn answer_queries(
    session: &Session,
    realm: &RealmName,
    directory: Directory,
) -> Result<(), zenoh::Error> {
    let runtime = tokio::runtime::Handle::current();
    let realm = realm.clone();
    session
        .declare_queryable(keys::everything_in(&realm))
        .callback(move |query: Query| {
            let (directory, realm) = (directory.clone(), realm.clone());
            runtime.spawn(async move { answer(&query, &realm, &directory).await });
        })
        .background()
        .await
}

async fn answer(query: &Query, realm: &RealmName, directory: &Directory) {
    let Ok(Key {
        session: keys,
        leaf,
    }) = query.key_expr().as_str().parse::<Key>()
    else {
        return;
    };
    if keys.realm() != realm {
        return;
    }
    let id = keys.session();
    let payload = match question(query.payload()) {
        Ok(payload) => payload,
        Err(bytes) => {
            let reason = format!("{bytes} bytes, wanted {LONGEST_QUESTION} at most");
            tracing::debug!(key = %query.key_expr(), "a question of {reason}");
            let reply = match leaf {
                Leaf::Join => json(&JoinReply::Refused {
                    code: RefusalCode::BadRequest,
                    reason,
                }),
                Leaf::ClayFresh => json(&FreshReply::Refused { reason }),
                _ => return,
            };
            return reply_with(query, &keys, leaf, reply).await;
        }
    };
    let reply = match leaf {
        Leaf::Join => json(&join(id, &payload, directory).await),
        Leaf::Leave => json(&leave(id, &payload, directory).await),
        Leaf::ClayFresh => json(&fresh(id, &payload, directory).await),
        Leaf::Parameters => match directory.session(id) {
            Some(live) => json(&live.loop_parameters()),
            None => return,
        },
        Leaf::ClaySnapshot => match directory.session(id) {
            Some(live) => {
                for message in bricks(&live, None).0 {
                    reply_with(query, &keys, leaf, message).await;
                }
                return;
            }
            None => return,
        },
        Leaf::State => match directory.session(id) {
            Some(live) => json(&live.state()),
            None => return,
        },
        _ => return,
    };
    reply_with(query, &keys, leaf, reply).await;
}

/// What a query brings, copied only where it is no longer than any question here may be; else its length in bytes.
fn question(payload: Option<&ZBytes>) -> Result<Vec<u8>, usize> {
    match payload {
        None => Ok(Vec::new()),
        Some(bytes) if LONGEST_QUESTION < bytes.len() => Err(bytes.len()),
        Some(bytes) => Ok(bytes.to_bytes().into_owned()),
    }
}

async fn reply_with(query: &Query, keys: &SessionKeys, leaf: Leaf, payload: Vec<u8>) {
    if let Err(error) = query.reply(keys.key(leaf), payload).await {
        tracing::warn!(%error, "a query could not be answered");
    }
}

fn json(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("plain data has a JSON form")
}

async fn join(id: &SessionId, payload: &[u8], directory: &Directory) -> JoinReply {
    let request: JoinRequest = match parse(payload) {
        Ok(request) => request,
        Err(error) => {
            return JoinReply::Refused {
                code: RefusalCode::BadRequest,
                reason: error.to_string(),
            };
        }
    };
    match directory.join(id, &request).await {
        Ok(granted) => JoinReply::Granted(Box::new(granted)),
        Err((code, reason)) => JoinReply::Refused { code, reason },
    }
}

async fn leave(id: &SessionId, payload: &[u8], directory: &Directory) -> LeaveReply {
    let (Ok(LeaveRequest { lease }), Some(live)) = (parse(payload), directory.session(id)) else {
        return LeaveReply::NoSuchLease;
    };
    match live.leave(lease).await {
        Ok(()) => LeaveReply::Left,
        Err(_) => LeaveReply::NoSuchLease,
    }
}

async fn fresh(id: &SessionId, payload: &[u8], directory: &Directory) -> FreshReply {
    let refused = |reason: &str| FreshReply::Refused {
        reason: reason.to_owned(),
    };
    let request: FreshRequest = match parse(payload) {
        Ok(request) => request,
        Err(error) => return refused(&error.to_string()),
    };
    let Some(live) = directory.session(id) else {
        return refused("there is no such session");
    };
    match live.reset(ClayReset::default(), Some(request.lease)).await {
        Ok(session) => FreshReply::Fresh {
            epoch: session.clay.epoch,
        },
        Err(error) => refused(&error.to_string()),
    }
}

/// Shows by a token which sessions this server runs. Handles let go at once when the token of theirs goes.
async fn show_sessions(session: Session, realm: RealmName, directory: Directory) {
    let mut shown: HashMap<SessionId, LivelinessToken> = HashMap::new();
    let mut changes = directory.changes();
    loop {
        let lives = directory.lives();
        // A token that is dropped is undeclared.
        shown.retain(|id, _| lives.iter().any(|live| live.id() == id));
        for live in &lives {
            if shown.contains_key(live.id()) {
                continue;
            }
            let key = SessionKeys::new(realm.clone(), live.id().clone()).alive();
            match session.liveliness().declare_token(key).await {
                Ok(token) => {
                    shown.insert(live.id().clone(), token);
                }
                Err(error) => tracing::error!(%error, "a session cannot be shown on zenoh"),
            }
        }
        // The directory lives as long as this task does.
        if changes.changed().await.is_err() || session.is_closed() {
            return;
        }
    }
}

async fn publish_state(session: Session, realm: RealmName, directory: Directory) {
    let mut period = tokio::time::interval(STATE_PERIOD);
    while !session.is_closed() {
        period.tick().await;
        for state in directory.sessions() {
            let key = SessionKeys::new(realm.clone(), state.id.clone()).state();
            // An error means that the session is closing.
            let _ = session.put(key, json(&state)).await;
        }
    }
}

async fn publish_bricks(session: Session, realm: RealmName, directory: Directory) {
    let mut seen: HashMap<SessionId, (u32, u64)> = HashMap::new();
    let mut period = tokio::time::interval(BRICKS_PERIOD);
    while !session.is_closed() {
        period.tick().await;
        let ids: Vec<SessionId> = directory
            .sessions()
            .into_iter()
            .map(|session| session.id)
            .collect();
        seen.retain(|id, _| ids.contains(id));
        for id in ids {
            let Some(live) = directory.session(&id) else {
                continue;
            };
            let (messages, now) = bricks(&live, seen.get(&id).copied());
            seen.insert(id.clone(), now);
            let key = SessionKeys::new(realm.clone(), id).clay_bricks();
            for message in messages {
                // An error means that the session is closing.
                let _ = session.put(&key, message).await;
            }
        }
    }
}

/// The bricks that changed since `seen` (epoch and revision), or all of them, and what has been seen then.
fn bricks(live: &Live, seen: Option<(u32, u64)>) -> (Vec<Vec<u8>>, (u32, u64)) {
    live.clay().with(|clay, epoch| {
        let since = seen
            .filter(|(seen_epoch, _)| *seen_epoch == epoch)
            .map(|(_, revision)| revision);
        (write_bricks(clay, epoch, since), (epoch, clay.revision()))
    })
}

fn write_bricks(clay: &Clay, epoch: u32, since: Option<u64>) -> Vec<Vec<u8>> {
    let grid = clay.grid();
    let header = BricksHeader {
        sequence: 0,
        clay_epoch: epoch,
        bricks_per_axis: grid.bricks(),
        kind: if since.is_none() {
            BricksKind::Keyframe
        } else {
            BricksKind::Delta
        },
        voxel_size_m: grid.voxel_size_m() as f32,
    };
    let mut writer = BricksWriter::new(header, MAX_MESSAGE);
    let mut write = |index: teleclay_clay::BrickIndex| {
        let content = match clay.brick(index) {
            BrickView::Empty => BrickContent::Empty,
            BrickView::Full => BrickContent::Full,
            BrickView::Voxels(voxels) => BrickContent::Voxels(voxels),
        };
        writer
            .push(index.as_u32(), content)
            .expect("the index is the grid's own");
    };
    match since {
        Some(revision) => clay.changed_after(revision).for_each(&mut write),
        None => (0..grid.brick_count() as u32)
            .filter_map(|dense| grid.brick_index(dense))
            .for_each(&mut write),
    }
    writer.finish()
}

const _: () = assert!(
    BRICK_VOXELS == teleclay_clay::BRICK_VOXELS,
    "bricks on the wire are the clay's"
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_question_that_is_too_long_is_not_copied() {
        let bytes = |length: usize| ZBytes::from(vec![b' '; length]);
        assert_eq!(question(None), Ok(Vec::new()));
        let longest = question(Some(&bytes(LONGEST_QUESTION)));
        assert_eq!(longest.map(|payload| payload.len()), Ok(LONGEST_QUESTION));
        assert_eq!(question(Some(&bytes(100_000_000))), Err(100_000_000));
    }
}
