//! What the dashboard works out itself of the clay that it shows: the server's own rooms, compiled for browsers.
//! `npm run module` builds it.
//!
//! | on the page | here |
//! |---|---|
//! | the clay: bricks in, meshes out | [`shown::ShownClay`] |
//! | how it is called from JavaScript | [`Page`] |

#[cfg(target_family = "wasm")]
mod exports;
mod page;
pub mod shown;

pub use page::{Buffer, DONE, NO_BRICK, Page, REFUSED, REGRIDDED};
