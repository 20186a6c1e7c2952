//! What the dashboard calculates itself, at every frame or every move of a slider: the rooms of the server, compiled
//! for browsers. `npm run module` builds it.
//!
//! | on the page | here |
//! |---|---|
//! | the clay: bricks in, meshes out | [`shown::ShownClay`] |
//! | the loop under the slider's round trip, the arms of the robot | [`theory::Theory`] |
//! | how both are called from JavaScript | [`Page`] |

#[cfg(target_family = "wasm")]
mod exports;
mod page;
pub mod shown;
pub mod theory;

pub use page::{Buffer, DONE, NO_BRICK, Page, REFUSED, REGRIDDED};
