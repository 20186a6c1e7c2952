//! A record: what happened to a session in a tick, as bytes.
//!
//! ```text
//! version  tick    fact  fact  ...           up to the end of the bytes
//! u8       number
//! ```
//!
//! A fact is a byte for its kind and its fields. A *number* has seven bits a byte, the lowest first; one with a sign is
//! folded, 0, -1, 1, -2, ...; a *text* is its length and itself. Positions are in steps of the lattice of poses. A cut
//! that begins where the one before it in the same fact ended says so in a byte; the first never does, so every record
//! can be read by itself.
//!
//! Who asks for a tool is not kept: after a restart nobody waits for the answer any more. That something has changed
//! is, by its revision, since revisions never fall. A stop is kept, and so is for whom a tool is reserved: otherwise a
//! server that comes back would give the tool to the one who has just handed it over.

mod cuts;

use std::sync::Arc;

use teleclay_clay::Operation;
use teleclay_link::replica::Cut;
use teleclay_link::safety::{Flaw, Implausible};
use teleclay_session::{Event, EventKind, Exchange, Operator, Release, Settings, ToolCuts};

pub(crate) use cuts::put_cuts;
use cuts::{read_cuts, read_worked};

use crate::bytes::{Malformed, Reader, put_number, put_text};
use crate::settings::{put_settings, read_settings, version_of};

/// The newest version that is read. A record is written as the oldest that knows all that is in it: 2 where settings
/// name a tool that version 1 does not know, 3 where something is added or smoothed. A program that does not know that
/// version says then that a later one wrote the record.
pub const VERSION: u8 = WITH_OPERATIONS;
const OLDEST: u8 = 1;
const WITH_OPERATIONS: u8 = 3;

/// Names of quantities that can put a tool into fault, by the byte that stands for each. New ones come at the end.
const FIELDS: [&str; 11] = [
    "a value",
    "position_m",
    "velocity_m_s",
    "hand_force_n",
    "felt_force_n",
    "wave",
    "wave_integral",
    "energy_in_j",
    "corrections",
    "corrections.held_n",
    "tool position_m",
];

const BEGUN: u8 = 1;
const GONE_ON: u8 = 2;
const CUTS: u8 = 3;
const CHANGED: u8 = 4;
const FRESH_BLOCK: u8 = 5;
const EXCHANGED: u8 = 6;
const TAKEN: u8 = 7;
const RELEASED: u8 = 8;
const CONNECTED: u8 = 9;
const DISCONNECTED: u8 = 10;
const FAULT: u8 = 11;
const STOPPED: u8 = 12;
const STOP_CLEARED: u8 = 13;
const RESERVATION_ENDED: u8 = 14;
const PASSED: u8 = 15;
const WORKED: u8 = 16;

/// What happened in a tick, in its order.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The session's tick.
    pub tick: u64,
    /// What happened up to its end and was not told before.
    pub facts: Vec<Fact>,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Fact {
    /// A session began, every tool free.
    Begun {
        /// Its settings.
        settings: Arc<Settings>,
        /// Counts the blocks.
        clay_epoch: u32,
        /// Hash of a block that the settings do not describe.
        given: Option<u64>,
        /// Counts the servers that have run it.
        ownership_epoch: u32,
        /// Number of the next lease.
        next_lease: u32,
    },
    /// Another server goes on with it.
    GoneOn {
        /// Counts the servers that have run it.
        ownership_epoch: u32,
    },
    /// A tool has cut.
    Cuts {
        /// The tool's slot, from 0.
        slot: usize,
        /// The lease under which it was held.
        lease: u32,
        /// Sweeps of its handle up to this number were merged or refused.
        decided: u32,
        /// What it did to the clay.
        operation: Operation,
        /// What it removed, added, or moved by smoothing, in units of 1/255 voxel.
        moved_units: u64,
        /// Its ways through the clay, in the order in which they were made.
        cuts: Vec<Cut>,
    },
    /// Something changed that is of no use after the process.
    Passed {
        /// The revision that it made.
        revision: u64,
    },
    /// Something that the session told.
    Told {
        /// The revision that it made, or that held.
        revision: u64,
        /// What it was.
        kind: EventKind,
    },
}

