//! The tick: every session of the server, stepped by one 1 kHz thread.
//!
//! The thread owns its sessions. It takes frames and orders from lock-free rings and puts frames, records, changed bricks and whatever it no
//! longer needs into others; it never allocates, never drops what is large, never locks and never calls Zenoh. What does not fit into a
//! ring is counted ([`Record::overflowed`]), not waited for; bricks that do not fit stay marked in the clay and go later.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::Thread;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};
use teleclay_bilateral::{FreshBlock, Lines, SessionLoop, ToolSide, ToolView};
use teleclay_clay::{BrickView, Material};
use teleclay_link::arrivals::ArrivalCounts;
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{HandleFrame, ToolFrame};
use teleclay_proto::watch::BRICK_VOXELS;
use teleclay_shell::Clock;
use teleclay_shell::ticker::{Next, Tick, Ticker, TickerConfig};

/// Time between ticks.
pub(crate) const TICK: Duration = Duration::from_millis(1);

/// Sessions at most: what one core steps in half a tick with room to spare.
pub(crate) const MAX_SESSIONS: usize = 32;
/// Tools of a session at most.
pub(crate) const MAX_TOOLS: usize = teleclay_proto::http::MAX_TOOLS as usize;

/// Frames that may wait for the tick from one session's handles: a quarter of a second of one of them.
const FRAMES_WAITING: usize = 256;
/// Frames that may wait for the sender.
const FRAMES_LEAVING: usize = 4096;
/// Records that may wait for the collector: four seconds of ticks.
const RECORDS_WAITING: usize = 4096;
/// Tool records that may wait: a second of eight tools at 250 Hz, and as much again.
const TOOLS_WAITING: usize = 4096;
/// Bricks that may wait for the collector of one session.
const BRICKS_WAITING: usize = 256;
const ORDERS_WAITING: usize = 256;

/// Every how many ticks tools are recorded: 250 Hz is beyond any screen, and a quarter of the bytes.
pub(crate) const RECORD_EVERY: u64 = 4;
/// Every how many ticks changed bricks are handed over, and how many at most: 1000 a second, so the 27 around a ball renew at 37 Hz.
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

/// One tick of the thread.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TickRecord {
    pub(crate) lateness_ns: u64,
    pub(crate) work_ns: u64,
    pub(crate) given_up: u64,
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
    pub(crate) fault: Option<&'static str>,
    pub(crate) tools: [Option<ToolRecord>; MAX_TOOLS],
}

/// One tool at one tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ToolRecord {
    pub(crate) lease: u32,
    pub(crate) is_connected: bool,
    pub(crate) has_left: bool,
    pub(crate) silence_s: f64,
    pub(crate) view: ToolView,
    pub(crate) coordination_m: f64,
    pub(crate) arrivals: ArrivalCounts,
    pub(crate) rtt_s: Option<f64>,
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
    pub(crate) number: u32,
    pub(crate) session: SessionLoop,
    pub(crate) frames_sent: u64,
    pub(crate) frames: Consumer<Incoming>,
    pub(crate) bricks: Producer<BrickUpdate>,
}

/// The ends of a session's rings that the tick does not hold.
pub(crate) struct RunningEnds {
    pub(crate) frames: Producer<Incoming>,
    pub(crate) bricks: Consumer<BrickUpdate>,
}

impl Running {
    pub(crate) fn new(number: u32, session: SessionLoop) -> (Box<Self>, RunningEnds) {
        let (frames_in, frames_out) = RingBuffer::new(FRAMES_WAITING);
        let (bricks_in, bricks_out) = RingBuffer::new(BRICKS_WAITING);
        let running = Self {
            number,
            session,
            frames_sent: 0,
            frames: frames_out,
            bricks: bricks_in,
        };
        (
            Box::new(running),
            RunningEnds {
                frames: frames_in,
                bricks: bricks_out,
            },
        )
    }
}

/// What the tick is told to do, between two ticks.
#[allow(
    clippy::large_enum_variant,
    reason = "orders are few and lie in a ring whose slots have one size"
)]
pub(crate) enum Order {
    Add(Box<Running>),
    Remove {
        session: u32,
    },
    Attach {
        session: u32,
        slot: usize,
        side: Box<ToolSide>,
    },
    Detach {
        session: u32,
        slot: usize,
        lease: u32,
    },
    ReplaceClay {
        session: u32,
        fresh: Box<FreshBlock>,
    },
    SetMaterial {
        session: u32,
        material: Material,
        revision: u16,
    },
    SetLines {
        session: u32,
        lines: Lines,
    },
    SetDeadband {
        session: u32,
        fraction: f64,
        revision: u16,
    },
    SetScheme {
        session: u32,
        scheme: Scheme,
        revision: u16,
    },
    Pause {
        session: u32,
    },
    Resume {
        session: u32,
    },
}

