//! The hand of a socket: a lease, frames both ways.
//!
//! A lease that is held here ends with the socket. Frames wait for the socket a moment, so that several share a
//! message, and what a socket that is not read cannot take is forgotten, the oldest first.

use std::future::pending;
use std::sync::Arc;
use std::time::{Duration, Instant};

use teleclay_channel::Purpose;
use teleclay_proto::frame::HandleFrame;
use teleclay_proto::watch::{FrameError, FramesKind, FramesView};
use teleclay_shell::Clock;

use super::pace::Pace;
use crate::directory::{Live, SocketGrant};
use crate::doors::{LeaseChannel, Pass, SocketLine};
use crate::engine::{FramesIn, Incoming};
use crate::session::slot_of;

/// From message to message, at the least: two ticks share one.
const MESSAGES_EVERY: Duration = Duration::from_millis(2);

/// A lease on a socket. Dropping it gives the tool back.
pub(super) struct Hand {
    live: Live,
    lease: u32,
    tool: u32,
    operator: String,
    pass: Pass,
    line: Arc<SocketLine>,
    next_message: Instant,
}

/// What the frames of a lease go through on their way to the tick.
pub(super) struct Hearing {
    live: Live,
    lease: u32,
    tool: u32,
    operator: String,
    pass: Pass,
    frames: FramesIn,
    clock: Clock,
    pace: Pace,
}

impl Hand {
    pub(super) fn new(
        live: Live,
        operator: String,
        pass: Pass,
        grant: SocketGrant,
        clock: Clock,
    ) -> (Self, Hearing) {
        let now = Instant::now();
        let (lease, tool) = (grant.granted.lease, grant.granted.tool);
        let hearing = Hearing {
            live: live.clone(),
            lease,
            tool,
            operator: operator.clone(),
            pass: pass.clone(),
            frames: grant.frames,
            clock,
            pace: Pace::of_a_hand(now),
        };
        let hand = Self {
            live,
            lease,
            tool,
            operator,
            pass,
            line: grant.line,
            next_message: now,
        };
        (hand, hearing)
    }

    pub(super) fn lease(&self) -> u32 {
        self.lease
    }

    pub(super) fn tool(&self) -> u32 {
        self.tool
    }

    pub(super) fn operator(&self) -> &str {
        &self.operator
    }

    pub(super) fn pass(&self) -> &Pass {
        &self.pass
    }

    /// The frames that wait. Others may wait for the next message from now on.
    pub(super) fn outgoing(&mut self) -> Option<Vec<u8>> {
        self.next_message = Instant::now() + MESSAGES_EVERY;
        self.line.take()
    }

    /// How many frames were forgotten since the last call, as the socket was not read.
    pub(super) fn take_forgotten(&self) -> u64 {
        self.line.take_forgotten()
    }

    /// Why the lease has ended, if it has.
    pub(super) fn farewell(&self) -> Option<String> {
        self.line.farewell()
    }
}

impl Hearing {
    pub(super) fn operator(&self) -> &str {
        &self.operator
    }

    pub(super) fn pass(&self) -> Pass {
        self.pass.clone()
    }

    /// Whether another message may be heard: one that sends more than any loop does is heard more slowly.
    pub(super) fn may_hear(&mut self, now: Instant) -> bool {
        self.pace.may_hear(now)
    }

    /// A message of frames came. Those count that the holder of the tool wrote, each once.
    pub(super) fn hear(&mut self, message: &[u8]) -> Result<(), FrameError> {
        let view = FramesView::decode(message)?;
        if view.kind != FramesKind::Handle {
            return Err(FrameError::WrongKind {
                got: view.kind as u8,
                want: FramesKind::Handle as u8,
            });
        }
        let arrived_ns = self.clock.now_ns();
        let slot = slot_of(self.tool);
        let holder = self.live.channels().at(slot);
        let holder = holder.filter(|holder| holder.lease == self.lease);
        for sealed in view.iter() {
            let Some(frame) = holder.as_deref().and_then(|holder| opened(holder, sealed)) else {
                self.live.count_unheard();
                continue;
            };
            // A full ring means that the tick has stalled: what is newest is then as old as the rest.
            let _ = self
                .frames
                .lock()
                .expect("no holder panics")
                .push(Incoming {
                    slot,
                    arrived_ns,
                    frame,
                });
        }
        Ok(())
    }
}

impl Drop for Hand {
    fn drop(&mut self) {
        let (live, lease) = (self.live.clone(), self.lease);
        // Outside of a runtime the server is ending, and every lease with it.
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            // One that has ended already is no more to be left.
            runtime.spawn(async move { live.leave(lease).await.ok() });
        }
    }
}

fn opened(holder: &LeaseChannel, sealed: &[u8]) -> Option<HandleFrame> {
    let frame = holder.channel.open(Purpose::Frame, sealed).ok()?;
    HandleFrame::decode(frame).ok()
}

/// Waits until a message is due, or a farewell; for ever where there is no hand.
pub(super) async fn due(hand: Option<&Hand>) {
    match hand {
        None => pending().await,
        Some(hand) => {
            hand.line.ready().await;
            tokio::time::sleep_until(hand.next_message.into()).await;
        }
    }
}
