//! A session as the tick holds it, with its ends of its own rings: whatever thread it lives on, they go with it.

use rtrb::{Consumer, Producer, RingBuffer};
use teleclay_keeping::Keeper;
use teleclay_keeping::keeper::Outbox;
use teleclay_link::phase::PhaseLock;
use teleclay_link::time::Timestamp;
use teleclay_recording::Tap;
use teleclay_session::{Event, Session};
use teleclay_shell::realtime::Out;
use teleclay_shell::ticker::{MOST_BEHIND, thread_time_ns};

use super::record::{
    BRICKS_EVERY, BrickUpdate, RECORD_EVERY, SessionRecord, hand_over_bricks, record,
};
use super::{Done, Engine, Incoming, Outgoing, TICK, TOOLS};

const TICK_NS: u64 = TICK.as_nanos() as u64;
/// Frames that may wait for the tick from one session's handles: a quarter of a second of one of them.
const FRAMES_WAITING: usize = 256;
/// Bricks that may wait for the collector of one session.
const BRICKS_WAITING: usize = 256;
/// Records that may wait for the collector of one session: half a second of them at 250 Hz.
const RECORDS_WAITING: usize = 128;
/// Events that may wait for the collector of one session.
const EVENTS_WAITING: usize = 256;

/// A session at rest is brought up to date so often, in ticks, and its records tell of that: twenty times a second.
pub(crate) const REST_TICKS: u64 = 50;
/// Every how many ticks a session's work is measured. It shares no factor with the rhythm of records and bricks, so
/// that ticks with and without these are measured alike.
const MEASURED_EVERY: u64 = 5;

/// A session as the tick holds it.
pub(crate) struct Running {
    pub(super) number: u32,
    pub(super) session: Session,
    /// Writes its history, where one is kept.
    pub(super) keeper: Option<Keeper>,
    /// Records it, while somebody wants that.
    pub(super) tap: Option<Box<Tap>>,
    /// Number of its next tick's deadline on its thread.
    pub(super) due: u64,
    /// When that is, ns, while it is between two threads.
    due_ns: u64,
    /// The thread that it goes to once this tick is over.
    pub(super) leaving: Option<usize>,
    /// It has just come to this thread, and nobody was told yet.
    pub(super) is_new: bool,
    events: Outbox,
    frames_sent: u64,
    /// Ticks that started more than a whole tick late.
    late_ticks: u64,
    /// What its last tick that was measured took, until it is told.
    work_ns: Option<u64>,
    frames: Consumer<Incoming>,
    bricks: Producer<BrickUpdate>,
    told: Producer<Event>,
    records: Producer<SessionRecord>,
}

/// The ends of a session's rings that the tick does not hold.
pub(crate) struct RunningEnds {
    pub(crate) frames: Producer<Incoming>,
    /// For the collector.
    pub(crate) told: Told,
}

/// What a session tells the collector.
pub(crate) struct Told {
    pub(crate) bricks: Consumer<BrickUpdate>,
    pub(crate) events: Consumer<Event>,
    pub(crate) records: Consumer<SessionRecord>,
}

/// One tick of a thread, as its sessions see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct ThreadTick {
    /// The thread.
    pub(super) thread: usize,
    /// Number of its deadline.
    pub(super) number: u64,
    /// When that was, ns.
    pub(super) deadline_ns: u64,
    pub(super) now: Timestamp,
    /// It started more than a whole tick late.
    pub(super) is_late: bool,
    /// The thread has slept through deadlines just before.
    pub(super) has_rested: bool,
}

/// Where a tick of a session leaves what goes elsewhere.
pub(super) struct Ways<'a> {
    pub(super) outgoing: &'a mut Producer<Outgoing>,
    /// Hears how long frames have waited.
    pub(super) phase: &'a mut PhaseLock,
    pub(super) out: &'a mut Out<Engine>,
}

