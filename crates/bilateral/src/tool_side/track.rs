//! Where the tool was of late, to be compared with a handle whose frames come later.

use teleclay_link::Vec3;
use teleclay_link::time::Timestamp;

/// Ticks that are remembered: the longest ways there are, twice over.
const TICKS: usize = 2048;

/// Places of the tool, tick by tick.
pub(super) struct Track {
    /// A ring, the newest last but for where it begins.
    places: Vec<(Timestamp, Vec3)>,
    begins: usize,
}

impl Track {
    /// Of a tool that has not moved.
    pub(super) fn new() -> Self {
        Self {
            places: Vec::with_capacity(TICKS),
            begins: 0,
        }
    }

    /// The tool was put somewhere: how it came there is no motion.
    pub(super) fn forget(&mut self) {
        self.places.clear();
        self.begins = 0;
    }

    /// The tool is at `place` from this tick on.
    pub(super) fn push(&mut self, now: Timestamp, place: Vec3) {
        if self.places.len() < TICKS {
            self.places.push((now, place));
        } else {
            self.places[self.begins] = (now, place);
            self.begins = (self.begins + 1) % TICKS;
        }
    }

    /// Where the tool was at an instant of its own clock, ns, between two ticks in proportion. Nothing where that is
    /// not remembered any more, or not yet.
    pub(super) fn at(&self, instant_ns: f64) -> Option<Vec3> {
        let (recent, old) = self.places.split_at(self.begins);
        let place = |index: usize| match old.get(index) {
            Some(place) => Some(place),
            None => recent.get(index - old.len()),
        };
        let (mut before, mut after) = (0, self.places.len());
        // Ticks come in order, so the last one that is not after the instant is found by halves.
        while 1 < after - before {
            let middle = before.midpoint(after);
            if place(middle)?.0.as_nanos() as f64 <= instant_ns {
                before = middle;
            } else {
                after = middle;
            }
        }
        let &(from, from_place) = place(before)?;
        let passed_ns = instant_ns - from.as_nanos() as f64;
        if passed_ns < 0.0 {
            return None;
        }
        let Some(&(to, to_place)) = place(before + 1) else {
            return Some(from_place);
        };
        let share = passed_ns / to.since(from).as_nanos().max(1) as f64;
        Some(from_place + (to_place - from_place) * share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tool that moves by a millimetre a tick: in the middle of two ticks it is in the middle of two places.
    #[test]
    fn a_place_is_told_by_its_instant_before_and_after_the_ring_is_full() {
        let at = |tick: usize| Timestamp::from_nanos(1_000_000 * tick as u64);
        let mut track = Track::new();
        assert_eq!(track.at(5e6), None);
        for tick in 1..=5000_usize {
            track.push(at(tick), Vec3::x() * (1e-3 * tick as f64));
            let oldest = tick.saturating_sub(TICKS - 1).max(1);
            for known in [oldest, oldest.midpoint(tick), tick - 1] {
                if !(oldest..tick).contains(&known) {
                    continue;
                }
                let place = track.at(1e6 * (known as f64 + 0.5)).unwrap();
                assert!((place.x - 1e-3 * (known as f64 + 0.5)).abs() < 1e-12);
            }
            assert_eq!(track.at(1e6 * (oldest as f64 - 0.5)), None);
            let newest = track.at(1e6 * (tick as f64 + 0.5)).unwrap();
            assert!((newest.x - 1e-3 * tick as f64).abs() < 1e-12);
        }
        track.forget();
        assert_eq!(track.at(5e9), None);
    }
}
