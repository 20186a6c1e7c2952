//! The sessions of a 1 kHz thread, stepped by it: the machine that [`teleclay_shell::realtime`] runs. There are as many
//! machines as threads, and a session lives on one of them.
//!
//! The machine owns its sessions. It takes frames from a ring of each session, and orders; it puts frames, records,
//! events and changed bricks into others. It never allocates, never drops what is large, never locks and never calls
//! Zenoh. What does not fit into a ring is counted, not waited for; bricks that do not fit stay marked in the clay and
//! go later, and events wait in their session.
//!
//! A session moves from one thread to another between two of its ticks, with its ends of its rings. Each thread follows
//! the frames of its own sessions with its deadlines, so a session takes along when its next tick is due, and that is
//! then at the deadline of its new thread which is nearest: half a tick sooner or later at most. A thread makes no tick
//! of a session that it has had elsewhere, and makes up for one that neither has made. A session at rest has no ticks
//! made at all: now and then they are counted, and before an order is carried out in it. A thread whose sessions are
//! all at rest sleeps.

mod record;
mod running;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};
use teleclay_bilateral::ToolSide;
use teleclay_clay::Clay;
use teleclay_link::phase::PhaseLock;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{HandleFrame, ToolFrame};
use teleclay_proto::http::{ClayShape, MAX_TOOLS};
use teleclay_recording::Tap;
use teleclay_session::{Outcome, Prepared, Refusal};
use teleclay_shell::beside::Waking;
use teleclay_shell::realtime::{Capacities, Claim, Machine, Out, Timing};
use teleclay_shell::ticker::{Tick, Waker};
use tokio::sync::oneshot;

pub(crate) use record::{BrickContent, BrickUpdate, RECORD_EVERY, SessionRecord, ToolRecord};
pub(crate) use running::{Running, Told};

use running::{REST_TICKS, ThreadTick, Ways};

/// Time between ticks.
pub(crate) const TICK: Duration = Duration::from_millis(1);

/// Sessions at most: what one core steps in half a tick with room to spare.
pub(crate) const MAX_SESSIONS: usize = 32;
/// Tools of a session at most.
pub(crate) const TOOLS: usize = MAX_TOOLS as usize;

/// Threads at most: four sessions on each, when there are as many as there may be.
pub(crate) const MAX_THREADS: usize = 8;

/// The threads' names, as the system has them: 15 bytes at most.
pub(crate) const THREAD_NAMES: [&str; MAX_THREADS] = [
    "teleclay-loop",
    "teleclay-loop-1",
    "teleclay-loop-2",
    "teleclay-loop-3",
    "teleclay-loop-4",
    "teleclay-loop-5",
    "teleclay-loop-6",
    "teleclay-loop-7",
];

