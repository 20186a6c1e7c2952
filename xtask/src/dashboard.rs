//! Builds the dashboard when its sources changed since the last build, the modules of WebAssembly in it first.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;

use anyhow::{Context, Result, ensure};
use teleclay_rules::files::files_of_ours;

use crate::process::{answer, command, run_quietly};
use crate::tools::install_wasm_target;
use crate::workspace::{root, target};

/// What `npm ci` reads.
const PACKAGE_FILES: [&str; 3] = ["package.json", "package-lock.json", ".npmrc"];

/// What the modules of WebAssembly are built into.
const MODULES: [&str; 4] = [
    "generated/page.wasm",
    "generated/mathematics.wasm",
    "generated/hand.wasm",
    "generated/film.wasm",
];

/// Prepares and builds client-web/dist, each only when needed.
pub(crate) fn build() -> Result<()> {
    prepare()?;
    let folder = folder();
    let stamp = target().join("dashboard.stamp");
    let mut inputs = sources(&folder)?;
    inputs.extend(MODULES.map(|module| folder.join(module)));
    let inputs = fingerprint(&inputs)?;
    let page = folder.join("dist/index.html");
    if page.exists() && holds(&stamp, &inputs) {
        println!("the dashboard is built already");
        return Ok(());
    }
    let log = target().join("dashboard-build.log");
    run_quietly(npm(&["run", "build"]), "building the dashboard", &log)?;
    ensure!(
        page.exists(),
        "npm run build succeeded but made no client-web/dist/index.html"
    );
    leave(&stamp, &inputs)
}

/// Has packages and module there: packages come over the network while the module is compiled.
pub(crate) fn prepare() -> Result<()> {
    install_wasm_target()?;
    thread::scope(|scope| {
        let module = scope.spawn(build_module);
        let installed = install();
        let built = module.join().unwrap_or_else(|panic| resume_unwind(panic));
        installed.and(built)
    })
}

/// Builds the modules that the page has in common with the server and with the handle; cargo knows whether anything
/// changed.
fn build_module() -> Result<()> {
    let log = target().join("dashboard-module.log");
    let mut script = command("node");
    script.current_dir(folder()).arg("scripts/module.mjs");
    run_quietly(script, "building the dashboard's modules", &log)
}

/// Installs the dashboard's packages as its lock file names them.
pub(crate) fn install() -> Result<()> {
    let folder = folder();
    // Inside node_modules, so that the stamp goes when the packages go.
    let stamp = folder.join("node_modules/.teleclay-stamp");
    let inputs = fingerprint(&PACKAGE_FILES.map(|name| folder.join(name)))?;
    if holds(&stamp, &inputs) {
        return Ok(());
    }
    let log = target().join("dashboard-install.log");
    let ci = npm(&["ci", "--no-audit", "--no-fund"]);
    run_quietly(ci, "installing the dashboard's packages", &log)?;
    leave(&stamp, &inputs)
}

/// npm, in the dashboard's folder.
pub(crate) fn npm(arguments: &[&str]) -> Command {
    let mut npm = command("npm");
    npm.current_dir(folder()).args(arguments);
    npm
}

fn folder() -> PathBuf {
    root().join("client-web")
}

/// Every file that the build may read; the browser's tests are none of them, and of the modules only what was built.
fn sources(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = files_of_ours(folder, &[])?;
    let others = ["browser", "film", "hand", "mathematics", "wasm"].map(|name| folder.join(name));
    files.retain(|file| !others.iter().any(|other| file.starts_with(other)));
    Ok(files)
}

/// A stamp says from which inputs something was made.
fn holds(stamp: &Path, inputs: &str) -> bool {
    fs::read_to_string(stamp).is_ok_and(|text| text == inputs)
}

fn leave(stamp: &Path, inputs: &str) -> Result<()> {
    fs::write(stamp, inputs).with_context(|| format!("{} cannot be written", stamp.display()))
}

/// A number that changes with any name or content, and with the Node.js that builds. Not a secret and not an identity:
/// it only has to notice an edit.
fn fingerprint(files: &[PathBuf]) -> Result<String> {
    let mut hasher = DefaultHasher::new();
    answer(command("node").arg("--version")).hash(&mut hasher);
    for file in files {
        file.strip_prefix(root()).unwrap_or(file).hash(&mut hasher);
        fs::read(file)
            .with_context(|| format!("{} cannot be read", file.display()))?
            .hash(&mut hasher);
    }
    Ok(format!("{:016x}\n", hasher.finish()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edit_a_new_name_and_a_new_file_are_noticed_and_made_things_are_not() {
        let folder = std::env::temp_dir().join(format!("teleclay-xtask-{}", std::process::id()));
        for (folder, file) in [
            ("src", "main.ts"),
            ("node_modules/three", "index.js"),
            ("browser", "a.ts"),
            ("wasm/src", "lib.rs"),
            ("mathematics/src", "lib.rs"),
            ("hand/src", "lib.rs"),
        ]
        .map(|(name, file)| (folder.join(name), file))
        {
            fs::create_dir_all(&folder).unwrap();
            fs::write(folder.join(file), "one").unwrap();
        }
        let now = || fingerprint(&sources(&folder).unwrap()).unwrap();
        let first = now();
        for made in [
            "node_modules/three/index.js",
            "browser/a.ts",
            "wasm/src/lib.rs",
            "mathematics/src/lib.rs",
            "hand/src/lib.rs",
        ] {
            fs::write(folder.join(made), "two").unwrap();
            assert_eq!(first, now());
        }
        fs::write(folder.join("src/main.ts"), "two").unwrap();
        let edited = now();
        fs::rename(folder.join("src/main.ts"), folder.join("src/other.ts")).unwrap();
        let renamed = now();
        fs::write(folder.join("src/more.ts"), "").unwrap();
        let more = now();
        assert!(first != edited && edited != renamed && renamed != more);
        fs::remove_dir_all(folder).unwrap();
    }
}
