//! Whether a recording comes out again: the clay by its history, and by the loop.

use std::collections::BTreeMap;

use teleclay_history::{Fact, Malformed, Record, Replay, ReplayError, State};
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::HandleFrame;
use teleclay_reel::{ReadError, Recorded, Step, Ticked};
use teleclay_session::EventKind;

use crate::again::{Again, AgainError, How, Known, Work};

/// Why a recording cannot be gone through.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// The file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A record or a state in it.
    #[error("after tick {tick}: {error}")]
    Malformed {
        /// The last tick that was read.
        tick: u64,
        /// What is wrong.
        error: Malformed,
    },
    /// The loop.
    #[error("after tick {tick}: {error}")]
    Again {
        /// The last tick that was read.
        tick: u64,
        /// What is wrong.
        error: AgainError,
    },
    /// It has no state to begin with.
    #[error("the recording has no state to begin with: it ended within its first moments")]
    NoBeginning,
}

/// What came out otherwise than it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub enum Difference {
    /// A tool made other cuts.
    Cuts {
        /// The tick.
        tick: u64,
        /// The tool's slot, from 0.
        slot: usize,
        /// As recorded.
        told: Work,
        /// As it came out.
        got: Work,
    },
    /// The clay.
    Clay {
        /// The tick.
        tick: u64,
        /// Whether the loop made it, or the history alone.
        by: &'static str,
        /// As recorded.
        told: u64,
        /// As it came out.
        got: u64,
    },
    /// A record that does not follow.
    History {
        /// The tick.
        tick: u64,
        /// What is wrong.
        why: String,
    },
    /// A frame that is none.
    Frame {
        /// The tick.
        tick: u64,
        /// The tool's slot, from 0.
        slot: usize,
    },
    /// A tick that is missing, and that the recording does not count as dropped.
    Missing {
        /// The tick before it.
        after: u64,
        /// The tick that follows.
        tick: u64,
    },
}

/// Ticks that nobody can go through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// The first of them.
    pub from_tick: u64,
    /// The first tick after them.
    pub to_tick: u64,
    /// Of these, how many found no room on their way to the file.
    pub dropped: u64,
}

/// What became of a tool's holder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Held {
    /// The tool's slot, from 0.
    pub slot: usize,
    /// Who held it.
    pub operator: String,
    /// How it came to its cuts.
    pub how: How,
    /// Ticks in which it was held.
    pub ticks: u64,
    /// Cuts that it made.
    pub cuts: u64,
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    /// Ticks that were gone through.
    pub ticks: u64,
    /// Each span of a tool in one hand.
    pub held: Vec<Held>,
    /// Spans that could not be gone through.
    pub gaps: Vec<Gap>,
    /// The first difference, if there was one.
    pub difference: Option<Difference>,
    /// The last hash that was recorded, and that came out.
    pub hash: Option<u64>,
    /// How many hashes were compared.
    pub hashes: u64,
    /// Whether the file ended before its end was written.
    pub is_cut_off: bool,
}

impl Verdict {
    /// Whether all that could be gone through came out, and something could.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.difference.is_none() && 0 < self.hashes
    }
}

/// Goes through a recording, up to the first difference.
///
/// # Errors
/// It cannot be gone through.
pub fn verify(file: &[u8]) -> Result<Verdict, VerifyError> {
    let mut recorded = Recorded::new(file)?;
    let mut run = Run::default();
    for step in &mut recorded {
        match step? {
            Step::Ticked(tick) => run.on_tick(&tick)?,
            Step::State(bytes) => run.on_state(&bytes)?,
            Step::Hash(hash) => run.on_hash(hash),
        }
        if run.verdict.difference.is_some() {
            break;
        }
    }
    if run.tick.is_none() && run.again.is_none() {
        return Err(VerifyError::NoBeginning);
    }
    run.close_all();
    run.verdict.is_cut_off = recorded.is_cut_off();
    Ok(run.verdict)
}

