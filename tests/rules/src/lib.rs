//! The rules by which this repository is kept, as far as its files alone show whether they are. CONTRIBUTING.md tells
//! them; `cargo verify` asks here.
//!
//! | module | asks |
//! |---|---|
//! | [`source`] | are lines, files and comments as long as they may be |
//! | [`imports`] | do modules side by side import each other |
//! | [`unused`] | is a dependency named that nobody uses |
//! | [`links`] | is what documentation and comments point at there |
//! | [`citations`] | is every key of a paper in the list of papers |
//! | [`files`] | which files are ours |

pub mod citations;
pub mod files;
pub mod imports;
pub mod links;
pub mod source;
pub mod unused;

use std::path::PathBuf;

/// One crate of ours.
pub struct Member {
    /// The package's name.
    pub name: String,
    /// Where it lies.
    pub folder: PathBuf,
    /// The names by which its sources can use other packages.
    pub dependencies: Vec<String>,
}
