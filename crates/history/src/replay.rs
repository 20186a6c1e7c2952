//! The state after any record, and clay without a stroke.

use std::sync::Arc;

use teleclay_clay::{Clay, Operation, Sweep, ToolShape};
use teleclay_link::replica::Cut;
use teleclay_session::{Event, EventKind, Exchange, ExchangedClay, Settings, Snapshot};

use crate::bytes::Malformed;
use crate::record::{Fact, Record};
use crate::state::State;
use crate::strokes::{NONE, Strokes};

/// Why a record does not follow.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReplayError {
    /// It is none.
    #[error(transparent)]
    Malformed(#[from] Malformed),
    /// Records begin with a session's beginning.
    #[error("the first record does not begin a session")]
    NoBeginning,
    /// It tells of something that is not there.
    #[error("tick {tick} tells of {what} {number}, which is not there")]
    Unknown {
        /// Tick of the record.
        tick: u64,
        /// What it tells of.
        what: &'static str,
        /// Its number.
        number: u64,
    },
    /// The clay from which the replay began has cuts of this stroke: begin at an earlier snapshot.
    #[error("stroke {stroke} was cut before the snapshot: an earlier one is needed")]
    EarlierBaseNeeded {
        /// The stroke.
        stroke: u64,
    },
    /// A block was given that the settings do not describe, and nobody has kept it.
    #[error("the block {hash:016x} is not there")]
    BlockMissing {
        /// Its hash.
        hash: u64,
    },
    /// The settings describe no block.
    #[error("settings: {why}")]
    Settings {
        /// Why not.
        why: String,
    },
    /// A tool moves another volume than the session that was recorded says.
    #[error(
        "tool {} moves {got} units of clay in tick {tick}, and the record says {told}",
        slot + 1
    )]
    OtherRemoval {
        /// Tick of the record.
        tick: u64,
        /// The tool's slot, from 0.
        slot: usize,
        /// What the record says, in units of 1/255 voxel.
        told: u64,
        /// What the replay moves.
        got: u64,
    },
}

/// A cut that was made since the base.
#[derive(Clone, Copy, Debug)]
struct Made {
    tick: u64,
    stroke: u64,
    operation: Operation,
    cut: Cut,
}

/// A session's records, told again one after the other.
///
/// It holds every cut since its base, 40 bytes each: a snapshot, or a fresh block. Of strokes that were cut since, any
/// can be undone; for an earlier one it says that an [earlier base](ReplayError::EarlierBaseNeeded) is needed.
pub struct Replay {
    session: Snapshot,
    next_lease: u32,
    decided: Vec<u32>,
    strokes: Strokes,
    /// The clay as it was at the base.
    base: Clay,
    /// Strokes below this number are in the base, if they were not undone there.
    base_until: u64,
    made: Vec<Made>,
    clay: Clay,
    /// Whether the clay is to be made anew from base and cuts.
    is_stale: bool,
    /// Whether what the records say of removed clay is compared.
    checks: bool,
    shape: ToolShape,
    /// Blocks that settings do not describe.
    given: Vec<Clay>,
}

impl Replay {
    /// From the first record of a session. `given` are the blocks that its settings never described, as they were.
    ///
    /// # Errors
    /// It begins none.
    pub fn begin(record: &[u8], given: Vec<Clay>) -> Result<Self, ReplayError> {
        let record = Record::decode(record)?;
        let Some(Fact::Begun {
            settings,
            clay_epoch,
            given: hash,
            ownership_epoch,
            next_lease,
        }) = record.facts.into_iter().next()
        else {
            return Err(ReplayError::NoBeginning);
        };
        let clay = block(&settings, hash, &given)?;
        let tools = settings.tools();
        Ok(Self::from_state(
            State {
                session: Snapshot {
                    tick: record.tick,
                    revision: settings.revision,
                    clay_epoch,
                    ownership_epoch,
                    stop: None,
                    tools: vec![teleclay_session::ToolSnapshot::default(); tools],
                    settings,
                },
                next_lease,
                decided: vec![0; tools],
                strokes: Strokes::new(tools),
                clay,
            },
            given,
        ))
    }

    /// From a snapshot.
    #[must_use]
    pub fn from_state(state: State, given: Vec<Clay>) -> Self {
        Self {
            shape: state.session.settings.tool_shape(),
            session: state.session,
            next_lease: state.next_lease,
            decided: state.decided,
            base_until: state.strokes.next(),
            strokes: state.strokes,
            base: state.clay.clone(),
            made: Vec::new(),
            clay: state.clay,
            is_stale: false,
            checks: false,
            given,
        }
    }

    /// Tells of strokes and settings, and makes no clay before somebody asks for it: for many records the faster way.
    #[must_use]
    pub fn without_clay(mut self) -> Self {
        self.is_stale = true;
        self
    }

    /// Compares from now on what each record says a tool has removed with what the replay removes.
    #[must_use]
    pub fn checking(mut self) -> Self {
        self.checks = true;
        self
    }

