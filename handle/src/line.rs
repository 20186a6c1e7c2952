//! What one lease needs of the network: frames up, frames down, and a sign of life.

use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use rtrb::Producer;
use teleclay_bilateral::ParameterError;
use teleclay_channel::{Channel, Purpose, TRAILER};
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{MAX_FRAME, ToolFrame};
use teleclay_proto::http::parse;
use teleclay_proto::join::Farewell;
use teleclay_shell::Clock;
use teleclay_shell::network::CONTROL_QOS;
use tokio::sync::mpsc::UnboundedSender;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

use crate::attachment::{Arrived, LineEnds};
use crate::grant::JoinGrant;
use crate::outbox::Sender;

/// A longer last word is none.
const LONGEST_FAREWELL: usize = 1024;

/// Why a lease cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LineError {
    /// The parameters make no loop.
    #[error("the server's parameters make no loop: {0}")]
    Parameters(#[from] ParameterError),
    /// The system has no thread to give.
    #[error("the sending thread: {0}")]
    Thread(#[from] io::Error),
    /// Zenoh does not declare what is needed.
    #[error("zenoh: {reason}")]
    Zenoh {
        /// In its words.
        reason: String,
    },
}

/// Frames that came and were of no use.
#[derive(Debug, Default)]
pub(crate) struct Rejected {
    unheard: AtomicU64,
    undecodable: AtomicU64,
    foreign: AtomicU64,
    overflowed: AtomicU64,
}

impl Rejected {
    /// Payloads that the server of the lease did not write, or that came again.
    pub(crate) fn unheard(&self) -> u64 {
        self.unheard.load(Ordering::Relaxed)
    }

    /// Payloads that are no frame of this version.
    pub(crate) fn undecodable(&self) -> u64 {
        self.undecodable.load(Ordering::Relaxed)
    }

    /// Frames under another lease.
    pub(crate) fn foreign(&self) -> u64 {
        self.foreign.load(Ordering::Relaxed)
    }

    /// Frames that found the tick's ring full.
    pub(crate) fn overflowed(&self) -> u64 {
        self.overflowed.load(Ordering::Relaxed)
    }
}

/// The network's end of one lease. Dropping it ends the frames both ways.
pub(crate) struct Line {
    pub(crate) grant: Box<JoinGrant>,
    rejected: Arc<Rejected>,
    sender: Sender,
    _down: Subscriber<()>,
    _farewell: Subscriber<()>,
    _alive: Subscriber<()>,
    _presence: LivelinessToken,
}

impl Line {
    /// Declares everything, and gives the tick its ends. `gone` gets the lease when the server goes, or says
    /// that the lease is over: a process that dies takes its connections with it, and that is seen at once. One that
    /// no longer answers is not seen so; silence tells of it.
    ///
    /// # Errors
    /// A resource is missing.
    pub(crate) async fn open(
        control: &Session,
        slow: &Session,
        clock: Clock,
        grant: Box<JoinGrant>,
        gone: UnboundedSender<Gone>,
    ) -> Result<(Self, LineEnds), LineError> {
        let JoinGrant {
            keys,
            granted,
            channel,
        } = &*grant;
        let (congestion, priority, express, reliability) = CONTROL_QOS;
        let up = control
            .declare_publisher(keys.tool_up(granted.tool))
            .congestion_control(congestion)
            .priority(priority)
            .express(express)
            .reliability(reliability)
            .await
            .map_err(zenoh_error)?;
        let sealing = Arc::clone(channel);
        let mut sealed = Vec::with_capacity(MAX_FRAME + TRAILER);
        let (outbox, sender) = Sender::spawn(clock, move |frame| {
            sealed.clear();
            sealed.extend_from_slice(frame);
            sealed.extend_from_slice(&sealing.trailer(Purpose::Frame, frame));
            up.put(&sealed[..]).wait().is_ok()
        })?;
        let (ends, arriving) = LineEnds::new(granted, outbox);
        let rejected = Arc::new(Rejected::default());
        let arrivals = Arrivals {
            clock,
            lease: granted.lease,
            channel: Arc::clone(channel),
            arriving,
            rejected: Arc::clone(&rejected),
        };
        // Zenoh asks for a callback that any thread may call; it calls it from one at a time, and the tick never comes
        // here.
        let arrivals = Mutex::new(arrivals);
        let down = control
            .declare_subscriber(keys.tool_down(granted.tool))
            .callback(move |sample| {
                arrivals
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .on_sample(&sample);
            })
            .await
            .map_err(zenoh_error)?;
        let lease = granted.lease;
        let (tell, opens) = (gone.clone(), Arc::clone(channel));
        let farewell = control
            .declare_subscriber(keys.tool_farewell(granted.tool))
            .callback(move |sample| {
                if let Some(reason) = last_word(&opens, lease, &sample) {
                    let reason = Some(reason);
                    // Whoever listened has gone: then nobody needs to know.
                    let _ = tell.send(Gone { lease, reason });
                }
            })
            .await
            .map_err(zenoh_error)?;
        let alive = slow
            .liveliness()
            .declare_subscriber(keys.alive())
            .history(true)
            .callback(move |sample| {
                if sample.kind() == SampleKind::Delete {
                    // Whoever listened has gone: then nobody needs to know.
                    let reason = None;
                    let _ = gone.send(Gone { lease, reason });
                }
            })
            .await
            .map_err(zenoh_error)?;
        let presence = slow
            .liveliness()
            .declare_token(keys.operator(granted.lease))
            .await
            .map_err(zenoh_error)?;
        Ok((
            Self {
                grant,
                rejected,
                sender,
                _down: down,
                _farewell: farewell,
                _alive: alive,
                _presence: presence,
            },
            ends,
        ))
    }

    /// Frames that came and were of no use.
    pub(crate) fn rejected(&self) -> &Rejected {
        &self.rejected
    }

    /// Frames that went out.
    pub(crate) fn sent(&self) -> u64 {
        self.sender.counts().sent()
    }

    /// Frames that the tick made and nobody sent: too old, or not taken by the network.
    pub(crate) fn unsent(&self) -> u64 {
        self.sender.counts().unsent()
    }
}

/// A lease that is over, or seems to be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Gone {
    pub(crate) lease: u32,
    /// Why, where the server itself said so.
    pub(crate) reason: Option<String>,
}

