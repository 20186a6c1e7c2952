//! Frames that come one a tick but for the phase of two clocks: in some ticks none, in the next two.
//!
//! Whoever follows what was told last stands still in the one and goes twice as far in the other; clay that answers
//! speed answers with nothing and with the double. The play head goes on by a tick every tick instead. Where the newest
//! frame is ahead of it or behind, the place told is carried back or on by the speed told:
//!
//! ```text
//! frame      7    8    .    9,10   11
//! lead       0    0    1   -0.05  -0.05 ...        ticks by which the head is ahead of the newest frame
//! place      7    8    9    9.95   10.95 ...
//! ```
//!
//! The head is drawn to the newest frame, so that a line that becomes longer or clocks that run apart leave nothing
//! behind. While frames come on time the lead is exactly zero, and what was told is where one goes, to the last bit.
//!
//! It works on lines that are steady but for that: where frames are lost or overtaken, or vary by more than
//! [`MOST_TICKS`], nothing is known of the sender's time that two ticks would mend.

/// The lead shrinks to a third in so many ticks.
const DRAWN_TICKS: f64 = 20.0;
/// A place is carried on for so many ticks at most.
const MOST_TICKS: f64 = 2.0;
/// So many ticks without a loss make a line steady.
const STEADY_TICKS: u32 = 1000;
/// A lead below this is none.
const NONE_TICKS: f64 = 1e-3;

/// Follows the frames of one sender.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PlayHead {
    /// Number of the newest frame; nothing before the first.
    newest: Option<u32>,
    /// Frames that came since the last tick.
    came: f64,
    /// Ticks that the head is ahead of the newest frame.
    lead: f64,
    /// Ticks without a loss.
    steady: u32,
    /// Whether the lead counts: from when the line is steady until it is not, and the lead has gone.
    is_engaged: bool,
}

impl PlayHead {
    /// A frame came that is newer than all before.
    pub(super) fn on_frame(&mut self, sequence: u32) {
        let before = self.newest.replace(sequence);
        let passed = before.map_or(1, |before| sequence.wrapping_sub(before));
        if passed != 1 {
            self.steady = 0;
        }
        self.came += f64::from(passed);
    }

    /// Advances by a tick: for how many ticks the place told last is to be carried on, below zero for back; nothing
    /// where it is to be taken as it was told.
    pub(super) fn step(&mut self) -> Option<f64> {
        let came = std::mem::take(&mut self.came);
        self.lead += 1.0 - came - self.lead / DRAWN_TICKS;
        if MOST_TICKS + 0.5 < self.lead.abs() {
            self.steady = 0;
            self.lead = self.lead.clamp(-MOST_TICKS, MOST_TICKS);
        } else {
            self.steady = self.steady.saturating_add(1);
        }
        if self.lead.abs() < NONE_TICKS {
            self.lead = 0.0;
            self.is_engaged = false;
        }
        self.is_engaged |= STEADY_TICKS < self.steady;
        let is_on_time = self.lead.abs() < NONE_TICKS;
        let lead = self.lead.clamp(-MOST_TICKS, MOST_TICKS);
        (self.is_engaged && !is_on_time).then_some(lead)
    }

    /// Starts anew.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where one goes tick by tick who is told places a tick apart, so many of them in each tick.
    fn places(came: impl IntoIterator<Item = u32>) -> Vec<f64> {
        let mut head = PlayHead::default();
        let mut newest = 0;
        let place = |came| {
            for _ in 0..came {
                newest += 1;
                head.on_frame(newest);
            }
            f64::from(newest) + head.step().unwrap_or(0.0)
        };
        came.into_iter().map(place).collect()
    }

    #[test]
    fn frames_on_time_are_followed_exactly() {
        let places = places(std::iter::repeat_n(1, 3000));
        assert!(
            places
                .iter()
                .zip(1..)
                .all(|(&place, tick)| place.to_bits() == f64::from(tick).to_bits())
        );
    }

    #[test]
    fn a_tick_without_a_frame_and_one_with_two_are_ticks_like_any_other() {
        for pattern in [[0, 2, 1, 1], [0, 1, 2, 1], [0, 2, 0, 2], [2, 0, 1, 1]] {
            let came = std::iter::repeat_n(1, 2000)
                .chain(pattern)
                .chain(std::iter::repeat_n(1, 200));
            for pair in places(came).windows(2).skip(1900) {
                let speed = pair[1] - pair[0];
                assert!((0.85..1.15).contains(&speed), "{pattern:?}: {speed}");
            }
        }
    }

    /// Clocks that run apart, and a line that is longer from now on: the head lets itself fall back.
    #[test]
    fn a_frame_that_is_late_for_good_leaves_nothing_behind() {
        let came = std::iter::repeat_n(1, 2000)
            .chain([0])
            .chain(std::iter::repeat_n(1, 400));
        let places = places(came);
        assert!(
            places
                .windows(2)
                .skip(1900)
                .all(|pair| 0.9 < pair[1] - pair[0])
        );
        assert_eq!(
            places.last().map(|place| place.to_bits()),
            Some(2400.0_f64.to_bits())
        );
    }

    #[test]
    fn silence_is_bridged_for_two_ticks_and_then_held() {
        let came = std::iter::repeat_n(1, 2000).chain(std::iter::repeat_n(0, 500));
        let places = places(came);
        assert!(places.iter().all(|&place| place <= 2002.0));
    }

    #[test]
    fn a_line_that_loses_frames_is_followed_as_it_is() {
        let mut head = PlayHead::default();
        for tick in 1..20_000_u32 {
            if tick % 100 != 0 {
                head.on_frame(tick);
            }
            assert_eq!(head.step(), None, "tick {tick}");
        }
    }
}
