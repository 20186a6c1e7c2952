//! The psychometric function that fits answers best, and how sure its threshold is.
//!
//! Maximum likelihood over location, spread and, where they are free, guess and lapse rate, each within bounds
//! ([WH01a], [KP16]). A lapse rate that is fitted freely to few trials pulls threshold and slope with it ([P12]); so
//! the usual case is a fixed one, or one that is bounded tightly.
//!
//! The interval is that of the profile likelihood: every threshold `m` with
//!
//! ```text
//! 2 (l(best) - max l over everything else, threshold m) <= chi²(1, confidence) (1 + b / trials)
//! ```
//!
//! With `b = 0` its coverage is the stated confidence where there are many trials. With few, the statistic scatters
//! more widely than chi², by a factor of the form `1 + b / trials` (Bartlett's, [B37]). Levels that are fixed
//! beforehand need none. A staircase does: it puts its trials where the answers led it, makes the function look steeper
//! than it is, and the interval too narrow. Its `b` was found by simulation, [`STAIRCASE_CORRECTION`];
//! `tests/coverage.rs` holds what comes of it, from both sides, and the program's `simulate` says it of any other
//! study.

use crate::normal;
use crate::psychometric::{Psychometric, Shape};

/// Answers at one level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counts {
    /// The level.
    pub level: f64,
    /// How many trials.
    pub trials: u32,
    /// How many of them were right, or answered with yes.
    pub noticed: u32,
}

/// A guess or a lapse rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// Known beforehand.
    Fixed(f64),
    /// Fitted, from zero up to this.
    UpTo(f64),
}

/// What is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// The shape.
    pub shape: Shape,
    /// Share of right answers where nothing is noticed.
    pub guess: Rate,
    /// Share of wrong answers however clear it is.
    pub lapse: Rate,
    /// Of the threshold's interval, between 0 and 1.
    pub confidence: f64,
    /// `b` of the factor that widens the interval, not below zero.
    pub correction: f64,
}

/// `b` of staircases that go down after two or three: of 600 simulated runs each of 60, 80, 120 and 160 trials, the 80,
/// 90 and 95 % quantiles of the statistic were those of chi² times a factor with `b` of 20 to 40 for steps of a third
/// of the function's spread, and of 10 to 30 for steps as wide as it.
pub const STAIRCASE_CORRECTION: f64 = 30.0;

/// The best fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// The function.
    pub function: Psychometric,
    /// Ends of the threshold's interval; nothing where the answers set no bound within reach of the levels.
    pub interval: [Option<f64>; 2],
    /// The interval's confidence, as asked for.
    pub confidence: f64,
    /// Logarithm of the likelihood, without the binomial coefficients.
    pub log_likelihood: f64,
    /// Twice the logarithm of the likelihood's ratio to that of a model with a share for every level.
    pub deviance: f64,
    /// How many trials it stands on.
    pub trials: u32,
}

/// Answers that say nothing of a threshold.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// There is no slope in one level.
    #[error("{got} levels with answers, wanted 2 at least")]
    Levels {
        /// How many.
        got: usize,
    },
    /// The best threshold is beyond everything that was shown.
    #[error(
        "the answers put the threshold beyond {least} to {most}, wanted levels on both sides of it"
    )]
    OutOfReach {
        /// End of what was searched.
        least: f64,
        /// The other one.
        most: f64,
    },
    /// More answers than trials.
    #[error("{noticed} of {trials} noticed at level {level}, wanted no more than all")]
    Counts {
        /// The level that has them.
        level: f64,
        /// As given.
        trials: u32,
        /// As given.
        noticed: u32,
    },
}

/// Places that are tried before the best is refined.
const GRID: usize = 31;
/// Spreads that are tried for each.
const SPREADS: usize = 13;
/// Spreads are searched from this share of the levels' range on: a steeper function is a step to these levels.
const LEAST_SPREAD: f64 = 0.01;
/// And up to so many ranges: a flatter one is even to them.
const MOST_SPREAD: f64 = 5.0;
/// Shares are kept off zero and one by this, so that one answer does not count for infinitely much.
const LEAST_SHARE: f64 = 1e-9;

