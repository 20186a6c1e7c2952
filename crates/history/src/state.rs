//! The state of a session after a record, and its bytes: a snapshot.
//!
//! Version 2 says besides whether the session is stopped, and for whom a tool is kept. Version 3 is the same, written
//! where settings name a tool that version 2 does not know, so that a program of that version says what is the matter.
//! What version 1 and 2 have written is read.

use teleclay_clay::Clay;
use teleclay_session::{
    HolderSnapshot, Recovery, Rules, Session, Settings, Snapshot, StopSnapshot, ToolSnapshot,
};

use crate::bytes::{Malformed, Reader, put_number, put_text};
use crate::content;
use crate::record::{put_fault, put_holder, read_fault, read_holder};
use crate::settings::{put_settings, read_settings, version_of};
use crate::strokes::Strokes;

const VERSION: u8 = 4;
/// From this version on a snapshot says whether the session is stopped.
const WITH_STOP: u8 = 2;

const HELD: u8 = 1;
const CONNECTED: u8 = 2;
const FAULTY: u8 = 4;
const RESERVED: u8 = 8;

/// The state of a session but for the motion of its tools.
#[derive(Clone, Debug)]
pub struct State {
    /// What its events have told.
    pub session: Snapshot,
    /// Number of the next lease.
    pub next_lease: u32,
    /// By slot, up to which number sweeps of the holder were merged or refused.
    pub decided: Vec<u32>,
    /// The strokes so far.
    pub strokes: Strokes,
    /// The clay.
    pub clay: Clay,
}

impl State {
    /// What [`Session::recover`](teleclay_session::Session::recover) goes on from.
    #[must_use]
    pub fn into_recovery(self, rules: Rules) -> Recovery {
        Recovery {
            state: self.session,
            clay: self.clay,
            next_lease: self.next_lease,
            decided: self.decided,
            rules,
        }
    }

    /// The bytes of a snapshot.
    pub fn encode(&mut self) -> Vec<u8> {
        let mut out = Vec::new();
        let state = &self.session;
        let numbers = Numbers {
            tick: state.tick,
            revision: state.revision,
            small: [
                state.clay_epoch,
                state.ownership_epoch,
                self.next_lease,
                state.tools.len() as u32,
            ],
        };
        put_numbers(&mut out, &numbers, &state.settings);
        for (slot, tool) in state.tools.iter().enumerate() {
            let decided = self.decided.get(slot).copied().unwrap_or(0);
            put_number(&mut out, decided.into());
            put_tool(&mut out, slot, tool);
        }
        put_stop(&mut out, state.stop.as_ref());
        self.strokes.put(&mut out);
        content::encode(&mut self.clay, &mut out);
        out
    }

    /// Writes what comes before the clay in the [snapshot](State::encode) of a session as it is between two ticks.
    /// Clay, as [`content`] writes it, completes that. Nothing is allocated where `out` has room. The session is not
    /// asked for its strokes, since it knows none: `strokes` are those that the snapshot shall tell of.
    pub fn encode_without_clay(session: &Session, strokes: &Strokes, out: &mut Vec<u8>) {
        let numbers = Numbers {
            tick: session.ticks(),
            revision: session.revision(),
            small: [
                session.clay_epoch(),
                session.ownership_epoch(),
                session.next_lease(),
                session.tools() as u32,
            ],
        };
        put_numbers(out, &numbers, session.settings());
        for slot in 0..session.tools() {
            let decided = session.side(slot).map_or(0, |side| side.sweeps_decided());
            put_number(out, decided.into());
            put_tool(out, slot, &session.tool_but_for_requests(slot));
        }
        put_stop(out, session.held_stop());
        strokes.put(out);
    }

