//! The machine. What changes it between two ticks stands in [`changes`] and [`manners`].

mod changes;
mod manners;

use std::collections::VecDeque;
use std::sync::Arc;

use teleclay_bilateral::{Permission, ToolSide, ToolStep};
use teleclay_clay::{Clay, Material};
use teleclay_link::arrivals::ArrivalCounts;
use teleclay_link::replica::Cut;
use teleclay_link::safety::Implausible;
use teleclay_link::scheme::Generation;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{HandleFrame, ToolFrame};
use teleclay_proto::http::MAX_TOOLS;

use crate::command::{Command, Outcome, Refusal};
use crate::cuts::{Cuts, ToolCuts};
use crate::event::{Event, EventKind, Release, Snapshot, StopSnapshot, ToolSnapshot};
use crate::prepare::{Parts, Prepared};
use crate::rules::Rules;
use crate::settings::{Lines, Settings};
use crate::slot::ToolSlot;

/// Events that wait to be taken away. A few seconds of the busiest session, should nobody come.
const EVENTS_WAITING: usize = 256;
/// Events that one command, or one tool in one tick, can bring at most.
const EVENTS_AT_ONCE: usize = 3;
/// Events of a stop: its own, and one for every tool. Nothing else gets their room, so a stop always finds it: it is
/// cleared by a command that waits until the room is there again.
const EVENTS_OF_A_STOP: usize = 1 + MAX_TOOLS as usize;
/// Cuts that one tool makes in one tick at most.
const CUTS_AT_ONCE: usize = teleclay_bilateral::CUTS_A_TICK;

/// What a session begins with.
pub struct SessionSetup {
    /// What it is told to be.
    pub settings: Settings,
    /// What the lines to the handles do.
    pub lines: Lines,
    /// The block.
    pub clay: Clay,
    /// Times of the rules about tools.
    pub rules: Rules,
    /// Number of the first lease. Leases of an earlier life of the session should lie below.
    pub first_lease: u32,
    /// Counts the servers that have run the session, from 1.
    pub ownership_epoch: u32,
}

/// One session.
///
/// Its methods are of four kinds, and are meant to be called in this order, tick by tick:
///
/// 1. `handle_*` takes in what comes from outside: [`handle_command`](Self::handle_command), [`handle_frame`](Self::handle_frame).
/// 2. [`tick`](Self::tick) lets a millisecond pass; [`rest`](Self::rest) lets many, where nothing happens in them.
/// 3. `poll_*` gives what is to go out, until each gives nothing more: [`poll_transmit`](Self::poll_transmit), then
///    [`poll_event`](Self::poll_event), then [`poll_retired`](Self::poll_retired).
/// 4. Everything else is a getter and changes nothing. [`snapshot`](Self::snapshot) allocates; the rest does not.
///
/// None of the first three kinds allocates or drops what is large.
pub struct Session {
    settings: Arc<Settings>,
    rules: Rules,
    clay: Clay,
    material: Material,
    slots: Vec<ToolSlot>,
    now: Timestamp,
    ticks: u64,
    revision: u64,
    clay_epoch: u32,
    ownership_epoch: u32,
    next_lease: u32,
    /// Nobody holds a tool, and nobody gets one, while there is one.
    stop: Option<StopSnapshot>,
    /// Counts of holders who have gone.
    departed: ArrivalCounts,
    /// Cuts of one tool on their way to the others.
    cuts: Vec<Cut>,
    /// What was cut, for whoever keeps it.
    made: Cuts,
    /// Whether what is cut now could not be kept.
    storage: Storage,
    journal: Journal,
    events: VecDeque<Event>,
    retired: Vec<Box<ToolSide>>,
    /// The frame that `poll_transmit` gave last, and the slot it looks at next.
    leaving: ToolFrame,
    next_to_transmit: usize,
}

/// Whether anything is kept beyond the process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Journal {
    None,
    Kept,
}