/// Fits a model to counts.
///
/// # Errors
/// Counts that say nothing of a threshold.
pub fn fit(counts: &[Counts], model: &Model) -> Result<Fit, FitError> {
    let data = Data::new(counts, model)?;
    let step = (data.most - data.least) / (GRID - 1) as f64;
    let mut shares = vec![0.0; data.counts.len()];
    let grid: Vec<f64> = (0..GRID)
        .map(|number| data.least + step * number as f64)
        .map(|location| data.best_of_grid(location, &mut shares).likelihood)
        .collect();
    let best = (0..GRID).fold(0, |best, at| if grid[best] < grid[at] { at } else { best });
    if best == 0 || best == GRID - 1 {
        return Err(FitError::OutOfReach {
            least: model.shape.level(data.least),
            most: model.shape.level(data.most),
        });
    }
    let around = data.least + step * best as f64;
    // Between the spreads of the grid the top may be a place further on.
    let location = highest(around - 2.0 * step, around + 2.0 * step, |location| {
        data.best_at(location).likelihood
    });
    let top = data.best_at(location);
    let [guess, lapse] = top.rates;
    let function = Psychometric {
        shape: model.shape,
        location,
        spread: top.log_spread.exp(),
        guess,
        lapse,
    };
    let z = normal::quantile(0.5 + 0.5 * model.confidence);
    let factor = 1.0 + model.correction / f64::from(data.trials);
    let least_likelihood = top.likelihood - 0.5 * z * z * factor;
    let end = |towards: f64| {
        data.crossing(location, towards * step, least_likelihood)
            .map(|place| model.shape.level(place))
    };
    Ok(Fit {
        function,
        interval: [end(-1.0), end(1.0)],
        confidence: model.confidence,
        log_likelihood: top.likelihood,
        deviance: 2.0 * (data.saturated() - top.likelihood),
        trials: data.trials,
    })
}

/// What fits best with the threshold at one place.
#[derive(Clone, Copy, Debug)]
struct Best {
    likelihood: f64,
    log_spread: f64,
    rates: [f64; 2],
}

/// Counts on the shape's axis, and where the threshold is looked for.
struct Data<'a> {
    model: &'a Model,
    /// Place, noticed, not noticed.
    counts: Vec<(Option<f64>, f64, f64)>,
    trials: u32,
    least: f64,
    most: f64,
    range: f64,
}

impl<'a> Data<'a> {
    fn new(counts: &[Counts], model: &'a Model) -> Result<Self, FitError> {
        let mut places = Vec::new();
        let mut data = Vec::new();
        let mut trials = 0;
        for &Counts {
            level,
            trials: of,
            noticed,
        } in counts.iter().filter(|counts| 0 < counts.trials)
        {
            if of < noticed {
                return Err(FitError::Counts {
                    level,
                    trials: of,
                    noticed,
                });
            }
            let place = model.shape.place(level);
            places.extend(place);
            trials += of;
            data.push((place, f64::from(noticed), f64::from(of - noticed)));
        }
        places.sort_by(f64::total_cmp);
        places.dedup_by(|a, b| a.to_bits() == b.to_bits());
        let [first, .., last] = places[..] else {
            return Err(FitError::Levels { got: places.len() });
        };
        let range = last - first;
        Ok(Self {
            model,
            counts: data,
            trials,
            least: first - range,
            most: last + range,
            range,
        })
    }

    /// The logarithms of the spreads that are searched: the first, and how far apart those of the grid are.
    fn spreads(&self) -> (f64, f64) {
        let least = (LEAST_SPREAD * self.range).ln();
        let most = (MOST_SPREAD * self.range).ln();
        (least, (most - least) / (SPREADS - 1) as f64)
    }

    /// The best of the grid's spreads with the threshold here.
    fn best_of_grid(&self, location: f64, shares: &mut [f64]) -> Best {
        let (least, step) = self.spreads();
        let mut best = self.with(location, least, shares);
        for number in 1..SPREADS {
            let other = self.with(location, least + step * number as f64, shares);
            if best.likelihood < other.likelihood {
                best = other;
            }
        }
        best
    }

    /// The best with the threshold here.
    fn best_at(&self, location: f64) -> Best {
        let mut shares = vec![0.0; self.counts.len()];
        let near = self.best_of_grid(location, &mut shares).log_spread;
        let (least, step) = self.spreads();
        let from = (near - step).max(least);
        let to = (near + step).min(least + step * (SPREADS - 1) as f64);
        let log_spread = highest(from, to, |log_spread| {
            self.with(location, log_spread, &mut shares).likelihood
        });
        self.with(location, log_spread, &mut shares)
    }

    fn with(&self, location: f64, log_spread: f64, shares: &mut [f64]) -> Best {
        self.shape_at(location, log_spread.exp(), shares);
        let (likelihood, rates) = self.best_rates(shares);
        Best {
            likelihood,
            log_spread,
            rates,
        }
    }

    fn shape_at(&self, location: f64, spread: f64, shares: &mut [f64]) {
        for (share, (place, ..)) in shares.iter_mut().zip(&self.counts) {
            *share = place.map_or(0.0, |place| {
                self.model.shape.share((place - location) / spread)
            });
        }
    }

