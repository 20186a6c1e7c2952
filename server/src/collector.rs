//! The collector: takes what the tick leaves in its rings, every 10 ms, and makes of it what watchers ask for.
//!
//! It keeps the statistics, feeds each session's mirror of the clay, hands samples to the telemetry channel, sees leases run out, and drops what
//! the tick is done with.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use rtrb::Consumer;
use teleclay_clay::{BrickView, Clay};
use teleclay_proto::http::{Quantiles, TickQuantiles};
use teleclay_proto::watch::TelemetrySample;

use crate::engine::{
    BrickContent, BrickUpdate, Discarded, MAX_TOOLS, RECORD_EVERY, SessionRecord, TICK, TickRecord,
    ToolRecord,
};
use crate::session::SessionShared;

/// How often the rings are emptied.
const ROUND: Duration = Duration::from_millis(10);
/// Quantiles are of the last one to two windows.
const WINDOW: Duration = Duration::from_secs(5);
/// Rates are of the last one to two of these.
const RATE_WINDOW: Duration = Duration::from_secs(1);
/// Greatest value that the histograms tell apart, ns: a minute.
const GREATEST_NS: u64 = 60_000_000_000;

/// A histogram over the last one to two windows.
pub(crate) struct Rolling {
    current: Histogram<u32>,
    before: Histogram<u32>,
    since: Instant,
}

impl Rolling {
    pub(crate) fn new() -> Self {
        let empty = || {
            let mut histogram =
                Histogram::new_with_bounds(100, GREATEST_NS, 3).expect("constant bounds are valid");
            histogram.auto(false);
            histogram
        };
        Self {
            current: empty(),
            before: empty(),
            since: Instant::now(),
        }
    }

    fn record(&mut self, nanos: u64) {
        self.current.saturating_record(nanos.max(100));
    }

    fn turn(&mut self, now: Instant) {
        if WINDOW <= now.duration_since(self.since) {
            std::mem::swap(&mut self.current, &mut self.before);
            self.current.reset();
            self.since = now;
        }
    }

    fn merged(&self) -> Histogram<u32> {
        let mut all = self.current.clone();
        all.add(&self.before).expect("both have the same bounds");
        all
    }

    pub(crate) fn quantiles(&self) -> Quantiles {
        let all = self.merged();
        Quantiles {
            p50: seconds(all.value_at_quantile(0.5)),
            p99: seconds(all.value_at_quantile(0.99)),
        }
    }

    pub(crate) fn tick_quantiles(&self) -> TickQuantiles {
        let all = self.merged();
        TickQuantiles {
            p50: seconds(all.value_at_quantile(0.5)),
            p99: seconds(all.value_at_quantile(0.99)),
            p999: seconds(all.value_at_quantile(0.999)),
            max: seconds(all.max()),
        }
    }
}

fn seconds(nanos: u64) -> f64 {
    nanos as f64 * 1e-9
}

/// Statistics of the thread, the same for all its sessions.
pub(crate) struct LoopStats {
    pub(crate) work: Rolling,
    pub(crate) lateness: Rolling,
    /// Ticks that started more than one period late.
    pub(crate) late_ticks: u64,
    /// Deadlines given up.
    pub(crate) given_up: u64,
    pub(crate) rate_hz: f64,
    pub(crate) last_tick: Option<Instant>,
}

/// A rate, from a counter read now and then.
#[derive(Debug)]
pub(crate) struct Rate {
    count: u64,
    since: Instant,
    per_s: f64,
}

impl Rate {
    fn new(now: Instant) -> Self {
        Self {
            count: 0,
            since: now,
            per_s: 0.0,
        }
    }

    fn turn(&mut self, now: Instant, count: u64) {
        let span = now.duration_since(self.since);
        if RATE_WINDOW <= span {
            self.per_s = count.saturating_sub(self.count) as f64 / span.as_secs_f64();
            self.count = count;
            self.since = now;
        }
    }
}

