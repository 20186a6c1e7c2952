//! The recordings of a server: for each that runs a thread and a file, and for each that there is a slip beside the
//! file that says what came of it.

use std::collections::BTreeMap;
use std::fs::{self, DirBuilder, File};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, Write};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use teleclay_proto::SessionId;
use teleclay_proto::http::{Recording, RecordingState};

use crate::error::WriteError;
use crate::scribe::{About, Scribe};
use crate::tap::Feed;

/// Bytes of one recording at most: two tools at every tick make a gigabyte in about a quarter of an hour.
pub const RECORDING_BYTES: u64 = 8 << 30;
/// Bytes of all recordings of a server at most.
pub const SHELF_BYTES: u64 = 32 << 30;
/// What the disk keeps free for everything else.
const SPARE_BYTES: u64 = 1 << 30;
/// A killed server loses what came since the last sync.
const BETWEEN_SYNCS: Duration = Duration::from_secs(1);
/// The ring has room for seconds.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);
/// Parcels that are taken before anybody looks at the clock again.
const PARCELS_AT_ONCE: usize = 4096;

/// Why there is no such recording, or it cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum ShelfError {
    /// One of this name is there.
    #[error("the session has a recording {id} already")]
    Exists {
        /// Its name.
        id: SessionId,
    },
    /// The session is being recorded.
    #[error("the session is being recorded as {id}: stop that first")]
    Running {
        /// The recording's name.
        id: SessionId,
    },
    /// There is none of this name.
    #[error("the session has no recording {id}")]
    Missing {
        /// The name.
        id: SessionId,
    },
    /// The bound on all recordings is reached.
    #[error("recordings take {got} MiB, of {most} MiB for all: delete some first", got = .got >> 20, most = .most >> 20)]
    Full {
        /// What they take, bytes.
        got: u64,
        /// What they may take, bytes.
        most: u64,
    },
    /// The folder or the file.
    #[error("the folder of recordings: {0}")]
    Folder(#[from] io::Error),
    /// The file cannot be begun.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Where recordings lie, and those that run.
pub struct Shelf {
    root: PathBuf,
    /// Nobody else will look for them once this server has ended.
    is_temporary: bool,
    root_is_made: AtomicBool,
    running: Mutex<BTreeMap<(SessionId, SessionId), Running>>,
}

struct Running {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    bytes: AtomicU64,
    ticks: AtomicU64,
    dropped: AtomicU64,
    is_temporary: bool,
    /// Whoever asks for it gives the reason.
    wanted_end: Mutex<Option<String>>,
    has_ended: AtomicBool,
}

impl Shelf {
    /// In a folder that lasts; it is made once there is a recording.
    #[must_use]
    pub fn lasting(root: PathBuf) -> Self {
        Self {
            root,
            is_temporary: false,
            root_is_made: AtomicBool::new(false),
            running: Mutex::default(),
        }
    }

    /// In a folder of the system's for what is temporary, that goes with the shelf.
    #[must_use]
    pub fn temporary() -> Self {
        // Others of this machine write there, too: a name that nobody can foresee, and see `make_root`.
        let chance = RandomState::new().hash_one(std::process::id());
        let name = format!("teleclay-recordings-{}-{chance:016x}", std::process::id());
        let mut shelf = Self::lasting(std::env::temp_dir().join(name));
        shelf.is_temporary = true;
        shelf
    }

    /// Begins to write what comes from a tick.
    ///
    /// # Errors
    /// There is one of this name, or one of this session that goes on, or no room; the file cannot be begun.
    pub fn start(&self, id: &SessionId, about: About, feed: Feed) -> Result<Recording, ShelfError> {
        let session = about.session.clone();
        let session =
            SessionId::new(session).map_err(|error| WriteError::Broken(error.to_string()))?;
        let mut running = self.running();
        if let Some((_, id)) = running
            .iter()
            .find(|((of, _), one)| *of == session && !one.has_ended())
            .map(|(key, _)| key)
        {
            return Err(ShelfError::Running { id: id.clone() });
        }
        let got = bytes_below(&self.root);
        if SHELF_BYTES < got {
            return Err(ShelfError::Full {
                got,
                most: SHELF_BYTES,
            });
        }
        let files = self.files(&session, id);
        self.make_root()?;
        fs::create_dir_all(files.folder())?;
        let file = File::create_new(&files.file).map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => ShelfError::Exists { id: id.clone() },
            _ => ShelfError::Folder(error),
        })?;
        let shared = Arc::new(self.shared());
        let slip = shared.slip(id, RecordingState::Recording, None);
        files.put_slip(&slip)?;
        sync_folder(files.folder())?;
        let sink = Counted {
            file: file.try_clone()?,
            shared: Arc::clone(&shared),
        };
        let scribe = Scribe::new(sink, about)?;
        let writing = Writing {
            scribe,
            feed,
            file,
            files,
            id: id.clone(),
            shared: Arc::clone(&shared),
            others_bytes: got,
        };
        let thread = std::thread::Builder::new()
            .name("recording".to_owned())
            .spawn(move || writing.run())?;
        let thread = Some(thread);
        running.insert((session, id.clone()), Running { shared, thread });
        Ok(slip)
    }

    /// Ends a recording once everything is written that the tick has given; waits for that.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn stop(
        &self,
        session: &SessionId,
        id: &SessionId,
        reason: &str,
    ) -> Result<Recording, ShelfError> {
        let writer = {
            let mut running = self.running();
            let running = running.get_mut(&(session.clone(), id.clone()));
            running.and_then(|running| {
                let mut wanted = running.shared.wanted_end.lock().expect("no holder panics");
                wanted.get_or_insert_with(|| reason.to_owned());
                drop(wanted);
                Some((running.thread.take()?, Arc::clone(&running.shared)))
            })
        };
        if let Some((thread, shared)) = writer {
            thread.thread().unpark();
            // A thread that panicked has left a slip that says it goes on; it is told as interrupted.
            let _ = thread.join();
            shared.has_ended.store(true, Ordering::Release);
        }
        self.recording(session, id)
    }

    /// The recording of a session that goes on, if one does.
    #[must_use]
    pub fn running_of(&self, session: &SessionId) -> Option<SessionId> {
        let running = self.running();
        let mut of_it = running.iter().filter(|((of, _), _)| of == session);
        of_it
            .find(|(_, one)| !one.has_ended())
            .map(|((_, id), _)| id.clone())
    }

    /// The recordings of a session, by name.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn list(&self, session: &SessionId) -> Result<Vec<Recording>, ShelfError> {
        let mut all = Vec::new();
        let folder = match fs::read_dir(self.root.join(session.as_str())) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(all),
            folder => folder?,
        };
        for entry in folder {
            let path = entry?.path();
            let is_file = path
                .extension()
                .is_some_and(|extension| extension == "mcap");
            let name = path.file_stem().and_then(|name| name.to_str());
            if let Some(id) = name
                .filter(|_| is_file)
                .and_then(|name| SessionId::new(name).ok())
            {
                all.push(self.recording(session, &id)?);
            }
        }
        all.sort_by(|one, other| one.id.cmp(&other.id));
        Ok(all)
    }

    /// One recording.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn recording(&self, session: &SessionId, id: &SessionId) -> Result<Recording, ShelfError> {
        let files = self.files(session, id);
        let bytes = fs::metadata(&files.file).map(|file| file.len());
        let bytes = bytes.map_err(|_| ShelfError::Missing { id: id.clone() })?;
        let key = (session.clone(), id.clone());
        if let Some(running) = self.running().get(&key).filter(|one| !one.has_ended()) {
            return Ok(running.shared.slip(id, RecordingState::Recording, None));
        }
        let slip = fs::read(&files.slip).ok();
        let slip = slip.and_then(|slip| serde_json::from_slice::<Recording>(&slip).ok());
        let interrupted = RecordingState::Interrupted;
        Ok(match slip {
            Some(slip) if slip.state != RecordingState::Recording => Recording { bytes, ..slip },
            _ => Recording {
                bytes,
                reason: Some("the server ended before the recording did".to_owned()),
                ..self.shared().slip(id, interrupted, None)
            },
        })
    }

    /// Where the file of a recording lies.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn file(&self, session: &SessionId, id: &SessionId) -> Result<PathBuf, ShelfError> {
        self.recording(session, id)?;
        Ok(self.files(session, id).file)
    }

    /// Deletes a recording that does not go on.
    ///
    /// # Errors
    /// There is none of this name, or it goes on; the file cannot be deleted.
    pub fn delete(&self, session: &SessionId, id: &SessionId) -> Result<(), ShelfError> {
        if self.recording(session, id)?.state == RecordingState::Recording {
            return Err(ShelfError::Running { id: id.clone() });
        }
        self.running().remove(&(session.clone(), id.clone()));
        let files = self.files(session, id);
        fs::remove_file(&files.file)?;
        // Without its slip a file is told as interrupted; without its file a slip is nothing.
        let _ = fs::remove_file(&files.slip);
        Ok(())
    }

    /// A temporary folder is this server's own, and nobody else looks into it: one that is there already is refused.
    fn make_root(&self) -> io::Result<()> {
        if self.is_temporary && !self.root_is_made.load(Ordering::Relaxed) {
            DirBuilder::new().mode(0o700).create(&self.root)?;
            self.root_is_made.store(true, Ordering::Relaxed);
        }
        Ok(())
    }

    fn shared(&self) -> Shared {
        Shared {
            is_temporary: self.is_temporary,
            ..Shared::default()
        }
    }

    fn running(&self) -> MutexGuard<'_, BTreeMap<(SessionId, SessionId), Running>> {
        self.running.lock().expect("no holder panics")
    }

    /// Names are [`SessionId`]s: none leads out of the folder.
    fn files(&self, session: &SessionId, id: &SessionId) -> Files {
        let folder = self.root.join(session.as_str());
        Files {
            file: folder.join(format!("{}.mcap", id.as_str())),
            slip: folder.join(format!("{}.json", id.as_str())),
        }
    }
}

