//! The handle's controller: a tool in a copy of the clay.

use std::sync::Arc;
use std::time::Duration;

use teleclay_clay::{Clay, Pose};
use teleclay_proto::Scheme;
use teleclay_proto::frame::{
    CopyState, Corrections, HandleFrame, LoopStatus, SweepRecord, SweepRefusal, ToolFrame,
};

use super::STALE;
use crate::Vec3;
use crate::deadband::Signal;
use crate::motion_limiter::{MotionLimiter, Recovery, Setpoint};
use crate::replica::{
    Copy, CorrectionLimits, Cut, Edge, Novelty, SweepInbox, SweepLog, ToolSetup, WINDOW,
};
use crate::round_trip;
use crate::scheme::tdpa::TdpaHandle;
use crate::scheme::{ClayCopy, Coupling, HandleController, HandlePort};
use crate::time::Timestamp;

/// A snapshot may be older than the request for it by this much: the server takes it from a mirror that follows its
/// clay.
const SNAPSHOT_LAG: Duration = Duration::from_millis(500);
/// Snapshots are asked for no more often than this.
const SNAPSHOT_EVERY: Duration = Duration::from_secs(1);
/// Cuts repeated on a fresh snapshot in one tick at most.
const REPEATS_A_TICK: usize = 24;
/// With perceptual coding a frame goes out when this many sweeps wait for their first: a third of what a frame carries,
/// so that every one goes out three times at least while the line is short.
const SWEEPS_DUE: usize = 8;

/// Asks the shell for a snapshot of the server's clay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WantedSnapshot {
    /// Which request this is; a new number is a new request.
    pub number: u32,
    /// The block that it should show.
    pub epoch: u32,
}

/// A snapshot of the server's clay.
pub struct Snapshot {
    /// The clay.
    pub clay: Box<Clay>,
    /// Which block it is.
    pub epoch: u32,
}

#[derive(Clone, Copy)]
struct Request {
    wanted: WantedSnapshot,
    at: Timestamp,
    /// Own sweeps up to this number were acknowledged then.
    acknowledged: u32,
}

/// Cuts to be repeated on a fresh snapshot, newest first: own ones above `own_floor`, others' that came after `since`.
#[derive(Clone, Copy)]
struct Rebuild {
    own_next: u32,
    own_floor: u32,
    others_next: u64,
    since: Timestamp,
}

/// The handle's controller.
pub struct ReplicaHandle {
    coupling: Coupling,
    setup: Arc<ToolSetup>,
    fallback: TdpaHandle,
    copy: Option<Copy>,
    motion_limiter: MotionLimiter,
    log: SweepLog,
    /// Number of the last sweep that changed the copy.
    changed_by: u32,
    /// First sweep of the present block.
    epoch_from: u32,
    inbox: SweepInbox,
    others: Recent,
    /// Room for the corrections of the next copy.
    corrections_waiting: Vec<Cut>,
    rebuild: Option<Rebuild>,
    epoch: u32,
    status: LoopStatus,
    gain: f64,
    last_frame: Option<Timestamp>,
    /// Displacement of the server's tool as last received, m.
    far_tool: Option<Vec3>,
    refused: u32,
    is_diverged: bool,
    is_stale: bool,
    request: Option<Request>,
    requests: u32,
    asked_at: Option<Timestamp>,
    /// What others have cut before is in every snapshot of this epoch, or was undone.
    exchanged_at: Timestamp,
    retired: Option<Box<Clay>>,
}

impl ReplicaHandle {
    /// Without a copy yet.
    pub fn new(coupling: Coupling, setup: Arc<ToolSetup>) -> Self {
        Self {
            fallback: TdpaHandle::new(coupling.clone()),
            coupling,
            copy: None,
            motion_limiter: MotionLimiter::new(setup.motion_limits),
            setup,
            log: SweepLog::default(),
            changed_by: 0,
            epoch_from: 1,
            inbox: SweepInbox::default(),
            others: Recent::default(),
            corrections_waiting: Copy::room_for_corrections(),
            rebuild: None,
            epoch: 0,
            status: LoopStatus::Idle,
            gain: 0.0,
            last_frame: None,
            far_tool: None,
            refused: 0,
            is_diverged: false,
            is_stale: false,
            request: None,
            requests: 0,
            asked_at: None,
            exchanged_at: Timestamp::ZERO,
            retired: None,
        }
    }

