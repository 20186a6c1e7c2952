//! Checks that what the documentation points at exists: links, pictures, headings, and folders and files of this workspace
//! that stand in `code`. Addresses on the web are left alone, since a check must not depend on other people's machines.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};

use super::files::{NOT_OURS, files_of_ours};

/// What leads nowhere, one sentence each.
pub(super) fn check(root: &Path) -> Result<Vec<String>> {
    let mut pages = HashMap::new();
    for path in files_of_ours(root, &["md"])? {
        let text = fs::read_to_string(&path)
            .with_context(|| format!("{} cannot be read", path.display()))?;
        pages.insert(path, Page::parse(&text));
    }
    ensure!(
        !pages.is_empty(),
        "there is no documentation in {}",
        root.display()
    );
    let mut wrong = Vec::new();
    for (path, page) in &pages {
        let folder = path.parent().unwrap_or(root);
        let shown = path.strip_prefix(root).unwrap_or(path).display();
        for link in &page.links {
            if let Some(reason) = broken(link, path, folder, &pages) {
                wrong.push(format!("{shown}: {link}: {reason}"));
            }
        }
        for code in &page.codes {
            if names_a_place(code, root) && !root.join(code).exists() {
                wrong.push(format!("{shown}: `{code}` does not exist"));
            }
        }
    }
    wrong.sort();
    Ok(wrong)
}

/// What of a Markdown file matters here.
struct Page {
    links: Vec<String>,
    codes: Vec<String>,
    headings: HashSet<String>,
}

impl Page {
    fn parse(text: &str) -> Self {
        let (mut links, mut codes, mut headings) = (Vec::new(), Vec::new(), HashSet::new());
        let mut heading: Option<String> = None;
        for event in Parser::new_ext(text, Options::ENABLE_TABLES) {
            match event {
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    links.push(dest_url.into_string());
                }
                Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
                Event::End(TagEnd::Heading(_)) => {
                    let name = anchor(&heading.take().unwrap_or_default());
                    let again = (1..).map(|n| format!("{name}-{n}"));
                    let free = std::iter::once(name.clone())
                        .chain(again)
                        .find(|n| !headings.contains(n));
                    headings.extend(free);
                }
                Event::Text(part) => {
                    if let Some(heading) = &mut heading {
                        heading.push_str(&part);
                    }
                }
                Event::Code(code) => {
                    if let Some(heading) = &mut heading {
                        heading.push_str(&code);
                    }
                    codes.push(code.into_string());
                }
                _ => {}
            }
        }
        Self {
            links,
            codes,
            headings,
        }
    }
}

fn broken(
    link: &str,
    page: &Path,
    folder: &Path,
    pages: &HashMap<PathBuf, Page>,
) -> Option<String> {
    let is_elsewhere = ["http://", "https://", "mailto:"]
        .iter()
        .any(|scheme| link.starts_with(scheme));
    if is_elsewhere {
        return None;
    }
    let (place, heading) = link
        .split_once('#')
        .map_or((link, None), |(place, heading)| (place, Some(heading)));
    let target = if place.is_empty() {
        page.to_owned()
    } else {
        match folder.join(place).canonicalize() {
            Ok(target) => target,
            Err(_) => return Some("does not exist".to_owned()),
        }
    };
    let heading = heading?;
    match pages.get(&target) {
        Some(page) if page.headings.contains(heading) => None,
        Some(_) => Some(format!("there is no heading #{heading}")),
        None => Some("only a Markdown page has headings to point at".to_owned()),
    }
}

/// Whether `code` reads as a path from the workspace's root: its first part is a folder there, and it holds no placeholder
/// and nothing that only a build makes.
fn names_a_place(code: &str, root: &Path) -> bool {
    let Some((first, rest)) = code.split_once('/') else {
        return false;
    };
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    let is_made = rest
        .split('/')
        .chain([first])
        .any(|part| NOT_OURS.contains(&part));
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
    use super::*;

    /// A small workspace in which `text` is docs/page.md.
    fn complaints(name: &str, text: &str) -> String {
        let root =
            std::env::temp_dir().join(format!("teleclay-xtask-{}-{name}", std::process::id()));
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
    fn what_exists_is_fine() {
        let text = "# Here\n[up](../README.md) [head](../README.md#one-thing-and-another) [twice](../README.md#same-1) \
                    [here](#here) [web](https://example.org/nowhere) `crates/clay` `crates/<name>` `target/release/x` \
                    `a/b`\n\n```\n[not a link](nowhere.md)\n```\n";
        assert_eq!(complaints("fine", text), "");
    }

    #[test]
    fn each_broken_pointer_is_found() {
        for (index, (text, word)) in [
            ("[x](nowhere.md)", "nowhere.md: does not exist"),
            ("![x](images/none.png)", "images/none.png: does not exist"),
            ("[x](../README.md#nothing)", "no heading #nothing"),
            ("[x](../README.md#same-2)", "no heading #same-2"),
            ("[x](#there)", "no heading #there"),
            (
                "see `crates/clay/src/gone.rs`",
                "`crates/clay/src/gone.rs` does not exist",
            ),
            (
                "| a |\n|---|\n| `docs/gone.md` |",
                "`docs/gone.md` does not exist",
            ),
        ]
        .into_iter()
        .enumerate()
        {
            let found = complaints(&format!("broken-{index}"), text);
            assert!(found.contains(word), "{word}: {found}");
        }
    }
}
