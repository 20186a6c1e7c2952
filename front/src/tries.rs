//! How often an address may show a wrong token.
//!
//! A stop has a budget of its own, so that nothing that was shown before keeps one from being heard. A token that was
//! good from an address before is looked at there whatever was tried since, where it is to stop something: that tells
//! whoever guesses at that address of the tokens in use there, and nobody else of anything.

use std::collections::{HashMap, HashSet, VecDeque};
use std::hash::{BuildHasher as _, RandomState};
use std::net::IpAddr;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::visitors::{Peer, canonical};

/// Wrong tokens that an address may show at once, and the time after which it may show another.
const TRIES: u32 = 20;
const TRY_EVERY: Duration = Duration::from_secs(1);
/// Addresses whose tries are counted. Beyond that, the count that is nearest to being forgotten is.
const MOST_COUNTED: usize = 4096;
/// Tokens that were good from somewhere. Beyond that, the one that was known first is forgotten.
const MOST_KNOWN: usize = 4096;

/// What a token is shown for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShownFor {
    /// A stop.
    Stop,
    /// Anything else.
    Else,
}

/// Wrong tokens, address by address, and what was good.
#[derive(Debug, Default)]
pub struct Tries {
    stops: Buckets,
    others: Buckets,
    known: Mutex<Known>,
    /// Of its own chance, so that nobody finds two tokens that it takes for one.
    hasher: RandomState,
}

impl Tries {
    /// How long an address must wait before this token of its is looked at; nothing if it need not.
    pub fn wait(
        &self,
        now: Instant,
        peer: Option<Peer>,
        token: &str,
        what: ShownFor,
    ) -> Option<Duration> {
        let address = canonical(peer?.0);
        if what == ShownFor::Stop && locked(&self.known).has(self.mark(address, token)) {
            return None;
        }
        self.buckets(what).wait(now, address)
    }

    /// It was a wrong one.
    pub fn count_wrong(&self, now: Instant, peer: Option<Peer>, what: ShownFor) {
        if let Some(Peer(address)) = peer {
            self.buckets(what).count(now, canonical(address));
        }
    }

    /// It was a good one.
    pub fn count_good(&self, peer: Option<Peer>, token: &str) {
        if let Some(Peer(address)) = peer {
            let mark = self.mark(canonical(address), token);
            locked(&self.known).take_in(mark);
        }
    }

    fn mark(&self, address: IpAddr, token: &str) -> u64 {
        self.hasher.hash_one((address, token))
    }

    fn buckets(&self, what: ShownFor) -> &Buckets {
        match what {
            ShownFor::Stop => &self.stops,
            ShownFor::Else => &self.others,
        }
    }
}

/// A bucket for each address, which fills with time.
#[derive(Debug, Default)]
struct Buckets(Mutex<HashMap<IpAddr, Instant>>);

impl Buckets {
    fn wait(&self, now: Instant, address: IpAddr) -> Option<Duration> {
        // The instant at which all is forgotten lies further ahead the more was tried.
        let forgotten = *locked(&self.0).get(&address)?;
        let ahead = forgotten.saturating_duration_since(now);
        let most = TRY_EVERY * (TRIES - 1);
        (most < ahead).then(|| ahead - most)
    }

    fn count(&self, now: Instant, address: IpAddr) {
        let mut tries = locked(&self.0);
        let forgotten = tries.entry(address).or_insert(now);
        *forgotten = (*forgotten).max(now) + TRY_EVERY;
        if MOST_COUNTED < tries.len() {
            tries.retain(|_, forgotten| now < *forgotten);
        }
        if MOST_COUNTED < tries.len()
            && let Some(address) = tries
                .iter()
                .min_by_key(|(_, until)| **until)
                .map(|(a, _)| *a)
        {
            tries.remove(&address);
        }
    }
}

/// Marks of what was good, in the order in which they came.
#[derive(Debug, Default)]
struct Known {
    marks: HashSet<u64>,
    order: VecDeque<u64>,
}

impl Known {
    fn has(&self, mark: u64) -> bool {
        self.marks.contains(&mark)
    }

    fn take_in(&mut self, mark: u64) {
        if !self.marks.insert(mark) {
            return;
        }
        self.order.push_back(mark);
        if MOST_KNOWN < self.order.len()
            && let Some(first) = self.order.pop_front()
        {
            self.marks.remove(&first);
        }
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOKEN: &str = "the right token";

    fn peer(last: u8) -> Option<Peer> {
        Some(Peer(IpAddr::from([192, 0, 2, last])))
    }

    #[test]
    fn twenty_wrong_tokens_may_be_shown_at_once_and_then_one_a_second() {
        for what in [ShownFor::Stop, ShownFor::Else] {
            let tries = Tries::default();
            let wait = |now, peer| tries.wait(now, peer, TOKEN, what);
            let began = Instant::now();
            for _ in 0..TRIES {
                assert_eq!(wait(began, peer(1)), None);
                tries.count_wrong(began, peer(1), what);
            }
            assert_eq!(wait(began, peer(1)), Some(TRY_EVERY));
            assert_eq!(wait(began, peer(2)), None);
            let later = began + TRY_EVERY;
            assert_eq!(wait(later, peer(1)), None);
            tries.count_wrong(later, peer(1), what);
            assert_eq!(wait(later, peer(1)), Some(TRY_EVERY));
            assert_eq!(wait(began + TRY_EVERY * 2 * TRIES, peer(1)), None);
        }
    }

    #[test]
    fn nothing_that_was_shown_for_something_else_keeps_a_stop_waiting() {
        let tries = Tries::default();
        let now = Instant::now();
        for _ in 0..1000 {
            tries.count_wrong(now, peer(1), ShownFor::Else);
        }
        assert!(tries.wait(now, peer(1), TOKEN, ShownFor::Else).is_some());
        assert_eq!(tries.wait(now, peer(1), TOKEN, ShownFor::Stop), None);
    }

    /// Wrong stops use up the budget of stops, but for a token that was good there before.
    #[test]
    fn whoever_is_known_may_stop_whatever_was_tried() {
        let tries = Tries::default();
        let now = Instant::now();
        tries.count_good(peer(1), TOKEN);
        for _ in 0..1000 {
            tries.count_wrong(now, peer(1), ShownFor::Stop);
            tries.count_wrong(now, peer(2), ShownFor::Stop);
        }
        let wait = |last, token| tries.wait(now, peer(last), token, ShownFor::Stop);
        assert_eq!(wait(1, TOKEN), None);
        assert!(wait(1, "another token").is_some());
        assert!(wait(2, TOKEN).is_some());
    }

    #[test]
    fn the_memory_of_tries_is_bounded() {
        let tries = Tries::default();
        let now = Instant::now();
        for number in 0..3 * MOST_COUNTED as u32 {
            let peer = Some(Peer(IpAddr::from(number.to_be_bytes())));
            tries.count_wrong(now, peer, ShownFor::Else);
            tries.count_good(peer, TOKEN);
        }
        assert_eq!(locked(&tries.others.0).len(), MOST_COUNTED);
        let known = locked(&tries.known);
        assert_eq!(
            (known.marks.len(), known.order.len()),
            (MOST_KNOWN, MOST_KNOWN)
        );
    }
}
