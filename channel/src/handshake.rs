//! The join's two messages with the system's own chance: [`teleclay_seal::handshake`] has all else of it.

pub use teleclay_seal::handshake::{Context, LONGEST_PAYLOAD, Secret};
use teleclay_seal::{Forged, Keys, handshake};

use crate::challenge::random;

/// The handle's side of a join.
#[derive(Debug)]
pub struct Asking(handshake::Asking);

impl Asking {
    /// The first message, with what the server alone is to read.
    ///
    /// # Panics
    /// The payload is longer than [`LONGEST_PAYLOAD`], or the system has no randomness.
    #[must_use]
    pub fn begin(secret: &Secret, context: Context<'_>, payload: &[u8]) -> (Self, Vec<u8>) {
        let (asking, message) = handshake::Asking::begin(secret, context, payload, random());
        (Self(asking), message)
    }

    /// What the server says, and the keys. An answer that is none changes nothing: the next may be the server's.
    ///
    /// # Errors
    /// The message comes from somebody who does not know the secret, or answers another question.
    pub fn conclude(&mut self, message: &[u8]) -> Result<(Vec<u8>, Keys), Forged> {
        self.0.conclude(message)
    }
}

/// The server's side of a join.
#[derive(Debug)]
pub struct Answering(handshake::Answering);

impl Answering {
    /// What a handle says in its first message.
    ///
    /// # Errors
    /// It does not know the secret, or asks for something else.
    ///
    /// # Panics
    /// The system has no randomness.
    pub fn hear(
        secret: &Secret,
        context: Context<'_>,
        message: &[u8],
    ) -> Result<(Vec<u8>, Self), Forged> {
        let (payload, answering) = handshake::Answering::hear(secret, context, message, random())?;
        Ok((payload, Self(answering)))
    }

    /// The answer, which that handle alone can read, and the keys.
    ///
    /// # Panics
    /// The payload is longer than [`LONGEST_PAYLOAD`].
    #[must_use]
    pub fn answer(self, payload: &[u8]) -> (Vec<u8>, Keys) {
        self.0.answer(payload)
    }
}
