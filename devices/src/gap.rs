//! Notices that time passed without the driver: a laptop that slept, a process that was stopped.
//!
//! Linux's monotonic clock stands still while the machine sleeps, and the wall's does not: where the two part, the
//! machine slept. A wall clock that somebody sets looks the same, and costs one more press of a button.

/// A driver steps every few milliseconds. One that did not for this long was stopped.
const STALL_NS: u64 = 500_000_000;
/// Corrections of a wall clock by a server of time are far smaller.
const SLEEP_NS: u64 = 2_000_000_000;

/// What two clocks show, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clocks {
    /// Monotonic, from any origin.
    pub now_ns: u64,
    /// Of the day.
    pub wall_ns: u64,
}

/// Compares the clocks of one step with those of the last.
#[derive(Clone, Copy, Debug, Default)]
pub struct GapWatch {
    last: Option<Clocks>,
}

impl GapWatch {
    /// Whether, since the last step, so much time passed that whoever held the device must take hold anew.
    pub fn step(&mut self, clocks: Clocks) -> bool {
        let Some(last) = self.last.replace(clocks) else {
            return false;
        };
        let passed_ns = clocks.now_ns.saturating_sub(last.now_ns);
        let on_the_wall_ns = clocks.wall_ns.saturating_sub(last.wall_ns);
        let parted_ns = on_the_wall_ns.abs_diff(passed_ns);
        let is_set_back = clocks.wall_ns.saturating_add(SLEEP_NS) < last.wall_ns;
        STALL_NS <= passed_ns || SLEEP_NS <= parted_ns || is_set_back
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn watch(steps: &[(u64, u64)]) -> Vec<bool> {
        let mut watch = GapWatch::default();
        let clocks = |&(now_ns, wall_ns)| Clocks { now_ns, wall_ns };
        steps.iter().map(clocks).map(|at| watch.step(at)).collect()
    }

    #[test]
    fn steps_in_time_are_no_gap_even_where_the_wall_clock_is_corrected_a_little() {
        let wall = 1_000_000 * MS;
        let seen = watch(&[
            (0, wall),
            (4 * MS, wall + 4 * MS),
            (8 * MS, wall + 60 * MS),
            (12 * MS, wall + 16 * MS),
        ]);
        assert_eq!(seen, [false; 4]);
    }

    #[test]
    fn sleep_a_stall_and_a_clock_that_is_set_are_gaps_once() {
        let wall = 1_000_000 * MS;
        let slept = watch(&[
            (0, wall),
            (4 * MS, wall + 60_000 * MS),
            (8 * MS, wall + 60_004 * MS),
        ]);
        assert_eq!(slept, [false, true, false]);
        let stalled = watch(&[(0, wall), (600 * MS, wall + 600 * MS)]);
        assert_eq!(stalled, [false, true]);
        let set_back = watch(&[(0, wall), (4 * MS, wall - 60_000 * MS)]);
        assert_eq!(set_back, [false, true]);
    }
}
