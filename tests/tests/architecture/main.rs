//! The rules that keep the rooms apart. Each is told in ARCHITECTURE.md; here it fails when it is broken.

mod dependencies;
mod rooms;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use rooms::USES;

/// Rooms that may use every other: they are there to look at the whole.
const SEE_EVERYTHING: [&str; 4] = [
    "teleclay-tests",
    "teleclay-golden",
    "teleclay-figures",
    "xtask",
];

/// Where code knows no clock, thread, file, socket or global chance.
const PURE: [&str; 5] = [
    "crates",
    "proto",
    "channel/seal",
    "client-web/wasm",
    "client-web/hand",
];

/// Mathematics, matter, and what else the dashboard's module is made of: they bring nothing along that knows JSON.
const WITHOUT_SERDE: [&str; 5] = ["control", "kinematics", "clay", "wire", "page"];

/// Packages that open sockets, start threads or ask the operating system for chance.
#[rustfmt::skip]
const IMPURE_PACKAGES: [&str; 12] = [
    "async-std", "axum", "getrandom", "hyper", "mio", "reqwest", "smol", "socket2", "tokio", "tungstenite", "ureq",
    "zenoh",
];

/// What pure code has no business with: clocks, threads, files, sockets, processes, chance.
const IMPURE_WORDS: [&str; 12] = [
    "Instant::now",
    "SystemTime",
    "thread::spawn",
    "thread::sleep",
    "std::net",
    "std::fs",
    "std::process",
    "std::env",
    "std::thread",
    "thread_rng",
    "rand::rng",
    "getrandom",
];

/// The same, where a brace gathers several names of std: `use std::{fmt, fs}`.
const IMPURE_MODULES: [&str; 5] = ["env", "fs", "net", "process", "thread"];

#[test]
fn each_room_uses_exactly_the_rooms_that_the_map_says_and_all_of_them_stand_above_it() {
    let metadata = metadata(&["--no-deps"]);
    let mut used: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for package in list(&metadata["packages"]) {
        let name = text(&package["name"]);
        if SEE_EVERYTHING.contains(&name) {
            continue;
        }
        // Tests of a room count, too: what only tests know today, the room knows tomorrow.
        let others = list(&package["dependencies"])
            .iter()
            .filter_map(|dependency| text(&dependency["name"]).strip_prefix("teleclay-"));
        used.insert(
            name.strip_prefix("teleclay-").unwrap_or(name),
            others.collect(),
        );
    }
    let said: BTreeMap<&str, BTreeSet<&str>> = USES
        .iter()
        .map(|(room, others)| (*room, others.iter().copied().collect()))
        .collect();
    assert_eq!(used, said, "left is what is, right is what this test says");
    for (index, (room, others)) in USES.iter().enumerate() {
        for other in *others {
            let above = USES[..index].iter().any(|(above, _)| above == other);
            assert!(above, "{room} uses {other}, which does not stand above it");
        }
    }
}

#[test]
fn mathematics_and_matter_do_not_know_json() {
    let metadata = metadata(&["--no-deps"]);
    for room in WITHOUT_SERDE {
        let package = member(&metadata, room);
        for dependency in list(&package["dependencies"]) {
            let name = text(&dependency["name"]);
            let is_for_tests = dependency["kind"] == "dev";
            assert!(
                is_for_tests || !name.starts_with("serde"),
                "{room} uses {name}"
            );
        }
    }
}

#[test]
fn nothing_below_a_pure_crate_opens_a_socket_or_starts_a_thread() {
    let metadata = metadata(&["--filter-platform", &host()]);
    let names: BTreeMap<&str, &str> = list(&metadata["packages"])
        .iter()
        .map(|package| (text(&package["id"]), text(&package["name"])))
        .collect();
    for package in pure_members(&metadata) {
        let tree = tree_of(&metadata, text(&package["id"]));
        let found: Vec<&str> = tree
            .iter()
            .map(|id| names[id])
            .filter(|name| is_impure(name))
            .collect();
        assert!(
            found.is_empty(),
            "{} brings {found:?}",
            text(&package["name"])
        );
    }
    // The same walk from the server must find what it is blind to above, or it looks at nothing.
    let tree = tree_of(&metadata, text(&member(&metadata, "server")["id"]));
    assert!(
        tree.iter().any(|id| is_impure(names[id])),
        "the walk finds no zenoh in the server"
    );
}

