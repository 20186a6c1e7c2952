//! Which frames are news, and which have waited in a queue.
//!
//! A line that stands still for a while and loses nothing (a stream that repeats, a full buffer, a program that was
//! stopped) delivers afterwards whatever queued up, faster than it was sent, and each of those frames is newer than all
//! before it. None of them may be driven or felt: what they ask for is over. A frame that waited is *stale*. It counts
//! as received and brings the facts that it carries, cuts and acknowledgements; it is no sign of life, and no
//! controller sees its pose or its force.
//!
//! Age is told without a common clock. *Transit* is our time at arrival less the sender's stamp: the delay, plus the
//! offset of the clocks. The least transit of the last [`SLOTS`] seconds is the line at its best, and what a frame's
//! transit is above it is its *excess*.
//!
//! ```text
//!  transit                      . .                    a gap longer than the silence, then late frames: stalled
//!     |                            ' .                   stale, whatever they say
//!     |                                ' .
//!     |  usual excess                      ' . . ..     within the usual excess, and everything at rest: fresh
//!     |  - - - - - - - - - - - - - - - - - - - - - - -
//!     |  .. . .. .   |                       |
//!     +--------------+-----------------------+--------> arrival
//!            normal        stalled
//! ```
//!
//! - Frames are doubted only after a gap, so that jitter, loss and a line that slows down by and by trip nothing; and
//!   after a gap only if they come later than is [usual](Freshness::allowed_ns) on this line, so that a line that lost
//!   what it did not carry, or a sender that was stopped, goes on at once.
//! - Once doubted, frames stay stale until the watchdog has brought everything to rest, however short the stall: motion
//!   and force begin anew from there.
//! - A line that has become slower for good has no queue to work off: its excess stays. When it has not fallen by
//!   [`STEADY`] in [`STEADY_FOR`], it is the new delay.
//! - At the start of a stream nothing is known of the line. A queue that is being worked off then shows in transits
//!   that fall from each frame to the next, and is waited for likewise: until they fall no more.
//!
//! What it cannot tell: a queue that comes in the order in which it was sent at the speed at which it was sent is a
//! longer line.

use std::time::Duration;

use crate::time::Timestamp;

/// A gap of this length makes the next frame doubtful, where the allowed silence is not shorter: that of the default
/// session.
const GAP: Duration = Duration::from_millis(100);
/// A frame that is later than the line's best by this much is fresh on any line: a hand is within a fraction of a
/// millimetre of where it was then, or on its way.
const ALLOWED: Duration = Duration::from_millis(20);
/// How many mean deviations from the mean are usual. Where frames overtake one another the excess of those that come
/// first falls off as an exponential does; of that one in a thousand is beyond seven, and beyond eight, right behind a
/// gap, none of the hundred lines tried.
const USUAL_DEVIATIONS: f64 = 8.0;
/// While few frames have come, the usual is taken to be wider by this over their number.
const FEW: f64 = 30.0;
/// The usual excess is that of so long.
const USUAL_OVER_S: f64 = 2.0;
/// A frame speaks for the time since the one before, for so long at most.
const SPEAKS_FOR_S: f64 = 0.02;
/// An excess that does not fall by this much...
const STEADY: Duration = Duration::from_millis(25);
/// ... in this time is the line's own: a queue that is worked off at 1.06 times the speed at which it grew falls
/// faster.
const STEADY_FOR: Duration = Duration::from_millis(500);
/// Seconds over which the least transit is sought. Clocks that differ by 100 ppm move it by a millisecond in that time.
const SLOTS: usize = 8;
const SLOT_NS: u64 = 1_000_000_000;
/// A stream is young for so long.
const YOUNG: Duration = Duration::from_secs(1);
/// In a young stream the least transit falls with almost each of so many frames, and by so much, only if they come out
/// of a queue...
const FALLS: u32 = 8;
const FALL: Duration = Duration::from_millis(10);
/// ... where none was sent more than so much later than the one before: a frame that overtakes many falls by as much as
/// it overtakes...
const NEXT: Duration = Duration::from_millis(5);
/// ... and none is later than the one before by more than a sender's tick may be.
const UNEVEN: Duration = Duration::from_millis(2);
/// A queue is worked off when the least transit has not fallen for so long...
const SETTLED_FOR: Duration = Duration::from_millis(150);
/// ... by more than clocks run apart in a while.
const A_FALL: Duration = Duration::from_millis(1);

