//! What the manifests of this workspace say.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;
use teleclay_rules::Member;

use crate::process::{answer, command};
use crate::python;
use crate::workspace::cargo;

const METADATA: &str = "metadata --format-version 1 --no-deps";

/// The crates of this workspace, as cargo reads their manifests.
pub(super) fn members() -> Result<Vec<Member>> {
    members_by(command(cargo()).args(METADATA.split(' ')))
}

/// The same, and those of the workspace in python/.
pub(super) fn all_members() -> Result<Vec<Member>> {
    let mut all = members()?;
    all.extend(members_by(&mut python::wheel_cargo(METADATA))?);
    Ok(all)
}

fn members_by(cargo: &mut Command) -> Result<Vec<Member>> {
    let said = answer(cargo).context("cargo metadata failed")?;
    let metadata: Value = serde_json::from_str(&said)?;
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let packages = list(&metadata["packages"])
        .into_iter()
        .map(|package| Member {
            name: text(&package["name"]),
            folder: Path::new(&text(&package["manifest_path"])).with_file_name(""),
            dependencies: list(&package["dependencies"])
                .iter()
                .map(|used| {
                    text(
                        used["rename"]
                            .as_str()
                            .map_or(&used["name"], |_| &used["rename"]),
                    )
                })
                .collect(),
        });
    Ok(packages.collect())
}
