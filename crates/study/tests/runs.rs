//! Runs of whole studies: blind, reproducible, and going on where they were.

use proptest::prelude::*;
use teleclay_study::answer::Answer;
use teleclay_study::file::{Study, Task};
use teleclay_study::log::{self, LogError};
use teleclay_study::observer::Observer;
use teleclay_study::psychometric::{Psychometric, Shape};
use teleclay_study::results::{self, read};
use teleclay_study::run::{Record, Run};

const STUDY: &str = include_str!("../../../study/examples/late-clay.toml");
const RATED: &str = include_str!("../../../study/examples/rated-feel.json");
const CONSTANT: &str = r#"{
  "name": "constant", "seed": 3, "participants": 4, "question": "Was it late?",
  "stimulus": { "quantity": "delay_s", "bounds": [0.0, 0.3] },
  "procedure": { "kind": "constant_stimuli", "task": "yes_no", "levels": [0.01, 0.04, 0.09], "repetitions": 6 },
  "conditions": [ { "name": "only", "scheme": "wave", "line": { "delay_s": 0.1, "jitter_s": 0.01, "loss": 0.05 } } ]
}"#;

fn study() -> Study {
    Study::from_toml(STUDY).unwrap()
}

fn observer(seed: u64) -> Observer {
    Observer::new(
        Psychometric {
            shape: Shape::CumulativeGaussian,
            location: 0.08,
            spread: 0.03,
            guess: 0.5,
            lapse: 0.02,
        },
        seed,
    )
}

/// A whole run, and its file.
fn simulated(study: &Study, participant: u32) -> (Vec<Record>, String) {
    let mut run = Run::new(study, participant).unwrap();
    run.simulate(&mut observer(participant.into()));
    let records = run.records().to_vec();
    let mut file = log::head(study, participant);
    file.extend(records.iter().map(log::answer));
    (records, file)
}

#[test]
fn every_participant_meets_every_condition_in_a_balanced_order_under_codes() {
    let study = study();
    let mut first = Vec::new();
    for participant in 1..=12 {
        let (records, _) = simulated(&study, participant);
        let mut met: Vec<&str> = records.iter().map(|record| &*record.condition).collect();
        met.dedup();
        assert_eq!(met.len(), 3, "{met:?}");
        first.push(met[0].to_owned());
        let codes = records.iter().map(|record| &record.code);
        let mut codes: Vec<_> = codes.collect();
        codes.dedup();
        assert_eq!(codes.len(), 3);
    }
    for condition in study.conditions() {
        let began = first.iter().filter(|name| **name == condition.name).count();
        assert_eq!(began, 4, "{}", condition.name);
    }
}

/// Whatever a participant reads.
#[test]
fn what_is_read_names_no_condition_no_scheme_and_no_level() {
    for study in [study(), Study::from_json(RATED).unwrap()] {
        for participant in 1..=study.participants() {
            let mut run = Run::new(&study, participant).unwrap();
            while let Some(trial) = run.next_trial() {
                let read = format!("{} {}", trial.heading(), study.question()).to_lowercase();
                for condition in study.conditions() {
                    assert!(!read.contains(&condition.name), "{read}");
                    assert!(!read.contains(condition.scheme.word()), "{read}");
                }
                // A level is a fraction; nothing that is read has a decimal point.
                assert!(!trial.heading().contains('.'), "{read}");
                let answer = match trial.task {
                    Task::TwoIntervals => Answer::First,
                    Task::YesNo => Answer::Yes,
                    Task::Rating { least, .. } => Answer::Rating(least),
                };
                run.answer(answer, 1.0).unwrap();
            }
        }
    }
}

#[test]
fn an_interval_is_the_condition_and_the_other_one_has_the_level() {
    let study = study();
    let mut run = Run::new(&study, 1).unwrap();
    let mut firsts = 0;
    let mut trials = 0;
    while let Some(trial) = run.next_trial() {
        assert_eq!(run.next_trial().as_ref(), Some(&trial), "asked twice");
        let condition = &study.conditions()[trial.condition()];
        let delays: Vec<f64> = trial.shown.iter().map(|shown| shown.line.delay_s).collect();
        let comparison = usize::from(delays[0] < delays[1]);
        if 0.0 < trial.level() {
            firsts += usize::from(comparison == 0);
            trials += 1;
            let off = delays[comparison] - condition.line.delay_s - trial.level();
            assert!(off.abs() < 1e-12);
        }
        assert!((delays[1 - comparison] - condition.line.delay_s).abs() < 1e-12);
        for shown in &trial.shown {
            assert!(shown.line.delay_s <= 0.3, "beyond the study's bounds");
            let patch = serde_json::to_value(shown.patch(trial.line_seeds)).unwrap();
            let fields: Vec<&String> = patch.as_object().unwrap().keys().collect();
            assert_eq!(fields, ["material", "network", "scheme"]);
        }
        // Always wrong: the level climbs to its bound and stays there.
        let wrong = [Answer::Second, Answer::First][comparison];
        run.answer(wrong, 0.5).unwrap();
    }
    assert!(
        (100..=200).contains(&firsts) && trials == 300,
        "{firsts} of {trials}"
    );
}

