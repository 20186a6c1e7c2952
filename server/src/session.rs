//! What the server keeps of one session outside of the tick: its snapshot, its statistics, its mirror of the clay.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

use teleclay_clay::Clay;
use teleclay_keeping::Archive;
use teleclay_proto::SessionId;
use teleclay_proto::watch::{Level, TelemetrySample};
use teleclay_session::{EventKind, Release, Settings, Snapshot};
use tokio::sync::broadcast;
use tokio::sync::mpsc::UnboundedSender;

use crate::doors::{Channels, LeaseChannel, Way};
use crate::engine::{Mirror, SessionRecord, TICK};
use crate::statistics::SessionStats;

/// Samples that a watcher may fall behind before it loses some: four seconds of one tool.
const SAMPLES_KEPT: usize = 1024;
const EVENTS_KEPT: usize = 64;

/// A sample of one tool, on its way to watchers.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// The tool's id.
    pub tool: u32,
    /// Time since the session began, s.
    pub time_s: f64,
    /// Time between samples, µs.
    pub period_us: u32,
    /// The sample.
    pub sample: TelemetrySample,
}

/// Something that happened.
#[derive(Clone, Debug)]
pub struct Event {
    /// How grave it is.
    pub level: Level,
    /// What happened, for people.
    pub text: String,
    /// When, since the session began, s.
    pub time_s: f64,
}

/// Somebody who held a tool, and is to be told over Zenoh why no longer.
pub(crate) struct Departure {
    pub(crate) session: SessionId,
    pub(crate) slot: usize,
    pub(crate) holder: Arc<LeaseChannel>,
    /// In a sentence without its full stop.
    pub(crate) reason: String,
}

/// A session, shared by the API, Zenoh and the collector.
///
/// Nobody holds two of `snapshot`, `stats` and `mirror` at once, so none can wait for another in a deadlock.
pub(crate) struct SessionShared {
    pub(crate) id: SessionId,
    pub(crate) number: u32,
    /// What the session's events have come to: never what somebody merely asked for.
    snapshot: Mutex<Snapshot>,
    pub(crate) stats: Mutex<SessionStats>,
    pub(crate) mirror: Mutex<Mirror>,
    /// How holders of tools are told from everybody else.
    pub(crate) channels: Channels,
    /// Its history, where one is kept.
    pub(crate) archive: Option<Archive>,
    /// Held by whoever looks into its history: one after the other, and each on one thread.
    pub(crate) looking_back: Arc<tokio::sync::Semaphore>,
    /// The thread that it lives on.
    thread: AtomicUsize,
    /// Held for reading by whoever gives its thread an order, for writing while it moves to another one.
    pub(crate) moving: tokio::sync::RwLock<()>,
    /// Held by whoever prepares a command: prepared one after the other, none is overtaken by another.
    pub(crate) preparing: tokio::sync::Mutex<()>,
    /// Ticks at the last record; apart from the statistics, so that whoever holds those can tell the time.
    ticks: AtomicU64,
    telemetry: broadcast::Sender<Sample>,
    events: broadcast::Sender<Event>,
    departures: UnboundedSender<Departure>,
}

impl SessionShared {
    pub(crate) fn new(
        number: u32,
        thread: usize,
        snapshot: Snapshot,
        mirror: Clay,
        archive: Option<Archive>,
        departures: UnboundedSender<Departure>,
    ) -> Self {
        let spec = &snapshot.settings.spec;
        Self {
            id: spec.id.clone(),
            number,
            mirror: Mutex::new(Mirror {
                clay: mirror,
                shape: spec.clay.shape.clone(),
                epoch: snapshot.clay_epoch,
            }),
            snapshot: Mutex::new(snapshot),
            stats: Mutex::new(SessionStats::new()),
            channels: Channels::default(),
            archive,
            looking_back: Arc::new(tokio::sync::Semaphore::new(1)),
            thread: AtomicUsize::new(thread),
            moving: tokio::sync::RwLock::default(),
            preparing: tokio::sync::Mutex::default(),
            ticks: AtomicU64::new(0),
            telemetry: broadcast::channel(SAMPLES_KEPT).0,
            events: broadcast::channel(EVENTS_KEPT).0,
            departures,
        }
    }

