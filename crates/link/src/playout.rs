//! Play-out: frames that come with varying delay leave with a constant one.
//!
//! A frame is due a fixed time after its stamp. The stamps are the sender's clock and the due times ours; their
//! difference is the clocks' offset plus the delay that is aimed at, one number, so no common clock is needed and a
//! clock that runs off is followed like any other change. Stamps and not sequence numbers tell the order in time: a
//! sender may leave frames out, and its ticks may be late.
//!
//! The delay follows the network:
//!
//! - A frame that comes too late while nothing newer has been played raises the delay at once, to its own: it is the
//!   network that became slower, and whatever was missed meanwhile has been missed anyway.
//! - A frame that comes after a newer one was played is a late frame. It is dropped, and the delay grows by one tick.
//! - When none of [`WINDOW`] frames came within a tick of being late, the delay shrinks by one tick.
//!
//! The last two hold the share of late frames near one in [`WINDOW`], whatever the shape of the jitter: a single
//! outlier moves the delay by a tick, not by its own lateness. Where the delay grows there is a tick with nothing due,
//! where it shrinks one with two frames due; what that means for what the frames carry is the caller's to decide.

use std::collections::VecDeque;

use crate::time::Timestamp;

/// Frames over which the least slack is sought, and so the share of late frames that is accepted.
pub const WINDOW: u32 = 128;

/// Frames that can wait at once. At 1 kHz a second: four deviations of the worst jitter that is played out here.
const CAPACITY: usize = 1024;

/// Sequence numbers remembered to tell copies: more than can wait, and as many again for those that were played.
const REMEMBERED: usize = 4 * CAPACITY;

/// A frame this early says that a clock was set, not that the network became faster; ns.
const JUMP_NS: i64 = 2_000_000_000;

struct Waiting<T> {
    sent_ns: u64,
    content: T,
}

/// What became of the frames so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlayoutCounts {
    /// Frames handed out.
    pub played: u64,
    /// Frames that came after a newer one was handed out, and were dropped.
    pub late_frames: u64,
}

/// Frames waiting for their time. Allocates when made and never again.
pub struct Playout<T> {
    tick_ns: i64,
    waiting: VecDeque<Waiting<T>>,
    known: Box<[Option<u32>]>,
    /// Local time less stamp at which a frame is due.
    offset_ns: Option<i64>,
    played_ns: Option<u64>,
    least_slack_ns: i64,
    looked_at: u32,
    counts: PlayoutCounts,
}

impl<T> Playout<T> {
    /// Nothing waiting; the first frame is due at once.
    pub fn new(tick_s: f64) -> Self {
        Self {
            tick_ns: (tick_s * 1e9) as i64,
            waiting: VecDeque::with_capacity(CAPACITY),
            known: vec![None; REMEMBERED].into(),
            offset_ns: None,
            played_ns: None,
            least_slack_ns: i64::MAX,
            looked_at: 0,
            counts: PlayoutCounts::default(),
        }
    }

    /// As new, with the memory that it has.
    pub fn restart(&mut self) {
        // Every field by its name, so that none is forgotten.
        let Self {
            tick_ns: _,
            waiting,
            known,
            offset_ns,
            played_ns,
            least_slack_ns,
            looked_at,
            counts,
        } = self;
        waiting.clear();
        known.fill(None);
        (*offset_ns, *played_ns) = (None, None);
        (*least_slack_ns, *looked_at) = (i64::MAX, 0);
        *counts = PlayoutCounts::default();
    }

    /// A frame came, in whatever order. Copies are told by `sequence` and ignored. `sent_ns` is the sender's stamp.
    pub fn on_frame(&mut self, now: Timestamp, sequence: u32, sent_ns: u64, content: T) {
        let known = &mut self.known[sequence as usize % REMEMBERED];
        if *known == Some(sequence) {
            return;
        }
        *known = Some(sequence);
        // Two clocks: only the difference of differences means anything, so wrapping is harmless.
        let transit_ns = now.as_nanos().wrapping_sub(sent_ns) as i64;
        let offset_ns = *self.offset_ns.get_or_insert(transit_ns);
        let slack_ns = offset_ns.saturating_sub(transit_ns);
        if self.played_ns.is_some_and(|played| sent_ns <= played) {
            self.counts.late_frames += 1;
            if slack_ns < 0 {
                self.offset_ns = Some(offset_ns.saturating_add(self.tick_ns));
            }
            return;
        }
        if slack_ns < 0 || JUMP_NS < slack_ns {
            self.offset_ns = Some(transit_ns);
        }
        self.shrink(slack_ns);
        self.insert(sent_ns, content);
    }

