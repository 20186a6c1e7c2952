//! Which level comes next.
//!
//! *Constant stimuli*: levels that are fixed beforehand, each as often as the others, in an order of chance ([KP16]).
//! *Staircase*: after so many noticed in a row the next level is weaker, after so many missed in a row stronger
//! ([L71]). It gathers trials around the level where either is as likely; a one-up staircase that goes down after `n`
//! does so where a share of `(1/2)^(1/n)` is noticed: 0.707 for two, 0.794 for three.

use serde::{Deserialize, Serialize};

use crate::chance::Chance;

/// How a step changes a level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// It is added or taken away.
    #[default]
    Added,
    /// The level is multiplied or divided by it.
    Factor,
}

/// A staircase before its first trial.
#[derive(Clone, Debug, PartialEq)]
pub struct StaircaseRule {
    /// The first level.
    pub start: f64,
    /// The step before the first reversal, the one after it, and so on; the last one stays.
    pub steps: Vec<f64>,
    /// What a step does.
    pub scale: Scale,
    /// So many noticed in a row, and it goes down.
    pub down: u32,
    /// So many missed in a row, and it goes up.
    pub up: u32,
    /// No level is below this.
    pub least: f64,
    /// Or above this.
    pub most: f64,
    /// It ends with so many reversals.
    pub reversals: Option<u32>,
    /// And with so many trials in any case.
    pub trials: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    Down,
    Up,
}

/// A staircase.
#[derive(Clone, Debug)]
pub struct Staircase {
    rule: StaircaseRule,
    level: f64,
    noticed_in_row: u32,
    missed_in_row: u32,
    direction: Option<Direction>,
    reversals: Vec<f64>,
    trials: u32,
}

impl Staircase {
    /// Before the first trial.
    pub fn new(rule: StaircaseRule) -> Self {
        Self {
            level: rule.start,
            rule,
            noticed_in_row: 0,
            missed_in_row: 0,
            direction: None,
            reversals: Vec::new(),
            trials: 0,
        }
    }

    /// The next level; nothing once it has ended.
    pub fn next_level(&self) -> Option<f64> {
        let has_turned_enough = |most: u32| most as usize <= self.reversals.len();
        let is_over =
            self.rule.trials <= self.trials || self.rule.reversals.is_some_and(has_turned_enough);
        (!is_over).then_some(self.level)
    }

    /// Takes an answer to the level; whether the staircase turns there.
    pub fn answer(&mut self, is_noticed: bool) -> bool {
        self.trials += 1;
        if is_noticed {
            self.noticed_in_row += 1;
            self.missed_in_row = 0;
        } else {
            self.missed_in_row += 1;
            self.noticed_in_row = 0;
        }
        if self.rule.down <= self.noticed_in_row {
            self.step(Direction::Down)
        } else if self.rule.up <= self.missed_in_row {
            self.step(Direction::Up)
        } else {
            false
        }
    }

    /// Levels at which it turned.
    pub fn reversals(&self) -> &[f64] {
        &self.reversals
    }

    fn step(&mut self, direction: Direction) -> bool {
        (self.noticed_in_row, self.missed_in_row) = (0, 0);
        let before = self.direction.replace(direction);
        let turns = before.is_some_and(|before| before != direction);
        if turns {
            self.reversals.push(self.level);
        }
        let last = self.rule.steps.len() - 1;
        let step = self.rule.steps[self.reversals.len().min(last)];
        let level = match (self.rule.scale, direction) {
            (Scale::Added, Direction::Down) => self.level - step,
            (Scale::Added, Direction::Up) => self.level + step,
            (Scale::Factor, Direction::Down) => self.level / step,
            (Scale::Factor, Direction::Up) => self.level * step,
        };
        self.level = level.clamp(self.rule.least, self.rule.most);
        turns
    }
}

