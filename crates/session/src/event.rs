//! What a session tells of itself. Every change is told exactly once, after it was made; [`Snapshot::apply`] makes the
//! state of it again.

use std::sync::Arc;

use teleclay_link::safety::Implausible;

use crate::command::Operator;
use crate::settings::Settings;

/// Something that has changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// The session's tick in which it changed.
    pub tick: u64,
    /// The revision that the change made, or that held while it happened.
    pub revision: u64,
    /// The change.
    pub kind: EventKind,
}

/// What has changed.
#[derive(Clone, Debug, PartialEq)]
pub enum EventKind {
    /// The settings are others.
    Changed {
        /// All of them, as they are now.
        settings: Arc<Settings>,
    },
    /// A fresh block stands in place of the one that was cut. Faults are over with it.
    FreshBlock {
        /// The settings that came with it.
        settings: Arc<Settings>,
        /// Counts the blocks.
        clay_epoch: u32,
        /// Hash of a block that was given as it is; `None` where it is the one that the settings describe.
        given: Option<u64>,
    },
    /// The clay is another one, in the same place, with the same tools in it: strokes were undone or redone.
    Exchanged {
        /// Counts the blocks, those that were exchanged included.
        clay_epoch: u32,
        /// What is different.
        exchange: Exchange,
        /// What was cut after this tick is in the clay whatever was undone.
        as_of_tick: u64,
    },
    /// An operator holds a tool.
    Taken {
        /// The tool's slot, from 0.
        slot: usize,
        /// The lease.
        lease: u32,
        /// Who holds it.
        operator: Arc<Operator>,
    },
    /// An operator holds a tool no longer.
    Released {
        /// The tool's slot, from 0.
        slot: usize,
        /// The lease that is over.
        lease: u32,
        /// Who held it.
        operator: Arc<Operator>,
        /// Why no longer.
        because: Release,
    },
    /// Frames come from the holder of a tool.
    Connected {
        /// The tool's slot, from 0.
        slot: usize,
    },
    /// Frames from the holder of a tool come no longer.
    Disconnected {
        /// The tool's slot, from 0.
        slot: usize,
    },
    /// The session is stopped. Every tool that was held is released next, and what was asked for or reserved is
    /// forgotten.
    Stopped {
        /// Who has stopped it.
        by: Arc<str>,
        /// Why, for people.
        reason: Arc<str>,
    },
    /// The session is stopped no longer.
    StopCleared {
        /// Who has cleared the stop.
        by: Arc<str>,
    },
    /// Somebody asks the holder of a tool for it.
    Requested {
        /// The tool's slot, from 0.
        slot: usize,
        /// Who asks.
        operator: Arc<str>,
    },
    /// Somebody asks for a tool no longer, and it was not given.
    RequestEnded {
        /// The tool's slot, from 0.
        slot: usize,
        /// Who had asked.
        operator: Arc<str>,
        /// Why no longer.
        because: RequestEnd,
    },
    /// A tool is kept for nobody any more: the one for whom it was has not come.
    ReservationEnded {
        /// The tool's slot, from 0.
        slot: usize,
        /// For whom it was kept.
        operator: Arc<str>,
    },
    /// A value put a tool into fault: it rests until somebody joins with it anew, or there is a fresh block.
    Fault {
        /// The tool's slot, from 0.
        slot: usize,
        /// The value.
        fault: Implausible,
    },
}

/// What is different in clay that was exchanged. Strokes are numbered by who keeps the history.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exchange {
    /// It is as if a stroke had not been.
    Undone {
        /// The stroke's number.
        stroke: u64,
    },
    /// It is as if no stroke had been from this number on.
    UndoneSince {
        /// The first stroke's number.
        stroke: u64,
    },
    /// A stroke that was undone is there again.
    Redone {
        /// The stroke's number.
        stroke: u64,
    },
}

/// Why a request for a tool has ended, where the tool is still held by the same operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RequestEnd {
    /// The holder, or somebody who may, has denied it.
    Denied {
        /// Why, for people.
        reason: Arc<str>,
    },
    /// Who asked wants it no longer.
    Withdrawn,
    /// Nobody has answered for as long as a request lasts.
    RanOut,
}

/// Why a lease has ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Release {
    /// The holder said goodbye.
    Left,
    /// No frame came for as long as a lease lasts.
    RanOut,
    /// Another operator asked for a tool, and this holder had fallen silent.
    TakenOver,
    /// The session was stopped.
    Stopped,
    /// The tool was handed over to an operator who had asked for it, and is kept for that one.
    HandedOver {
        /// To whom.
        to: Arc<str>,
    },
    /// Somebody who may has taken the tool away.
    TakenAway,
}