/// Statistics of one session.
pub(crate) struct SessionStats {
    pub(crate) record: SessionRecord,
    pub(crate) rtt: Rolling,
    pub(crate) age: Rolling,
    pub(crate) up: Rate,
    pub(crate) down: Rate,
}

impl SessionStats {
    pub(crate) fn new() -> Self {
        let now = Instant::now();
        Self {
            record: SessionRecord::default(),
            rtt: Rolling::new(),
            age: Rolling::new(),
            up: Rate::new(now),
            down: Rate::new(now),
        }
    }

    pub(crate) fn packets_per_s(&self) -> (f64, f64) {
        (self.up.per_s, self.down.per_s)
    }
}

impl Default for LoopStats {
    fn default() -> Self {
        Self {
            work: Rolling::new(),
            lateness: Rolling::new(),
            late_ticks: 0,
            given_up: 0,
            rate_hz: 0.0,
            last_tick: None,
        }
    }
}

/// What the collector is told.
pub(crate) enum Notice {
    /// A session was added; its bricks come out of this ring.
    Added(Arc<SessionShared>, Consumer<BrickUpdate>),
    /// A session is gone.
    Removed(u32),
}

/// What the collector finds out and somebody must act on.
pub(crate) enum Finding {
    /// A lease ran out, or its operator said goodbye.
    LeaseEnded {
        session: u32,
        slot: usize,
        lease: u32,
        because: &'static str,
    },
}

/// The rings that the collector empties.
pub(crate) struct Sources {
    pub(crate) ticks: Consumer<TickRecord>,
    pub(crate) sessions: Consumer<SessionRecord>,
    pub(crate) discarded: Consumer<Discarded>,
    pub(crate) notices: Receiver<Notice>,
}

/// The running collector.
pub(crate) struct Collector {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Collector {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic was printed by the thread itself.
            let _ = thread.join();
        }
    }
}

struct Watched {
    shared: Arc<SessionShared>,
    bricks: Consumer<BrickUpdate>,
}

struct State {
    sources: Sources,
    loop_stats: Arc<Mutex<LoopStats>>,
    findings: tokio::sync::mpsc::UnboundedSender<Finding>,
    watched: Vec<Watched>,
    tick_rate: Rate,
    ticks: u64,
}

impl Collector {
    /// Starts the thread.
    pub(crate) fn spawn(
        sources: Sources,
        loop_stats: Arc<Mutex<LoopStats>>,
        findings: tokio::sync::mpsc::UnboundedSender<Finding>,
    ) -> std::io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let asked_to_stop = Arc::clone(&stop);
        let mut state = State {
            sources,
            loop_stats,
            findings,
            watched: Vec::new(),
            tick_rate: Rate::new(Instant::now()),
            ticks: 0,
        };
        let thread = std::thread::Builder::new()
            .name("collector".to_owned())
            .spawn(move || {
                while !asked_to_stop.load(Ordering::Relaxed) {
                    state.round();
                    std::thread::sleep(ROUND);
                }
            })?;
        Ok(Self {
            stop,
            thread: Some(thread),
        })
    }
}

/// Tells the collector of a session. It goes on when the collector is gone: then the server is ending.
pub(crate) fn notify(notices: &Sender<Notice>, notice: Notice) {
    let _ = notices.send(notice);
}

impl State {
    fn round(&mut self) {
        while let Ok(notice) = self.sources.notices.try_recv() {
            match notice {
                Notice::Added(shared, bricks) => self.watched.push(Watched { shared, bricks }),
                Notice::Removed(number) => self
                    .watched
                    .retain(|watched| watched.shared.number != number),
            }
        }
        while let Ok(discarded) = self.sources.discarded.pop() {
            drop(discarded);
        }
        let now = Instant::now();
        self.take_ticks(now);
        self.take_sessions(now);
        for watched in &mut self.watched {
            take_bricks(watched);
        }
    }

