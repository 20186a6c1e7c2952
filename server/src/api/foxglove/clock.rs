//! When a sample of a session was, by everybody's clock.

/// What is observed later than expected by more than this was not merely slow: the loop has given up ticks, or the
/// system's clock was set.
const JUMP_NS: i128 = 200_000_000;

/// How the time of a session lies in that since 1970. A sample is observed a while after it was taken, never before:
/// the least of what is observed is the best guess, and the stamps of a topic stay evenly spaced.
#[derive(Debug, Default)]
pub(super) struct SessionClock {
    began_ns: Option<i128>,
}

impl SessionClock {
    /// At `now_ns` since 1970 a sample of `time_s` was there.
    pub(super) fn observe(&mut self, now_ns: u64, time_s: f64) {
        let began_ns = i128::from(now_ns) - session_ns(time_s);
        let is_kept = |kept: i128| kept <= began_ns && began_ns - kept < JUMP_NS;
        if !self.began_ns.is_some_and(is_kept) {
            self.began_ns = Some(began_ns);
        }
    }

    /// When `time_s` of the session is, ns since 1970; what is told where nothing was observed yet.
    pub(super) fn stamp_ns(&self, time_s: f64, otherwise_ns: u64) -> u64 {
        let Some(began_ns) = self.began_ns else {
            return otherwise_ns;
        };
        u64::try_from(began_ns + session_ns(time_s)).unwrap_or(otherwise_ns)
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

    #[test]
    fn stamps_are_as_evenly_spaced_as_the_samples_however_late_they_are_observed() {
        let mut clock = SessionClock::default();
        let mut stamps = Vec::new();
        for step in 0..500_u64 {
            let time_s = step as f64 * 0.02;
            // Between 1 and 19 ms late, in no order.
            let late_ns = 1_000_000 * (1 + step * 7 % 19);
            clock.observe(BEGAN_NS + 20_000_000 * step + late_ns, time_s);
            stamps.push(clock.stamp_ns(time_s, 0));
        }
        // Once the least lateness was seen.
        for pair in stamps[20..].windows(2) {
            assert_eq!(pair[1] - pair[0], 20_000_000);
        }
        assert_eq!(stamps[499], BEGAN_NS + 499 * 20_000_000 + 1_000_000);
    }

    #[test]
    fn a_loop_that_has_given_up_a_second_is_followed() {
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
