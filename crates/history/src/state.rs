//! The state of a session after a record, and its bytes: a snapshot.

use std::sync::Arc;

use teleclay_clay::Clay;
use teleclay_session::{HolderSnapshot, Recovery, Rules, Snapshot, ToolSnapshot};

use crate::bytes::{Malformed, Reader, put_number};
use crate::content;
use crate::record::{put_fault, put_holder, put_settings, read_fault, read_holder, read_settings};
use crate::strokes::Strokes;

const VERSION: u8 = 1;

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
        reader.version(VERSION)?;
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
        let strokes = Strokes::read(&mut reader)?;
        let rest = reader.slice(reader.left(), "clay")?;
        Ok(Self {
            session: Snapshot {
                tick,
                revision,
                settings,
                clay_epoch,
                ownership_epoch,
                tools,
            },
            next_lease,
            decided,
            strokes,
            clay: content::decode(rest)?,
        })
    }
}

fn put_tool(out: &mut Vec<u8>, slot: usize, tool: &ToolSnapshot) {
    let Some(holder) = &tool.holder else {
        out.push(0);
        return;
    };
    let is_faulty = holder.fault.is_some();
    out.push(1 | u8::from(holder.is_connected) << 1 | u8::from(is_faulty) << 2);
    put_holder(out, slot, holder.lease, &holder.operator);
    if let Some(fault) = holder.fault {
        put_fault(out, fault);
    }
}

fn read_tool(reader: &mut Reader<'_>) -> Result<ToolSnapshot, Malformed> {
    let flags = reader.byte("a tool")?;
    if flags == 0 {
        return Ok(ToolSnapshot::default());
    }
    let (_, lease, operator) = read_holder(reader)?;
    let fault = (flags & 4 != 0).then(|| read_fault(reader)).transpose()?;
    Ok(ToolSnapshot {
        holder: Some(HolderSnapshot {
            lease,
            operator: Arc::clone(&operator),
            is_connected: flags & 2 != 0,
            fault,
        }),
    })
}
