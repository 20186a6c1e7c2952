//! Every field of every body, given what it should not be.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use crate::calls::{Call, Verdict, calls};
use crate::rig::{shared, small};
use crate::wire::{Answer, Ask};

/// Pointers of a value and of everything in it.
fn pointers(value: &Value) -> Vec<String> {
    let below = |key: &str, value: &Value| -> Vec<String> {
        let inner = pointers(value).into_iter();
        inner.map(|rest| format!("/{key}{rest}")).collect()
    };
    let mut all = vec![String::new()];
    match value {
        Value::Object(fields) => all.extend(fields.iter().flat_map(|(k, v)| below(k, v))),
        Value::Array(items) => {
            let items = items.iter().enumerate();
            all.extend(items.flat_map(|(at, item)| below(&at.to_string(), item)));
        }
        _ => {}
    }
    all
}

/// Fields that must fit each other: the second is named when the first is changed.
const PARTNERS: [(&str, &str); 2] = [
    ("/edges_m", "/clay_damping_n_s_per_m"),
    ("/clay/shape/depths_of_cut_m", "/clay/voxel_size_m"),
];

/// Whether a refusal of a field names it, or something in it, or what it stands in.
fn names_the_field(named: &str, pointer: &str) -> bool {
    named.starts_with(pointer) || pointer.starts_with(named) || PARTNERS.contains(&(pointer, named))
}

/// What is wrong with the answer to a body that has another value at `pointer`.
fn mistake(call: &Call, pointer: &str, value: &Value, answer: &Answer) -> Option<&'static str> {
    let verdict = call.verdict(pointer, value);
    if answer.status < 300 {
        return (verdict == Verdict::Bad).then_some("it is accepted");
    }
    if verdict == Verdict::Good {
        return Some("it is refused");
    }
    let problem = answer.problem();
    let word = answer.word();
    let may_be_refused = verdict == Verdict::InRange && call.refusals.contains(&&*word);
    match &problem.pointer {
        _ if answer.status != 422 => Some("it is refused in another way"),
        Some(named) if !names_the_field(named, pointer) => Some("another field is named"),
        None if !may_be_refused => Some("no field is named"),
        _ => None,
    }
}

