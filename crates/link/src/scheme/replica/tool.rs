//! The tool's controller: the authority merges what the handle has cut.

use std::sync::Arc;

use teleclay_clay::{Clay, ContactState, Material, Motion, Pose, Sweep};
use teleclay_proto::frame::{
    CopyState, HandleFrame, LoopStatus, SweepRecord, SweepRefusal, Sweeps, ToolFrame,
};
use teleclay_proto::{Scheme, is_after};

use crate::Vec3;
use crate::deadband::Signal;
use crate::motion_limiter::Recovery;
use crate::replica::{Cut, Impossible, Novelty, SweepInbox, SweepLog, ToolSetup, WINDOW};
use crate::round_trip;
use crate::scheme::tdpa::TdpaTool;
use crate::scheme::{Coupling, Generation, ToolController, ToolPort};
use crate::time::Timestamp;

/// Sweeps that wait for the tick at most: as many as can be under way, so that none is ever refused room.
const WAITING: usize = WINDOW;
/// Sweeps merged in one tick at most: what an outage held back comes at 64 times the speed at which it was made.
const MERGES_A_TICK: usize = 64;

/// With perceptual coding a frame goes out when this many relayed sweeps wait for their first, as on the way up.
const RELAYS_DUE: usize = 8;

/// What a merging tool works with in one tick.
pub struct MergeContext<'a> {
    /// The server's clay.
    pub clay: &'a mut Clay,
    /// What it resists with.
    pub material: &'a Material,
    /// What it remembers of this tool.
    pub contact: &'a mut ContactState,
    /// What the loop does.
    pub status: LoopStatus,
    /// Gets every cut that was merged, for others' copies. Has room for what a tick may merge.
    pub cuts: &'a mut Vec<Cut>,
}

/// What a tick of merging came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Merged {
    /// Displacement of the tool, m.
    pub displacement: Vec3,
    /// Its velocity, m/s.
    pub velocity: Vec3,
    /// The clay's answer here, N.
    pub force: Vec3,
    /// Area of the tool that meets clay, m².
    pub engaged_area_m2: f64,
    /// What was removed, in units of 1/255 voxel.
    pub removed_units: u64,
    /// Number of the newest sweep merged in this tick, if one was newer than all before it.
    pub newest: Option<u32>,
}

/// What the handle knew of a hold when it made its sweeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hold {
    /// The tools work.
    None,
    /// They were told to rest at this time of ours, ns; the handle may not know yet.
    Told { since_ns: u64 },
    /// The handle knows: sweeps beyond this number were made in spite of it.
    Known { last: u32 },
}

/// The tool's controller.
pub struct ReplicaTool {
    setup: Arc<ToolSetup>,
    fallback: TdpaTool,
    inbox: SweepInbox,
    relay: SweepLog,
    pending: Vec<SweepRecord>,
    /// Frames of an earlier generation of this scheme number their sweeps otherwise.
    since_revision: u32,
    epoch: u32,
    /// Sweeps of this block and all since count: clay was only exchanged since.
    kept_from: u32,
    handle_leads: bool,
    hold: Hold,
    refused: u32,
    refusal: SweepRefusal,
    newest: u32,
    /// Newest number seen in any frame, and whether the newest frame had nothing newer: then the tool rested in its
    /// tick.
    seen: u32,
    rests: bool,
    merged: Option<Merged>,
    hash: u64,
}

impl ReplicaTool {
    /// At rest; the handle has no copy yet.
    pub fn new(coupling: Coupling, setup: Arc<ToolSetup>) -> Self {
        Self {
            fallback: TdpaTool::new(coupling),
            setup,
            inbox: SweepInbox::default(),
            relay: SweepLog::default(),
            pending: Vec::with_capacity(WAITING),
            since_revision: 0,
            epoch: 0,
            kept_from: 0,
            handle_leads: false,
            hold: Hold::None,
            refused: 0,
            refusal: SweepRefusal::None,
            newest: 0,
            seen: 0,
            rests: true,
            merged: None,
            hash: 0,
        }
    }

