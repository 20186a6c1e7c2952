//! Checks that what the documentation points at exists: links, pictures, headings, and folders and files of this
//! workspace that stand in `code`. Addresses on the web are left alone, since a check must not depend on other people's
//! machines.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::files::{NOT_OURS, files_of_ours, read};

/// What leads nowhere, one sentence each.
pub fn check(root: &Path) -> Result<Vec<String>> {
    let root = root
        .canonicalize()
        .with_context(|| format!("{} does not exist", root.display()))?;
    let mut pages = BTreeMap::new();
    for path in files_of_ours(&root, &["md"])? {
        let (_, text) = read(&root, &path)?;
        pages.insert(path, Page::parse(&text));
    }
    ensure!(
        !pages.is_empty(),
        "there is no documentation in {}",
        root.display()
    );
    let mut wrong = Vec::new();
    for (path, page) in &pages {
        let shown = path.strip_prefix(&root).unwrap_or(path).display();
        for link in &page.links {
            if let Some(reason) = broken(link, path, &pages) {
                wrong.push(format!("{shown}: {link}: {reason}"));
            }
        }
        for code in &page.codes {
            if names_a_place(code, &root) && !root.join(code).exists() {
                wrong.push(format!("{shown}: `{code}` does not exist"));
            }
        }
    }
    Ok(wrong)
}

/// What of a Markdown file matters here.
struct Page {
    links: Vec<String>,
    codes: Vec<String>,
    headings: BTreeSet<String>,
}

impl Page {
    /// Reads what stands outside fences. Between two backticks stands code, and a link in there is none.
    fn parse(text: &str) -> Self {
        let mut is_fenced = false;
        let open = |line: &&str| {
            is_fenced ^= line.starts_with("```");
            !is_fenced
        };
        let lines: Vec<&str> = text.lines().filter(open).collect();
        let text = lines.join("\n");
        let links = text
            .split('`')
            .step_by(2)
            .flat_map(|prose| prose.split("](").skip(1));
        let links = links.filter_map(|rest| rest.split_once(')').map(|(link, _)| link.to_owned()));
        let codes = text.split('`').skip(1).step_by(2).map(str::to_owned);
        let mut headings = BTreeSet::new();
        for line in lines.iter().filter(|line| line.starts_with('#')) {
            let name = anchor(line.trim_start_matches('#').trim());
            let again = (1..).map(|n| format!("{name}-{n}"));
            let free = std::iter::once(name.clone())
                .chain(again)
                .find(|name| !headings.contains(name));
            headings.extend(free);
        }
        Self {
            links: links.collect(),
            codes: codes.collect(),
            headings,
        }
    }
}

fn broken(link: &str, page: &Path, pages: &BTreeMap<PathBuf, Page>) -> Option<String> {
    if ["http://", "https://", "mailto:"]
        .iter()
        .any(|scheme| link.starts_with(scheme))
    {
        return None;
    }
    let (place, heading) = link
        .split_once('#')
        .map_or((link, None), |(place, heading)| (place, Some(heading)));
    let target = match place {
        "" => page.to_owned(),
        place => match page.with_file_name(place).canonicalize() {
            Ok(target) => target,
            Err(_) => return Some("does not exist".to_owned()),
        },
    };
    let heading = heading?;
    let is_there = pages
        .get(&target)
        .is_some_and(|page| page.headings.contains(heading));
    (!is_there).then(|| format!("there is no heading #{heading}"))
}

/// Whether `code` reads as a path from the workspace's root: its first part is a folder there, and it holds no
/// placeholder and nothing that only a build makes.
fn names_a_place(code: &str, root: &Path) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    let is_made = code.split('/').any(|part| NOT_OURS.contains(&part));
    let first = code.split_once('/').map_or("", |(first, _)| first);
    code.chars().all(is_plain) && !is_made && !first.is_empty() && root.join(first).is_dir()
}

/// The name that a heading gets in the address, as forges make it.
fn anchor(heading: &str) -> String {
    let kept = heading
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.flat_map(char::to_lowercase)
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// A small workspace in which `text` is docs/page.md.
    fn complaints(text: &str) -> String {
        let root =
            std::env::temp_dir().join(format!("teleclay-xtask-{}-links", std::process::id()));
        fs::create_dir_all(root.join("docs")).unwrap();
        fs::create_dir_all(root.join("crates/clay")).unwrap();
        fs::write(
            root.join("README.md"),
            "# One `thing`, and another\n\n## Same\n\n## Same\n",
        )
        .unwrap();
        fs::write(root.join("docs/page.md"), text).unwrap();
        let wrong = check(&root).unwrap().join("\n");
        fs::remove_dir_all(root).unwrap();
        wrong
    }

    #[test]
    fn what_exists_is_fine_and_each_broken_pointer_is_found() {
        let text = "# Here\n[up](../README.md) [head](../README.md#one-thing-and-another) [twice](../README.md#same-1) \
                    [here](#here) [web](https://example.org/nowhere) `crates/clay` `crates/<name>` `target/release/x` \
                    `a/b` `[no](link.md)`\n\n```\n[not a link](nowhere.md)\n```\n";
        assert_eq!(complaints(text), "");
        for (text, word) in [
            ("[x](nowhere.md)", "nowhere.md: does not exist"),
            ("![x](images/none.png)", "images/none.png: does not exist"),
            ("[x](../README.md#nothing)", "no heading #nothing"),
            ("[x](../README.md#same-2)", "no heading #same-2"),
            ("[x](../crates#same)", "no heading #same"),
            ("[x](#there)", "no heading #there"),
            (
                "see `crates/clay/src/gone.rs`",
                "`crates/clay/src/gone.rs` does not exist",
            ),
            (
                "| a |\n|---|\n| `docs/gone.md` |",
                "`docs/gone.md` does not exist",
            ),
        ] {
            assert!(
                complaints(text).contains(word),
                "{word}: {}",
                complaints(text)
            );
        }
    }
}
