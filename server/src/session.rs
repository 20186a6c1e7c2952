//! What all of the server knows of one session: its settings, its leases, its statistics, its mirror of the clay.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use teleclay_clay::Clay;
use teleclay_proto::SessionId;
use teleclay_proto::frame::Corrections;
use teleclay_proto::http::{
    ClayShape, CorrectionsState, NewSession, Session, SessionState, ToolDescription, ToolState,
};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::watch::{Level, TelemetrySample};
use tokio::sync::broadcast;

use crate::collector::{LoopStats, SessionStats};
use crate::engine::{MAX_TOOLS, SessionRecord, TICK};
use crate::state;

/// Samples that a watcher may fall behind before it loses some: four seconds of one tool.
const SAMPLES_KEPT: usize = 1024;
const EVENTS_KEPT: usize = 64;
/// A lease ends this long after the last frame, s: long enough to plug a cable in again.
const LEASE_S: f64 = 10.0;
/// Silence after which another operator may take a tool over, s.
const TAKEOVER_AFTER_S: f64 = 0.15;

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

/// The watchers' copy of the clay, a few milliseconds behind the tick's.
pub(crate) struct Mirror {
    /// The clay.
    pub(crate) clay: Clay,
    /// What it was when it was fresh.
    pub(crate) shape: ClayShape,
    /// Counts the fresh blocks.
    pub(crate) epoch: u32,
}

/// Who holds a tool.
#[derive(Clone, Debug)]
pub(crate) struct Lease {
    pub(crate) lease: u32,
    pub(crate) operator: String,
    pub(crate) granted: Instant,
}

/// What a session was told to be.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    pub(crate) spec: NewSession,
    pub(crate) parameters: LoopParameters,
    pub(crate) is_paused: bool,
    pub(crate) slots: Vec<Option<Lease>>,
}

impl Settings {
    /// The parameters are about to change: their next revision.
    pub(crate) fn next_revision(&mut self) -> u16 {
        self.parameters.revision = self.parameters.revision.wrapping_add(1);
        self.parameters.revision
    }
}

/// A session, shared by the API, Zenoh and the collector.
///
/// Nobody holds two of `settings`, `stats` and `mirror` at once, so they cannot deadlock. What has to change together changes under
/// `changes`, which is taken first.
pub(crate) struct SessionShared {
    pub(crate) id: SessionId,
    pub(crate) number: u32,
    pub(crate) settings: Mutex<Settings>,
    pub(crate) stats: Mutex<SessionStats>,
    pub(crate) mirror: Mutex<Mirror>,
    /// Held by whoever changes the session: settings, mirror and loop change together, whoever else would like to.
    pub(crate) changes: tokio::sync::Mutex<()>,
    /// Ticks at the last record; apart from the statistics, so that whoever holds those can tell the time.
    ticks: AtomicU64,
    telemetry: broadcast::Sender<Sample>,
    events: broadcast::Sender<Event>,
}

impl SessionShared {
    pub(crate) fn new(number: u32, spec: NewSession, mirror: Clay) -> Self {
        let parameters = parameters(&spec);
        let shape = spec.clay.shape.clone();
        let slots = vec![None; usize::from(spec.tools)];
        Self {
            id: spec.id.clone(),
            number,
            settings: Mutex::new(Settings {
                spec,
                parameters,
                is_paused: false,
                slots,
            }),
            stats: Mutex::new(SessionStats::new()),
            mirror: Mutex::new(Mirror {
                clay: mirror,
                shape,
                epoch: 1,
            }),
            changes: tokio::sync::Mutex::default(),
            ticks: AtomicU64::new(0),
            telemetry: broadcast::channel(SAMPLES_KEPT).0,
            events: broadcast::channel(EVENTS_KEPT).0,
        }
    }

    pub(crate) fn settings(&self) -> std::sync::MutexGuard<'_, Settings> {
        self.settings.lock().expect("no holder panics")
    }

    /// What the loop told last.
    pub(crate) fn last_record(&self) -> SessionRecord {
        self.stats.lock().expect("no holder panics").record
    }

    /// Gives a tool to an operator, if one can be had: the operator's own if it has fallen silent; else one that nobody holds; else any that has
    /// fallen silent.
    pub(crate) fn hold_slot(&self, operator: &str, lease: u32) -> Option<usize> {
        let record = self.last_record();
        let mut settings = self.settings();
        let slot = slot_for(operator, &settings.slots, &record)?;
        settings.slots[slot] = Some(Lease {
            lease,
            operator: operator.to_owned(),
            granted: Instant::now(),
        });
        Some(slot)
    }

    /// The session as the API shows it.
    pub(crate) fn state(&self, loop_stats: &Mutex<LoopStats>, scheduler: &str) -> Session {
        state::session(self, loop_stats, scheduler)
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

    /// Emits an event to watchers and to the log.
    pub(crate) fn emit(&self, level: Level, text: String) {
        match level {
            Level::Info => tracing::info!(session = %self.id, "{text}"),
            Level::Warning => tracing::warn!(session = %self.id, "{text}"),
            Level::Error => tracing::error!(session = %self.id, "{text}"),
        }
        let ticks = self.ticks.load(Ordering::Relaxed);
        // An error means that nobody watches.
        let _ = self.events.send(Event {
            level,
            text,
            time_s: ticks as f64 * TICK.as_secs_f64(),
        });
    }

    /// The session has come to this tick.
    pub(crate) fn has_come_to(&self, ticks: u64) {
        self.ticks.store(ticks, Ordering::Relaxed);
    }

    pub(crate) fn emit_connection(&self, slot: usize, is_connected: bool) {
        let operator = self.settings().slots[slot]
            .as_ref()
            .map(|lease| lease.operator.clone());
        let operator = operator.unwrap_or_else(|| "the operator".to_owned());
        let tool = tool_id(slot);
        if is_connected {
            self.emit(Level::Info, format!("{operator} holds tool {tool}"));
        } else {
            self.emit(
                Level::Warning,
                format!("no frame from {operator}: tool {tool} stopped"),
            );
        }
    }

    pub(crate) fn emit_fault(&self, field: &str) {
        self.emit(
            Level::Error,
            format!("{field} is not finite: forces are zero until a fresh block"),
        );
    }

    pub(crate) fn lease_s(&self) -> f64 {
        LEASE_S
    }

    pub(crate) fn lease_age(&self, slot: usize, lease: u32) -> Option<Duration> {
        let settings = self.settings();
        let held = settings
            .slots
            .get(slot)?
            .as_ref()
            .filter(|held| held.lease == lease)?;
        Some(held.granted.elapsed())
    }
}