/// What a frame is good for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Age {
    /// News: to be acted on.
    Fresh,
    /// It waited in a queue: only facts count.
    Stale,
}

/// Frames are being doubted.
#[derive(Clone, Copy, Debug)]
struct Stall {
    /// Least excess since it was last found to fall, ns, when that was, and the least transit since.
    level_ns: i64,
    since: Timestamp,
    least_ns: i64,
    /// It was found by falling transits: the stream began in a queue.
    is_of_the_beginning: bool,
}

/// How the least transit falls.
#[derive(Clone, Copy, Debug)]
struct Fall {
    /// Frames of a row with which it did, and by how much, ns.
    frames: u32,
    by_ns: i64,
    /// When it had fallen by [`A_FALL`] last, and by how much since, ns.
    at: Timestamp,
    since_ns: i64,
}

/// Excess of the frames of a line on which some overtake many: what is right behind a gap there is none of these, and
/// is late by as much as most are.
#[derive(Clone, Copy, Debug, Default)]
struct Excess {
    /// Mean, mean deviation from it, s, and how many frames were counted.
    mean_s: f64,
    deviation_s: f64,
    counted: f64,
}

impl Excess {
    /// So many frames are remembered, and nothing is known before.
    const FRAMES: f64 = 1000.0;
    /// Three standard deviations of a normal distribution: the last frame before an outage may be the only one for a
    /// while.
    const DEVIATIONS: f64 = 4.0;

    fn learn(&mut self, excess_s: f64) {
        self.counted = (self.counted + 1.0).min(Self::FRAMES);
        self.mean_s += (excess_s - self.mean_s) / self.counted;
        self.deviation_s += ((excess_s - self.mean_s).abs() - self.deviation_s) / self.counted;
    }

    fn usual_s(&self) -> f64 {
        if self.counted < Self::FRAMES {
            0.0
        } else {
            self.mean_s + Self::DEVIATIONS * self.deviation_s
        }
    }
}

/// Judges the frames of one stream by when they were sent and when they came.
#[derive(Clone, Copy, Debug)]
pub struct Freshness {
    gap: Duration,
    /// Least transits, ns, second by second, and the second of the newest.
    least_ns: [i64; SLOTS],
    slot: u64,
    /// Excess of newest frames, s: mean, mean deviation from it, and how many were counted.
    mean_s: f64,
    deviation_s: f64,
    counted: f64,
    /// Of all frames, those that were overtaken included.
    all: Excess,
    first_at: Option<Timestamp>,
    /// When the newest frame came, and its stamp.
    newest: Option<(Timestamp, u64)>,
    fresh_at: Timestamp,
    fall: Fall,
    stall: Option<Stall>,
    /// Stamp of the newest frame that was stale.
    stale_until_ns: Option<u64>,
}

impl Freshness {
    /// A stream of which nothing has come, where a silence of this length is one.
    pub fn new(silence: Duration) -> Self {
        Self {
            gap: silence.min(GAP),
            least_ns: [i64::MAX; SLOTS],
            slot: 0,
            mean_s: 0.0,
            deviation_s: 0.0,
            counted: 0.0,
            all: Excess::default(),
            first_at: None,
            newest: None,
            fresh_at: Timestamp::ZERO,
            fall: Fall {
                frames: 0,
                by_ns: 0,
                at: Timestamp::ZERO,
                since_ns: 0,
            },
            stall: None,
            stale_until_ns: None,
        }
    }

