//! What a watcher may cost: a token bucket over all its messages.

use std::time::Instant;

/// Bytes per second that a watcher gets: 2 Mbit/s, a tenth of what a modest wireless link carries.
const BYTES_PER_S: f64 = 250_000.0;

/// Bytes that may be saved up, and that may be owed: one second's. A first keyframe of the clay then comes at once.
const BURST_BYTES: f64 = BYTES_PER_S;

/// Bytes that may still be sent. Bricks wait for it, and so do requests, whose answers are not small when they are
/// many; the rest is small, is sent anyway, and is taken off.
pub(in crate::api) struct Budget {
    left_bytes: f64,
    refilled: Instant,
    /// A request has been heard in debt since the last refill.
    has_heard: bool,
}

impl Budget {
    pub(in crate::api) fn full(now: Instant) -> Self {
        Self {
            left_bytes: BURST_BYTES,
            refilled: now,
            has_heard: false,
        }
    }

    /// Adds what the time since the last call is worth.
    pub(in crate::api) fn refill(&mut self, now: Instant) {
        let passed_s = now.duration_since(self.refilled).as_secs_f64();
        self.left_bytes = BURST_BYTES.min(self.left_bytes + BYTES_PER_S * passed_s);
        self.refilled = now;
        self.has_heard = false;
    }

    /// Whether a request may be heard now: any number while there is something left, and in debt one from refill to
    /// refill, so that whoever is told much can still ask for a pause.
    pub(in crate::api) fn may_hear(&self) -> bool {
        0.0 < self.left_bytes || !self.has_heard
    }

    /// A request was heard.
    pub(in crate::api) fn on_request(&mut self) {
        self.has_heard = self.left_bytes <= 0.0;
    }

    pub(in crate::api) fn spend(&mut self, bytes: usize) {
        self.left_bytes = (-BURST_BYTES).max(self.left_bytes - bytes as f64);
    }

    /// Bytes that may be sent now.
    pub(in crate::api) fn left_bytes(&self) -> usize {
        self.left_bytes.max(0.0) as usize
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    /// Whoever sends whenever there is something left is held to the rate, whatever the size of the messages.
    #[test]
    fn a_minute_costs_a_minutes_bytes_and_one_burst() {
        for message in [40, 4_000, 60_000] {
            let start = Instant::now();
            let mut budget = Budget::full(start);
            let mut sent = 0;
            for tick in 0..1500 {
                budget.refill(start + Duration::from_millis(40 * tick));
                while 0 < budget.left_bytes() {
                    budget.spend(message);
                    sent += message;
                }
            }
            let rate = (sent as f64 - BURST_BYTES) / 60.0;
            assert!(
                (0.99 * BYTES_PER_S..1.02 * BYTES_PER_S).contains(&rate),
                "{rate} B/s with {message} B messages"
            );
        }
    }

    #[test]
    fn idleness_is_not_saved_up_without_end() {
        let start = Instant::now();
        let mut budget = Budget::full(start);
        budget.refill(start + Duration::from_secs(3600));
        assert_eq!(budget.left_bytes(), BURST_BYTES as usize);
    }

    /// Telemetry of many tools may use up the share for good; a request is heard all the same, and no more than one.
    #[test]
    fn in_debt_one_request_is_heard_from_refill_to_refill() {
        let start = Instant::now();
        let mut budget = Budget::full(start);
        for _ in 0..1000 {
            assert!(budget.may_hear(), "there is something left");
            budget.on_request();
        }
        for tick in 1..100 {
            budget.spend(100_000_000);
            budget.refill(start + Duration::from_millis(40 * tick));
            assert_eq!(budget.left_bytes(), 0);
            assert!(budget.may_hear());
            budget.on_request();
            assert!(!budget.may_hear());
        }
    }

    #[test]
    fn debt_is_paid_off_within_a_second() {
        let start = Instant::now();
        let mut budget = Budget::full(start);
        budget.spend(100_000_000);
        assert_eq!(budget.left_bytes(), 0);
        budget.refill(start + Duration::from_millis(1100));
        assert!(0 < budget.left_bytes());
    }
}
