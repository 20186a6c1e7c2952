//! The files of this workspace that someone wrote.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// Folders that hold nothing of ours, or nothing that a clone has.
pub(crate) const NOT_OURS: [&str; 6] = [
    ".git",
    "target",
    "node_modules",
    "dist",
    "generated",
    ".venv",
];

/// Every file below `root` with one of these extensions, or every file when none is named, sorted.
pub fn files_of_ours(root: &Path, extensions: &[&str]) -> Result<Vec<PathBuf>> {
    let mut left = vec![root.to_owned()];
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
            } else if extensions.is_empty() || extension.is_some_and(|e| extensions.contains(&e)) {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

/// A text file of ours, as the checks quote it: its path from `root`, and what stands there.
pub(crate) fn read(root: &Path, file: &Path) -> Result<(String, String)> {
    let text =
        fs::read_to_string(file).with_context(|| format!("{} cannot be read", file.display()))?;
    let shown = file
        .strip_prefix(root)
        .unwrap_or(file)
        .display()
        .to_string();
    Ok((shown, text))
}
