//! Which ticks are owed: absolute deadlines, so that no lateness adds up, however irregularly somebody wakes.

/// Ticks that are made up for at once, at most. The ramps of this side end within them, 50 ms at 0.5 ms a tick: whoever
/// wakes after a long gap lets go of everything in the very same call.
pub const MOST_AT_ONCE: u32 = 100;

/// The deadlines of a loop.
///
/// ```
/// use teleclay_pointer::{Deadlines, MOST_AT_ONCE};
///
/// let mut deadlines = Deadlines::new(0, 1_000_000);
/// assert_eq!(deadlines.take(999_999).ticks, 0);
/// let owed = deadlines.take(4_200_000);
/// assert_eq!((owed.first_ns, owed.ticks, owed.given_up), (1_000_000, 4, 0));
/// // A laptop that slept: the newest are made, the others are counted.
/// let owed = deadlines.take(9_004_000_000);
/// assert_eq!((owed.ticks, owed.given_up), (MOST_AT_ONCE, 9_000 - 100));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Deadlines {
    tick_ns: u64,
    next_ns: u64,
}

/// Ticks that are to be made now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Owed {
    /// Deadline of the first.
    pub first_ns: u64,
    /// How many, [`MOST_AT_ONCE`] at most.
    pub ticks: u32,
    /// Older ones, which nobody makes any more.
    pub given_up: u64,
}

impl Deadlines {
    /// The first tick is due a tick after `now_ns`.
    #[must_use]
    pub fn new(now_ns: u64, tick_ns: u64) -> Self {
        let tick_ns = tick_ns.max(1);
        Self {
            tick_ns,
            next_ns: now_ns.saturating_add(tick_ns),
        }
    }

    /// What is owed at `now_ns`; from then on it is not owed any more. A clock that goes backwards owes nothing.
    pub fn take(&mut self, now_ns: u64) -> Owed {
        let first_ns = self.next_ns;
        let Some(late_ns) = now_ns.checked_sub(first_ns) else {
            return Owed::default();
        };
        let due = late_ns / self.tick_ns + 1;
        let ticks = due.min(u64::from(MOST_AT_ONCE));
        let given_up = due - ticks;
        // Below the present, but for the last one.
        let last_ns = first_ns + (due - 1) * self.tick_ns;
        self.next_ns = last_ns.saturating_add(self.tick_ns);
        Owed {
            first_ns: first_ns + given_up * self.tick_ns,
            ticks: ticks as u32,
            given_up,
        }
    }

    /// When the next tick is due.
    #[must_use]
    pub fn next_ns(&self) -> u64 {
        self.next_ns
    }

    /// From deadline to deadline.
    #[must_use]
    pub fn tick_ns(&self) -> u64 {
        self.tick_ns
    }
}