/// Levels in an order that is fixed beforehand: every round has each level once, in an order of its own.
pub(crate) fn rounds(levels: &[f64], repetitions: u32, chance: &mut Chance) -> Vec<f64> {
    let mut sequence = Vec::with_capacity(levels.len() * repetitions as usize);
    for _ in 0..repetitions {
        let mut round = levels.to_vec();
        chance.shuffle(&mut round);
        sequence.extend(round);
    }
    sequence
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observer::Observer;
    use crate::psychometric::{Psychometric, Shape};

    fn rule(down: u32) -> StaircaseRule {
        StaircaseRule {
            start: 8.0,
            steps: vec![2.0, 1.0],
            scale: Scale::Added,
            down,
            up: 1,
            least: 0.0,
            most: 10.0,
            reversals: Some(4),
            trials: 100,
        }
    }

    #[test]
    fn two_noticed_go_down_one_missed_goes_up_and_turns_are_told() {
        let mut staircase = Staircase::new(rule(2));
        let mut levels = Vec::new();
        let mut turns = Vec::new();
        for is_noticed in [
            true, true, true, true, false, true, false, true, true, true, true,
        ] {
            levels.push(staircase.next_level().unwrap());
            turns.push(staircase.answer(is_noticed));
        }
        // Down 8 to 6 to 4; missed at 4: a turn, and from now on by ones; missed again; then down.
        assert_eq!(
            levels,
            [8.0, 8.0, 6.0, 6.0, 4.0, 5.0, 5.0, 6.0, 6.0, 5.0, 5.0]
        );
        let turned: Vec<usize> = (0..11).filter(|trial| turns[*trial]).collect();
        assert_eq!(turned, [4, 8]);
        assert_eq!(staircase.reversals(), [4.0, 6.0]);
    }

    #[test]
    fn it_ends_with_its_reversals_or_its_trials_and_stays_within_its_bounds() {
        let mut staircase = Staircase::new(rule(1));
        let mut trials = 0;
        while let Some(level) = staircase.next_level() {
            assert!((0.0..=10.0).contains(&level));
            staircase.answer(trials % 2 == 0);
            trials += 1;
        }
        assert_eq!((trials, staircase.reversals().len()), (5, 4));
        let mut misses = Staircase::new(rule(1));
        let mut trials = 0;
        while let Some(level) = misses.next_level() {
            assert!(level <= 10.0);
            misses.answer(false);
            trials += 1;
        }
        assert_eq!(trials, 100);
    }

    #[test]
    fn a_factor_multiplies_and_divides() {
        let mut staircase = Staircase::new(StaircaseRule {
            steps: vec![2.0],
            scale: Scale::Factor,
            least: 0.5,
            ..rule(1)
        });
        let levels: Vec<f64> = [true, true, true, true, true, false]
            .map(|is_noticed| {
                let level = staircase.next_level().unwrap();
                staircase.answer(is_noticed);
                level
            })
            .into();
        assert_eq!(levels, [8.0, 4.0, 2.0, 1.0, 0.5, 0.5]);
    }

    /// [L71], table 1: where the staircases settle, by the mean of many reversals.
    #[test]
    fn staircases_settle_where_their_share_is_noticed() {
        let function = Psychometric {
            shape: Shape::CumulativeGaussian,
            location: 5.0,
            spread: 1.5,
            guess: 0.5,
            lapse: 0.0,
        };
        for down in [2, 3] {
            let share = 0.5_f64.powf(1.0 / f64::from(down));
            let mut observer = Observer::new(function, 1);
            let mut staircase = Staircase::new(StaircaseRule {
                steps: vec![0.25],
                least: -100.0,
                most: 100.0,
                reversals: None,
                trials: 60_000,
                ..rule(down)
            });
            while let Some(level) = staircase.next_level() {
                staircase.answer(observer.notices(level));
            }
            let turned = &staircase.reversals()[100..];
            let mean = turned.iter().sum::<f64>() / turned.len() as f64;
            let settled = function.level_at(share).unwrap();
            assert!((mean - settled).abs() < 0.12, "{down}: {mean}, {settled}");
        }
    }

    #[test]
    fn every_round_has_every_level_once() {
        let mut chance = Chance::new(1, "levels", &[]);
        let sequence = rounds(&[1.0, 2.0, 3.0, 4.0, 5.0], 20, &mut chance);
        assert_eq!(sequence.len(), 100);
        for round in sequence.chunks(5) {
            let mut round = round.to_vec();
            round.sort_by(f64::total_cmp);
            assert_eq!(round, [1.0, 2.0, 3.0, 4.0, 5.0]);
        }
        assert_ne!(sequence[..5], sequence[5..10]);
    }
}
