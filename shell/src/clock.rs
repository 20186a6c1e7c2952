//! The process's monotonic clock.

use std::time::{Duration, Instant};

/// Nanoseconds since the clock was made. Copies tell the same time.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    started: Instant,
    drift: Drift,
}

/// How much faster a clock runs than the system's, in parts per million. Crystals are off by up to 100; a test asks for
/// more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drift {
    ppm: i32,
}

/// A drift that no test asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a drift of {got} ppm, want -{MOST_PPM} to {MOST_PPM}")]
pub struct DriftError {
    /// As given.
    pub got: i32,
}

/// Ten per cent: what reads such a clock should notice, not break.
const MOST_PPM: i32 = 100_000;

impl Drift {
    /// A clock that is fast by `ppm` parts per million; slow, when below zero.
    ///
    /// # Errors
    /// More than ten per cent.
    pub fn from_ppm(ppm: i32) -> Result<Self, DriftError> {
        if (-MOST_PPM..=MOST_PPM).contains(&ppm) {
            Ok(Self { ppm })
        } else {
            Err(DriftError { got: ppm })
        }
    }

    /// What such a clock shows after `true_ns` of the system's.
    fn shown_ns(self, true_ns: u64) -> u64 {
        if self.ppm == 0 {
            return true_ns;
        }
        let gained = i128::from(true_ns) * i128::from(self.ppm) / 1_000_000;
        // Ten per cent at most, so it stays positive; what passes 64 bits has run for centuries.
        u64::try_from(i128::from(true_ns) + gained).unwrap_or(u64::MAX)
    }

    /// How long the system's clock takes for what such a clock calls `span`.
    pub fn true_span(self, span: Duration) -> Duration {
        Duration::from_secs_f64(span.as_secs_f64() / (1.0 + f64::from(self.ppm) * 1e-6))
    }
}

impl Clock {
    /// A clock that starts now, at 1: a stamp of 0 means "none" on the wire.
    pub fn start() -> Self {
        Self::start_drifting(Drift::default())
    }

    /// A clock that starts now, at 1, and runs fast or slow: a stand-in for another machine's crystal.
    pub fn start_drifting(drift: Drift) -> Self {
        Self {
            started: Instant::now(),
            drift,
        }
    }

    /// Nanoseconds since the start, never 0.
    pub fn now_ns(&self) -> u64 {
        let true_ns = u64::try_from(self.started.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.drift.shown_ns(true_ns).saturating_add(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_is_100_ppm_fast_gains_a_tenth_of_a_millisecond_a_second() {
        let fast = Drift::from_ppm(100).unwrap();
        assert_eq!(fast.shown_ns(1_000_000_000), 1_000_100_000);
        let slow = Drift::from_ppm(-100).unwrap();
        assert_eq!(slow.shown_ns(1_000_000_000), 999_900_000);
        assert_eq!(Drift::default().shown_ns(u64::MAX - 1), u64::MAX - 1);
    }

    /// What it calls a millisecond is one on its own face.
    #[test]
    fn a_span_and_its_true_length_agree() {
        for ppm in [-MOST_PPM, -100, 0, 100, MOST_PPM] {
            let drift = Drift::from_ppm(ppm).unwrap();
            let span = Duration::from_millis(1);
            let shown_ns = drift.shown_ns(drift.true_span(span).as_nanos() as u64);
            assert!(shown_ns.abs_diff(1_000_000) <= 1, "{ppm}: {shown_ns}");
        }
        assert!(Drift::from_ppm(MOST_PPM + 1).is_err());
    }

    #[test]
    fn no_stamp_is_zero() {
        assert!(0 < Clock::start_drifting(Drift::from_ppm(-MOST_PPM).unwrap()).now_ns());
    }
}