    /// The next frame due by `now`, oldest first; call until `None`, every tick.
    pub fn take(&mut self, now: Timestamp) -> Option<T> {
        let offset_ns = self.offset_ns?;
        let front = self.waiting.front()?;
        let age_ns = now.as_nanos().wrapping_sub(front.sent_ns) as i64;
        if age_ns < offset_ns && self.waiting.len() < CAPACITY {
            return None;
        }
        let due = self.waiting.pop_front()?;
        self.played_ns = Some(due.sent_ns);
        self.counts.played += 1;
        Some(due.content)
    }

    /// Frames that wait.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Our time less stamp at which frames are due, s: the delay that is aimed at, plus the offset between the two
    /// clocks.
    pub fn offset_s(&self) -> Option<f64> {
        self.offset_ns.map(|ns| ns as f64 * 1e-9)
    }

    /// Counts so far.
    pub fn counts(&self) -> PlayoutCounts {
        self.counts
    }

    fn shrink(&mut self, slack_ns: i64) {
        self.least_slack_ns = self.least_slack_ns.min(slack_ns);
        self.looked_at += 1;
        if self.looked_at < WINDOW {
            return;
        }
        if self.tick_ns <= self.least_slack_ns {
            self.offset_ns = self
                .offset_ns
                .map(|offset| offset.saturating_sub(self.tick_ns));
        }
        self.least_slack_ns = i64::MAX;
        self.looked_at = 0;
    }

