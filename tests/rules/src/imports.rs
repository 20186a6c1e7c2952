//! Finds circles of imports between the modules of a crate. Modules side by side are compared, each with all that lies
//! below it; a module and its own parts may know each other.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Result, ensure};

use crate::Member;
use crate::files::{files_of_ours, read};

/// Circles, one sentence each.
pub fn check(members: &[Member]) -> Result<Vec<String>> {
    let mut circles = BTreeSet::new();
    let mut modules = 0;
    for member in members {
        let source = member.folder.join("src");
        let mut room = Room::default();
        for file in files_of_ours(&source, &["rs"])? {
            let (shown, text) = read(&source, &file)?;
            room.add(module_path(Path::new(&shown)), &text);
        }
        modules += room.modules.len();
        circles.extend(
            room.circles()
                .iter()
                .map(|circle| format!("{}: {circle}", member.name)),
        );
    }
    ensure!(members.len() < modules, "no crate has more than one module");
    let sentence = |circle: String| format!("{circle} import each other");
    Ok(circles.into_iter().map(sentence).collect())
}

type ModulePath = Vec<String>;

/// The modules of a crate by their paths, each with the paths that it names and the names that it imports.
#[derive(Default)]
struct Room {
    modules: BTreeMap<ModulePath, Vec<ModulePath>>,
}

impl Room {
    fn add(&mut self, module: ModulePath, source: &str) {
        let named = named_paths(&module, source);
        self.modules.insert(module, named);
    }

    /// Modules side by side that know each other, directly or by way of others beside them, largest groups only.
    fn circles(&self) -> BTreeSet<String> {
        let mut knows: BTreeMap<ModulePath, BTreeSet<ModulePath>> = BTreeMap::new();
        for (module, named) in &self.modules {
            for target in named.iter().map(|path| self.resolve(path, 0)) {
                let common = module
                    .iter()
                    .zip(&target)
                    .take_while(|(a, b)| a == b)
                    .count();
                if common < module.len() && common < target.len() {
                    let known = knows.entry(module[..=common].to_vec()).or_default();
                    known.insert(target[..=common].to_vec());
                }
            }
        }
        let know_each_other =
            |a: &ModulePath, b: &ModulePath| reaches(&knows, a, b) && reaches(&knows, b, a);
        let circle = |module: &ModulePath| {
            let members = knows.keys().filter(|other| know_each_other(module, other));
            members.map(|member| member.join("::")).collect::<Vec<_>>()
        };
        let circles = knows.keys().map(circle).filter(|circle| 1 < circle.len());
        circles.map(|circle| circle.join(", ")).collect()
    }

    /// The module that holds what a path names: as far as there are modules, and further where one imports the next
    /// name.
    fn resolve(&self, path: &[String], depth: usize) -> ModulePath {
        let mut at = ModulePath::new();
        for (index, name) in path.iter().enumerate() {
            let mut next = at.clone();
            next.push(name.clone());
            if self.modules.contains_key(&next) {
                at = next;
                continue;
            }
            let imported = self.modules.get(&at).into_iter().flatten();
            let mut imported =
                imported.filter(|import| import.last() == Some(name) && *import != path);
            return match imported.next() {
                Some(import) if depth < 8 => {
                    let further = [import.as_slice(), &path[index + 1..]].concat();
                    self.resolve(&further, depth + 1)
                }
                _ => at,
            };
        }
        at
    }
}

fn reaches(
    knows: &BTreeMap<ModulePath, BTreeSet<ModulePath>>,
    from: &ModulePath,
    to: &ModulePath,
) -> bool {
    let (mut seen, mut left) = (BTreeSet::new(), vec![from]);
    while let Some(module) = left.pop() {
        if module == to {
            return true;
        }
        if seen.insert(module) {
            left.extend(knows.get(module).into_iter().flatten());
        }
    }
    false
}

/// `a/mod.rs` and `a.rs` are the module `a`; `lib.rs` and `main.rs` are the crate itself.
fn module_path(file: &Path) -> ModulePath {
    let parts = file.with_extension("");
    let parts = parts.iter().map(|part| part.to_string_lossy().into_owned());
    parts
        .filter(|part| !["mod", "lib", "main"].contains(&part.as_str()))
        .collect()
}

