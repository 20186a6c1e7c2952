//! Writes the conformance vectors of `proto/vectors/`: `cargo run --release -p teleclay-proto --example vectors`.
//!
//! Run it after a layout has changed, together with its version. The tests decode the files and compare them with bytes
//! that were laid out by hand from SPEC.md; this program only saves the typing.

use std::path::Path;
use std::{fs, io};

#[allow(unreachable_pub, reason = "the tests include this module too")]
mod cases;

fn main() -> io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors");
    fs::create_dir_all(&folder)?;
    for (name, text) in cases::files() {
        fs::write(folder.join(name), text)?;
    }
    Ok(())
}
