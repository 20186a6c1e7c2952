//! Frames in and out. The callback for frames decodes, pushes into the session's ring and returns. A sender thread of
//! its own puts what the tick leaves: a put may block for longer than a tick even when it may drop.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use teleclay_channel::{Purpose, TRAILER};
use teleclay_proto::RealmName;
use teleclay_proto::frame::{HandleFrame, MAX_FRAME};
use teleclay_proto::keys::SessionKeys;
use teleclay_shell::Clock;
use teleclay_shell::beside::{Beside, Waking};
use teleclay_shell::network::CONTROL_QOS;
use tokio::sync::watch;
use zenoh::Session;
use zenoh::Wait;
use zenoh::pubsub::Subscriber;

use super::sessions::Sessions;
use crate::directory::{Directory, Live};
use crate::doors::{LeaseChannel, Way};
use crate::engine::{FramesIn, Incoming, Leaving, Outgoing, TOOLS};

/// The sender looks at least this often whether other sessions of Zenoh have taken the place of its own.
const SENDER_NAP: Duration = Duration::from_millis(100);

/// The thread that puts frames, before it knows of Zenoh: the tick needs its handle to wake it.
pub(crate) struct Sender {
    pub(super) stop: Arc<AtomicBool>,
    pub(super) thread: JoinHandle<()>,
    waking: Waking,
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
        let beside = Beside::new();
        let place = beside.place();
        let thread = std::thread::Builder::new()
            .name("sender".to_owned())
            .spawn(move || {
                if let Ok(sending) = started.recv() {
                    send_until(&asked_to_stop, sending, beside);
                }
            })?;
        Ok(Self {
            stop,
            waking: place.waking(thread.thread()),
            thread,
            start,
        })
    }

    pub(crate) const fn waking(&self) -> &Waking {
        &self.waking
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

fn send_until(stop: &AtomicBool, sending: Sending, mut beside: Beside) {
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
        beside.follow();
    }
}

/// Hears the frames of each session's tools, on their own keys as long as the session is there.
///
/// A subscriber for all of them at once would cost more: Zenoh finds the route of a key that was declared, and whether
/// access control lets it through, once; of a key that only a wildcard matches, anew for each message.
pub(super) async fn hear_sessions(
    session: Session,
    realm: RealmName,
    directory: Directory,
    clock: Clock,
) {
    let mut heard: HashMap<u32, Vec<Subscriber<()>>> = HashMap::new();
    let mut changes = directory.changes();
    loop {
        let lives = directory.lives();
        // A subscriber that is dropped is undeclared.
        heard.retain(|number, _| lives.iter().any(|live| live.number() == *number));
        for live in lives {
            if heard.contains_key(&live.number()) {
                continue;
            }
            let Some(ring) = directory.frames(live.id()) else {
                continue;
            };
            let mut subscribers = Vec::with_capacity(TOOLS);
            for slot in 0..TOOLS {
                let way = InWay {
                    live: live.clone(),
                    ring: Arc::clone(&ring),
                    slot,
                };
                match hear(&session, &realm, way, clock).await {
                    Ok(subscriber) => subscribers.push(subscriber),
                    Err(error) => tracing::error!(%error, "a tool's frames cannot be heard"),
                }
            }
            // What is not whole is tried again when the next session comes or goes.
            if subscribers.len() == TOOLS {
                heard.insert(live.number(), subscribers);
            }
        }
        // The directory lives as long as this task does.
        if changes.changed().await.is_err() || session.is_closed() {
            return;
        }
    }
}

/// The way of a tool's frames: from its holder, into its session's ring.
struct InWay {
    live: Live,
    ring: FramesIn,
    slot: usize,
}

async fn hear(
    session: &Session,
    realm: &RealmName,
    way: InWay,
    clock: Clock,
) -> Result<Subscriber<()>, zenoh::Error> {
    let tool = crate::session::tool_id(way.slot);
    let key = SessionKeys::new(realm.clone(), way.live.id().clone()).tool_up(tool);
    let own = key.clone();
    let callback = move |sample: zenoh::sample::Sample| {
        let arrived_ns = clock.now_ns();
        // What is put on a wildcard comes here, too: nobody may make one message many.
        if sample.key_expr().as_str() == own {
            way.take(arrived_ns, &sample);
        }
    };
    session.declare_subscriber(key).callback(callback).await
}

impl InWay {
    fn take(&self, arrived_ns: u64, sample: &zenoh::sample::Sample) {
        let Self { live, ring, slot } = self;
        if MAX_FRAME + TRAILER < sample.payload().len() {
            return;
        }
        let payload = sample.payload().to_bytes();
        // Whoever does not hold the tool is not heard; nor is what comes again.
        let opened = live.channels().at(*slot).and_then(|holder| {
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
            slot: *slot,
            arrived_ns,
            frame,
        });
    }
}