impl Release {
    /// What became of the holder, for a sentence that begins with the operator's name.
    pub const fn words(&self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::RanOut => "was silent for too long",
            Self::TakenOver => "was silent, and another operator asked for the tool",
            Self::Stopped => "was stopped",
            Self::HandedOver { .. } => "handed the tool over",
            Self::TakenAway => "had the tool taken away",
        }
    }
}

/// A session's state, but for the clay itself and the motion of tools.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Ticks so far, or the tick of the last event that was applied.
    pub tick: u64,
    /// Counts the changes.
    pub revision: u64,
    /// What the session was told to be.
    pub settings: Arc<Settings>,
    /// Counts the fresh blocks, from 1.
    pub clay_epoch: u32,
    /// Counts the servers that have run the session, from 1.
    pub ownership_epoch: u32,
    /// Who has stopped it, and why, while it is stopped.
    pub stop: Option<StopSnapshot>,
    /// Every tool, held or free.
    pub tools: Vec<ToolSnapshot>,
}

/// A stop that holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StopSnapshot {
    /// Who has stopped the session.
    pub by: Arc<str>,
    /// Why, for people.
    pub reason: Arc<str>,
}

/// A tool's state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolSnapshot {
    /// Who holds it, if anybody does.
    pub holder: Option<HolderSnapshot>,
    /// Who has asked the holder for it, the first one first.
    pub requests: Vec<Arc<str>>,
    /// For whom it is kept, if it is for anybody; nobody holds it then.
    pub reserved_for: Option<Arc<str>>,
}

/// Who holds a tool.
#[derive(Clone, Debug, PartialEq)]
pub struct HolderSnapshot {
    /// The lease.
    pub lease: u32,
    /// The operator.
    pub operator: Arc<Operator>,
    /// Whether frames come.
    pub is_connected: bool,
    /// The value that put the tool into fault, if one did.
    pub fault: Option<Implausible>,
}

impl Snapshot {
    /// Takes in an event. Events that come in their order give the state as it was when the last of them was told.
    pub fn apply(&mut self, event: &Event) {
        self.tick = event.tick;
        self.revision = event.revision;
        match &event.kind {
            EventKind::Changed { settings } => self.settings = Arc::clone(settings),
            EventKind::FreshBlock {
                settings,
                clay_epoch,
                ..
            } => {
                self.settings = Arc::clone(settings);
                self.clay_epoch = *clay_epoch;
                let holders = self
                    .tools
                    .iter_mut()
                    .filter_map(|tool| tool.holder.as_mut());
                holders.for_each(|holder| holder.fault = None);
            }
            EventKind::Exchanged { clay_epoch, .. } => self.clay_epoch = *clay_epoch,
            EventKind::Taken {
                slot,
                lease,
                operator,
            } => {
                self.tools[*slot] = ToolSnapshot {
                    holder: Some(HolderSnapshot {
                        lease: *lease,
                        operator: Arc::clone(operator),
                        is_connected: false,
                        fault: None,
                    }),
                    ..ToolSnapshot::default()
                };
            }
            EventKind::Released { slot, because, .. } => {
                self.tools[*slot] = ToolSnapshot {
                    reserved_for: match because {
                        Release::HandedOver { to } => Some(Arc::clone(to)),
                        _ => None,
                    },
                    ..ToolSnapshot::default()
                };
            }
            EventKind::Stopped { by, reason } => {
                self.stop = Some(StopSnapshot {
                    by: Arc::clone(by),
                    reason: Arc::clone(reason),
                });
                self.tools.fill(ToolSnapshot::default());
            }
            EventKind::StopCleared { .. } => self.stop = None,
            EventKind::Requested { slot, operator } => {
                self.tools[*slot].requests.push(Arc::clone(operator));
            }
            EventKind::RequestEnded { slot, operator, .. } => {
                self.tools[*slot].requests.retain(|asked| asked != operator);
            }
            EventKind::ReservationEnded { slot, .. } => self.tools[*slot].reserved_for = None,
            EventKind::Connected { slot } => self.set_connected(*slot, true),
            EventKind::Disconnected { slot } => self.set_connected(*slot, false),
            EventKind::Fault { slot, fault } => {
                if let Some(holder) = &mut self.tools[*slot].holder {
                    holder.fault = Some(*fault);
                }
            }
        }
    }

    /// The slot of the tool that is held under `lease`.
    pub fn slot_of(&self, lease: u32) -> Option<usize> {
        self.tools.iter().position(|tool| {
            tool.holder
                .as_ref()
                .is_some_and(|holder| holder.lease == lease)
        })
    }

    fn set_connected(&mut self, slot: usize, is_connected: bool) {
        if let Some(holder) = &mut self.tools[slot].holder {
            holder.is_connected = is_connected;
        }
    }
}
