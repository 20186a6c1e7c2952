//! How handle and server know each other, as pure functions: the handshake of a join, the keys that come of it, and the
//! trailer of every message under a lease. Chance is an argument, so that a module in a browser has it as it is;
//! `teleclay_channel` offers the same with the system's own, and a server's challenges.
//!
//! The handshake is Noise's `NNpsk0`, <https://noiseprotocol.org/noise.html>, the trailer that of HMAC-SHA-256, RFC
//! 2104. proto/SPEC.md has the bytes.

mod challenge;
mod chance;
mod forged;
pub mod handshake;
mod keys;
mod seal;
mod window;

pub use challenge::{CHALLENGE, Challenge};
pub use chance::CHANCE;
pub use forged::Forged;
pub use handshake::Secret;
pub use keys::Keys;
pub use seal::{Channel, Purpose, TRAILER};
