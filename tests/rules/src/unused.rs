//! Finds dependencies that no source of their package names.

use std::path::Path;

use anyhow::{Result, ensure};

use crate::Member;
use crate::files::{files_of_ours, read};

/// Dependencies that are there for their features alone; the manifest says why.
const NAMED_FOR_FEATURES: [&str; 1] = ["regex-syntax"];

/// Dependencies that nobody uses, one sentence each.
pub fn check(root: &Path, members: &[Member]) -> Result<Vec<String>> {
    ensure!(!members.is_empty(), "the workspace has no members");
    let mut wrong = Vec::new();
    for member in members {
        let mut sources = String::new();
        for file in files_of_ours(&member.folder, &["rs"])? {
            sources.push_str(&read(root, &file)?.1);
        }
        let used = member.dependencies.iter().map(String::as_str);
        let used = used.filter(|name| !NAMED_FOR_FEATURES.contains(name));
        wrong.extend(
            unnamed(&sources, used).map(|name| format!("{}: {name} is not used", member.name)),
        );
    }
    let (_, manifest) = read(root, &root.join("Cargo.toml"))?;
    let shared = manifest
        .split("[workspace.dependencies]\n")
        .nth(1)
        .unwrap_or_default();
    let shared = shared.lines().take_while(|line| !line.starts_with('['));
    for name in shared.filter_map(|line| line.split_once(" = ").map(|(name, _)| name)) {
        let is_named = |member: &Member| member.dependencies.iter().any(|used| used == name);
        if !members.iter().any(is_named) {
            wrong.push(format!(
                "Cargo.toml: no member of the workspace uses {name}"
            ));
        }
    }
    Ok(wrong)
}

/// The names among `dependencies` that the sources do not say as a path, an import or an attribute does.
fn unnamed<'a>(
    sources: &str,
    dependencies: impl Iterator<Item = &'a str>,
) -> impl Iterator<Item = &'a str> {
    dependencies.filter(move |name| {
        let name = name.replace('-', "_");
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let mut found = sources.match_indices(&name);
        !found.any(|(at, _)| {
            let before = sources[..at].chars().next_back();
            let after = &sources[at + name.len()..];
            let follows = ["::", ";", " as ", ",", "}"]
                .iter()
                .any(|mark| after.starts_with(mark));
            follows && !before.is_some_and(is_word)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dependency_is_used_when_a_path_names_it() {
        let found = |sources: &str| {
            let all = ["rand-core", "serde", "log"];
            unnamed(sources, all.into_iter())
                .collect::<Vec<_>>()
                .join(" ")
        };
        assert_eq!(found("use rand_core::Rng; use serde; log::info!()"), "");
        assert_eq!(
            found("use serde_json::Value; catalog::x(); rand_core"),
            "rand-core serde log"
        );
        assert_eq!(
            found("// the log says so\nlet log = 1; use {rand_core, serde};"),
            "log"
        );
    }
}
