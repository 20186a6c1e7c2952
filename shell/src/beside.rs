//! A thread that a tick wakes, on the processor of the tick.
//!
//! Waking a thread that rests on another processor costs the one who wakes it an interrupt there, which on a virtual
//! machine is dearer than all else in a tick, and costs the frame the time until that processor is up. On the tick's
//! own processor the thread begins as soon as the tick sleeps. Where that processor is taken, so that the thread comes
//! late there, it goes wherever the scheduler puts it, for a while.
//!
//! Only beside a thread of real time, which no thread beside it can delay.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::Thread;

use crate::ticker::now_ns;

/// Later than this after it was woken, a thread is late, ns.
const LATE_NS: u64 = 500_000;
/// How often in a row it may be.
const LATE_AT_MOST: u32 = 3;
/// How long it is free then: at first, and at most, ns.
const FREE_NS: u64 = 1_000_000_000;
const FREE_AT_MOST_NS: u64 = 64_000_000_000;
/// After so long without being late, the next time is like the first, ns.
const FORGIVEN_NS: u64 = 60_000_000_000;
/// No processor.
const NOWHERE: u64 = 0xFFFF;

/// Where and when a tick has woken the thread beside it last.
#[derive(Debug)]
struct TickPlace {
    /// The processor.
    processor: AtomicU64,
    /// When it woke the thread, ns.
    woken_ns: AtomicU64,
}

impl Default for TickPlace {
    fn default() -> Self {
        Self {
            processor: AtomicU64::new(NOWHERE),
            woken_ns: AtomicU64::new(0),
        }
    }
}

impl TickPlace {
    /// The tick's thread is about to wake the one beside it.
    fn note(&self) {
        self.woken_ns.store(now_ns(), Ordering::Relaxed);
        self.processor
            .store(platform::processor_of_real_time(), Ordering::Relaxed);
    }

    fn processor(&self) -> Option<usize> {
        let processor = self.processor.load(Ordering::Relaxed);
        (processor < NOWHERE).then_some(processor as usize)
    }
}

/// Where a tick tells the thread beside it of itself.
#[derive(Debug)]
pub struct Place(Arc<TickPlace>);

impl Place {
    /// What wakes that thread.
    #[must_use]
    pub fn waking(self, thread: &Thread) -> Waking {
        Waking {
            thread: thread.clone(),
            place: Some(self.0),
        }
    }
}

/// A thread beside a tick, for the tick.
#[derive(Clone, Debug)]
pub struct Waking {
    thread: Thread,
    place: Option<Arc<TickPlace>>,
}

impl Waking {
    /// Wakes the thread.
    pub fn wake(&self) {
        if let Some(place) = &self.place {
            place.note();
        }
        self.thread.unpark();
    }

    /// The same thread, woken by one tick of several: it stays where the scheduler puts it.
    #[must_use]
    pub fn by_one_of_several(&self) -> Self {
        Self {
            thread: self.thread.clone(),
            place: None,
        }
    }
}

/// A thread beside a tick. Belongs to that thread.
#[derive(Debug, Default)]
pub struct Beside {
    place: Arc<TickPlace>,
    /// When it was woken as it knows.
    seen_ns: u64,
    law: Law,
    /// Where the thread may run, once it has been woken.
    everywhere: Option<platform::Processors>,
}

impl Beside {
    /// Beside the tick that is given what [wakes](Place::waking) it. For the thread that will [follow](Self::follow).
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// For the tick: where it tells of itself.
    #[must_use]
    pub fn place(&self) -> Place {
        Place(Arc::clone(&self.place))
    }

    /// The thread was woken: goes where the tick is, or lets the scheduler choose.
    pub fn follow(&mut self) {
        let now_ns = now_ns();
        let woken_ns = self.place.woken_ns.load(Ordering::Relaxed);
        let late_ns = if std::mem::replace(&mut self.seen_ns, woken_ns) == woken_ns {
            // It woke by itself.
            0
        } else {
            now_ns.saturating_sub(woken_ns)
        };
        let tick = self.place.processor();
        if let Some(to) = self.law.next(tick, now_ns, late_ns) {
            let everywhere = self
                .everywhere
                .get_or_insert_with(platform::Processors::of_this_thread);
            // Where it may not go, it stays as it is.
            match to {
                Some(processor) => everywhere.bind_to(processor),
                None => everywhere.free(),
            }
        }
    }
}

/// Where to be.
#[derive(Debug, Default)]
struct Law {
    bound_to: Option<usize>,
    late: u32,
    free_until_ns: u64,
    free_for_ns: u64,
    freed_at_ns: u64,
}

impl Law {
    /// Where to go, if that is another place than before: to a processor, or anywhere.
    fn next(&mut self, tick: Option<usize>, now_ns: u64, late_ns: u64) -> Option<Option<usize>> {
        let is_late = self.bound_to.is_some() && LATE_NS < late_ns;
        self.late = if is_late { self.late + 1 } else { 0 };
        if LATE_AT_MOST <= self.late {
            let is_forgiven = self.freed_at_ns + FORGIVEN_NS < now_ns;
            self.free_for_ns = if is_forgiven || self.free_for_ns == 0 {
                FREE_NS
            } else {
                (2 * self.free_for_ns).min(FREE_AT_MOST_NS)
            };
            self.freed_at_ns = now_ns + self.free_for_ns;
            self.free_until_ns = now_ns + self.free_for_ns;
            self.late = 0;
        }
        let wanted = tick.filter(|_| self.free_until_ns <= now_ns);
        (wanted != self.bound_to).then(|| {
            self.bound_to = wanted;
            wanted
        })
    }
}