/// Whether what is cut can be kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Storage {
    Ready,
    Full,
}

impl Session {
    /// A session at rest, every tool free.
    pub fn new(setup: SessionSetup) -> Self {
        let SessionSetup {
            settings,
            lines,
            clay,
            rules,
            first_lease,
            ownership_epoch,
        } = setup;
        let tools = settings.tools();
        Self {
            rules,
            clay,
            material: settings.material(),
            slots: (0..tools)
                .map(|number| ToolSlot::new(number, &lines))
                .collect(),
            now: Timestamp::ZERO,
            ticks: 0,
            revision: settings.revision,
            clay_epoch: 1,
            ownership_epoch,
            next_lease: first_lease.max(1),
            stop: None,
            departed: ArrivalCounts::default(),
            cuts: Vec::with_capacity(CUTS_AT_ONCE),
            made: Cuts::new(tools, 0),
            storage: Storage::Ready,
            journal: Journal::None,
            events: VecDeque::with_capacity(EVENTS_WAITING + EVENTS_OF_A_STOP),
            retired: Vec::with_capacity(tools),
            leaving: ToolFrame::default(),
            next_to_transmit: 0,
            settings: Arc::new(settings),
        }
    }

    /// Carries a command out, or leaves everything as it is. Either way `prepared` then holds what is to be dropped
    /// elsewhere.
    ///
    /// A stop is never refused. One that comes while another holds changes nothing, and succeeds.
    ///
    /// # Errors
    /// Why the command was refused. Nothing has changed then, and no event is told.
    pub fn handle_command(
        &mut self,
        now: Timestamp,
        prepared: &mut Prepared,
    ) -> Result<Outcome, Refusal> {
        let is_stop = matches!(prepared.parts, Parts::Stop(_));
        if !is_stop && !self.has_room_for(EVENTS_AT_ONCE) {
            return Err(Refusal::Busy);
        }
        if let Some(prepared_from) = prepared.prepared_from
            && prepared_from != self.settings.revision
        {
            return Err(Refusal::Overtaken {
                prepared_from,
                settings_from: self.settings.revision,
            });
        }
        if let Some(lease) = prepared.asked_by {
            self.slot_of(lease)?;
        }
        let granted = match &mut prepared.parts {
            Parts::Patch(parts) => {
                self.patch(parts);
                None
            }
            Parts::Reset(parts) => {
                self.reset(parts);
                None
            }
            Parts::Join(parts) => Some(self.join(now, parts)?),
            Parts::Exchange(parts) => {
                self.exchange(parts)?;
                None
            }
            Parts::Leave { lease, side } => {
                let slot = self.slot_of(*lease)?;
                *side = self.release(slot, Release::Left);
                None
            }
            Parts::Stop(parts) => {
                self.stop(parts);
                None
            }
            Parts::ClearStop { by, before } => {
                *before = Some(self.clear_stop(by)?);
                None
            }
            Parts::Control(parts) => {
                self.control(now, parts)?;
                None
            }
        };
        Ok(Outcome {
            revision: self.revision,
            clay_epoch: self.clay_epoch,
            granted,
        })
    }

    /// Prepares a command and carries it out at once, where nothing ticks in real time: this allocates.
    ///
    /// # Errors
    /// Why the command was refused.
    pub fn carry_out(&mut self, now: Timestamp, command: &Command) -> Result<Outcome, Refusal> {
        let mut prepared = Prepared::new(command, &self.settings)?;
        self.handle_command(now, &mut prepared)
    }

    /// Changes what the lines do, from the next frame on, to what no setting can say. The settings stay as they are.
    pub fn impair(&mut self, lines: &Lines) {
        for (number, slot) in self.slots.iter_mut().enumerate() {
            slot.impair(number, lines);
        }
    }

