//! The tools that must be there before work starts, and what to do when one is not.

use std::fmt;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use crate::process::{Interrupt, command, run};
use crate::workspace::root;

/// The target of a browser.
pub(crate) const WASM: &str = "wasm32-unknown-unknown";

/// Where the browser test looks for Debian's package.
const CHROMIUM: &str = "/usr/bin/chromium";

/// A version of up to three numbers; what is left out is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Version([u32; 3]);

impl Version {
    /// Reads the first thing that looks like a version: `v20.19.1`, `11.2`, `>=20.19`.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let start = text.find(|c: char| c.is_ascii_digit())?;
        let digits = text[start..]
            .split(|c: char| c != '.' && !c.is_ascii_digit())
            .next()?;
        let mut numbers = [0; 3];
        for (number, part) in numbers.iter_mut().zip(digits.split('.')) {
            if !part.is_empty() {
                *number = part.parse().ok()?;
            }
        }
        Some(Self(numbers))
    }
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [major, minor, patch] = self.0;
        write!(f, "{major}.{minor}.{patch}")
    }
}

/// Checks that Node.js is as new as the dashboard's package.json asks for, and that npm is there.
pub(crate) fn require_node() -> Result<()> {
    let wanted = wanted_node()?;
    let advice = format!(
        "install Node.js {wanted} or newer with npm (from nodejs.org, or from your system's packages where they are new enough)"
    );
    let Some(said) = answer(command("node").arg("--version")) else {
        bail!("node is missing, and the dashboard is built with it: {advice}");
    };
    let found = Version::parse(&said)
        .with_context(|| format!("node --version answered {said:?}, which is no version"))?;
    if found < wanted {
        bail!("node {found} is too old to build the dashboard: {advice}");
    }
    if answer(command("npm").arg("--version")).is_none() {
        bail!("node {found} is there but npm is not: {advice}");
    }
    Ok(())
}

/// The oldest Node.js the dashboard builds with, from its own package.json.
pub(crate) fn wanted_node() -> Result<Version> {
    let path = root().join("client-web/package.json");
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("{} cannot be read", path.display()))?;
    let manifest: Manifest = serde_json::from_str(&text)
        .with_context(|| format!("{} names no engines.node", path.display()))?;
    Version::parse(&manifest.engines.node)
        .with_context(|| format!("{}: engines.node is no version", path.display()))
}

/// Adds the Rust target that the pure crates are checked for.
pub(crate) fn install_wasm_target(interrupt: &Interrupt) -> Result<()> {
    let libraries = answer(command("rustc").args(["--print", "target-libdir", "--target", WASM]))
        .with_context(|| format!("this rustc does not know {WASM}"))?;
    if Path::new(&libraries).exists() {
        return Ok(());
    }
    run(command("rustup").args(["target", "add", WASM]), interrupt)
        .with_context(|| format!("the Rust target {WASM} is missing and rustup could not add it"))
}

/// Installs the browser that the dashboard is tested in, where that is ours to do.
pub(crate) fn install_chromium(interrupt: &Interrupt) -> Result<()> {
    if Path::new(CHROMIUM).exists() {
        return Ok(());
    }
    // Without a font the page has no words to look at, and Debian only recommends one.
    install_packages(&["chromium", "fonts-liberation"], interrupt)
        .with_context(|| format!("{CHROMIUM} is missing"))
}

/// Installs packages of the system, where that is ours to do.
pub(crate) fn install_packages(names: &[&str], interrupt: &Interrupt) -> Result<()> {
    let is_root = answer(command("id").arg("-u")).as_deref() == Some("0");
    if !is_root || answer(command("apt-get").arg("--version")).is_none() {
        bail!(
            "on Debian or Ubuntu, as root: apt-get install {}",
            names.join(" ")
        );
    }
    run(command("apt-get").args(["update", "--quiet"]), interrupt)?;
    run(
        command("apt-get")
            .args(["install", "--yes", "--quiet", "--no-install-recommends"])
            .args(names)
            .env("DEBIAN_FRONTEND", "noninteractive"),
        interrupt,
    )
}

/// What a command prints, when it can be started and succeeds.
pub(crate) fn answer(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    output.status.success().then_some(text)
}

#[derive(Deserialize)]
struct Manifest {
    engines: Engines,
}

#[derive(Deserialize)]
struct Engines {
    node: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_compared_as_numbers() {
        let version = |text| Version::parse(text).unwrap();
        assert!(version("v9.11.2") < version("v20.2.0"));
        assert!(version("20.9") < version(">=20.19"));
        assert_eq!(version("v20.19.0\n"), version("20.19"));
        assert_eq!(version("11").to_string(), "11.0.0");
        assert_eq!(Version::parse("no version at all"), None);
    }

    #[test]
    fn the_dashboard_says_which_node_it_needs() {
        assert!(Version::parse("20").unwrap() <= wanted_node().unwrap());
    }
}