impl Shelf {
    /// Ends every recording that goes on.
    pub fn end_all(&self) {
        let keys: Vec<_> = self.running().keys().cloned().collect();
        for (session, id) in keys {
            // What cannot be ended is told as interrupted.
            let _ = self.stop(&session, &id, "the server has ended");
        }
    }
}

impl Drop for Shelf {
    fn drop(&mut self) {
        self.end_all();
        if self.is_temporary {
            // The system clears its folder of temporary files sooner or later.
            let _ = fs::remove_dir_all(&self.root);
        }
    }
}

impl Running {
    fn has_ended(&self) -> bool {
        self.shared.has_ended.load(Ordering::Acquire)
    }
}

impl Shared {
    fn slip(&self, id: &SessionId, state: RecordingState, reason: Option<String>) -> Recording {
        Recording {
            id: id.clone(),
            state,
            reason,
            bytes: self.bytes.load(Ordering::Relaxed),
            ticks: self.ticks.load(Ordering::Relaxed),
            dropped: self.dropped.load(Ordering::Relaxed),
            is_temporary: self.is_temporary,
        }
    }
}

struct Files {
    file: PathBuf,
    slip: PathBuf,
}

impl Files {
    fn folder(&self) -> &Path {
        self.file.parent().unwrap_or(Path::new("."))
    }

