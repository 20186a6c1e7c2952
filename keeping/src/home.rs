//! The folder of all sessions.
//!
//! ```text
//! DATA/sessions/lock             locked by the server that runs
//! DATA/sessions/version          1
//! DATA/sessions/of/<session>/    a journal each
//! ```

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use teleclay_clay::Clay;
use teleclay_history::Recorder;
use teleclay_journal::{Disk, OpenError, Policy, Reader, Writer, start};
use teleclay_link::time::Timestamp;
use teleclay_proto::SessionId;
use teleclay_session::{Rules, Session};

use crate::archive::Archive;
use crate::blocks;
use crate::error::{HomeError, VERSION, at, bytes_in};
use crate::keeper::Keeper;
use crate::past::{Past, PastError, Until};

const SESSIONS: &str = "sessions";
/// Beside lock and version, a folder of folders: sessions may have any name.
const OF: &str = "of";
/// What stands before the name of a folder that is being removed. No name of a session has it.
const GOING: &str = "~";

/// Where the files of a session are, in a data folder.
#[must_use]
pub fn folder_of(data: &Path, id: &SessionId) -> PathBuf {
    data.join(SESSIONS).join(OF).join(id.as_str())
}

/// The sessions of one data folder, and the right to write them.
#[derive(Debug)]
pub struct Home {
    folder: PathBuf,
    policy: Policy,
    /// Held for as long as the server runs.
    _lock: File,
}

