//! What cargo knows about this workspace: where it is, where it builds, how much there is to build.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use serde::Deserialize;

use crate::process::command;

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
        let metadata = metadata(&["--no-deps"])?;
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

/// How many packages a build of the workspace compiles on this machine. An estimate for a progress line: a package that
/// only another platform needs may be among them.
pub(crate) fn packages_to_build() -> Result<u64> {
    let metadata = metadata(&["--filter-platform", &host()?])?;
    let resolve = metadata
        .resolve
        .context("cargo metadata resolved nothing")?;
    let nodes: HashMap<&str, &Node> = resolve
        .nodes
        .iter()
        .map(|node| (node.id.as_str(), node))
        .collect();
    let mut seen: HashSet<&str> = HashSet::new();
    let mut left: Vec<&str> = metadata
        .workspace_members
        .iter()
        .map(String::as_str)
        .collect();
    while let Some(id) = left.pop() {
        if !seen.insert(id) {
            continue;
        }
        let Some(node) = nodes.get(id) else { continue };
        let built = node.deps.iter().filter(|dependency| {
            let only_for_tests = |kind: &Kind| kind.kind.as_deref() == Some("dev");
            !dependency.dep_kinds.iter().all(only_for_tests)
        });
        left.extend(built.map(|dependency| dependency.pkg.as_str()));
    }
    Ok(seen.len() as u64)
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    workspace_members: Vec<String>,
    target_directory: PathBuf,
    resolve: Option<Resolve>,
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

#[derive(Deserialize)]
struct Resolve {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    id: String,
    deps: Vec<Dependency>,
}

#[derive(Deserialize)]
struct Dependency {
    pkg: String,
    dep_kinds: Vec<Kind>,
}

#[derive(Deserialize)]
struct Kind {
    kind: Option<String>,
}

fn metadata(arguments: &[&str]) -> Result<Metadata> {
    let output = command(cargo())
        .args(["metadata", "--format-version", "1"])
        .args(arguments)
        .output()
        .context("cargo metadata cannot be started")?;
    ensure!(
        output.status.success(),
        "cargo metadata failed ({}):\n{}",
        output.status,
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).context("cargo metadata answered something unknown")
}

/// The triple of this machine, such as `x86_64-unknown-linux-gnu`.
fn host() -> Result<String> {
    let output = command("rustc")
        .arg("-vV")
        .output()
        .context("rustc cannot be started")?;
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines()
        .find_map(|line| line.strip_prefix("host: "))
        .map(str::to_owned)
        .context("rustc -vV names no host")
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
