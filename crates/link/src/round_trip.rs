//! Round trip and clock offset from echoed stamps.
//!
//! Each frame carries its sender's stamp, the last stamp the sender got, and how long it held that one. The round trip
//! is then arithmetic on one clock; no common clock is assumed. The offset between the clocks uses the exchange with
//! the least delay of the last [`WINDOW`] (the least queueing, hence the least asymmetry) and is slewed, never stepped.

use std::time::Duration;

use crate::time::Timestamp;

/// Exchanges over which the least delay is sought: about one second at 1 kHz, in slots of 1/8.
const WINDOW: u32 = 1024;
const SLOTS: usize = 8;

/// Greatest change of the offset estimate, seconds a second: five times a poor crystal's error.
const SLEW_PER_SECOND: f64 = 500e-6;

#[derive(Clone, Copy, Debug)]
struct Exchange {
    round_trip_ns: u64,
    offset_ns: f64,
}

/// Round trip of one exchange: a stamp of ours that came back at `now`, after the peer had held it. `None` without a
/// stamp.
pub fn of_exchange(now: Timestamp, echo_ns: u64, echo_hold_ns: u32) -> Option<Duration> {
    if echo_ns == 0 {
        return None;
    }
    let there_and_back = now.as_nanos().checked_sub(echo_ns)?;
    // A hold longer than the exchange is a broken or hostile stamp: no sample.
    let round_trip_ns = there_and_back.checked_sub(u64::from(echo_hold_ns))?;
    Some(Duration::from_nanos(round_trip_ns))
}

/// One side's view of round trip and offset.
#[derive(Clone, Debug, Default)]
pub struct RoundTrip {
    peer: Option<(u64, Timestamp)>,
    last: Option<Duration>,
    slots: [Option<Exchange>; SLOTS],
    exchanges: u32,
    offset_ns: Option<f64>,
    slewed_at: Timestamp,
}

impl RoundTrip {
    /// A frame came at `now`. `sent_ns` is the peer's stamp; `echo_ns` our own stamp it got last (0 for none) and
    /// `echo_hold_ns` how long it had held it. Call for frames that are newer than all before. Returns the round trip
    /// if the frame completes one.
    pub fn on_frame(
        &mut self,
        now: Timestamp,
        sent_ns: u64,
        echo_ns: u64,
        echo_hold_ns: u32,
    ) -> Option<Duration> {
        self.peer = Some((sent_ns, now));
        let round_trip = of_exchange(now, echo_ns, echo_hold_ns)?;
        let round_trip_ns = round_trip.as_nanos() as u64;
        self.last = Some(round_trip);

        let peer_received = sent_ns as f64 - f64::from(echo_hold_ns);
        let offset_ns =
            ((peer_received - echo_ns as f64) + (sent_ns as f64 - now.as_nanos() as f64)) / 2.0;
        self.remember(Exchange {
            round_trip_ns,
            offset_ns,
        });
        self.slew(now);
        Some(round_trip)
    }

    /// The stamp to echo at `now` and how long it was held, nanoseconds; zeros when there is none.
    pub fn echo(&self, now: Timestamp) -> (u64, u32) {
        self.peer.map_or((0, 0), |(stamp, arrived)| {
            let held = now.since(arrived).as_nanos();
            // Held for over four seconds: useless as a sample, so none is offered.
            u32::try_from(held).map_or((0, 0), |held| (stamp, held))
        })
    }

    /// The last round trip.
    pub fn last(&self) -> Option<Duration> {
        self.last
    }

    /// The least round trip of the window.
    pub fn least(&self) -> Option<Duration> {
        self.best()
            .map(|best| Duration::from_nanos(best.round_trip_ns))
    }

    /// Peer's clock minus ours, seconds; half the asymmetry of the least exchange is in it.
    pub fn offset_s(&self) -> Option<f64> {
        self.offset_ns.map(|ns| ns * 1e-9)
    }

    /// When something was on our clock that the peer's stamped `peer_ns`, ns; nothing before the first exchange.
    pub fn ours_ns(&self, peer_ns: u64) -> Option<f64> {
        self.offset_ns.map(|offset_ns| peer_ns as f64 - offset_ns)
    }

    /// Estimated one-way delay of a frame stamped `sent_ns` by the peer that came at `now`, seconds.
    pub fn one_way_s(&self, now: Timestamp, sent_ns: u64) -> Option<f64> {
        let offset = self.offset_ns?;
        Some((now.as_nanos() as f64 - (sent_ns as f64 - offset)) * 1e-9)
    }

