//! The Python that other people's mathematics and linters run in: a virtual environment under target/.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::process::{answer, command, run, run_quietly};
use crate::tools::install_packages;
use crate::workspace::{root, target};

/// Makes the environment and installs what tests/python/requirements.txt pins; does nothing where that was done before.
pub(crate) fn install() -> Result<()> {
    let wanted = root().join("tests/python/requirements.txt");
    let text = fs::read_to_string(&wanted)
        .with_context(|| format!("{} cannot be read", wanted.display()))?;
    // Written last, so that what was broken off is done again.
    let stamp = folder().join("installed.txt");
    if fs::read_to_string(&stamp).is_ok_and(|installed| installed == text) {
        return Ok(());
    }
    ensure!(
        answer(command("python3").arg("--version")).is_some(),
        "python3 is missing, and independent mathematics is asked in it: install Python 3.11 or newer with venv"
    );
    // Debian ships venv without the part that puts pip into an environment.
    if answer(command("python3").args(["-c", "import ensurepip, venv"])).is_none() {
        install_packages(&["python3-venv"]).context("python3 cannot make virtual environments")?;
    }
    run(command("python3")
        .args(["-m", "venv", "--clear"])
        .arg(folder()))?;
    let mut pip = script("python");
    pip.args(["-m", "pip", "install", "--disable-pip-version-check", "-r"])
        .arg(&wanted);
    run_quietly(
        pip,
        "installing what the checks in Python need",
        &folder().join("pip.log"),
    )?;
    fs::write(&stamp, text).with_context(|| format!("{} cannot be written", stamp.display()))
}

/// A program of the environment: the interpreter, or what a package brought.
pub(crate) fn script(name: &str) -> Command {
    command(folder().join("bin").join(name))
}

fn folder() -> PathBuf {
    target().join("python")
}