#[cfg(target_os = "linux")]
mod platform {
    //! Which processor runs this, and which may.
    #![allow(
        unsafe_code,
        reason = "libc calls; each is given valid pointers to locals and its result is checked"
    )]

    use super::NOWHERE;

    /// The processor that runs the calling thread, if it is one of real time.
    pub(super) fn processor_of_real_time() -> u64 {
        thread_local! {
            // SAFETY: 0 is the calling thread.
            static IS_REAL_TIME: bool = unsafe { libc::sched_getscheduler(0) } == libc::SCHED_FIFO;
        }
        if !IS_REAL_TIME.with(|is| *is) {
            return NOWHERE;
        }
        // SAFETY: takes nothing.
        let processor = unsafe { libc::sched_getcpu() };
        u64::try_from(processor).unwrap_or(NOWHERE)
    }

    /// Those on which the calling thread may run from the start.
    #[derive(Clone, Copy)]
    pub(super) struct Processors(libc::cpu_set_t);

    impl std::fmt::Debug for Processors {
        fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            // SAFETY: the set is initialised.
            write!(f, "{} processors", unsafe { libc::CPU_COUNT(&self.0) })
        }
    }

    impl Processors {
        pub(super) fn of_this_thread() -> Self {
            // SAFETY: an empty set is all zeros.
            let mut set: libc::cpu_set_t = unsafe { std::mem::zeroed() };
            // SAFETY: the set is as long as is said. Where it cannot be had it stays empty, and nothing is bound.
            unsafe { libc::sched_getaffinity(0, size_of::<libc::cpu_set_t>(), &raw mut set) };
            Self(set)
        }

        pub(super) fn bind_to(&self, processor: usize) {
            // SAFETY: the set is initialised; a processor beyond its end is not looked at.
            let may = processor < libc::CPU_SETSIZE as usize
                && unsafe { libc::CPU_ISSET(processor, &self.0) };
            if may {
                // SAFETY: an empty set is all zeros, and has room for this processor.
                let set = unsafe {
                    let mut set: libc::cpu_set_t = std::mem::zeroed();
                    libc::CPU_SET(processor, &mut set);
                    set
                };
                Self::run_on(&set);
            }
        }

        pub(super) fn free(&self) {
            Self::run_on(&self.0);
        }

        fn run_on(set: &libc::cpu_set_t) {
            // SAFETY: the set is as long as is said. Refused, the thread stays where it may be now.
            unsafe { libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), set) };
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod platform {
    //! Nothing is known of processors, and no thread is bound.

    pub(super) fn processor_of_real_time() -> u64 {
        super::NOWHERE
    }

    #[derive(Debug)]
    pub(super) struct Processors;

    impl Processors {
        pub(super) fn of_this_thread() -> Self {
            Self
        }

        pub(super) fn bind_to(&self, _processor: usize) {}

        pub(super) fn free(&self) {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn a_thread_goes_where_the_tick_is_and_follows_it() {
        let mut law = Law::default();
        assert_eq!(law.next(None, 0, 0), None, "no tick of real time: nothing");
        assert_eq!(law.next(Some(1), MS, 10_000), Some(Some(1)));
        assert_eq!(law.next(Some(1), 2 * MS, 10_000), None);
        assert_eq!(law.next(Some(0), 3 * MS, 10_000), Some(Some(0)));
        assert_eq!(law.next(None, 4 * MS, 10_000), Some(None));
    }

    /// Once is chance; again and again is a processor that is taken.
    #[test]
    fn one_that_comes_late_is_freed_for_longer_each_time_until_that_is_long_ago() {
        let mut law = Law::default();
        let mut now = MS;
        let mut lengths = Vec::new();
        law.next(Some(0), now, 0);
        for _ in 0..9 {
            for late in 0..3 {
                now += MS;
                let told = law.next(Some(0), now, LATE_NS + 1);
                assert_eq!(told, (late == 2).then_some(None), "the third in a row");
            }
            let freed = now;
            // Free, it is where the scheduler wants it: being late there says nothing of the tick's processor.
            while law.next(Some(0), now, 2 * LATE_NS).is_none() {
                now += 100 * MS;
            }
            lengths.push((now - freed) / 1_000_000_000);
        }
        assert_eq!(lengths, [1, 2, 4, 8, 16, 32, 64, 64, 64]);
        // A minute on time, and a late one now and then, are forgiven.
        for tick in 0..61_000 {
            now += MS;
            let late_ns = if tick % 2 == 0 { LATE_NS + 1 } else { 0 };
            assert_eq!(law.next(Some(0), now, late_ns), None);
        }
        for _ in 0..3 {
            now += MS;
            law.next(Some(0), now, LATE_NS + 1);
        }
        assert_eq!(law.next(Some(0), now + FREE_NS - 1, 0), None);
        assert_eq!(law.next(Some(0), now + FREE_NS, 0), Some(Some(0)));
    }

    /// On this machine, whatever it grants: no call makes a thread run where it may not, or ends it.
    #[test]
    fn a_thread_that_follows_runs_where_it_may() {
        let mut beside = Beside::new();
        let place = Arc::clone(&beside.place);
        beside.follow();
        beside.place().waking(&std::thread::current()).wake();
        beside.follow();
        place.processor.store(NOWHERE - 1, Ordering::Relaxed);
        beside.follow();
        place.processor.store(0, Ordering::Relaxed);
        beside.follow();
        place.processor.store(NOWHERE, Ordering::Relaxed);
        beside.follow();
        assert_eq!(beside.law.bound_to, None);
    }
}