/// Begins a record.
pub(crate) fn put_head(out: &mut Vec<u8>, tick: u64) {
    out.push(OLDEST);
    put_number(out, tick);
}

pub(crate) fn put_begun(
    out: &mut Vec<u8>,
    settings: &Settings,
    clay_epoch: u32,
    given: Option<u64>,
    [ownership_epoch, next_lease]: [u32; 2],
) {
    out.push(BEGUN);
    for number in [clay_epoch, ownership_epoch, next_lease] {
        put_number(out, number.into());
    }
    put_given(out, given);
    put_settings_of_record(out, settings);
}

pub(crate) fn put_gone_on(out: &mut Vec<u8>, ownership_epoch: u32) {
    out.push(GONE_ON);
    put_number(out, ownership_epoch.into());
}

/// What a session told.
pub(crate) fn put_event(out: &mut Vec<u8>, event: &Event) {
    put_told(out, event.revision, &event.kind);
}

fn put_told(out: &mut Vec<u8>, revision: u64, kind: &EventKind) {
    let code = match kind {
        EventKind::Changed { .. } => CHANGED,
        EventKind::FreshBlock { .. } => FRESH_BLOCK,
        EventKind::Exchanged { .. } => EXCHANGED,
        EventKind::Taken { .. } => TAKEN,
        EventKind::Released { .. } => RELEASED,
        EventKind::Connected { .. } => CONNECTED,
        EventKind::Disconnected { .. } => DISCONNECTED,
        EventKind::Fault { .. } => FAULT,
        EventKind::Stopped { .. } => STOPPED,
        EventKind::StopCleared { .. } => STOP_CLEARED,
        EventKind::ReservationEnded { .. } => RESERVATION_ENDED,
        EventKind::Requested { .. } | EventKind::RequestEnded { .. } => PASSED,
    };
    out.push(code);
    put_number(out, revision);
    match kind {
        EventKind::Changed { settings } => put_settings_of_record(out, settings),
        EventKind::FreshBlock {
            settings,
            clay_epoch,
            given,
        } => {
            put_number(out, (*clay_epoch).into());
            put_given(out, *given);
            put_settings_of_record(out, settings);
        }
        EventKind::Exchanged {
            clay_epoch,
            exchange,
            as_of_tick,
        } => {
            put_number(out, (*clay_epoch).into());
            put_number(out, *as_of_tick);
            let (code, stroke) = match exchange {
                Exchange::Undone { stroke } => (0, stroke),
                Exchange::UndoneSince { stroke } => (1, stroke),
                Exchange::Redone { stroke } => (2, stroke),
            };
            out.push(code);
            put_number(out, *stroke);
        }
        EventKind::Taken {
            slot,
            lease,
            operator,
        } => put_holder(out, *slot, *lease, operator),
        EventKind::Released {
            slot,
            lease,
            operator,
            because,
        } => {
            put_holder(out, *slot, *lease, operator);
            out.push(match because {
                Release::Left => 0,
                Release::RanOut => 1,
                Release::TakenOver => 2,
                Release::Stopped => 3,
                Release::HandedOver { .. } => 4,
                Release::TakenAway => 5,
            });
            if let Release::HandedOver { to } = because {
                put_text(out, to.as_bytes());
            }
        }
        EventKind::Connected { slot } | EventKind::Disconnected { slot } => {
            put_number(out, *slot as u64);
        }
        EventKind::Fault { slot, fault } => {
            put_number(out, *slot as u64);
            put_fault(out, *fault);
        }
        EventKind::Stopped { by, reason } => {
            put_text(out, by.as_bytes());
            put_text(out, reason.as_bytes());
        }
        EventKind::StopCleared { by } => put_text(out, by.as_bytes()),
        EventKind::ReservationEnded { slot, operator } => {
            put_number(out, *slot as u64);
            put_text(out, operator.as_bytes());
        }
        EventKind::Requested { .. } | EventKind::RequestEnded { .. } => {}
    }
}

