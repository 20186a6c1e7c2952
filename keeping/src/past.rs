//! The state after what is on disk.

use teleclay_history::{Malformed, Replay, ReplayError, State};
use teleclay_journal::reader::Fault;
use teleclay_journal::{Reader, Storage};

/// Why there is no state.
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
    /// A record does not follow.
    #[error("record {sequence}: {why}")]
    Record {
        /// Its number.
        sequence: u64,
        /// Why not.
        why: ReplayError,
    },
    /// Nothing was ever kept.
    #[error("there is no record")]
    Nothing,
    /// The settings make no loop.
    #[error("the settings make no loop: {0}")]
    NoLoop(String),
}

/// The state after record `sequence`, from the newest snapshot before it.
///
/// # Errors
/// The journal is damaged or tells what cannot be; the record that is at fault is named.
pub fn state_of<S: Storage>(reader: &Reader<S>, sequence: u64) -> Result<State, PastError> {
    let mut base = sequence;
    loop {
        match replay(reader, base, sequence) {
            Ok(replay) => return Ok(replay.into_state()),
            // An exchange since the snapshot took away what was cut before it.
            Err((
                PastError::Record {
                    why: ReplayError::EarlierBaseNeeded { .. },
                    ..
                },
                Some(snapshot),
            )) => base = snapshot - 1,
            Err((error, _)) => return Err(error),
        }
    }
}

/// A replay up to record `sequence`, from the newest snapshot up to `base`; with an error, the number of that snapshot.
pub fn replay<S: Storage>(
    reader: &Reader<S>,
    base: u64,
    sequence: u64,
) -> Result<Replay, (PastError, Option<u64>)> {
    let snapshot = reader
        .snapshot_before(base)
        .map_err(|error| (error.into(), None))?;
    let from = snapshot.as_ref().map(|snapshot| snapshot.sequence);
    let failed = |error: PastError| (error, from);
    let mut replay = None;
    if let Some(snapshot) = snapshot {
        let state = State::decode(&snapshot.payload).map_err(|why| {
            failed(PastError::Snapshot {
                sequence: snapshot.sequence,
                why,
            })
        })?;
        replay = Some(Replay::from_state(state, Vec::new()));
    }
    for record in reader.records_from(from.map_or(1, |from| from + 1)) {
        let record = record.map_err(|error| failed(error.into()))?;
        if sequence < record.sequence {
            break;
        }
        let told = match &mut replay {
            Some(replay) => replay.apply(&record.payload),
            None => Replay::begin(&record.payload, Vec::new()).map(|begun| replay = Some(begun)),
        };
        told.map_err(|why| {
            failed(PastError::Record {
                sequence: record.sequence,
                why,
            })
        })?;
    }
    replay.ok_or_else(|| failed(PastError::Nothing))
}