    /// The likelihood is concave in both rates, for the shares are linear in them: one after the other leads to the
    /// top.
    fn best_rates(&self, shares: &[f64]) -> (f64, [f64; 2]) {
        let Model { guess, lapse, .. } = *self.model;
        match (guess, lapse) {
            (Rate::Fixed(guess), Rate::Fixed(lapse)) => {
                (self.likelihood(shares, guess, lapse), [guess, lapse])
            }
            (Rate::Fixed(guess), Rate::UpTo(most)) => {
                let lapse = highest(0.0, most, |lapse| self.likelihood(shares, guess, lapse));
                (self.likelihood(shares, guess, lapse), [guess, lapse])
            }
            (Rate::UpTo(most), Rate::Fixed(lapse)) => {
                let guess = highest(0.0, most, |guess| self.likelihood(shares, guess, lapse));
                (self.likelihood(shares, guess, lapse), [guess, lapse])
            }
            (Rate::UpTo(most_guess), Rate::UpTo(most_lapse)) => {
                let (mut guess, mut lapse) = (0.5 * most_guess, 0.5 * most_lapse);
                for _ in 0..ALTERNATIONS {
                    guess = highest(0.0, most_guess, |guess| {
                        self.likelihood(shares, guess, lapse)
                    });
                    lapse = highest(0.0, most_lapse, |lapse| {
                        self.likelihood(shares, guess, lapse)
                    });
                }
                (self.likelihood(shares, guess, lapse), [guess, lapse])
            }
        }
    }

    fn likelihood(&self, shares: &[f64], guess: f64, lapse: f64) -> f64 {
        let of = |(share, (_, noticed, not)): (&f64, &(Option<f64>, f64, f64))| {
            let share = guess + (1.0 - guess - lapse) * share;
            log_likelihood(share, *noticed, *not)
        };
        shares.iter().zip(&self.counts).map(of).sum()
    }

    /// The likelihood of a model that has a share for every level.
    fn saturated(&self) -> f64 {
        let of = |(_, noticed, not): &(Option<f64>, f64, f64)| {
            log_likelihood(noticed / (noticed + not), *noticed, *not)
        };
        self.counts.iter().map(of).sum()
    }

    /// Where the profile falls below `least`, from the best place on in steps, and then between two of them.
    fn crossing(&self, from: f64, step: f64, least: f64) -> Option<f64> {
        let mut inside = from;
        loop {
            let outside = inside + step;
            if !(self.least <= outside && outside <= self.most) {
                return None;
            }
            if self.best_at(outside).likelihood < least {
                return Some(self.bisected(inside, outside, least));
            }
            inside = outside;
        }
    }

    fn bisected(&self, mut inside: f64, mut outside: f64, least: f64) -> f64 {
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (inside + outside);
            if self.best_at(middle).likelihood < least {
                outside = middle;
            } else {
                inside = middle;
            }
        }
        0.5 * (inside + outside)
    }
}

/// Rounds over two rates: each takes most of what is left.
const ALTERNATIONS: usize = 6;
/// A grid's step over a thousand: less than anybody reads of a threshold.
const BISECTIONS: usize = 10;
/// Golden sections: to a thousandth of the bracket.
const SECTIONS: usize = 16;

fn log_likelihood(share: f64, noticed: f64, not: f64) -> f64 {
    let share = share.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
    noticed * share.ln() + not * (1.0 - share).ln()
}

