//! Study files: what is read, and what is said of those that are none.

use teleclay_study::file::{Quantity, Study, Task};

const STUDY: &str = include_str!("../../../study/examples/late-clay.toml");
const RATED: &str = include_str!("../../../study/examples/rated-feel.json");

/// What is said of the study with one thing changed.
fn told(from: &str, to: &str) -> String {
    assert!(STUDY.contains(from), "{from}");
    Study::from_toml(&STUDY.replacen(from, to, 1))
        .unwrap_err()
        .to_string()
}

#[test]
fn the_examples_are_studies() {
    let study = Study::from_toml(STUDY).unwrap();
    assert_eq!((study.name(), study.participants()), ("late-clay", 12));
    assert_eq!(study.stimulus().quantity, Quantity::DelayS);
    assert_eq!(
        (study.task(), study.conditions().len()),
        (Task::TwoIntervals, 3)
    );
    assert_eq!(study.round(), 6);
    let rated = Study::from_json(RATED).unwrap();
    assert_eq!(rated.task(), Task::Rating { least: 1, most: 7 });
    assert!(rated.model().is_none() && study.model().is_some());
}

#[test]
fn what_is_wrong_is_told_with_its_place_and_what_was_wanted() {
    for (from, to, wanted) in [
        (
            "name = \"late-clay\"",
            "name = \"Late clay\"",
            "/name: Late clay, wanted 1 to 60 of",
        ),
        (
            "participants = 12",
            "participants = 0",
            "/participants: 0, wanted 1 to 10000",
        ),
        (
            "bounds = [0.0, 0.3]",
            "bounds = [0.3, 0.0]",
            "/stimulus/bounds: [0.3, 0], wanted two numbers",
        ),
        (
            "start = 0.16",
            "start = 0.4",
            "/procedure/start: 0.4 makes `plain` 0.4, wanted delay_s from 0 to 0.3",
        ),
        (
            "start = 0.16",
            "start = nan",
            "/procedure/start: NaN makes `plain` NaN",
        ),
        (
            "[0.04, 0.03]",
            "[0.04, -0.02]",
            "/procedure/steps/1: -0.02, wanted a number above 0",
        ),
        ("[0.04, 0.03]", "[]", "/procedure/steps: 0, wanted 1 to 20"),
        ("down = 2", "down = 0", "/procedure/down: 0, wanted 1 to 10"),
        (
            "lapse = 0.02",
            "lapse = 0.5",
            "/fit/lapse: 0.5, wanted 0 to 0.2",
        ),
        (
            "name = \"waves\"",
            "name = \"plain\"",
            "/conditions/1/name: plain, wanted a name that no other",
        ),
        (
            "confidence = 0.95",
            "confidence = 95",
            "/fit/confidence: 95, wanted 0.5 to 0.999",
        ),
    ] {
        let told = told(from, to);
        assert!(told.contains(wanted), "{told}");
    }
}

/// TOML that is not a study's is told by line.
#[test]
fn fields_that_there_are_not_are_told_by_line() {
    for (from, to, wanted) in [
        ("down = 2", "downs = 2", "downs"),
        ("scheme = \"wave\"", "scheme = \"waves\"", "force_exchange"),
        ("quantity = \"delay_s\"", "quantity = \"delay\"", "delay_s"),
        ("seed = 20261130", "seed = \"x\"", "line 3"),
        ("participants = 12", "", "participants"),
    ] {
        let told = told(from, to);
        assert!(told.contains(wanted), "{told}");
    }
}

/// Nothing in a study is a bound on what the hand meets, and values beyond the server's ranges are refused before
/// anybody sits down.
#[test]
fn a_study_widens_no_bound() {
    for word in [
        "force_limit_n = 40",
        "slew_limit_n_per_s = 1e6",
        "silence_s = 10",
        "speed_limit_m_s = 9",
        "deadband = 0.5",
        "paused = false",
    ] {
        for place in ["[stimulus]", "[procedure]", "[fit]", "[[conditions]]"] {
            let told = told(place, &format!("{place}\n{word}"));
            let name = word.split(' ').next().unwrap();
            assert!(told.contains(name), "{place}: {told}");
        }
        let told = told("participants = 12", &format!("participants = 12\n{word}"));
        assert!(told.contains("unknown field"), "{told}");
    }
    let told_of = told("bounds = [0.0, 0.3]", "bounds = [0.0, 3.0]");
    assert!(
        told_of.contains("delay_s") && told_of.contains("to 2"),
        "{told_of}"
    );
    let told_of = told("line = { delay_s = 0.0 }", "line = { loss = 1.5 }");
    assert!(
        told_of.starts_with("/conditions/0") && told_of.contains("loss"),
        "{told_of}"
    );
}

#[test]
fn a_question_that_names_a_condition_is_refused() {
    for question in [
        "Was it waves?",
        "Was that position force?",
        "position_force or not?",
    ] {
        let told = told("In which of the two did the clay answer late?", question);
        assert!(told.starts_with("/question: it names"), "{told}");
    }
}

#[test]
fn a_digest_is_of_what_matters() {
    let study = Study::from_toml(STUDY).unwrap();
    let relaid = STUDY.replace("down = 2\nup = 1\n", "up = 1\n# first up\ndown = 2\n");
    assert_eq!(study.digest(), Study::from_toml(&relaid).unwrap().digest());
    let as_json = serde_json::to_string(&study).unwrap();
    assert_eq!(study.digest(), Study::from_json(&as_json).unwrap().digest());
    let changed = STUDY.replace("0.16", "0.17");
    assert_ne!(study.digest(), Study::from_toml(&changed).unwrap().digest());
}
