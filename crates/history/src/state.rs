//! The state of a session after a record, and its bytes: a snapshot.
//!
//! Version 2 says besides whether the session is stopped, and for whom a tool is kept. What version 1 has written is
//! read.

use teleclay_clay::Clay;
use teleclay_session::{HolderSnapshot, Recovery, Rules, Snapshot, StopSnapshot, ToolSnapshot};

use crate::bytes::{Malformed, Reader, put_number, put_text};
use crate::content;
use crate::record::{put_fault, put_holder, put_settings, read_fault, read_holder, read_settings};
use crate::strokes::Strokes;

const VERSION: u8 = 2;
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
        let mut out = vec![VERSION];
        let state = &self.session;
        for number in [
            state.tick,
            state.revision,
            state.clay_epoch.into(),
            state.ownership_epoch.into(),
            self.next_lease.into(),
        ] {
            put_number(&mut out, number);
        }
        put_settings(&mut out, &state.settings);
        put_number(&mut out, state.tools.len() as u64);
        for (slot, tool) in state.tools.iter().enumerate() {
            put_number(
                &mut out,
                self.decided.get(slot).copied().unwrap_or(0).into(),
            );
            put_tool(&mut out, slot, tool);
        }
        put_stop(&mut out, state.stop.as_ref());
        self.strokes.put(&mut out);
        content::encode(&mut self.clay, &mut out);
        out
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
