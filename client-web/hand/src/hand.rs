//! Calls from JavaScript, which passes and takes nothing but numbers: whatever is longer lies in buffers of the module.
//!
//! What a call is to look at is written into [`Buffer::BytesIn`] first. Memory moves when it grows, so a buffer is
//! asked for its address each time. Times are milliseconds of the worker's own clock, as `performance.now()` gives
//! them. The TypeScript side is `client-web/src/protocol/hand_module.ts`; the two change together.

use teleclay_pointer::{Pointer, PointerSetup};
use teleclay_seal::Keys;

use crate::numbers;

/// The call was carried out.
pub const DONE: u32 = 0;
/// The call was refused, and [`Buffer::Refusal`] says why.
pub const REFUSED: u32 = 1;

/// Bytes of the keys before a grant: the handle's, then the server's.
pub const KEYS: usize = 64;

/// The hand of the module, once a grant was taken.
#[derive(Default)]
pub struct Hand {
    pointer: Option<Pointer>,
    bytes_in: Vec<u8>,
    numbers: Vec<f64>,
    refusal: String,
}

/// A stretch of memory that both sides know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Buffer {
    /// What a call is to look at.
    BytesIn,
    /// The message that the last [`Hand::advance`] sends; empty for none.
    Outgoing,
    /// `f64`: what [`Hand::look`] saw, in the order of [`numbers`].
    Numbers,
    /// UTF-8: why a call was refused.
    Refusal,
}

impl Buffer {
    /// By the number that JavaScript gives it.
    #[must_use]
    pub fn numbered(number: u32) -> Option<Self> {
        const ALL: [Buffer; 4] = [
            Buffer::BytesIn,
            Buffer::Outgoing,
            Buffer::Numbers,
            Buffer::Refusal,
        ];
        ALL.get(number as usize).copied()
    }
}

/// Why nothing can be done.
#[derive(Clone, Copy, Debug)]
enum Missing {
    Grant,
    Keys,
}

impl std::fmt::Display for Missing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Grant => "no grant was taken yet",
            Self::Keys => "a grant comes after 64 bytes of keys",
        })
    }
}

impl Hand {
    /// Makes room for so many bytes.
    pub fn resize_bytes_in(&mut self, length: usize) {
        self.bytes_in.resize(length, 0);
    }

    /// What the next call is to look at.
    pub fn bytes_in(&mut self) -> &mut [u8] {
        &mut self.bytes_in
    }

    /// What the last look saw.
    #[must_use]
    pub fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// Why the last call that was refused was.
    #[must_use]
    pub fn refusal(&self) -> &str {
        &self.refusal
    }

    /// What the last advance sends; empty for nothing.
    #[must_use]
    pub fn outgoing(&self) -> &[u8] {
        let pointer = self.pointer.as_ref();
        pointer.and_then(Pointer::outgoing).unwrap_or_default()
    }

    /// Where a buffer begins.
    #[must_use]
    pub fn address(&self, buffer: Buffer) -> *const u8 {
        match buffer {
            Buffer::BytesIn => self.bytes_in.as_ptr(),
            Buffer::Outgoing => self.outgoing().as_ptr(),
            Buffer::Numbers => self.numbers.as_ptr().cast(),
            Buffer::Refusal => self.refusal.as_ptr(),
        }
    }

    /// How many elements of its kind a buffer has.
    #[must_use]
    pub fn length(&self, buffer: Buffer) -> usize {
        match buffer {
            Buffer::BytesIn => self.bytes_in.len(),
            Buffer::Outgoing => self.outgoing().len(),
            Buffer::Numbers => self.numbers.len(),
            Buffer::Refusal => self.refusal.len(),
        }
    }

    /// Takes the keys and the grant that lie in the bytes, for a device that is told `rate_hz` times a second at the
    /// slowest and moves the handle by `motion` times its own way. A hand that was there is gone then; one that could
    /// not be made changes nothing.
    pub fn begin(&mut self, now_ms: f64, rate_hz: f64, motion: f64) -> u32 {
        let setup = PointerSetup {
            rate_hz,
            motion,
            ..PointerSetup::default()
        };
        let Some((keys, granted)) = keys_and_grant(&self.bytes_in) else {
            return self.refuse(&Missing::Keys);
        };
        match Pointer::new(ns(now_ms), setup, granted, &keys) {
            Ok(pointer) => {
                self.pointer = Some(pointer);
                DONE
            }
            Err(error) => self.refuse(&error),
        }
    }

    /// Goes on under the keys and the grant that lie in the bytes: another lease of the same loop.
    pub fn renew(&mut self, now_ms: f64) -> u32 {
        if keys_and_grant(&self.bytes_in).is_none() {
            return self.refuse(&Missing::Keys);
        }
        self.try_with_bytes(|pointer, bytes| {
            keys_and_grant(bytes).map_or(Ok(()), |(keys, granted)| {
                pointer.renew(ns(now_ms), granted, &keys)
            })
        })
    }

