//! Checks that every paper the sources cite by its key, as in `[KHMH03] (21)`, is listed in docs/papers.md.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use super::files::files_of_ours;

/// Files that cite: code and prose.
const CITING: [&str; 4] = ["rs", "ts", "tsx", "md"];

/// What is cited and not listed, one sentence each.
pub(super) fn check(root: &Path) -> Result<Vec<String>> {
    let page = root.join("docs/papers.md");
    let text =
        fs::read_to_string(&page).with_context(|| format!("{} cannot be read", page.display()))?;
    let listed = listed(&text);
    ensure!(!listed.is_empty(), "{} lists no paper", page.display());
    let mut wrong = Vec::new();
    for path in files_of_ours(root, &CITING)? {
        let text = fs::read_to_string(&path)
            .with_context(|| format!("{} cannot be read", path.display()))?;
        let shown = path
            .strip_prefix(root)
            .unwrap_or(&path)
            .display()
            .to_string();
        for (line, text) in text.lines().enumerate() {
            let unlisted = keys(text).into_iter().filter(|key| !listed.contains(key));
            wrong.extend(
                unlisted
                    .map(|key| format!("{shown}:{}: [{key}] is not in docs/papers.md", line + 1)),
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
fn keys(line: &str) -> Vec<&str> {
    let parts = line.match_indices('[').filter(|(at, _)| {
        let before = line[..*at].chars().next_back();
        !before.is_some_and(|c| c.is_alphanumeric() || "_])".contains(c))
    });
    let inside = parts.filter_map(|(at, _)| line[at + 1..].split_once(']').map(|(key, _)| key));
    inside.filter(|key| is_key(key)).collect()
}

/// Initials of the authors and two digits of the year.
fn is_key(text: &str) -> bool {
    let Some((initials, year)) = text
        .len()
        .checked_sub(2)
        .and_then(|at| text.split_at_checked(at))
    else {
        return false;
    };
    !initials.is_empty()
        && initials.chars().all(|c| c.is_ascii_uppercase())
        && year.chars().all(|c| c.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_told_from_other_brackets() {
        assert_eq!(
            keys("Source: [KHMH03] (21), [C94]; see [`x`] and [NS91]."),
            ["KHMH03", "C94", "NS91"]
        );
        assert_eq!(
            keys("let a = table[K42]; error[E0308] [x01] [2003] []"),
            Vec::<&str>::new()
        );
    }

    #[test]
    fn the_tables_first_cells_are_what_is_listed() {
        let page = "| key | paper |\n|---|---|\n| AB99 | one |\n| C00 | cites [NS91] |\n";
        assert_eq!(listed(page), BTreeSet::from(["AB99", "C00"]));
    }
}
