//! One session: a block of clay, its tools, and the conditioned line to each of them. Stepped once a tick.

use std::sync::Arc;

use teleclay_clay::{Clay, Material};
use teleclay_link::conditioner::{Conditioner, Impairment};
use teleclay_link::deadband::DeadbandError;
use teleclay_link::replica::{Cut, ToolSetup};
use teleclay_link::safety::NotFinite;
use teleclay_link::scheme::replica::Generation;
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{HandleFrame, ToolFrame};

use crate::tool_side::{CUTS_A_TICK, Permission, ToolSide, ToolStep};

/// Frames in flight on one line at most: two seconds of delay at 1 kHz, every one of them doubled.
const LINE_CAPACITY: usize = 4096;

/// What the network does, in each direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lines {
    /// From handle to tool.
    pub up: Impairment,
    /// Seed of that line.
    pub up_seed: u64,
    /// From tool to handle.
    pub down: Impairment,
    /// Seed of that line.
    pub down_seed: u64,
}

/// One tool slot of a session: the line up, the line down, and the tool side while somebody holds it.
struct ToolSlot {
    side: Option<Box<ToolSide>>,
    up: Conditioner<HandleFrame>,
    down: Conditioner<ToolFrame>,
    last: ToolStep,
}

/// What takes the place of a block that was cut.
pub struct FreshBlock {
    /// The block.
    pub clay: Clay,
    /// Where and with what the tools work on it.
    pub setup: Arc<ToolSetup>,
    /// Its number, and the revision of the parameters that came with it.
    pub generation: Generation,
    /// Gets what the tools had before; needs room for as many as there are slots.
    pub before: Vec<Arc<ToolSetup>>,
}

/// A session's loop. Owned by whoever steps it.
pub struct SessionLoop {
    clay: Clay,
    material: Material,
    slots: Vec<ToolSlot>,
    is_paused: bool,
    fault: Option<NotFinite>,
    ticks: u64,
    generation: Generation,
    /// Cuts of one tool on their way to the others.
    cuts: Vec<Cut>,
}

impl SessionLoop {
    /// A session with room for `slots` tools.
    pub fn new(clay: Clay, material: Material, slots: usize, lines: &Lines) -> Self {
        let slot = |number: u64| ToolSlot {
            side: None,
            up: Conditioner::new(lines.up, lines.up_seed.wrapping_add(number), LINE_CAPACITY),
            down: Conditioner::new(
                lines.down,
                lines.down_seed.wrapping_add(number),
                LINE_CAPACITY,
            ),
            last: ToolStep::default(),
        };
        Self {
            clay,
            material,
            slots: (0..slots as u64).map(slot).collect(),
            is_paused: false,
            fault: None,
            ticks: 0,
            generation: Generation {
                since_revision: 0,
                epoch: 1,
            },
            cuts: Vec::with_capacity(CUTS_A_TICK),
        }
    }

    /// A frame from the handle of `slot` entered the line.
    pub fn on_frame(&mut self, now: Timestamp, slot: usize, frame: HandleFrame) {
        if let Some(slot) = self.slots.get_mut(slot) {
            slot.up.push(now, frame);
        }
    }

    /// One tick of every tool. `send` gets each frame that leaves the line towards a handle.
    pub fn step(&mut self, now: Timestamp, mut send: impl FnMut(usize, &ToolFrame)) {
        self.ticks += 1;
        for number in 0..self.slots.len() {
            let slot = &mut self.slots[number];
            let Some(side) = slot.side.as_mut() else {
                continue;
            };
            while let Some((arrived, frame)) = slot.up.poll_with_arrival(now) {
                side.on_frame(arrived, &frame);
            }
            let permission = match (self.fault, self.is_paused) {
                (Some(_), _) => Permission::Fault,
                (None, true) => Permission::Pause,
                (None, false) => Permission::Work,
            };
            slot.last = side.step(now, &mut self.clay, &self.material, permission);
            self.fault = self.fault.or(side.fault());
            if let Some(frame) = side.frame_to_send() {
                slot.down.push(now, *frame);
            }
            while let Some(frame) = slot.down.poll(now) {
                send(number, &frame);
            }
            self.cuts.clear();
            self.cuts.extend_from_slice(side.cuts());
            let is_led = side.is_led();
            self.relay_from(number, is_led);
        }
    }

    /// Tells every copy what the tool at `number` has cut, but for the one that led it there: that one has cut it first.
    fn relay_from(&mut self, number: usize, is_led: bool) {
        if self.cuts.is_empty() {
            return;
        }
        let others = (0..)
            .zip(&mut self.slots)
            .filter(|(other, _)| *other != number || !is_led);
        for side in others.filter_map(|(_, slot)| slot.side.as_mut()) {
            for cut in &self.cuts {
                side.relay(*cut);
            }
        }
    }