    /// A frame from the handle of the tool in `slot` entered the line. What comes for a slot that does not exist, or
    /// that nobody holds, is dropped.
    pub fn handle_frame(&mut self, now: Timestamp, slot: usize, frame: &HandleFrame) {
        if let Some(slot) = self.slots.get_mut(slot)
            && slot.holder.is_some()
        {
            slot.up.push(now, frame.clone());
        }
    }

    /// One tick of every tool.
    pub fn tick(&mut self, now: Timestamp) {
        self.tick_heard(now, |_, _, _| {});
    }

    /// One tick of every tool, told to `heard` besides: each frame that leaves a line up in this tick, with its slot
    /// and when the tool side takes it to have come. Frames that the line still holds, or has lost, are not among them.
    pub fn tick_heard(
        &mut self,
        now: Timestamp,
        mut heard: impl FnMut(usize, Timestamp, &HandleFrame),
    ) {
        self.now = now;
        self.ticks += 1;
        self.made.clear();
        for number in 0..self.slots.len() {
            self.tick_tool(number, &mut heard);
        }
        self.clay.commit_ahead();
        for number in 0..self.slots.len() {
            self.follow_holder(number);
            self.forget_old(number);
        }
        self.next_to_transmit = 0;
    }

    /// Whether nothing happens in any further tick, until a command comes: nobody holds a tool, no tool is kept for
    /// anybody, nothing is to be taken away, and the clay is ready for whoever comes.
    pub fn is_at_rest(&self) -> bool {
        self.events.is_empty()
            && self.retired.is_empty()
            && self.slots.iter().all(ToolSlot::is_at_rest)
            && self.clay.is_committed_ahead()
    }

    /// Lets ticks pass of a session that is [at rest](Self::is_at_rest), the last of them at `now`. It is then as it
    /// would be after as many calls of [`tick`](Self::tick), to the last bit, and has taken the time of none.
    pub fn rest(&mut self, now: Timestamp, ticks: u64) {
        debug_assert!(self.is_at_rest(), "something would happen in these ticks");
        if ticks == 0 {
            return;
        }
        self.now = now;
        self.ticks += ticks;
        self.made.clear();
        self.next_to_transmit = 0;
    }

    /// A journal is kept from now on: frames say that a sweep is durable only when [`Session::set_durable`] has.
    pub fn keep_journal(&mut self) {
        self.journal = Journal::Kept;
        self.sides_mut().for_each(|side| side.set_durable(0));
    }

    /// Everything that happened up to and in this tick is durable.
    pub fn set_durable(&mut self, tick: u64) {
        for slot in &mut self.slots {
            slot.set_durable(tick);
        }
    }

