//! A session that goes on where an earlier server of it has ended.

use std::sync::Arc;

use teleclay_bilateral::{ParameterError, ToolSide};
use teleclay_clay::Clay;
use teleclay_link::time::Timestamp;

use crate::event::Snapshot;
use crate::rules::Rules;
use crate::session::{Session, SessionSetup};
use crate::slot::Holder;

/// What is known of a session that an earlier server has run.
pub struct Recovery {
    /// Its state, as its events have told it. `is_connected` counts for nothing.
    pub state: Snapshot,
    /// The clay.
    pub clay: Clay,
    /// Number of the next lease: above all that were given.
    pub next_lease: u32,
    /// For each tool, up to which number the sweeps of its holder were merged or refused.
    pub decided: Vec<u32>,
    /// Times of the rules about tools.
    pub rules: Rules,
}

impl Session {
    /// The session as it was: same revision, block and tick, each tool held by whoever held it, under one ownership
    /// epoch more. Every tool rests at home until its holder is heard; a holder who is not heard loses the tool by the
    /// same rules as any other. What the line to each did with frames begins anew.
    ///
    /// A session that was stopped is stopped, and nobody holds a tool of it. A tool that was kept for somebody is kept,
    /// and its time begins anew; who had asked for one is forgotten.
    ///
    /// # Errors
    /// The settings make no loop: they were never those of a session.
    pub fn recover(now: Timestamp, recovery: Recovery) -> Result<Self, ParameterError> {
        let Recovery {
            state,
            clay,
            next_lease,
            decided,
            rules,
        } = recovery;
        let settings = Arc::unwrap_or_clone(state.settings);
        let parameters = settings.parameters_at(state.revision);
        let mut session = Self::new(SessionSetup {
            lines: settings.lines(),
            settings,
            clay,
            rules,
            first_lease: next_lease,
            ownership_epoch: state.ownership_epoch.wrapping_add(1),
        });
        session.go_on_from(now, state.tick, state.revision, state.clay_epoch);
        if let Some(stop) = state.stop {
            session.put_stop(stop);
            return Ok(session);
        }
        for (slot, tool) in state.tools.into_iter().enumerate() {
            let Some(was) = tool.holder else {
                session.put_reservation(now, slot, tool.reserved_for);
                continue;
            };
            let mut side = Box::new(ToolSide::new(&parameters, was.lease)?);
            side.attach(was.lease, session.ownership_epoch(), session.generation());
            side.resume(decided.get(slot).copied().unwrap_or(0), was.fault);
            session.put_holder(
                slot,
                Holder {
                    lease: was.lease,
                    operator: was.operator,
                    since: now,
                    is_recovered: true,
                    side,
                    was_connected: false,
                    fault: was.fault,
                },
            );
        }
        Ok(session)
    }
}
