//! How sources are written: lines of prose to a width, doc comments of more than a word, files of a size that can be
//! read.

use std::path::Path;

use anyhow::{Result, ensure};

use crate::files::{files_of_ours, read};

/// Columns that a line of prose may have.
const PROSE_COLUMNS: usize = 120;

/// Lines that a file may have.
const FILE_LINES: usize = 600;

/// What is against the rules, one sentence each.
pub fn check(root: &Path) -> Result<Vec<String>> {
    let files = files_of_ours(root, &["rs", "ts", "tsx", "md"])?;
    ensure!(
        !files.is_empty(),
        "there are no sources in {}",
        root.display()
    );
    let mut wrong = Vec::new();
    for file in files {
        let (shown, text) = read(root, &file)?;
        let is_code = !shown.ends_with(".md");
        wrong.extend(
            long_prose(&text, is_code)
                .map(|line| format!("{shown}:{line}: over {PROSE_COLUMNS} columns")),
        );
        if is_code {
            wrong.extend(
                docs_of_a_word(&text)
                    .map(|(line, word)| format!("{shown}:{line}: {word} says nothing")),
            );
            let lines = text.lines().count();
            if FILE_LINES < lines {
                wrong.push(format!("{shown}: {lines} lines, more than {FILE_LINES}"));
            }
        }
    }
    Ok(wrong)
}

/// The numbers of lines of prose that are too long: of comments in code, of everything in Markdown. Tables and what
/// stands between fences cannot be broken, nor can the address or the link that a line ends with.
fn long_prose(text: &str, is_code: bool) -> impl Iterator<Item = usize> {
    let mut is_fenced = false;
    text.lines().enumerate().filter_map(move |(index, line)| {
        let start = line.trim_start();
        let is_comment = ["//", "/*", "* "]
            .iter()
            .any(|mark| start.starts_with(mark));
        let prose = if is_code {
            start.trim_start_matches(['/', '!', '*', ' '])
        } else {
            start
        };
        is_fenced = (is_comment || !is_code) && is_fenced ^ prose.starts_with("```");
        let has_prose = !is_code
            || is_comment
            || line.contains("; // ")
            || line.contains(", // ")
            || line.contains("} // ");
        let last = line.split(' ').next_back().unwrap_or_default();
        let is_bound = prose.starts_with('|') || last.contains("://") || last.contains("](");
        let is_long = PROSE_COLUMNS < line.chars().count();
        (is_long && has_prose && !is_fenced && !is_bound).then_some(index + 1)
    })
}

/// Doc comments of a single word, and the numbers of their lines.
fn docs_of_a_word(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let doc = |line: &&str| {
        line.strip_prefix("///")
            .or_else(|| line.strip_prefix("//!"))
            .is_some()
    };
    let words: Vec<(usize, &str)> = (0..lines.len())
        .filter(|&at| doc(&lines[at]))
        .filter(|&at| at == 0 || !doc(&lines[at - 1]))
        .filter(|&at| !lines.get(at + 1).is_some_and(doc))
        .map(|at| (at + 1, lines[at]))
        .collect();
    let blocks = lines
        .into_iter()
        .enumerate()
        .map(|(at, line)| (at + 1, line));
    let blocks = blocks.filter(|(_, line)| line.starts_with("/**") && line.ends_with("*/"));
    words
        .into_iter()
        .chain(blocks.collect::<Vec<_>>())
        .filter(|(_, line)| {
            let said = line.trim_matches(['/', '!', '*', ' ']);
            said.split_whitespace().count() == 1
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prose_is_held_to_its_width_and_what_cannot_be_broken_is_not() {
        let long = "word ".repeat(25);
        for (text, is_code, wrong) in [
            (format!("/// {long}"), true, vec![1]),
            (format!("//! short\nfn f() {{}} // {long}"), true, vec![2]),
            (format!("/**\n * {long}\n */"), true, vec![2]),
            (format!("let text = \"{long}\";"), true, vec![]),
            (
                format!("let product = a * b; {}", "call(a * b); ".repeat(9)),
                true,
                vec![],
            ),
            (
                format!("/// ```\n/// {long}\n/// ```\n/// {long}"),
                true,
                vec![4],
            ),
            (format!("/// | {long} |"), true, vec![]),
            (format!("# Title\n\n{long}"), false, vec![3]),
            (format!("| {long} |\n```\n{long}\n```"), false, vec![]),
            (
                format!("{}[a link](over/there.md)", &long[..110]),
                false,
                vec![],
            ),
            (
                format!("<https://example.org/{}>", long.replace(' ', "/")),
                false,
                vec![],
            ),
            ("é".repeat(120), false, vec![]),
            ("é".repeat(121), false, vec![1]),
        ] {
            assert_eq!(
                long_prose(&text, is_code).collect::<Vec<_>>(),
                wrong,
                "{text}"
            );
        }
    }

    #[test]
    fn a_doc_comment_of_one_word_is_found_alone_and_not_within_another() {
        let text = "/// It.\nfn f() {}\n    /// Its name.\n/// Long,\n/// wide.\nfn f() {}\n\
                    //! Why.\nfn g() {}\n/** So. */\n/** The why. */";
        let found: Vec<usize> = docs_of_a_word(text).map(|(line, _)| line).collect();
        assert_eq!(found, [1, 7, 9]);
    }

    #[test]
    fn a_file_of_six_hundred_lines_is_the_longest() {
        let root =
            std::env::temp_dir().join(format!("teleclay-xtask-{}-source", std::process::id()));
        std::fs::create_dir_all(&root).unwrap();
        let complaints = |lines: usize| {
            std::fs::write(root.join("a.rs"), "x\n".repeat(lines)).unwrap();
            check(&root).unwrap()
        };
        assert!(complaints(FILE_LINES).is_empty());
        assert_eq!(
            complaints(FILE_LINES + 1),
            ["a.rs: 601 lines, more than 600"]
        );
        std::fs::remove_dir_all(&root).unwrap();
    }
}
