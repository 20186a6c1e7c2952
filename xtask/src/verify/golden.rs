//! The same digests by native code and by WebAssembly: `tests/golden` run both ways, and compared.

use anyhow::{Context, Result};

use crate::process::{answer, command, run};
use crate::tools::WASM;
use crate::workspace::{cargo, program, root, target};

/// The package, which is also the program's name.
const PACKAGE: &str = "teleclay-golden";

/// What differs, a line each.
pub(super) fn check() -> Result<Vec<String>> {
    let package = ["--locked", "--package", PACKAGE];
    run(command(cargo()).args(["build", "--release"]).args(package))?;
    // As a browser gets it.
    run(command(cargo())
        .args(["rustc", "--profile", "page", "--target", WASM, "--lib"])
        .args(["--crate-type", "cdylib"])
        .args(package))?;
    let native =
        answer(&mut command(program(PACKAGE))).with_context(|| format!("{PACKAGE} failed"))?;
    let module = target().join(WASM).join("page/teleclay_golden.wasm");
    let script = root().join("tests/golden/run.mjs");
    let wasm = answer(command("node").arg(script).arg(module))
        .context("the WebAssembly module failed in Node.js")?;
    println!("{native}");
    Ok(differences(&native, &wasm))
}

/// Compares lines of a name and a digest with lines of a digest alone.
fn differences(native: &str, wasm: &str) -> Vec<String> {
    let (native, wasm): (Vec<&str>, Vec<&str>) = (native.lines().collect(), wasm.lines().collect());
    if native.is_empty() || native.len() != wasm.len() {
        return vec![format!(
            "native code has {} digests, WebAssembly {}",
            native.len(),
            wasm.len()
        )];
    }
    let pairs = native.into_iter().zip(wasm);
    pairs
        .filter(|(native, wasm)| native.split_whitespace().last() != Some(*wasm))
        .map(|(native, wasm)| format!("{native} by native code, {wasm} by WebAssembly"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::differences;

    #[test]
    fn only_the_same_digests_pass() {
        assert!(differences("clay 01ab\nloop 02cd", "01ab\n02cd").is_empty());
        let wrong = differences("clay 01ab\nloop 02cd", "01ab\n02ce");
        assert_eq!(wrong, ["loop 02cd by native code, 02ce by WebAssembly"]);
        assert_eq!(differences("clay 01ab", "01ab\n02cd").len(), 1);
        assert_eq!(differences("clay 01ab\nloop 02cd", "01ab").len(), 1);
        assert_eq!(differences("", "").len(), 1);
    }
}
