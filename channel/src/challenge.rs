//! Challenges: a server hands them out to anybody, keeps nothing of them, and takes each once, for a while.

use std::collections::VecDeque;
use std::time::Duration;

use blake2::Blake2sMac;
use blake2::digest::consts::U16;
use blake2::digest::{FixedOutput, KeyInit, Update};
use teleclay_seal::{CHALLENGE, Challenge};

/// A challenge is taken for this long: a join goes once there and once back, over any line that a loop bears.
const LASTS: Duration = Duration::from_secs(10);
/// Challenges that were taken are remembered until they are old, and no more than so many: the next join waits then.
const MOST_TAKEN: usize = 4096;

/// Why a challenge is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unwelcome {
    /// Another server gave it, an earlier run of this one, or nobody.
    #[error("the challenge is not this server's")]
    Foreign,
    /// It was given too long ago.
    #[error("the challenge is older than {} s", LASTS.as_secs())]
    Expired,
    /// A join has named it already.
    #[error("the challenge was answered before")]
    Used,
    /// So many joins came of late that no more can be told apart.
    #[error("too many joins at once")]
    Crowded,
}

/// The giver of challenges.
pub struct Challenges {
    key: [u8; 32],
    /// Those that were taken, oldest first.
    taken: VecDeque<(Duration, Challenge)>,
}

impl Challenges {
    /// With a key of its own, which nobody else ever knows.
    ///
    /// # Panics
    /// The system has no randomness.
    #[must_use]
    pub fn new() -> Self {
        Self {
            key: random(),
            taken: VecDeque::new(),
        }
    }

    /// One more. `now` is any clock that only goes forward.
    ///
    /// # Panics
    /// The system has no randomness.
    #[must_use]
    pub fn give(&self, now: Duration) -> Challenge {
        let mut bytes = [0; CHALLENGE];
        bytes[..8].copy_from_slice(&(now.as_millis() as u64).to_le_bytes());
        bytes[8..16].copy_from_slice(&random::<8>());
        let mark = self.mark(&bytes[..16]);
        bytes[16..].copy_from_slice(&mark);
        Challenge::from_bytes(bytes)
    }

    /// Whether a challenge is good now. It stays so until it is [taken](Self::take).
    ///
    /// # Errors
    /// It is not.
    pub fn check(&self, now: Duration, challenge: &Challenge) -> Result<(), Unwelcome> {
        let (told, mark) = challenge.as_bytes().split_at(16);
        let differing = self
            .mark(told)
            .iter()
            .zip(mark)
            .fold(0, |all, (a, b)| all | (a ^ b));
        if std::hint::black_box(differing) != 0 {
            return Err(Unwelcome::Foreign);
        }
        if challenge.given_at() + LASTS < now {
            return Err(Unwelcome::Expired);
        }
        if self.taken.iter().any(|(_, taken)| taken == challenge) {
            return Err(Unwelcome::Used);
        }
        Ok(())
    }

    /// Takes a challenge, once. Only joins that showed that they know the secret come here, so that nobody else can
    /// fill the memory of what was taken.
    ///
    /// # Errors
    /// It is not good (any more).
    pub fn take(&mut self, now: Duration, challenge: &Challenge) -> Result<(), Unwelcome> {
        self.check(now, challenge)?;
        // Those are refused for their age by now.
        while self
            .taken
            .front()
            .is_some_and(|(given, _)| *given + LASTS < now)
        {
            self.taken.pop_front();
        }
        if self.taken.len() == MOST_TAKEN {
            return Err(Unwelcome::Crowded);
        }
        let given = challenge.given_at();
        let place = self.taken.partition_point(|(other, _)| *other <= given);
        self.taken.insert(place, (given, *challenge));
        Ok(())
    }

    fn mark(&self, told: &[u8]) -> [u8; 16] {
        let mut mac = Blake2sMac::<U16>::new_from_slice(&self.key).expect("a key of 32 bytes");
        mac.update(told);
        mac.finalize_fixed().into()
    }
}

impl Default for Challenges {
    fn default() -> Self {
        Self::new()
    }
}

impl std::fmt::Debug for Challenges {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Challenges")
            .field("taken", &self.taken.len())
            .finish_non_exhaustive()
    }
}

pub(crate) fn random<const N: usize>() -> [u8; N] {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).expect("the system has randomness");
    bytes
}