/// What the server says at the end of a lease, if it is the server that says it.
fn last_word(channel: &Channel, lease: u32, sample: &Sample) -> Option<String> {
    if LONGEST_FAREWELL < sample.payload().len() {
        return None;
    }
    let sealed = sample.payload().to_bytes();
    let message = channel.open(Purpose::Leave, &sealed).ok()?;
    let farewell: Farewell = parse(message).ok()?;
    (farewell.lease == lease).then_some(farewell.reason)
}

/// Runs on Zenoh's own thread, where anything slow would hold up every session: open, decode, push, return.
struct Arrivals {
    clock: Clock,
    lease: u32,
    channel: Arc<Channel>,
    arriving: Producer<Arrived>,
    rejected: Arc<Rejected>,
}

impl Arrivals {
    fn on_sample(&mut self, sample: &Sample) {
        let at = Timestamp::from_nanos(self.clock.now_ns());
        let count = match self.open(sample) {
            Err(Useless::Unheard) => &self.rejected.unheard,
            Err(Useless::Undecodable) => &self.rejected.undecodable,
            Ok(frame) if frame.header.lease != self.lease => &self.rejected.foreign,
            Ok(frame) => match self.arriving.push(Arrived { at, frame }) {
                Ok(()) => return,
                Err(_) => &self.rejected.overflowed,
            },
        };
        count.fetch_add(1, Ordering::Relaxed);
    }

    /// The frame, if it is one that the server has sealed and that comes for the first time.
    fn open(&self, sample: &Sample) -> Result<ToolFrame, Useless> {
        if MAX_FRAME + TRAILER < sample.payload().len() {
            return Err(Useless::Unheard);
        }
        let sealed = sample.payload().to_bytes();
        let opened = self.channel.open(Purpose::Frame, &sealed);
        let frame = opened.map_err(|_| Useless::Unheard)?;
        ToolFrame::decode(frame).map_err(|_| Useless::Undecodable)
    }
}

/// Why a payload is of no use.
enum Useless {
    Unheard,
    Undecodable,
}

fn zenoh_error(error: zenoh::Error) -> LineError {
    LineError::Zenoh {
        reason: error.to_string(),
    }
}
