//! The Python that other people's mathematics and linters run in: a virtual environment under target/.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::process::{answer, command, run, run_quietly};
use crate::tools::install_packages;
use crate::workspace::{cargo, root, target};

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

/// Builds the wheel of python/ and puts it into the environment, as `pip install ./python` would into anybody's.
pub(crate) fn install_wheel() -> Result<()> {
    let mut pip = with_wheel(script("python"));
    pip.args(["-m", "pip", "install", "--disable-pip-version-check"])
        // Everything that it needs is there, pinned; nothing is fetched, nothing else changed.
        .args([
            "--no-build-isolation",
            "--no-deps",
            "--no-index",
            "--force-reinstall",
        ])
        .arg(root().join("python"))
        // The versions of Cargo.lock; maturin's own default is the release profile.
        .env("MATURIN_PEP517_ARGS", "--locked");
    // maturin is called by its name.
    let found = std::env::var_os("PATH").unwrap_or_default();
    let mut paths = vec![folder().join("bin")];
    paths.extend(std::env::split_paths(&found));
    pip.env("PATH", std::env::join_paths(paths)?);
    run_quietly(
        pip,
        "building the wheel of python/",
        &target().join("wheel.log"),
    )
}

/// cargo in the workspace of python/.
pub(crate) fn wheel_cargo(arguments: &str) -> Command {
    let mut cargo = with_wheel(command(cargo()));
    cargo
        .args(arguments.split(' '))
        .current_dir(root().join("python"))
        .env("PYO3_PYTHON", folder().join("bin/python"));
    cargo
}

/// In a folder of its own: the two workspaces would take each other's place in one.
fn with_wheel(mut command: Command) -> Command {
    command.env("CARGO_TARGET_DIR", target().join("wheel"));
    command
}

/// A program of the environment: the interpreter, or what a package brought.
pub(crate) fn script(name: &str) -> Command {
    command(folder().join("bin").join(name))
}

fn folder() -> PathBuf {
    target().join("python")
}