pub(crate) fn put_fault(out: &mut Vec<u8>, fault: Implausible) {
    let known = FIELDS.iter().position(|field| *field == fault.field);
    out.push(known.unwrap_or(0) as u8);
    out.push(match fault.flaw {
        Flaw::NotFinite => 0,
        Flaw::TooLarge => 1,
    });
}

pub(crate) fn put_holder(out: &mut Vec<u8>, slot: usize, lease: u32, operator: &Operator) {
    put_number(out, slot as u64);
    put_number(out, lease.into());
    put_text(out, operator.name.as_bytes());
    put_text(out, operator.device.as_bytes());
}

fn put_given(out: &mut Vec<u8>, given: Option<u64>) {
    out.push(u8::from(given.is_some()));
    if let Some(hash) = given {
        out.extend_from_slice(&hash.to_le_bytes());
    }
}

/// Settings in a record, which begins where `out` does.
/// The record that begins here has something that versions before this one do not know.
fn is_of_version(record: &mut [u8], version: u8) {
    record[0] = record[0].max(version);
}

fn put_settings_of_record(out: &mut Vec<u8>, settings: &Settings) {
    is_of_version(out, version_of(settings));
    put_settings(out, settings);
}

impl Record {
    /// The bytes of the record.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::new();
        put_head(&mut out, self.tick);
        for fact in &self.facts {
            fact.put(&mut out);
        }
        out
    }

    /// The tick of a record, without reading its facts.
    ///
    /// # Errors
    /// The bytes are none, or a later program wrote them.
    pub fn tick_of(bytes: &[u8]) -> Result<u64, Malformed> {
        let mut reader = Reader::new(bytes);
        reader.version(VERSION)?;
        reader.number("the tick")
    }

    /// Reads a record.
    ///
    /// # Errors
    /// The bytes are none, or a later program wrote them. Whatever they are, nothing panics.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes);
        reader.version(VERSION)?;
        let tick = reader.number("the tick")?;
        let mut facts = Vec::new();
        while !reader.is_empty() {
            facts.push(Fact::read(&mut reader)?);
        }
        Ok(Self { tick, facts })
    }
}

