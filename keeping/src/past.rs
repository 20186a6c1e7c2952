//! What was, read from what is on disk.

use teleclay_clay::Clay;
use teleclay_history::{Malformed, Record, Replay, ReplayError, State};
use teleclay_journal::reader::Fault;
use teleclay_journal::{Reader, Storage};

/// Why there is no such state.
#[derive(Debug, thiserror::Error)]
pub enum PastError {
    /// The journal cannot be read there, or is damaged.
    #[error(transparent)]
    Journal(#[from] Fault),
    /// A snapshot is none.
    #[error("snapshot {sequence}: {why}")]
    Snapshot {
        /// Its number.
        sequence: u64,
        /// Why not.
        why: Malformed,
    },
    /// A snapshot holds another state than the records before it make.
    #[error("snapshot {sequence} is another state than the records before it make")]
    OtherSnapshot {
        /// Its number.
        sequence: u64,
    },
    /// A record does not follow.
    #[error("record {sequence}: {why}")]
    Record {
        /// Its number.
        sequence: u64,
        /// Why not.
        why: ReplayError,
    },
    /// It lies before the oldest snapshot that is kept.
    #[error("that lies before everything that is kept of the session's history")]
    NotKept,
    /// Nothing was ever kept.
    #[error("there is no record")]
    Nothing,
    /// The settings make no loop.
    #[error("the settings make no loop: {0}")]
    NoLoop(String),
}

/// Up to which record history is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Until {
    /// The record of this number.
    Record(u64),
    /// The last record of this tick or of one before it.
    Tick(u64),
    /// The last one.
    Now,
}

/// What a replay is wanted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum For {
    /// The whole state.
    State,
    /// Strokes and settings: clay is made only once it is asked for.
    Strokes,
}

/// The past of one session.
#[derive(Debug)]
pub struct Past<'a, S> {
    /// What is on disk.
    pub reader: &'a Reader<S>,
    /// The blocks that its settings never described.
    pub given: &'a [Clay],
}

/// A replay, and what it was made of.
pub struct Told {
    /// The replay.
    pub replay: Replay,
    /// Number of the last record that it has.
    pub last: u64,
    /// Number of the snapshot that it began with; 0 for the first record.
    pub base: u64,
}