/// What the tick is done with; dropped by the collector.
pub(crate) enum Discarded {
    Session { _session: Box<Running> },
    Side { _side: Box<ToolSide> },
    Block { _block: Box<FreshBlock> },
}

/// Everything that the tick and the rest of the server share without locks.
pub(crate) struct Ends {
    pub(crate) orders: Producer<Order>,
    pub(crate) outgoing: Consumer<Outgoing>,
    pub(crate) ticks: Consumer<TickRecord>,
    pub(crate) sessions: Consumer<SessionRecord>,
    pub(crate) discarded: Consumer<Discarded>,
    pub(crate) shared: Arc<Shared>,
}

/// Counters that any thread may read.
#[derive(Debug, Default)]
pub(crate) struct Shared {
    /// Orders carried out since the start.
    pub(crate) orders_done: AtomicU64,
    /// Ticks since the start.
    pub(crate) ticks: AtomicU64,
    /// Records and frames that found a ring full.
    pub(crate) overflowed: AtomicU64,
}

/// The state of the thread.
pub(crate) struct Engine {
    clock: Clock,
    /// Boxed, so that one that is removed moves out of here without copying its kilobytes on the tick.
    #[allow(clippy::vec_box, reason = "see above")]
    running: Vec<Box<Running>>,
    orders: Consumer<Order>,
    outgoing: Producer<Outgoing>,
    ticks: Producer<TickRecord>,
    sessions: Producer<SessionRecord>,
    discarded: Producer<Discarded>,
    shared: Arc<Shared>,
    sender: Option<Thread>,
}

impl Engine {
    pub(crate) fn new(clock: Clock) -> (Self, Ends) {
        let (orders_in, orders) = RingBuffer::new(ORDERS_WAITING);
        let (outgoing, outgoing_out) = RingBuffer::new(FRAMES_LEAVING);
        let (ticks, ticks_out) = RingBuffer::new(RECORDS_WAITING);
        let (sessions, sessions_out) = RingBuffer::new(TOOLS_WAITING);
        let (discarded, discarded_out) = RingBuffer::new(ORDERS_WAITING);
        let shared = Arc::new(Shared::default());
        let engine = Self {
            clock,
            running: Vec::with_capacity(MAX_SESSIONS),
            orders,
            outgoing,
            ticks,
            sessions,
            discarded,
            shared: Arc::clone(&shared),
            sender: None,
        };
        let ends = Ends {
            orders: orders_in,
            outgoing: outgoing_out,
            ticks: ticks_out,
            sessions: sessions_out,
            discarded: discarded_out,
            shared,
        };
        (engine, ends)
    }

    /// Starts the thread. `sender` is woken when frames wait to leave.
    pub(crate) fn spawn(mut self, config: TickerConfig, sender: Thread) -> std::io::Result<Ticker> {
        self.sender = Some(sender);
        Ticker::spawn(config, move |tick| {
            self.tick(tick);
            Next::Continue
        })
    }

    /// One tick of every session.
    pub(crate) fn tick(&mut self, tick: Tick) {
        let started_ns = self.clock.now_ns();
        self.carry_out_orders();
        let now = Timestamp::from_nanos(started_ns);
        let mut leaves = false;
        let mut overflowed = 0;
        for running in &mut self.running {
            while let Ok(incoming) = running.frames.pop() {
                let arrived = Timestamp::from_nanos(incoming.arrived_ns).min(now);
                running
                    .session
                    .on_frame(arrived, incoming.slot, incoming.frame);
            }
            let (outgoing, session, frames_sent) =
                (&mut self.outgoing, running.number, &mut running.frames_sent);
            running.session.step(now, |slot, frame| {
                leaves = true;
                *frames_sent += 1;
                let full = outgoing
                    .push(Outgoing {
                        session,
                        slot,
                        frame: *frame,
                    })
                    .is_err();
                overflowed += u64::from(full);
            });
        }
        if let Some(sender) = self.sender.as_ref().filter(|_| leaves) {
            sender.unpark();
        }
        for running in &mut self.running {
            let turn = running
                .session
                .ticks()
                .wrapping_add(u64::from(running.number));
            if turn.is_multiple_of(RECORD_EVERY) {
                overflowed += u64::from(self.sessions.push(record(running, now)).is_err());
            }
            if turn.is_multiple_of(BRICKS_EVERY) {
                hand_over_bricks(running);
            }
        }
        let record = TickRecord {
            lateness_ns: tick.lateness.as_nanos() as u64,
            work_ns: self.clock.now_ns() - started_ns,
            given_up: tick.given_up,
        };
        overflowed += u64::from(self.ticks.push(record).is_err());
        self.shared.ticks.fetch_add(1, Ordering::Relaxed);
        if 0 < overflowed {
            self.shared
                .overflowed
                .fetch_add(overflowed, Ordering::Relaxed);
        }
    }

