//! In how many packets a sweep goes out before a word of it is waited for.

/// Packets of a round at least. With every third packet lost, one sweep in a hundred needs a second round.
const LEAST_COPIES: f64 = 4.0;
/// Packets of a round at most. These many sweeps, one a packet, leave a sixth of the room to those made before.
const MOST_COPIES: f64 = 108.0;
/// A sweep that needs a second round makes rounds longer by so many packets, and one that comes with the first makes
/// them shorter by a tenth of that.
const COPIES_UP: f64 = 0.5;
const COPIES_DOWN: f64 = 0.05;

/// How long a round is, in packets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Copies(f64);

impl Default for Copies {
    fn default() -> Self {
        Self(LEAST_COPIES)
    }
}

impl Copies {
    pub(super) fn packets(self) -> u64 {
        self.0 as u64
    }

    /// A round was in vain: for one sweep in eleven that is as it should be.
    pub(super) fn on_second_round(&mut self) {
        self.0 = (self.0 + COPIES_UP).min(MOST_COPIES);
    }

    pub(super) fn on_first_round_that_came(&mut self) {
        self.0 = (self.0 - COPIES_DOWN).max(LEAST_COPIES);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_grow_on_a_line_that_lets_little_through_and_shrink_on_a_good_one() {
        let mut copies = Copies::default();
        for _ in 0..1000 {
            copies.on_second_round();
        }
        assert_eq!(copies.packets(), MOST_COPIES as u64);
        for _ in 0..3000 {
            copies.on_first_round_that_came();
        }
        assert_eq!(copies.packets(), LEAST_COPIES as u64);
    }
}
