//! A recording in a browser: [`teleclay_reel`] as a module that a worker feeds with pieces of a file. `npm run module`
//! builds it, and a page loads it when somebody opens a recording.
//!
//! | on the page | here |
//! |---|---|
//! | what the worker calls, and how long things are handed over | [`Film`], [`Buffer`] |
//! | the clay as the messages of bricks that the clay's worker reads | [`bricks`] |

pub mod bricks;
#[cfg(target_family = "wasm")]
mod exports;
mod film;

pub use film::{Buffer, DONE, Film, MORE, REFUSED};