    /// A frame came at `now` that is newer than all before, sent at `sent_ns` of the peer's clock. `is_at_rest`:
    /// nothing of what came before still moves or is felt.
    pub fn on_newest(&mut self, now: Timestamp, sent_ns: u64, is_at_rest: bool) -> Age {
        let transit_ns = now.as_nanos().wrapping_sub(sent_ns) as i64;
        let before = self.newest.replace((now, sent_ns));
        let first_at = *self.first_at.get_or_insert(now);
        if let Some((_, before_ns)) = before
            && (now.since(first_at) < YOUNG || self.stall.is_some())
        {
            self.look_for_a_fall(now, transit_ns, sent_ns.wrapping_sub(before_ns));
        }
        let is_late = self.allowed_ns() < self.excess_ns(transit_ns);
        let is_after_a_gap = before.is_some() && self.gap < now.since(self.fresh_at);
        let is_falling = FALLS <= self.fall.frames && ns(FALL) < self.fall.by_ns;
        if self.stall.is_none() && (is_late && is_after_a_gap || is_falling) {
            self.stall = Some(Stall {
                level_ns: i64::MAX,
                since: now,
                least_ns: i64::MAX,
                is_of_the_beginning: is_falling,
            });
        }
        if let Some(stall) = self.stall {
            let is_settled = SETTLED_FOR < now.since(self.fall.at);
            let is_the_line = self.is_steady(stall, now, transit_ns, before.map(|(at, _)| at));
            if !is_at_rest || is_late && !is_the_line || !is_settled {
                self.stale_until_ns = Some(sent_ns);
                return Age::Stale;
            }
            self.stall = None;
            (self.fall.frames, self.fall.by_ns) = (0, 0);
        }
        self.learn(now, transit_ns, before.map(|(at, _)| at));
        self.fresh_at = now;
        Age::Fresh
    }

    /// A frame came after a newer one. What belongs to a queue is stale, however late it comes.
    pub fn on_late(&mut self, now: Timestamp, sent_ns: u64) -> Age {
        let is_of_a_queue = self
            .stale_until_ns
            .is_some_and(|until| sent_ns.wrapping_sub(until) as i64 <= 0);
        if is_of_a_queue || self.stall.is_some() {
            return Age::Stale;
        }
        let transit_ns = now.as_nanos().wrapping_sub(sent_ns) as i64;
        self.all.learn(self.excess_ns(transit_ns) as f64 * 1e-9);
        Age::Fresh
    }

    /// Whether frames are being doubted because the first of the stream had queued up: where it begins is not known
    /// yet.
    pub fn has_not_begun(&self) -> bool {
        self.stall.is_some_and(|stall| stall.is_of_the_beginning)
    }

    /// The excess up to which a frame is in time, ns.
    pub fn allowed_ns(&self) -> i64 {
        let known = 1.0 + FEW / self.counted.max(1.0);
        let usual_s = (self.mean_s + USUAL_DEVIATIONS * self.deviation_s) * known;
        ns(ALLOWED).max((usual_s.max(self.all.usual_s()) * 1e9) as i64)
    }

    fn excess_ns(&self, transit_ns: i64) -> i64 {
        let least_ns = self.least_ns.iter().fold(i64::MAX, |a, &b| a.min(b));
        transit_ns.saturating_sub(least_ns.min(transit_ns))
    }

    /// The least transit may fall, in a young stream or behind a stall; `apart_ns` lies between the stamps of the last
    /// two newest frames.
    fn look_for_a_fall(&mut self, now: Timestamp, transit_ns: i64, apart_ns: u64) {
        let least_ns = self.least_ns.iter().fold(i64::MAX, |a, &b| a.min(b));
        let fall_ns = least_ns.saturating_sub(transit_ns);
        let fall = &mut self.fall;
        if fall_ns < -ns(UNEVEN) || (NEXT.as_nanos() as u64) < apart_ns {
            (fall.frames, fall.by_ns) = (0, 0);
        } else if 0 < fall_ns {
            fall.frames += 1;
            fall.by_ns += fall_ns;
        }
        if 0 < fall_ns {
            fall.since_ns += fall_ns;
            if ns(A_FALL) < fall.since_ns {
                (fall.at, fall.since_ns) = (now, 0);
            }
            self.forget(now, transit_ns);
        }
    }