    /// Sweeps of others that the handle has not acknowledged.
    pub fn relays_waiting(&self) -> usize {
        self.relay.waiting()
    }

    fn is_of_this_generation(&self, frame: &HandleFrame) -> bool {
        frame.header.scheme == Scheme::Replica
            && !is_after(self.since_revision, frame.header.revision)
    }

    fn cuts_this_clay(&self, epoch: u32) -> bool {
        !is_after(self.kept_from, epoch) && !is_after(epoch, self.epoch)
    }

    /// Sweeps that cut a block which is gone. Each is decided once, as any other.
    fn refuse_sweeps(&mut self, sweeps: &Sweeps) {
        for record in sweeps {
            if self.inbox.on_sweep(record.sequence) == Novelty::New {
                self.refuse(SweepRefusal::WrongEpoch);
            }
        }
    }

    fn refuse(&mut self, refusal: SweepRefusal) {
        self.refused = self.refused.wrapping_add(1);
        self.refusal = refusal;
    }

    fn take_sweeps(&mut self, sweeps: &Sweeps) {
        self.inbox.skip_to(sweeps.oldest_unacknowledged);
        for record in sweeps {
            if WAITING <= self.pending.len() {
                // Not noted as come, so it will be repeated.
                return;
            }
            if self.inbox.on_sweep(record.sequence) == Novelty::New {
                self.pending.push(record);
            }
        }
    }

    fn follow_hold(&mut self, now: Timestamp, status: LoopStatus) {
        let rests = matches!(status, LoopStatus::Paused | LoopStatus::Fault);
        self.hold = match (rests, self.hold) {
            (false, _) => Hold::None,
            (true, Hold::None) => Hold::Told {
                since_ns: now.as_nanos(),
            },
            (true, hold) => hold,
        };
    }

    /// Why a sweep is not merged, if it is not.
    fn judge(&self, record: &SweepRecord, status: LoopStatus) -> Option<SweepRefusal> {
        if let Hold::Known { last } = self.hold
            && last < record.sequence
        {
            return Some(if status == LoopStatus::Fault {
                SweepRefusal::Fault
            } else {
                SweepRefusal::Paused
            });
        }
        match self.setup.check(&cut_of(record)) {
            Ok(()) => None,
            Err(Impossible::OutOfReach) => Some(SweepRefusal::OutOfReach),
            Err(Impossible::TooFast) => Some(SweepRefusal::TooFast),
        }
    }

    fn merge_one(
        &mut self,
        record: &SweepRecord,
        context: &mut MergeContext<'_>,
        merged: &mut Merged,
    ) {
        if let Some(refusal) = self.judge(record, context.status) {
            self.refuse(refusal);
            return;
        }
        let cut = cut_of(record);
        context.cuts.push(cut);
        let way = Vec3::from(cut.to.displacement_from_m(cut.from));
        let velocity = way / self.setup.motion_limits.tick_s;
        let motion = (self.newest < record.sequence)
            .then(|| Motion::new(cut.from, cut.to, velocity.into()).ok())
            .flatten();
        let Some(motion) = motion else {
            // One that was overtaken: what it cut counts, where the tool is now it does not say.
            merged.removed_units += context.clay.carve(&Sweep {
                shape: *self.setup.tool.shape(),
                from: cut.from,
                to: cut.to,
            });
            return;
        };
        self.newest = record.sequence;
        let worked =
            context
                .clay
                .work(&self.setup.tool, context.material, &motion, context.contact);
        *merged = Merged {
            displacement: Vec3::from(cut.to.position_m()) - self.setup.home,
            velocity,
            force: Vec3::from(worked.response.force_n),
            engaged_area_m2: worked.response.engaged_area_m2,
            removed_units: merged.removed_units + worked.moved_units,
            newest: Some(record.sequence),
        };
    }
}

