//! Who is connected, address by address: how many connections one may hold.
//!
//! A connection that asks for nothing is worth nothing: where an address holds many of those, or none is free for
//! somebody else, the one that has been silent for longest goes. Where none can go, there are a few places still for
//! what is urgent and nothing else.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

/// Connections at once, of everybody. Each watcher has one, and each page a handful besides.
pub(crate) const MOST: usize = 512;
/// Of these, so many are for this machine alone: who looks after a server must reach it.
const FOR_LOOPBACK: usize = 32;
/// Connections of one address.
const MOST_OF_ONE: usize = 256;
/// Connections of one address that ask for nothing: several pages' worth.
const MOST_SILENT_OF_ONE: usize = 32;
/// Connections beyond all these on which what is urgent is heard. Whoever has not asked yet makes room for the next.
const MOST_URGENT: usize = 32;

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

/// What a connection is good for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// For whatever is asked.
    Usual,
    /// For what is urgent: every other place is taken.
    Urgent,
}

#[derive(Debug)]
struct Held {
    address: IpAddr,
    place: Place,
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
    place: Place,
    leave: Arc<Leave>,
}

impl Visitors {
    /// A connection comes from `address`; nothing where it cannot be kept. Another that asks for nothing may have to go
    /// for it.
    pub(crate) fn arrive(self: &Arc<Self>, address: IpAddr) -> Option<Visit> {
        let address = canonical(address);
        let mut visits = self.visits();
        let place = visits.place_for(address)?;
        let number = visits.next;
        visits.next += 1;
        let leave = Arc::new(Leave::default());
        let held = Held {
            address,
            place,
            silent_since: Some(number),
            leave: Arc::clone(&leave),
        };
        visits.held.insert(number, held);
        Some(Visit {
            visitors: Arc::clone(self),
            number,
            place,
            leave,
        })
    }

    fn visits(&self) -> MutexGuard<'_, Visits> {
        self.visits.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Visits {
    /// The place of one more connection from `address`, free from now on.
    fn place_for(&mut self, address: IpAddr) -> Option<Place> {
        if self.has_usual_place(address) {
            return Some(Place::Usual);
        }
        let is_urgent = |held: &Held| held.place == Place::Urgent;
        let urgent = self.held.values().filter(|held| is_urgent(held)).count();
        let is_free = urgent < MOST_URGENT
            || self.send_away(|held| is_urgent(held) && held.address == address)
            || self.send_away(is_urgent);
        is_free.then_some(Place::Urgent)
    }

    fn has_usual_place(&mut self, address: IpAddr) -> bool {
        let is_usual = |held: &Held| held.place == Place::Usual;
        let of_it = |held: &Held| is_usual(held) && held.address == address;
        let (all, silent) = self
            .held
            .values()
            .filter(|held| of_it(held))
            .fold((0, 0), |(all, silent), held| {
                (all + 1, silent + usize::from(held.silent_since.is_some()))
            });
        if MOST_SILENT_OF_ONE <= silent {
            self.send_away(of_it);
        } else if MOST_OF_ONE <= all {
            return false;
        }
        let limit = if address.is_loopback() {
            MOST
        } else {
            MOST - FOR_LOOPBACK
        };
        let usual = self.held.values().filter(|held| is_usual(held)).count();
        usual < limit || self.send_away(is_usual)
    }

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
    /// What it is good for.
    pub(crate) fn place(&self) -> Place {
        self.place
    }

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

/// An IPv4 address is one, however it is written; of an IPv6 one the network counts, since a household has all the
/// rest.
pub(crate) fn canonical(address: IpAddr) -> IpAddr {
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
                (visit.place() == Place::Usual).then_some(visit)
            });
            visits.collect()
        };
        let one = busy(1, 1000);
        assert_eq!(one.len(), MOST_OF_ONE);
        let others = busy(2, 1000);
        assert_eq!(one.len() + others.len(), MOST - FOR_LOOPBACK);
        assert_eq!(visitors.arrive(address(3)).unwrap().place(), Place::Urgent);
        let own: Vec<_> = (0..FOR_LOOPBACK)
            .map(|_| visitors.arrive(IpAddr::from([127, 0, 0, 1])).unwrap())
            .collect();
        assert!(own.iter().all(|visit| !is_sent_away(visit)));
    }

    /// Whoever fills every place, those for what is urgent too, keeps nobody from the next of these.
    #[test]
    fn there_is_always_a_place_for_what_is_urgent() {
        let visitors = Arc::new(Visitors::default());
        let flood = |last: u8| -> Vec<Visit> {
            let visits = (0..MOST_OF_ONE + MOST_URGENT).filter_map(|_| {
                let visit = visitors.arrive(address(last))?;
                if visit.place() == Place::Usual {
                    visit.asks();
                }
                Some(visit)
            });
            visits.collect()
        };
        let floods = [flood(1), flood(2)];
        for last in [1, 2, 3] {
            let visit = visitors.arrive(address(last)).unwrap();
            assert_eq!(visit.place(), Place::Urgent);
            // Once it asks, nothing takes the place away.
            visit.asks();
            let next: Vec<_> = (0..2 * MOST_URGENT)
                .map(|_| visitors.arrive(address(1)).unwrap())
                .collect();
            assert!(!is_sent_away(&visit) && is_sent_away(&next[0]));
        }
        drop(floods);
        assert_eq!(visitors.arrive(address(3)).unwrap().place(), Place::Usual);
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
