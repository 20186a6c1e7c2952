//! Where this workspace lies, and where it builds.

use std::path::{Path, PathBuf};

/// The folder that holds the workspace's Cargo.toml.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("xtask is a folder of the workspace")
}

/// The cargo that runs us, so that a nested build takes the same toolchain.
pub(crate) fn cargo() -> PathBuf {
    std::env::var_os("CARGO").map_or_else(|| PathBuf::from("cargo"), PathBuf::from)
}

/// Where cargo builds: this program lies there, in `release`.
pub(crate) fn target() -> PathBuf {
    let program = std::env::current_exe().expect("the operating system tells a program its path");
    let release = program
        .ancestors()
        .find(|folder| folder.ends_with("release"));
    let target = release
        .and_then(Path::parent)
        .expect("this program is built in release");
    target.to_owned()
}

/// A program of the release build.
pub(crate) fn program(name: &str) -> PathBuf {
    target().join("release").join(name)
}
