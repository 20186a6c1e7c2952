//! Frames in and out. The callback for frames decodes, pushes into the session's ring and returns. A sender thread of
//! its own puts what the tick leaves: a put may block for longer than a tick even when it may drop.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, Thread};
use std::time::Duration;

use rtrb::Consumer;
use teleclay_proto::RealmName;
use teleclay_proto::frame::{HandleFrame, MAX_FRAME};
use teleclay_proto::keys::{self, Key, Leaf, SessionKeys};
use teleclay_shell::Clock;
use teleclay_shell::network::CONTROL_QOS;
use zenoh::Session;
use zenoh::Wait;

use crate::directory::Directory;
use crate::engine::{Incoming, Outgoing};

/// The sender looks into its ring at least this often, should a wake-up get lost.
const SENDER_NAP: Duration = Duration::from_millis(5);

/// The thread that puts frames, before it knows of Zenoh: the tick needs its handle to wake it.
pub(crate) struct Sender {
    pub(super) stop: Arc<AtomicBool>,
    pub(super) thread: JoinHandle<()>,
    pub(super) start: std::sync::mpsc::Sender<Sending>,
}

/// What that thread works with.
pub(super) struct Sending {
    pub(super) outgoing: Consumer<Outgoing>,
    pub(super) session: Session,
    pub(super) realm: RealmName,
    pub(super) directory: Directory,
}

/// The same thread, with frames to put.
pub(crate) struct FedSender {
    pub(super) sender: Sender,
    pub(super) outgoing: Consumer<Outgoing>,
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

pub(super) async fn receive_frames(
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