impl<S: Storage> Past<'_, S> {
    /// The state at a moment, from the newest snapshot that serves.
    ///
    /// # Errors
    /// The journal is damaged or tells what cannot be, and the record that is at fault is named; or the moment lies
    /// before everything that is kept.
    pub fn state(&self, until: Until) -> Result<State, PastError> {
        Ok(self.tell(For::State, until)?.replay.into_state())
    }

    /// A replay up to a moment, from the newest snapshot that serves.
    ///
    /// # Errors
    /// As [`Past::state`].
    pub fn tell(&self, what: For, until: Until) -> Result<Told, PastError> {
        let mut base = match until {
            Until::Record(sequence) => sequence,
            Until::Tick(_) | Until::Now => u64::MAX,
        };
        loop {
            match self.tell_from(base, what, until) {
                // An exchange since the snapshot took away what was cut before it.
                Err(Failed {
                    error:
                        PastError::Record {
                            why: ReplayError::EarlierBaseNeeded { .. },
                            ..
                        }
                        | PastError::NotKept,
                    base: from,
                }) => base = self.before(from)?,
                other => return other.map_err(|failed| failed.error),
            }
        }
    }

    /// The tick of the earliest state that can be had.
    ///
    /// # Errors
    /// As [`Past::state`].
    pub fn first_tick(&self) -> Result<u64, PastError> {
        let oldest = self.reader.snapshots().first().copied().unwrap_or(0);
        Ok(self.begin(oldest)?.replay.session().tick)
    }

    /// A replay up to the last record that begins earlier than another one, for strokes that were cut before its base.
    ///
    /// # Errors
    /// As [`Past::state`].
    pub fn tell_before(&self, told: &Told) -> Result<Told, PastError> {
        let base = self.before(told.base)?;
        let told = self.tell_from(base, For::Strokes, Until::Now);
        told.map_err(|failed| failed.error)
    }

    /// Tells a replay of the records that it has not.
    ///
    /// # Errors
    /// As [`Past::state`].
    pub fn go_on(&self, told: &mut Told) -> Result<(), PastError> {
        for record in self.reader.records_from(told.last + 1) {
            let record = record?;
            let applied = told.replay.apply(&record.payload);
            applied.map_err(|why| PastError::Record {
                sequence: record.sequence,
                why,
            })?;
            told.last = record.sequence;
        }
        Ok(())
    }

    /// Replays everything that is kept from its beginning, and compares what every record says of removed clay, and
    /// every snapshot, with it. Gives the state at the end.
    ///
    /// # Errors
    /// As [`Past::state`]; and where something differs, which.
    pub fn verify(&self) -> Result<State, PastError> {
        let snapshots = self.reader.snapshots();
        let base = snapshots.first().copied().unwrap_or(0);
        let mut told = self.begin(base)?;
        told.replay = told.replay.checking();
        for record in self.reader.records_from(told.last + 1) {
            let record = record?;
            let sequence = record.sequence;
            let applied = told.replay.apply(&record.payload);
            applied.map_err(|why| PastError::Record { sequence, why })?;
            if snapshots.contains(&sequence) {
                let snapshot = self.reader.snapshot_before(sequence)?;
                let is_same =
                    snapshot.is_some_and(|kept| kept.payload == told.replay.state().encode());
                if !is_same {
                    return Err(PastError::OtherSnapshot { sequence });
                }
            }
        }
        Ok(told.replay.into_state())
    }

    /// The number up to which a snapshot before number `base` may stand.
    fn before(&self, base: u64) -> Result<u64, PastError> {
        let oldest = self.reader.snapshots().first();
        let has_older = oldest.is_some_and(|oldest| *oldest < base);
        has_older.then(|| base - 1).ok_or(PastError::NotKept)
    }

    /// With the newest snapshot up to number `base`.
    fn tell_from(&self, base: u64, what: For, until: Until) -> Result<Told, Failed> {
        let snapshots = self.reader.snapshots();
        let at = snapshots.partition_point(|number| *number <= base);
        let base = at.checked_sub(1).map_or(0, |index| snapshots[index]);
        let failed = |error: PastError| Failed { error, base };
        let mut told = self.begin(base).map_err(failed)?;
        if matches!(until, Until::Tick(tick) if tick < told.replay.session().tick) {
            return Err(failed(PastError::NotKept));
        }
        if what == For::Strokes {
            told.replay = told.replay.without_clay();
        }
        for record in self.reader.records_from(told.last + 1) {
            let record = record.map_err(|error| failed(error.into()))?;
            let sequence = record.sequence;
            let not_read = |why| failed(PastError::Record { sequence, why });
            let is_later = match until {
                Until::Record(last) => last < sequence,
                Until::Tick(tick) => {
                    let tick_of = Record::tick_of(&record.payload);
                    tick < tick_of.map_err(|why| not_read(why.into()))?
                }
                Until::Now => false,
            };
            if is_later {
                break;
            }
            told.replay.apply(&record.payload).map_err(not_read)?;
            told.last = sequence;
        }
        Ok(told)
    }

    /// From a snapshot, or from the first record.
    fn begin(&self, base: u64) -> Result<Told, PastError> {
        let given = self.given.to_vec();
        if base == 0 {
            // Records count from the oldest snapshot on.
            if !self.reader.snapshots().is_empty() {
                return Err(PastError::NotKept);
            }
            let first = self.reader.records_from(1).next();
            let first = first.ok_or(PastError::Nothing)??;
            let sequence = first.sequence;
            let begun = Replay::begin(&first.payload, given);
            return Ok(Told {
                replay: begun.map_err(|why| PastError::Record { sequence, why })?,
                last: sequence,
                base,
            });
        }
        let snapshot = self.reader.snapshot_before(base)?;
        let snapshot = snapshot.ok_or(PastError::NotKept)?;
        let sequence = snapshot.sequence;
        let state = State::decode(&snapshot.payload)
            .map_err(|why| PastError::Snapshot { sequence, why })?;
        Ok(Told {
            replay: Replay::from_state(state, given),
            last: sequence,
            base: sequence,
        })
    }
}

/// Why a base does not serve.
struct Failed {
    error: PastError,
    /// The base: number of its snapshot, or 0.
    base: u64,
}
