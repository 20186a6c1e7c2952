//! Every session of the server, stepped by one 1 kHz thread: the machine that [`teleclay_shell::realtime`] runs.
//!
//! The machine owns its sessions. It takes frames from a ring of each session, and orders; it puts frames, records,
//! events and changed bricks into others. It never allocates, never drops what is large, never locks and never calls
//! Zenoh. What does not fit into a ring is counted, not waited for; bricks that do not fit stay marked in the clay and
//! go later, and events wait in their session.

mod record;
mod running;

use std::sync::Arc;
use std::thread::Thread;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};
use teleclay_bilateral::ToolSide;
use teleclay_clay::Clay;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{HandleFrame, ToolFrame};
use teleclay_proto::http::{ClayShape, MAX_TOOLS};
use teleclay_recording::Tap;
use teleclay_session::{Event, Outcome, Prepared, Refusal};
use teleclay_shell::realtime::{Capacities, Claim, Machine, Out, Timing};
use tokio::sync::oneshot;

pub(crate) use record::{BrickContent, BrickUpdate, RECORD_EVERY, SessionRecord, ToolRecord};
pub(crate) use running::Running;

use record::{BRICKS_EVERY, hand_over_bricks, record};

/// Time between ticks.
pub(crate) const TICK: Duration = Duration::from_millis(1);

/// Sessions at most: what one core steps in half a tick with room to spare.
pub(crate) const MAX_SESSIONS: usize = 32;
/// Tools of a session at most.
pub(crate) const TOOLS: usize = MAX_TOOLS as usize;

/// Lengths of the thread's own rings. Four seconds of ticks may wait to be counted.
pub(crate) const CAPACITIES: Capacities = Capacities {
    orders: 256,
    done: 512,
    records: 4096,
};
/// Frames that may wait for the sender.
const FRAMES_LEAVING: usize = 4096;
/// Records of sessions that may wait: a second of all of them at 250 Hz would be more than twice as many.
const RECORDS_WAITING: usize = 4096;
/// Events that may wait for the collector, of all sessions.
const EVENTS_WAITING: usize = 1024;

/// A frame on its way from Zenoh to the tick.
pub(crate) struct Incoming {
    pub(crate) slot: usize,
    /// When it came, on the server's clock, ns: the wait for the tick is not the network's.
    pub(crate) arrived_ns: u64,
    pub(crate) frame: HandleFrame,
}

/// A frame on its way from the tick to Zenoh.
pub(crate) struct Outgoing {
    pub(crate) session: u32,
    pub(crate) slot: usize,
    pub(crate) frame: ToolFrame,
}

/// What the tick is told to do, between two ticks; and afterwards, what came of it. Boxed, since it carries what is
/// large both ways.
pub(crate) struct Order {
    pub(crate) claim: Claim,
    pub(crate) task: Task,
    /// Gets the answer from whoever empties the ring of what is done.
    pub(crate) reply: oneshot::Sender<Answer>,
    pub(crate) answer: Answer,
}

/// The watchers' copy of the clay, a few milliseconds behind the tick's.
pub(crate) struct Mirror {
    /// The clay.
    pub(crate) clay: Clay,
    /// What it was when it was fresh.
    pub(crate) shape: ClayShape,
    /// Counts the fresh blocks.
    pub(crate) epoch: u32,
}

/// An order's substance.
#[expect(
    clippy::large_enum_variant,
    reason = "it travels in the box of its order"
)]
pub(crate) enum Task {
    Add(Option<Box<Running>>),
    Remove {
        session: u32,
        removed: Option<Box<Running>>,
    },
    Command {
        session: u32,
        prepared: Prepared,
        /// For a fresh block: a copy of it, for the watchers.
        mirror: Option<Mirror>,
    },
    /// Records a session from now on, or no longer; afterwards what has recorded it so far.
    Record {
        session: u32,
        tap: Option<Box<Tap>>,
    },
}

/// What came of an order.
#[derive(Clone, Debug)]
pub(crate) enum Answer {
    /// It was not carried out: it had been taken back, or there is no such session, or none can be added.
    Undone,
    Done,
    Command(Result<Outcome, Refusal>),
}

/// What the tick is done with.
pub(crate) enum Done {
    Order(Box<Order>),
    /// To be dropped, no more.
    Side {
        _side: Box<ToolSide>,
    },
}

/// The rings of all sessions that the tick does not hold.
pub(crate) struct Ends {
    pub(crate) outgoing: Consumer<Outgoing>,
    pub(crate) sessions: Consumer<SessionRecord>,
    pub(crate) events: Consumer<(u32, Event)>,
}

/// The sessions.
pub(crate) struct Engine {
    /// Boxed, so that one that is removed moves out of here without copying its kilobytes on the tick.
    #[allow(clippy::vec_box, reason = "see above")]
    running: Vec<Box<Running>>,
    outgoing: Producer<Outgoing>,
    sessions: Producer<SessionRecord>,
    events: Producer<(u32, Event)>,
    sender: Option<Thread>,
}

