//! Has cargo notice when the dashboard is built, so that the next build of the server carries it.
//!
//! The dashboard is built by npm, not from here, and may not be there at all. Cargo can watch a folder only if it
//! exists; for one that does not, it would run this again with every build.

use std::path::Path;

fn main() {
    let built = Path::new("../client-web/dist");
    // In a checkout that cannot be written to there is nothing to be noticed either.
    std::fs::create_dir_all(built).ok();
    println!("cargo::rerun-if-changed={}", built.display());
}