/// Where a function with one top between two places is highest, by golden sections.
fn highest(mut least: f64, mut most: f64, mut value: impl FnMut(f64) -> f64) -> f64 {
    let share = 0.5 * (5.0_f64.sqrt() - 1.0);
    let mut low = most - share * (most - least);
    let mut high = least + share * (most - least);
    let (mut at_low, mut at_high) = (value(low), value(high));
    for _ in 0..SECTIONS {
        if at_low < at_high {
            (least, low, at_low) = (low, high, at_high);
            high = least + share * (most - least);
            at_high = value(high);
        } else {
            (most, high, at_high) = (high, low, at_low);
            low = most - share * (most - least);
            at_low = value(low);
        }
    }
    0.5 * (least + most)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODEL: Model = Model {
        shape: Shape::CumulativeGaussian,
        guess: Rate::Fixed(0.5),
        lapse: Rate::Fixed(0.02),
        confidence: 0.95,
        correction: 0.0,
    };

    /// So many trials that the shares are those of the function.
    fn exact(function: &Psychometric, levels: &[f64]) -> Vec<Counts> {
        const TRIALS: u32 = 10_000_000;
        let of = |level: &f64| Counts {
            level: *level,
            trials: TRIALS,
            noticed: (function.share(*level) * f64::from(TRIALS)).round() as u32,
        };
        levels.iter().map(of).collect()
    }

    #[test]
    fn answers_without_chance_give_the_function_back() {
        for (shape, location, spread) in [
            (Shape::CumulativeGaussian, 0.1, 0.04),
            (Shape::Weibull, 0.1_f64.ln(), 0.4),
        ] {
            for (guess, lapse, rates) in [
                (0.5, 0.02, [Rate::Fixed(0.5), Rate::Fixed(0.02)]),
                (0.5, 0.03, [Rate::Fixed(0.5), Rate::UpTo(0.06)]),
                (0.04, 0.03, [Rate::UpTo(0.1), Rate::UpTo(0.06)]),
            ] {
                let function = Psychometric {
                    shape,
                    location,
                    spread,
                    guess,
                    lapse,
                };
                let counts = exact(&function, &[0.01, 0.04, 0.07, 0.1, 0.13, 0.16, 0.25, 0.4]);
                let model = Model {
                    shape,
                    guess: rates[0],
                    lapse: rates[1],
                    ..MODEL
                };
                let found = fit(&counts, &model).unwrap();
                let off = found.function.threshold() / 0.1 - 1.0;
                assert!(off.abs() < 2e-3, "{shape:?} {rates:?}: {found:?}");
                let off = found.function.spread / spread - 1.0;
                assert!(off.abs() < 1e-2, "{shape:?} {rates:?}: {found:?}");
                assert!((found.function.lapse - lapse).abs() < 1e-3, "{found:?}");
            }
        }
    }

    /// With the spread known and no lapses, the likelihood of one parameter can be written down: at the interval's
    /// ends twice its logarithm is below the top by the square of the normal quantile.
    #[test]
    fn the_interval_ends_where_the_profile_has_fallen_by_half_of_chi_squared() {
        let function = Psychometric {
            shape: Shape::CumulativeGaussian,
            location: 0.1,
            spread: 0.05,
            guess: 0.5,
            lapse: 0.02,
        };
        let counts: Vec<Counts> = exact(&function, &[0.0, 0.05, 0.1, 0.15, 0.2])
            .into_iter()
            .map(|counts| Counts {
                trials: 40,
                noticed: (f64::from(counts.noticed) * 40.0 / 1e7).round() as u32,
                ..counts
            })
            .collect();
        let found = fit(&counts, &MODEL).unwrap();
        // The profile by brute force.
        let profile = |location: f64| {
            let mut most = f64::NEG_INFINITY;
            for number in 0..4000 {
                let function = Psychometric {
                    location,
                    spread: 0.002 * (f64::from(number) * 1.6e-3).exp(),
                    ..function
                };
                let of = |counts: &Counts| {
                    let share = function.share(counts.level);
                    let not = counts.trials - counts.noticed;
                    f64::from(counts.noticed) * share.ln() + f64::from(not) * (1.0 - share).ln()
                };
                most = counts.iter().map(of).sum::<f64>().max(most);
            }
            most
        };
        let best = profile(found.function.location);
        for (correction, factor) in [(0.0, 1.0), (30.0, 1.0 + 30.0 / 200.0)] {
            let found = fit(
                &counts,
                &Model {
                    correction,
                    ..MODEL
                },
            )
            .unwrap();
            for end in found.interval {
                let fallen = 2.0 * (best - profile(end.unwrap()));
                assert!((fallen - 3.841_458_8 * factor).abs() < 0.03, "{fallen}");
            }
        }
        let [least, most] = found.interval.map(Option::unwrap);
        assert!(least < found.function.location && found.function.location < most);
    }

    #[test]
    fn answers_that_say_nothing_of_a_threshold_are_refused() {
        let at = |level, noticed| Counts {
            level,
            trials: 20,
            noticed,
        };
        let refused = |counts: &[Counts]| fit(counts, &MODEL).unwrap_err();
        assert_eq!(refused(&[]), FitError::Levels { got: 0 });
        assert_eq!(
            refused(&[at(0.1, 10), at(0.1, 12)]),
            FitError::Levels { got: 1 }
        );
        assert!(matches!(
            refused(&[at(0.1, 20), at(0.2, 20), at(0.3, 20)]),
            FitError::OutOfReach { .. }
        ));
        assert!(matches!(
            refused(&[at(0.1, 21), at(0.2, 1)]),
            FitError::Counts { .. }
        ));
    }
}
