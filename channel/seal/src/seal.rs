//! The trailer of every message under a lease: a number that counts up, and a tag that only the two sides can make.
//!
//! A message stays readable; what the trailer tells is who wrote it, what for, and that it comes for the first time.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use hmac::{Hmac, Mac};
use sha2::Sha256;

use crate::forged::Forged;
use crate::keys::Keys;
use crate::window::Window;

/// Length of the trailer in bytes: a number of 8, a tag of 16.
pub const TRAILER: usize = 24;
const TAG: usize = 16;

/// What a message is for. Each counts for itself, and none is taken for another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Purpose {
    /// A frame of the loop.
    Frame = 1,
    /// Giving the lease back.
    Leave = 2,
    /// Asking for a fresh block.
    ClayFresh = 3,
    /// Asking for the parameters of the loop.
    Parameters = 4,
    /// Asking for the clay.
    ClaySnapshot = 5,
    /// Asking for the session as it is.
    State = 6,
}

const PURPOSES: usize = 6;

/// One side's end of a lease. Any thread may use it; none waits for longer than another takes to note a number.
pub struct Channel {
    own: Hmac<Sha256>,
    other: Hmac<Sha256>,
    numbers: [AtomicU64; PURPOSES],
    windows: [Mutex<Window>; PURPOSES],
}

impl Channel {
    /// The handle's end.
    #[must_use]
    pub fn of_handle(keys: &Keys) -> Self {
        Self::new(&keys.of_handle, &keys.of_server)
    }

    /// The server's end.
    #[must_use]
    pub fn of_server(keys: &Keys) -> Self {
        Self::new(&keys.of_server, &keys.of_handle)
    }

    fn new(own: &[u8; 32], other: &[u8; 32]) -> Self {
        Self {
            own: keyed(own),
            other: keyed(other),
            numbers: [const { AtomicU64::new(0) }; PURPOSES],
            windows: [const { Mutex::new(Window::new()) }; PURPOSES],
        }
    }

    /// The trailer of this side's next message for this purpose. Allocates nothing.
    ///
    /// # Panics
    /// After 2⁶⁴ messages.
    #[must_use]
    pub fn trailer(&self, purpose: Purpose, message: &[u8]) -> [u8; TRAILER] {
        self.trailer_over(purpose, [message])
    }

    fn trailer_over<const N: usize>(&self, purpose: Purpose, parts: [&[u8]; N]) -> [u8; TRAILER] {
        let number = self.numbers[place(purpose)].fetch_add(1, Ordering::Relaxed);
        let number = number.checked_add(1).expect("no lease lasts so long");
        let tag = covering(&self.own, purpose, number, parts).finalize();
        let mut trailer = [0; TRAILER];
        trailer[..8].copy_from_slice(&number.to_le_bytes());
        trailer[8..].copy_from_slice(&tag.into_bytes()[..TAG]);
        trailer
    }

    /// The message without its trailer, if the other side wrote it for this purpose and it comes for the first time.
    /// Allocates nothing.
    ///
    /// # Errors
    /// It did not, or it does not.
    pub fn open<'a>(&self, purpose: Purpose, sealed: &'a [u8]) -> Result<&'a [u8], Forged> {
        let (message, number) = self.verify(purpose, &[], sealed)?;
        let mut window = self.windows[place(purpose)]
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if window.take(number) {
            Ok(message)
        } else {
            Err(Forged::Replayed)
        }
    }

    /// A message with its trailer.
    ///
    /// # Panics
    /// As [`trailer`](Self::trailer) does.
    #[must_use]
    pub fn seal(&self, purpose: Purpose, message: &[u8]) -> Vec<u8> {
        let trailer = self.trailer(purpose, message);
        [message, &trailer[..]].concat()
    }

    /// An answer with its trailer, which also covers the question.
    ///
    /// # Panics
    /// As [`trailer`](Self::trailer) does.
    #[must_use]
    pub fn seal_answer(&self, purpose: Purpose, question: &[u8], answer: &[u8]) -> Vec<u8> {
        let trailer = self.trailer_over(purpose, [question, answer]);
        [answer, &trailer[..]].concat()
    }

    /// The answer to a question of this side's (sealed as it was sent), if it is the other side's.
    ///
    /// # Errors
    /// It is not, or answers another question.
    pub fn open_answer<'a>(
        &self,
        purpose: Purpose,
        question: &[u8],
        sealed: &'a [u8],
    ) -> Result<&'a [u8], Forged> {
        // An answer that comes twice says the same twice: the question is never asked again.
        let (answer, _) = self.verify(purpose, question, sealed)?;
        Ok(answer)
    }

    fn verify<'a>(
        &self,
        purpose: Purpose,
        question: &[u8],
        sealed: &'a [u8],
    ) -> Result<(&'a [u8], u64), Forged> {
        let too_short = Forged::TooShort { got: sealed.len() };
        let (rest, tag) = sealed.split_last_chunk::<TAG>().ok_or(too_short)?;
        let (message, number) = rest.split_last_chunk::<8>().ok_or(too_short)?;
        let number = u64::from_le_bytes(*number);
        covering(&self.other, purpose, number, [question, message])
            .verify_truncated_left(tag)
            .map_err(|_| Forged::Unauthentic)?;
        Ok((message, number))
    }
}

impl std::fmt::Debug for Channel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Channel")
    }
}

const fn place(purpose: Purpose) -> usize {
    purpose as usize - 1
}

fn keyed(key: &[u8; 32]) -> Hmac<Sha256> {
    Hmac::new_from_slice(key).expect("a key may have any length")
}

/// What a tag is made of: the purpose, the number, and what it covers.
fn covering<const N: usize>(
    key: &Hmac<Sha256>,
    purpose: Purpose,
    number: u64,
    parts: [&[u8]; N],
) -> Hmac<Sha256> {
    let mut mac = key.clone();
    mac.update(&[purpose as u8]);
    mac.update(&number.to_le_bytes());
    for part in parts {
        mac.update(part);
    }
    mac
}
