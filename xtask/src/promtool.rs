//! Prometheus' own judge of figures, `promtool`, for the server's tests.
//!
//! Debian has it in one package with the Prometheus server, which would start to run here. So the package is only
//! unpacked, under target/, and all but `promtool` is thrown away again.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::process::{answer, command, run};
use crate::workspace::target;

/// The variable by which the server's tests find it.
pub(crate) const VARIABLE: &str = "TELECLAY_PROMTOOL";

/// Fetches it where it is missing and Debian's packages are at hand.
pub(crate) fn install() -> Result<()> {
    if program().is_some() {
        return Ok(());
    }
    let has = |name: &str| answer(command(name).arg("--version")).is_some();
    if !(has("apt-get") && has("dpkg-deb")) {
        println!(
            "promtool is not here, and cannot be fetched: install Prometheus to have figures judged by it"
        );
        return Ok(());
    }
    let folder = folder();
    let unpacked = folder.join("unpacked");
    fs::create_dir_all(&unpacked)
        .with_context(|| format!("{} cannot be made", unpacked.display()))?;
    if answer(command("id").arg("-u")).as_deref() == Some("0") {
        run(command("apt-get").args(["update", "--quiet"]))?;
    }
    let mut download = command("apt-get");
    download
        .current_dir(&unpacked)
        .args(["download", "--quiet", "prometheus"]);
    run(&mut download)?;
    let package = fs::read_dir(&unpacked)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .find(|path| path.extension().is_some_and(|kind| kind == "deb"))
        .context("apt-get downloaded no package")?;
    let mut unpack = command("dpkg-deb");
    unpack.arg("--extract").arg(&package).arg(&unpacked);
    run(&mut unpack)?;
    fs::rename(unpacked.join("usr/bin/promtool"), folder.join("promtool"))
        .context("Debian's package has no promtool")?;
    fs::remove_dir_all(&unpacked)
        .with_context(|| format!("{} cannot be removed", unpacked.display()))
}

/// Where it is: on the path, or under target/.
pub(crate) fn program() -> Option<PathBuf> {
    let fetched = folder().join("promtool");
    if answer(command("promtool").arg("--version")).is_some() {
        Some(Path::new("promtool").to_owned())
    } else {
        fetched.exists().then_some(fetched)
    }
}

fn folder() -> PathBuf {
    target().join("promtool")
}
