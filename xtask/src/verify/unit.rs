//! The systemd unit in ops/, as systemd's own judge reads it.

use std::fs;

use anyhow::{Context, Result, ensure};

use crate::process::{answer, command};
use crate::workspace::{root, target};

/// The most that `systemd-analyze security` may find exposed, of a hundred: what a server needs that is reached over
/// the network.
const MOST_EXPOSED: &str = "25";

/// Has the unit judged, where systemd is here.
pub(super) fn check() -> Result<()> {
    if answer(command("systemd-analyze").arg("--version")).is_none() {
        println!("systemd-analyze is not here: the unit is not judged");
        return Ok(());
    }
    let unit = root().join("ops/teleclay-server.service");
    let text =
        fs::read_to_string(&unit).with_context(|| format!("{} cannot be read", unit.display()))?;
    // The program is where it will be, which need not be here.
    let text = text.replace("/usr/local/bin/teleclay-server", "/bin/true");
    let copy = target().join("teleclay-server.service");
    fs::write(&copy, text).with_context(|| format!("{} cannot be written", copy.display()))?;
    let exposed = format!("--threshold={MOST_EXPOSED}");
    for arguments in [&["verify"][..], &["security", "--offline=true", &exposed]] {
        let said = command("systemd-analyze")
            .args(arguments)
            .arg(&copy)
            .output()
            .context("systemd-analyze does not start")?;
        let words = [said.stdout, said.stderr].concat();
        ensure!(
            said.status.success(),
            "systemd-analyze {}: {}",
            arguments[0],
            String::from_utf8_lossy(&words)
        );
    }
    Ok(())
}