    fn take_ticks(&mut self, now: Instant) {
        let mut stats = self.loop_stats.lock().expect("no holder panics");
        stats.work.turn(now);
        stats.lateness.turn(now);
        while let Ok(tick) = self.sources.ticks.pop() {
            self.ticks += 1;
            stats.work.record(tick.work_ns);
            stats.lateness.record(tick.lateness_ns);
            stats.late_ticks += u64::from((TICK.as_nanos() as u64) < tick.lateness_ns);
            stats.given_up += tick.given_up;
            stats.last_tick = Some(now);
        }
        self.tick_rate.turn(now, self.ticks);
        stats.rate_hz = self.tick_rate.per_s;
    }

    fn take_sessions(&mut self, now: Instant) {
        while let Ok(record) = self.sources.sessions.pop() {
            let Some(watched) = self
                .watched
                .iter()
                .find(|watched| watched.shared.number == record.session)
            else {
                continue;
            };
            let shared = &watched.shared;
            shared.has_come_to(record.ticks);
            for slot in 0..MAX_TOOLS {
                if let Some(because) = record.tools[slot]
                    .as_ref()
                    .and_then(|tool| ended(shared, slot, tool))
                {
                    let lease = record.tools[slot].map_or(0, |tool| tool.lease);
                    let finding = Finding::LeaseEnded {
                        session: record.session,
                        slot,
                        lease,
                        because,
                    };
                    // Nobody listens any more only when the server is ending.
                    let _ = self.findings.send(finding);
                }
            }
            let before = shared.last_record();
            publish(shared, &before, &record);
            emit_transitions(shared, &before, &record);
            let mut stats = shared.stats.lock().expect("no holder panics");
            stats.rtt.turn(now);
            stats.age.turn(now);
            let connected = record
                .tools
                .iter()
                .flatten()
                .filter(|tool| tool.is_connected);
            for tool in connected {
                if let Some(rtt_s) = tool.rtt_s {
                    stats.rtt.record((rtt_s * 1e9) as u64);
                }
                stats.age.record((tool.silence_s * 1e9) as u64);
            }
            let received: u64 = record
                .tools
                .iter()
                .flatten()
                .map(|tool| tool.arrivals.received)
                .sum();
            stats.up.turn(now, received);
            stats.down.turn(now, record.frames_sent);
            stats.record = record;
        }
    }
}

/// Whether a lease has ended, and why.
fn ended(shared: &SessionShared, slot: usize, tool: &ToolRecord) -> Option<&'static str> {
    if tool.has_left {
        return Some("left");
    }
    let lasts = shared.lease_s();
    let is_old = shared
        .lease_age(slot, tool.lease)
        .is_some_and(|age| lasts < age.as_secs_f64());
    (is_old && lasts < tool.silence_s).then_some("was silent for too long")
}

fn publish(shared: &SessionShared, before: &SessionRecord, record: &SessionRecord) {
    let time_s = record.ticks as f64 * TICK.as_secs_f64();
    let single = |v: [f64; 3]| v.map(|x| x as f32);
    for (slot, tool) in record.tools.iter().enumerate() {
        let Some(tool) = tool else { continue };
        let view = &tool.view;
        let before = before.tools[slot].filter(|before| before.lease == tool.lease);
        let sample = TelemetrySample {
            hand_force_n: single(view.hand_force_n),
            felt_force_n: single(view.felt_force_n),
            tool_force_n: single(view.force_n),
            handle_position_m: single(view.handle_position_m),
            tool_position_m: single(view.position_m),
            handle_velocity_m_s: single(view.handle_velocity_m_s),
            tool_velocity_m_s: single(view.velocity_m_s),
            energy_handle_j: view.energy_handle_j as f32,
            energy_tool_j: view.energy_tool_j as f32,
            rtt_s: tool.rtt_s.unwrap_or(0.0) as f32,
            correction_step_n: corrected_since(before.as_ref(), tool) as f32,
            correction_held_n: norm(view.corrections.held_n),
            age_s: tool.silence_s as f32,
        };
        shared.publish(
            slot,
            time_s,
            TICK.as_micros() as u32 * RECORD_EVERY as u32,
            sample,
        );
    }
}

