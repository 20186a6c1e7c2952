//! Whose code is built in: under which licences, from where, and what is kept out.
//!
//! Known weaknesses of packages are not looked up here: a list of them has to come over a network, and changes without
//! this project. CONTRIBUTING.md says what to run for that.

use std::collections::BTreeSet;
use std::fs;

use serde_json::Value;
use spdx::{Expression, LicenseItem, ParseMode};

use super::{answer_in, root};

/// Licences under which code may be built into the programs: none of them asks anything of what stands beside it. The
/// MPL asks for the changes of its own files, and nothing is changed in them.
const ALLOWED: [&str; 12] = [
    "0BSD",
    "Apache-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "CC0-1.0",
    "CDLA-Permissive-2.0",
    "ISC",
    "MIT",
    "MPL-2.0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
];

/// What is not to be built in. One provider of cryptography, since two in a process each take themselves for the
/// default; and none that needs a library of the system.
const BANNED: [&str; 5] = [
    "aws-lc-rs",
    "aws-lc-sys",
    "native-tls",
    "openssl",
    "openssl-sys",
];

/// Of these there may be one version: a second one would be another type by the same name, or another state.
const ONCE: [&str; 10] = [
    "axum",
    "mcap",
    "nalgebra",
    "ring",
    "rustls",
    "serde",
    "serde_json",
    "tokio",
    "tracing",
    "zenoh",
];

/// Workspaces with a lockfile of their own.
const WORKSPACES: [&str; 2] = [".", "python"];

fn packages() -> Vec<Value> {
    let mut all = Vec::new();
    for workspace in WORKSPACES {
        let arguments = ["metadata", "--format-version", "1", "--locked"];
        let told: Value = serde_json::from_str(&answer_in(workspace, "cargo", &arguments)).unwrap();
        let packages = told["packages"].as_array().unwrap();
        assert!(
            100 < packages.len(),
            "{workspace}: {} packages",
            packages.len()
        );
        all.extend(packages.iter().cloned());
    }
    all
}

fn is_allowed(licence: &str) -> bool {
    // As older packages write it: a slash for `OR`.
    let expression = Expression::parse_mode(licence.trim(), ParseMode::LAX).unwrap();
    expression.evaluate(|required| match &required.license {
        LicenseItem::Spdx { id, .. } => ALLOWED.contains(&id.name),
        LicenseItem::Other { .. } => false,
    })
}

#[test]
fn every_package_that_is_built_in_has_a_licence_that_allows_it() {
    for package in packages() {
        let name = package["name"].as_str().unwrap();
        let licence = package["license"].as_str();
        assert!(
            licence.is_some_and(is_allowed),
            "{name} is under {licence:?}"
        );
    }
    // The same of what a browser is given.
    let lock = fs::read_to_string(root().join("client-web/package-lock.json")).unwrap();
    let lock: Value = serde_json::from_str(&lock).unwrap();
    let mut shipped = 0;
    for (path, package) in lock["packages"].as_object().unwrap() {
        if path.is_empty() || package["dev"] == true {
            continue;
        }
        shipped += 1;
        let licence = package["license"].as_str();
        assert!(
            licence.is_some_and(is_allowed),
            "{path} is under {licence:?}"
        );
    }
    assert!(
        5 <= shipped,
        "only {shipped} packages for the browser were found"
    );
}

#[test]
fn a_licence_that_asks_for_more_is_noticed() {
    for licence in [
        "GPL-3.0-only",
        "MIT AND AGPL-3.0-only",
        "LGPL-2.1-or-later",
        "EPL-2.0",
    ] {
        assert!(!is_allowed(licence), "{licence}");
    }
    for licence in [
        "MIT/Apache-2.0",
        "EPL-2.0 OR Apache-2.0",
        "Apache-2.0 WITH LLVM-exception",
    ] {
        assert!(is_allowed(licence), "{licence}");
    }
}

#[test]
fn packages_come_from_the_registry_or_from_here_and_none_is_banned_or_there_twice() {
    for workspace in WORKSPACES {
        let lock = fs::read_to_string(root().join(workspace).join("Cargo.lock")).unwrap();
        let mut seen = BTreeSet::new();
        for package in lock.split("[[package]]").skip(1) {
            let field = |name: &str| {
                let mut lines = package.lines();
                let line = lines.find_map(|line| line.strip_prefix(name)?.strip_prefix(" = "));
                line.map(|value| value.trim_matches('"'))
            };
            let name = field("name").unwrap();
            let is_ours = name.starts_with("teleclay") || field("source").is_none();
            assert!(
                is_ours || field("source").is_some_and(|source| source.starts_with("registry+")),
                "{name} comes from {:?}",
                field("source")
            );
            assert!(
                is_ours || field("checksum").is_some(),
                "{name} has no checksum"
            );
            assert!(!BANNED.contains(&name), "{name} is in {workspace}");
            let is_new = seen.insert(name);
            assert!(
                is_new || !ONCE.contains(&name),
                "{name} is there twice in {workspace}"
            );
        }
    }
}