    fn put_slip(&self, slip: &Recording) -> io::Result<()> {
        let fresh = self.slip.with_extension("json.new");
        let mut file = File::create(&fresh)?;
        file.write_all(&serde_json::to_vec(slip)?)?;
        file.sync_all()?;
        fs::rename(fresh, &self.slip)
    }
}

/// A recording's thread.
struct Writing {
    scribe: Scribe<Counted>,
    feed: Feed,
    file: File,
    files: Files,
    id: SessionId,
    shared: Arc<Shared>,
    others_bytes: u64,
}

impl Writing {
    fn run(mut self) {
        let end = self.write();
        let (state, reason) = match end {
            Ok(reason) => (RecordingState::Ended, reason),
            Err(error) => (RecordingState::Failed, error.to_string()),
        };
        self.tell_counts();
        let slip = self.shared.slip(&self.id, state, Some(reason));
        if let Err(error) = self.files.put_slip(&slip) {
            tracing::warn!(recording = %self.id, "what came of the recording cannot be noted: {error}");
        }
        if state == RecordingState::Failed {
            tracing::warn!(recording = %self.id, "{}", slip.reason.as_deref().unwrap_or_default());
        }
        self.shared.has_ended.store(true, Ordering::Release);
    }

    /// Writes until there is a reason to end.
    fn write(&mut self) -> Result<String, WriteError> {
        let mut synced = Instant::now();
        loop {
            let has_ended = self.feed.has_ended();
            let taken = self.scribe.take_from(&mut self.feed, PARCELS_AT_ONCE)?;
            self.tell_counts();
            if let Some(reason) = self.reason_to_end(has_ended, taken) {
                self.scribe.finish(&reason)?;
                self.file.sync_all().map_err(mcap::McapError::from)?;
                return Ok(reason);
            }
            if BETWEEN_SYNCS <= synced.elapsed() {
                synced = Instant::now();
                self.scribe.flush()?;
                self.file.sync_data().map_err(mcap::McapError::from)?;
            }
            if taken < PARCELS_AT_ONCE {
                std::thread::park_timeout(BETWEEN_LOOKS);
            }
        }
    }