    fn carry_out_orders(&mut self) {
        // An order may leave one thing to discard: without room for it the order waits.
        while 0 < self.discarded.slots() {
            let Ok(order) = self.orders.pop() else { return };
            if let Some(discarded) = self.carry_out(order) {
                // There is room, see above.
                let _ = self.discarded.push(discarded);
            }
            self.shared.orders_done.fetch_add(1, Ordering::Release);
        }
    }

    fn carry_out(&mut self, order: Order) -> Option<Discarded> {
        match order {
            Order::Add(running) if self.running.len() < MAX_SESSIONS => {
                self.running.push(running);
                None
            }
            Order::Add(running) => Some(Discarded::Session { _session: running }),
            Order::Remove { session } => {
                let index = self
                    .running
                    .iter()
                    .position(|running| running.number == session)?;
                Some(Discarded::Session {
                    _session: self.running.swap_remove(index),
                })
            }
            Order::Attach {
                session,
                slot,
                side,
            } => {
                let Some(running) = self.find(session) else {
                    return Some(Discarded::Side { _side: side });
                };
                running
                    .session
                    .attach(slot, side)
                    .map(|side| Discarded::Side { _side: side })
            }
            Order::Detach {
                session,
                slot,
                lease,
            } => {
                let running = self.find(session)?;
                let is_his = running
                    .session
                    .side(slot)
                    .is_some_and(|side| side.lease() == lease);
                if !is_his {
                    return None;
                }
                running
                    .session
                    .detach(slot)
                    .map(|side| Discarded::Side { _side: side })
            }
            Order::ReplaceClay { session, mut fresh } => {
                if let Some(running) = self.find(session) {
                    running.session.swap_clay(&mut fresh);
                }
                Some(Discarded::Block { _block: fresh })
            }
            Order::SetMaterial {
                session,
                material,
                revision,
            } => {
                let session = &mut self.find(session)?.session;
                session.set_material(material, revision);
                None
            }
            Order::SetDeadband {
                session,
                fraction,
                revision,
            } => {
                let session = &mut self.find(session)?.session;
                let set = session.set_deadband(fraction, revision);
                debug_assert!(set.is_ok(), "what is ordered was validated: {set:?}");
                None
            }
            Order::SetLines { session, lines } => {
                self.find(session)?.session.impair(&lines);
                None
            }
            Order::SetScheme {
                session,
                scheme,
                revision,
            } => {
                let session = &mut self.find(session)?.session;
                session.change_scheme(scheme, revision);
                None
            }
            Order::Pause { session } => {
                self.find(session)?.session.pause();
                None
            }
            Order::Resume { session } => {
                self.find(session)?.session.resume();
                None
            }
        }
    }

    fn find(&mut self, session: u32) -> Option<&mut Running> {
        self.running
            .iter_mut()
            .find(|running| running.number == session)
            .map(|running| &mut **running)
    }
}

fn record(running: &Running, now: Timestamp) -> SessionRecord {
    let session = &running.session;
    let mut record = SessionRecord {
        session: running.number,
        ticks: session.ticks(),
        clay_epoch: running.session.generation().epoch,
        initial_units: session.clay().initial_units(),
        remaining_units: session.clay().remaining_units(),
        frames_sent: running.frames_sent,
        fault: session.fault().map(|fault| fault.field),
        tools: [None; MAX_TOOLS],
    };
    for (slot, tool) in record.tools.iter_mut().enumerate() {
        *tool = session.side(slot).map(|side| ToolRecord {
            lease: side.lease(),
            is_connected: side.is_connected(now),
            has_left: side.has_left(),
            silence_s: side.silence_s(now),
            view: *side.view(),
            coordination_m: side.coordination_m(),
            arrivals: side.arrivals(),
            rtt_s: side.round_trip().last().map(|rtt| rtt.as_secs_f64()),
        });
    }
    record
}

fn hand_over_bricks(running: &mut Running) {
    let most = running.bricks.slots().min(BRICKS_AT_ONCE);
    let (bricks, clay_epoch) = (&mut running.bricks, running.session.generation().epoch);
    running
        .session
        .clay_mut()
        .drain_changed(most, |index, view| {
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
