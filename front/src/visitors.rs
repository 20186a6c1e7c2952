//! Who is connected, address by address: how many connections one may hold, and how often it may show a wrong token.
//!
//! A connection that asks for nothing is worth nothing: where an address holds many of those, or none is free for
//! somebody else, the one that has been silent for longest goes.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::Notify;

/// Connections at once, of everybody. Each watcher has one, and each page a handful besides.
pub(crate) const MOST: usize = 512;
/// Of these, so many are for this machine alone: who looks after a server must reach it.
const FOR_LOOPBACK: usize = 32;
/// Connections of one address.
const MOST_OF_ONE: usize = 256;
/// Connections of one address that ask for nothing: several pages' worth.
const MOST_SILENT_OF_ONE: usize = 32;

/// Wrong tokens that an address may show at once, and the time after which it may show another.
const TRIES: u32 = 20;
const TRY_EVERY: Duration = Duration::from_secs(1);
/// Addresses whose tries are counted. Beyond that, the count that is nearest to being forgotten is.
const MOST_COUNTED: usize = 4096;

/// The address at the other end of a request's connection.
#[derive(Clone, Copy, Debug)]
pub struct Peer(pub IpAddr);

/// Everybody who is connected.
#[derive(Debug, Default)]
pub(crate) struct Visitors {
    visits: Mutex<Visits>,
}

#[derive(Debug, Default)]
struct Visits {
    next: u64,
    held: HashMap<u64, Held>,
}

#[derive(Debug)]
struct Held {
    address: IpAddr,
    /// When it last had something to do, by a count; nothing while it has.
    silent_since: Option<u64>,
    leave: Arc<Leave>,
}

#[derive(Debug, Default)]
struct Leave {
    asked: Notify,
    /// Whether anything was ever asked on the connection.
    has_asked: AtomicBool,
}

/// One connection. Dropping it makes room.
pub(crate) struct Visit {
    visitors: Arc<Visitors>,
    number: u64,
    leave: Arc<Leave>,
}

impl Visitors {
    /// A connection comes from `address`; nothing where it cannot be kept. Another that asks for nothing may have to go
    /// for it.
    pub(crate) fn arrive(self: &Arc<Self>, address: IpAddr) -> Option<Visit> {
        let address = canonical(address);
        let mut visits = self.visits();
        let of_it = visits.held.values().filter(|held| held.address == address);
        let (all, silent) = of_it.fold((0, 0), |(all, silent), held| {
            (all + 1, silent + usize::from(held.silent_since.is_some()))
        });
        if MOST_SILENT_OF_ONE <= silent {
            visits.send_away(|held| held.address == address);
        } else if MOST_OF_ONE <= all {
            return None;
        }
        let limit = if address.is_loopback() {
            MOST
        } else {
            MOST - FOR_LOOPBACK
        };
        if limit <= visits.held.len() && !visits.send_away(|_| true) {
            return None;
        }
        let number = visits.next;
        visits.next += 1;
        let leave = Arc::new(Leave::default());
        let held = Held {
            address,
            silent_since: Some(number),
            leave: Arc::clone(&leave),
        };
        visits.held.insert(number, held);
        Some(Visit {
            visitors: Arc::clone(self),
            number,
            leave,
        })
    }

    fn visits(&self) -> MutexGuard<'_, Visits> {
        self.visits.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Visits {
    /// Asks the connection to go that has asked for nothing for longest, of those that `may` go. Its place is free at
    /// once.
    fn send_away(&mut self, may: impl Fn(&Held) -> bool) -> bool {
        let silent = self.held.iter().filter(|(_, held)| may(held));
        let longest = silent
            .filter_map(|(number, held)| Some((held.silent_since?, *number)))
            .min();
        let Some((_, number)) = longest else {
            return false;
        };
        if let Some(held) = self.held.remove(&number) {
            held.leave.asked.notify_one();
        }
        true
    }
}

impl Visit {
    /// Something is asked.
    pub(crate) fn asks(&self) {
        self.leave.has_asked.store(true, Ordering::Relaxed);
        if let Some(held) = self.visitors.visits().held.get_mut(&self.number) {
            held.silent_since = None;
        }
    }

    /// It was answered.
    pub(crate) fn is_answered(&self) {
        let mut visits = self.visitors.visits();
        let now = visits.next;
        visits.next += 1;
        if let Some(held) = visits.held.get_mut(&self.number) {
            held.silent_since = Some(now);
        }
    }

