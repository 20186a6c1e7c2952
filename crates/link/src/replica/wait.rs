//! How long an acknowledgement is waited for.
//!
//! As TCP's retransmission timer does it ([PACS11] in docs/papers.md): the round trip and its variation, smoothed over
//! a sample a round trip. Against it, a round trip of one exchange says how long that exchange took: one that met a
//! starved program takes seconds, and the next milliseconds.

use std::time::Duration;

use crate::time::Timestamp;

/// Round trip before one is known.
const UNKNOWN_ROUND_TRIP: Duration = Duration::from_millis(100);
/// An acknowledgement is awaited this much longer, for both sides' ticks.
const PATIENCE: Duration = Duration::from_millis(20);
/// A sample counts as twice the smoothed round trip and this at most. So an outlier moves it by an eighth of that, and
/// a line that became slower is followed within some ten samples.
const OUTLIER: Duration = Duration::from_millis(50);
/// Share of a sample's difference that goes into the round trip, and into its variation: an eighth and a quarter, in
/// [PACS11].
const ROUND_TRIP_SHARE: i64 = 8;
const VARIATION_SHARE: i64 = 4;

/// The smoothed round trip. In whole nanoseconds, so that a constant line gives its own round trip and no variation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wait {
    round_trip_ns: i64,
    variation_ns: i64,
    /// When the last sample was taken; nothing before the first.
    sampled_at: Option<Timestamp>,
}

impl Default for Wait {
    fn default() -> Self {
        Self {
            round_trip_ns: nanos(UNKNOWN_ROUND_TRIP),
            variation_ns: 0,
            sampled_at: None,
        }
    }
}

impl Wait {
    /// An exchange that came to its end at `now` took so long.
    pub(super) fn on_round_trip(&mut self, now: Timestamp, round_trip: Duration) {
        let sample_ns = nanos(round_trip);
        let Some(sampled_at) = self.sampled_at else {
            self.round_trip_ns = sample_ns;
            self.sampled_at = Some(now);
            return;
        };
        if nanos(now.since(sampled_at)) < self.round_trip_ns {
            return;
        }
        self.sampled_at = Some(now);
        let most_ns = 2 * self.round_trip_ns + nanos(OUTLIER);
        let off_ns = sample_ns.min(most_ns) - self.round_trip_ns;
        self.variation_ns += (off_ns.abs() - self.variation_ns) / VARIATION_SHARE;
        self.round_trip_ns += off_ns / ROUND_TRIP_SHARE;
    }

    /// From the sending of a sweep until its acknowledgement is usually there.
    pub(super) fn span(&self) -> Duration {
        let round_trip_ns = self.round_trip_ns + self.round_trip_ns / 4;
        Duration::from_nanos((round_trip_ns + 4 * self.variation_ns) as u64) + PATIENCE
    }
}

/// Round trips are shorter than the hours at which this would no longer fit.
fn nanos(span: Duration) -> i64 {
    i64::try_from(span.as_nanos()).unwrap_or(i64::MAX / 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn after(samples: impl IntoIterator<Item = u32>) -> (Wait, Timestamp) {
        let (mut wait, mut now) = (Wait::default(), Timestamp::ZERO);
        for sample in samples {
            now = now.after(MS);
            wait.on_round_trip(now, MS * sample);
        }
        (wait, now)
    }

    #[test]
    fn a_constant_line_is_waited_for_a_quarter_longer_than_its_round_trip_and_20_ms() {
        for round_trip in [0, 1, 80, 500] {
            let (wait, _) = after(vec![round_trip; 5000]);
            assert_eq!(wait.span(), (MS * round_trip).mul_f64(1.25) + MS * 20);
        }
    }

    #[test]
    fn a_program_that_was_starved_for_three_seconds_makes_nobody_wait_for_seconds() {
        let (mut wait, mut now) = after(vec![80; 1000]);
        let usual = wait.span();
        // What had queued up meanwhile tells of ever shorter trips, all in one millisecond.
        now = now.after(MS * 3000);
        for round_trip in (80..3000).rev() {
            wait.on_round_trip(now, MS * round_trip);
        }
        assert!(wait.span() < usual * 3, "{:?}", wait.span());
        for _ in 0..2000 {
            now = now.after(MS);
            wait.on_round_trip(now, MS * 80);
        }
        assert!(wait.span() < usual.mul_f64(1.2), "{:?}", wait.span());
    }

    #[test]
    fn a_line_that_becomes_slower_or_faster_is_followed_within_forty_round_trips() {
        for (before, behind) in [(1, 500), (500, 1), (20, 2000)] {
            let slower = before.max(behind) as usize;
            let (wait, _) = after([vec![before; 2000], vec![behind; 40 * slower]].concat());
            let settled = (MS * behind).mul_f64(1.25) + MS * 20;
            let off = wait.span().abs_diff(settled);
            assert!(
                off < settled.mul_f64(0.1),
                "{before} to {behind}: {:?}",
                wait.span()
            );
        }
    }
}
