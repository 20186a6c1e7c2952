//! Whose streams are open: one address cannot take the places of all.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Streams that one address may have open at once; a quarter of all places. Loopback is everybody on the server's own
/// machine, a proxy that others come through perhaps, and may have all of them.
pub(crate) const MAX_WATCHERS_OF_ONE: usize = 16;

/// How many streams each address has open.
#[derive(Clone, Debug, Default)]
pub(crate) struct Watchers(Arc<Mutex<HashMap<IpAddr, usize>>>);

/// A stream that is open. It counts until it is dropped.
#[derive(Debug)]
pub(crate) struct Entered {
    watchers: Watchers,
    address: Option<IpAddr>,
}

impl Watchers {
    /// Counts a stream from there, unless there are enough.
    pub(crate) fn enter(&self, address: Option<IpAddr>) -> Option<Entered> {
        let counted = address
            .map(|address| address.to_canonical())
            .filter(|address| !address.is_loopback());
        if let Some(address) = counted {
            let mut open = self.open();
            let count = open.entry(address).or_default();
            if MAX_WATCHERS_OF_ONE <= *count {
                return None;
            }
            *count += 1;
        }
        Some(Entered {
            watchers: self.clone(),
            address: counted,
        })
    }

    fn open(&self) -> MutexGuard<'_, HashMap<IpAddr, usize>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Entered {
    fn drop(&mut self) {
        let Some(address) = self.address else {
            return;
        };
        let mut open = self.watchers.open();
        if let Some(count) = open.get_mut(&address) {
            *count -= 1;
            if *count == 0 {
                open.remove(&address);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_keeps_no_other_one_out_and_gets_its_places_back() {
        let watchers = Watchers::default();
        let address = |text: &str| Some(text.parse::<IpAddr>().unwrap());
        let one = address("192.0.2.1");
        let mut held: Vec<Entered> = (0..MAX_WATCHERS_OF_ONE)
            .map(|_| watchers.enter(one).unwrap())
            .collect();
        assert!(watchers.enter(one).is_none());
        // The same address, as a socket for both families writes it.
        assert!(watchers.enter(address("::ffff:192.0.2.1")).is_none());
        let other = watchers.enter(address("192.0.2.2")).unwrap();
        held.pop();
        held.push(watchers.enter(one).unwrap());
        assert!(watchers.enter(one).is_none());
        // The server's own machine is not counted, nor is what has no address.
        let inside: Vec<Entered> = (0..100)
            .map(|_| watchers.enter(address("127.0.0.1")).unwrap())
            .collect();
        assert!(watchers.enter(None).is_some());
        drop((held, other, inside));
        assert!(watchers.open().is_empty(), "nothing is left behind");
    }
}
