//! Who meets which condition when, and what it is called meanwhile.
//!
//! Counterbalancing by a Latin square that is balanced for what comes right before what: Williams' square ([W49] in
//! docs/papers.md). With an even number `n` of conditions it has `n` orders, with an odd one `2 n`. Every condition
//! stands at every place equally often, and right behind every other one equally often.

use crate::chance::Chance;

/// Letters of a code: none that makes a word with others, and none that is read as another.
const LETTERS: &[u8; 16] = b"BCDFGHJKLMPRTVXZ";

/// The orders of a balanced Latin square over `conditions` conditions, each as numbers from 0.
///
/// ```
/// let square = teleclay_study::order::williams(4);
/// assert_eq!(square[0], [0, 1, 3, 2]);
/// assert_eq!(square.len(), 4);
/// ```
pub fn williams(conditions: usize) -> Vec<Vec<usize>> {
    let zigzag = (0..conditions).map(|place| match place % 2 {
        0 => (conditions - place / 2) % conditions,
        _ => place.div_ceil(2),
    });
    let first: Vec<usize> = zigzag.collect();
    let shifted = |by: usize| -> Vec<usize> {
        let shift = |condition: &usize| (condition + by) % conditions;
        first.iter().map(shift).collect()
    };
    let mut orders: Vec<Vec<usize>> = (0..conditions).map(shifted).collect();
    if conditions % 2 == 1 && 1 < conditions {
        let mirrored: Vec<Vec<usize>> = orders
            .iter()
            .map(|order| order.iter().rev().copied().collect())
            .collect();
        orders.extend(mirrored);
    }
    orders
}

/// The order in which a participant, counted from 1, meets the conditions. Which order of the square is whose, the
/// seed says; every full round of participants has each order once.
pub fn order(seed: u64, conditions: usize, participant: u32) -> Vec<usize> {
    let mut orders = williams(conditions);
    let number = participant.saturating_sub(1) as usize;
    let round = (number / orders.len().max(1)) as u64;
    Chance::new(seed, "orders", &[round]).shuffle(&mut orders);
    let at = number % orders.len().max(1);
    orders.swap_remove(at)
}

/// What each condition is called before a participant: three letters, other ones for every participant.
pub fn codes(seed: u64, conditions: usize, participant: u32) -> Vec<String> {
    let mut chance = Chance::new(seed, "codes", &[u64::from(participant)]);
    let mut codes: Vec<String> = Vec::with_capacity(conditions);
    while codes.len() < conditions {
        let letter = |_| char::from(LETTERS[chance.below(LETTERS.len())]);
        let code: String = (0..3).map(letter).collect();
        if !codes.contains(&code) {
            codes.push(code);
        }
    }
    codes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_condition_stands_at_every_place_and_behind_every_other_equally_often() {
        for conditions in 1..=9 {
            let square = williams(conditions);
            let rounds = if conditions % 2 == 1 && 1 < conditions {
                2
            } else {
                1
            };
            assert_eq!(square.len(), rounds * conditions);
            for condition in 0..conditions {
                for place in 0..conditions {
                    let there = square.iter().filter(|order| order[place] == condition);
                    assert_eq!(
                        there.count(),
                        rounds,
                        "{conditions}: {condition} at {place}"
                    );
                }
                for before in (0..conditions).filter(|before| *before != condition) {
                    let pairs = square.iter().flat_map(|order| order.windows(2));
                    let met = pairs.filter(|pair| **pair == [before, condition]).count();
                    assert_eq!(met, rounds, "{conditions}: {condition} behind {before}");
                }
            }
        }
    }

    #[test]
    fn a_round_of_participants_has_every_order_once_and_the_seed_says_whose() {
        let round = |seed| -> Vec<Vec<usize>> {
            (1..=4)
                .map(|participant| order(seed, 4, participant))
                .collect()
        };
        let mut sorted = round(7);
        sorted.sort();
        let mut square = williams(4);
        square.sort();
        assert_eq!(sorted, square);
        assert_eq!(round(7), round(7));
        assert!((8..20).any(|seed| round(seed) != round(7)));
    }

    #[test]
    fn codes_are_apart_and_say_nothing_from_one_participant_to_the_next() {
        for participant in 1..50 {
            let mut own = codes(7, 9, participant);
            own.sort();
            own.dedup();
            assert_eq!(own.len(), 9);
        }
        assert_ne!(codes(7, 9, 1), codes(7, 9, 2));
        assert_eq!(codes(7, 9, 1), codes(7, 9, 1));
    }
}