#[derive(Default)]
struct Run {
    again: Option<Again>,
    history: Option<Replay>,
    /// Tick and dropped of the last tick that was read.
    tick: Option<(u64, u64)>,
    /// Since when nothing is known, and the dropped until then.
    lost_since: Option<(u64, u64)>,
    holding: BTreeMap<usize, Held>,
    verdict: Verdict,
}

impl Run {
    fn last_tick(&self) -> u64 {
        self.tick.map_or(0, |(tick, _)| tick)
    }

    fn on_state(&mut self, bytes: &[u8]) -> Result<(), VerifyError> {
        let tick = self.last_tick();
        let mut state =
            State::decode(bytes).map_err(|error| VerifyError::Malformed { tick, error })?;
        if self.again.is_some() {
            // A snapshot on the way.
            self.on_hash(state.clay.hash());
            return Ok(());
        }
        if let Some((from_tick, dropped)) = self.lost_since.take() {
            self.verdict.gaps.push(Gap {
                from_tick,
                to_tick: tick + 1,
                dropped: self.tick.map_or(0, |(_, all)| all) - dropped,
            });
        }
        for (slot, tool) in state.session.tools.iter().enumerate() {
            if let Some(holder) = &tool.holder {
                self.hold(slot, holder.operator.name.clone(), How::Followed);
            }
        }
        self.tick.get_or_insert((state.session.tick, 0));
        self.verdict.hash = Some(state.clay.hash());
        self.history = Some(Replay::from_state(state.clone(), Vec::new()).checking());
        self.again = Some(Again::from_state(state));
        Ok(())
    }

    fn on_hash(&mut self, told: u64) {
        let tick = self.last_tick();
        let (Some(again), Some(history)) = (&mut self.again, &mut self.history) else {
            return;
        };
        let outcomes = [
            ("the loop", again.clay().hash()),
            ("the history", history.clay().hash()),
        ];
        let other = outcomes.into_iter().find(|(_, got)| *got != told);
        self.verdict.difference = other.map(|(by, got)| Difference::Clay {
            tick,
            by,
            told,
            got,
        });
        self.verdict.hash = Some(told);
        self.verdict.hashes += 1;
    }

    fn on_tick(&mut self, tick: &Ticked) -> Result<(), VerifyError> {
        if let Some((last, dropped)) = self.tick
            && tick.tick != last + 1
        {
            if tick.dropped - dropped != tick.tick.wrapping_sub(last + 1) {
                self.verdict.difference = Some(Difference::Missing {
                    after: last,
                    tick: tick.tick,
                });
                return Ok(());
            }
            self.lose(last + 1, dropped);
        }
        let is_first = self.tick.is_none();
        self.tick = Some((tick.tick, tick.dropped));
        if is_first {
            self.lost_since = Some((tick.tick, tick.dropped));
        }
        if self.again.is_none() {
            return Ok(());
        }
        self.verdict.ticks += 1;
        for record in &tick.records {
            if let Some(history) = &mut self.history
                && let Err(error) = history.apply(record)
            {
                return self.on_broken_history(tick, &error);
            }
        }
        let mut records = Vec::new();
        for record in &tick.records {
            let record = Record::decode(record).map_err(|error| VerifyError::Malformed {
                tick: tick.tick,
                error,
            })?;
            records.push(record);
        }
        let (between, within): (Vec<_>, Vec<_>) =
            records.iter().partition(|record| record.tick < tick.tick);
        self.on_facts(tick, between.iter().flat_map(|record| &record.facts))?;
        self.work(tick, within.iter().flat_map(|record| &record.facts));
        self.on_facts(tick, within.iter().flat_map(|record| &record.facts))
    }

