//! What cargo knows about this workspace: where it is, where it builds, how much there is to build.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use serde::Deserialize;

use crate::process::{Interrupt, command, run_quietly};
use crate::tools::answer;

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

/// The workspace as `cargo metadata` tells it.
pub(crate) struct Workspace {
    /// Where cargo builds.
    pub(crate) target: PathBuf,
    /// The crates of ours.
    pub(crate) members: Vec<Member>,
}

/// One crate of ours.
pub(crate) struct Member {
    /// The package's name.
    pub(crate) name: String,
    /// Its folder, relative to the workspace's root.
    pub(crate) folder: PathBuf,
    /// The programs it makes.
    pub(crate) programs: Vec<String>,
}

impl Workspace {
    /// Asks cargo, without looking at dependencies.
    pub(crate) fn find() -> Result<Self> {
        let metadata = metadata()?;
        let members = metadata
            .packages
            .into_iter()
            .map(|package| Member {
                folder: relative_folder(&package.manifest_path),
                programs: programs(&package.targets),
                name: package.name,
            })
            .collect();
        Ok(Self {
            target: metadata.target_directory,
            members,
        })
    }

    /// A program of the release build.
    pub(crate) fn program(&self, name: &str) -> PathBuf {
        self.target
            .join("release")
            .join(format!("{name}{}", std::env::consts::EXE_SUFFIX))
    }

    /// The members that must stay free of input, output and clocks: crates/ and proto.
    pub(crate) fn pure_members(&self) -> impl Iterator<Item = &Member> {
        self.members.iter().filter(|member| {
            member.folder.starts_with("crates") || member.folder.starts_with("proto")
        })
    }
}

/// How many packages a build of the workspace compiles on this machine. Downloads them first where some are missing.
pub(crate) fn packages_to_build(workspace: &Workspace, interrupt: &Interrupt) -> Result<u64> {
    let tree = if let Ok(tree) = ask_cargo(&TREE) {
        tree
    } else {
        let host = answer(command("rustc").args(["--print", "host-tuple"]))
            .context("rustc does not say what it builds for")?;
        let mut fetch = command(cargo());
        fetch.args(["fetch", "--target", &host]);
        let log = workspace.target.join("download.log");
        run_quietly(fetch, "downloading packages", &log, interrupt)?;
        ask_cargo(&TREE)?
    };
    let tree = String::from_utf8(tree).context("cargo tree answered no text")?;
    // A package that stands there again, its own tree left out, is marked so.
    let package = |line| str::trim_end_matches(line, " (*)");
    let packages: HashSet<&str> = tree.lines().map(package).collect();
    Ok(packages.len() as u64)
}

/// Every package of a build, one a line. Fails rather than downloading: that may take long, and wants a progress line.
const TREE: [&str; 9] = [
    "tree",
    "--offline",
    "--workspace",
    "--edges",
    "normal,build",
    "--prefix",
    "none",
    "--format",
    "{p}",
];

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    target_directory: PathBuf,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    manifest_path: PathBuf,
    targets: Vec<Target>,
}

#[derive(Deserialize)]
struct Target {
    name: String,
    kind: Vec<String>,
}

fn metadata() -> Result<Metadata> {
    let answer = ask_cargo(&["metadata", "--format-version", "1", "--no-deps"])?;
    serde_json::from_slice(&answer).context("cargo metadata answered something unknown")
}

fn ask_cargo(arguments: &[&str]) -> Result<Vec<u8>> {
    let what = arguments[0];
    let output = command(cargo())
        .args(arguments)
        .output()
        .with_context(|| format!("cargo {what} cannot be started"))?;
    ensure!(
        output.status.success(),
        "cargo {what} failed ({}):\n{}",
        output.status,
        String::from_utf8_lossy(&output.stderr)
    );
    Ok(output.stdout)
}

fn programs(targets: &[Target]) -> Vec<String> {
    let is_program = |target: &&Target| target.kind.iter().any(|kind| kind == "bin");
    targets
        .iter()
        .filter(is_program)
        .map(|target| target.name.clone())
        .collect()
}

fn relative_folder(manifest: &Path) -> PathBuf {
    let folder = manifest.parent().unwrap_or(manifest);
    folder.strip_prefix(root()).unwrap_or(folder).to_owned()
}
