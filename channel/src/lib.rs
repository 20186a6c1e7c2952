//! What tells the words of a handle and of its server from everybody else's.
//!
//! | module | does |
//! |---|---|
//! | [`handshake`] | the join: both sides show that they know the secret, which never crosses, and agree on keys |
//! | [`challenge`] | what a join must name, so that one overheard before is worth nothing |
//! | [`seal`] | the trailer by which a message under a lease is known to come from the other side, once |
//!
//! The handshake is Noise's `NNpsk0`, <https://noiseprotocol.org/noise.html>, the trailer that
//! of HMAC-SHA-256, RFC 2104. proto/SPEC.md has the bytes.

pub mod challenge;
mod forged;
pub mod handshake;
pub mod seal;
mod window;

pub use challenge::{Challenge, Challenges, Unwelcome};
pub use forged::Forged;
pub use handshake::{Answering, Asking, Context, Keys, Secret};
pub use seal::{Channel, Purpose, TRAILER};
