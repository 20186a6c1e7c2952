//! Bodies about stops and about who wants which tool.

use serde_json::{Value, json};
use teleclay_proto::http::{
    BodyError, ControlRequest, Denial, MAX_NAME, MAX_REASON, Stop, StopRequest, Validate, parse,
};
use teleclay_proto::join::Farewell;

fn read<T>(body: &Value) -> Result<T, String>
where
    T: serde::de::DeserializeOwned + serde::Serialize + Validate,
{
    parse(body.to_string().as_bytes()).map_err(|error| match error {
        BodyError::Field(error) => error.pointer,
        BodyError::Syntax { detail, .. } => panic!("{detail}"),
    })
}

#[test]
fn names_and_reasons_keep_to_their_length_and_have_no_control_characters() {
    let texts = |most: usize| {
        [
            ("ä".repeat(most), true),
            ("a".to_owned(), true),
            ("ä".repeat(most + 1), false),
            (String::new(), false),
            ("a\nb".to_owned(), false),
            ("\u{1b}[2J".to_owned(), false),
        ]
    };
    let refused = |is_good: bool, pointer: &str| (!is_good).then(|| pointer.to_owned());
    for (name, is_good) in texts(MAX_NAME) {
        let body = json!({ "operator": name });
        let wanted = refused(is_good, "/operator");
        assert_eq!(read::<ControlRequest>(&body).err(), wanted);
        let body = json!({ "operator": name, "reason": "no" });
        assert_eq!(read::<Denial>(&body).err(), wanted);
    }
    for (reason, is_good) in texts(MAX_REASON) {
        let body = json!({ "reason": reason });
        let wanted = refused(is_good, "/reason");
        assert_eq!(read::<StopRequest>(&body).err(), wanted);
        let body = json!({ "operator": "Bob", "reason": reason });
        assert_eq!(read::<Denial>(&body).err(), wanted);
    }
}

#[test]
fn a_stop_needs_no_reason_and_whoever_wants_a_tool_has_a_name() {
    let reason = "no reason given";
    assert_eq!(read::<StopRequest>(&json!({})).unwrap().reason, reason);
    let denial = read::<Denial>(&json!({ "operator": "Bob" })).unwrap();
    assert_eq!((&*denial.operator, &*denial.reason), ("Bob", reason));
    assert!(read::<ControlRequest>(&json!({})).is_err());
    assert!(read::<Denial>(&json!({ "reason": "no" })).is_err());
    for unknown in [json!({ "reason": "a", "by": "Eve" }), json!({ "why": "a" })] {
        assert!(read::<StopRequest>(&unknown).is_err());
    }
}

#[test]
fn whatever_the_words_of_a_stop_they_fit_and_good_ones_stay() {
    let long = "ä\u{0}".repeat(500);
    for by in ["", "Eve", "E\tve", &long] {
        for reason in ["", "enough", "e\rnough", &long] {
            let stop = Stop::fitting(by, reason);
            assert_eq!(stop.validate(), Ok(()));
            // With names and words around it a farewell still has room.
            let reason = format!(
                "{}, stopped by {}: {}",
                "x".repeat(40),
                stop.by,
                stop.reason
            );
            assert_eq!(Farewell { lease: 1, reason }.validate(), Ok(()));
        }
    }
    let stop = Stop {
        by: "Eve".to_owned(),
        reason: "a hand in the way".to_owned(),
    };
    assert_eq!(Stop::fitting(&stop.by, &stop.reason), stop);
}