    /// Reads a snapshot.
    ///
    /// # Errors
    /// The bytes are none, or a later program wrote them. Whatever they are, nothing panics.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes);
        let version = reader.version(VERSION)?;
        let tick = reader.number("the tick")?;
        let revision = reader.number("the revision")?;
        let clay_epoch = reader.small("the clay's epoch")?;
        let ownership_epoch = reader.small("the ownership epoch")?;
        let next_lease = reader.small("the next lease")?;
        let settings = read_settings(&mut reader)?;
        let (mut tools, mut decided) = (Vec::new(), Vec::new());
        for _ in 0..reader.small::<u8>("tools")? {
            decided.push(reader.small("the last sweep decided")?);
            tools.push(read_tool(&mut reader)?);
        }
        if tools.len() != settings.tools() {
            return Err(Malformed::Value {
                what: "the count of tools",
                got: tools.len() as u64,
            });
        }
        let stop = if version < WITH_STOP {
            None
        } else {
            read_stop(&mut reader)?
        };
        let strokes = Strokes::read(&mut reader)?;
        let rest = reader.slice(reader.left(), "clay")?;
        Ok(Self {
            session: Snapshot {
                tick,
                revision,
                settings,
                clay_epoch,
                ownership_epoch,
                stop,
                tools,
            },
            next_lease,
            decided,
            strokes,
            clay: content::decode(rest)?,
        })
    }
}

/// The counts at the head of a snapshot.
struct Numbers {
    tick: u64,
    revision: u64,
    /// The clay's epoch, the ownership epoch, the next lease, and behind the settings the count of tools.
    small: [u32; 4],
}

fn put_numbers(out: &mut Vec<u8>, numbers: &Numbers, settings: &Settings) {
    // Its versions are those of settings, but for the first.
    out.push(WITH_STOP + version_of(settings) - 1);
    let [clay_epoch, ownership_epoch, next_lease, tools] = numbers.small.map(u64::from);
    for number in [
        numbers.tick,
        numbers.revision,
        clay_epoch,
        ownership_epoch,
        next_lease,
    ] {
        put_number(out, number);
    }
    put_settings(out, settings);
    put_number(out, tools);
}

fn put_stop(out: &mut Vec<u8>, stop: Option<&StopSnapshot>) {
    out.push(u8::from(stop.is_some()));
    if let Some(StopSnapshot { by, reason }) = stop {
        put_text(out, by.as_bytes());
        put_text(out, reason.as_bytes());
    }
}

fn read_stop(reader: &mut Reader<'_>) -> Result<Option<StopSnapshot>, Malformed> {
    let what = "whether it is stopped";
    match reader.byte(what)? {
        0 => Ok(None),
        1 => Ok(Some(StopSnapshot {
            by: reader.shared("who stopped")?,
            reason: reader.shared("why")?,
        })),
        got => Err(Malformed::Value {
            what,
            got: got.into(),
        }),
    }
}

fn put_tool(out: &mut Vec<u8>, slot: usize, tool: &ToolSnapshot) {
    let holder = tool.holder.as_ref();
    let flags = [
        (HELD, holder.is_some()),
        (CONNECTED, holder.is_some_and(|holder| holder.is_connected)),
        (FAULTY, holder.is_some_and(|holder| holder.fault.is_some())),
        (RESERVED, tool.reserved_for.is_some()),
    ];
    let flags = flags.iter().filter(|(_, is_set)| *is_set);
    out.push(flags.fold(0, |all, (flag, _)| all | flag));
    if let Some(holder) = holder {
        put_holder(out, slot, holder.lease, &holder.operator);
        if let Some(fault) = holder.fault {
            put_fault(out, fault);
        }
    }
    if let Some(operator) = &tool.reserved_for {
        put_text(out, operator.as_bytes());
    }
}

fn read_tool(reader: &mut Reader<'_>) -> Result<ToolSnapshot, Malformed> {
    let flags = reader.byte("a tool")?;
    let is_free = flags & HELD == 0;
    if (HELD | CONNECTED | FAULTY | RESERVED) < flags || (is_free && flags & !RESERVED != 0) {
        return Err(Malformed::Value {
            what: "a tool",
            got: flags.into(),
        });
    }
    let holder = if is_free {
        None
    } else {
        let (_, lease, operator) = read_holder(reader)?;
        let is_faulty = flags & FAULTY != 0;
        Some(HolderSnapshot {
            lease,
            operator,
            is_connected: flags & CONNECTED != 0,
            fault: is_faulty.then(|| read_fault(reader)).transpose()?,
        })
    };
    let is_reserved = flags & RESERVED != 0;
    let reserved_for = is_reserved.then(|| reader.shared("for whom a tool is kept"));
    Ok(ToolSnapshot {
        holder,
        requests: Vec::new(),
        reserved_for: reserved_for.transpose()?,
    })
}
