//! Frames in and out. The callback for frames decodes, pushes into the session's ring and returns. A sender thread of
//! its own puts what the tick leaves: a put may block for longer than a tick even when it may drop.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, Thread};
use std::time::Duration;

use teleclay_channel::{Purpose, TRAILER};
use teleclay_proto::RealmName;
use teleclay_proto::frame::{HandleFrame, MAX_FRAME};
use teleclay_proto::keys::{self, Key, Leaf, SessionKeys};
use teleclay_shell::Clock;
use teleclay_shell::network::CONTROL_QOS;
use tokio::sync::watch;
use zenoh::Session;
use zenoh::Wait;

use super::sessions::Sessions;
use crate::directory::{Directory, Live};
use crate::doors::{LeaseChannel, Way};
use crate::engine::{FramesIn, Incoming, Leaving, Outgoing, TOOLS};

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
    pub(super) outgoing: Leaving,
    pub(super) sessions: watch::Receiver<Sessions>,
    pub(super) realm: RealmName,
    pub(super) directory: Directory,
}

/// The same thread, with frames to put.
pub(crate) struct FedSender {
    pub(super) sender: Sender,
    pub(super) outgoing: Leaving,
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

    /// Frames come out of these rings.
    pub(crate) fn feed(self, outgoing: Leaving) -> FedSender {
        FedSender {
            sender: self,
            outgoing,
        }
    }
}

/// The way of a tool's frames to its holder.
struct Line {
    live: Live,
    publisher: zenoh::pubsub::Publisher<'static>,
    holder: Option<Arc<LeaseChannel>>,
}

fn send_until(stop: &AtomicBool, sending: Sending) {
    let Sending {
        mut outgoing,
        mut sessions,
        realm,
        directory,
    } = sending;
    let (congestion, priority, is_express, reliability) = CONTROL_QOS;
    let mut session = sessions.borrow_and_update().control.clone();
    let mut lines: HashMap<(u32, usize), Line> = HashMap::new();
    let mut buffer = [0; MAX_FRAME];
    let mut sealed = Vec::with_capacity(MAX_FRAME + TRAILER);
    while !stop.load(Ordering::Relaxed) {
        // An error means that no other session will come.
        if sessions.has_changed().unwrap_or(false) {
            lines.clear();
            session = sessions.borrow_and_update().control.clone();
        }
        while let Ok(Outgoing {
            session: number,
            slot,
            frame,
        }) = outgoing.pop()
        {
            if !lines.contains_key(&(number, slot)) {
                // Those of sessions that are gone take no room for ever.
                lines.retain(|_, line| line.live.is_there());
            }
            let line = match lines.entry((number, slot)) {
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
                        Ok(publisher) => free.insert(Line {
                            live,
                            publisher,
                            holder: None,
                        }),
                        Err(error) => {
                            tracing::error!(%error, "cannot publish frames");
                            continue;
                        }
                    }
                }
            };
            let lease = frame.header.lease;
            if line
                .holder
                .as_ref()
                .is_none_or(|holder| holder.lease != lease)
            {
                line.holder = line.live.channels().at(slot);
            }
            // A lease that has just been granted has no channel yet, and nobody who listens.
            let holder = line.holder.as_ref().filter(|holder| holder.lease == lease);
            let Some(holder) = holder else { continue };
            let bytes = frame.encode(&mut buffer);
            let trailer = holder.channel.trailer(Purpose::Frame, bytes);
            if let Way::Socket(socket) = &holder.way {
                socket.push(bytes, &trailer);
                continue;
            }
            sealed.clear();
            sealed.extend_from_slice(bytes);
            sealed.extend_from_slice(&trailer);
            // An error means that the session is closing.
            let _ = line.publisher.put(&sealed[..]).wait();
        }
        std::thread::park_timeout(SENDER_NAP);
    }
}

/// The way of a key's frames: from whose holder, into which ring.
#[derive(Clone)]
struct Route {
    live: Live,
    ring: FramesIn,
    slot: usize,
}

impl Route {
    /// Whether its session is gone.
    fn is_over(&self) -> bool {
        self.ring.lock().expect("no holder panics").is_abandoned()
    }
}

pub(super) async fn receive_frames(
    session: &Session,
    realm: &RealmName,
    directory: Directory,
    clock: Clock,
) -> Result<(), zenoh::Error> {
    let routes: Mutex<HashMap<String, Route>> = Mutex::new(HashMap::new());
    let callback = move |sample: zenoh::sample::Sample| {
        let arrived_ns = clock.now_ns();
        if MAX_FRAME + TRAILER < sample.payload().len() {
            return;
        }
        let key = sample.key_expr().as_str();
        let mut routes = routes.lock().expect("no holder panics");
        if routes.get(key).is_none_or(Route::is_over) {
            // Keys of sessions that are gone take no room for ever.
            routes.retain(|_, route| !route.is_over());
            let Some(route) = route(key, &directory) else {
                return;
            };
            routes.insert(key.to_owned(), route);
        }
        let Route { live, ring, slot } = routes[key].clone();
        drop(routes);
        let payload = sample.payload().to_bytes();
        // Whoever does not hold the tool is not heard; nor is what comes again.
        let opened = live.channels().at(slot).and_then(|holder| {
            let frame = holder.channel.open(Purpose::Frame, &payload).ok()?;
            Some(HandleFrame::decode(frame))
        });
        let frame = match opened {
            Some(Ok(frame)) => frame,
            Some(Err(_)) | None => return live.count_unheard(),
        };
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

fn route(key: &str, directory: &Directory) -> Option<Route> {
    let Ok(Key {
        session: keys,
        leaf: Leaf::ToolUp(tool),
    }) = key.parse()
    else {
        return None;
    };
    let slot = usize::try_from(tool).ok()?.checked_sub(1)?;
    if TOOLS <= slot {
        return None;
    }
    Some(Route {
        live: directory.session(keys.session())?,
        ring: directory.frames(keys.session())?,
        slot,
    })
}
