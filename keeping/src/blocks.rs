//! Blocks that no settings describe, beside the journal that tells of them: imported meshes, copies of other sessions.
//!
//! ```text
//! <hash>.block     the block whose hash these 16 hexadecimal digits are
//! ```
//!
//! A block is there, whole and synced, before the record that tells of it is written.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

use teleclay_clay::Clay;
use teleclay_history::content;

/// Younger ones are never removed: the record that tells of one follows it.
const YOUNG: Duration = Duration::from_secs(600);
const ENDING: &str = "block";
/// Ends the name of one that is being written.
const PART: &str = "part";

/// Keeps a block in a session's folder; gives its hash.
///
/// # Errors
/// The system refuses.
pub(crate) fn keep(folder: &Path, clay: &mut Clay) -> io::Result<u64> {
    let hash = clay.hash();
    let path = path_of(folder, hash);
    let part = path.with_extension(PART);
    let mut bytes = Vec::new();
    content::encode(clay, &mut bytes);
    let written = write_as(folder, &part, &path, &bytes);
    if written.is_err() {
        // Half a block is of use to nobody, and takes room.
        let _ = fs::remove_file(&part);
    }
    written.map(|()| hash)
}

fn write_as(folder: &Path, part: &Path, path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create(part)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(part, path)?;
    File::open(folder)?.sync_all()
}

/// The blocks that are kept in a session's folder.
///
/// # Errors
/// The system refuses, or a file holds another block than its name says.
pub(crate) fn load(folder: &Path) -> io::Result<Vec<Clay>> {
    let mut blocks = Vec::new();
    for path in paths(folder)? {
        let block = content::decode(&fs::read(&path)?);
        blocks.push(block.map_err(|error| {
            let words = format!("{}: {error}", path.display());
            io::Error::new(io::ErrorKind::InvalidData, words)
        })?);
    }
    Ok(blocks)
}

/// Removes the blocks that nothing tells of any more.
///
/// # Errors
/// The system refuses.
pub(crate) fn retain(folder: &Path, needed: &BTreeSet<u64>) -> io::Result<()> {
    for path in paths(folder)? {
        let hash = path.file_stem().and_then(|stem| stem.to_str());
        let hash = hash.and_then(|hash| u64::from_str_radix(hash, 16).ok());
        let is_needed = hash.is_none_or(|hash| needed.contains(&hash));
        let age = fs::metadata(&path)?.modified()?.elapsed();
        if !is_needed && age.is_ok_and(|age| YOUNG < age) {
            fs::remove_file(&path)?;
        }
    }
    Ok(())
}

fn path_of(folder: &Path, hash: u64) -> PathBuf {
    folder.join(format!("{hash:016x}.{ENDING}"))
}

fn paths(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == ENDING) {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}
