//! Draws that a study makes, from its seed and what they are for.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sha2::{Digest, Sha256};

/// A source of chance for one purpose. What is drawn for one says nothing of what is drawn for another.
pub(crate) struct Chance(Pcg64Mcg);

impl Chance {
    /// `what` names the purpose, `of` whom or what it concerns.
    pub(crate) fn new(seed: u64, what: &str, of: &[u64]) -> Self {
        let mut digest = Sha256::new();
        digest.update(seed.to_le_bytes());
        for number in of {
            digest.update(number.to_le_bytes());
        }
        digest.update(what.as_bytes());
        let bytes: [u8; 32] = digest.finalize().into();
        let [a, b, c, d, e, f, g, h, ..] = bytes;
        Self(Pcg64Mcg::seed_from_u64(u64::from_le_bytes([
            a, b, c, d, e, f, g, h,
        ])))
    }

    /// From 0 up to, without, 1.
    pub(crate) fn share(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// From 0 up to, without, `count`, which is above zero.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((self.share() * count as f64) as usize).min(count - 1)
    }

    /// Any order is as likely as any other.
    pub(crate) fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }
}