    /// The next record.
    ///
    /// # Errors
    /// It does not follow. The replay is of no use then.
    pub fn apply(&mut self, record: &[u8]) -> Result<(), ReplayError> {
        let record = Record::decode(record)?;
        for fact in record.facts {
            self.apply_fact(record.tick, fact)?;
        }
        self.session.tick = record.tick;
        Ok(())
    }

    /// What the session's events have told so far.
    #[must_use]
    pub const fn session(&self) -> &Snapshot {
        &self.session
    }

    /// The strokes so far.
    #[must_use]
    pub const fn strokes(&self) -> &Strokes {
        &self.strokes
    }

    /// The clay after the last record.
    pub fn clay(&mut self) -> &mut Clay {
        if std::mem::take(&mut self.is_stale) {
            self.clay = self.clay_after(None);
        }
        &mut self.clay
    }

    /// The whole state after the last record.
    pub fn state(&mut self) -> State {
        let clay = self.clay().clone();
        State {
            session: self.session.clone(),
            next_lease: self.next_lease,
            decided: self.decided.clone(),
            strokes: self.strokes.clone(),
            clay,
        }
    }

    /// Likewise, and the replay is over.
    #[must_use]
    pub fn into_state(mut self) -> State {
        self.clay();
        State {
            session: self.session,
            next_lease: self.next_lease,
            decided: self.decided,
            strokes: self.strokes,
            clay: self.clay,
        }
    }

    /// The clay as it would be after an exchange, to be given to the session; the records so far stay as they are.
    ///
    /// # Errors
    /// There is no such stroke, or not so, or it was cut before the base.
    pub fn exchanged(&self, exchange: Exchange) -> Result<ExchangedClay, ReplayError> {
        self.check(exchange)?;
        Ok(ExchangedClay {
            clay: self.clay_after(Some(exchange)),
            clay_epoch: self.session.clay_epoch,
            exchange,
            as_of_tick: self.session.tick,
        })
    }

    /// Cuts in exchanged clay what the records since have brought, so that a session has little to make up for.
    ///
    /// # Errors
    /// There is another block by now.
    pub fn catch_up(&self, exchanged: &mut ExchangedClay) -> Result<(), ReplayError> {
        if exchanged.clay_epoch != self.session.clay_epoch {
            return Err(ReplayError::Unknown {
                tick: self.session.tick,
                what: "block",
                number: exchanged.clay_epoch.into(),
            });
        }
        let (after, exchange) = (exchanged.as_of_tick, Some(exchanged.exchange));
        let first = self.made.partition_point(|made| made.tick <= after);
        for made in &self.made[first..] {
            if self.strokes.counts(made.stroke, exchange) {
                let sweep = sweep(self.shape, made.cut);
                exchanged.clay.operate(made.operation, &sweep);
            }
        }
        exchanged.as_of_tick = self.session.tick;
        Ok(())
    }

    fn apply_fact(&mut self, tick: u64, fact: Fact) -> Result<(), ReplayError> {
        match fact {
            Fact::Begun { .. } => Err(ReplayError::NoBeginning),
            Fact::GoneOn { ownership_epoch } => {
                self.session.ownership_epoch = ownership_epoch;
                for tool in &mut self.session.tools {
                    if let Some(holder) = &mut tool.holder {
                        holder.is_connected = false;
                    }
                }
                Ok(())
            }
            Fact::Cuts {
                slot,
                decided,
                operation,
                moved_units,
                cuts,
                ..
            } => {
                self.check_slot(tick, slot)?;
                self.decided[slot] = decided;
                self.apply_cuts(tick, slot, (operation, moved_units), &cuts)
            }
            Fact::Passed { revision } => {
                self.session.revision = revision;
                Ok(())
            }
            Fact::Told { revision, kind } => self.apply_told(tick, revision, kind),
        }
    }

    fn apply_cuts(
        &mut self,
        tick: u64,
        slot: usize,
        (operation, moved_units): (Operation, u64),
        cuts: &[Cut],
    ) -> Result<(), ReplayError> {
        let holder = self.session.tools[slot].holder.as_ref();
        let operator = holder.map(|holder| &*holder.operator);
        // A tool that was taken clears the place where it stands before anybody moves it.
        let is_moved = holder.is_some_and(|holder| holder.is_connected);
        let stroke = if is_moved {
            self.strokes.on_cuts(tick, slot, operator, moved_units)
        } else {
            NONE
        };
        if self.checks {
            self.clay();
        }
        let mut got = 0;
        for cut in cuts {
            self.made.push(Made {
                tick,
                stroke,
                operation,
                cut: *cut,
            });
            if !self.is_stale {
                got += self.clay.operate(operation, &sweep(self.shape, *cut));
            }
        }
        if self.checks && got != moved_units {
            return Err(ReplayError::OtherRemoval {
                tick,
                slot,
                told: moved_units,
                got,
            });
        }
        Ok(())
    }