    /// What corrections of the copy have done to the hand; nothing without a copy.
    fn corrections(&self) -> Corrections {
        let Some(limiter) = self.copy.as_ref().map(Copy::limiter) else {
            return Corrections::default();
        };
        Corrections {
            moved_n: limiter.moved_n() / -self.coupling.force_ratio,
            held_n: self.coupling.felt(limiter.held()).map(|n| n as f32).into(),
            largest_step_n: (limiter.largest_step_n() / -self.coupling.force_ratio) as f32,
            injected_j: (limiter.injected_j() / self.coupling.power_ratio()) as f32,
            tank_j: (limiter.tank_j() / self.coupling.power_ratio()) as f32,
            count: limiter.corrections(),
        }
    }

    /// What corrections may do to the device, as the tool's side of the ratios has it.
    fn correction_limits(&self) -> CorrectionLimits {
        let at_device = CorrectionLimits::for_range(self.setup.force_limit_n);
        CorrectionLimits {
            step_n: at_device.step_n * -self.coupling.force_ratio,
            tank_j: at_device.tank_j * self.coupling.power_ratio(),
        }
    }

    fn take_acknowledgement(&mut self, frame: &ToolFrame) {
        self.log
            .on_acknowledged(frame.sweeps_acknowledged, &frame.sweep_gaps);
        self.log.on_durable(frame.sweeps_durable);
    }

    fn take_relayed(&mut self, now: Timestamp, frame: &ToolFrame) {
        self.inbox.skip_to(frame.relayed.oldest_unacknowledged);
        for record in &frame.relayed {
            let has_room = self.copy.as_ref().is_none_or(Copy::has_room);
            if !has_room {
                // Not noted as come, so it will be repeated.
                return;
            }
            if self.inbox.on_sweep(record.sequence) != Novelty::New {
                continue;
            }
            let cut = cut_of(&record);
            self.others.push(now, cut);
            if let Some(copy) = &mut self.copy {
                copy.correct(cut);
            }
        }
    }

    fn start_epoch(&mut self, now: Timestamp, epoch: u32) {
        self.epoch = epoch;
        self.log.give_up();
        self.inbox.restart();
        self.epoch_from = self.log.last() + 1;
        self.changed_by = self.log.last();
        self.others.clear();
        self.exchanged_at = Timestamp::ZERO;
        self.rebuild = None;
        self.is_diverged = false;
        if let Some(copy) = self.copy.take() {
            let (clay, corrections) = copy.into_parts();
            self.retired = Some(clay);
            self.corrections_waiting = corrections;
        }
        self.ask_for_snapshot(now);
    }

    /// The server's clay was exchanged under a new epoch: the copy stays and is cut on until a snapshot takes its
    /// place, through the limiter, as any that heals it. What was cut before is in the snapshot, or was undone.
    fn follow_exchange(&mut self, now: Timestamp, frame: &ToolFrame) {
        self.epoch = frame.header.clay_epoch;
        if let Some(copy) = &mut self.copy {
            copy.follow(self.epoch);
        }
        self.epoch_from = frame.sweeps_acknowledged + 1;
        self.exchanged_at = now;
        self.rebuild = None;
        self.is_diverged = self.copy.is_some();
        self.ask_for_snapshot(now);
    }

    /// Whether a frame's clay is the copy's, exchanged.
    fn is_exchanged(&self, frame: &ToolFrame) -> bool {
        let ahead = frame.header.clay_epoch.wrapping_sub(self.epoch);
        self.epoch != 0 && ahead <= frame.epochs_kept.into()
    }