fn norm([x, y, z]: [f32; 3]) -> f32 {
    x.hypot(y).hypot(z)
}

/// How far corrections have moved the force on this hand since the record before, N.
fn corrected_since(before: Option<&ToolRecord>, tool: &ToolRecord) -> f64 {
    let moved_n = tool.view.corrections.moved_n;
    let since_n = moved_n - before.map_or(0.0, |before| before.view.corrections.moved_n);
    // A copy that was made anew counts from zero.
    if since_n < 0.0 { moved_n } else { since_n }
}

fn emit_transitions(shared: &SessionShared, before: &SessionRecord, after: &SessionRecord) {
    for slot in 0..MAX_TOOLS {
        let was = before.tools[slot]
            .filter(|tool| tool.is_connected)
            .map(|tool| tool.lease);
        let is = after.tools[slot]
            .filter(|tool| tool.is_connected)
            .map(|tool| tool.lease);
        if was != is {
            shared.emit_connection(slot, is.is_some());
        }
    }
    if let (None, Some(field)) = (before.fault, after.fault) {
        shared.emit_fault(field);
    }
}

fn take_bricks(watched: &mut Watched) {
    if watched.bricks.is_empty() {
        return;
    }
    let mut mirror = watched.shared.mirror.lock().expect("no holder panics");
    while let Ok(update) = watched.bricks.pop() {
        if update.clay_epoch == mirror.epoch {
            replace(&mut mirror.clay, &update);
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use rtrb::RingBuffer;
    use teleclay_clay::Shape;
    use teleclay_proto::http::NewSession;

    /// Tools come and go, as after a hiccup of the network, while others ask for one. Each of the two sides locks what the other has; had one of them two
    /// locks at a time, this would stand still.
    #[test]
    fn joins_and_news_of_tools_never_wait_for_each_other_in_a_ring() {
        const ROUNDS: u64 = 100_000;
        let size_m = [0.01; 3];
        let clay = Clay::new(&Shape::Block { size_m }, 1e-3).unwrap();
        let shared = Arc::new(SessionShared::new(
            1,
            NewSession::new("joins".parse().unwrap()),
            clay,
        ));
        let (mut records, sessions) = RingBuffer::new(1);
        let (_bricks, bricks) = RingBuffer::new(1);
        let mut state = State {
            sources: Sources {
                ticks: RingBuffer::new(1).1,
                sessions,
                discarded: RingBuffer::new(1).1,
                notices: std::sync::mpsc::channel().1,
            },
            loop_stats: Arc::default(),
            findings: tokio::sync::mpsc::unbounded_channel().0,
            watched: vec![Watched {
                shared: Arc::clone(&shared),
                bricks,
            }],
            tick_rate: Rate::new(Instant::now()),
            ticks: 0,
        };
        let (done, ended) = std::sync::mpsc::channel();
        let done_too = done.clone();
        let joining = Arc::clone(&shared);
        std::thread::spawn(move || {
            for lease in 0..ROUNDS as u32 {
                let _ = joining.hold_slot("Ada", lease);
            }
            done.send("joins").unwrap();
        });
        std::thread::spawn(move || {
            for ticks in 0..ROUNDS {
                let mut record = SessionRecord {
                    session: 1,
                    ticks,
                    ..SessionRecord::default()
                };
                record.tools[0] = Some(ToolRecord {
                    lease: 7,
                    is_connected: ticks.is_multiple_of(2),
                    has_left: false,
                    silence_s: 0.0,
                    view: teleclay_bilateral::ToolView::default(),
                    coordination_m: 0.0,
                    arrivals: teleclay_link::arrivals::ArrivalCounts::default(),
                    rtt_s: None,
                });
                records.push(record).ok().unwrap();
                state.take_sessions(Instant::now());
            }
            done_too.send("news").unwrap();
        });
        for _ in 0..2 {
            let patience = Duration::from_secs(30);
            println!("{} are through", ended.recv_timeout(patience).unwrap());
        }
        assert_eq!(shared.last_record().ticks, ROUNDS - 1);
    }
}
