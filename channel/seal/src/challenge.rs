//! The challenge that a join names.

use std::time::Duration;

/// Length of a challenge in bytes.
pub const CHALLENGE: usize = 32;

/// What a join must name: when it was given, at random, and a mark by which its giver knows it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Challenge([u8; CHALLENGE]);

impl Challenge {
    /// As it crosses.
    #[must_use]
    pub const fn as_bytes(&self) -> &[u8; CHALLENGE] {
        &self.0
    }

    /// As it came.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; CHALLENGE]) -> Self {
        Self(bytes)
    }

    /// When it was given, by its giver's clock.
    #[must_use]
    pub fn given_at(&self) -> Duration {
        let [a, b, c, d, e, f, g, h, ..] = self.0;
        Duration::from_millis(u64::from_le_bytes([a, b, c, d, e, f, g, h]))
    }
}

impl std::fmt::Debug for Challenge {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Challenge({:?})", self.given_at())
    }
}
