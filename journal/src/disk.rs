//! A journal's directory on a real disk.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read};
use std::os::fd::AsRawFd;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::storage::{Entry, Storage};

/// Name of the file that is locked.
const LOCK: &str = "lock";

/// A directory.
#[derive(Clone, Debug)]
pub struct Disk {
    folder: PathBuf,
    directory: Arc<File>,
    lock: Option<Arc<File>>,
}

impl Disk {
    /// The directory at `folder`, which is made where it is missing.
    ///
    /// # Errors
    /// It cannot be made or opened.
    pub fn new(folder: impl Into<PathBuf>) -> io::Result<Self> {
        let folder = folder.into();
        let is_new = !folder.is_dir();
        fs::create_dir_all(&folder)?;
        if is_new && let Some(parent) = folder.parent() {
            sync_folder(parent)?;
        }
        Self::existing(folder)
    }

    /// The directory at `folder`, which has to be there.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn existing(folder: impl Into<PathBuf>) -> io::Result<Self> {
        let folder = folder.into();
        Ok(Self {
            directory: Arc::new(File::open(&folder)?),
            folder,
            lock: None,
        })
    }

    /// Gives back what a file has reserved behind its first `bytes`.
    ///
    /// # Errors
    /// The system refuses.
    pub fn trim(&self, name: &str, bytes: u64) -> io::Result<()> {
        let file = OpenOptions::new()
            .write(true)
            .open(self.folder.join(name))?;
        if bytes < file.metadata()?.len() {
            file.set_len(bytes)?;
        }
        Ok(())
    }

    /// Where it is.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}

impl Storage for Disk {
    type File = File;

    fn lock(&mut self) -> io::Result<()> {
        if self.lock.is_some() {
            return Ok(());
        }
        let file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .open(self.folder.join(LOCK))?;
        file.try_lock().map_err(io::Error::from)?;
        self.lock = Some(Arc::new(file));
        Ok(())
    }

    fn create(&mut self, name: &str) -> io::Result<File> {
        OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(self.folder.join(name))
    }

    fn preallocate(&mut self, file: &File, bytes: u64) -> io::Result<()> {
        let length = libc::off_t::try_from(bytes).map_err(|_| io::ErrorKind::InvalidInput)?;
        // Its errors come back as numbers, not in errno.
        #[allow(unsafe_code, reason = "std has no call that reserves room on a disk")]
        // SAFETY: the descriptor is open as long as `file` is borrowed.
        let code = unsafe { libc::posix_fallocate(file.as_raw_fd(), 0, length) };
        match code {
            0 => Ok(()),
            // Some file systems reserve nothing; a write that finds no room then says so.
            libc::EOPNOTSUPP | libc::EINVAL => file.set_len(bytes),
            code => Err(io::Error::from_raw_os_error(code)),
        }
    }

    fn write_at(&mut self, file: &File, offset: u64, bytes: &[u8]) -> io::Result<usize> {
        FileExt::write_at(file, bytes, offset)
    }

    fn sync(&mut self, file: &File) -> io::Result<()> {
        file.sync_data()
    }

    fn sync_directory(&mut self) -> io::Result<()> {
        self.directory.sync_all()
    }

    fn rename(&mut self, from: &str, to: &str) -> io::Result<()> {
        fs::rename(self.folder.join(from), self.folder.join(to))
    }

    fn remove(&mut self, name: &str) -> io::Result<()> {
        fs::remove_file(self.folder.join(name))
    }

    fn list(&self) -> io::Result<Vec<Entry>> {
        let mut entries = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let entry = entry?;
            let is_file = entry.file_type()?.is_file();
            if let (true, Ok(name)) = (is_file, entry.file_name().into_string()) {
                entries.push(Entry {
                    name,
                    bytes: entry.metadata()?.len(),
                });
            }
        }
        Ok(entries)
    }

    fn read_front(&self, name: &str, most: usize) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(most);
        let file = File::open(self.folder.join(name))?;
        file.take(most as u64).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        fs::read(self.folder.join(name))
    }
}

fn sync_folder(folder: &Path) -> io::Result<()> {
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    File::open(folder)?.sync_all()
}
