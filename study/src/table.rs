//! Thresholds as CSV: a row for each participant and condition.

use std::fmt::Write;

use teleclay_study::fit::{Model, fit};
use teleclay_study::results::Group;

/// The first reversals of a staircase are still on the way to where it settles.
const REVERSALS_LEFT_OUT: usize = 4;

/// The fits of every group. Where there is none, `remark` says why.
pub fn thresholds(groups: &[Group], model: impl Fn(&Group) -> Option<Model>) -> String {
    let mut text = String::new();
    let Some(quantity) = groups.first().map(|group| &group.quantity) else {
        return text;
    };
    // Writing into a string does not fail.
    let _ = writeln!(
        text,
        "study,participant,condition,trials,threshold_{quantity},least_{quantity},most_{quantity},confidence,\
         share_at_threshold,spread,guess,lapse,deviance,reversal_mean_{quantity},rating_median,remark"
    );
    for group in groups {
        let _ = writeln!(text, "{}", row(group, model(group)));
    }
    text
}

fn row(group: &Group, model: Option<Model>) -> String {
    let mut row = Row {
        trials: group.counts.iter().map(|counts| counts.trials).sum(),
        reversal_mean: group.reversal_mean(REVERSALS_LEFT_OUT),
        ..Row::default()
    };
    match model.map(|model| fit(&group.counts, &model)) {
        Some(Ok(fit)) => {
            let function = fit.function;
            row.threshold = Some(function.threshold());
            [row.least, row.most] = fit.interval;
            row.confidence = Some(fit.confidence);
            row.share_at_threshold = Some(function.share(function.threshold()));
            row.spread = Some(function.spread);
            row.guess = Some(function.guess);
            row.lapse = Some(function.lapse);
            row.deviance = Some(fit.deviance);
        }
        Some(Err(error)) => row.remark = error.to_string(),
        None => {
            row.trials = group.ratings.len() as u32;
            row.rating_median = median(&group.ratings);
        }
    }
    let names = [&group.study, &group.participant, &group.condition].map(|name| quoted(name));
    let figures = [
        row.threshold,
        row.least,
        row.most,
        row.confidence,
        row.share_at_threshold,
        row.spread,
        row.guess,
        row.lapse,
        row.deviance,
        row.reversal_mean,
        row.rating_median,
    ]
    .map(number);
    format!(
        "{},{},{},{}",
        names.join(","),
        row.trials,
        figures.join(","),
        quoted(&row.remark)
    )
}

/// What stands behind a group's names.
#[derive(Default)]
struct Row {
    trials: u32,
    threshold: Option<f64>,
    least: Option<f64>,
    most: Option<f64>,
    confidence: Option<f64>,
    share_at_threshold: Option<f64>,
    spread: Option<f64>,
    guess: Option<f64>,
    lapse: Option<f64>,
    deviance: Option<f64>,
    reversal_mean: Option<f64>,
    rating_median: Option<f64>,
    remark: String,
}

/// The middle of the ratings: their scale has an order and no distances, so no mean.
fn median(ratings: &[u8]) -> Option<f64> {
    let mut ratings = ratings.to_vec();
    ratings.sort_unstable();
    let middle = ratings.len().checked_sub(1)? / 2;
    let other = ratings.len() / 2;
    Some(f64::midpoint(ratings[middle].into(), ratings[other].into()))
}

/// To five digits; nothing where there is none.
fn number(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| {
        let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
        rounded.to_string()
    })
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratings_have_a_median_and_numbers_five_digits() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[7, 1, 2]), Some(2.0));
        assert_eq!(median(&[7, 1, 2, 3]), Some(2.5));
        assert_eq!(number(Some(0.123_456_789)), "0.12346");
        assert_eq!(number(Some(2e5)), "200000");
        assert_eq!(number(None), "");
        assert_eq!(quoted("a, \"b\""), "\"a, \"\"b\"\"\"");
    }
}