impl ReplicaTool {
    fn feel_at_rest(&self, context: &mut MergeContext<'_>, merged: &mut Merged) {
        merged.velocity = Vec3::zeros();
        let pose = Pose::quantise((self.setup.home + merged.displacement).into());
        // Merged sweeps are within reach, so on the lattice; and rest is a motion.
        let rest = pose.ok().and_then(|at| Motion::new(at, at, [0.0; 3]).ok());
        if let Some(rest) = rest {
            let felt =
                context
                    .clay
                    .feel(&self.setup.tool, context.material, &rest, context.contact);
            merged.force = Vec3::from(felt.force_n);
            merged.engaged_area_m2 = felt.engaged_area_m2;
        }
    }
}

impl ToolController for ReplicaTool {
    fn on_frame(&mut self, now: Timestamp, frame: &HandleFrame) {
        if !self.is_of_this_generation(frame) {
            self.handle_leads = false;
            return;
        }
        self.fallback.take_in(frame);
        let is_of_this_block = self.cuts_this_clay(frame.header.clay_epoch);
        self.handle_leads = frame.copy != CopyState::None && is_of_this_block;
        self.relay
            .on_acknowledged(frame.relayed_acknowledged, &frame.relayed_gaps);
        self.relay.on_durable(frame.relayed_acknowledged);
        let header = &frame.header;
        if let Some(round_trip) = round_trip::of_exchange(now, header.echo_ns, header.echo_hold_ns)
        {
            self.relay.on_round_trip(now, round_trip);
        }
        let newest = frame.sweeps.iter().map(|sweep| sweep.sequence).max();
        let newest = newest.unwrap_or(0);
        if let Hold::Told { since_ns } = self.hold
            && since_ns <= frame.header.echo_ns
        {
            // The handle needs the ramp to come to rest.
            let ramp = self.setup.ramp_s / self.setup.motion_limits.tick_s;
            self.hold = Hold::Known {
                last: newest.max(self.seen) + ramp.ceil() as u32 + 1,
            };
        }
        self.rests = newest <= self.seen;
        self.seen = self.seen.max(newest);
        self.on_late_frame(now, frame);
    }

    fn on_late_frame(&mut self, _now: Timestamp, frame: &HandleFrame) {
        if !self.is_of_this_generation(frame) || frame.copy == CopyState::None {
            return;
        }
        if self.cuts_this_clay(frame.header.clay_epoch) {
            self.take_sweeps(&frame.sweeps);
        } else {
            self.refuse_sweeps(&frame.sweeps);
        }
    }

    fn on_stale_frame(&mut self, now: Timestamp, frame: &HandleFrame) {
        if !self.is_of_this_generation(frame) {
            return;
        }
        self.relay
            .on_acknowledged(frame.relayed_acknowledged, &frame.relayed_gaps);
        self.relay.on_durable(frame.relayed_acknowledged);
        let newest = frame.sweeps.iter().map(|sweep| sweep.sequence).max();
        self.seen = self.seen.max(newest.unwrap_or(0));
        self.on_late_frame(now, frame);
    }

    fn merge(
        &mut self,
        now: Timestamp,
        port: &ToolPort,
        mut context: MergeContext<'_>,
    ) -> Option<Merged> {
        /// Half a microsecond each.
        const BRICKS_A_TICK: usize = 2;
        self.follow_hold(now, context.status);
        let mut merged = match self.merged {
            Some(before) => Merged {
                removed_units: 0,
                newest: None,
                ..before
            },
            None => Merged {
                displacement: port.position,
                velocity: Vec3::zeros(),
                force: Vec3::zeros(),
                engaged_area_m2: 0.0,
                removed_units: 0,
                newest: None,
            },
        };
        let mut pending = std::mem::take(&mut self.pending);
        let count = pending.len().min(MERGES_A_TICK);
        for record in pending.drain(..count) {
            self.merge_one(&record, &mut context, &mut merged);
        }
        self.pending = pending;
        if merged.newest.is_none() && self.rests {
            self.feel_at_rest(&mut context, &mut merged);
        }
        let is_merged = context.clay.refresh_hashes(BRICKS_A_TICK) == 0 && self.pending.is_empty();
        self.hash = if is_merged { context.clay.hash() } else { 0 };
        if !self.handle_leads {
            self.merged = None;
            return None;
        }
        self.merged = Some(merged);
        Some(merged)
    }

