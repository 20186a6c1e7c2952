//! The hand in a browser: the handle side of the loop, [`teleclay_pointer`], as a module that a dedicated worker wakes.
//! `npm run module` builds it.
//!
//! | on the page | here |
//! |---|---|
//! | what the worker calls, and how long things are handed over | [`Hand`], [`Buffer`] |
//! | what it reads of the state | [`numbers`] |

#[cfg(target_family = "wasm")]
mod exports;
mod hand;
pub mod numbers;

pub use hand::{Buffer, DONE, Hand, KEYS, REFUSED};
