//! The tool side of a session once more: what a recording tells happens again, tick by tick, through the same loop.
//!
//! Who holds a tool and when is told by the session's events; no rule decides it anew. A tool that was taken within the
//! recording is *driven*: its frames go through its tool side, and it must cut what it cut. A tool that was held
//! already when the recording began, or before a gap in it, is *followed*: nobody knows what its controllers
//! remembered, so it cuts what the history says. What the line to each tool did is in the recording: its frames are
//! those that came out.

use std::sync::Arc;

use teleclay_bilateral::{LoopModel, ParameterError, Permission, ToolSide, tool_setup};
use teleclay_clay::{Clay, Material, Operation, Sweep};
use teleclay_history::{Fact, State};
use teleclay_link::replica::Cut;
use teleclay_link::scheme::{Generation, tool_controller};
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::HandleFrame;
use teleclay_session::{EventKind, Settings};

/// Why the loop cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum AgainError {
    /// Parameters that never were a loop's.
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    /// Settings that describe no block.
    #[error("the settings describe no block: {0}")]
    Block(String),
    /// A slot that is not there.
    #[error("there is no tool {}", .0 + 1)]
    NoTool(usize),
}

/// A tool's part in a tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Work {
    /// Sweeps up to this number were merged or refused.
    pub decided: Option<u32>,
    /// What was done to the clay.
    pub operation: Operation,
    /// What was removed, added, or moved by smoothing, in units of 1/255 voxel.
    pub moved_units: u64,
    /// The ways through the clay, in their order.
    pub cuts: Vec<Cut>,
}

/// How a tool comes to its cuts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum How {
    /// Nobody holds it.
    Free,
    /// Through the loop.
    Driven,
    /// By the history.
    Followed,
}

enum Slot {
    Free,
    Driven(Box<ToolSide>),
    Followed,
}

/// A session's tools and clay.
pub struct Again {
    clay: Clay,
    material: Material,
    settings: Arc<Settings>,
    revision: u64,
    clay_epoch: u32,
    ownership_epoch: u32,
    slots: Vec<Slot>,
}

/// Whether the clay is known after an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// It is.
    Yes,
    /// It is another one, which only a later state can tell.
    No,
}

impl Again {
    /// Goes on from a state; tools that were held then are followed.
    #[must_use]
    pub fn from_state(state: State) -> Self {
        let session = state.session;
        let slots = session.tools.iter().map(|tool| match tool.holder {
            Some(_) => Slot::Followed,
            None => Slot::Free,
        });
        Self {
            slots: slots.collect(),
            material: session.settings.material(),
            clay: state.clay,
            revision: session.revision,
            clay_epoch: session.clay_epoch,
            ownership_epoch: session.ownership_epoch,
            settings: session.settings,
        }
    }

    /// The clay after the last tick.
    pub fn clay(&mut self) -> &mut Clay {
        &mut self.clay
    }

    /// How the tool in a slot comes to its cuts.
    #[must_use]
    pub fn how(&self, slot: usize) -> How {
        match self.slots.get(slot) {
            None | Some(Slot::Free) => How::Free,
            Some(Slot::Driven(_)) => How::Driven,
            Some(Slot::Followed) => How::Followed,
        }
    }

    /// How many tools there are.
    #[must_use]
    pub fn tools(&self) -> usize {
        self.slots.len()
    }

    /// A frame came out of a line.
    pub fn on_frame(&mut self, slot: usize, arrived: Timestamp, frame: &HandleFrame) {
        if let Some(Slot::Driven(side)) = self.slots.get_mut(slot) {
            side.handle_frame(arrived, frame);
        }
    }

    /// One tick of every tool. `told` is what each slot did by the history; what each did now is given back.
    pub fn tick(&mut self, now: Timestamp, can_keep_cuts: bool, told: &[Work]) -> Vec<Work> {
        let permission = if self.settings.is_paused || !can_keep_cuts {
            Permission::Pause
        } else {
            Permission::Work
        };
        let shape = self.settings.tool_shape();
        let mut works = Vec::with_capacity(self.slots.len());
        for slot in 0..self.slots.len() {
            let mut is_led = false;
            let work = match &mut self.slots[slot] {
                Slot::Free => Work::default(),
                Slot::Driven(side) => {
                    let operation = self.settings.operation();
                    let step =
                        side.step(now, &mut self.clay, &self.material, operation, permission);
                    is_led = side.is_led();
                    Work {
                        decided: Some(side.sweeps_decided()),
                        operation,
                        moved_units: step.moved_units,
                        cuts: side.cuts().to_vec(),
                    }
                }
                Slot::Followed => {
                    let told = told.get(slot).cloned().unwrap_or_default();
                    let moved = told.cuts.iter().map(|cut| {
                        let sweep = Sweep {
                            shape,
                            from: cut.from,
                            to: cut.to,
                        };
                        self.clay.operate(told.operation, &sweep)
                    });
                    Work {
                        moved_units: moved.sum(),
                        ..told
                    }
                }
            };
            self.relay(slot, is_led, &work.cuts);
            works.push(work);
        }
        works
    }