impl Engine {
    /// No session yet. `sender` is woken when frames wait to leave.
    pub(crate) fn new(sender: Option<Thread>) -> (Self, Ends) {
        let (outgoing, outgoing_out) = RingBuffer::new(FRAMES_LEAVING);
        let (sessions, sessions_out) = RingBuffer::new(RECORDS_WAITING);
        let (events, events_out) = RingBuffer::new(EVENTS_WAITING);
        let engine = Self {
            running: Vec::with_capacity(MAX_SESSIONS),
            outgoing,
            sessions,
            events,
            sender,
        };
        let ends = Ends {
            outgoing: outgoing_out,
            sessions: sessions_out,
            events: events_out,
        };
        (engine, ends)
    }

    fn find(&mut self, number: u32) -> Option<&mut Running> {
        self.running
            .iter_mut()
            .find(|running| running.number == number)
            .map(|running| &mut **running)
    }

    fn perform(&mut self, now: Timestamp, task: &mut Task) -> Answer {
        match task {
            Task::Add(running) => {
                if self.running.len() < MAX_SESSIONS
                    && let Some(running) = running.take()
                {
                    self.running.push(running);
                    return Answer::Done;
                }
                Answer::Undone
            }
            Task::Remove { session, removed } => {
                let mut numbers = self.running.iter().map(|running| running.number);
                let Some(index) = numbers.position(|number| number == *session) else {
                    return Answer::Undone;
                };
                self.running[index].end_recording();
                *removed = Some(self.running.swap_remove(index));
                Answer::Done
            }
            Task::Command {
                session, prepared, ..
            } => match self.find(*session) {
                Some(running) => Answer::Command(running.session.handle_command(now, prepared)),
                None => Answer::Undone,
            },
            Task::Record { session, tap } => match self.find(*session) {
                Some(running) => {
                    running.end_recording();
                    std::mem::swap(&mut running.tap, tap);
                    Answer::Done
                }
                None => Answer::Undone,
            },
        }
    }
}

impl Machine for Engine {
    type Order = Box<Order>;
    type Done = Done;
    type Record = Timing;
    type Failure = std::convert::Infallible;

    fn carry_out(&mut self, now: Timestamp, mut order: Box<Order>) -> Done {
        order.answer = if order.claim.carry_out() {
            self.perform(now, &mut order.task)
        } else {
            Answer::Undone
        };
        Done::Order(order)
    }

    /// One tick of every session.
    fn tick(&mut self, now: Timestamp, out: &mut Out<Self>) -> Result<(), Self::Failure> {
        let (mut leaves, mut overflowed) = (false, 0);
        for running in &mut self.running {
            let Running {
                number,
                session,
                keeper,
                tap,
                events,
                frames_sent,
                frames,
                bricks,
            } = &mut **running;
            while let Ok(incoming) = frames.pop() {
                let arrived = Timestamp::from_nanos(incoming.arrived_ns).min(now);
                session.handle_frame(arrived, incoming.slot, &incoming.frame);
            }
            match tap {
                Some(tap) => session.tick_heard(now, |slot, arrived, frame| {
                    tap.on_frame(slot, arrived, frame);
                }),
                None => session.tick(now),
            }
            while let Some((slot, frame)) = session.poll_transmit() {
                leaves = true;
                *frames_sent += 1;
                let outgoing = Outgoing {
                    session: *number,
                    slot,
                    frame: *frame,
                };
                overflowed += u64::from(self.outgoing.push(outgoing).is_err());
            }
            // What orders have changed since the last tick is among these.
            {
                let fresh = events.take_from(session);
                if let Some(tap) = tap {
                    tap.on_tick(session, now, fresh.clone());
                }
                if let Some(keeper) = keeper {
                    keeper.on_tick(session, fresh);
                }
            }
            while 0 < self.events.slots()
                && let Some(event) = events.pop()
            {
                // There is room, see above.
                let _ = self.events.push((*number, event));
            }
            while 0 < out.room_to_retire()
                && let Some(side) = session.poll_retired()
            {
                out.retire(Done::Side { _side: side });
            }
            // Sessions take turns, so that no tick has the records or bricks of all of them.
            let phase = session.ticks().wrapping_add(u64::from(*number));
            if phase.is_multiple_of(RECORD_EVERY) {
                let record = record(session, *number, *frames_sent, now);
                overflowed += u64::from(self.sessions.push(record).is_err());
            }
            if phase.is_multiple_of(BRICKS_EVERY) {
                hand_over_bricks(session, bricks);
            }
        }
        if leaves && let Some(sender) = &self.sender {
            sender.unpark();
        }
        out.count_overflowed(overflowed);
        Ok(())
    }

    fn after_tick(&mut self, timing: Timing, out: &mut Out<Self>) {
        // One that finds no room is counted by the ring.
        let _ = out.record(timing);
    }
}

/// Where the frames of one session's handles go.
pub(crate) type FramesIn = Arc<std::sync::Mutex<Producer<Incoming>>>;
