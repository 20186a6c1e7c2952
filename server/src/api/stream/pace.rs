//! How fast a socket is heard: a bucket that each message takes one from.

use std::time::Instant;

/// Messages that are heard in a second, and that may come at once.
pub(super) struct Pace {
    per_s: f64,
    at_once: f64,
    left: f64,
    refilled: Instant,
}

impl Pace {
    /// For a loop: twice what one of 1 kHz sends at most, and what a second without a network holds back.
    pub(super) fn of_a_hand(now: Instant) -> Self {
        Self::new(2000.0, 1000.0, now)
    }

    /// For whoever holds no tool: more than any page asks, and at once what a hand may have had on its way when its
    /// lease ended.
    pub(super) fn of_a_watcher(now: Instant) -> Self {
        Self::new(100.0, 1000.0, now)
    }

    fn new(per_s: f64, at_once: f64, now: Instant) -> Self {
        Self {
            per_s,
            at_once,
            left: at_once,
            refilled: now,
        }
    }

    /// Whether another message may be heard now; then it counts.
    pub(super) fn may_hear(&mut self, now: Instant) -> bool {
        let passed_s = now.duration_since(self.refilled).as_secs_f64();
        self.left = self.at_once.min(self.left + self.per_s * passed_s);
        self.refilled = now;
        let may_hear = 1.0 <= self.left;
        self.left -= f64::from(u8::from(may_hear));
        may_hear
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    /// However often somebody asks, ten seconds are worth ten seconds' messages and those that may come at once.
    #[test]
    fn ten_seconds_are_worth_ten_seconds_messages() {
        for (make, per_s) in [
            (Pace::of_a_hand as fn(Instant) -> Pace, 2000_usize),
            (Pace::of_a_watcher, 100),
        ] {
            let began = Instant::now();
            let mut pace = make(began);
            let asked = (0..=200_000).map(|number| began + Duration::from_micros(50 * number));
            let heard = asked.filter(|now| pace.may_hear(*now)).count();
            assert!((1000 + 10 * per_s).abs_diff(heard) <= 1, "{heard}");
        }
    }

    #[test]
    fn a_loop_is_never_kept_waiting() {
        let began = Instant::now();
        let mut pace = Pace::of_a_hand(began);
        for tick in 0..100_000 {
            assert!(pace.may_hear(began + Duration::from_millis(tick)));
        }
    }
}