    /// Something that the session told, between two ticks.
    ///
    /// # Errors
    /// It never was a session's.
    pub fn on_fact(&mut self, fact: &Fact) -> Result<Known, AgainError> {
        match fact {
            Fact::Told { revision, kind } => self.on_told(*revision, kind),
            Fact::Passed { revision } => {
                self.come_to(*revision);
                Ok(Known::Yes)
            }
            Fact::GoneOn { .. } | Fact::Begun { .. } | Fact::Cuts { .. } => Ok(Known::Yes),
        }
    }

    fn on_told(&mut self, revision: u64, kind: &EventKind) -> Result<Known, AgainError> {
        match kind {
            EventKind::Changed { settings } => {
                self.revision = revision;
                self.change(settings)?;
            }
            EventKind::FreshBlock {
                settings,
                clay_epoch,
                given,
            } => {
                self.revision = revision;
                self.clay_epoch = *clay_epoch;
                self.settings = Arc::clone(settings);
                if given.is_some() {
                    return Ok(Known::No);
                }
                self.renew()?;
            }
            EventKind::Exchanged { clay_epoch, .. } => {
                self.clay_epoch = *clay_epoch;
                return Ok(Known::No);
            }
            EventKind::Taken { slot, lease, .. } => {
                self.revision = revision;
                let mut side = ToolSide::new(&self.settings.parameters, 0)?;
                side.attach(*lease, self.ownership_epoch, self.generation());
                *self.slot(*slot)? = Slot::Driven(Box::new(side));
            }
            EventKind::Released { slot, .. } => *self.slot(*slot)? = Slot::Free,
            _ => {}
        }
        self.come_to(revision);
        Ok(Known::Yes)
    }

    fn change(&mut self, settings: &Arc<Settings>) -> Result<(), AgainError> {
        let before = std::mem::replace(&mut self.settings, Arc::clone(settings));
        self.material = settings.material();
        let generation = self.generation();
        let (parameters, was) = (&settings.parameters, &before.parameters);
        let model = LoopModel::new(parameters)?;
        for slot in &mut self.slots {
            let Slot::Driven(side) = slot else { continue };
            if parameters.deadband.to_bits() != was.deadband.to_bits() {
                // What was a session's deadband can be one; frames that leave are nobody's here.
                let _ = side.set_deadband(parameters.deadband);
            }
            if parameters.scheme != was.scheme {
                let mut controller = tool_controller(parameters.scheme, model.context());
                side.change_scheme(parameters.scheme, generation, &mut controller);
            }
        }
        Ok(())
    }

    fn renew(&mut self) -> Result<(), AgainError> {
        let fresh = self.settings.fresh_block();
        self.clay = fresh.map_err(|error| AgainError::Block(error.detail))?;
        let setup = tool_setup(&self.settings.parameters)?;
        self.material = setup.material;
        let generation = self.generation();
        for slot in &mut self.slots {
            if let Slot::Driven(side) = slot {
                side.move_to(Arc::clone(&setup));
                side.start_on_fresh_block(generation);
            }
        }
        Ok(())
    }

    fn come_to(&mut self, revision: u64) {
        self.revision = revision;
        for slot in &mut self.slots {
            if let Slot::Driven(side) = slot {
                side.set_revision(revision as u32);
            }
        }
    }

    /// Tells every copy what a tool has cut, as the session does.
    fn relay(&mut self, from: usize, is_led: bool, cuts: &[Cut]) {
        for (other, slot) in self.slots.iter_mut().enumerate() {
            if let Slot::Driven(side) = slot
                && (other != from || !is_led)
            {
                cuts.iter().for_each(|cut| side.handle_cut(*cut));
            }
        }
    }

    fn slot(&mut self, slot: usize) -> Result<&mut Slot, AgainError> {
        self.slots.get_mut(slot).ok_or(AgainError::NoTool(slot))
    }

    fn generation(&self) -> Generation {
        Generation {
            since_revision: self.revision as u32,
            epoch: self.clay_epoch,
        }
    }
}