    /// Whether the excess has not fallen for so long that it is the line's own, which is then taken for its delay.
    fn is_steady(
        &mut self,
        mut stall: Stall,
        now: Timestamp,
        transit_ns: i64,
        before: Option<Timestamp>,
    ) -> bool {
        let is_broken = before.is_none_or(|before| self.gap < now.since(before));
        let excess_ns = self.excess_ns(transit_ns);
        if is_broken || excess_ns < stall.level_ns.saturating_sub(ns(STEADY)) {
            stall = Stall {
                level_ns: excess_ns,
                since: now,
                least_ns: i64::MAX,
                ..stall
            };
        }
        stall.least_ns = stall.least_ns.min(transit_ns);
        self.stall = Some(stall);
        let is_steady = STEADY_FOR < now.since(stall.since);
        if is_steady {
            self.forget(now, stall.least_ns);
        }
        is_steady
    }

    /// Nothing is known of the line but this transit.
    fn forget(&mut self, now: Timestamp, transit_ns: i64) {
        self.least_ns = [i64::MAX; SLOTS];
        self.slot = now.as_nanos() / SLOT_NS;
        self.least_ns[self.slot as usize % SLOTS] = transit_ns;
    }

    /// What a frame in time tells of the line.
    fn learn(&mut self, now: Timestamp, transit_ns: i64, before: Option<Timestamp>) {
        let slot = now.as_nanos() / SLOT_NS;
        if self.slot != slot {
            // Seconds without a frame in time told nothing, so that what was known before them stays.
            self.slot = slot;
            self.least_ns[slot as usize % SLOTS] = i64::MAX;
        }
        let least_ns = &mut self.least_ns[slot as usize % SLOTS];
        *least_ns = transit_ns.min(*least_ns);
        let excess_s = self.excess_ns(transit_ns) as f64 * 1e-9;
        self.all.learn(excess_s);
        let passed_s = before.map_or(0.0, |before| now.since(before).as_secs_f64());
        self.counted += 1.0;
        let share = (passed_s.min(SPEAKS_FOR_S) / USUAL_OVER_S).max(1.0 / self.counted);
        self.mean_s += (excess_s - self.mean_s) * share;
        self.deviation_s += ((excess_s - self.mean_s).abs() - self.deviation_s) * share;
    }
}

