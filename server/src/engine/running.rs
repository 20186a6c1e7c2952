//! A session as the tick holds it.

use rtrb::{Consumer, Producer, RingBuffer};
use teleclay_keeping::Keeper;
use teleclay_keeping::keeper::Outbox;
use teleclay_recording::Tap;
use teleclay_session::Session;

use super::Incoming;
use super::record::BrickUpdate;

/// Frames that may wait for the tick from one session's handles: a quarter of a second of one of them.
const FRAMES_WAITING: usize = 256;
/// Bricks that may wait for the collector of one session.
const BRICKS_WAITING: usize = 256;

/// A session as the tick holds it.
pub(crate) struct Running {
    pub(super) number: u32,
    pub(super) session: Session,
    /// Writes its history, where one is kept.
    pub(super) keeper: Option<Keeper>,
    /// Records it, while somebody wants that.
    pub(super) tap: Option<Box<Tap>>,
    pub(super) events: Outbox,
    pub(super) frames_sent: u64,
    pub(super) frames: Consumer<Incoming>,
    pub(super) bricks: Producer<BrickUpdate>,
}

/// The ends of a session's rings that the tick does not hold.
pub(crate) struct RunningEnds {
    pub(crate) frames: Producer<Incoming>,
    pub(crate) bricks: Consumer<BrickUpdate>,
}

impl Running {
    pub(crate) fn new(
        number: u32,
        session: Session,
        keeper: Option<Keeper>,
    ) -> (Box<Self>, RunningEnds) {
        let (frames_in, frames_out) = RingBuffer::new(FRAMES_WAITING);
        let (bricks_in, bricks_out) = RingBuffer::new(BRICKS_WAITING);
        let running = Self {
            number,
            session,
            keeper,
            tap: None,
            events: Outbox::default(),
            frames_sent: 0,
            frames: frames_out,
            bricks: bricks_in,
        };
        let ends = RunningEnds {
            frames: frames_in,
            bricks: bricks_out,
        };
        (Box::new(running), ends)
    }

    pub(super) fn end_recording(&mut self) {
        if let Some(tap) = &mut self.tap {
            tap.end(&mut self.session);
        }
    }
}