fn slot_for(operator: &str, slots: &[Option<Lease>], record: &SessionRecord) -> Option<usize> {
    let is_silent = |slot: usize, held: &Lease| {
        let silent = record.tools[slot].is_some_and(|tool| {
            tool.lease == held.lease && !tool.is_connected && TAKEOVER_AFTER_S < tool.silence_s
        });
        // A fresh lease gets a second to send its first frame.
        silent && Duration::from_secs(1) < held.granted.elapsed()
    };
    let silent = |of: Option<&str>| {
        slots.iter().enumerate().position(|(slot, held)| {
            held.as_ref().is_some_and(|held| {
                of.is_none_or(|operator| operator == held.operator) && is_silent(slot, held)
            })
        })
    };
    silent(Some(operator))
        .or_else(|| slots.iter().position(Option::is_none))
        .or_else(|| silent(None))
}

/// Tools are numbered from 1.
pub(crate) fn tool_id(slot: usize) -> u32 {
    slot as u32 + 1
}

/// Where the handle's home maps to, and how far the tool may go: over the middle of a block with the tool just touching it; before the first step of a
/// stepped block with the blade's leading face at x = 0.
pub(crate) fn parameters(spec: &NewSession) -> LoopParameters {
    /// The tool may leave the block by this much on every side, m.
    const MARGIN_M: f64 = 0.1;

    let size = spec.clay.shape.size_m();
    let (lowest_m, half_depth_m) = match spec.tool {
        ToolDescription::Ball { radius_m } => (radius_m, radius_m),
        ToolDescription::Blade { thickness_m, .. } => (0.0, thickness_m / 2.0),
    };
    let home_m = match &spec.clay.shape {
        ClayShape::Block { .. } => [size[0] / 2.0, size[1] / 2.0, size[2] + lowest_m],
        ClayShape::Stepped { base_m, .. } => [-half_depth_m, size[1] / 2.0, base_m + lowest_m],
    };
    LoopParameters {
        axes: spec.axes,
        scheme: spec.scheme,
        deadband: spec.deadband,
        home_m,
        reach_m: [[-MARGIN_M; 3], size.map(|edge| edge + MARGIN_M)],
        tool: spec.tool,
        material: spec.material,
        ..LoopParameters::default()
    }
}

pub(crate) fn tools(settings: &Settings, stats: &SessionStats) -> Vec<ToolState> {
    let mut tools = Vec::new();
    for slot in 0..MAX_TOOLS.min(settings.slots.len()) {
        let Some(lease) = &settings.slots[slot] else {
            continue;
        };
        let record = stats.record.tools[slot].filter(|tool| tool.lease == lease.lease);
        let view = record.map(|tool| tool.view).unwrap_or_default();
        tools.push(ToolState {
            id: tool_id(slot),
            operator: lease.operator.clone(),
            connected: record.is_some_and(|tool| tool.is_connected),
            position_m: record.map_or(settings.parameters.home_m, |tool| tool.view.position_m),
            force_n: view.force_n,
            handle_position_m: view.handle_position_m,
            felt_force_n: view.felt_force_n,
            hand_force_n: view.hand_force_n,
            home_m: settings.parameters.home_m,
            copy: view.copy,
            hidden_force_n: view.hidden_force_n,
            sweeps_refused: view.sweeps_refused,
            corrections: corrections(&view.corrections),
        });
    }
    tools
}

fn corrections(told: &Corrections) -> CorrectionsState {
    CorrectionsState {
        count: told.count,
        moved_n: told.moved_n,
        held_n: told.held_n.map(f64::from),
        largest_step_n: told.largest_step_n.into(),
        injected_j: told.injected_j.into(),
        tank_j: told.tank_j.into(),
    }
}

pub(crate) fn session_state(settings: &Settings, stats: &SessionStats) -> SessionState {
    let is_connected = stats
        .record
        .tools
        .iter()
        .flatten()
        .any(|tool| tool.is_connected);
    match (stats.record.fault, settings.is_paused, is_connected) {
        (Some(_), ..) => SessionState::Fault,
        (None, true, _) => SessionState::Paused,
        (None, false, true) => SessionState::Running,
        (None, false, false) => SessionState::Idle,
    }
}