    /// The session's state, but for clay and motion.
    pub(crate) fn snapshot(&self) -> MutexGuard<'_, Snapshot> {
        self.snapshot.lock().expect("no holder panics")
    }

    pub(crate) fn settings(&self) -> Arc<Settings> {
        Arc::clone(&self.snapshot().settings)
    }

    /// The thread that it lives on.
    pub(crate) fn thread(&self) -> usize {
        self.thread.load(Ordering::Relaxed)
    }

    /// It lives on another thread.
    pub(crate) fn has_moved(&self, to: usize) {
        self.thread.store(to, Ordering::Relaxed);
    }

    /// How many of its tools are held.
    pub(crate) fn held_tools(&self) -> usize {
        let snapshot = self.snapshot();
        let tools = snapshot.tools.iter();
        tools.filter(|tool| tool.holder.is_some()).count()
    }

    /// What the loop told last.
    pub(crate) fn last_record(&self) -> SessionRecord {
        self.stats.lock().expect("no holder panics").record
    }

    pub(crate) fn telemetry(&self) -> broadcast::Receiver<Sample> {
        self.telemetry.subscribe()
    }

    pub(crate) fn events(&self) -> broadcast::Receiver<Event> {
        self.events.subscribe()
    }

    pub(crate) fn publish(
        &self,
        slot: usize,
        time_s: f64,
        period_us: u32,
        sample: TelemetrySample,
    ) {
        // An error means that nobody watches.
        let _ = self.telemetry.send(Sample {
            tool: tool_id(slot),
            time_s,
            period_us,
            sample,
        });
    }

    /// The loop told of a change: the snapshot follows, then watchers and the log hear of it.
    pub(crate) fn take_in(&self, event: &teleclay_session::Event) {
        let (words, farewell) = {
            let mut snapshot = self.snapshot();
            let words = teleclay_session::in_words(&event.kind, &snapshot);
            let farewell = farewell(&event.kind, &snapshot);
            snapshot.apply(event);
            (words, farewell)
        };
        if let Some((slot, lease, reason)) = farewell
            && let Some(holder) = self.channels.at(slot)
            && holder.lease == lease
        {
            self.say_farewell(slot, holder, reason);
        }
        if let Some((level, text)) = words {
            self.emit_at(level, text, event.tick);
        }
    }

    /// Tells whoever held a tool why no longer.
    pub(crate) fn say_farewell(&self, slot: usize, holder: Arc<LeaseChannel>, reason: String) {
        if let Way::Socket(line) = &holder.way {
            return line.end(reason);
        }
        // Nobody takes it only where the server ends.
        let _ = self.departures.send(Departure {
            session: self.id.clone(),
            slot,
            holder,
            reason,
        });
    }

    /// Tells watchers and the log.
    pub(crate) fn emit(&self, level: Level, text: String) {
        self.emit_at(level, text, self.ticks.load(Ordering::Relaxed));
    }

    fn emit_at(&self, level: Level, text: String, tick: u64) {
        match level {
            Level::Info => tracing::info!(session = %self.id, "{text}"),
            Level::Warning => tracing::warn!(session = %self.id, "{text}"),
            Level::Error => tracing::error!(session = %self.id, "{text}"),
        }
        // An error means that nobody watches.
        let _ = self.events.send(Event {
            level,
            text,
            time_s: tick as f64 * TICK.as_secs_f64(),
        });
    }

    /// The session has come to this tick.
    pub(crate) fn has_come_to(&self, ticks: u64) {
        self.ticks.store(ticks, Ordering::Relaxed);
    }

    /// The tick works on another block.
    pub(crate) fn replace_mirror(&self, mirror: Mirror) {
        *self.mirror.lock().expect("no holder panics") = mirror;
    }
}

/// What the holder of a tool is told whose lease has ended for a reason that it may not know: slot, lease and reason.
fn farewell(kind: &EventKind, before: &Snapshot) -> Option<(usize, u32, String)> {
    let EventKind::Released {
        slot,
        lease,
        because,
        ..
    } = kind
    else {
        return None;
    };
    let reason = match because {
        // It has said goodbye itself, or is told by whoever has it leave.
        Release::Left => return None,
        Release::RanOut => "no frame has come for as long as a lease lasts".to_owned(),
        Release::TakenOver => "no frame came, and another operator asked for the tool".to_owned(),
        Release::Stopped => match &before.stop {
            Some(stop) => format!("{} has stopped the session: {}", stop.by, stop.reason),
            None => "the session was stopped".to_owned(),
        },
        Release::HandedOver { to } => format!("the tool was handed over to {to}"),
        Release::TakenAway => "the tool was taken away".to_owned(),
    };
    Some((*slot, *lease, reason))
}

/// The place of a tool among a session's.
pub(crate) fn slot_of(tool: u32) -> usize {
    tool as usize - 1
}

/// Tools are numbered from 1.
pub(crate) fn tool_id(slot: usize) -> u32 {
    slot as u32 + 1
}