    fn reason_to_end(&self, has_ended: bool, taken: usize) -> Option<String> {
        let wanted = self.shared.wanted_end.lock().expect("no holder panics");
        if taken == 0 && (has_ended || wanted.is_some()) {
            let reason = wanted.as_deref().unwrap_or("the session has ended");
            return Some(reason.to_owned());
        }
        drop(wanted);
        let bytes = self.shared.bytes.load(Ordering::Relaxed);
        if RECORDING_BYTES < bytes {
            return Some(format!("it takes {} GiB", RECORDING_BYTES >> 30));
        }
        if SHELF_BYTES < self.others_bytes + bytes {
            return Some(format!("all recordings take {} GiB", SHELF_BYTES >> 30));
        }
        None
    }

    fn tell_counts(&self) {
        let counts = self.scribe.counts();
        self.shared.ticks.store(counts.ticks, Ordering::Relaxed);
        self.shared.dropped.store(counts.dropped, Ordering::Relaxed);
    }
}

/// A file that counts what was written to it, and leaves the disk some room.
struct Counted {
    file: File,
    shared: Arc<Shared>,
}

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        let before = self
            .shared
            .bytes
            .fetch_add(written as u64, Ordering::Relaxed);
        // Looked at once in 16 MiB.
        let after = before + written as u64;
        if before >> 24 != after >> 24
            && free_bytes(&self.file).is_some_and(|free| free < SPARE_BYTES)
        {
            return Err(io::Error::new(
                io::ErrorKind::StorageFull,
                "the disk has less than a gigabyte left",
            ));
        }
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Room on the disk of a file, where the system tells it.
#[allow(unsafe_code, reason = "the standard library does not ask for it")]
fn free_bytes(file: &File) -> Option<u64> {
    use std::os::fd::AsRawFd;
    let mut room = std::mem::MaybeUninit::<libc::statvfs>::uninit();
    // SAFETY: the descriptor is open, and the structure is filled where the call says so.
    let room = unsafe {
        if libc::fstatvfs(file.as_raw_fd(), room.as_mut_ptr()) != 0 {
            return None;
        }
        room.assume_init()
    };
    Some(room.f_bavail * room.f_frsize)
}

fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

/// Bytes of all recordings in a folder of folders. What cannot be read counts nothing.
fn bytes_below(root: &Path) -> u64 {
    let folders = fs::read_dir(root).into_iter().flatten().flatten();
    folders
        .flat_map(|folder| fs::read_dir(folder.path()).into_iter().flatten().flatten())
        .filter_map(|file| file.metadata().ok())
        .map(|file| file.len())
        .sum()
}
