//! The tools that must be there before work starts, and what to do when one is not.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::process::{answer, command, run};
use crate::workspace::root;

/// The target of a browser.
pub(crate) const WASM: &str = "wasm32-unknown-unknown";

/// Where the browser test looks for Debian's package.
const CHROMIUM: &str = "/usr/bin/chromium";

/// Checks that Node.js is as new as the dashboard's package.json asks for, and that npm is there.
pub(crate) fn require_node() -> Result<()> {
    let wanted = wanted_node()?;
    let advice = format!(
        "install Node.js {wanted} or newer with npm (from nodejs.org, or from your system's packages where they are new enough)"
    );
    let said = answer(command("node").arg("--version"));
    let said = said.with_context(|| {
        format!("node is missing, and the dashboard is built with it: {advice}")
    })?;
    ensure!(
        version(&wanted) <= version(&said),
        "node {said} is too old to build the dashboard: {advice}"
    );
    let npm = answer(command("npm").arg("--version"));
    ensure!(
        npm.is_some(),
        "node {said} is there but npm is not: {advice}"
    );
    Ok(())
}

/// The oldest Node.js the dashboard builds with, from its own package.json.
pub(crate) fn wanted_node() -> Result<String> {
    let path = root().join("client-web/package.json");
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("{} cannot be read", path.display()))?;
    let manifest: Value =
        serde_json::from_str(&text).with_context(|| format!("{} is no JSON", path.display()))?;
    let wanted = manifest["engines"]["node"].as_str();
    let wanted = wanted.with_context(|| format!("{} names no engines.node", path.display()))?;
    Ok(wanted
        .trim_start_matches(|c: char| !c.is_ascii_digit())
        .to_owned())
}

/// The numbers of the first thing that looks like a version, to be compared: `v20.19.1`, `11.2`, `>=20.19`.
pub(crate) fn version(text: &str) -> Vec<u32> {
    let start = text
        .find(|c: char| c.is_ascii_digit())
        .unwrap_or(text.len());
    let numbers = text[start..]
        .split(|c: char| c != '.' && !c.is_ascii_digit())
        .next();
    numbers
        .unwrap_or_default()
        .split('.')
        .map_while(|number| number.parse().ok())
        .collect()
}

/// Adds the Rust target that the pure crates are checked for.
pub(crate) fn install_wasm_target() -> Result<()> {
    let libraries = answer(command("rustc").args(["--print", "target-libdir", "--target", WASM]))
        .with_context(|| format!("this rustc does not know {WASM}"))?;
    if Path::new(&libraries).exists() {
        return Ok(());
    }
    run(command("rustup").args(["target", "add", WASM]))
        .with_context(|| format!("the Rust target {WASM} is missing and rustup could not add it"))
}

/// Installs the browser that the dashboard is tested in, where that is ours to do.
pub(crate) fn install_chromium() -> Result<()> {
    if Path::new(CHROMIUM).exists() {
        return Ok(());
    }
    // Without a font the page has no words to look at, and Debian only recommends one.
    install_packages(&["chromium", "fonts-liberation"])
        .with_context(|| format!("{CHROMIUM} is missing"))
}

/// Installs packages of the system, where that is ours to do.
pub(crate) fn install_packages(names: &[&str]) -> Result<()> {
    let is_root = answer(command("id").arg("-u")).as_deref() == Some("0");
    if !is_root || answer(command("apt-get").arg("--version")).is_none() {
        bail!(
            "on Debian or Ubuntu, as root: apt-get install {}",
            names.join(" ")
        );
    }
    run(command("apt-get").args(["update", "--quiet"]))?;
    run(command("apt-get")
        .args(["install", "--yes", "--quiet", "--no-install-recommends"])
        .args(names)
        .env("DEBIAN_FRONTEND", "noninteractive"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_compared_as_numbers() {
        assert!(version("v9.11.2") < version("v20.2.0"));
        assert!(version("20.9") < version(">=20.19"));
        assert!(version("20.19") <= version("v20.19.0\n"));
        assert_eq!(version("rust:1.95.0-slim"), [1, 95, 0]);
        assert!(version("no version at all").is_empty());
    }

    #[test]
    fn the_dashboard_says_which_node_it_needs() {
        assert!(version("20") <= version(&wanted_node().unwrap()));
    }
}
