//! What a tool did in a tick, as bytes.

use teleclay_clay::{Operation, Pose};
use teleclay_link::replica::Cut;
use teleclay_session::ToolCuts;

use super::{CUTS, Fact, WITH_OPERATIONS, WORKED, is_of_version};
use crate::bytes::{Malformed, Reader, put_number, put_signed};

const ADD: u8 = 1;
const SMOOTH: u8 = 2;

pub(crate) fn put_cuts(out: &mut Vec<u8>, made: &ToolCuts<'_>) {
    let ToolCuts {
        slot,
        lease,
        decided,
        operation,
        moved_units,
        cuts,
    } = *made;
    match operation {
        Operation::Cut => out.push(CUTS),
        Operation::Add => out.extend_from_slice(&[WORKED, ADD]),
        Operation::Smooth => out.extend_from_slice(&[WORKED, SMOOTH]),
    }
    if operation != Operation::Cut {
        is_of_version(out, WITH_OPERATIONS);
    }
    for number in [
        slot as u64,
        lease.into(),
        decided.into(),
        moved_units,
        cuts.len() as u64,
    ] {
        put_number(out, number);
    }
    let mut before: Option<[i32; 3]> = None;
    for cut in cuts {
        let (from, to) = (cut.from.steps(), cut.to.steps());
        if let Some(before) = before {
            out.push(u8::from(before != from));
        }
        if before != Some(from) {
            from.iter().for_each(|steps| put_signed(out, *steps));
        }
        for axis in 0..3 {
            put_signed(out, to[axis].wrapping_sub(from[axis]));
        }
        before = Some(to);
    }
}

/// Of a tool that did not cut.
pub(super) fn read_worked(reader: &mut Reader<'_>) -> Result<Fact, Malformed> {
    let operation = match reader.byte("an operation")? {
        ADD => Operation::Add,
        SMOOTH => Operation::Smooth,
        got => {
            let (what, got) = ("an operation", got.into());
            return Err(Malformed::Value { what, got });
        }
    };
    read_cuts(reader, operation)
}

pub(super) fn read_cuts(reader: &mut Reader<'_>, operation: Operation) -> Result<Fact, Malformed> {
    let slot = reader.small::<u8>("a slot")?.into();
    let lease = reader.small("a lease")?;
    let decided = reader.small("the last sweep decided")?;
    let moved_units = reader.number("what was moved")?;
    let count: usize = reader.small("the count of cuts")?;
    // A cut has three bytes at least.
    if reader.left() < 3 * count.min(reader.left() + 1) {
        return Err(Malformed::Short { what: "cuts" });
    }
    let mut cuts: Vec<Cut> = Vec::with_capacity(count);
    for _ in 0..count {
        let from = match cuts.last() {
            Some(before) if reader.byte("a cut")? == 0 => before.to.steps(),
            _ => read_steps(reader)?,
        };
        let steps = read_steps(reader)?;
        let to = std::array::from_fn(|axis| from[axis].wrapping_add(steps[axis]));
        cuts.push(Cut {
            from: Pose::from_steps(from),
            to: Pose::from_steps(to),
        });
    }
    Ok(Fact::Cuts {
        slot,
        lease,
        decided,
        operation,
        moved_units,
        cuts,
    })
}

fn read_steps(reader: &mut Reader<'_>) -> Result<[i32; 3], Malformed> {
    Ok([
        reader.signed("a pose")?,
        reader.signed("a pose")?,
        reader.signed("a pose")?,
    ])
}
