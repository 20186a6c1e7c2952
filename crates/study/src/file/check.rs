//! Whether a file is a study that can be run.

use std::fmt::Display;

use teleclay_proto::http::{FieldError, SessionPatch, Validate};

use super::Presentation;
use super::raw::{Condition, FitSettings, Procedure, RawStudy};
use crate::procedure::Scale;

/// Nobody sits through more.
const MOST_TRIALS: u32 = 5000;
/// Latin squares beyond this have more orders than any study has people.
const MOST_CONDITIONS: usize = 32;

pub(super) fn check(raw: &RawStudy) -> Result<(), FieldError> {
    check_name("/name", &raw.name)?;
    range("/participants", raw.participants, 1, 10_000)?;
    if raw.question.trim().is_empty() {
        return wrong("/question", "it is empty", "a question");
    }
    let [least, most] = raw.stimulus.bounds;
    if !(least.is_finite() && most.is_finite() && least < most) {
        let got = format!("[{least}, {most}]");
        return wrong("/stimulus/bounds", &got, "two numbers that ascend");
    }
    check_conditions(raw)?;
    check_procedure(raw)?;
    check_fit(&raw.fit)
}

fn check_conditions(raw: &RawStudy) -> Result<(), FieldError> {
    range("/conditions", raw.conditions.len(), 1, MOST_CONDITIONS)?;
    for (number, condition) in raw.conditions.iter().enumerate() {
        let at = format!("/conditions/{number}");
        check_name(&format!("{at}/name"), &condition.name)?;
        let before = &raw.conditions[..number];
        if before.iter().any(|other| other.name == condition.name) {
            let wanted = "a name that no other condition has";
            return wrong(&format!("{at}/name"), &condition.name, wanted);
        }
        check_blind(raw, &at, condition)?;
        let standard = condition.standard();
        valid(&at, standard)?;
        // Both ends, so that no level in between is refused by the server halfway through.
        for bound in raw.stimulus.bounds {
            valid(
                "/stimulus/bounds",
                standard.but(raw.stimulus.quantity, bound),
            )?;
        }
    }
    Ok(())
}

/// What a participant reads must not name what it is blind to.
fn check_blind(raw: &RawStudy, at: &str, condition: &Condition) -> Result<(), FieldError> {
    let question = raw.question.to_lowercase();
    for (field, word) in [
        ("name", condition.name.to_lowercase()),
        ("scheme", condition.scheme.word().to_owned()),
        ("scheme", condition.scheme.word().replace('_', " ")),
    ] {
        if question.contains(&word) {
            let got = format!("it names `{word}`, which is {at}/{field}");
            return wrong("/question", &got, "a question that names no condition");
        }
    }
    Ok(())
}

/// What the server would refuse is refused here.
fn valid(at: &str, shown: Presentation) -> Result<(), FieldError> {
    let patch: SessionPatch = shown.patch([1, 1]);
    let refused = patch.validate().err();
    refused.map_or(Ok(()), |refused| {
        let detail = format!("{}: {}", refused.pointer, refused.detail);
        Err(FieldError::new(at, detail))
    })
}

fn check_procedure(raw: &RawStudy) -> Result<(), FieldError> {
    match &raw.procedure {
        Procedure::ConstantStimuli {
            levels,
            repetitions,
            ..
        } => {
            range("/procedure/levels", levels.len(), 2, 100)?;
            check_levels(raw, levels, *repetitions)
        }
        Procedure::Rating {
            levels,
            repetitions,
            least,
            most,
        } => {
            range("/procedure/levels", levels.len(), 1, 100)?;
            if most <= least {
                return wrong("/procedure/most", most, &format!("more than {least}"));
            }
            check_levels(raw, levels, *repetitions)
        }
        Procedure::Staircase {
            start,
            steps,
            scale,
            down,
            up,
            reversals,
            trials,
            ..
        } => {
            check_level(raw, "/procedure/start", *start)?;
            range("/procedure/down", *down, 1, 10)?;
            range("/procedure/up", *up, 1, 10)?;
            range("/procedure/trials", *trials, 1, MOST_TRIALS)?;
            if let Some(reversals) = reversals {
                range("/procedure/reversals", *reversals, 1, MOST_TRIALS)?;
            }
            range("/procedure/steps", steps.len(), 1, 20)?;
            let least = match scale {
                Scale::Added => 0.0,
                Scale::Factor => 1.0,
            };
            for (number, step) in steps.iter().enumerate() {
                if !(step.is_finite() && least < *step) {
                    let at = format!("/procedure/steps/{number}");
                    return wrong(&at, step, &format!("a number above {least}"));
                }
            }
            if *start <= 0.0 {
                return wrong("/procedure/start", start, "a level above zero");
            }
            Ok(())
        }
    }
}

fn check_levels(raw: &RawStudy, levels: &[f64], repetitions: u32) -> Result<(), FieldError> {
    for (number, level) in levels.iter().enumerate() {
        let at = format!("/procedure/levels/{number}");
        check_level(raw, &at, *level)?;
        if levels[..number]
            .iter()
            .any(|other| other.to_bits() == level.to_bits())
        {
            return wrong(&at, level, "a level that is not there yet");
        }
    }
    range("/procedure/repetitions", repetitions, 1, 1000)?;
    let trials = levels.len() as u32 * repetitions;
    range("/procedure (levels by repetitions)", trials, 1, MOST_TRIALS)
}

/// With a level added, every condition stays within the study's bounds.
fn check_level(raw: &RawStudy, at: &str, level: f64) -> Result<(), FieldError> {
    let [least, most] = raw.stimulus.bounds;
    let quantity = raw.stimulus.quantity;
    for condition in &raw.conditions {
        let value = condition.with(quantity, level).value(quantity);
        if !(least <= value && value <= most) {
            let got = format!("{level} makes `{}` {value}", condition.name);
            let wanted = format!("{} from {least} to {most}", quantity.word());
            return wrong(at, &got, &wanted);
        }
    }
    Ok(())
}

fn check_fit(fit: &FitSettings) -> Result<(), FieldError> {
    range("/fit/lapse", fit.lapse, 0.0, 0.2)?;
    if let Some(most) = fit.lapse_most {
        range("/fit/lapse_most", most, 0.0, 0.2)?;
    }
    if let Some(most) = fit.guess_most {
        range("/fit/guess_most", most, 0.0, 0.5)?;
    }
    range("/fit/confidence", fit.confidence, 0.5, 0.999)
}

fn check_name(at: &str, name: &str) -> Result<(), FieldError> {
    let is_plain = |letter: char| {
        letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '-' || letter == '_'
    };
    if name.is_empty() || 60 < name.len() || !name.chars().all(is_plain) {
        let wanted = "1 to 60 of a to z, 0 to 9, - and _";
        return wrong(at, name, wanted);
    }
    Ok(())
}

fn range<T: PartialOrd + Display>(at: &str, got: T, least: T, most: T) -> Result<(), FieldError> {
    if least <= got && got <= most {
        return Ok(());
    }
    wrong(at, got, &format!("{least} to {most}"))
}

fn wrong<T>(at: &str, got: impl Display, wanted: &str) -> Result<T, FieldError> {
    Err(FieldError::new(at, format!("{got}, wanted {wanted}")))
}
