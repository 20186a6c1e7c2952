//! One session's history as everybody but its tick sees it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use teleclay_clay::Clay;
use teleclay_history::{Fact, Record};
use teleclay_journal::{
    Disk, OpenError, Policy, Reader, Running, Snapshot, State, Watch, compact, write_snapshot,
};
use teleclay_session::EventKind;

use crate::blocks;
use crate::error::{HomeError, at, bytes_in};
use crate::keeper::{Keeper, Told};
use crate::past::{Past, PastError, Until};

/// Records after which the next snapshot is due: so many seconds of one tool that cuts, and less than a tenth of a
/// second of work at the next start.
const RECORDS_A_SNAPSHOT: u64 = 60_000;

/// How much of a session's files is checked before they are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// What follows the newest snapshot.
    SinceSnapshot,
    /// Every record and every snapshot.
    All,
}

/// What has become of a session's history.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Storage {
    /// All of it is on disk.
    Durable,
    /// The last moments are on their way.
    Behind,
    /// The disk does not take it: nothing is cut until it does.
    Failed {
        /// Why not.
        reason: String,
    },
}

/// A session's history.
pub struct Archive {
    folder: PathBuf,
    policy: Policy,
    watch: Watch,
    told: Arc<Told>,
    bytes: AtomicU64,
    /// Number of the newest snapshot; 0 while there is none.
    snapshot: AtomicU64,
    /// Held while files are read, and while some are removed.
    looking: Mutex<()>,
    running: Mutex<Option<Running>>,
}

impl std::fmt::Debug for Archive {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Archive")
            .field("folder", &self.folder)
            .finish_non_exhaustive()
    }
}

impl Archive {
    pub(crate) fn new(
        folder: &Path,
        policy: Policy,
        running: Running,
        keeper: &Keeper,
        snapshot: u64,
    ) -> Self {
        let watch = running.watch();
        let archive = Self {
            folder: folder.to_owned(),
            policy,
            told: keeper.told(),
            bytes: AtomicU64::new(0),
            snapshot: AtomicU64::new(snapshot),
            looking: Mutex::new(()),
            watch,
            running: Mutex::new(Some(running)),
        };
        archive.measure();
        archive
    }

    /// What has become of it by now.
    #[must_use]
    pub fn storage(&self) -> Storage {
        if self.told.has_gap() {
            return Storage::Failed {
                reason: "more happened at once than could be kept; the server has to start again"
                    .to_owned(),
            };
        }
        match self.watch.state() {
            State::Durable => Storage::Durable,
            State::Behind => Storage::Behind,
            State::Failed(failure) => Storage::Failed {
                reason: failure.to_string(),
            },
        }
    }

    /// Up to which revision the session's changes are on disk.
    #[must_use]
    pub fn durable_revision(&self) -> u64 {
        self.told.durable_revision()
    }

    /// What it takes on disk, bytes, as of the last [look](Self::look_after).
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Makes a snapshot where one is due, removes what history no longer needs, and measures what is left. Takes a
    /// while, beside the tick.
    ///
    /// # Errors
    /// The disk fails. The session goes on without the snapshot.
    pub fn look_after(&self) -> Result<(), HomeError> {
        let durable = self.watch.durable();
        let last = self.snapshot.load(Ordering::Relaxed);
        if last == 0 && 0 < durable {
            // The beginning: history goes back to there for as long as there is room.
            self.make_snapshot(1)?;
        } else if RECORDS_A_SNAPSHOT <= durable.saturating_sub(last) {
            self.make_snapshot(durable)?;
        }
        self.measure();
        Ok(())
    }

    /// What was kept of the session, as it is on disk by now. Nothing is removed while `tell` looks.
    ///
    /// # Errors
    /// The disk fails, the journal is damaged, or what `tell` says.
    pub fn look_back<T>(
        &self,
        tell: impl FnOnce(&Past<'_, Disk>) -> Result<T, PastError>,
    ) -> Result<T, HomeError> {
        let _nothing_is_removed = self.looking.lock().unwrap_or_else(PoisonError::into_inner);
        look_back(&self.folder, Depth::SinceSnapshot, tell)
    }

    /// Up to which record all is on disk.
    #[must_use]
    pub fn durable(&self) -> u64 {
        self.watch.durable()
    }

    /// Keeps a block that no settings describe, so that a record may tell of it; gives its hash.
    ///
    /// # Errors
    /// The disk does not take it.
    pub fn keep_block(&self, clay: &mut Clay) -> Result<u64, HomeError> {
        blocks::keep(&self.folder, clay).map_err(at(&self.folder))
    }

    fn make_snapshot(&self, sequence: u64) -> Result<(), HomeError> {
        let failed = at(&self.folder);
        let mut disk = Disk::existing(&self.folder).map_err(&failed)?;
        let (epoch, payload) = self.look_back(|past| {
            let mut state = past.state(Until::Record(sequence))?;
            Ok((past.reader.epoch(), state.encode()))
        })?;
        let snapshot = Snapshot {
            sequence,
            epoch,
            payload,
        };
        let _nobody_looks = self.looking.lock().unwrap_or_else(PoisonError::into_inner);
        write_snapshot(&mut disk, &snapshot).map_err(&failed)?;
        self.snapshot.store(sequence, Ordering::Relaxed);
        compact(&mut disk, &self.policy).map_err(&failed)?;
        let needed = look_back(&self.folder, Depth::SinceSnapshot, blocks_told_of)?;
        blocks::retain(&self.folder, &needed).map_err(&failed)
    }

    fn measure(&self) {
        self.bytes.store(bytes_in(&self.folder), Ordering::Relaxed);
    }

    /// Writes what waits, once, and ends the thread that does.
    pub fn end(&self) {
        let running = self
            .running
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        drop(running);
    }
}

/// Looks at what is kept in a session's folder, with or without a server at work there.
///
/// # Errors
/// The disk fails, the journal is damaged, or what `tell` says.
pub fn look_back<T>(
    folder: &Path,
    depth: Depth,
    tell: impl FnOnce(&Past<'_, Disk>) -> Result<T, PastError>,
) -> Result<T, HomeError> {
    let disk = Disk::existing(folder).map_err(at(folder))?;
    let reader = match depth {
        Depth::SinceSnapshot => Reader::open(disk)?,
        Depth::All => Reader::verify(disk)?,
    };
    if let Some(damage) = reader.damage().first() {
        return Err(OpenError::Damaged(damage.clone()).into());
    }
    let given = blocks::load(folder).map_err(at(folder))?;
    Ok(tell(&Past {
        reader: &reader,
        given: &given,
    })?)
}

/// Hashes of the blocks that the records tell of, from the oldest snapshot on.
fn blocks_told_of(past: &Past<'_, Disk>) -> Result<BTreeSet<u64>, PastError> {
    let mut told = BTreeSet::new();
    for record in past.reader.records_from(past.reader.first()) {
        let record = record?;
        let sequence = record.sequence;
        let facts = Record::decode(&record.payload).map_err(|why| PastError::Record {
            sequence,
            why: why.into(),
        })?;
        told.extend(facts.facts.iter().filter_map(|fact| match fact {
            Fact::Begun { given, .. }
            | Fact::Told {
                kind: EventKind::FreshBlock { given, .. },
                ..
            } => *given,
            _ => None,
        }));
    }
    Ok(told)
}