    fn ask_for_snapshot(&mut self, now: Timestamp) {
        self.requests = self.requests.wrapping_add(1);
        self.asked_at = Some(now);
        self.request = Some(Request {
            wanted: WantedSnapshot {
                number: self.requests,
                epoch: self.epoch,
            },
            at: now,
            acknowledged: self.log.acknowledged(),
        });
    }

    /// Looks whether the two clays are one, where that can be told.
    fn compare(&mut self, frame: &ToolFrame) {
        if frame.sweeps_refused != self.refused {
            self.refused = frame.sweeps_refused;
            // A sweep of a block that is gone says nothing of the copy, which is of the present one.
            let is_of_this_block = frame.refusal != SweepRefusal::WrongEpoch;
            self.is_diverged |= self.copy.is_some() && is_of_this_block;
        }
        let Some(copy) = &self.copy else { return };
        let is_under_way = self.rebuild.is_some()
            || copy.has_corrections()
            || !frame.relayed.is_empty()
            || self.inbox.complete() + 1 != frame.relayed.oldest_unacknowledged
            || frame.sweeps_acknowledged < self.changed_by;
        if is_under_way || frame.clay_hash == 0 {
            return;
        }
        if let Some(hash) = copy.hash() {
            self.is_diverged = hash != frame.clay_hash;
        }
    }

    /// Repeats a few of the cuts that a fresh snapshot may not have.
    fn go_on_rebuilding(&mut self) {
        let (Some(copy), Some(rebuild)) = (&mut self.copy, &mut self.rebuild) else {
            return;
        };
        for _ in 0..REPEATS_A_TICK {
            let own = (rebuild.own_floor < rebuild.own_next)
                .then(|| self.log.record(rebuild.own_next))
                .flatten();
            if let Some(record) = own {
                copy.carve(&self.setup, cut_of(record));
                rebuild.own_next -= 1;
                continue;
            }
            let other = rebuild
                .others_next
                .checked_sub(1)
                .and_then(|number| self.others.at(number));
            match other {
                Some((came, cut)) if rebuild.since <= came => {
                    copy.carve(&self.setup, cut);
                    rebuild.others_next -= 1;
                }
                _ => {
                    self.rebuild = None;
                    return;
                }
            }
        }
    }

    /// Whether the copy may be cut in this tick.
    fn edge(&mut self, now: Timestamp) -> Edge {
        // A copy that was given on joining waits for its first frame no longer than for any other.
        let is_silent = STALE < now.since(*self.last_frame.get_or_insert(now));
        // A log with a fifth of its room left is full: a sweep that finds no room would be felt here and never cut
        // there.
        self.is_stale = is_silent || WINDOW - WINDOW / 5 < self.log.kept();
        let works = matches!(self.status, LoopStatus::Running | LoopStatus::Idle);
        if works && !self.is_stale {
            Edge::Cutting
        } else {
            Edge::Blunt
        }
    }

    fn local_reaction(&mut self, now: Timestamp, port: &HandlePort) -> Vec3 {
        self.go_on_rebuilding();
        let edge = self.edge(now);
        let tick_s = self.setup.motion_limits.tick_s;
        let works = matches!(self.status, LoopStatus::Running | LoopStatus::Idle);
        let change = tick_s / self.setup.ramp_s;
        self.gain = (self.gain + if works { change } else { -change }).clamp(0.0, 1.0);

        let before = self.motion_limiter.at();
        let reference = port.position * self.coupling.position_ratio;
        let setpoint = Setpoint {
            reference,
            recovery: Recovery::Absolute,
            lift_m: self.setup.is_lifted.then_some(reference.z),
        };
        let at = self.motion_limiter.step(setpoint, self.gain);
        let velocity = (at - before) / tick_s;
        let Some(copy) = &mut self.copy else {
            return Vec3::zeros();
        };
        // Within reach, so on the lattice.
        let to = Pose::quantise((self.setup.home + at).into()).unwrap_or(copy.pose());
        let worked = copy.step(&self.setup, to, velocity, edge);
        if let Some(cut) = worked.cut {
            // `edge` keeps room.
            if let Ok(number) = self.log.push(cut.from.steps(), cut.to.steps())
                && worked.has_changed_clay
            {
                self.changed_by = number;
            }
        }
        self.coupling.felt(worked.force)
    }
}

