//! The file operations that a journal needs, so that a test can be the disk.

use std::io;

/// A file of the directory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Its name.
    pub name: String,
    /// Its length, bytes.
    pub bytes: u64,
}

/// One directory. A clone is another way to the same one.
///
/// Nothing is promised of what was not synced: a crash may keep any part of it, in any order.
pub trait Storage: Clone {
    /// An open file.
    type File;

    /// Keeps other processes out until this and all clones are gone.
    ///
    /// # Errors
    /// [`io::ErrorKind::WouldBlock`] when another process has it.
    fn lock(&mut self) -> io::Result<()>;

    /// Makes a file that is not there yet.
    ///
    /// # Errors
    /// It is there, or the storage fails.
    fn create(&mut self, name: &str) -> io::Result<Self::File>;

    /// Gives the file this length, of zeros, and the room for it.
    ///
    /// # Errors
    /// There is no room, or the storage fails.
    fn preallocate(&mut self, file: &Self::File, bytes: u64) -> io::Result<()>;

    /// Writes some of `bytes` at `offset` and says how many.
    ///
    /// # Errors
    /// The storage fails.
    fn write_at(&mut self, file: &Self::File, offset: u64, bytes: &[u8]) -> io::Result<usize>;

    /// Makes what was written to the file durable. After an error nobody knows what was lost: the file is not to be
    /// trusted again.
    ///
    /// # Errors
    /// The storage fails.
    fn sync(&mut self, file: &Self::File) -> io::Result<()>;

    /// Makes durable which names there are.
    ///
    /// # Errors
    /// The storage fails.
    fn sync_directory(&mut self) -> io::Result<()>;

    /// Gives a file another name, in place of any file that had it.
    ///
    /// # Errors
    /// The storage fails.
    fn rename(&mut self, from: &str, to: &str) -> io::Result<()>;

    /// Removes a file.
    ///
    /// # Errors
    /// The storage fails.
    fn remove(&mut self, name: &str) -> io::Result<()>;

    /// All files.
    ///
    /// # Errors
    /// The storage fails.
    fn list(&self) -> io::Result<Vec<Entry>>;

    /// The first `most` bytes of a file, or all where it is shorter.
    ///
    /// # Errors
    /// The storage fails.
    fn read_front(&self, name: &str, most: usize) -> io::Result<Vec<u8>>;

    /// All of a file.
    ///
    /// # Errors
    /// The storage fails.
    fn read(&self, name: &str) -> io::Result<Vec<u8>>;
}

/// Writes all of `bytes` at `offset`.
pub(crate) fn write_all<S: Storage>(
    storage: &mut S,
    file: &S::File,
    offset: u64,
    bytes: &[u8],
) -> io::Result<()> {
    let mut done = 0;
    while done < bytes.len() {
        let written = match storage.write_at(file, offset + done as u64, &bytes[done..]) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            other => other?,
        };
        if written == 0 {
            return Err(io::ErrorKind::WriteZero.into());
        }
        done += written;
    }
    Ok(())
}
