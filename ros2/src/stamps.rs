//! The session's own time as the time of day. Ticks are evenly spaced and news of them is not: a stamp follows the
//! tick, and the two clocks are laid over one another at the fastest news so far.

use teleclay_ros::standard::Time;

/// Clocks that lie further apart are laid over one another anew: one of them was set, or the loop stood still.
const APART_NS: i128 = 200_000_000;
const NS_PER_S: f64 = 1e9;

/// Stamps of one session.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stamps {
    laid: Option<Laid>,
}

/// Two clocks over one another.
#[derive(Clone, Copy, Debug)]
struct Laid {
    /// Time of day less the session's own, ns, as the fastest news had it.
    offset_ns: i128,
    /// The last stamp, ns: faster news than any before must not turn time back.
    last_ns: i128,
}

impl Stamps {
    /// The time of day at the session's `time_s`, of which news came at `now_ns` since 1970. Never before the stamp
    /// that was given last, but where a clock was set.
    pub(crate) fn stamp(&mut self, time_s: f64, now_ns: u64) -> Time {
        let own_ns = (time_s * NS_PER_S).round() as i128;
        let seen_ns = i128::from(now_ns) - own_ns;
        let anew = Laid {
            offset_ns: seen_ns,
            last_ns: own_ns + seen_ns,
        };
        let laid = match self.laid {
            Some(laid) if (seen_ns - laid.offset_ns).abs() <= APART_NS => {
                let offset_ns = laid.offset_ns.min(seen_ns);
                let last_ns = laid.last_ns.max(own_ns + offset_ns);
                Laid { offset_ns, last_ns }
            }
            _ => anew,
        };
        self.laid = Some(laid);
        Time::from_ns(u64::try_from(laid.last_ns).unwrap_or(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAY_NS: u64 = 1_700_000_000_000_000_000;

    fn ns(time: Time) -> u64 {
        time.sec as u64 * 1_000_000_000 + u64::from(time.nanosec)
    }

    #[test]
    fn stamps_are_as_even_as_the_ticks_however_late_the_news() {
        let mut stamps = Stamps::default();
        // News is late by up to 9 ms, in a pattern; the first is late, too.
        let stamped: Vec<u64> = (0..500_u64)
            .map(|tick| {
                let late_ns = [7, 3, 9, 0, 5][tick as usize % 5] * 1_000_000;
                ns(stamps.stamp(tick as f64 * 0.004, DAY_NS + tick * 4_000_000 + late_ns))
            })
            .collect();
        assert!(stamped.is_sorted(), "faster news turn no time back");
        for pair in stamped[5..].windows(2) {
            assert_eq!(pair[1] - pair[0], 4_000_000);
        }
        assert_eq!(stamped[5], DAY_NS + 5 * 4_000_000, "no later than it was");
    }

    #[test]
    fn a_clock_that_was_set_is_followed() {
        let mut stamps = Stamps::default();
        stamps.stamp(1.0, DAY_NS);
        let hour_ns = 3_600_000_000_000;
        assert_eq!(ns(stamps.stamp(1.0, DAY_NS + hour_ns)), DAY_NS + hour_ns);
        assert_eq!(ns(stamps.stamp(1.0, DAY_NS - hour_ns)), DAY_NS - hour_ns);
    }

    #[test]
    fn a_time_before_1970_is_1970() {
        assert_eq!(Stamps::default().stamp(5.0, 0), Time::from_ns(0));
    }
}