impl HandleController for ReplicaHandle {
    fn on_frame(&mut self, now: Timestamp, frame: &ToolFrame) {
        if frame.header.scheme != Scheme::Replica {
            return;
        }
        self.fallback.take_in(frame);
        self.last_frame = Some(now);
        self.status = frame.status;
        self.far_tool = Some(Vec3::from(frame.position_m) - self.setup.home);
        self.take_acknowledgement(frame);
        let header = &frame.header;
        if let Some(round_trip) = round_trip::of_exchange(now, header.echo_ns, header.echo_hold_ns)
        {
            self.log.on_round_trip(now, round_trip);
        }
        if frame.header.clay_epoch != self.epoch {
            if self.is_exchanged(frame) {
                self.follow_exchange(now, frame);
            } else {
                self.start_epoch(now, frame.header.clay_epoch);
            }
        }
        self.take_relayed(now, frame);
        self.compare(frame);
        let may_ask = self
            .asked_at
            .is_none_or(|asked_at| SNAPSHOT_EVERY < now.since(asked_at));
        if self.is_diverged && self.request.is_none() && may_ask {
            self.ask_for_snapshot(now);
        }
    }

    fn on_late_frame(&mut self, now: Timestamp, frame: &ToolFrame) {
        if frame.header.scheme == Scheme::Replica && frame.header.clay_epoch == self.epoch {
            self.take_relayed(now, frame);
        }
    }

    fn on_stale_frame(&mut self, now: Timestamp, frame: &ToolFrame) {
        if frame.header.scheme == Scheme::Replica && frame.header.clay_epoch == self.epoch {
            self.take_acknowledgement(frame);
            self.take_relayed(now, frame);
        }
    }

    /// What came to the tool side before need not have come to this one, which relays under numbers of its own and has
    /// refused nothing.
    fn on_another_peer(&mut self) {
        self.log.forget_what_came();
        self.inbox.restart();
        self.refused = 0;
    }

    fn reaction(&mut self, now: Timestamp, port: &HandlePort) -> Vec3 {
        if self.copy.is_some() {
            self.local_reaction(now, port)
        } else {
            self.fallback.reaction(now, port)
        }
    }

    fn needs_frames(&self) -> bool {
        self.copy.is_none()
    }

    fn fill(&mut self, frame: &mut HandleFrame) {
        self.fallback.fill(frame);
        frame.copy = self.state();
        frame.corrections = self.corrections();
        frame.clay_hash = self.copy.as_ref().and_then(Copy::hash).unwrap_or(0);
        frame.relayed_acknowledged = self.inbox.complete();
        self.inbox.fill(&mut frame.relayed_gaps);
        frame.header.clay_epoch = self.copy.as_ref().map_or(self.epoch, Copy::epoch);
        let now = Timestamp::from_nanos(frame.header.sent_ns);
        self.log.fill(now, &mut frame.sweeps);
    }

    fn has_urgent_news(&self) -> bool {
        SWEEPS_DUE <= self.log.unsent()
    }

    fn on_sent(&mut self, frame: &HandleFrame) {
        let now = Timestamp::from_nanos(frame.header.sent_ns);
        self.log.on_sent(now, &frame.sweeps);
    }

    /// The server needs the sweeps, and when there are none, a sign of life.
    fn signal(&self, frame: &HandleFrame) -> Option<Signal> {
        if self.copy.is_some() {
            Some(Signal::velocity(Vec3::zeros()))
        } else {
            self.fallback.signal(frame)
        }
    }

    fn clay_copy(&self) -> Option<&dyn ClayCopy> {
        Some(self)
    }

