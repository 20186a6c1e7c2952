//! A directory in memory, with every fault that a disk may have.
//!
//! What was written is seen at once, and is durable only after a sync. A crash keeps any part of what was not: each
//! page whole, torn or not at all, each name by itself. A sync that fails loses any part as well, and the next one says
//! that all is well, as file systems do; only that a file is gone is not forgotten. Chance comes from a seed.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, ErrorKind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::storage::{Entry, Storage};

/// What is kept or lost as one, bytes. Small, so that little is needed to find what goes wrong.
const PAGE: usize = 64;

/// How often an operation fails, in a thousand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults {
    /// A write fails.
    pub write: u32,
    /// A write takes in a part.
    pub short_write: u32,
    /// A sync of a file fails.
    pub sync: u32,
    /// A sync of the directory fails.
    pub sync_directory: u32,
    /// A file is not made, given room, renamed or removed.
    pub name: u32,
    /// Bytes that all files may take; `None` for no bound.
    pub room: Option<u64>,
    /// Nothing may be changed.
    pub is_read_only: bool,
}

/// A directory. A clone is another way to the same one.
#[derive(Clone, Debug)]
pub struct Memory {
    inner: Arc<Mutex<Inner>>,
}

#[derive(Debug)]
struct Inner {
    files: Vec<Contents>,
    /// Names as they are seen.
    names: BTreeMap<String, usize>,
    /// Names as they are durable.
    durable_names: BTreeMap<String, usize>,
    /// Changes of names since the last sync of the directory.
    changes: Vec<Change>,
    faults: Faults,
    lot: u64,
    is_locked: bool,
    /// Operations until the power fails; `None` while it lasts.
    fuse: Option<u32>,
}

#[derive(Debug, Default)]
struct Contents {
    seen: Vec<u8>,
    durable: Vec<u8>,
    dirty: BTreeSet<usize>,
}

#[derive(Clone, Debug)]
enum Change {
    Link {
        name: String,
        file: usize,
    },
    Rename {
        from: String,
        to: String,
        file: usize,
    },
    Unlink {
        name: String,
    },
}

impl Memory {
    /// An empty directory with chance of its own.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self {
            inner: Arc::new(Mutex::new(Inner {
                files: Vec::new(),
                names: BTreeMap::new(),
                durable_names: BTreeMap::new(),
                changes: Vec::new(),
                faults: Faults::default(),
                lot: seed,
                is_locked: false,
                fuse: None,
            })),
        }
    }

    /// What goes wrong from now on.
    pub fn set_faults(&self, faults: Faults) {
        self.inner().faults = faults;
    }

    /// After these many further operations nothing is done any more, until [`Memory::crash`] or [`Memory::kill`].
    pub fn set_fuse(&self, operations: u32) {
        self.inner().fuse = Some(operations);
    }

    /// Whether the fuse has blown.
    #[must_use]
    pub fn is_dead(&self) -> bool {
        self.inner().fuse == Some(0)
    }

    /// The power fails and comes back: of what was not synced any part is left.
    pub fn crash(&self) {
        let mut inner = self.inner();
        inner.revive();
        let mut names = std::mem::take(&mut inner.durable_names);
        for change in std::mem::take(&mut inner.changes) {
            if inner.draw(2) == 0 {
                change.apply(&mut names);
            }
        }
        inner.names.clone_from(&names);
        inner.durable_names = names;
        for file in 0..inner.files.len() {
            inner.lose(file);
            let contents = &mut inner.files[file];
            contents.seen.clone_from(&contents.durable);
        }
    }

    /// The process ends and another one begins: what was written is seen, synced or not.
    pub fn kill(&self) {
        self.inner().revive();
    }

    /// Flips bits of a byte, as seen and as durable.
    ///
    /// # Panics
    /// When there is no such file or byte.
    pub fn flip(&self, name: &str, at: usize, mask: u8) {
        let mut inner = self.inner();
        let file = inner.names[name];
        inner.files[file].seen[at] ^= mask;
        inner.files[file].durable[at] ^= mask;
    }

    /// Operations may not panic half way, so a poisoned lock holds what is sound.
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Change {
    fn apply(self, names: &mut BTreeMap<String, usize>) {
        match self {
            Self::Link { name, file } => {
                names.insert(name, file);
            }
            Self::Rename { from, to, file } => {
                names.remove(&from);
                names.insert(to, file);
            }
            Self::Unlink { name } => {
                names.remove(&name);
            }
        }
    }
}

impl Inner {
    /// A number below `below`, by lot.
    fn draw(&mut self, below: u64) -> u64 {
        self.lot = self.lot.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.lot ^ self.lot >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        (mixed ^ mixed >> 31) % below
    }

    fn revive(&mut self) {
        self.is_locked = false;
        self.fuse = None;
        self.faults = Faults::default();
    }

    /// One operation, which fails so often in a thousand.
    fn operation(&mut self, often: u32) -> io::Result<()> {
        if let Some(left) = &mut self.fuse {
            if *left == 0 {
                return Err(io::Error::other("the power is off"));
            }
            *left -= 1;
        }
        if self.faults.is_read_only {
            return Err(ErrorKind::ReadOnlyFilesystem.into());
        }
        if self.draw(1000) < often.into() {
            return Err(io::Error::from_raw_os_error(libc::EIO));
        }
        Ok(())
    }

    fn used(&self) -> u64 {
        let lengths = self.names.values();
        lengths
            .map(|file| self.files[*file].seen.len() as u64)
            .sum()
    }

    fn room_for(&self, more: u64) -> io::Result<()> {
        match self.faults.room {
            Some(room) if room < self.used() + more => Err(ErrorKind::StorageFull.into()),
            _ => Ok(()),
        }
    }

