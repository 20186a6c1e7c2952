//! How often samples come.

/// Samples a second on a topic. Invariant: above zero, and no more than [`Rate::MOST`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate(f64);

/// A number that is no rate.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the rate is {got} Hz, wanted above 0 and at most {} Hz", Rate::MOST.hz())]
pub struct RateError {
    /// The number.
    pub got: f64,
}

impl Rate {
    /// What a plot on a screen shows.
    pub const USUAL: Self = Self(60.0);
    /// A sample of every fourth millisecond: no more are taken.
    pub const MOST: Self = Self(250.0);

    /// A rate, Hz.
    ///
    /// # Errors
    /// It is zero or below, above [`Rate::MOST`], or no number.
    pub fn new(hz: f64) -> Result<Self, RateError> {
        if 0.0 < hz && hz <= Self::MOST.0 {
            Ok(Self(hz))
        } else {
            Err(RateError { got: hz })
        }
    }

    /// Samples a second.
    #[must_use]
    pub const fn hz(self) -> f64 {
        self.0
    }

    /// Samples that wait for a client at most: those of a quarter of a second, which a busy machine may be late by.
    /// What is older is of no use to whoever looks at what happens.
    pub(super) fn waiting(self) -> usize {
        (self.0 / 4.0).ceil() as usize
    }
}

/// Chooses samples so that they come at a rate: the first one in each period of it. Where samples are taken on a grid
/// of their own, periods of it alternate, and over a second the rate is met.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    rate: Rate,
    period: Option<i64>,
}

/// Times are whole milliseconds in floating point; a period that begins at one must not miss it by a rounding.
const ROUNDING: f64 = 1e-6;

impl Pace {
    pub(super) const fn new(rate: Rate) -> Self {
        Self { rate, period: None }
    }

    pub(super) const fn rate(&self) -> Rate {
        self.rate
    }

    /// Whether the sample of this moment, s, is to be sent.
    pub(super) fn is_due(&mut self, time_s: f64) -> bool {
        let period = (time_s * self.rate.0 + ROUNDING).floor() as i64;
        let is_due = self.period != Some(period);
        self.period = Some(period);
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of ten seconds of a grid of 4 ms, as they are chosen, s.
    fn chosen(hz: f64) -> Vec<f64> {
        let mut pace = Pace::new(Rate::new(hz).unwrap());
        (0..2500)
            .map(|sample| 1234.0 + f64::from(sample) * 0.004)
            .filter(|time_s| pace.is_due(*time_s))
            .collect()
    }

    #[test]
    fn ten_seconds_have_ten_times_the_rate_and_no_gap_is_longer_than_a_period_and_a_sample() {
        for hz in [
            0.5, 1.0, 7.0, 30.0, 60.0, 99.9, 100.0, 125.0, 200.0, 249.0, 250.0,
        ] {
            let times_s = chosen(hz);
            let count = times_s.len() as f64;
            assert!((count - 10.0 * hz).abs() <= 1.0, "{hz} Hz: {count}");
            for pair in times_s.windows(2) {
                let gap_s = pair[1] - pair[0];
                assert!(gap_s <= 1.0 / hz + 0.004 + 1e-9, "{hz} Hz: {gap_s} s");
            }
        }
    }

    #[test]
    fn a_session_that_begins_anew_is_sampled_at_once() {
        let mut pace = Pace::new(Rate::new(1.0).unwrap());
        assert!(pace.is_due(500.1));
        assert!(!pace.is_due(500.9));
        assert!(pace.is_due(0.004));
    }

    #[test]
    fn what_is_no_rate_is_refused_with_its_bounds() {
        for hz in [0.0, -1.0, 250.1, f64::NAN, f64::INFINITY] {
            let said = Rate::new(hz).unwrap_err().to_string();
            assert!(said.contains("250 Hz"), "{said}");
        }
        assert_eq!(Rate::MOST.waiting(), 63);
        assert_eq!(Rate::new(0.1).unwrap().waiting(), 1);
    }
}