    fn clay_copy_mut(&mut self) -> Option<&mut dyn ClayCopy> {
        Some(self)
    }
}

impl ClayCopy for ReplicaHandle {
    fn state(&self) -> CopyState {
        match &self.copy {
            None => CopyState::None,
            Some(_) if self.is_stale => CopyState::Stale,
            Some(_) if self.is_diverged => CopyState::Diverged,
            Some(_) => CopyState::Live,
        }
    }

    fn copy(&self) -> Option<&Copy> {
        self.copy.as_ref()
    }

    fn log(&self) -> &SweepLog {
        &self.log
    }

    fn wanted_snapshot(&self) -> Option<WantedSnapshot> {
        self.request.map(|request| request.wanted)
    }

    fn handle_snapshot(&mut self, snapshot: Snapshot) {
        if self.epoch == 0 {
            // It came with the lease, before the first frame.
            self.epoch = snapshot.epoch;
        }
        if snapshot.epoch != self.epoch {
            self.retired = Some(snapshot.clay);
            return;
        }
        let request = self.request.take();
        let lag_ns = SNAPSHOT_LAG.as_nanos() as u64;
        let since = request.map_or(Timestamp::ZERO, |request| {
            Timestamp::from_nanos(request.at.as_nanos().saturating_sub(lag_ns))
        });
        let lag_sweeps = (SNAPSHOT_LAG.as_secs_f64() / self.setup.motion_limits.tick_s) as u32;
        let acknowledged = request.map_or(0, |request| request.acknowledged);
        self.rebuild = Some(Rebuild {
            own_next: self.log.last(),
            own_floor: acknowledged
                .saturating_sub(lag_sweeps)
                .max(self.epoch_from - 1),
            others_next: self.others.count,
            since: since.max(self.exchanged_at),
        });
        self.is_diverged = false;
        if let Some(copy) = &mut self.copy {
            self.retired = Some(copy.exchange(snapshot.clay));
            return;
        }
        if let Some(far_tool) = self.far_tool {
            self.motion_limiter.put(far_tool);
        }
        let at = self.setup.home + self.motion_limiter.at();
        // Within reach, so on the lattice.
        let pose = Pose::quantise(at.into()).unwrap_or_default();
        let corrections = std::mem::take(&mut self.corrections_waiting);
        let limits = self.correction_limits();
        self.copy = Some(Copy::new(
            snapshot.clay,
            snapshot.epoch,
            pose,
            limits,
            corrections,
        ));
        self.gain = 0.0;
    }

    fn poll_retired(&mut self) -> Option<Box<Clay>> {
        self.retired.take()
    }

    fn move_to(&mut self, setup: &Arc<ToolSetup>) {
        self.motion_limiter.limit(setup.motion_limits);
        self.setup = Arc::clone(setup);
    }
}

fn cut_of(record: &SweepRecord) -> Cut {
    Cut {
        from: Pose::from_steps(record.from),
        to: Pose::from_steps(record.to),
    }
}

/// Others' cuts in the order they came, the last [`WINDOW`] of them.
struct Recent {
    cuts: Box<[(Timestamp, Cut)]>,
    /// How many came so far; the newest is number `count - 1`.
    count: u64,
}

impl Default for Recent {
    fn default() -> Self {
        let none = Cut {
            from: Pose::default(),
            to: Pose::default(),
        };
        Self {
            cuts: vec![(Timestamp::ZERO, none); WINDOW].into_boxed_slice(),
            count: 0,
        }
    }
}

impl Recent {
    /// As if none had come; the memory stays.
    fn clear(&mut self) {
        self.count = 0;
    }

    fn push(&mut self, came: Timestamp, cut: Cut) {
        self.cuts[self.count as usize % WINDOW] = (came, cut);
        self.count += 1;
    }

    fn at(&self, number: u64) -> Option<(Timestamp, Cut)> {
        let is_kept = number < self.count && self.count <= number + WINDOW as u64;
        is_kept.then(|| self.cuts[number as usize % WINDOW])
    }
}
