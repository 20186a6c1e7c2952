//! Thresholds as CSV: a row for each participant and condition; of ratings one for each level, too.

use std::fmt::{self, Write};

use teleclay_study::fit::{Model, fit};
use teleclay_study::results::{Group, Ratings};

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
        "study,participant,condition,level_{quantity},trials,threshold_{quantity},least_{quantity},most_{quantity},confidence,\
         share_at_threshold,spread,guess,lapse,deviance,reversal_mean_{quantity},rating_median,remark"
    );
    for group in groups {
        for row in rows(group, model(group)) {
            let names = [&group.study, &group.participant, &group.condition];
            let names = names.map(|name| quoted(name)).join(",");
            let _ = writeln!(text, "{names},{row}");
        }
    }
    text
}

fn rows(group: &Group, model: Option<Model>) -> Vec<Row> {
    let Some(model) = model else {
        let of_level = |ratings: &Ratings| Row {
            level: Some(ratings.level),
            trials: ratings.given.len() as u32,
            rating_median: median(&ratings.given),
            ..Row::default()
        };
        return group.ratings.iter().map(of_level).collect();
    };
    let row = Row {
        trials: group.counts.iter().map(|counts| counts.trials).sum(),
        reversal_mean: group.reversal_mean(REVERSALS_LEFT_OUT),
        ..Row::default()
    };
    vec![match fit(&group.counts, &model) {
        Ok(fit) => {
            let [least, most] = fit.interval;
            let function = fit.function;
            Row {
                threshold: Some(function.threshold()),
                least,
                most,
                confidence: Some(fit.confidence),
                share_at_threshold: Some(function.share(function.threshold())),
                spread: Some(function.spread),
                guess: Some(function.guess),
                lapse: Some(function.lapse),
                deviance: Some(fit.deviance),
                ..row
            }
        }
        Err(error) => Row {
            remark: error.to_string(),
            ..row
        },
    }]
}

/// What stands behind a group's names.
#[derive(Default)]
struct Row {
    level: Option<f64>,
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

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let figures = [
            self.threshold,
            self.least,
            self.most,
            self.confidence,
            self.share_at_threshold,
            self.spread,
            self.guess,
            self.lapse,
            self.deviance,
            self.reversal_mean,
            self.rating_median,
        ]
        .map(number)
        .join(",");
        let (level, remark) = (number(self.level), quoted(&self.remark));
        write!(f, "{level},{},{figures},{remark}", self.trials)
    }
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

    const TABLE: &str = "\
study,participant,condition,task,level_delay_s,noticed,reversal,rating
a,1,plain,two_intervals,0.1,1,0,
a,1,plain,two_intervals,0.1,1,0,
a,1,rated,rating,0.1,,0,3
a,1,rated,rating,0.1,,0,6
a,1,rated,rating,0.2,,0,7
";

    #[test]
    fn every_row_has_the_columns_of_the_head_and_says_why_there_is_no_threshold() {
        let groups = teleclay_study::results::read(TABLE).unwrap();
        let model = Model {
            shape: teleclay_study::psychometric::Shape::CumulativeGaussian,
            guess: teleclay_study::fit::Rate::Fixed(0.5),
            lapse: teleclay_study::fit::Rate::Fixed(0.02),
            confidence: 0.95,
            correction: 0.0,
        };
        let text = thresholds(&groups, |group| (group.task != "rating").then_some(model));
        let lines: Vec<&str> = text.lines().collect();
        let commas = lines[0].matches(',').count();
        for row in &lines[2..] {
            assert_eq!(row.matches(',').count(), commas, "{row}");
        }
        let plain = "a,1,plain,,2,,,,,,,,,,,,\"1 levels with answers, wanted 2 at least\"";
        assert_eq!(lines[1], plain);
        assert_eq!(lines[2], "a,1,rated,0.1,2,,,,,,,,,,,4.5,");
        assert_eq!(lines[3], "a,1,rated,0.2,1,,,,,,,,,,,7,");
        assert_eq!(lines.len(), 4);
    }

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
