//! A machine on a 1 kHz thread, and the rings that connect it to everybody else.
//!
//! ```text
//!  orders ──ring──> carry_out ─┐
//!                              ├─ machine ──> records ──ring──> whoever counts and watches
//!  deadline ──────> tick ──────┘        └───> done    ──ring──> whoever answers, and drops what is large
//! ```
//!
//! The thread owns the machine. It takes orders between two ticks and waits for nobody: a ring that is full is counted
//! ([`Counters::overflowed`]), and an order waits as long as there is no room for what it will leave behind. Nothing is
//! allocated here after [`Realtime::new`], nothing large is dropped, no lock is held. What a machine does in its own
//! methods is its own affair.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::thread::Thread;

use rtrb::{Consumer, Producer, RingBuffer};
use teleclay_link::time::Timestamp;

use crate::Clock;
use crate::ticker::{Next, Tick, Ticker, TickerConfig, Waker};

/// What is stepped.
pub trait Machine: Send + 'static {
    /// What it may be told between two ticks.
    type Order: Send + 'static;
    /// What an order leaves behind, and whatever else the machine is done with.
    type Done: Send + 'static;
    /// What a tick tells whoever counts and watches.
    type Record: Send + 'static;
    /// Why it ended by itself.
    type Failure: Send + 'static;

    /// A tick begins: before its orders, and before [`Machine::tick`].
    fn begin(&mut self, now: Timestamp, tick: &Tick) {
        let _ = (now, tick);
    }

    /// Carries an order out. There is room for what it leaves.
    fn carry_out(&mut self, now: Timestamp, order: Self::Order) -> Self::Done;

    /// One tick.
    ///
    /// # Errors
    /// The machine cannot go on; its thread ends.
    fn tick(&mut self, now: Timestamp, out: &mut Out<Self>) -> Result<(), Self::Failure>
    where
        Self: Sized;

    /// The tick is over, and took as long as `timing` says: the place to record it.
    fn after_tick(&mut self, timing: Timing, out: &mut Out<Self>)
    where
        Self: Sized;

    /// Deadlines that may pass without a tick, as long as no order comes: then the thread sleeps.
    fn may_rest(&self) -> u32 {
        0
    }

    /// By how much the next deadline is to be later than a period after this one, ns; see [`Next::Shift`]. Asked once a
    /// tick.
    fn shift_ns(&mut self) -> i64 {
        0
    }
}

/// How one tick went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timing {
    /// From the deadline to the start, ns.
    pub lateness_ns: u64,
    /// From the start to the end, orders included, ns.
    pub work_ns: u64,
    /// Deadlines given up just before.
    pub given_up: u64,
    /// Deadlines slept through just before, since nothing was to be done.
    pub rested: u64,
}

/// Lengths of the rings.
#[derive(Clone, Copy, Debug)]
pub struct Capacities {
    /// Orders that may wait for the tick.
    pub orders: usize,
    /// Things that may wait to be dropped or answered.
    pub done: usize,
    /// Records that may wait to be read.
    pub records: usize,
}

/// Where a machine puts what leaves it.
pub struct Out<M: Machine> {
    records: Producer<M::Record>,
    done: Producer<M::Done>,
    overflowed: u64,
    has_done: bool,
}

impl<M: Machine> Out<M> {
    /// Tells a record. One that finds the ring full is counted and lost.
    ///
    /// # Errors
    /// The ring is full; the record comes back.
    pub fn record(&mut self, record: M::Record) -> Result<(), M::Record> {
        self.records
            .push(record)
            .map_err(|rtrb::PushError::Full(record)| {
                self.overflowed += 1;
                record
            })
    }

    /// How many things may be retired now.
    pub fn room_to_retire(&self) -> usize {
        self.done.slots()
    }

    /// Hands over something to be dropped elsewhere. Look for room first: what finds none is dropped here, and counted.
    pub fn retire(&mut self, done: M::Done) {
        self.has_done = true;
        self.overflowed += u64::from(self.done.push(done).is_err());
    }

    /// Counts things of the machine's own that found no room.
    pub fn count_overflowed(&mut self, count: u64) {
        self.overflowed += count;
    }
}

/// The ends of the rings that the thread does not hold.
pub struct Ends<M: Machine> {
    /// Into the tick.
    pub orders: Producer<M::Order>,
    /// Out of it.
    pub records: Consumer<M::Record>,
    /// Likewise: orders that were carried out, and what the machine is done with.
    pub done: Consumer<M::Done>,
    /// Why the thread ended by itself; one at most.
    pub failures: Consumer<M::Failure>,
    /// Counters that any thread may read.
    pub counters: Arc<Counters>,
}

/// Counters that any thread may read.
#[derive(Debug, Default)]
pub struct Counters {
    /// Ticks since the start, those that a resting machine slept through included.
    pub ticks: AtomicU64,
    /// Records and other things that found a ring full.
    pub overflowed: AtomicU64,
}

