//! The collector: takes what the tick leaves in its rings and makes of it what everybody else asks for.
//!
//! It folds events into each session's [`Snapshot`](teleclay_session::Snapshot), answers orders once what they changed
//! is in there, keeps the statistics, feeds each session's mirror of the clay, hands samples to the telemetry channel,
//! and drops what the tick is done with.

mod samples;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, Thread};
use std::time::{Duration, Instant};

use rtrb::Consumer;
use teleclay_clay::{BrickView, Clay};
use teleclay_shell::realtime::Timing;

use crate::engine::{Answer, BrickContent, BrickUpdate, Done, Order, Task, Told};
use crate::session::SessionShared;
use crate::statistics::{LoopStats, Rate};

/// How often the rings are emptied, where nothing is to be answered meanwhile.
const ROUND: Duration = Duration::from_millis(10);
/// The same while every session rests: as often as they are brought up to date.
const ROUND_AT_REST: Duration = Duration::from_millis(50);

/// What the collector is told.
pub(crate) enum Notice {
    /// A session was added; what it tells comes out of these rings.
    Added(Arc<SessionShared>, Told),
    /// A session is gone.
    Removed(u32),
}

/// The rings that the collector empties, beside those of each session.
pub(crate) struct Sources {
    pub(crate) threads: Vec<FromThread>,
    pub(crate) notices: Receiver<Notice>,
}

/// What one thread leaves.
pub(crate) struct FromThread {
    pub(crate) timings: Consumer<Timing>,
    pub(crate) done: Consumer<Done>,
    /// What is made of its timings.
    pub(crate) stats: Arc<Mutex<LoopStats>>,
}

/// The running collector.
pub(crate) struct Collector {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// The thread before it knows its rings: the tick needs its handle, to wake it.
pub(crate) struct Waiting {
    collector: Collector,
    start: Sender<State>,
}

impl Drop for Collector {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // A panic was printed by the thread itself.
            let _ = thread.join();
        }
    }
}

impl Collector {
    /// Starts the thread.
    pub(crate) fn spawn() -> std::io::Result<Waiting> {
        let stop = Arc::new(AtomicBool::new(false));
        let asked_to_stop = Arc::clone(&stop);
        let (start, started) = std::sync::mpsc::channel::<State>();
        let thread = std::thread::Builder::new()
            .name("collector".to_owned())
            .spawn(move || {
                let Ok(mut state) = started.recv() else {
                    return;
                };
                while !asked_to_stop.load(Ordering::Relaxed) {
                    let nap = match state.round() {
                        Seen::Motion => ROUND,
                        Seen::Rest => ROUND_AT_REST,
                    };
                    std::thread::park_timeout(nap);
                }
            })?;
        let thread = Some(thread);
        Ok(Waiting {
            collector: Self { stop, thread },
            start,
        })
    }
}

impl Waiting {
    /// The thread, to be woken when an order was carried out.
    pub(crate) fn thread(&self) -> Thread {
        let thread = self.collector.thread.as_ref();
        thread.expect("it is joined on drop only").thread().clone()
    }

    /// Lets the thread begin.
    pub(crate) fn start(self, sources: Sources) -> Collector {
        // The thread waits for it.
        let _ = self.start.send(State::new(sources));
        self.collector
    }
}

/// Tells the collector of a session. It goes on when the collector is gone: then the server is ending.
pub(crate) fn notify(notices: &Sender<Notice>, notice: Notice) {
    let _ = notices.send(notice);
}

struct Watched {
    shared: Arc<SessionShared>,
    told: Told,
}

/// What a round has come upon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seen {
    /// Some thread has made ticks, or something waits to be answered.
    Motion,
    /// The threads sleep, all that told something.
    Rest,
}

/// A thread, with the rate of its ticks.
struct Looped {
    from: FromThread,
    rate: Rate,
    ticks: u64,
}

struct State {
    threads: Vec<Looped>,
    notices: Receiver<Notice>,
    watched: Vec<Watched>,
    /// Orders that were carried out and are not answered yet.
    #[expect(
        clippy::vec_box,
        reason = "orders come boxed; moving one out would copy it"
    )]
    unanswered: Vec<Box<Order>>,
}

impl State {
    fn new(sources: Sources) -> Self {
        let threads = sources.threads.into_iter().map(|from| Looped {
            from,
            rate: Rate::new(Instant::now()),
            ticks: 0,
        });
        Self {
            threads: threads.collect(),
            notices: sources.notices,
            watched: Vec::new(),
            unanswered: Vec::new(),
        }
    }

