//! Chance as an argument, for a handshake that asks for it once.

use snow::Error;
use snow::params::{CipherChoice, DHChoice, HashChoice};
use snow::resolvers::CryptoResolver;
use snow::types::{Cipher, Dh, Hash, Random};

/// What a side needs of chance for its message, in bytes: a private key. Whoever could know or foresee them could read
/// what is said, so they come from the system's own source, new for every join.
pub const CHANCE: usize = 32;

/// Gives the bytes that it was made with, once. A handshake that would ask again fails, and never repeats a key.
pub(crate) struct Given {
    chance: [u8; CHANCE],
}

impl Given {
    pub(crate) const fn new(chance: [u8; CHANCE]) -> Self {
        Self { chance }
    }
}

impl CryptoResolver for Given {
    fn resolve_rng(&self) -> Option<Box<dyn Random>> {
        Some(Box::new(Once(Some(self.chance))))
    }

    fn resolve_dh(&self, _: &DHChoice) -> Option<Box<dyn Dh>> {
        None
    }

    fn resolve_hash(&self, _: &HashChoice) -> Option<Box<dyn Hash>> {
        None
    }

    fn resolve_cipher(&self, _: &CipherChoice) -> Option<Box<dyn Cipher>> {
        None
    }
}

struct Once(Option<[u8; CHANCE]>);

impl Random for Once {
    fn try_fill_bytes(&mut self, to: &mut [u8]) -> Result<(), Error> {
        let chance = self.0.take().ok_or(Error::Rng)?;
        if to.len() != chance.len() {
            return Err(Error::Rng);
        }
        to.copy_from_slice(&chance);
        Ok(())
    }
}
