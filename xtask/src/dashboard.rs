//! Builds the dashboard when its sources changed since the last build.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::process::{Interrupt, command, run_quietly};
use crate::tools::answer;
use crate::workspace::{Workspace, root};

/// What `npm ci` reads.
const PACKAGE_FILES: [&str; 3] = ["package.json", "package-lock.json", ".npmrc"];

/// Folders of client-web that the build does not read: what it makes, what npm makes, and the browser's tests.
const NOT_SOURCES: [&str; 4] = ["dist", "generated", "node_modules", "browser"];

/// Installs packages and builds client-web/dist, each only when needed.
pub(crate) fn build(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    install(workspace, interrupt)?;
    let folder = root().join("client-web");
    let stamp = Stamp {
        path: workspace.target.join("dashboard.stamp"),
        text: fingerprint(&sources(&folder)?)?,
    };
    if folder.join("dist/index.html").exists() && stamp.holds() {
        println!("the dashboard is built already");
        return Ok(());
    }
    let mut build = command("npm");
    build.current_dir(&folder).args(["run", "build"]);
    let log = workspace.target.join("dashboard-build.log");
    run_quietly(build, "building the dashboard", &log, interrupt)?;
    ensure!(
        folder.join("dist/index.html").exists(),
        "npm run build succeeded but made no client-web/dist/index.html"
    );
    stamp.leave()
}

/// Installs the dashboard's packages as its lock file names them.
pub(crate) fn install(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    let folder = root().join("client-web");
    let files = PACKAGE_FILES.map(|name| folder.join(name));
    // Inside node_modules, so that the stamp goes when the packages go.
    let stamp = Stamp {
        path: folder.join("node_modules/.teleclay-stamp"),
        text: fingerprint(&files)?,
    };
    if stamp.holds() {
        return Ok(());
    }
    let mut install = command("npm");
    install
        .current_dir(&folder)
        .args(["ci", "--no-audit", "--no-fund"]);
    let log = workspace.target.join("dashboard-install.log");
    run_quietly(
        install,
        "installing the dashboard's packages",
        &log,
        interrupt,
    )?;
    stamp.leave()
}

/// A file that says from which inputs something was made.
struct Stamp {
    path: PathBuf,
    text: String,
}

impl Stamp {
    fn holds(&self) -> bool {
        fs::read_to_string(&self.path).is_ok_and(|text| text == self.text)
    }

    fn leave(&self) -> Result<()> {
        fs::write(&self.path, &self.text)
            .with_context(|| format!("{} cannot be written", self.path.display()))
    }
}

/// Every file below `folder` that the build may read, sorted.
fn sources(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut left = vec![folder.to_owned()];
    while let Some(next) = left.pop() {
        let entries =
            fs::read_dir(&next).with_context(|| format!("{} cannot be read", next.display()))?;
        for entry in entries {
            let entry = entry?;
            let skipped =
                next == folder && NOT_SOURCES.iter().any(|name| entry.file_name() == *name);
            if entry.file_type()?.is_dir() {
                if !skipped {
                    left.push(entry.path());
                }
            } else {
                files.push(entry.path());
            }
        }
    }
    files.sort();
    Ok(files)
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

    fn folder(name: &str) -> PathBuf {
        let folder =
            std::env::temp_dir().join(format!("teleclay-xtask-{}-{name}", std::process::id()));
        fs::create_dir_all(folder.join("src")).unwrap();
        fs::create_dir_all(folder.join("node_modules/three")).unwrap();
        fs::write(folder.join("src/main.ts"), "one").unwrap();
        fs::write(folder.join("node_modules/three/index.js"), "three").unwrap();
        folder
    }

    #[test]
    fn an_edit_a_new_name_and_a_new_file_are_noticed_and_made_things_are_not() {
        let folder = folder("fingerprint");
        let now = || fingerprint(&sources(&folder).unwrap()).unwrap();
        let first = now();
        assert_eq!(first, now());
        fs::write(folder.join("node_modules/three/index.js"), "four").unwrap();
        assert_eq!(first, now());
        fs::write(folder.join("src/main.ts"), "two").unwrap();
        let edited = now();
        assert_ne!(first, edited);
        fs::rename(folder.join("src/main.ts"), folder.join("src/other.ts")).unwrap();
        let renamed = now();
        assert_ne!(edited, renamed);
        fs::write(folder.join("src/more.ts"), "").unwrap();
        assert_ne!(renamed, now());
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_stamp_holds_only_for_what_it_was_left_for() {
        let folder = folder("stamp");
        let stamp = |text: &str| Stamp {
            path: folder.join("stamp"),
            text: text.to_owned(),
        };
        assert!(!stamp("a").holds());
        stamp("a").leave().unwrap();
        assert!(stamp("a").holds() && !stamp("b").holds());
        fs::remove_dir_all(folder).unwrap();
    }
}