    fn round(&mut self) -> Seen {
        while let Ok(notice) = self.notices.try_recv() {
            match notice {
                Notice::Added(shared, told) => self.watched.push(Watched { shared, told }),
                Notice::Removed(number) => self
                    .watched
                    .retain(|watched| watched.shared.number != number),
            }
        }
        // Before the events: what these tell of an order was told before it was done.
        for thread in &mut self.threads {
            while let Ok(done) = thread.from.done.pop() {
                if let Done::Order(order) = done {
                    self.unanswered.push(order);
                }
            }
        }
        let now = Instant::now();
        let mut seen = Seen::Rest;
        for thread in &mut self.threads {
            if thread.take_timings(now) == Seen::Motion {
                seen = Seen::Motion;
            }
        }
        for watched in &mut self.watched {
            watched.take_events();
            watched.take_records(now);
        }
        self.answer_orders();
        for watched in &mut self.watched {
            take_bricks(watched);
        }
        if self.unanswered.is_empty() {
            seen
        } else {
            Seen::Motion
        }
    }

    /// Answers those whose changes everybody can see by now.
    fn answer_orders(&mut self) {
        for mut order in std::mem::take(&mut self.unanswered) {
            if let (
                Task::Command {
                    session, mirror, ..
                },
                Answer::Command(Ok(outcome)),
            ) = (&mut order.task, &order.answer)
                && let Some(shared) = find(&self.watched, *session)
            {
                if shared.snapshot().revision < outcome.revision {
                    self.unanswered.push(order);
                    continue;
                }
                if let Some(mirror) = mirror.take() {
                    shared.replace_mirror(mirror);
                }
            }
            let Order { reply, answer, .. } = *order;
            // Whoever asked may have gone.
            let _ = reply.send(answer);
        }
    }
}

impl Looped {
    fn take_timings(&mut self, now: Instant) -> Seen {
        let mut seen = Seen::Rest;
        let mut stats = self.from.stats.lock().expect("no holder panics");
        stats.turn(now);
        while let Ok(timing) = self.from.timings.pop() {
            self.ticks += 1 + timing.rested;
            if timing.rested == 0 {
                seen = Seen::Motion;
            }
            stats.add(&timing, now);
        }
        self.rate.turn(now, self.ticks);
        stats.rate_hz = self.rate.per_s;
        seen
    }
}

impl Watched {
    fn take_events(&mut self) {
        while let Ok(event) = self.told.events.pop() {
            self.shared.take_in(&event);
        }
    }

    fn take_records(&mut self, now: Instant) {
        let shared = &self.shared;
        while let Ok(record) = self.told.records.pop() {
            shared.has_come_to(record.ticks);
            let before = shared.last_record();
            samples::publish(shared, &before, &record);
            shared
                .stats
                .lock()
                .expect("no holder panics")
                .add(record, now);
        }
    }
}

fn find(watched: &[Watched], number: u32) -> Option<&Arc<SessionShared>> {
    watched
        .iter()
        .map(|watched| &watched.shared)
        .find(|shared| shared.number == number)
}

/// Bricks of a block that the mirror does not show yet wait in their ring.
fn take_bricks(watched: &mut Watched) {
    let bricks = &mut watched.told.bricks;
    if bricks.is_empty() {
        return;
    }
    let mut mirror = watched.shared.mirror.lock().expect("no holder panics");
    while let Ok(update) = bricks.peek() {
        if mirror.epoch < update.clay_epoch {
            return;
        }
        if update.clay_epoch == mirror.epoch {
            replace(&mut mirror.clay, update);
        }
        // It was there a moment ago, and nobody else takes from this ring.
        let _ = bricks.pop();
    }
}

fn replace(clay: &mut Clay, update: &BrickUpdate) {
    let Some(index) = clay.grid().brick_index(update.index) else {
        return;
    };
    let view = match &update.content {
        BrickContent::Empty => BrickView::Empty,
        BrickContent::Full => BrickView::Full,
        BrickContent::Voxels(voxels) => BrickView::Voxels(voxels),
    };
    if let Err(error) = clay.replace_brick(index, view) {
        // The mirror has the engine's own grid, so this is a defect worth knowing.
        tracing::error!(%error, "a brick did not fit the mirror");
    }
}