    /// What the tools have cut in the last tick, under every scheme; one entry for each tool that was held. The order
    /// is the one in which they cut. It stands until the next tick.
    pub fn cuts(&self) -> impl Iterator<Item = ToolCuts<'_>> {
        self.made.iter()
    }

    /// What is cut now could not be kept: the tools rest, as in a pause, until [`Session::resume_cutting`].
    pub fn stop_cutting(&mut self) {
        self.storage = Storage::Full;
    }

    /// What is cut can be kept again.
    pub fn resume_cutting(&mut self) {
        self.storage = Storage::Ready;
    }

    /// Whether what is cut can be kept, as told last.
    pub fn can_keep_cuts(&self) -> bool {
        self.storage == Storage::Ready
    }

    /// The next frame that leaves a line towards a handle in this tick, and the slot of its tool.
    pub fn poll_transmit(&mut self) -> Option<(usize, &ToolFrame)> {
        while let Some(slot) = self.slots.get_mut(self.next_to_transmit) {
            if let Some(frame) = slot.down.poll(self.now) {
                self.leaving = frame;
                return Some((self.next_to_transmit, &self.leaving));
            }
            self.next_to_transmit += 1;
        }
        None
    }

    /// The next thing that has changed.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// The next thing that the session is done with, to be dropped where that costs no tick.
    pub fn poll_retired(&mut self) -> Option<Box<ToolSide>> {
        self.retired.pop()
    }

    /// The state of the session, but for the clay itself and the motion of tools.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            tick: self.ticks,
            revision: self.revision,
            settings: Arc::clone(&self.settings),
            clay_epoch: self.clay_epoch,
            ownership_epoch: self.ownership_epoch,
            stop: self.stop.clone(),
            tools: self.slots.iter().map(ToolSlot::snapshot).collect(),
        }
    }

    /// What the session was told to be.
    pub fn settings(&self) -> &Arc<Settings> {
        &self.settings
    }

    /// Counts the changes.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Counts the fresh blocks, from 1.
    pub fn clay_epoch(&self) -> u32 {
        self.clay_epoch
    }

    /// Counts the servers that have run the session, from 1.
    pub fn ownership_epoch(&self) -> u32 {
        self.ownership_epoch
    }

    /// Number of the next lease: above all that were given.
    pub fn next_lease(&self) -> u32 {
        self.next_lease
    }

    /// Who has stopped it, and why, while it is stopped.
    pub fn held_stop(&self) -> Option<&StopSnapshot> {
        self.stop.as_ref()
    }

    /// A tool's state, but for who has asked for it; a free one's where there is no such slot.
    pub fn tool_but_for_requests(&self, slot: usize) -> ToolSnapshot {
        self.slots
            .get(slot)
            .map_or_else(ToolSnapshot::default, ToolSlot::snapshot_but_for_requests)
    }

    /// The value that put a tool into fault, if one did.
    pub fn fault(&self, slot: usize) -> Option<Implausible> {
        self.slots.get(slot)?.holder.as_ref()?.fault
    }

    /// Ticks so far.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// The clay.
    pub fn clay(&self) -> &Clay {
        &self.clay
    }

    /// The clay, for draining changes and hashes.
    pub fn clay_mut(&mut self) -> &mut Clay {
        &mut self.clay
    }

    /// How many tools there are, held or free.
    pub fn tools(&self) -> usize {
        self.slots.len()
    }

    /// The tool side in `slot`, if somebody holds it.
    pub fn side(&self, slot: usize) -> Option<&ToolSide> {
        self.slots.get(slot)?.side()
    }

    /// The tool side in `slot`, to change how it leaves frames out.
    pub fn side_mut(&mut self, slot: usize) -> Option<&mut ToolSide> {
        self.slots.get_mut(slot)?.side_mut()
    }

    /// What the tool in `slot` did in the last tick.
    pub fn last_step(&self, slot: usize) -> ToolStep {
        self.slots
            .get(slot)
            .map_or_else(ToolStep::default, |slot| slot.last)
    }

    /// What came from all handles since the session began, those who have left included. No count ever falls.
    pub fn arrivals(&self) -> ArrivalCounts {
        let sides = self.slots.iter().filter_map(ToolSlot::side);
        sides.fold(self.departed, |all, side| all.and(side.arrivals()))
    }

    fn tick_tool(&mut self, number: usize, heard: &mut impl FnMut(usize, Timestamp, &HandleFrame)) {
        let now = self.now;
        let slot = &mut self.slots[number];
        let Some(holder) = &mut slot.holder else {
            return;
        };
        let side = &mut holder.side;
        while let Some((arrived, frame)) = slot.up.poll_with_arrival(now) {
            heard(number, arrived, &frame);
            side.handle_frame(arrived, &frame);
        }
        let rests = self.settings.is_paused || self.storage == Storage::Full;
        let permission = if rests {
            Permission::Pause
        } else {
            Permission::Work
        };
        let operation = self.settings.operation();
        let step = side.step(now, &mut self.clay, &self.material, operation, permission);
        slot.last = step;
        self.cuts.clear();
        self.cuts.extend_from_slice(side.cuts());
        let made = ToolCuts {
            slot: number,
            lease: holder.lease,
            decided: side.sweeps_decided(),
            operation,
            moved_units: step.moved_units,
            cuts: side.cuts(),
        };
        self.made.push(self.ticks, &made);
        let decided = made.decided;
        let (is_led, fault) = (side.is_led(), side.fault());
        let is_told = holder.fault.is_some();
        if let Some(frame) = side.frame_to_send() {
            slot.down.push(now, *frame);
        }
        if self.journal == Journal::Kept {
            slot.note_decided(self.ticks, decided);
        }
        if let Some(fault) = fault
            && !is_told
            && self.has_room_for(EVENTS_AT_ONCE)
        {
            self.tell_fault(number, fault);
        }
        self.relay_from(number, is_led);
    }

    /// The fault of one tool is that tool's: the others work on.
    fn tell_fault(&mut self, slot: usize, fault: Implausible) {
        if let Some(holder) = &mut self.slots[slot].holder {
            holder.fault = Some(fault);
        }
        self.revision += 1;
        self.announce_revision();
        self.emit(EventKind::Fault { slot, fault });
    }

    /// Tells every copy what the tool at `number` has cut, but for the one that led it there: that one has cut it
    /// first.
    fn relay_from(&mut self, number: usize, is_led: bool) {
        if self.cuts.is_empty() {
            return;
        }
        let others = (0..)
            .zip(&mut self.slots)
            .filter(|(other, _)| *other != number || !is_led);
        for side in others.filter_map(|(_, slot)| slot.side_mut()) {
            for cut in &self.cuts {
                side.handle_cut(*cut);
            }
        }
    }

    /// Tells whether the holder of a tool is heard, and ends a lease that is over.
    fn follow_holder(&mut self, number: usize) {
        if !self.has_room_for(EVENTS_AT_ONCE) {
            return;
        }
        let now = self.now;
        let slot = &mut self.slots[number];
        let Some(held) = slot.held(now) else { return };
        let (is_connected, has_run_out) = (held.is_connected, self.rules.has_run_out(&held));
        let Some(holder) = &mut slot.holder else {
            return;
        };
        let has_left = holder.side.has_left(now);
        if is_connected != std::mem::replace(&mut holder.was_connected, is_connected) {
            self.emit(if is_connected {
                EventKind::Connected { slot: number }
            } else {
                EventKind::Disconnected { slot: number }
            });
        }
        let because = match (has_left, has_run_out) {
            (true, _) => Release::Left,
            (false, true) => Release::RanOut,
            (false, false) => return,
        };
        if self.retired.len() < self.retired.capacity()
            && let Some(side) = self.release(number, because)
        {
            self.retired.push(side);
        }
    }

    /// What frames name from this revision on.
    pub(crate) fn generation(&self) -> Generation {
        Generation {
            since_revision: self.revision as u32,
            epoch: self.clay_epoch,
        }
    }

    fn announce_revision(&mut self) {
        let revision = self.revision as u32;
        for side in self.sides_mut() {
            side.set_revision(revision);
        }
    }

    fn sides_mut(&mut self) -> impl Iterator<Item = &mut ToolSide> {
        self.slots.iter_mut().filter_map(ToolSlot::side_mut)
    }

    fn slot_of(&self, lease: u32) -> Result<usize, Refusal> {
        let holds = |slot: &ToolSlot| slot.holder.as_ref().is_some_and(|held| held.lease == lease);
        self.slots
            .iter()
            .position(holds)
            .ok_or(Refusal::NoSuchLease { lease })
    }

    fn has_room_for(&self, events: usize) -> bool {
        self.events.len() + events <= EVENTS_WAITING
    }

    /// Callers have made sure of room.
    fn emit(&mut self, kind: EventKind) {
        self.events.push_back(Event {
            tick: self.ticks,
            revision: self.revision,
            kind,
        });
    }
}

const _: () = assert!(
    EVENTS_AT_ONCE * (MAX_TOOLS as usize + 1) < EVENTS_WAITING,
    "a tick and a command find room for their events"
);
