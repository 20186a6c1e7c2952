//! Every session of the server, stepped by one 1 kHz thread: the machine that [`teleclay_shell::realtime`] runs.
//!
//! The machine owns its sessions. It takes frames from a ring of each session, and orders; it puts frames, records,
//! events and changed bricks into others. It never allocates, never drops what is large, never locks and never calls
//! Zenoh. What does not fit into a ring is counted, not waited for; bricks that do not fit stay marked in the clay and
//! go later, and events wait in their session.

use std::sync::Arc;
use std::thread::Thread;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};
use teleclay_bilateral::{ToolSide, ToolView};
use teleclay_clay::{BrickView, Clay};
use teleclay_keeping::Keeper;
use teleclay_keeping::keeper::Outbox;
use teleclay_link::arrivals::ArrivalCounts;
use teleclay_link::phase::PhaseLock;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{HandleFrame, ToolFrame};
use teleclay_proto::http::{ClayShape, MAX_TOOLS};
use teleclay_proto::watch::BRICK_VOXELS;
use teleclay_recording::Tap;
use teleclay_session::{Event, Outcome, Prepared, Refusal, Session};
use teleclay_shell::realtime::{Capacities, Claim, Machine, Out, Timing};
use tokio::sync::oneshot;

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
/// Frames that may wait for the tick from one session's handles: a quarter of a second of one of them.
const FRAMES_WAITING: usize = 256;
/// Frames that may wait for the sender.
const FRAMES_LEAVING: usize = 4096;
/// Records of sessions that may wait: a second of all of them at 250 Hz would be more than twice as many.
const RECORDS_WAITING: usize = 4096;
/// Bricks that may wait for the collector of one session.
const BRICKS_WAITING: usize = 256;
/// Events that may wait for the collector, of all sessions.
const EVENTS_WAITING: usize = 1024;

/// Every how many ticks tools are recorded: 250 Hz is beyond any screen, and a quarter of the bytes.
pub(crate) const RECORD_EVERY: u64 = 4;
/// Every how many ticks changed bricks are handed over, and how many at most: 1000 a second, so the 27 around a ball
/// renew at 37 Hz.
const BRICKS_EVERY: u64 = 4;
const BRICKS_AT_ONCE: usize = 4;

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

/// One session at one tick.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SessionRecord {
    pub(crate) session: u32,
    pub(crate) ticks: u64,
    pub(crate) clay_epoch: u32,
    pub(crate) initial_units: u64,
    pub(crate) remaining_units: u64,
    /// Frames that left for handles since the session began.
    pub(crate) frames_sent: u64,
    /// What came from handles since then, those who have left included.
    pub(crate) arrivals: ArrivalCounts,
    pub(crate) tools: [Option<ToolRecord>; TOOLS],
}

/// One tool at one tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ToolRecord {
    pub(crate) lease: u32,
    pub(crate) is_connected: bool,
    pub(crate) silence_s: f64,
    pub(crate) view: ToolView,
    pub(crate) coordination_m: f64,
    pub(crate) rtt_s: Option<f64>,
    /// Sweeps that are in the clay, and of these on disk.
    pub(crate) sweeps: [u32; 2],
}

/// A changed brick on its way to the mirror.
pub(crate) struct BrickUpdate {
    pub(crate) clay_epoch: u32,
    pub(crate) index: u32,
    pub(crate) content: BrickContent,
}

/// What a brick holds now.
#[allow(
    clippy::large_enum_variant,
    reason = "it lies in a ring whose slots have one size; a box would allocate on the tick"
)]
pub(crate) enum BrickContent {
    Empty,
    Full,
    Voxels([u8; BRICK_VOXELS]),
}

/// A session as the tick holds it.
pub(crate) struct Running {
    number: u32,
    session: Session,
    /// Writes its history, where one is kept.
    keeper: Option<Keeper>,
    /// Records it, while somebody wants that.
    tap: Option<Box<Tap>>,
    events: Outbox,
    frames_sent: u64,
    frames: Consumer<Incoming>,
    bricks: Producer<BrickUpdate>,
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

    fn end_recording(&mut self) {
        if let Some(tap) = &mut self.tap {
            tap.end(&mut self.session);
        }
    }
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
    /// Has ticks begin shortly after frames come.
    phase: PhaseLock,
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
            phase: PhaseLock::new(TICK.as_nanos() as u64, MAX_SESSIONS * TOOLS),
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
            let mut newest = [None; TOOLS];
            while let Ok(incoming) = frames.pop() {
                let arrived = Timestamp::from_nanos(incoming.arrived_ns).min(now);
                session.handle_frame(arrived, incoming.slot, &incoming.frame);
                newest[incoming.slot] = Some(now.as_nanos() - arrived.as_nanos());
            }
            for (slot, waited_ns) in newest.into_iter().enumerate() {
                if let Some(waited_ns) = waited_ns {
                    self.phase.on_frame(phase_key(*number, slot), waited_ns);
                }
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

    fn shift_ns(&mut self) -> i64 {
        self.phase.shift_ns()
    }
}

/// What the phase lock knows a tool by.
fn phase_key(session: u32, slot: usize) -> u64 {
    u64::from(session) << 8 | slot as u64
}

fn record(session: &Session, number: u32, frames_sent: u64, now: Timestamp) -> SessionRecord {
    let mut record = SessionRecord {
        session: number,
        ticks: session.ticks(),
        clay_epoch: session.clay_epoch(),
        initial_units: session.clay().initial_units(),
        remaining_units: session.clay().remaining_units(),
        frames_sent,
        arrivals: session.arrivals(),
        tools: [None; TOOLS],
    };
    for (slot, tool) in record.tools.iter_mut().enumerate() {
        *tool = session.side(slot).map(|side| ToolRecord {
            lease: side.lease(),
            is_connected: side.is_connected(now),
            silence_s: side.silence_s(now),
            view: side.view(),
            coordination_m: side.coordination_m(),
            rtt_s: side.round_trip().last().map(|rtt| rtt.as_secs_f64()),
            sweeps: [
                side.frame().sweeps_acknowledged,
                side.frame().sweeps_durable,
            ],
        });
    }
    record
}

fn hand_over_bricks(session: &mut Session, bricks: &mut Producer<BrickUpdate>) {
    let most = bricks.slots().min(BRICKS_AT_ONCE);
    let clay_epoch = session.clay_epoch();
    session.clay_mut().drain_changed(most, |index, view| {
        let content = match view {
            BrickView::Empty => BrickContent::Empty,
            BrickView::Full => BrickContent::Full,
            BrickView::Voxels(voxels) => BrickContent::Voxels(*voxels),
        };
        // There is room, see `most`.
        let _ = bricks.push(BrickUpdate {
            clay_epoch,
            index: index.as_u32(),
            content,
        });
    });
}

/// Where the frames of one session's handles go.
pub(crate) type FramesIn = Arc<std::sync::Mutex<Producer<Incoming>>>;
