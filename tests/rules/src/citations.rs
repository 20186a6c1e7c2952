//! Checks that every paper the sources cite by its key, as in `[KHMH03] (21)`, is listed in docs/papers.md.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Result, ensure};

use crate::files::{files_of_ours, read};

/// What is cited and not listed, one sentence each.
pub fn check(root: &Path) -> Result<Vec<String>> {
    let (_, page) = read(root, &root.join("docs/papers.md"))?;
    let listed = listed(&page);
    ensure!(!listed.is_empty(), "docs/papers.md lists no paper");
    let mut wrong = Vec::new();
    for path in files_of_ours(root, &["rs", "ts", "tsx", "md"])? {
        let (shown, text) = read(root, &path)?;
        for (line, text) in (1..).zip(text.lines()) {
            let unlisted = keys(text).filter(|key| !listed.contains(key));
            wrong.extend(
                unlisted.map(|key| format!("{shown}:{line}: [{key}] is not in docs/papers.md")),
            );
        }
    }
    Ok(wrong)
}

/// The first cells of the tables' rows, as far as they are keys.
fn listed(page: &str) -> BTreeSet<&str> {
    let cells = page
        .lines()
        .filter_map(|line| line.strip_prefix("| ")?.split(" |").next());
    cells.filter(|cell| is_key(cell)).collect()
}

/// The keys that a line cites: in brackets of their own, so that neither an index nor a code such as E0308 counts.
fn keys(line: &str) -> impl Iterator<Item = &str> {
    let own = line.match_indices('[').filter(|(at, _)| {
        let before = line[..*at].chars().next_back();
        !before.is_some_and(|c| c.is_alphanumeric() || "_])".contains(c))
    });
    let inside = own.filter_map(|(at, _)| line[at + 1..].split_once(']').map(|(key, _)| key));
    inside.filter(|key| is_key(key))
}

/// Initials of the authors and two digits of the year.
fn is_key(text: &str) -> bool {
    let initials = text.trim_end_matches(|c: char| c.is_ascii_digit());
    let is_named = !initials.is_empty() && initials.chars().all(|c| c.is_ascii_uppercase());
    is_named && text.len() == initials.len() + 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_told_from_other_brackets() {
        let found = |line| keys(line).collect::<Vec<_>>().join(" ");
        assert_eq!(
            found("Source: [KHMH03] (21), [C94]; see [`x`] and [NS91]."),
            "KHMH03 C94 NS91"
        );
        assert_eq!(
            found("let a = table[K42]; error[E0308] [x01] [2003] []"),
            ""
        );
    }

    #[test]
    fn the_tables_first_cells_are_what_is_listed() {
        let page = "| key | paper |\n|---|---|\n| AB99 | one |\n| C00 | cites [NS91] |\n";
        assert_eq!(listed(page), BTreeSet::from(["AB99", "C00"]));
    }
}
