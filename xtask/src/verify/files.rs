//! The files of this workspace that someone wrote.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// Folders that hold nothing of ours, or nothing that a clone has.
pub(super) const NOT_OURS: [&str; 5] = [".git", "target", "node_modules", "dist", ".venv"];

/// Every file below `root` with one of these extensions, sorted, each path as `canonicalize` names it.
pub(super) fn files_of_ours(root: &Path, extensions: &[&str]) -> Result<Vec<PathBuf>> {
    let root = root
        .canonicalize()
        .with_context(|| format!("{} does not exist", root.display()))?;
    let mut left = vec![root];
    let mut files = Vec::new();
    while let Some(folder) = left.pop() {
        let entries = fs::read_dir(&folder)
            .with_context(|| format!("{} cannot be read", folder.display()))?;
        for entry in entries {
            let entry = entry?;
            let path = entry.path();
            let extension = path.extension().and_then(|extension| extension.to_str());
            if entry.file_type()?.is_dir() {
                if !NOT_OURS.iter().any(|name| entry.file_name() == *name) {
                    left.push(path);
                }
            } else if extension.is_some_and(|extension| extensions.contains(&extension)) {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}