impl Home {
    /// Takes the folder into use; makes it where it is missing.
    ///
    /// # Errors
    /// Another server has it, a later one has written it, or the system refuses.
    pub fn open(data: &Path) -> Result<Self, HomeError> {
        let sessions = data.join(SESSIONS);
        let folder = sessions.join(OF);
        fs::create_dir_all(&folder).map_err(at(&folder))?;
        let path = sessions.join("lock");
        let lock = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(at(&path))?;
        lock.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => HomeError::InUse {
                path: sessions.clone(),
            },
            TryLockError::Error(source) => HomeError::File {
                path: path.clone(),
                source,
            },
        })?;
        check_version(&sessions)?;
        let home = Self {
            folder,
            policy: Policy::default(),
            _lock: lock,
        };
        home.sweep()?;
        Ok(home)
    }

    /// The sessions that are there, by name.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn names(&self) -> Result<Vec<SessionId>, HomeError> {
        let entries = fs::read_dir(&self.folder).map_err(at(&self.folder))?;
        let mut names: Vec<SessionId> = entries
            .filter_map(|entry| SessionId::new(entry.ok()?.file_name().to_str()?).ok())
            .collect();
        names.sort();
        Ok(names)
    }

    /// Whether a session of this name is there, in whatever state.
    #[must_use]
    pub fn has(&self, id: &SessionId) -> bool {
        self.path(id).exists()
    }

    /// Keeps a session that begins: before its first tick, its tools free. `given` is its block, where the settings do
    /// not describe it.
    ///
    /// # Errors
    /// There is no room for it, or there is one of its name.
    pub fn begin(
        &self,
        session: &mut Session,
        given: Option<&mut Clay>,
    ) -> Result<(Keeper, Archive), HomeError> {
        let path = self.path(&session.settings().spec.id);
        // Whoever makes the folder has it to themselves.
        fs::create_dir(&path).map_err(at(&path))?;
        File::open(&self.folder)
            .and_then(|folder| folder.sync_all())
            .map_err(at(&self.folder))?;
        let begun = self.begin_in(&path, session, given);
        if begun.is_err() {
            // What never began keeps no name. Should it stay, the next start removes it.
            let _ = fs::remove_dir_all(&path);
        }
        begun
    }

    fn begin_in(
        &self,
        path: &Path,
        session: &mut Session,
        given: Option<&mut Clay>,
    ) -> Result<(Keeper, Archive), HomeError> {
        let disk = Disk::existing(path).map_err(at(path))?;
        let writer = Writer::go_on(Reader::open(disk)?, self.policy)?;
        session.keep_journal();
        let mut recorder = Recorder::new(session.tools());
        let given = given.map(|clay| blocks::keep(path, clay)).transpose();
        let given = given.map_err(at(path))?;
        let first = recorder.begin(session, given).to_vec();
        self.keep(path, writer, recorder, &first, session, 0)
    }

    /// The session as it was, which goes on, and how it is kept from now on.
    ///
    /// # Errors
    /// It is damaged, or not to be read. Nothing of it was changed then.
    pub fn recover(
        &self,
        id: &SessionId,
        now: Timestamp,
    ) -> Result<(Session, Keeper, Archive), HomeError> {
        let path = self.path(id);
        let disk = Disk::existing(&path).map_err(at(&path))?;
        let reader = Reader::open(disk.clone())?;
        if let Some(damage) = reader.damage().first() {
            return Err(OpenError::Damaged(damage.clone()).into());
        }
        for remark in reader.remarks() {
            tracing::info!(session = %id, "an end that was never durable is left out: {remark}");
        }
        let given = blocks::load(&path).map_err(at(&path))?;
        let past = Past {
            reader: &reader,
            given: &given,
        };
        let state = past.state(Until::Now)?;
        let snapshot = reader.snapshots().last().copied().unwrap_or(0);
        let mut session = Session::recover(now, state.into_recovery(Rules::default()))
            .map_err(|error| PastError::NoLoop(error.to_string()))?;
        for (file, bytes) in reader.spare() {
            disk.trim(file, bytes).map_err(at(&path))?;
        }
        let writer = Writer::go_on(reader, self.policy)?;
        session.keep_journal();
        let mut recorder = Recorder::new(session.tools());
        let first = recorder.go_on(&session).to_vec();
        let (keeper, archive) = self.keep(&path, writer, recorder, &first, &session, snapshot)?;
        Ok((session, keeper, archive))
    }

    /// Removes what is kept of a session.
    ///
    /// # Errors
    /// The system refuses.
    pub fn remove(&self, id: &SessionId) -> Result<(), HomeError> {
        let path = self.path(id);
        // Half a folder is no session.
        let going = self.folder.join(format!("{GOING}{id}"));
        if going.exists() {
            fs::remove_dir_all(&going).map_err(at(&going))?;
        }
        fs::rename(&path, &going).map_err(at(&path))?;
        fs::remove_dir_all(&going).map_err(at(&going))
    }

    /// What a session's files take on disk, bytes.
    #[must_use]
    pub fn bytes(&self, id: &SessionId) -> u64 {
        bytes_in(&self.path(id))
    }

    fn keep(
        &self,
        path: &Path,
        writer: Writer<Disk>,
        recorder: Recorder,
        first: &[u8],
        session: &Session,
        snapshot: u64,
    ) -> Result<(Keeper, Archive), HomeError> {
        let (appender, running) = start(writer).map_err(at(path))?;
        let keeper = Keeper::new(recorder, appender, first, session);
        let archive = Archive::new(path, self.policy, running, &keeper, snapshot);
        Ok((keeper, archive))
    }

    fn path(&self, id: &SessionId) -> PathBuf {
        self.folder.join(id.as_str())
    }

    /// Removes what an earlier server had begun to remove, and sessions of which it had not written a byte when it
    /// ended: nobody was told that these are durable.
    fn sweep(&self) -> Result<(), HomeError> {
        let entries = fs::read_dir(&self.folder).map_err(at(&self.folder))?;
        for entry in entries.flatten() {
            let path = entry.path();
            let is_going = entry.file_name().to_string_lossy().starts_with(GOING);
            if is_going || never_began(&path) {
                fs::remove_dir_all(&path).map_err(at(&path))?;
            }
        }
        Ok(())
    }
}

/// Whether a folder holds nothing but room for records. What cannot be read has begun.
fn never_began(path: &Path) -> bool {
    /// Files of one that has not: a segment, a lock, a block.
    const MOST_FILES: usize = 3;
    let files = fs::read_dir(path).map_or(usize::MAX, Iterator::count);
    files <= MOST_FILES
        && Disk::existing(path)
            .ok()
            .and_then(|disk| Reader::open(disk).ok())
            .is_some_and(|reader| {
                reader.last() == 0 && reader.damage().is_empty() && reader.remarks().is_empty()
            })
}

fn check_version(sessions: &Path) -> Result<(), HomeError> {
    let path = sessions.join("version");
    match fs::read_to_string(&path) {
        Ok(text) => match text.trim().parse() {
            Ok(got) if got <= VERSION => Ok(()),
            got => Err(HomeError::Newer {
                path: sessions.to_owned(),
                got: got.unwrap_or(u32::MAX),
            }),
        },
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            fs::write(&path, format!("{VERSION}\n")).map_err(at(&path))
        }
        Err(error) => Err(at(&path)(error)),
    }
}