    /// Gives `slot` to an operator. Returns who held it, to be dropped elsewhere.
    pub fn attach(&mut self, slot: usize, mut side: Box<ToolSide>) -> Option<Box<ToolSide>> {
        side.take_up(self.generation);
        let slot = self.slots.get_mut(slot)?;
        slot.up.clear();
        slot.down.clear();
        slot.side.replace(side)
    }

    /// Takes `slot` from its operator.
    pub fn detach(&mut self, slot: usize) -> Option<Box<ToolSide>> {
        let slot = self.slots.get_mut(slot)?;
        slot.up.clear();
        slot.down.clear();
        slot.last = ToolStep::default();
        slot.side.take()
    }

    /// Changes what the lines do, from the next frame on.
    pub fn impair(&mut self, lines: &Lines) {
        for (number, slot) in (0_u64..).zip(&mut self.slots) {
            slot.up.impair(lines.up);
            slot.up.reseed(lines.up_seed.wrapping_add(number));
            slot.down.impair(lines.down);
            slot.down.reseed(lines.down_seed.wrapping_add(number));
        }
    }

    /// A fresh block: tools go to where their handles are, without cutting. Clears a fault. Leaves the old clay in `fresh`, to be dropped
    /// elsewhere.
    pub fn swap_clay(&mut self, fresh: &mut FreshBlock) {
        self.fault = None;
        let generation = fresh.generation;
        self.generation = generation;
        self.material = fresh.setup.material;
        for side in self.sides_mut() {
            let before = side.move_to(Arc::clone(&fresh.setup));
            side.start_on_fresh_block(generation);
            fresh.before.push(before);
        }
        std::mem::swap(&mut self.clay, &mut fresh.clay);
    }

    /// Changes the scheme of every tool, from `revision` of the parameters on.
    pub fn change_scheme(&mut self, scheme: Scheme, revision: u16) {
        self.generation.since_revision = revision;
        let generation = self.generation;
        for side in self.sides_mut() {
            side.change_scheme(scheme, generation);
        }
    }

    /// Changes what the clay is made of, from `revision` of the parameters on.
    pub fn set_material(&mut self, material: Material, revision: u16) {
        self.material = material;
        self.generation.since_revision = revision;
        for side in self.sides_mut() {
            side.set_revision(revision);
        }
    }

    /// Leaves out frames whose change is below this share of what is felt, from `revision` of the parameters on; 0 sends every one.
    ///
    /// # Errors
    /// There is no such share; then no tool has it.
    pub fn set_deadband(&mut self, fraction: f64, revision: u16) -> Result<(), DeadbandError> {
        for side in self.sides_mut() {
            side.set_deadband(fraction)?;
        }
        self.generation.since_revision = revision;
        for side in self.sides_mut() {
            side.set_revision(revision);
        }
        Ok(())
    }

    fn sides_mut(&mut self) -> impl Iterator<Item = &mut ToolSide> {
        self.slots
            .iter_mut()
            .filter_map(|slot| slot.side.as_deref_mut())
    }

    /// Revision of the parameters, and which block of clay this is.
    pub fn generation(&self) -> Generation {
        self.generation
    }

    /// Holds every tool.
    pub fn pause(&mut self) {
        self.is_paused = true;
    }

    /// Lets the tools work again.
    pub fn resume(&mut self) {
        self.is_paused = false;
    }

    /// Whether the session is paused.
    pub fn is_paused(&self) -> bool {
        self.is_paused
    }

    /// The value that put the session into fault, if one did.
    pub fn fault(&self) -> Option<NotFinite> {
        self.fault
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

    /// The material.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Number of slots, taken or not.
    pub fn slots(&self) -> usize {
        self.slots.len()
    }

    /// The tool side at `slot`, if somebody holds it.
    pub fn side(&self, slot: usize) -> Option<&ToolSide> {
        self.slots.get(slot)?.side.as_deref()
    }

    /// The tool side at `slot`, to change its scheme.
    pub fn side_mut(&mut self, slot: usize) -> Option<&mut ToolSide> {
        self.slots.get_mut(slot)?.side.as_deref_mut()
    }

    /// What the tool at `slot` did in the last tick.
    pub fn last_step(&self, slot: usize) -> ToolStep {
        self.slots
            .get(slot)
            .map_or_else(ToolStep::default, |slot| slot.last)
    }
}