/// A machine with its rings.
pub struct Realtime<M: Machine> {
    machine: M,
    clock: Clock,
    orders: Consumer<M::Order>,
    failures: Producer<M::Failure>,
    out: Out<M>,
    counters: Arc<Counters>,
    reader: Option<Thread>,
    waker: Option<Waker>,
}

impl<M: Machine> Realtime<M> {
    /// Makes the rings.
    pub fn new(machine: M, clock: Clock, capacities: Capacities) -> (Self, Ends<M>) {
        let (orders, orders_out) = RingBuffer::new(capacities.orders);
        let (done, done_out) = RingBuffer::new(capacities.done);
        let (records, records_out) = RingBuffer::new(capacities.records);
        let (failures, failures_out) = RingBuffer::new(1);
        let counters = Arc::new(Counters::default());
        let realtime = Self {
            machine,
            clock,
            orders: orders_out,
            failures,
            out: Out {
                records,
                done,
                overflowed: 0,
                has_done: false,
            },
            counters: Arc::clone(&counters),
            reader: None,
            waker: None,
        };
        let ends = Ends {
            orders,
            records: records_out,
            done: done_out,
            failures: failures_out,
            counters,
        };
        (realtime, ends)
    }

    /// Wakes `reader` after each tick that left something in the ring `done`.
    pub fn waking(mut self, reader: Thread) -> Self {
        self.reader = Some(reader);
        self
    }

    /// Lets the thread sleep while the machine has nothing to do. Whoever puts an order into the ring has `waker` wake
    /// it.
    pub fn resting(mut self, waker: Waker) -> Self {
        self.waker = Some(waker);
        self
    }

    /// Starts the thread.
    ///
    /// # Errors
    /// The system cannot make a thread.
    pub fn spawn(mut self, config: TickerConfig) -> io::Result<Ticker> {
        let waker = self.waker.clone();
        let ticker = Ticker::spawn(config, move |tick| self.tick(tick))?;
        if let Some(waker) = waker {
            waker.set(&ticker);
        }
        Ok(ticker)
    }

    /// Orders that wait, then one tick of the machine.
    pub fn tick(&mut self, tick: Tick) -> Next {
        self.tick_at(Timestamp::from_nanos(self.clock.now_ns()), tick)
    }

    /// The same at a time of the caller's.
    pub fn tick_at(&mut self, now: Timestamp, tick: Tick) -> Next {
        let started_ns = self.clock.now_ns();
        self.machine.begin(now, &tick);
        self.take_orders(now);
        if let Err(failure) = self.machine.tick(now, &mut self.out) {
            // The ring holds the one failure that there can be.
            let _ = self.failures.push(failure);
            return Next::Stop;
        }
        let timing = Timing {
            lateness_ns: tick.lateness.as_nanos() as u64,
            work_ns: self.clock.now_ns() - started_ns,
            given_up: tick.given_up,
            rested: tick.rested,
        };
        self.machine.after_tick(timing, &mut self.out);
        let ticks = &self.counters.ticks;
        ticks.fetch_add(1 + tick.rested, Ordering::Relaxed);
        let overflowed = std::mem::take(&mut self.out.overflowed);
        if 0 < overflowed {
            self.counters
                .overflowed
                .fetch_add(overflowed, Ordering::Relaxed);
        }
        if std::mem::take(&mut self.out.has_done)
            && let Some(reader) = &self.reader
        {
            reader.unpark();
        }
        let shift_ns = self.machine.shift_ns();
        // An order that comes after this look wakes the thread.
        let can_rest = self.waker.is_some() && self.orders.is_empty();
        match (self.machine.may_rest(), shift_ns) {
            (most @ 1.., _) if can_rest => Next::Rest(most),
            (_, 0) => Next::Continue,
            (_, shift_ns) => Next::Shift(shift_ns),
        }
    }

    /// The machine, where nothing ticks.
    pub fn machine(&self) -> &M {
        &self.machine
    }

    fn take_orders(&mut self, now: Timestamp) {
        while 0 < self.out.room_to_retire() {
            let Ok(order) = self.orders.pop() else { return };
            let done = self.machine.carry_out(now, order);
            self.out.retire(done);
        }
    }
}

/// Settles whether an order is carried out or taken back: exactly one of the two sides gets its way. Copies are the
/// same claim.
#[derive(Clone, Debug, Default)]
pub struct Claim(Arc<AtomicU8>);

const OPEN: u8 = 0;
const CARRIED_OUT: u8 = 1;
const TAKEN_BACK: u8 = 2;

impl Claim {
    /// The tick is about to carry the order out. Whether it still may.
    pub fn carry_out(&self) -> bool {
        self.settle(CARRIED_OUT)
    }

    /// Whoever gave the order will not wait longer. Whether it is certain now that the order is not carried out.
    pub fn take_back(&self) -> bool {
        self.settle(TAKEN_BACK)
    }