#[test]
fn the_full_bodies_are_good() {
    let site = shared().site();
    let session = shared().session(&site);
    for call in calls(&session) {
        let answer = call.send(&site, call.full.to_string());
        assert!(
            answer.status < 300,
            "{} {}: {answer:?}",
            call.method,
            call.path
        );
    }
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn no_field_takes_a_value_of_another_kind_and_the_pointer_says_which() {
    let site = shared().site();
    let session = shared().session(&site);
    let deep = (0..100).fold(json!(1), |inner, _| json!([inner]));
    let bad = [
        json!(null),
        json!("Not A Word"),
        json!([]),
        json!([1, 2]),
        json!({}),
        json!({ "surplus": 1 }),
        json!(true),
        json!(-1),
        json!(-1e300),
        json!(1e300),
        json!(0.5e-300),
        json!(u64::MAX),
        deep,
    ];
    let mut wrong = Vec::new();
    let mut asked = 0;
    for call in calls(&session) {
        for pointer in pointers(&call.full) {
            for value in &bad {
                let answer = call.send(&site, call.with(&pointer, value.clone()).to_string());
                asked += 1;
                if let Some(mistake) = mistake(&call, &pointer, value, &answer) {
                    let (method, path) = (call.method, &call.path);
                    let shown = String::from_utf8_lossy(&answer.body);
                    let shown: String = shown.chars().take(300).collect();
                    wrong.push(format!(
                        "{method} {path} with {value} at {pointer:?}: {mistake}: {} {shown}",
                        answer.status
                    ));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    println!("{asked} bodies asked");
    site.delete(&format!("/api/v1/sessions/{session}"));
}

/// JSON has these numbers and `f64` has not.
#[test]
fn numbers_beyond_any_range_and_words_for_them_are_refused() {
    let site = shared().site();
    let session = shared().session(&site);
    let mut asked = 0;
    for call in calls(&session) {
        for pointer in pointers(&call.full) {
            for number in [
                "1e999", "-1e999", "NaN", "Infinity", "0x10", "1_000", "01", ".5", "--1",
            ] {
                let marked = call.with(&pointer, json!("HERE")).to_string();
                let answer = call.send(&site, marked.replace("\"HERE\"", number));
                asked += 1;
                let context = format!("{} {} with {number} at {pointer:?}", call.method, call.path);
                assert!((400..500).contains(&answer.status), "{context}: {answer:?}");
                let problem = answer.problem();
                let says_where = problem.pointer.is_some() || problem.detail.contains("column");
                assert!(says_where, "{context}: {problem:?}");
            }
        }
    }
    println!("{asked} bodies asked");
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn unknown_missing_and_doubled_fields_are_seen_at_every_level() {
    let site = shared().site();
    let session = shared().session(&site);
    let mut asked = 0;
    for call in calls(&session) {
        for pointer in pointers(&call.full) {
            let Some(object) = call.full.pointer(&pointer).and_then(Value::as_object) else {
                continue;
            };
            let context = format!("{} {} at {pointer:?}", call.method, call.path);
            let mut more = object.clone();
            more.insert("surplus".to_owned(), json!(1));
            let answer = call.send(&site, call.with(&pointer, Value::Object(more)).to_string());
            asked += 1;
            assert_eq!(answer.status, 422, "{context}: {answer:?}");
            let problem = answer.problem();
            assert!(problem.pointer.unwrap().starts_with(&pointer), "{context}");
            assert!(
                problem.detail.contains("surplus"),
                "{context}: {}",
                problem.detail
            );

            for (key, value) in object {
                // Twice the same field, which no document type can hold.
                let marked = call.with(&pointer, json!("HERE")).to_string();
                let object = Value::Object(object.clone()).to_string();
                let doubled = object.replacen('{', &format!("{{\"{key}\":{value},"), 1);
                let answer = call.send(&site, marked.replace("\"HERE\"", &doubled));
                asked += 1;
                assert_eq!(answer.status, 422, "{context}, {key} doubled: {answer:?}");
                answer.problem();

                let mut less = call.full.clone();
                let inner = less.pointer_mut(&pointer).unwrap().as_object_mut().unwrap();
                inner.remove(key);
                let answer = call.send(&site, less.to_string());
                asked += 1;
                if 300 <= answer.status {
                    assert_eq!(answer.status, 422, "{context}, {key} missing: {answer:?}");
                    answer.problem();
                }
            }
        }
        // What has no default must be there.
        if call.method == "POST" && call.route == "/api/v1/sessions" {
            let answer = call.send(&site, "{}");
            asked += 1;
            assert!(answer.problem().detail.contains("id"), "{answer:?}");
        }
    }
    println!("{asked} bodies asked");
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn what_is_not_json_is_answered_with_its_line_and_column() {
    let site = shared().site();
    let session = shared().session(&site);
    let mut asked = 0;
    for call in calls(&session) {
        let good = call.full.to_string();
        let mut bad: Vec<Vec<u8>> = vec![
            b"".to_vec(),
            b" ".to_vec(),
            b"{".to_vec(),
            b"{}}".to_vec(),
            b"{}{}".to_vec(),
            b"{'id': 1}".to_vec(),
            b"{\"a\": 1,}".to_vec(),
            b"// no comments\n{}".to_vec(),
            b"\xef\xbb\xbf{}".to_vec(),
            b"\xff\xfe{\x00}\x00".to_vec(),
            b"{\"id\": \"\xff\"}".to_vec(),
            b"{\"id\": \"\xed\xa0\x80\"}".to_vec(),
            b"{\"id\": \"\\ud800\"}".to_vec(),
            b"{\"id\": \"\x00\"}".to_vec(),
            b"\0\0\0\0".to_vec(),
            vec![b'['; 60_000],
            b"{\"a\":".repeat(10_000),
        ];
        bad.extend(
            (1..good.len())
                .step_by(7)
                .map(|end| good.as_bytes()[..end].to_vec()),
        );
        for body in bad {
            let shown = String::from_utf8_lossy(&body[..body.len().min(40)]).into_owned();
            let answer = call.send(&site, body);
            asked += 1;
            assert_eq!(answer.status, 400, "{} {shown}: {answer:?}", call.path);
            assert_eq!(answer.word(), "syntax");
            assert!(
                answer.problem().detail.starts_with("line "),
                "{shown}: {answer:?}"
            );
        }
        for body in ["null", "true", "3", "\"text\"", "[]", "[{}]", "[1,2,3]"] {
            let answer = call.send(&site, body);
            asked += 1;
            assert_eq!(answer.status, 422, "{} {body}: {answer:?}", call.path);
            assert_eq!(answer.problem().pointer.unwrap(), "", "{body}");
        }
    }
    println!("{asked} bodies asked");
    site.delete(&format!("/api/v1/sessions/{session}"));
}

/// A thousand bodies with bytes changed at random: every one is answered, and none brings out a mistake of the
/// server's.
#[test]
fn changed_bytes_never_make_the_server_fail() {
    let site = shared().site();
    let session = shared().session(&site);
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = move |below: usize| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % below as u64) as usize
    };
    let mut statuses = BTreeSet::new();
    let mut asked = 0;
    for call in calls(&session) {
        let good = call.full.to_string().into_bytes();
        for _ in 0..200 {
            let mut body = good.clone();
            for _ in 0..=random(3) {
                let at = random(body.len());
                match random(4) {
                    0 => body[at] = random(256) as u8,
                    1 => drop(body.remove(at)),
                    2 => body.insert(at, b"{}[],:\"0123456789eE+-. tfn\\"[random(27)]),
                    _ => body.swap(at, (at + 1).min(good.len() - 3)),
                }
            }
            let answer = call.send(&site, body.clone());
            asked += 1;
            statuses.insert(answer.status);
            let shown = String::from_utf8_lossy(&body).into_owned();
            assert!(answer.status < 500, "{shown}: {answer:?}");
            if 300 <= answer.status {
                answer.problem();
            }
        }
    }
    assert!(
        statuses.is_superset(&BTreeSet::from([400, 422])),
        "{statuses:?}"
    );
    println!("{asked} bodies asked");
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn a_body_of_another_media_type_is_refused_unread() {
    let site = shared().site();
    let session = shared().session(&site);
    let good = |call: &Call| call.full.to_string();
    let mut asked = 0;
    for call in calls(&session) {
        for media_type in [
            "",
            "text/plain",
            "application/x-www-form-urlencoded",
            "multipart/form-data; boundary=x",
            "application/jsonp",
            "application/json-patch+json",
            "text/json",
            ";",
        ] {
            let ask = Ask::new(call.method, &call.path).body(good(&call));
            let answer = site.send(&ask.with("Content-Type", media_type));
            asked += 1;
            assert_eq!(answer.status, 415, "{media_type}: {answer:?}");
            assert_eq!(answer.word(), "media-type");
        }
        let packed = Ask::new(call.method, &call.path).json(good(&call));
        let answer = site.send(&packed.with("Content-Encoding", "gzip"));
        asked += 1;
        assert_eq!((answer.status, &*answer.word()), (415, "media-type"));
        for media_type in ["application/json;charset=utf-8", "Application/JSON ; x=y"] {
            let ask = Ask::new(call.method, &call.path).body("{");
            let answer = site.send(&ask.with("Content-Type", media_type));
            asked += 1;
            assert_eq!(answer.word(), "syntax", "it is read: {media_type}");
        }
    }
    println!("{asked} bodies asked");
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn a_change_is_made_whole_or_not_at_all() {
    let site = shared().site();
    let session = shared().session(&site);
    let path = format!("/api/v1/sessions/{session}");
    let before: Value = site.get(&path).json();
    let answer = site.patch(
        &path,
        &json!({ "paused": true, "material": { "stiffness_pa": 5 }, "network": { "down": { "loss": 2 } } }),
    );
    assert_eq!(answer.problem().pointer.unwrap(), "/network/down/loss");
    let after: Value = site.get(&path).json();
    for field in ["state", "material", "network", "scheme"] {
        assert_eq!(before[field], after[field]);
    }
    site.delete(&path);
}

#[test]
fn a_taken_name_is_a_conflict_and_a_bad_one_a_field() {
    let site = shared().site();
    let session = shared().session(&site);
    let answer = site.post("/api/v1/sessions", &small(&session));
    assert_eq!((answer.status, &*answer.word()), (409, "session-exists"));
    let long = "x".repeat(65);
    for name in ["", "Upper", "a b", "a/b", "../etc", "ü", "a\u{0}b", &long] {
        let answer = site.post("/api/v1/sessions", &small(name));
        assert_eq!(answer.problem().pointer.unwrap(), "/id", "{name:?}");
    }
    site.delete(&format!("/api/v1/sessions/{session}"));
}