/// Spans here are far shorter than the centuries that fit.
const fn ns(span: Duration) -> i64 {
    span.as_nanos() as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conditioner::{Conditioner, Impairment, JitterDistribution, Stall as LineStall};

    const TICK: Duration = Duration::from_millis(1);
    /// Everything is at rest so long after the last fresh frame: the silence and the ramp of a default session.
    const AT_REST_AFTER: Duration = Duration::from_millis(150);

    fn at(ms: u32) -> Timestamp {
        Timestamp::ZERO.after(TICK * ms)
    }

    /// A sender that stamps and sends a frame a tick, a line, and a receiver that comes to rest as a watchdog makes it.
    struct Stream {
        line: Conditioner<u64>,
        freshness: Freshness,
        newest: Option<u64>,
        fresh_at: Timestamp,
        is_doubted: bool,
        /// How far the sender's clock is ahead, and how many millionths it runs fast.
        ahead_ns: u64,
        ppm: f64,
    }

    /// What became of a frame that was newer than all before: how late it was, over what the line takes, and its age.
    struct Judged {
        waited: Duration,
        age: Age,
    }

    impl Stream {
        fn new(impairment: Impairment, seed: u64) -> Self {
            Self {
                line: Conditioner::new(impairment, seed, 1 << 14),
                freshness: Freshness::new(Duration::from_millis(100)),
                newest: None,
                fresh_at: Timestamp::ZERO,
                is_doubted: false,
                ahead_ns: 0,
                ppm: 0.0,
            }
        }

        /// One tick, in which a frame is sent unless the sender stands still; hands what came to `look`.
        fn tick(&mut self, now: Timestamp, sends: bool, mut look: impl FnMut(Judged)) {
            if sends {
                self.line.push(now, now.as_nanos());
            }
            while let Some((came, sent_ns)) = self.line.poll_with_arrival(now) {
                let fast_ns = (sent_ns as f64 * self.ppm * 1e-6) as u64;
                let stamp_ns = sent_ns + self.ahead_ns + fast_ns;
                if self.newest.is_some_and(|newest| sent_ns <= newest) {
                    self.freshness.on_late(came, stamp_ns);
                    continue;
                }
                self.newest = Some(sent_ns);
                let is_at_rest = self.is_doubted || AT_REST_AFTER < came.since(self.fresh_at);
                let age = self.freshness.on_newest(came, stamp_ns, is_at_rest);
                if age == Age::Fresh {
                    self.fresh_at = came;
                    self.is_doubted = false;
                } else if AT_REST_AFTER < came.since(self.fresh_at) {
                    self.is_doubted = true;
                }
                let waited = came.since(Timestamp::from_nanos(sent_ns));
                look(Judged { waited, age });
            }
        }
    }

    fn stalling(from_ms: u32, length_ms: u32, drain: f64) -> Impairment {
        Impairment {
            stall: Some(LineStall {
                from: at(from_ms),
                length: TICK * length_ms,
                drain,
            }),
            ..Impairment::default()
        }
    }

    /// Until the queue is worked off, and not much longer.
    #[test]
    fn what_waited_in_a_queue_is_stale_and_what_did_not_is_fresh() {
        for delay_ms in [0, 5, 150] {
            for length_ms in [120, 200, 500, 1000, 3000, 10_000] {
                for drain in [1.2, 2.0, 5.0, 20.0, f64::INFINITY] {
                    for ahead_ns in [0, 77_000_000_000] {
                        let line = Impairment {
                            delay: TICK * delay_ms,
                            ..stalling(3000, length_ms, drain)
                        };
                        let mut stream = Stream::new(line, 1);
                        (stream.ahead_ns, stream.ppm) = (ahead_ns, 100.0);
                        let delay = TICK * delay_ms;
                        let case = format!("{delay_ms} ms, {length_ms} ms, drain {drain}");
                        let caught_up = if drain.is_finite() {
                            f64::from(length_ms) * drain / (drain - 1.0)
                        } else {
                            f64::from(length_ms)
                        };
                        let until_ms = 3000 + caught_up as u32 + 400;
                        let mut stale = 0;
                        for ms in 1..until_ms {
                            stream.tick(at(ms), true, |judged| {
                                let excess = judged.waited.saturating_sub(delay);
                                let is_stale = judged.age == Age::Stale;
                                stale += u64::from(is_stale);
                                if ms < 3000 || until_ms - 200 < ms {
                                    assert!(!is_stale, "{case}: at {ms} ms");
                                }
                                // A clock that is fast by 100 ppm hides so much.
                                let hidden = (TICK * ms).mul_f64(1e-4);
                                if ALLOWED + TICK * 2 + hidden < excess {
                                    assert!(is_stale, "{case}: {excess:?} late at {ms} ms");
                                }
                            });
                        }
                        assert!(u64::from(length_ms) < stale + 25, "{case}: {stale} stale");
                    }
                }
            }
        }
    }

    /// Whatever jitter, loss and reordering do, and however long: once the line is known nothing is doubted that did
    /// not queue.
    #[test]
    fn no_line_without_a_queue_is_doubted() {
        let mut gaps = 0;
        for delay_ms in [1, 5, 25, 50, 150, 250] {
            for (ratio, loss, reorder, distribution) in [
                (0.2, 0.0, 0.0, JitterDistribution::Normal),
                (0.5, 0.3, 0.0, JitterDistribution::Normal),
                (0.5, 0.0, 0.0, JitterDistribution::HeavyTailed),
                (0.2, 0.9, 0.0, JitterDistribution::Normal),
                (0.2, 0.0, 0.05, JitterDistribution::Normal),
                (0.2, 0.3, 0.02, JitterDistribution::Normal),
            ] {
                let line = Impairment {
                    delay: TICK * delay_ms,
                    jitter: (TICK * delay_ms).mul_f64(ratio),
                    loss,
                    distribution,
                    reorder,
                    ..Impairment::default()
                };
                for seed in 0..10 {
                    let mut stream = Stream::new(line, seed);
                    let mut before = at(1);
                    for ms in 1..20_000 {
                        stream.tick(at(ms), true, |judged| {
                            let is_known = 3000 < ms || reorder == 0.0 && loss < 0.5;
                            assert!(
                                judged.age == Age::Fresh || !is_known,
                                "{line:?}, seed {seed}: stale at {ms} ms"
                            );
                            gaps += u32::from(GAP < at(ms).since(before));
                            before = at(ms);
                        });
                    }
                }
            }
        }
        assert!(0 < gaps, "nothing was put to the question");
    }

    /// The line lost what it did not carry, or the sender stood still: what comes then is news.
    #[test]
    fn after_a_silence_that_queued_nothing_the_first_frame_is_fresh() {
        for length_ms in [120, 1000, 10_000] {
            let mut stream = Stream::new(Impairment::default(), 1);
            for ms in 1..2000 + length_ms + 500 {
                let sends = !(2000..2000 + length_ms).contains(&ms);
                stream.tick(at(ms), sends, |judged| {
                    assert_eq!(judged.age, Age::Fresh, "{length_ms} ms: at {ms} ms");
                });
            }
        }
    }

    /// No queue is worked off there, so frames count again after [`STEADY_FOR`].
    #[test]
    fn a_line_that_becomes_longer_for_good_is_believed_soon() {
        for added_ms in [30, 120, 250, 1000] {
            for jitter_ratio in [0.0, 0.1] {
                let longer = Impairment {
                    delay: TICK * added_ms,
                    jitter: (TICK * added_ms).mul_f64(jitter_ratio),
                    ..Impairment::default()
                };
                let mut stream = Stream::new(Impairment::default(), 1);
                let mut fresh = 0;
                for ms in 1..8000 {
                    if ms == 3000 {
                        stream.line.impair(longer);
                    }
                    stream.tick(at(ms), true, |judged| {
                        let is_fresh = judged.age == Age::Fresh;
                        // Where it jitters as well the least of half a second takes longer to be found.
                        let believed_ms = if jitter_ratio == 0.0 { 700 } else { 2000 };
                        if 3000 + added_ms + believed_ms < ms {
                            assert!(is_fresh, "{added_ms} ms, {jitter_ratio}: at {ms} ms");
                            fresh += 1;
                        }
                    });
                }
                assert!(30 < fresh, "{added_ms} ms: {fresh} fresh");
            }
        }
    }

    /// Nothing is known of the line then but how the frames fall behind one another.
    #[test]
    fn a_stream_that_begins_in_a_queue_waits_for_its_end() {
        for length_ms in [120, 500, 3000] {
            for drain in [1.2, 2.0, 20.0] {
                let mut stream = Stream::new(stalling(0, length_ms, drain), 1);
                let caught_up = f64::from(length_ms) * drain / (drain - 1.0);
                let mut doubtful = Duration::ZERO;
                let until_ms = caught_up as u32 + 600;
                for ms in 1..until_ms {
                    stream.tick(at(ms), true, |judged| {
                        let is_stale = judged.age == Age::Stale;
                        if !is_stale && TICK * 30 < judged.waited {
                            doubtful += TICK;
                        }
                        if until_ms - 200 < ms {
                            assert!(!is_stale, "{length_ms} ms, drain {drain}: at {ms} ms");
                        }
                    });
                }
                // What came before the fall was seen: two dozen frames at most.
                assert!(
                    doubtful < TICK * 80,
                    "{length_ms} ms, {drain}: {doubtful:?}"
                );
            }
        }
    }

    #[test]
    fn what_comes_late_out_of_a_queue_is_stale_long_after_it() {
        let mut stream = Stream::new(stalling(1000, 500, 20.0), 1);
        for ms in 1..3000 {
            stream.tick(at(ms), true, |_| {});
        }
        assert_eq!(
            stream.freshness.on_late(at(3000), at(1200).as_nanos()),
            Age::Stale
        );
        assert_eq!(
            stream.freshness.on_late(at(3000), at(2500).as_nanos()),
            Age::Fresh
        );
    }
}
