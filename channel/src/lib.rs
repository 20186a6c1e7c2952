//! What tells the words of a handle and of its server from everybody else's.
//!
//! | module | does |
//! |---|---|
//! | [`handshake`] | the join: both sides show that they know the secret, which never crosses, and agree on keys |
//! | [`challenge`] | what a join must name, so that one overheard before is worth nothing |
//! | [`Channel`] | the trailer by which a message under a lease is known to come from the other side, once |
//!
//! Trailer and handshake are those of `teleclay_seal`, here with the system's own chance. The handshake is Noise's
//! `NNpsk0`, <https://noiseprotocol.org/noise.html>, the trailer that of HMAC-SHA-256, RFC 2104. proto/SPEC.md has the
//! bytes.

pub mod challenge;
pub mod handshake;

pub use challenge::{Challenges, Unwelcome};
pub use handshake::{Answering, Asking, Context, Secret};
pub use teleclay_seal::{Challenge, Channel, Forged, Keys, Purpose, TRAILER};

/// Keys of a lease that is granted on a line which nobody else can read: what a handshake would agree on elsewhere.
///
/// # Panics
/// The system has no randomness.
#[must_use]
pub fn fresh_keys() -> Keys {
    Keys::new(challenge::random(), challenge::random())
}