impl Fact {
    fn put(&self, out: &mut Vec<u8>) {
        match self {
            Self::Begun {
                settings,
                clay_epoch,
                given,
                ownership_epoch,
                next_lease,
            } => put_begun(
                out,
                settings,
                *clay_epoch,
                *given,
                [*ownership_epoch, *next_lease],
            ),
            Self::GoneOn { ownership_epoch } => put_gone_on(out, *ownership_epoch),
            Self::Cuts {
                slot,
                lease,
                decided,
                operation,
                moved_units,
                cuts,
            } => put_cuts(
                out,
                &ToolCuts {
                    slot: *slot,
                    lease: *lease,
                    decided: *decided,
                    operation: *operation,
                    moved_units: *moved_units,
                    cuts,
                },
            ),
            Self::Passed { revision } => {
                out.push(PASSED);
                put_number(out, *revision);
            }
            Self::Told { revision, kind } => put_told(out, *revision, kind),
        }
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, Malformed> {
        let code = reader.byte("a fact")?;
        match code {
            BEGUN => {
                let clay_epoch = reader.small("the clay's epoch")?;
                let ownership_epoch = reader.small("the ownership epoch")?;
                let next_lease = reader.small("the next lease")?;
                Ok(Self::Begun {
                    clay_epoch,
                    ownership_epoch,
                    next_lease,
                    given: read_given(reader)?,
                    settings: read_settings(reader)?,
                })
            }
            GONE_ON => Ok(Self::GoneOn {
                ownership_epoch: reader.small("the ownership epoch")?,
            }),
            CUTS => read_cuts(reader, Operation::Cut),
            WORKED => read_worked(reader),
            PASSED => Ok(Self::Passed {
                revision: reader.number("the revision")?,
            }),
            _ => Ok(Self::Told {
                revision: reader.number("the revision")?,
                kind: read_kind(code, reader)?,
            }),
        }
    }
}

fn read_kind(code: u8, reader: &mut Reader<'_>) -> Result<EventKind, Malformed> {
    match code {
        CHANGED => Ok(EventKind::Changed {
            settings: read_settings(reader)?,
        }),
        FRESH_BLOCK => Ok(EventKind::FreshBlock {
            clay_epoch: reader.small("the clay's epoch")?,
            given: read_given(reader)?,
            settings: read_settings(reader)?,
        }),
        EXCHANGED => {
            let clay_epoch = reader.small("the clay's epoch")?;
            let as_of_tick = reader.number("a tick")?;
            let which = reader.byte("an exchange")?;
            let stroke = reader.number("a stroke")?;
            Ok(EventKind::Exchanged {
                clay_epoch,
                as_of_tick,
                exchange: match which {
                    0 => Exchange::Undone { stroke },
                    1 => Exchange::UndoneSince { stroke },
                    2 => Exchange::Redone { stroke },
                    got => return Err(value("an exchange", got)),
                },
            })
        }
        TAKEN => {
            let (slot, lease, operator) = read_holder(reader)?;
            Ok(EventKind::Taken {
                slot,
                lease,
                operator,
            })
        }
        RELEASED => {
            let (slot, lease, operator) = read_holder(reader)?;
            Ok(EventKind::Released {
                slot,
                lease,
                operator,
                because: match reader.byte("a reason")? {
                    0 => Release::Left,
                    1 => Release::RanOut,
                    2 => Release::TakenOver,
                    3 => Release::Stopped,
                    4 => Release::HandedOver {
                        to: reader.shared("an operator")?,
                    },
                    5 => Release::TakenAway,
                    got => return Err(value("a reason", got)),
                },
            })
        }
        CONNECTED => Ok(EventKind::Connected {
            slot: read_slot(reader)?,
        }),
        DISCONNECTED => Ok(EventKind::Disconnected {
            slot: read_slot(reader)?,
        }),
        FAULT => Ok(EventKind::Fault {
            slot: read_slot(reader)?,
            fault: read_fault(reader)?,
        }),
        STOPPED => Ok(EventKind::Stopped {
            by: reader.shared("who stopped")?,
            reason: reader.shared("why")?,
        }),
        STOP_CLEARED => Ok(EventKind::StopCleared {
            by: reader.shared("who cleared a stop")?,
        }),
        RESERVATION_ENDED => Ok(EventKind::ReservationEnded {
            slot: read_slot(reader)?,
            operator: reader.shared("an operator")?,
        }),
        got => Err(value("the kind of a fact", got)),
    }
}

fn value(what: &'static str, got: u8) -> Malformed {
    Malformed::Value {
        what,
        got: got.into(),
    }
}

fn read_slot(reader: &mut Reader<'_>) -> Result<usize, Malformed> {
    Ok(reader.small::<u8>("a slot")?.into())
}

pub(crate) fn read_fault(reader: &mut Reader<'_>) -> Result<Implausible, Malformed> {
    let field = reader.byte("a field")?;
    Ok(Implausible {
        field: FIELDS
            .get(usize::from(field))
            .ok_or(value("a field", field))?,
        flaw: match reader.byte("a flaw")? {
            0 => Flaw::NotFinite,
            1 => Flaw::TooLarge,
            got => return Err(value("a flaw", got)),
        },
    })
}

pub(crate) fn read_holder(
    reader: &mut Reader<'_>,
) -> Result<(usize, u32, Arc<Operator>), Malformed> {
    let slot = read_slot(reader)?;
    let lease = reader.small("a lease")?;
    let operator = Operator {
        name: reader.string("an operator")?,
        device: reader.string("a device")?,
    };
    Ok((slot, lease, Arc::new(operator)))
}

fn read_given(reader: &mut Reader<'_>) -> Result<Option<u64>, Malformed> {
    match reader.byte("whether a block was given")? {
        0 => Ok(None),
        1 => {
            let bytes = reader.slice(8, "a hash")?;
            Ok(Some(u64::from_le_bytes(std::array::from_fn(|at| {
                bytes[at]
            }))))
        }
        got => Err(value("whether a block was given", got)),
    }
}