proptest! {
    /// Killed at any byte, the run goes on where it was, and ends as it would have.
    #[test]
    fn a_run_that_was_killed_ends_as_if_it_had_not_been(share in 0.0..1.0_f64, participant in 1_u32..12) {
        let study = study();
        let (records, whole) = simulated(&study, participant);
        let cut = (share * whole.len() as f64) as usize;
        let left = &whole[..cut];
        let Some(log) = log::read(left).unwrap() else {
            prop_assert!(!left.contains('\n'));
            return Ok(());
        };
        prop_assert!(log.whole_bytes <= cut && cut - log.whole_bytes < 400);
        prop_assert_eq!(&records[..log.records.len()], &log.records[..]);
        let mut run = log.run(&study, participant).unwrap();
        for record in &records[log.records.len()..] {
            let made = run.answer(record.answer, record.response_s).unwrap();
            prop_assert_eq!(made, record);
        }
        prop_assert!(run.next_trial().is_none());
    }
}

#[test]
fn answers_to_another_study_or_of_another_person_are_refused() {
    let study = study();
    let (_, file) = simulated(&study, 3);
    let log = log::read(&file).unwrap().unwrap();
    let changed = Study::from_toml(&STUDY.replace("0.16", "0.17")).unwrap();
    assert!(matches!(
        log.run(&changed, 3).map(|_| ()),
        Err(LogError::OtherStudy { .. })
    ));
    assert_eq!(
        log.run(&study, 4).map(|_| ()),
        Err(LogError::OtherParticipant { got: 3, wanted: 4 })
    );
    // Somebody has edited a level.
    let edited = file.replacen("\"level\":0.16", "\"level\":0.15", 1);
    let log = log::read(&edited).unwrap().unwrap();
    assert!(matches!(
        log.run(&study, 3).map(|_| ()),
        Err(LogError::Replay(_))
    ));
    // And one has torn a line in the middle of the file.
    let torn = file.replacen("{\"trial\":2", "{\"tri", 1);
    let told = log::read(&torn).unwrap_err().to_string();
    assert!(told.starts_with("line 3: "), "{told}");
    let gone_on = file.clone() + &log::withdrawn() + "{\"trial\":2}\n";
    assert!(log::read(&gone_on).is_err());
    let ended = log::read(&(file + &log::withdrawn())).unwrap().unwrap();
    assert!(ended.is_withdrawn);
}

#[test]
fn results_have_a_row_a_trial_and_come_back_as_counts() {
    let study = Study::from_json(CONSTANT).unwrap();
    let mut run = Run::new(&study, 2).unwrap();
    run.simulate(&mut observer(1));
    let table = results::head(&study) + &results::rows(&run);
    assert_eq!(table.lines().count(), 1 + 18);
    let head: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    assert!(head.contains(&"level_delay_s") && head.contains(&"response_s"));
    for row in table.lines().skip(1) {
        let row: Vec<&str> = row.split(',').collect();
        assert_eq!(row.len(), head.len());
        let of = |name: &str| row[head.iter().position(|other| *other == name).unwrap()];
        assert_eq!(
            (of("condition"), of("scheme"), of("delay_s")),
            ("only", "wave", "0.1")
        );
        assert_eq!(of("noticed") == "1", of("answer") == "yes");
    }
    let groups = read(&table).unwrap();
    assert_eq!(groups.len(), 1);
    let noticed: u32 = groups[0].counts.iter().map(|counts| counts.noticed).sum();
    let said = run
        .records()
        .iter()
        .filter(|record| record.noticed == Some(true));
    assert_eq!(noticed as usize, said.count());
    assert!(groups[0].counts.iter().all(|counts| counts.trials == 6));
}

#[test]
fn ratings_are_on_their_scale_and_kept_as_they_were_given() {
    let study = Study::from_json(RATED).unwrap();
    let mut run = Run::new(&study, 1).unwrap();
    assert!(run.answer(Answer::Rating(8), 0.0).is_err());
    assert!(run.answer(Answer::Yes, 0.0).is_err());
    assert!(study.task().read("0").is_err());
    assert_eq!(study.task().read(" 7 "), Ok(Answer::Rating(7)));
    run.simulate(&mut observer(1));
    assert_eq!(run.records().len(), 2 * 9);
    let groups = read(&(results::head(&study) + &results::rows(&run))).unwrap();
    for group in &groups {
        assert!(
            group.counts.is_empty() && group.ratings.len() == 3,
            "{group:?}"
        );
        for ratings in &group.ratings {
            assert_eq!(ratings.given.len(), 3);
            let given = run.records().iter().filter_map(|record| {
                let is_here = record.condition == group.condition
                    && record.level.to_bits() == ratings.level.to_bits();
                match record.answer {
                    Answer::Rating(rating) if is_here => Some(rating),
                    _ => None,
                }
            });
            assert_eq!(given.collect::<Vec<_>>(), ratings.given);
        }
    }
}

#[test]
fn a_participant_whom_the_study_does_not_have_is_refused() {
    let study = study();
    for participant in [0, 13] {
        let refused = Run::new(&study, participant).map(|_| ()).unwrap_err();
        assert_eq!(
            refused.to_string(),
            format!("participant {participant}, wanted 1 to 12")
        );
    }
}
