//! Whether a watcher is still there: a socket whose other end has vanished looks like one that only listens.

use std::time::{Duration, Instant};

/// A watcher is asked for a sign of life this often; the library of any WebSocket answers by itself.
const PING_EVERY: Duration = Duration::from_secs(10);
/// One that has given none for so long is gone: two questions, and the slowest answer to the second.
const SILENT_AFTER: Duration = Duration::from_secs(25);

/// What is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::api) enum Due {
    Nothing,
    Ping,
    /// The watcher is gone.
    Goodbye,
}

/// The signs of life of one watcher.
#[derive(Debug)]
pub(in crate::api) struct Heartbeat {
    heard_at: Instant,
    pinged_at: Instant,
}

impl Heartbeat {
    pub(in crate::api) fn new(now: Instant) -> Self {
        Self {
            heard_at: now,
            pinged_at: now,
        }
    }

    /// Anything came.
    pub(in crate::api) fn on_heard(&mut self, now: Instant) {
        self.heard_at = now;
    }

    /// What is due now.
    pub(in crate::api) fn due(&mut self, now: Instant) -> Due {
        if SILENT_AFTER <= now.duration_since(self.heard_at) {
            return Due::Goodbye;
        }
        if now.duration_since(self.pinged_at) < PING_EVERY {
            return Due::Nothing;
        }
        self.pinged_at = now;
        Due::Ping
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_answers_stays_and_who_does_not_is_gone_after_25_seconds() {
        let began = Instant::now();
        let at = |ms: u64| began + Duration::from_millis(ms);
        let mut silent = Heartbeat::new(began);
        let mut alive = Heartbeat::new(began);
        let mut pings = 0;
        for ms in (0..120_000).step_by(40) {
            match alive.due(at(ms)) {
                Due::Nothing => {}
                Due::Ping => {
                    pings += 1;
                    alive.on_heard(at(ms + 2000));
                }
                Due::Goodbye => panic!("{ms} ms"),
            }
            let is_gone = silent.due(at(ms)) == Due::Goodbye;
            assert_eq!(is_gone, 25_000 <= ms, "{ms} ms");
        }
        assert_eq!(pings, 11);
    }
}