/// Lengths of a thread's own rings. Four seconds of ticks may wait to be counted.
pub(crate) const CAPACITIES: Capacities = Capacities {
    orders: 256,
    done: 512,
    records: 4096,
};
/// Frames that may wait for the sender.
const FRAMES_LEAVING: usize = 4096;
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
    /// Has a session live on another thread from its next tick on.
    Move {
        session: u32,
        to: usize,
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

/// Frames that leave for handles, of all threads, for the one who sends them.
///
/// A session's frames come out in order while it lives on one thread. When it moves, the last one from the old thread
/// and the first one from the new are a tick apart; should they be taken out together all the same, whoever gets them
/// keeps to the newest, as after any network.
pub(crate) struct Leaving(Vec<Consumer<Outgoing>>);

impl Leaving {
    /// The next one, of whatever thread.
    pub(crate) fn pop(&mut self) -> Result<Outgoing, rtrb::PopError> {
        let popped = self.0.iter_mut().find_map(|ring| ring.pop().ok());
        popped.ok_or(rtrb::PopError::Empty)
    }
}

/// The sessions that live on one thread.
pub(crate) struct Engine {
    thread: usize,
    /// Boxed, so that one that is removed or moves out of here without copying its kilobytes on the tick.
    #[allow(clippy::vec_box, reason = "see above")]
    running: Vec<Box<Running>>,
    outgoing: Producer<Outgoing>,
    sender: Option<Waking>,
    /// Sessions that come from other threads.
    arriving: Vec<Consumer<Box<Running>>>,
    /// The way to each thread; none to itself.
    ways: Vec<Option<Way>>,
    at: ThreadTick,
    /// Whether nothing is to be done in any tick until an order comes.
    is_at_rest: bool,
    /// Has ticks begin shortly after frames come.
    phase: PhaseLock,
}

/// The way from one thread to another.
struct Way {
    ring: Producer<Box<Running>>,
    waker: Waker,
}

/// The machine of a thread, and what wakes it.
pub(crate) struct Threaded {
    pub(crate) engine: Engine,
    pub(crate) waker: Waker,
}

impl Engine {
    /// So many machines without a session, from each of which sessions can go to every other. `sender` is woken when
    /// frames wait to leave.
    pub(crate) fn threads(count: usize, sender: Option<&Waking>) -> (Vec<Threaded>, Leaving) {
        let wakers: Vec<Waker> = (0..count).map(|_| Waker::default()).collect();
        let mut leaving = Vec::with_capacity(count);
        let mut threads: Vec<Threaded> = (0..count)
            .map(|thread| {
                let (outgoing, outgoing_out) = RingBuffer::new(FRAMES_LEAVING);
                leaving.push(outgoing_out);
                let engine = Self {
                    thread,
                    running: Vec::with_capacity(MAX_SESSIONS),
                    outgoing,
                    sender: sender.map(|sender| match count {
                        1 => sender.clone(),
                        _ => sender.by_one_of_several(),
                    }),
                    arriving: Vec::with_capacity(count),
                    ways: Vec::with_capacity(count),
                    at: ThreadTick::of(thread),
                    is_at_rest: false,
                    phase: PhaseLock::new(TICK.as_nanos() as u64, MAX_SESSIONS * TOOLS),
                };
                Threaded {
                    engine,
                    waker: wakers[thread].clone(),
                }
            })
            .collect();
        for from in 0..count {
            for (to, waker) in wakers.iter().enumerate() {
                let way = (from != to).then(|| {
                    // Every session finds room.
                    let (ring, arriving) = RingBuffer::new(MAX_SESSIONS);
                    threads[to].engine.arriving.push(arriving);
                    Way {
                        ring,
                        waker: waker.clone(),
                    }
                });
                threads[from].engine.ways.push(way);
            }
        }
        (threads, Leaving(leaving))
    }

    /// A session that lives here, brought up to the tick before this one.
    fn find(&mut self, number: u32) -> Option<&mut Running> {
        let mut all = self.running.iter_mut();
        let running = all.find(|running| running.number == number)?;
        running.catch_up(self.at.now, self.at.number);
        Some(running)
    }

    fn perform(&mut self, now: Timestamp, task: &mut Task) -> Answer {
        match task {
            Task::Add(running) => {
                if self.running.len() < MAX_SESSIONS
                    && let Some(mut running) = running.take()
                {
                    running.due = self.at.number;
                    self.running.push(running);
                    return Answer::Done;
                }
                Answer::Undone
            }
            Task::Remove { session, removed } => {
                let Some(running) = self.find(*session) else {
                    return Answer::Undone;
                };
                running.end_recording();
                let mut numbers = self.running.iter().map(|running| running.number);
                let Some(index) = numbers.position(|number| number == *session) else {
                    return Answer::Undone;
                };
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
            Task::Move { session, to } => {
                if !matches!(self.ways.get(*to), Some(Some(_))) {
                    return Answer::Undone;
                }
                match self.find(*session) {
                    Some(running) => {
                        running.leaving = Some(*to);
                        Answer::Done
                    }
                    None => Answer::Undone,
                }
            }
        }
    }

    /// Sessions whose tick is made go where they are to go: what is due there is their next one.
    fn send_away(&mut self) {
        let mut index = 0;
        while let Some(running) = self.running.get_mut(index) {
            let way = running.leaving.and_then(|to| self.ways[to].as_mut());
            match way {
                Some(way) if 0 < way.ring.slots() => {
                    running.leaving = None;
                    running.leaves_at(self.at);
                    // There is room, and nobody else fills this ring.
                    let _ = way.ring.push(self.running.swap_remove(index));
                    way.waker.wake();
                }
                // Without room, after the next tick.
                _ => index += 1,
            }
        }
    }
}

impl Machine for Engine {
    type Order = Box<Order>;
    type Done = Done;
    type Record = Timing;
    type Failure = std::convert::Infallible;

    fn begin(&mut self, now: Timestamp, tick: &Tick) {
        self.at = ThreadTick {
            thread: self.thread,
            number: tick.number,
            deadline_ns: tick.deadline_ns,
            now,
            is_late: TICK < tick.lateness,
            has_rested: 0 < tick.rested,
        };
        for arriving in &mut self.arriving {
            while self.running.len() < MAX_SESSIONS
                && let Ok(mut running) = arriving.pop()
            {
                running.arrives_at(self.at);
                self.running.push(running);
            }
        }
    }

    fn carry_out(&mut self, now: Timestamp, mut order: Box<Order>) -> Done {
        order.answer = if order.claim.carry_out() {
            self.perform(now, &mut order.task)
        } else {
            Answer::Undone
        };
        Done::Order(order)
    }

    /// One tick of every session.
    fn tick(&mut self, _now: Timestamp, out: &mut Out<Self>) -> Result<(), Self::Failure> {
        let (mut leaves, mut overflowed) = (false, 0);
        self.is_at_rest = true;
        for running in &mut self.running {
            let ways = Ways {
                outgoing: &mut self.outgoing,
                phase: &mut self.phase,
                out,
            };
            let stepped = running.tick(self.at, ways);
            self.is_at_rest &= stepped.is_at_rest;
            leaves |= stepped.leaves;
            overflowed += stepped.overflowed;
        }
        if leaves && let Some(sender) = &self.sender {
            sender.wake();
        }
        self.send_away();
        out.count_overflowed(overflowed);
        Ok(())
    }

    fn after_tick(&mut self, timing: Timing, out: &mut Out<Self>) {
        // One that finds no room is counted by the ring.
        let _ = out.record(timing);
    }

    fn shift_ns(&mut self) -> i64 {
        self.phase.shift_ns()
    }

    fn may_rest(&self) -> u32 {
        if self.is_at_rest {
            REST_TICKS as u32
        } else {
            0
        }
    }
}

/// Where the frames of one session's handles go.
pub(crate) type FramesIn = Arc<std::sync::Mutex<Producer<Incoming>>>;