    fn settle(&self, how: u8) -> bool {
        self.0
            .compare_exchange(OPEN, how, Ordering::AcqRel, Ordering::Acquire)
            .is_ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// Adds up its orders, and tells the sum.
    #[derive(Default)]
    struct Adder {
        sum: u32,
    }

    impl Machine for Adder {
        type Order = u32;
        type Done = u32;
        type Record = (u32, Timing);
        type Failure = &'static str;

        fn carry_out(&mut self, _now: Timestamp, order: u32) -> u32 {
            self.sum += order;
            order
        }

        fn tick(&mut self, _now: Timestamp, _out: &mut Out<Self>) -> Result<(), &'static str> {
            if self.sum < 1000 {
                Ok(())
            } else {
                Err("enough")
            }
        }

        fn after_tick(&mut self, timing: Timing, out: &mut Out<Self>) {
            let _ = out.record((self.sum, timing));
        }
    }

    fn adder(done: usize, records: usize) -> (Realtime<Adder>, Ends<Adder>) {
        let capacities = Capacities {
            orders: 8,
            done,
            records,
        };
        Realtime::new(Adder::default(), Clock::start(), capacities)
    }

    fn tick(number: u64) -> Tick {
        Tick {
            number,
            lateness: Duration::from_micros(7),
            given_up: 2,
            ..Tick::default()
        }
    }

    #[test]
    fn an_order_waits_as_long_as_there_is_no_room_for_what_it_leaves() {
        let (mut realtime, mut ends) = adder(2, 8);
        for order in [1, 2, 4, 8] {
            ends.orders.push(order).unwrap();
        }
        realtime.tick(tick(0));
        assert_eq!(realtime.machine().sum, 3);
        assert_eq!(ends.done.pop(), Ok(1));
        realtime.tick(tick(1));
        assert_eq!(realtime.machine().sum, 7);
        assert_eq!((ends.done.pop(), ends.done.pop()), (Ok(2), Ok(4)));
        realtime.tick(tick(2));
        assert_eq!(realtime.machine().sum, 15);
        assert_eq!(ends.counters.overflowed.load(Ordering::Relaxed), 0);
    }

    #[test]
    fn a_record_tells_how_its_tick_went_and_one_too_many_is_counted() {
        let (mut realtime, mut ends) = adder(2, 2);
        for number in 0..3 {
            realtime.tick(tick(number));
        }
        let (sum, timing) = ends.records.pop().unwrap();
        assert_eq!((sum, timing.lateness_ns, timing.given_up), (0, 7_000, 2));
        assert_eq!(ends.counters.ticks.load(Ordering::Relaxed), 3);
        assert_eq!(ends.counters.overflowed.load(Ordering::Relaxed), 1);
    }

    #[test]
    fn a_machine_that_cannot_go_on_says_why_and_ends_its_thread() {
        let (mut realtime, mut ends) = adder(2, 2);
        ends.orders.push(1000).unwrap();
        assert_eq!(realtime.tick(tick(0)), Next::Stop);
        assert_eq!(ends.failures.pop(), Ok("enough"));
    }

    /// It rests while the machine has nothing to do and no order waits, and what was slept through is counted.
    #[test]
    fn a_machine_that_may_rest_does_so_when_no_order_waits() {
        struct Idle;
        impl Machine for Idle {
            type Order = ();
            type Done = ();
            type Record = Timing;
            type Failure = ();
            fn carry_out(&mut self, _now: Timestamp, (): ()) {}
            fn tick(&mut self, _now: Timestamp, _out: &mut Out<Self>) -> Result<(), ()> {
                Ok(())
            }
            fn after_tick(&mut self, timing: Timing, out: &mut Out<Self>) {
                let _ = out.record(timing);
            }
            fn may_rest(&self) -> u32 {
                50
            }
        }
        let capacities = Capacities {
            orders: 8,
            done: 1,
            records: 8,
        };
        let (realtime, mut ends) = Realtime::new(Idle, Clock::start(), capacities);
        let mut realtime = realtime.resting(Waker::default());
        assert_eq!(realtime.tick(tick(0)), Next::Rest(50));
        let rested = Tick {
            number: 51,
            rested: 50,
            ..Tick::default()
        };
        realtime.tick(rested);
        assert_eq!(ends.counters.ticks.load(Ordering::Relaxed), 52);
        ends.records.pop().unwrap();
        assert_eq!(ends.records.pop().unwrap().rested, 50);
        // The second of two waits for room, and then nobody sleeps over it.
        ends.orders.push(()).unwrap();
        ends.orders.push(()).unwrap();
        assert_eq!(realtime.tick(tick(52)), Next::Continue);
        assert_eq!(ends.done.pop(), Ok(()));
        assert_eq!(realtime.tick(tick(53)), Next::Rest(50));
    }

    #[test]
    fn a_claim_is_settled_once() {
        let (carried_out, taken_back) = (Claim::default(), Claim::default());
        assert!(carried_out.carry_out() && !carried_out.take_back() && !carried_out.carry_out());
        assert!(taken_back.take_back() && !taken_back.carry_out() && !taken_back.take_back());
    }
}