/// What a tick of a session has come to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stepped {
    /// Nothing was to be done, and nothing is until somebody gives an order.
    pub(super) is_at_rest: bool,
    /// Frames wait for the sender.
    pub(super) leaves: bool,
    /// What found no room.
    pub(super) overflowed: u64,
}

impl Running {
    pub(crate) fn new(
        number: u32,
        session: Session,
        keeper: Option<Keeper>,
    ) -> (Box<Self>, RunningEnds) {
        let (frames_in, frames_out) = RingBuffer::new(FRAMES_WAITING);
        let (bricks_in, bricks_out) = RingBuffer::new(BRICKS_WAITING);
        let (told, events_out) = RingBuffer::new(EVENTS_WAITING);
        let (records, records_out) = RingBuffer::new(RECORDS_WAITING);
        let running = Self {
            number,
            session,
            keeper,
            tap: None,
            due: 0,
            due_ns: 0,
            leaving: None,
            is_new: true,
            events: Outbox::default(),
            frames_sent: 0,
            late_ticks: 0,
            work_ns: None,
            frames: frames_out,
            bricks: bricks_in,
            told,
            records,
        };
        let ends = RunningEnds {
            frames: frames_in,
            told: Told {
                bricks: bricks_out,
                events: events_out,
                records: records_out,
            },
        };
        (Box::new(running), ends)
    }

    /// Whether its ticks do nothing until somebody gives an order.
    fn is_at_rest(&self) -> bool {
        self.tap.is_none()
            && self.leaving.is_none()
            && self.session.is_at_rest()
            && self.session.clay().changed_count() == 0
            && self.events.is_empty()
            && self.keeper.as_ref().is_none_or(Keeper::is_settled)
    }

    /// An order is about to be carried out before tick `number`: one that rests is brought up to the tick before.
    pub(super) fn catch_up(&mut self, now: Timestamp, number: u64) {
        if self.due < number && self.is_at_rest() {
            self.session.rest(now, number - self.due);
            self.due = number;
        }
    }

    /// It goes to another thread, whose deadlines are others.
    pub(super) fn leaves_at(&mut self, at: ThreadTick) {
        let until_due_ns = self.due.saturating_sub(at.number) * TICK_NS;
        self.due_ns = at.deadline_ns + until_due_ns;
    }

    /// It comes from another thread. Its next tick is at the deadline here that is nearest to when it would have been
    /// there.
    pub(super) fn arrives_at(&mut self, at: ThreadTick) {
        let away_ns = self.due_ns as i64 - at.deadline_ns as i64;
        let away_ticks = (2 * away_ns + TICK_NS as i64).div_euclid(2 * TICK_NS as i64);
        self.due = at.number.saturating_add_signed(away_ticks);
        self.is_new = true;
    }

    pub(super) fn end_recording(&mut self) {
        if let Some(tap) = &mut self.tap {
            tap.end(&mut self.session);
        }
    }

    /// The ticks that are due. One, as a rule: a session that comes from a thread that is ahead has none yet, and one
    /// that comes from a thread that was late makes up for those that it has missed.
    pub(super) fn tick(&mut self, at: ThreadTick, mut ways: Ways<'_>) -> Stepped {
        let owed = (at.number + 1).saturating_sub(self.due);
        if self.is_at_rest() {
            let is_told = self.is_new || at.has_rested || REST_TICKS <= owed;
            let mut stepped = Stepped::default();
            if is_told && 0 < owed {
                self.take_frames(at.now, ways.phase);
                self.session.rest(at.now, owed);
                stepped.overflowed = self.tell(at, &mut ways).overflowed;
                stepped.overflowed += self.push_record(at);
                self.due += owed;
            }
            stepped.is_at_rest = !self.is_new;
            return stepped;
        }
        // What a thread gives up after a stall is not made up for.
        let owed = if u64::from(MOST_BEHIND) < owed {
            1
        } else {
            owed
        };
        let mut stepped = Stepped::default();
        let phase = at.number.wrapping_add(u64::from(self.number));
        let measured_from = phase
            .is_multiple_of(MEASURED_EVERY)
            .then(thread_time_ns)
            .filter(|_| owed == 1);
        for _ in 0..owed {
            self.late_ticks += u64::from(at.is_late);
            self.take_frames(at.now, ways.phase);
            match &mut self.tap {
                Some(tap) => self.session.tick_heard(at.now, |slot, arrived, frame| {
                    tap.on_frame(slot, arrived, frame);
                }),
                None => self.session.tick(at.now),
            }
            let told = self.tell(at, &mut ways);
            stepped.leaves |= told.leaves;
            stepped.overflowed += told.overflowed;
            // Sessions take turns, so that no tick has the records or bricks of all of them.
            let phase = self.session.ticks().wrapping_add(u64::from(self.number));
            if phase.is_multiple_of(RECORD_EVERY) || self.is_new {
                stepped.overflowed += self.push_record(at);
            }
            if phase.is_multiple_of(BRICKS_EVERY) {
                hand_over_bricks(&mut self.session, &mut self.bricks);
            }
        }
        if 0 < owed {
            self.due = at.number + 1;
        }
        if let Some(from) = measured_from {
            self.work_ns = Some(thread_time_ns() - from);
        }
        stepped
    }