#[test]
fn pure_code_asks_no_clock_starts_no_thread_and_touches_no_file() {
    let metadata = metadata(&["--no-deps"]);
    let mut wrong = Vec::new();
    for package in pure_members(&metadata) {
        let folder = Path::new(text(&package["manifest_path"]))
            .parent()
            .unwrap()
            .join("src");
        for file in rust_files(&folder) {
            let source = fs::read_to_string(&file).unwrap();
            wrong.extend(
                impurities(&source)
                    .iter()
                    .map(|word| format!("{}: {word}", file.display())),
            );
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_search_for_impurities_finds_them_and_leaves_tests_and_comments_alone() {
    let found = |source: &str| impurities(source).join(" ");
    assert_eq!(found("let t = std::time::Instant::now();"), "Instant::now");
    assert_eq!(found("use std::fs;"), "std::fs");
    assert_eq!(
        found("use std::{\n    fmt,\n    fs::File,\n};"),
        "std::{fs}"
    );
    assert_eq!(
        found("use std::{collections::{BTreeMap}, thread};"),
        "std::{thread}"
    );
    assert_eq!(found("fn f() { /* never std::net */ } // SystemTime"), "");
    assert_eq!(found("/// Not like `Instant::now`.\nfn f() {}"), "");
    assert_eq!(found("use std::{fmt, ops};\nlet envelope = 1;"), "");
    let only_tests = "fn f() {}\n#[cfg(test)]\nmod tests { use std::fs; }";
    assert_eq!(found(only_tests), "");
    assert_eq!(
        found("#[cfg(test)]\nuse std::fs;\nfn f() { std::net::x(); }"),
        "std::net"
    );
}

/// A feature that only tests switch on makes cargo build all below it twice; for zenoh that is minutes.
#[test]
fn builds_and_tests_share_one_feature_set() {
    let build = features("normal,build");
    let test = features("normal,build,dev");
    let differing: Vec<String> = build
        .iter()
        .filter(|(package, features)| test.get(*package) != Some(features))
        .map(|(package, features)| {
            format!(
                "{package}: {features:?} in builds, {:?} in tests",
                test.get(package)
            )
        })
        .collect();
    assert!(differing.is_empty(), "{}", differing.join("\n"));
    let has_zenoh = build.keys().any(|package| package.starts_with("zenoh v"));
    assert!(has_zenoh, "zenoh is not in the tree");
}

/// Each equation has its place, and the pages of the theory name it.
#[test]
fn what_the_pages_of_the_theory_name_is_there() {
    let folder = root().join("docs/theory");
    let code = code_of_all_rooms();
    let (mut names, mut wrong) = (0, Vec::new());
    for entry in fs::read_dir(&folder).unwrap() {
        let page = entry.unwrap().path();
        for line in fs::read_to_string(&page).unwrap().lines() {
            let linked: Vec<String> = links_to_code(line)
                .map(|link| fs::read_to_string(folder.join(link)).unwrap_or_default())
                .collect();
            let places = if linked.is_empty() { &code } else { &linked };
            for name in names_of_code(line) {
                names += 1;
                // A test may stand elsewhere than what it tests.
                let is_there = places.iter().any(|source| defines(source, name))
                    || (is_test(name) && code.iter().any(|source| defines(source, name)));
                if !is_there {
                    wrong.push(format!("{}: `{name}`", page.display()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(50 < names, "the pages name only {names} things");
}

#[test]
fn a_name_that_is_not_there_is_noticed() {
    let source = "impl Inverse {\n    pub fn step(&self) {}\n}\nstruct Reach;\nfn the_rods_close() {}\nfn g_hx() {}";
    for there in ["Inverse::step", "Reach", "the_rods_close", "g_hx"] {
        assert!(defines(source, there), "{there}");
    }
    for missing in [
        "Inverse::inverse",
        "Forward::step",
        "Follower",
        "the_rods_open",
        "g_hy",
    ] {
        assert!(!defines(source, missing), "{missing}");
    }
    let line = "| (6) | `R_j cos rho_j` in [a.rs](../b/a.rs), `Reach`, `Inverse::step`; `the_rods_close` with `G_h`, `g_hx` |";
    assert_eq!(
        names_of_code(line),
        ["Reach", "Inverse::step", "the_rods_close", "g_hx"]
    );
    assert_eq!(links_to_code(line).collect::<Vec<_>>(), ["../b/a.rs"]);
}

/// Sources and tests of every room.
fn code_of_all_rooms() -> Vec<String> {
    let rooms = fs::read_dir(root().join("crates")).unwrap();
    let crates = rooms.map(|entry| entry.unwrap().path());
    let others = ["proto", "server", "handle", "tests"].map(|room| root().join(room));
    crates
        .chain(others)
        .flat_map(|room| ["src", "tests"].map(|part| room.join(part)))
        .filter(|folder| folder.is_dir())
        .flat_map(|folder| rust_files(&folder))
        .map(|file| fs::read_to_string(file).unwrap())
        .collect()
}

fn links_to_code(line: &str) -> impl Iterator<Item = &str> {
    line.split("](")
        .skip(1)
        .filter_map(|rest| rest.split(')').next())
        .filter(|link| link.ends_with(".rs"))
}

/// What between backticks reads as a name of the code: a type, a type's function, a test; after a link also a function.
fn names_of_code(line: &str) -> Vec<&str> {
    let link_ends = line.find(".rs)").unwrap_or(line.len());
    let mut names = Vec::new();
    let mut at = 0;
    for (index, span) in line.split('`').enumerate() {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "_:".contains(c);
        if index % 2 == 1 && span.chars().all(is_plain) {
            let is_upper = span.starts_with(|c: char| c.is_ascii_uppercase());
            let lower = span.chars().filter(char::is_ascii_lowercase).count();
            let is_type = is_upper && 1 < lower && !span.contains('_');
            let is_function = !is_upper && link_ends < at && 3 < span.len();
            if span.contains("::") || is_type || is_function || is_test(span) {
                names.push(span);
            }
        }
        at += span.len() + 1;
    }
    names
}

/// Tests are named by sentences.
fn is_test(name: &str) -> bool {
    3 < name.split('_').count() && name.starts_with(|c: char| c.is_ascii_lowercase())
}

/// Whether a source has the definition of a name: `Type::function` in one place with the type, or as a field of it.
fn defines(source: &str, name: &str) -> bool {
    let has_word = |word: &str| {
        let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
        source.match_indices(word).any(|(at, _)| {
            !source[..at].ends_with(is_part) && !source[at + word.len()..].starts_with(is_part)
        })
    };
    let is_function = |name: &str| has_word(&format!("fn {name}"));
    match name.split_once("::") {
        Some((kind, part)) => {
            has_word(kind) && (is_function(part) || source.contains(&format!("pub {part}:")))
        }
        None if name.starts_with(|c: char| c.is_ascii_uppercase()) => ["struct", "enum", "trait"]
            .iter()
            .any(|word| has_word(&format!("{word} {name}"))),
        None => is_function(name),
    }
}

fn is_impure(package: &str) -> bool {
    IMPURE_PACKAGES.contains(&package) || package.starts_with("zenoh-")
}

/// Everything that `source` may not say, outside comments and tests.
fn impurities(source: &str) -> Vec<String> {
    let code = without_tests(&without_comments(source));
    let code: String = code.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut found: Vec<String> = IMPURE_WORDS
        .iter()
        .filter(|word| code.contains(**word))
        .map(|word| (*word).to_owned())
        .collect();
    for (start, _) in code.match_indices("std::{") {
        for name in top_level_names(&code[start + "std::{".len()..]) {
            if IMPURE_MODULES.contains(&name) {
                found.push(format!("std::{{{name}}}"));
            }
        }
    }
    found
}

/// The first names of a brace's members: `fs` of `fs::File, fmt::{self, Debug}}`.
fn top_level_names(rest: &str) -> Vec<&str> {
    let mut depth = 0;
    let mut names = Vec::new();
    let mut start = 0;
    for (index, c) in rest.char_indices() {
        match c {
            '{' => depth += 1,
            ',' if depth == 0 => {
                names.push(&rest[start..index]);
                start = index + 1;
            }
            '}' if depth == 0 => {
                names.push(&rest[start..index]);
                break;
            }
            '}' => depth -= 1,
            _ => {}
        }
    }
    names
        .into_iter()
        .map(|name| name.trim().split("::").next().unwrap_or(name))
        .collect()
}

fn without_comments(source: &str) -> String {
    let mut code = String::new();
    let mut rest = source;
    while let Some(at) = rest.find("//").into_iter().chain(rest.find("/*")).min() {
        code.push_str(&rest[..at]);
        let end = if rest[at..].starts_with("//") {
            "\n"
        } else {
            "*/"
        };
        let skipped = rest[at..]
            .find(end)
            .map_or(rest.len(), |length| at + length);
        rest = rest[skipped..]
            .strip_prefix("*/")
            .unwrap_or(&rest[skipped..]);
    }
    code + rest
}

/// The source without each item that is compiled for tests alone, whether a module or a single `use`.
fn without_tests(code: &str) -> String {
    const MARK: &str = "#[cfg(test)]";
    let Some((before, item)) = code.split_once(MARK) else {
        return code.to_owned();
    };
    let mut depth = 0;
    for (index, c) in item.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 && matches!(c, '}' | ';') {
            return before.to_owned() + &without_tests(&item[index + 1..]);
        }
    }
    before.to_owned()
}

/// Every package that is compiled for this one. What only tests use is left out.
fn tree_of<'a>(metadata: &'a Value, root: &'a str) -> BTreeSet<&'a str> {
    let nodes: BTreeMap<&str, &Value> = list(&metadata["resolve"]["nodes"])
        .iter()
        .map(|node| (text(&node["id"]), node))
        .collect();
    let mut tree = BTreeSet::new();
    let mut left = vec![root];
    while let Some(id) = left.pop() {
        if !tree.insert(id) {
            continue;
        }
        for dependency in list(&nodes[id]["deps"]) {
            let is_for_tests = list(&dependency["dep_kinds"])
                .iter()
                .all(|kind| kind["kind"] == "dev");
            if !is_for_tests {
                left.push(text(&dependency["pkg"]));
            }
        }
    }
    tree
}

/// The features of each package in the workspace's tree, all sets of them where it is built more than once.
fn features(edges: &str) -> BTreeMap<String, BTreeSet<String>> {
    let arguments = [
        "tree",
        "--workspace",
        "--locked",
        "--edges",
        edges,
        "--prefix",
        "none",
        "--format",
        "{p}|{f}",
    ];
    let mut features: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for line in answer("cargo", &arguments)
        .lines()
        .filter(|line| !line.is_empty())
    {
        let line = line.trim_end_matches(" (*)");
        let (package, set) = line.split_once('|').unwrap();
        features
            .entry(package.to_owned())
            .or_default()
            .insert(set.to_owned());
    }
    features
}

fn pure_members(metadata: &Value) -> Vec<&Value> {
    let is_pure = |package: &&Value| {
        let folder = Path::new(text(&package["manifest_path"])).parent().unwrap();
        let place = folder.strip_prefix(root()).unwrap_or(folder);
        package["source"].is_null() && (PURE.iter().any(|folder| place.starts_with(folder)))
    };
    let pure: Vec<&Value> = list(&metadata["packages"]).iter().filter(is_pure).collect();
    assert!(6 < pure.len(), "{PURE:?} are not where this test looks");
    pure
}

fn member<'a>(metadata: &'a Value, room: &str) -> &'a Value {
    let name = format!("teleclay-{room}");
    list(&metadata["packages"])
        .iter()
        .find(|package| package["name"] == *name)
        .unwrap_or_else(|| panic!("there is no {name}"))
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

fn metadata(arguments: &[&str]) -> Value {
    let arguments = [
        &["metadata", "--format-version", "1", "--locked"],
        arguments,
    ]
    .concat();
    serde_json::from_str(&answer("cargo", &arguments)).unwrap()
}

fn host() -> String {
    let version = answer("rustc", &["-vV"]);
    version
        .lines()
        .find_map(|line| line.strip_prefix("host: "))
        .unwrap()
        .to_owned()
}

fn answer(program: &str, arguments: &[&str]) -> String {
    answer_in(".", program, arguments)
}

fn answer_in(folder: &str, program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(root().join(folder))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{program} {arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}