    /// Takes the session's parameters, JSON.
    pub fn take_parameters(&mut self) -> u32 {
        self.try_with_bytes(Pointer::handle_parameters)
    }

    /// Begins a snapshot of the clay that the bytes describe, JSON.
    pub fn begin_snapshot(&mut self) -> u32 {
        self.try_with_bytes(Pointer::begin_snapshot)
    }

    /// Takes in a message of bricks of the snapshot.
    pub fn take_in_bricks(&mut self) -> u32 {
        self.try_with_bytes(Pointer::handle_bricks)
    }

    /// All of the snapshot has come.
    pub fn finish_snapshot(&mut self) -> u32 {
        self.try_with_bytes(|pointer, _| pointer.finish_snapshot())
    }

    /// The pointer was somewhere at `at_ms`, which is told at `now_ms`.
    pub fn tell(&mut self, now_ms: f64, at_ms: f64, position_m: [f64; 3]) {
        self.with(|pointer| pointer.handle_sample(ns(now_ms), ns(at_ms), position_m));
    }

    /// A message of frames came.
    pub fn hear(&mut self, now_ms: f64) -> u32 {
        self.try_with_bytes(|pointer, bytes| pointer.handle_frames(ns(now_ms), bytes))
    }

    /// The server has gone.
    pub fn lose_peer(&mut self, now_ms: f64) {
        self.with(|pointer| pointer.handle_peer_gone(ns(now_ms)));
    }

    /// The hand takes hold.
    pub fn hold(&mut self) {
        self.with(Pointer::hold);
    }

    /// The hand lets go.
    pub fn release(&mut self) {
        self.with(Pointer::release);
    }

    /// The hand moves without the handle until it takes hold again.
    pub fn clutch(&mut self) {
        self.with(Pointer::clutch);
    }

    /// Holds axes fast from the next grip on: x by bit 0, y by bit 1, z by bit 2.
    pub fn lock_axes(&mut self, which: u32) {
        self.with(|pointer| pointer.lock_axes([0, 1, 2].map(|axis| which >> axis & 1 == 1)));
    }

    /// The handle moves so much for the pointer's motion.
    pub fn set_motion(&mut self, motion: f64) -> u32 {
        self.try_with_bytes(|pointer, _| pointer.set_motion(motion))
    }

    /// Says goodbye and comes to rest.
    pub fn leave(&mut self) {
        self.with(Pointer::leave);
    }

    /// Makes the ticks that are owed; how many they were.
    pub fn advance(&mut self, now_ms: f64) -> u32 {
        let pointer = self.pointer.as_mut();
        pointer.map_or(0, |pointer| pointer.advance(ns(now_ms)).ticks)
    }

    /// When the next tick is due, ms; never, while there is no hand.
    #[must_use]
    pub fn due_ms(&self) -> f64 {
        let pointer = self.pointer.as_ref();
        pointer.map_or(f64::INFINITY, |pointer| pointer.next_ns() as f64 * 1e-6)
    }

    /// Does what no tick has time for; call it when what the ticks send is on its way.
    pub fn tidy(&mut self) {
        self.with(Pointer::tidy);
    }

    /// Writes the state of the last tick into the numbers; none while there is no hand.
    pub fn look(&mut self) {
        self.numbers.clear();
        if let Some(pointer) = &self.pointer {
            numbers::write(pointer, &mut self.numbers);
        }
    }

    fn with(&mut self, call: impl FnOnce(&mut Pointer)) {
        if let Some(pointer) = &mut self.pointer {
            call(pointer);
        }
    }

    fn try_with_bytes<E: std::fmt::Display>(
        &mut self,
        call: impl FnOnce(&mut Pointer, &[u8]) -> Result<(), E>,
    ) -> u32 {
        let Some(pointer) = &mut self.pointer else {
            return self.refuse(&Missing::Grant);
        };
        match call(pointer, &self.bytes_in) {
            Ok(()) => DONE,
            Err(error) => self.refuse(&error),
        }
    }

    fn refuse(&mut self, error: &dyn std::fmt::Display) -> u32 {
        self.refusal = error.to_string();
        REFUSED
    }
}

fn keys_and_grant(bytes: &[u8]) -> Option<(Keys, &[u8])> {
    let (of_handle, rest) = bytes.split_first_chunk()?;
    let (of_server, granted) = rest.split_first_chunk()?;
    Some((Keys::new(*of_handle, *of_server), granted))
}

/// Nanoseconds of milliseconds; what is no time is the beginning.
fn ns(ms: f64) -> u64 {
    (ms * 1e6) as u64
}
