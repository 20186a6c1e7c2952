//! Many seeds of many cells, as rows.
//!
//! A row's errors are means over its seeds, with the worst seed beside them; its least energy is the least of any seed,
//! and it is stable only if every seed is.

use serde::{Deserialize, Deserializer, Serialize};

use crate::cell::{Cell, Profile};
use crate::run::Outcome;

/// Median and tails of a step, N.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quantiles {
    /// Half of the steps are smaller.
    pub p50: f64,
    /// 95 in a hundred.
    pub p95: f64,
    /// 99 in a hundred.
    pub p99: f64,
    /// The greatest.
    pub max: f64,
}

/// One cell over its seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The scheme's word.
    pub scheme: String,
    /// Mean one-way delay, s.
    pub one_way_delay_s: f64,
    /// Standard deviation of the one-way delay over its mean.
    pub jitter_ratio: f64,
    /// Share of frames lost, independently.
    pub loss: f64,
    /// What was done beside delay, jitter and independent loss.
    pub profile: Profile,
    /// How many seeds.
    pub seeds: usize,
    /// The first of them; the others follow.
    pub first_seed: u64,
    /// Whether every seed is stable.
    pub stable: bool,
    /// Share of seeds that are.
    pub stable_share: f64,
    /// Least energy of the channel in any seed, J.
    #[serde(deserialize_with = "measured")]
    pub min_energy_j: f64,
    /// Force error over force, root mean squares; mean of the seeds.
    #[serde(deserialize_with = "measured")]
    pub force_nrmse: f64,
    /// The same of the worst seed.
    #[serde(deserialize_with = "measured")]
    pub force_nrmse_worst: f64,
    /// Position error of the handle, m.
    #[serde(deserialize_with = "measured")]
    pub position_rmse_m: f64,
    /// Distance between tool and image of the handle, m.
    #[serde(deserialize_with = "measured")]
    pub coordination_rmse_m: f64,
    /// Removed volume off by this share; mean of the seeds.
    #[serde(deserialize_with = "measured")]
    pub removed_volume_error: f64,
    /// The same of the worst seed.
    #[serde(deserialize_with = "measured")]
    pub removed_volume_error_worst: f64,
    /// Share of time with a force error above what a hand can tell.
    #[serde(deserialize_with = "measured")]
    pub share_force_error_above_jnd: f64,
    /// Changes of the felt force by corrections, N a tick, of the ticks in which there was one.
    pub correction_step_n: Quantiles,
    /// Most energy that the hand has spent on cutting and so earned for corrections in any seed, J.
    #[serde(deserialize_with = "measured")]
    pub earned_j: f64,
    /// Most energy that corrections brought into the hand in any seed, J.
    #[serde(deserialize_with = "measured")]
    pub injected_j: f64,
    /// What the copy hid, over what was felt; `null` for schemes without a copy.
    pub hidden_force_nrmse: Option<f64>,
    /// Whether every copy was the server's in every seed once the line was drained; `null` for schemes without a copy.
    pub clay_identical: Option<bool>,
    /// Frames both ways, a second.
    #[serde(deserialize_with = "measured")]
    pub packets_per_s: f64,
    /// Their bytes, without what transports add.
    #[serde(deserialize_with = "measured")]
    pub bytes_per_s: f64,
}

impl Row {
    /// Sums up the outcomes of a cell.
    ///
    /// # Panics
    /// Without outcomes.
    pub fn of(cell: &Cell, first_seed: u64, outcomes: &[Outcome]) -> Self {
        assert!(!outcomes.is_empty(), "a row has a seed at least");
        let count = outcomes.len() as f64;
        let mean = |value: fn(&Outcome) -> f64| outcomes.iter().map(value).sum::<f64>() / count;
        let worst = |value: fn(&Outcome) -> f64| outcomes.iter().map(value).fold(0.0, f64::max);
        let steps = outcomes
            .iter()
            .flat_map(|outcome| outcome.correction_steps_n.iter().copied())
            .collect();
        let hidden: Option<Vec<f64>> = outcomes
            .iter()
            .map(|outcome| outcome.hidden_force_nrmse)
            .collect();
        let identical: Option<Vec<bool>> = outcomes
            .iter()
            .map(|outcome| outcome.clay_identical)
            .collect();
        Self {
            scheme: cell.scheme.to_string(),
            one_way_delay_s: f64::from(cell.delay_ms) * 1e-3,
            jitter_ratio: cell.jitter_ratio,
            loss: cell.loss,
            profile: cell.profile,
            seeds: outcomes.len(),
            first_seed,
            stable: outcomes.iter().all(|outcome| outcome.stable),
            stable_share: mean(|outcome| f64::from(u8::from(outcome.stable))),
            min_energy_j: outcomes
                .iter()
                .map(|outcome| outcome.min_energy_j)
                .fold(0.0, f64::min),
            force_nrmse: mean(|outcome| outcome.force_nrmse),
            force_nrmse_worst: worst(|outcome| outcome.force_nrmse),
            position_rmse_m: mean(|outcome| outcome.position_rmse_m),
            coordination_rmse_m: mean(|outcome| outcome.coordination_rmse_m),
            removed_volume_error: mean(|outcome| outcome.removed_volume_error),
            removed_volume_error_worst: worst(|outcome| outcome.removed_volume_error),
            share_force_error_above_jnd: mean(|outcome| outcome.share_force_error_above_jnd),
            correction_step_n: Quantiles::of(steps),
            earned_j: worst(|outcome| outcome.earned_j),
            injected_j: worst(|outcome| outcome.injected_j),
            hidden_force_nrmse: hidden
                .map(|hidden| hidden.iter().sum::<f64>() / hidden.len() as f64),
            clay_identical: identical.map(|identical| identical.into_iter().all(|is| is)),
            packets_per_s: mean(|outcome| outcome.packets_per_s),
            bytes_per_s: mean(|outcome| outcome.bytes_per_s),
        }
    }
}

/// What is not a number is `null` in JSON.
fn measured<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

impl Quantiles {
    /// Of these values; zeros without any.
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_unstable_by(f64::total_cmp);
        let Some(&max) = values.last() else {
            return Self::default();
        };
        let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
        Self {
            p50: at(0.5),
            p95: at(0.95),
            p99: at(0.99),
            max,
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "small whole numbers are exact")]
mod tests {
    use super::*;
    use crate::cell::{Extent, cells};

    #[test]
    fn quantiles_are_values_that_occurred() {
        let quantiles = Quantiles::of((1..=101).rev().map(f64::from).collect());
        assert_eq!(
            [quantiles.p50, quantiles.p95, quantiles.p99, quantiles.max],
            [51.0, 96.0, 100.0, 101.0]
        );
        assert_eq!(Quantiles::of(Vec::new()), Quantiles::default());
    }

    #[test]
    fn one_bad_seed_is_not_averaged_away() {
        let cell = cells(Extent::Quick)[0];
        let good = Outcome {
            stable: true,
            clay_identical: Some(true),
            ..Outcome::default()
        };
        let bad = Outcome {
            min_energy_j: -1.0,
            removed_volume_error: 0.5,
            clay_identical: Some(false),
            ..Outcome::default()
        };
        let row = Row::of(&cell, 1, &[good.clone(), bad, good]);
        assert!(!row.stable);
        assert_eq!(row.clay_identical, Some(false));
        assert_eq!(
            (row.min_energy_j, row.removed_volume_error_worst),
            (-1.0, 0.5)
        );
        assert!((row.stable_share - 2.0 / 3.0).abs() < 1e-12);
    }
}