    fn insert(&mut self, sent_ns: u64, content: T) {
        let newer = self
            .waiting
            .iter()
            .rev()
            .take_while(|held| sent_ns < held.sent_ns)
            .count();
        if self.waiting.len() == CAPACITY {
            // Cannot be reached while `take` is called every tick, since a full buffer is played from.
            self.waiting.pop_front();
        }
        let at = self.waiting.len().saturating_sub(newer);
        self.waiting.insert(at, Waiting { sent_ns, content });
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;
    use crate::conditioner::{Conditioner, Impairment, JitterDistribution};

    const TICK: Duration = Duration::from_millis(1);
    const TICK_S: f64 = 1e-3;
    /// The sender's clock is this far ahead: nothing may depend on a common one.
    const AHEAD_NS: u64 = 77_000_000_000_123;

    fn at(tick: u64) -> Timestamp {
        Timestamp::from_nanos(1_000_000 * tick)
    }

    /// Sends one numbered frame a tick through a line and returns, for each tick, what was played.
    fn run(line: Impairment, ticks: u64) -> (Playout<u64>, Vec<Vec<u64>>) {
        let mut line = Conditioner::new(line, 5, 8192);
        let mut playout = Playout::new(TICK_S);
        let played = (1..=ticks)
            .map(|tick| {
                line.push(at(tick), tick);
                while let Some(frame) = line.poll(at(tick)) {
                    let stamp = at(frame).as_nanos() + AHEAD_NS;
                    playout.on_frame(at(tick), frame as u32, stamp, frame);
                }
                std::iter::from_fn(|| playout.take(at(tick))).collect()
            })
            .collect();
        (playout, played)
    }

    #[test]
    fn a_steady_line_is_played_at_its_own_delay_one_frame_a_tick() {
        let (_, played) = run(
            Impairment {
                delay: TICK * 20,
                ..Default::default()
            },
            5000,
        );
        for (tick, frames) in (1_u64..).zip(&played) {
            let expected: Vec<u64> = tick
                .checked_sub(20)
                .filter(|&frame| 0 < frame)
                .into_iter()
                .collect();
            assert_eq!(*frames, expected, "tick {tick}");
        }
    }

    #[test]
    fn jitter_settles_to_a_constant_delay_with_about_one_late_frame_in_a_window() {
        for distribution in [JitterDistribution::Normal, JitterDistribution::HeavyTailed] {
            let line = Impairment {
                delay: TICK * 100,
                jitter: TICK * 25,
                distribution,
                duplicate: 0.2,
                ..Default::default()
            };
            let (before, _) = run(line, 20_000);
            let (after, played) = run(line, 60_000);
            let late = after.counts().late_frames - before.counts().late_frames;
            let share = late as f64 / 40_000.0;
            let delay_s = after.offset_s().unwrap() + AHEAD_NS as f64 * 1e-9;
            println!("{distribution:?}: {share} late, delay {delay_s} s");
            // A line of 100 ms, deviation 25 ms: the one hundred and twenty-eighth part is beyond 2.4 deviations of the
            // normal.
            assert!(share < 1.5 / f64::from(WINDOW), "{distribution:?}: {share}");
            assert!(
                (0.14..0.22).contains(&delay_s),
                "{distribution:?}: {delay_s} s"
            );
            let steady = played[20_000..]
                .iter()
                .filter(|frames| frames.len() == 1)
                .count();
            assert!(
                0.97 < steady as f64 / 40_000.0,
                "{distribution:?}: {steady}"
            );
        }
    }

    #[test]
    fn a_slower_line_is_followed_at_once_and_a_faster_one_tick_by_tick() {
        let by = |delay| Impairment {
            delay: TICK * delay,
            ..Default::default()
        };
        let mut line = Conditioner::new(by(10), 1, 8192);
        let mut playout = Playout::new(TICK_S);
        let mut delay_after = vec![None];
        for tick in 1..20_000_u64 {
            match tick {
                2000 => line.impair(by(60)),
                6000 => line.impair(by(30)),
                _ => {}
            }
            line.push(at(tick), tick);
            while let Some(frame) = line.poll(at(tick)) {
                playout.on_frame(at(tick), frame as u32, at(frame).as_nanos(), frame);
            }
            let newest = std::iter::from_fn(|| playout.take(at(tick))).last();
            delay_after.push(newest.map(|frame| tick - frame));
        }
        assert_eq!(delay_after[1999], Some(10));
        assert_eq!(delay_after[2060], Some(60));
        assert_eq!(delay_after[6060], Some(60));
        assert_eq!(delay_after[19_999], Some(30));
        let steps = delay_after[2060..].iter().flatten().collect::<Vec<_>>();
        assert_eq!(steps.len(), 20_000 - 2060, "a tick without a frame");
        assert!(
            steps
                .windows(2)
                .all(|pair| pair[1] <= pair[0] && pair[0] - pair[1] <= 1)
        );
    }

    #[test]
    fn a_clock_that_runs_off_is_followed() {
        for ppm in [-100.0, 100.0] {
            let mut playout = Playout::new(TICK_S);
            let mut played = 0;
            for tick in 1..120_000_u64 {
                let stamp = (at(tick).as_nanos() as f64 * (1.0 + ppm * 1e-6)) as u64;
                playout.on_frame(at(tick), tick as u32, stamp, tick);
                while let Some(frame) = playout.take(at(tick)) {
                    assert!(tick - frame <= 2, "{ppm} ppm: frame {frame} at {tick}");
                    played += 1;
                }
            }
            assert!(119_990 < played, "{ppm} ppm: {played}");
            assert_eq!(playout.counts().late_frames, 0);
        }
    }

    #[test]
    fn a_peer_whose_clock_was_set_is_played_on() {
        let mut playout = Playout::new(TICK_S);
        for (tick, stamp) in [(1, 50_u64), (2, 51), (3, 5000), (4, 5001)] {
            playout.on_frame(at(tick), tick as u32, at(stamp).as_nanos(), tick);
            assert_eq!(playout.take(at(tick)), Some(tick));
        }
    }

    proptest! {
        /// Whatever comes, nothing is played twice, nothing out of the order of its stamps, and nothing that never
        /// came.
        #[test]
        fn order_holds_whatever_comes(arrivals in prop::collection::vec((0_u64..400, any::<u64>(), any::<bool>()), 1..300)) {
            let mut playout = Playout::new(TICK_S);
            let mut newest = None;
            for (tick, (frame, wild, is_wild)) in (1_u64..).zip(arrivals) {
                let stamp = if is_wild { wild } else { at(frame).as_nanos() };
                playout.on_frame(at(tick), frame as u32, stamp, stamp);
                while let Some(stamp) = playout.take(at(tick)) {
                    prop_assert!(newest.is_none_or(|newest| newest < stamp));
                    newest = Some(stamp);
                }
            }
        }
    }
}