    /// An exchange of clay that was cut before the recording began is followed no further; anything else is a
    /// difference.
    fn on_broken_history(&mut self, tick: &Ticked, error: &ReplayError) -> Result<(), VerifyError> {
        let leads_elsewhere = matches!(
            error,
            ReplayError::EarlierBaseNeeded { .. }
                | ReplayError::BlockMissing { .. }
                | ReplayError::Unknown { what: "stroke", .. }
        );
        if leads_elsewhere {
            self.lose(tick.tick, tick.dropped);
        } else {
            self.verdict.difference = Some(Difference::History {
                tick: tick.tick,
                why: error.to_string(),
            });
        }
        Ok(())
    }

    fn on_facts<'a>(
        &mut self,
        tick: &Ticked,
        facts: impl Iterator<Item = &'a Fact>,
    ) -> Result<(), VerifyError> {
        for fact in facts {
            let Some(again) = &mut self.again else {
                return Ok(());
            };
            let known = again.on_fact(fact).map_err(|error| VerifyError::Again {
                tick: tick.tick,
                error,
            })?;
            if let Fact::Told { kind, .. } = fact {
                match kind {
                    EventKind::Taken { slot, operator, .. } => {
                        self.hold(*slot, operator.name.clone(), How::Driven);
                    }
                    EventKind::Released { slot, .. } => self.close(*slot),
                    _ => {}
                }
            }
            if known == Known::No {
                self.lose(tick.tick, tick.dropped);
            }
        }
        Ok(())
    }

    fn work<'a>(&mut self, tick: &Ticked, facts: impl Iterator<Item = &'a Fact>) {
        let Some(again) = &mut self.again else {
            return;
        };
        let mut told = vec![Work::default(); again.tools()];
        for fact in facts {
            if let Fact::Cuts {
                slot,
                decided,
                operation,
                moved_units,
                cuts,
                ..
            } = fact
                && let Some(work) = told.get_mut(*slot)
            {
                *work = Work {
                    decided: Some(*decided),
                    operation: *operation,
                    moved_units: *moved_units,
                    cuts: cuts.clone(),
                };
            }
        }
        for came in &tick.frames {
            let arrived = Timestamp::from_nanos(came.arrived_ns);
            let Ok(frame) = HandleFrame::decode(&came.bytes) else {
                self.verdict.difference = Some(Difference::Frame {
                    tick: tick.tick,
                    slot: came.slot,
                });
                return;
            };
            again.on_frame(came.slot, arrived, &frame);
        }
        let now = Timestamp::from_nanos(tick.now_ns);
        let works = again.tick(now, tick.can_keep_cuts, &told);
        for (slot, (told, got)) in told.into_iter().zip(works).enumerate() {
            if let Some(held) = self.holding.get_mut(&slot) {
                held.ticks += 1;
                held.cuts += got.cuts.len() as u64;
            }
            // Nothing is told of a tool that cut nothing and decided nothing.
            let is_other = told.cuts != got.cuts
                || told.operation != got.operation && !told.cuts.is_empty()
                || told.moved_units != got.moved_units
                || (told.decided.is_some() && told.decided != got.decided);
            if is_other && self.verdict.difference.is_none() {
                self.verdict.difference = Some(Difference::Cuts {
                    tick: tick.tick,
                    slot,
                    told,
                    got,
                });
            }
        }
    }

    /// Nothing is known from this tick on, until there is a state again.
    fn lose(&mut self, from_tick: u64, dropped: u64) {
        self.again = None;
        self.history = None;
        self.close_all();
        self.lost_since.get_or_insert((from_tick, dropped));
    }

    fn hold(&mut self, slot: usize, operator: String, how: How) {
        self.close(slot);
        let held = Held {
            slot,
            operator,
            how,
            ticks: 0,
            cuts: 0,
        };
        self.holding.insert(slot, held);
    }

    fn close(&mut self, slot: usize) {
        self.verdict.held.extend(self.holding.remove(&slot));
    }

    fn close_all(&mut self) {
        self.verdict
            .held
            .extend(std::mem::take(&mut self.holding).into_values());
    }
}
