//! One session's history as everybody but its tick sees it.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use teleclay_journal::{Disk, Policy, Reader, Running, Snapshot, State, Watch, compact, write_snapshot};

use crate::home::HomeError;
use crate::keeper::{Keeper, Told};
use crate::past::state_of;

/// Records after which the next snapshot is due: so many seconds of one tool that cuts, and less than a tenth of a second
/// of work at the next start.
const RECORDS_A_SNAPSHOT: u64 = 60_000;

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
    /// Number of the last snapshot that was made by this server, or of what it began with.
    snapshot: AtomicU64,
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
    pub(crate) fn new(folder: &Path, policy: Policy, running: Running, keeper: &Keeper) -> Self {
        let watch = running.watch();
        let archive = Self {
            folder: folder.to_owned(),
            policy,
            told: keeper.told(),
            bytes: AtomicU64::new(0),
            snapshot: AtomicU64::new(watch.durable()),
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
                reason: "more happened at once than could be kept; the server has to start again".to_owned(),
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
        if RECORDS_A_SNAPSHOT <= durable.saturating_sub(self.snapshot.load(Ordering::Relaxed)) {
            self.make_snapshot(durable)?;
        }
        self.measure();
        Ok(())
    }

    fn make_snapshot(&self, sequence: u64) -> Result<(), HomeError> {
        let failed = |source| HomeError::File {
            path: self.folder.clone(),
            source,
        };
        let mut disk = Disk::existing(&self.folder).map_err(failed)?;
        let reader = Reader::open(disk.clone())?;
        let mut state = state_of(&reader, sequence)?;
        let snapshot = Snapshot {
            sequence,
            epoch: reader.epoch(),
            payload: state.encode(),
        };
        write_snapshot(&mut disk, &snapshot).map_err(failed)?;
        self.snapshot.store(sequence, Ordering::Relaxed);
        compact(&mut disk, &self.policy).map_err(failed)?;
        Ok(())
    }

    fn measure(&self) {
        let files = std::fs::read_dir(&self.folder).into_iter().flatten();
        let lengths = files.filter_map(|file| Some(file.ok()?.metadata().ok()?.len()));
        self.bytes.store(lengths.sum(), Ordering::Relaxed);
    }

    /// Writes what waits, once, and ends the thread that does.
    pub fn end(&self) {
        let running = self.running.lock().unwrap_or_else(PoisonError::into_inner).take();
        drop(running);
    }
}
