//! Which numbers have come, of those that may still come.

/// Numbers behind the newest that are told apart: two seconds of frames. What is older counts as having come.
pub(crate) const WIDTH: u64 = 2048;
const WORDS: usize = (WIDTH / 64) as usize;

/// The numbers that have come. Number 0 never does.
#[derive(Clone, Debug)]
pub(crate) struct Window {
    newest: u64,
    /// Bit `n % WIDTH` tells of the number `n` within the width behind the newest.
    has_come: [u64; WORDS],
}

impl Window {
    pub(crate) const fn new() -> Self {
        Self {
            newest: 0,
            has_come: [0; WORDS],
        }
    }

    /// Whether a number comes for the first time; from then on it has come.
    pub(crate) fn take(&mut self, number: u64) -> bool {
        if number == 0 || WIDTH <= self.newest.saturating_sub(number) {
            return false;
        }
        if self.newest < number {
            if WIDTH <= number - self.newest {
                self.has_come = [0; WORDS];
            } else {
                for between in self.newest + 1..=number {
                    self.clear(between);
                }
            }
            self.newest = number;
        }
        let (word, bit) = place(number);
        let is_new = self.has_come[word] & bit == 0;
        self.has_come[word] |= bit;
        is_new
    }

    fn clear(&mut self, number: u64) {
        let (word, bit) = place(number);
        self.has_come[word] &= !bit;
    }
}

fn place(number: u64) -> (usize, u64) {
    let index = number % WIDTH;
    ((index / 64) as usize, 1 << (index % 64))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Against a set of everything that has come.
        #[test]
        fn a_number_is_taken_once_and_never_when_it_is_too_old(
            steps in prop::collection::vec(
                prop_oneof![8 => -40_i64..80, 2 => -3000_i64..3000, 1 => 0_i64..10_000], 1..400)
        ) {
            let mut window = Window::new();
            let mut come = BTreeSet::new();
            let (mut newest, mut at) = (0_u64, 5000_i64);
            for step in steps {
                at = (at + step).max(0);
                let number = at as u64;
                let is_wanted = number != 0 && newest < number + WIDTH && !come.contains(&number);
                prop_assert_eq!(window.take(number), is_wanted, "{} after {}", number, newest);
                if is_wanted {
                    come.insert(number);
                    newest = newest.max(number);
                }
            }
        }
    }

    #[test]
    fn the_last_number_of_all_can_come() {
        let mut window = Window::new();
        assert!(window.take(u64::MAX));
        assert!(!window.take(u64::MAX));
        assert!(window.take(u64::MAX - 1));
        assert!(!window.take(1));
    }
}
