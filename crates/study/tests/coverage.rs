//! Whether a threshold's interval is what it says: it has the true threshold as often as its confidence, no more and no
//! less, and is about as wide as the estimates scatter.
//!
//! An interval that is right in exactly 95 of 100 cases is right in 93.4 to 96.6 of 100 over 1,000 seeds (two and a half
//! standard deviations to each side); one that is always right is too wide.

use teleclay_study::file::Study;
use teleclay_study::fit::{Fit, fit};
use teleclay_study::normal;
use teleclay_study::observer::Observer;
use teleclay_study::psychometric::{Psychometric, Shape};
use teleclay_study::results::counts;
use teleclay_study::run::Run;

const SEEDS: u64 = 1000;
const TRUE_THRESHOLD_S: f64 = 0.08;

fn study(seed: u64, procedure: &str, fit: &str) -> Study {
    let text = format!(
        r#"{{
  "name": "coverage", "seed": {seed}, "participants": 1, "question": "Which one?",
  "stimulus": {{ "quantity": "delay_s", "bounds": [0.0, 0.3] }},
  "procedure": {procedure},
  "fit": {fit},
  "conditions": [ {{ "name": "only", "scheme": "tdpa" }} ]
}}"#
    );
    Study::from_json(&text).unwrap()
}

/// Fits of as many simulated participants as there are seeds; nothing where the answers gave no threshold.
fn fits(procedure: &str, settings: &str, function: Psychometric) -> Vec<Option<Fit>> {
    let of_seed = |seed| {
        let study = study(seed, procedure, settings);
        let mut run = Run::new(&study, 1).unwrap();
        run.simulate(&mut Observer::new(function, seed));
        let (_, counts) = counts(&run).remove(0);
        fit(&counts, &study.model().unwrap()).ok()
    };
    (0..SEEDS).map(of_seed).collect()
}

struct Found {
    /// Share of seeds whose interval has the true threshold. No fit counts as a miss.
    covered: f64,
    /// Half the median width of the intervals, over the normal quantile of their confidence and the scatter of the
    /// estimates.
    width: f64,
    /// Mean of the estimates less the truth, over their scatter.
    bias: f64,
}

fn look(fits: &[Option<Fit>], confidence: f64) -> Found {
    let made: Vec<&Fit> = fits.iter().flatten().collect();
    let has_truth = |fit: &&&Fit| {
        let [least, most] = fit.interval;
        least.is_none_or(|least| least <= TRUE_THRESHOLD_S)
            && most.is_none_or(|most| TRUE_THRESHOLD_S <= most)
    };
    let mut widths: Vec<f64> = made
        .iter()
        .map(|fit| match fit.interval {
            [Some(least), Some(most)] => most - least,
            _ => f64::INFINITY,
        })
        .collect();
    widths.sort_by(f64::total_cmp);
    // By quartiles, so that a stray seed does not say how all scatter.
    let mut thresholds: Vec<f64> = made.iter().map(|fit| fit.function.threshold()).collect();
    thresholds.sort_by(f64::total_cmp);
    let quartile = |share: usize| thresholds[thresholds.len() * share / 4];
    let scatter = (quartile(3) - quartile(1)) / (2.0 * normal::quantile(0.75));
    let z = normal::quantile(0.5 + 0.5 * confidence);
    Found {
        covered: made.iter().filter(has_truth).count() as f64 / fits.len() as f64,
        width: 0.5 * widths[widths.len() / 2] / (z * scatter),
        bias: (quartile(2) - TRUE_THRESHOLD_S) / scatter,
    }
}

const GAUSSIAN: Psychometric = Psychometric {
    shape: Shape::CumulativeGaussian,
    location: TRUE_THRESHOLD_S,
    spread: 0.03,
    guess: 0.5,
    lapse: 0.02,
};
const STAIRCASE: &str = r#"{ "kind": "staircase", "task": "two_intervals", "start": 0.16,
    "steps": [0.04, 0.02, 0.01], "down": 2, "trials": 80 }"#;

#[test]
fn a_staircase_of_eighty_trials_finds_the_threshold_as_often_as_its_interval_says() {
    for confidence in [0.95, 0.8] {
        let settings = format!(r#"{{ "lapse": 0.02, "confidence": {confidence} }}"#);
        let found = look(&fits(STAIRCASE, &settings, GAUSSIAN), confidence);
        println!("{confidence}: {} {} {}", found.covered, found.width, found.bias);
    }
}