    /// Of what was not synced any part becomes durable, and the rest never will.
    fn lose(&mut self, file: usize) {
        let pages = std::mem::take(&mut self.files[file].dirty);
        for page in pages {
            let kept = match self.draw(3) {
                0 => PAGE,
                1 => 0,
                _ => self.draw(PAGE as u64) as usize,
            };
            self.files[file].persist(page, kept);
        }
    }
}

impl Contents {
    /// The first bytes of a page become durable.
    fn persist(&mut self, page: usize, kept: usize) {
        let start = page * PAGE;
        let end = (start + kept).min(self.seen.len());
        if start < end {
            if self.durable.len() < end {
                self.durable.resize(end, 0);
            }
            self.durable[start..end].copy_from_slice(&self.seen[start..end]);
        }
    }

    fn write(&mut self, offset: usize, bytes: &[u8]) {
        let end = offset + bytes.len();
        if self.seen.len() < end {
            self.seen.resize(end, 0);
        }
        self.seen[offset..end].copy_from_slice(bytes);
        self.dirty.extend(offset / PAGE..end.div_ceil(PAGE));
    }
}

impl Storage for Memory {
    type File = usize;

    fn lock(&mut self) -> io::Result<()> {
        let mut inner = self.inner();
        if std::mem::replace(&mut inner.is_locked, true) {
            return Err(ErrorKind::WouldBlock.into());
        }
        Ok(())
    }

    fn create(&mut self, name: &str) -> io::Result<usize> {
        let mut inner = self.inner();
        let often = inner.faults.name;
        inner.operation(often)?;
        if inner.names.contains_key(name) {
            return Err(ErrorKind::AlreadyExists.into());
        }
        inner.files.push(Contents::default());
        let file = inner.files.len() - 1;
        inner.names.insert(name.to_owned(), file);
        inner.changes.push(Change::Link {
            name: name.to_owned(),
            file,
        });
        Ok(file)
    }

    fn preallocate(&mut self, file: &usize, bytes: u64) -> io::Result<()> {
        let mut inner = self.inner();
        let often = inner.faults.name;
        inner.operation(often)?;
        inner.room_for(bytes)?;
        let contents = &mut inner.files[*file];
        contents.seen.resize(bytes as usize, 0);
        contents.dirty.extend(0..(bytes as usize).div_ceil(PAGE));
        Ok(())
    }

    fn write_at(&mut self, file: &usize, offset: u64, bytes: &[u8]) -> io::Result<usize> {
        let mut inner = self.inner();
        let often = inner.faults.write;
        let failed = inner.operation(often);
        let is_short = inner.draw(1000) < inner.faults.short_write.into();
        let mut written = bytes.len();
        if failed.is_err() || is_short {
            written = inner.draw(bytes.len() as u64 + 1) as usize;
        }
        let end = offset + written as u64;
        let more = end.saturating_sub(inner.files[*file].seen.len() as u64);
        inner.room_for(more)?;
        if !matches!(&failed, Err(error) if error.kind() == ErrorKind::ReadOnlyFilesystem) {
            // What a write that fails leaves is anything.
            inner.files[*file].write(offset as usize, &bytes[..written]);
        }
        failed.map(|()| written)
    }

    fn sync(&mut self, file: &usize) -> io::Result<()> {
        let mut inner = self.inner();
        let often = inner.faults.sync;
        let was_dead = inner.fuse == Some(0);
        if let Err(error) = inner.operation(often) {
            if !was_dead {
                inner.lose(*file);
            }
            return Err(error);
        }
        let contents = &mut inner.files[*file];
        for page in std::mem::take(&mut contents.dirty) {
            contents.persist(page, PAGE);
        }
        Ok(())
    }

    fn sync_directory(&mut self) -> io::Result<()> {
        let mut inner = self.inner();
        let often = inner.faults.sync_directory;
        let was_dead = inner.fuse == Some(0);
        let failed = inner.operation(often);
        if failed.is_err() && was_dead {
            return failed;
        }
        for change in std::mem::take(&mut inner.changes) {
            if failed.is_ok() || inner.draw(2) == 0 {
                change.apply(&mut inner.durable_names);
            } else if matches!(change, Change::Unlink { .. }) {
                inner.changes.push(change);
            }
        }
        failed
    }

    fn rename(&mut self, from: &str, to: &str) -> io::Result<()> {
        let mut inner = self.inner();
        let often = inner.faults.name;
        inner.operation(often)?;
        let file = inner.names.remove(from).ok_or(ErrorKind::NotFound)?;
        inner.names.insert(to.to_owned(), file);
        inner.changes.push(Change::Rename {
            from: from.to_owned(),
            to: to.to_owned(),
            file,
        });
        Ok(())
    }

    fn remove(&mut self, name: &str) -> io::Result<()> {
        let mut inner = self.inner();
        let often = inner.faults.name;
        inner.operation(often)?;
        inner.names.remove(name).ok_or(ErrorKind::NotFound)?;
        inner.changes.push(Change::Unlink {
            name: name.to_owned(),
        });
        Ok(())
    }

    fn list(&self) -> io::Result<Vec<Entry>> {
        let inner = self.inner();
        let entries = inner.names.iter().map(|(name, file)| Entry {
            name: name.clone(),
            bytes: inner.files[*file].seen.len() as u64,
        });
        Ok(entries.collect())
    }

    fn read_front(&self, name: &str, most: usize) -> io::Result<Vec<u8>> {
        let mut bytes = self.read(name)?;
        bytes.truncate(most);
        Ok(bytes)
    }

    fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let inner = self.inner();
        let file = inner.names.get(name).ok_or(ErrorKind::NotFound)?;
        Ok(inner.files[*file].seen.clone())
    }
}