    /// Waits until it is to make room; whether anything was ever asked on it.
    pub(crate) async fn must_leave(&self) -> bool {
        self.leave.asked.notified().await;
        self.leave.has_asked.load(Ordering::Relaxed)
    }
}

impl Drop for Visit {
    fn drop(&mut self) {
        self.visitors.visits().held.remove(&self.number);
    }
}

/// Wrong tokens, address by address: a bucket each that fills with time.
#[derive(Debug, Default)]
pub struct Tries(Mutex<HashMap<IpAddr, Instant>>);

impl Tries {
    /// How long an address must wait before a token of its is looked at; nothing if it need not.
    pub fn wait(&self, now: Instant, peer: Option<Peer>) -> Option<Duration> {
        let tries = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // The instant at which all is forgotten lies further ahead the more was tried.
        let forgotten = *tries.get(&canonical(peer?.0))?;
        let ahead = forgotten.saturating_duration_since(now);
        let most = TRY_EVERY * (TRIES - 1);
        (most < ahead).then(|| ahead - most)
    }

    /// It was a wrong one.
    pub fn count(&self, now: Instant, peer: Option<Peer>) {
        let Some(Peer(address)) = peer else { return };
        let mut tries = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let forgotten = tries.entry(canonical(address)).or_insert(now);
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

/// An IPv4 address is one, however it is written; of an IPv6 one the network counts, since a household has all the
/// rest.
fn canonical(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) if !address.is_loopback() => {
            IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() >> 64 << 64))
        }
        address => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(last: u8) -> IpAddr {
        IpAddr::from([192, 0, 2, last])
    }

    fn is_sent_away(visit: &Visit) -> bool {
        let visits = visit.visitors.visits();
        !visits.held.contains_key(&visit.number)
    }

    #[test]
    fn of_those_who_ask_for_nothing_the_one_that_was_silent_for_longest_makes_room() {
        let visitors = Arc::new(Visitors::default());
        let mut silent: Vec<Visit> = (0..MOST_SILENT_OF_ONE)
            .map(|_| visitors.arrive(address(1)).unwrap())
            .collect();
        // The first has something to do, and had then.
        silent[0].asks();
        silent[0].is_answered();
        let newcomer = visitors.arrive(address(1)).unwrap();
        assert!(is_sent_away(&silent[1]));
        assert!(!is_sent_away(&silent[0]) && !is_sent_away(&newcomer));
        let elsewhere = visitors.arrive(address(2)).unwrap();
        assert!(!is_sent_away(&silent[2]) && !is_sent_away(&elsewhere));
        silent.clear();
        assert_eq!(visitors.visits().held.len(), 2);
    }

    #[test]
    fn one_address_may_hold_so_many_that_work_and_loopback_always_has_a_place() {
        let visitors = Arc::new(Visitors::default());
        let busy = |last: u8, most: usize| -> Vec<Visit> {
            let visits = (0..most).map_while(|_| {
                let visit = visitors.arrive(address(last))?;
                visit.asks();
                Some(visit)
            });
            visits.collect()
        };
        let one = busy(1, 1000);
        assert_eq!(one.len(), MOST_OF_ONE);
        let others = busy(2, 1000);
        assert_eq!(one.len() + others.len(), MOST - FOR_LOOPBACK);
        assert!(visitors.arrive(address(3)).is_none());
        let own: Vec<_> = (0..FOR_LOOPBACK)
            .map(|_| visitors.arrive(IpAddr::from([127, 0, 0, 1])).unwrap())
            .collect();
        assert!(own.iter().all(|visit| !is_sent_away(visit)));
    }

    #[test]
    fn twenty_wrong_tokens_may_be_shown_at_once_and_then_one_a_second() {
        let tries = Tries::default();
        let began = Instant::now();
        let peer = Some(Peer(address(1)));
        for _ in 0..TRIES {
            assert_eq!(tries.wait(began, peer), None);
            tries.count(began, peer);
        }
        assert_eq!(tries.wait(began, peer), Some(TRY_EVERY));
        assert_eq!(tries.wait(began, Some(Peer(address(2)))), None);
        let later = began + TRY_EVERY;
        assert_eq!(tries.wait(later, peer), None);
        tries.count(later, peer);
        assert_eq!(tries.wait(later, peer), Some(TRY_EVERY));
        assert_eq!(tries.wait(began + TRY_EVERY * 2 * TRIES, peer), None);
    }

    #[test]
    fn the_memory_of_tries_is_bounded() {
        let tries = Tries::default();
        let now = Instant::now();
        for number in 0..3 * MOST_COUNTED as u32 {
            tries.count(now, Some(Peer(IpAddr::from(number.to_be_bytes()))));
        }
        assert_eq!(tries.0.lock().unwrap().len(), MOST_COUNTED);
    }

    #[test]
    fn an_address_is_itself_however_it_is_written() {
        let plain: IpAddr = "192.0.2.1".parse().unwrap();
        assert_eq!(canonical("::ffff:192.0.2.1".parse().unwrap()), plain);
        let [one, other] = ["2001:db8::1", "2001:db8::ffff:2"].map(|text| text.parse().unwrap());
        assert_eq!(canonical(one), canonical(other));
        assert!(canonical("::1".parse().unwrap()).is_loopback());
    }
}
