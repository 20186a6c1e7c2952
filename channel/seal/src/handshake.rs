//! The join's two messages: Noise `NNpsk0` over X25519, ChaCha20-Poly1305 and BLAKE2s.
//!
//! Whoever lacks the secret can neither make a message that the other side takes nor read one. Keys are new for each
//! join, and a secret that is lost later opens nothing that was said before, but for the first message of a join.

use blake2::{Blake2s256, Digest};
use snow::resolvers::{DefaultResolver, FallbackResolver};
use snow::{Builder, HandshakeState};

use crate::challenge::Challenge;
use crate::chance::{CHANCE, Given};
use crate::forged::Forged;
use crate::keys::Keys;

const PATTERN: &str = "Noise_NNpsk0_25519_ChaChaPoly_BLAKE2s";
/// What a message has beside its payload, in bytes: a public key and a tag.
const OVERHEAD: usize = 48;
/// Longest payload of either message, in bytes.
pub const LONGEST_PAYLOAD: usize = 65_535 - OVERHEAD;

/// What both sides know before they meet.
#[derive(Clone)]
pub struct Secret([u8; 32]);

impl PartialEq for Secret {
    /// Takes as long wherever two secrets differ.
    fn eq(&self, other: &Self) -> bool {
        let pairs = self.0.iter().zip(&other.0);
        std::hint::black_box(pairs.fold(0, |all, (a, b)| all | (a ^ b))) == 0
    }
}

impl Eq for Secret {}

impl Secret {
    /// The secret that a token stands for.
    #[must_use]
    pub fn of_token(token: &str) -> Self {
        let mut hash = Blake2s256::new();
        hash.update(b"teleclay token 1");
        hash.update(token.as_bytes());
        Self(hash.finalize().into())
    }

    /// As it was [kept](Self::as_bytes).
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// To be kept where nobody else reads: whoever has it can join, though the token cannot be had from it.
    #[must_use]
    pub const fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// What everybody knows: the secret of a server that asks for none. Keys are still new for each join, and whoever
    /// only listens learns none of them; but anybody may answer in the server's place.
    #[must_use]
    pub const fn none() -> Self {
        Self([0; 32])
    }
}

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Secret")
    }
}

/// What a join is about. Both sides must mean the same, or neither hears the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Context<'a> {
    /// The key that the join is asked on.
    pub key: &'a str,
    /// The server's challenge.
    pub challenge: &'a Challenge,
}

/// The handle's side of a join.
#[derive(Debug)]
pub struct Asking {
    state: HandshakeState,
}

impl Asking {
    /// The first message, with what the server alone is to read.
    ///
    /// # Panics
    /// The payload is longer than [`LONGEST_PAYLOAD`].
    #[must_use]
    pub fn begin(
        secret: &Secret,
        context: Context<'_>,
        payload: &[u8],
        chance: [u8; CHANCE],
    ) -> (Self, Vec<u8>) {
        let mut state = with_builder(secret, context, chance, |builder| {
            builder
                .build_initiator()
                .expect("the pattern needs no more")
        });
        let message = write(&mut state, payload);
        (Self { state }, message)
    }

    /// What the server says, and the keys. An answer that is none changes nothing: the next may be the server's.
    ///
    /// # Errors
    /// The message comes from somebody who does not know the secret, or answers another question.
    pub fn conclude(&mut self, message: &[u8]) -> Result<(Vec<u8>, Keys), Forged> {
        let payload = read(&mut self.state, message)?;
        Ok((payload, keys(&mut self.state)))
    }
}

/// The server's side of a join.
#[derive(Debug)]
pub struct Answering {
    state: HandshakeState,
}

impl Answering {
    /// What a handle says in its first message.
    ///
    /// # Errors
    /// It does not know the secret, or asks for something else.
    pub fn hear(
        secret: &Secret,
        context: Context<'_>,
        message: &[u8],
        chance: [u8; CHANCE],
    ) -> Result<(Vec<u8>, Self), Forged> {
        let mut state = with_builder(secret, context, chance, |builder| {
            builder
                .build_responder()
                .expect("the pattern needs no more")
        });
        let payload = read(&mut state, message)?;
        Ok((payload, Self { state }))
    }

    /// The answer, which that handle alone can read, and the keys.
    ///
    /// # Panics
    /// The payload is longer than [`LONGEST_PAYLOAD`].
    #[must_use]
    pub fn answer(mut self, payload: &[u8]) -> (Vec<u8>, Keys) {
        let message = write(&mut self.state, payload);
        let keys = keys(&mut self.state);
        (message, keys)
    }
}

fn with_builder(
    secret: &Secret,
    context: Context<'_>,
    chance: [u8; CHANCE],
    build: impl FnOnce(Builder<'_>) -> HandshakeState,
) -> HandshakeState {
    let mut prologue = b"teleclay join 1\0".to_vec();
    prologue.extend_from_slice(context.challenge.as_bytes());
    prologue.extend_from_slice(context.key.as_bytes());
    let resolver = FallbackResolver::new(Box::new(Given::new(chance)), Box::new(DefaultResolver));
    let pattern = PATTERN.parse().expect("a pattern that exists");
    let builder = Builder::with_resolver(pattern, Box::new(resolver))
        .psk(0, &secret.0)
        .and_then(|builder| builder.prologue(&prologue))
        .expect("each is given once");
    build(builder)
}

fn write(state: &mut HandshakeState, payload: &[u8]) -> Vec<u8> {
    let mut message = vec![0; payload.len() + OVERHEAD];
    let length = state
        .write_message(payload, &mut message)
        .expect("it is this side's turn, and the payload fits");
    message.truncate(length);
    message
}

fn read(state: &mut HandshakeState, message: &[u8]) -> Result<Vec<u8>, Forged> {
    let mut payload = vec![0; message.len()];
    let length = state
        .read_message(message, &mut payload)
        .map_err(|_| Forged::Unauthentic)?;
    payload.truncate(length);
    Ok(payload)
}

fn keys(state: &mut HandshakeState) -> Keys {
    let (of_handle, of_server) = state.dangerously_get_raw_split();
    Keys::new(of_handle, of_server)
}
