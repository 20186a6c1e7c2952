//! How far behind a client is: what the network holds for it, the socket does not tell. So pings go along with the
//! samples, and what the answers have not come back for is still on its way.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// A ping goes along this often.
const PING_EVERY: Duration = Duration::from_millis(100);

/// A client that has not answered for so long gets no further samples until it has: after a stall it has to read those
/// of a second, whatever buffers there are. A satellite answers within 0.7 s.
const BEHIND_AFTER: Duration = Duration::from_secs(1);

/// The pings that are under way.
#[derive(Debug, Default)]
pub(super) struct Trail {
    sent: VecDeque<(u64, Instant)>,
    next: u64,
    pinged_at: Option<Instant>,
    has_sent: bool,
}

impl Trail {
    /// A sample was sent.
    pub(super) fn on_sample(&mut self) {
        self.has_sent = true;
    }

    /// The ping that is to go along now, if one is.
    pub(super) fn due(&mut self, now: Instant) -> Option<[u8; 8]> {
        let is_time = |at| PING_EVERY <= now.duration_since(at);
        if !(self.has_sent && self.pinged_at.is_none_or(is_time)) {
            return None;
        }
        let number = self.next;
        self.next += 1;
        self.sent.push_back((number, now));
        self.pinged_at = Some(now);
        self.has_sent = false;
        Some(number.to_le_bytes())
    }

    /// An answer came. One may stand for those before it.
    pub(super) fn on_pong(&mut self, payload: &[u8]) {
        let Ok(number) = payload.try_into().map(u64::from_le_bytes) else {
            return;
        };
        while self.sent.front().is_some_and(|(sent, _)| *sent <= number) {
            self.sent.pop_front();
        }
    }

    /// Whether the client is to get no further samples now.
    pub(super) fn is_behind(&self, now: Instant) -> bool {
        let oldest = self.sent.front();
        oldest.is_some_and(|(_, sent_at)| BEHIND_AFTER <= now.duration_since(*sent_at))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten seconds of samples every 20 ms to a client that answers after `answers_ms`, or does not between 2 s and 7 s:
    /// how many samples of which second were sent.
    fn sent(answers_ms: u64) -> [u32; 10] {
        let began = Instant::now();
        let mut trail = Trail::default();
        let mut answers: VecDeque<(u64, [u8; 8])> = VecDeque::new();
        let mut sent = [0; 10];
        for ms in (0..10_000).step_by(20) {
            let now = began + Duration::from_millis(ms);
            let reads = !(2000..7000).contains(&ms);
            while reads && answers.front().is_some_and(|(at, _)| *at <= ms) {
                trail.on_pong(&answers.pop_front().unwrap().1);
            }
            if !trail.is_behind(now) {
                trail.on_sample();
                sent[(ms / 1000) as usize] += 1;
            }
            if let Some(ping) = trail.due(now) {
                answers.push_back((ms + answers_ms, ping));
            }
            assert!(answers.len() <= 12, "pings are bounded, too");
        }
        sent
    }

    #[test]
    fn a_stall_leaves_a_second_of_samples_to_be_read() {
        assert_eq!(sent(1), [50, 50, 50, 0, 0, 0, 0, 50, 50, 50]);
    }

    #[test]
    fn a_satellite_is_no_stall() {
        assert_eq!(sent(700)[..2], [50, 50]);
        assert_eq!(sent(700)[8..], [50, 50]);
    }

    #[test]
    fn whoever_gets_no_samples_is_not_pinged_and_is_not_behind() {
        let began = Instant::now();
        let mut trail = Trail::default();
        for s in 0..100 {
            let now = began + Duration::from_secs(s);
            assert_eq!(trail.due(now), None);
            assert!(!trail.is_behind(now));
        }
        trail.on_pong(b"not ours");
        trail.on_pong(b"");
    }
}