    fn take_frames(&mut self, now: Timestamp, phase: &mut PhaseLock) {
        let mut newest = [None; TOOLS];
        while let Ok(incoming) = self.frames.pop() {
            let arrived = Timestamp::from_nanos(incoming.arrived_ns).min(now);
            self.session
                .handle_frame(arrived, incoming.slot, &incoming.frame);
            newest[incoming.slot] = Some(now.as_nanos() - arrived.as_nanos());
        }
        for (slot, waited_ns) in newest.into_iter().enumerate() {
            if let Some(waited_ns) = waited_ns {
                phase.on_frame(phase_key(self.number, slot), waited_ns);
            }
        }
    }

    /// Hands over what a tick has brought.
    fn tell(&mut self, at: ThreadTick, ways: &mut Ways<'_>) -> Stepped {
        let Ways { outgoing, out, .. } = ways;
        let (mut leaves, mut overflowed) = (false, 0);
        let session = &mut self.session;
        while let Some((slot, frame)) = session.poll_transmit() {
            leaves = true;
            self.frames_sent += 1;
            let leaving = Outgoing {
                session: self.number,
                slot,
                frame: *frame,
            };
            overflowed += u64::from(outgoing.push(leaving).is_err());
        }
        // What orders have changed since the last tick is among these.
        {
            let fresh = self.events.take_from(session);
            if let Some(tap) = &mut self.tap {
                tap.on_tick(session, at.now, fresh.clone());
            }
            if let Some(keeper) = &mut self.keeper {
                keeper.on_tick(session, fresh);
            }
        }
        while 0 < self.told.slots()
            && let Some(event) = self.events.pop()
        {
            // There is room, see above.
            let _ = self.told.push(event);
        }
        while 0 < out.room_to_retire()
            && let Some(side) = session.poll_retired()
        {
            out.retire(Done::Side { _side: side });
        }
        Stepped {
            is_at_rest: false,
            leaves,
            overflowed,
        }
    }

    /// Tells how things are, and gives how many records found no room.
    fn push_record(&mut self, at: ThreadTick) -> u64 {
        let told = self.records.push(SessionRecord {
            thread: at.thread,
            late_ticks: self.late_ticks,
            work_ns: self.work_ns,
            frames_sent: self.frames_sent,
            ..record(&self.session, at.now)
        });
        if told.is_err() {
            return 1;
        }
        self.work_ns = None;
        self.is_new = false;
        0
    }
}

/// What the phase lock knows a tool by.
fn phase_key(session: u32, slot: usize) -> u64 {
    u64::from(session) << 8 | slot as u64
}

impl ThreadTick {
    /// Before the first.
    pub(super) fn of(thread: usize) -> Self {
        Self {
            thread,
            number: 0,
            deadline_ns: 0,
            now: Timestamp::ZERO,
            is_late: false,
            has_rested: false,
        }
    }
}