    fn apply_told(&mut self, tick: u64, revision: u64, kind: EventKind) -> Result<(), ReplayError> {
        match &kind {
            EventKind::FreshBlock {
                settings, given, ..
            } => {
                self.check_tools(tick, settings)?;
                self.base = block(settings, *given, &self.given)?;
                self.shape = settings.tool_shape();
                self.clay = self.base.clone();
                self.made.clear();
                self.strokes.on_fresh_block();
                self.base_until = self.strokes.next();
            }
            EventKind::Exchanged {
                exchange,
                as_of_tick,
                ..
            } => self.apply_exchange(*exchange, *as_of_tick)?,
            EventKind::Changed { settings } => self.check_tools(tick, settings)?,
            EventKind::Taken { slot, lease, .. } => {
                self.check_slot(tick, *slot)?;
                self.strokes.on_other_holder(*slot);
                self.decided[*slot] = 0;
                let next = lease.checked_add(1).unwrap_or(1);
                self.next_lease = self.next_lease.max(next);
            }
            EventKind::Released { slot, .. } => {
                self.check_slot(tick, *slot)?;
                self.strokes.on_other_holder(*slot);
                self.decided[*slot] = 0;
            }
            EventKind::Stopped { .. } => {
                for slot in 0..self.session.tools.len() {
                    self.strokes.on_other_holder(slot);
                    self.decided[slot] = 0;
                }
            }
            EventKind::StopCleared { .. } => {}
            EventKind::Connected { slot }
            | EventKind::Disconnected { slot }
            | EventKind::Requested { slot, .. }
            | EventKind::RequestEnded { slot, .. }
            | EventKind::ReservationEnded { slot, .. }
            | EventKind::Fault { slot, .. } => self.check_slot(tick, *slot)?,
        }
        self.session.apply(&Event {
            tick,
            revision,
            kind,
        });
        Ok(())
    }

    fn apply_exchange(&mut self, exchange: Exchange, as_of_tick: u64) -> Result<(), ReplayError> {
        self.check(exchange)?;
        for moved in self.strokes.on_exchange(exchange, as_of_tick) {
            for made in &mut self.made {
                if made.stroke == moved.stroke && moved.after_tick < made.tick {
                    made.stroke = moved.to;
                }
            }
        }
        // Made again when somebody asks: of many exchanges in a row only the last one counts.
        self.is_stale = true;
        Ok(())
    }

    /// Whether the exchange is of strokes that are there, and that the base does not have.
    fn check(&self, exchange: Exchange) -> Result<(), ReplayError> {
        let (Exchange::Undone { stroke }
        | Exchange::Redone { stroke }
        | Exchange::UndoneSince { stroke }) = exchange;
        if !self.strokes.admits(exchange) {
            return Err(ReplayError::Unknown {
                tick: self.session.tick,
                what: "stroke",
                number: stroke,
            });
        }
        let is_since = matches!(exchange, Exchange::UndoneSince { .. });
        let mut in_base = stroke..self.base_until;
        let is_in_base = if is_since {
            in_base.any(|number| self.strokes.counts(number, None))
        } else {
            stroke < self.base_until
        };
        if is_in_base {
            return Err(ReplayError::EarlierBaseNeeded { stroke });
        }
        Ok(())
    }

    fn clay_after(&self, exchange: Option<Exchange>) -> Clay {
        let mut clay = self.base.clone();
        for made in &self.made {
            if self.strokes.counts(made.stroke, exchange) {
                clay.operate(made.operation, &sweep(self.shape, made.cut));
            }
        }
        clay
    }

    fn check_slot(&self, tick: u64, slot: usize) -> Result<(), ReplayError> {
        if slot < self.session.tools.len() {
            return Ok(());
        }
        Err(ReplayError::Unknown {
            tick,
            what: "slot",
            number: slot as u64,
        })
    }

    fn check_tools(&self, tick: u64, settings: &Arc<Settings>) -> Result<(), ReplayError> {
        if settings.tools() == self.session.tools.len() {
            return Ok(());
        }
        Err(ReplayError::Unknown {
            tick,
            what: "count of tools",
            number: settings.tools() as u64,
        })
    }
}

fn sweep(shape: ToolShape, cut: Cut) -> Sweep {
    Sweep {
        shape,
        from: cut.from,
        to: cut.to,
    }
}

/// The block that settings describe, or the one that was given.
fn block(settings: &Settings, given: Option<u64>, kept: &[Clay]) -> Result<Clay, ReplayError> {
    let Some(hash) = given else {
        let fresh = settings.fresh_block();
        return fresh.map_err(|error| ReplayError::Settings { why: error.detail });
    };
    let mut kept = kept.iter().map(Clay::clone);
    kept.find_map(|mut clay| (clay.hash() == hash).then_some(clay))
        .ok_or(ReplayError::BlockMissing { hash })
}
