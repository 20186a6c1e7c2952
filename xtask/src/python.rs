//! The Python that the comparisons with other people's mathematics run in: a virtual environment under target/.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::process::{Interrupt, command, run, run_quietly};
use crate::tools::{answer, install_packages};
use crate::workspace::{Workspace, root};

/// Makes the environment and installs what tests/python/requirements.txt pins; does nothing where that was done before.
pub(crate) fn install(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    let folder = folder(workspace);
    let wanted = root().join("tests/python/requirements.txt");
    let wanted_text = fs::read_to_string(&wanted)
        .with_context(|| format!("{} cannot be read", wanted.display()))?;
    // Written last, so that what was broken off is done again.
    let stamp = folder.join("installed.txt");
    if fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted_text) {
        return Ok(());
    }
    make(&folder, interrupt)?;
    let mut pip = command(python(workspace));
    pip.args(["-m", "pip", "install", "--disable-pip-version-check", "-r"])
        .arg(&wanted);
    let log = folder.join("pip.log");
    run_quietly(
        pip,
        "installing what the comparisons in Python need",
        &log,
        interrupt,
    )?;
    fs::write(&stamp, wanted_text).with_context(|| format!("{} cannot be written", stamp.display()))
}

/// The interpreter of the environment.
pub(crate) fn python(workspace: &Workspace) -> PathBuf {
    folder(workspace).join("bin/python")
}

fn folder(workspace: &Workspace) -> PathBuf {
    workspace.target.join("python")
}

fn make(folder: &Path, interrupt: &Interrupt) -> Result<()> {
    if answer(command("python3").arg("--version")).is_none() {
        bail!(
            "python3 is missing, and independent mathematics is asked in it: install Python 3.11 or newer with venv"
        );
    }
    // Debian ships venv without the part that puts pip into an environment.
    if answer(command("python3").args(["-c", "import ensurepip, venv"])).is_none() {
        install_packages(&["python3-venv"], interrupt)
            .context("python3 cannot make virtual environments")?;
    }
    run(
        command("python3")
            .args(["-m", "venv", "--clear"])
            .arg(folder),
        interrupt,
    )
}