    fn remember(&mut self, exchange: Exchange) {
        let per_slot = WINDOW / SLOTS as u32;
        let slot = (self.exchanges / per_slot) as usize % SLOTS;
        if self.exchanges.is_multiple_of(per_slot) {
            self.slots[slot] = None;
        }
        self.exchanges = self.exchanges.wrapping_add(1);
        let is_better =
            self.slots[slot].is_none_or(|held| exchange.round_trip_ns < held.round_trip_ns);
        if is_better {
            self.slots[slot] = Some(exchange);
        }
    }

    fn best(&self) -> Option<Exchange> {
        self.slots
            .iter()
            .flatten()
            .min_by_key(|exchange| exchange.round_trip_ns)
            .copied()
    }

    fn slew(&mut self, now: Timestamp) {
        let Some(best) = self.best() else { return };
        let step_limit = now.since(self.slewed_at).as_nanos() as f64 * SLEW_PER_SECOND;
        self.slewed_at = now;
        self.offset_ns = Some(match self.offset_ns {
            // The first second settles freely: nothing hangs on the estimate yet.
            Some(held) if WINDOW <= self.exchanges => {
                held + (best.offset_ns - held).clamp(-step_limit, step_limit)
            }
            _ => best.offset_ns,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// Two sides exchange a frame each millisecond; the peer's clock is `offset` ahead and `ppm` fast.
    struct Pair {
        here: RoundTrip,
        there: RoundTrip,
        offset: u64,
        ppm: f64,
    }

    impl Pair {
        fn peer_clock(&self, t: u64) -> Timestamp {
            Timestamp::from_nanos(t + self.offset + (t as f64 * self.ppm * 1e-6) as u64)
        }

        /// One frame up (taking `up` ns) and one back (taking `down`), starting at true time `t`, held `hold` ns
        /// between.
        fn exchange(&mut self, t: u64, up: u64, hold: u64, down: u64) -> Option<Duration> {
            let (echo, held) = self.here.echo(Timestamp::from_nanos(t));
            self.there.on_frame(self.peer_clock(t + up), t, echo, held);
            let back = t + up + hold;
            let (echo, held) = self.there.echo(self.peer_clock(back));
            self.here.on_frame(
                Timestamp::from_nanos(back + down),
                self.peer_clock(back).as_nanos(),
                echo,
                held,
            )
        }
    }

    fn pair(offset: u64, ppm: f64) -> Pair {
        Pair {
            here: RoundTrip::default(),
            there: RoundTrip::default(),
            offset,
            ppm,
        }
    }

    #[test]
    fn the_round_trip_is_the_two_flights_without_the_holding_time() {
        let mut pair = pair(987_654_321_000, 0.0);
        let round_trip = pair.exchange(5 * MS, 3 * MS, 40 * MS, 4 * MS);
        assert_eq!(round_trip, Some(Duration::from_nanos(7 * MS)));
    }

    #[test]
    fn the_offset_is_taken_from_the_least_delayed_exchange() {
        let mut pair = pair(77 * MS, 0.0);
        for k in 0..200_u64 {
            // One exchange in fifty is clean; the others queue on the way up.
            let queueing = if k % 50 == 7 { 0 } else { 30 * MS };
            pair.exchange((1 + k * 50) * MS, 2 * MS + queueing, MS, 2 * MS);
        }
        let offset = pair.here.offset_s().unwrap();
        assert!((offset - 0.077).abs() < 1e-9, "{offset}");
        assert_eq!(pair.here.least(), Some(Duration::from_nanos(4 * MS)));
    }

    #[test]
    fn a_clock_that_runs_100_ppm_off_is_followed_without_a_step() {
        let mut pair = pair(5 * MS, 100.0);
        let mut before = None::<f64>;
        for k in 1..60_000_u64 {
            pair.exchange(k * MS, 10 * MS, 0, 10 * MS);
            let offset = pair.here.offset_s().unwrap();
            if let Some(before) = before.filter(|_| 1100 < k) {
                assert!(
                    (offset - before).abs() < 0.6e-6,
                    "step of {} s at {k}",
                    offset - before
                );
            }
            before = Some(offset);
        }
        let truth = 5e-3 + 60.0 * 100e-6;
        assert!(
            (before.unwrap() - truth).abs() < 150e-6,
            "{before:?}, truth {truth}"
        );
    }

    #[test]
    fn a_stamp_from_the_future_or_a_hold_beyond_the_exchange_gives_no_sample() {
        let mut here = RoundTrip::default();
        assert_eq!(here.on_frame(Timestamp::from_nanos(10), 1, 11, 0), None);
        assert_eq!(here.on_frame(Timestamp::from_nanos(10), 1, 5, 6), None);
        assert_eq!(
            here.on_frame(Timestamp::from_nanos(10), 1, 5, 5),
            Some(Duration::ZERO)
        );
    }
}
