//! The trailer of every message under a lease, and the keys that it is made with. It brings nothing along that asks a
//! machine for randomness, so that a module in a browser has it as it is; how two sides come to have the keys is in
//! `teleclay_channel`, which offers what is here under its own names.
//!
//! The trailer is that of HMAC-SHA-256, RFC 2104. proto/SPEC.md has the bytes.

mod forged;
mod keys;
mod seal;
mod window;

pub use forged::Forged;
pub use keys::Keys;
pub use seal::{Channel, Purpose, TRAILER};