/// The paths from the crate's root that a module's code names, in imports and elsewhere. Its tests, which come last,
/// may know more.
fn named_paths(module: &[String], source: &str) -> Vec<ModulePath> {
    let code: Vec<&str> = source
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect();
    let code = code.join("\n");
    let code = code.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    let mut found = Vec::new();
    for (root, base) in [
        ("crate::", Vec::new()),
        ("self::", module.to_vec()),
        ("super::", module[..module.len().saturating_sub(1)].to_vec()),
        ("use ", module.to_vec()),
    ] {
        for (at, _) in code.match_indices(root) {
            let before = code[..at].chars().next_back();
            if !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
                expand(&code[at + root.len()..], base.clone(), &mut found);
            }
        }
    }
    found
}

/// Adds the paths that begin with `base` and go on as `rest` says, a brace for each of its members. Returns what
/// follows.
fn expand<'a>(rest: &'a str, mut base: ModulePath, found: &mut Vec<ModulePath>) -> &'a str {
    let mut rest = rest.trim_start();
    if let Some(inside) = rest.strip_prefix('{') {
        rest = inside;
        loop {
            rest = expand(rest, base.clone(), found).trim_start();
            let Some(next) = rest.strip_prefix(',') else {
                return rest.strip_prefix('}').unwrap_or(rest);
            };
            rest = next;
        }
    }
    let end = rest
        .find(|c: char| !(c.is_alphanumeric() || c == '_'))
        .unwrap_or(rest.len());
    let (name, after) = rest.split_at(end);
    match name {
        "super" => drop(base.pop()),
        "self" | "" => {}
        name => base.push(name.to_owned()),
    }
    match after.strip_prefix("::") {
        Some(further) if !name.is_empty() => expand(further, base, found),
        _ => {
            found.push(base);
            after
                .split_at(after.find([',', '}', ';', '(', ')']).unwrap_or(0))
                .1
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The circles among files that stand as `a.rs: use crate::b; | b/mod.rs: mod c; | b/c.rs:`.
    fn circles(files: &str) -> String {
        let mut room = Room::default();
        for (file, source) in files.split(" | ").filter_map(|file| file.split_once(": ")) {
            room.add(module_path(Path::new(file)), source);
        }
        let circles: Vec<String> = room.circles().into_iter().collect();
        circles.join("; ")
    }

    #[test]
    fn a_circle_is_found_however_it_is_written() {
        for (files, wrong) in [
            (
                "a.rs: use crate::b::B; | b/mod.rs: use crate::a::A;",
                "a, b",
            ),
            (
                "a.rs: use crate::{c, b::{self, B}}; | b.rs: fn f(a: super::a::A) {}",
                "a, b",
            ),
            (
                "lib.rs: pub use a::A; | a.rs: use crate::b::B; | b.rs: use crate::A;",
                "a, b",
            ),
            (
                "a.rs: use crate::b; | b.rs: use self::c::C; | b/c.rs: use super::C;",
                "",
            ),
            ("a.rs: use crate::b; | b.rs: // as crate::a::A does", ""),
            (
                "a.rs: use crate::b; | b.rs: #[cfg(test)]\nmod tests { use crate::a::A; }",
                "",
            ),
            ("a.rs: use other_crate::b::B; | b.rs: use crate::a::A;", ""),
        ] {
            assert_eq!(circles(files), wrong, "{files}");
        }
    }

    #[test]
    fn a_circle_may_go_by_way_of_others_and_lie_below() {
        let files = "a.rs: use crate::b::x::X; | b/x.rs: use crate::c; | c.rs: use crate::a; | b.rs: mod x;";
        assert_eq!(circles(files), "a, b, c");
        let files =
            "m/mod.rs: use self::p::P; | m/p.rs: use super::q::Q; | m/q.rs: use super::{p, M};";
        assert_eq!(circles(files), "m::p, m::q");
    }

    #[test]
    fn a_module_and_its_own_parts_may_know_each_other() {
        let files = "lib.rs: use crate::a::A; | a/mod.rs: use self::b::B; | a/b.rs: use super::A;";
        assert_eq!(circles(files), "");
    }
}
