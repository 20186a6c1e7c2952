//! When a sample of a session was, by everybody's clock.

/// What is observed later or earlier than expected by more than this was not merely slow or fast: the loop has given up
/// ticks, or the system's clock was set.
const JUMP_NS: i128 = 200_000_000;

/// How the time of a session lies in that since 1970. A sample is observed a while after it was taken, never before:
/// the least of what is observed is the best guess, and the stamps of a topic stay evenly spaced. A better guess turns
/// no stamp back.
#[derive(Clone, Copy, Debug, Default)]
pub struct SessionClock {
    laid: Option<Laid>,
}

#[derive(Clone, Copy, Debug)]
struct Laid {
    /// When the session began, ns since 1970.
    began_ns: i128,
    /// The latest time of the session that was observed, ns.
    newest_ns: i128,
    /// The latest stamp by guesses that were worse, ns since 1970.
    floor_ns: i128,
}

impl SessionClock {
    /// At `now_ns` since 1970 a sample of `time_s` was there.
    pub fn observe(&mut self, now_ns: u64, time_s: f64) {
        let own_ns = session_ns(time_s);
        let began_ns = i128::from(now_ns) - own_ns;
        self.laid = Some(match self.laid {
            Some(laid) if (began_ns - laid.began_ns).abs() < JUMP_NS => Laid {
                began_ns: laid.began_ns.min(began_ns),
                newest_ns: laid.newest_ns.max(own_ns),
                floor_ns: if began_ns < laid.began_ns {
                    laid.floor_ns.max(laid.began_ns + laid.newest_ns)
                } else {
                    laid.floor_ns
                },
            },
            _ => Laid {
                began_ns,
                newest_ns: own_ns,
                floor_ns: i128::MIN,
            },
        });
    }

    /// When `time_s` of the session is, ns since 1970; what is told where nothing was observed yet, and where it lies
    /// before 1970.
    #[must_use]
    pub fn stamp_ns(&self, time_s: f64, otherwise_ns: u64) -> u64 {
        self.laid.map_or(otherwise_ns, |laid| {
            let stamp_ns = (laid.began_ns + session_ns(time_s)).max(laid.floor_ns);
            u64::try_from(stamp_ns).unwrap_or(otherwise_ns)
        })
    }
}

/// A loop ticks in whole milliseconds; microseconds are more than enough.
fn session_ns(time_s: f64) -> i128 {
    (time_s * 1e6).round() as i128 * 1000
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEGAN_NS: u64 = 1_700_000_000_000_000_000;

    /// Between 1 and 19 ms late, and none overtakes another; the first is late, too.
    #[test]
    fn stamps_are_as_evenly_spaced_as_the_samples_however_late_they_are_observed() {
        let mut clock = SessionClock::default();
        let mut stamps = Vec::new();
        for step in 0..500_u64 {
            let time_s = step as f64 * 0.02;
            let now_ns = BEGAN_NS + 20_000_000 * step + 1_000_000 * (1 + (step + 18) * 7 % 19);
            clock.observe(now_ns, time_s);
            let stamp_ns = clock.stamp_ns(time_s, 0);
            assert!(stamp_ns <= now_ns, "nothing is stamped before it was there");
            stamps.push(stamp_ns);
        }
        // Once the least lateness was seen.
        for pair in stamps[40..].windows(2) {
            assert_eq!(pair[1] - pair[0], 20_000_000);
        }
        assert_eq!(stamps[499], BEGAN_NS + 499 * 20_000_000 + 1_000_000);
    }

    /// An event comes at once, and samples 9 ms late: what was stamped by these alone was stamped too late.
    #[test]
    fn a_better_guess_turns_no_stamp_back() {
        const MS: u64 = 1_000_000;
        let mut clock = SessionClock::default();
        clock.observe(BEGAN_NS + 9 * MS, 0.0);
        let before_ns = clock.stamp_ns(0.0, 0);
        assert_eq!(before_ns, BEGAN_NS + 9 * MS);
        clock.observe(BEGAN_NS + 10 * MS, 0.010);
        let stamps = [0.004, 0.008, 0.012, 0.016].map(|time_s| clock.stamp_ns(time_s, 0));
        assert_eq!(stamps, [9, 9, 12, 16].map(|ms| BEGAN_NS + ms * MS));
    }

    #[test]
    fn a_loop_that_has_given_up_a_second_is_followed_and_so_is_a_clock_that_was_set() {
        let mut clock = SessionClock::default();
        clock.observe(BEGAN_NS + 1_000_000_000, 1.0);
        assert_eq!(clock.stamp_ns(1.0, 0), BEGAN_NS + 1_000_000_000);
        clock.observe(BEGAN_NS + 3_000_000_000, 2.0);
        assert_eq!(clock.stamp_ns(2.0, 0), BEGAN_NS + 3_000_000_000);
        clock.observe(BEGAN_NS, 2.5);
        assert_eq!(clock.stamp_ns(2.5, 0), BEGAN_NS);
    }

    #[test]
    fn before_anything_was_observed_it_is_now() {
        assert_eq!(SessionClock::default().stamp_ns(5.0, 77), 77);
    }
}