    /// The handle has no sweep on its way: its tool rests.
    fn reference(&mut self, now: Timestamp, port: &ToolPort, remote_gain: f64) -> Vec3 {
        self.fallback.reference(now, port, remote_gain)
    }

    fn moved(&mut self, port: &ToolPort) {
        self.fallback.moved(port);
    }

    fn reindex(&mut self, handle_position: Vec3) {
        self.fallback.reindex(handle_position);
        self.merged = None;
    }

    fn recovery(&self) -> Recovery {
        self.fallback.recovery()
    }

    fn begin(&mut self, generation: Generation) {
        self.since_revision = generation.since_revision;
        self.epoch = generation.epoch;
        self.kept_from = generation.epoch;
    }

    fn has_merged_all(&self) -> bool {
        self.pending.is_empty() && self.inbox.complete() == self.seen
    }

    fn on_exchanged_clay(&mut self, epoch: u32) {
        self.epoch = epoch;
        // What others have cut by now is in the clay, or was undone.
        self.relay.give_up();
        self.hash = 0;
    }

    fn resume(&mut self, decided: u32) {
        self.inbox.skip_to(decided.saturating_add(1));
        self.newest = decided;
        self.seen = decided;
    }

    fn sweeps_decided(&self) -> u32 {
        let waiting = self.pending.iter().map(|record| record.sequence).min();
        let complete = self.inbox.complete();
        waiting.map_or(complete, |oldest| complete.min(oldest - 1))
    }

    fn on_fresh_block(&mut self, epoch: u32) {
        self.epoch = epoch;
        self.kept_from = epoch;
        self.pending.clear();
        self.relay.give_up();
        self.handle_leads = false;
        self.merged = None;
        self.hash = 0;
    }

    fn move_to(&mut self, setup: &Arc<ToolSetup>) {
        self.setup = Arc::clone(setup);
    }

    fn relay(&mut self, cut: Cut) {
        // A log that is full belongs to a handle that hears nothing; the hashes will tell it.
        let _ = self.relay.push(cut.from.steps(), cut.to.steps());
    }

    fn fill(&mut self, frame: &mut ToolFrame) {
        self.fallback.fill(frame);
        frame.sweeps_acknowledged = self.inbox.complete();
        // Without a journal what was noted is as durable as anything; with one the tool's side says what is.
        frame.sweeps_durable = frame.sweeps_acknowledged;
        let kept = self.epoch.wrapping_sub(self.kept_from);
        frame.epochs_kept = u8::try_from(kept).unwrap_or(u8::MAX);
        self.inbox.fill(&mut frame.sweep_gaps);
        frame.sweeps_refused = self.refused;
        frame.refusal = self.refusal;
        frame.clay_hash = self.hash;
        let now = Timestamp::from_nanos(frame.header.sent_ns);
        self.relay.fill(now, &mut frame.relayed);
    }

    fn has_urgent_news(&self) -> bool {
        RELAYS_DUE <= self.relay.unsent()
    }

    fn on_sent(&mut self, frame: &ToolFrame) {
        let now = Timestamp::from_nanos(frame.header.sent_ns);
        self.relay.on_sent(now, &frame.relayed);
    }

    fn signal(&self, frame: &ToolFrame) -> Option<Signal> {
        if self.handle_leads {
            Some(Signal::velocity(Vec3::zeros()))
        } else {
            self.fallback.signal(frame)
        }
    }
}

fn cut_of(record: &SweepRecord) -> Cut {
    Cut {
        from: Pose::from_steps(record.from),
        to: Pose::from_steps(record.to),
    }
}
