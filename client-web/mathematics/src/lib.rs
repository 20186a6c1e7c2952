//! The mathematics that the dashboard works out itself at every move of a slider, the server's own, compiled for
//! browsers. `npm run module` builds it; the pages *Stability* and *Robot* load it, and no other does.
//!
//! | on the page | here |
//! |---|---|
//! | the loop under the slider's round trip, the arms of the robot | [`theory::Theory`], [`theory::arms`] |
//! | how both are called from JavaScript | [`Mathematics`] |

mod calls;
#[cfg(target_family = "wasm")]
mod exports;
pub mod theory;

pub use calls::{Buffer, DONE, Mathematics, REFUSED};
