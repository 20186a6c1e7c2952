//! How bodies are read: what counts as a word and as a whole number, where ranges end, and what is said of a mistake.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use teleclay_proto::Scheme;
use teleclay_proto::frame::CopyState;
use teleclay_proto::http::theory::{
    CuttingRequest, JacobianRequest, TuningRequest, WorkspaceRequest,
};
use teleclay_proto::http::{
    Axes, BodyError, ClayReset, FieldError, Impairment, JitterDistribution, Network, NewSession,
    Outage, SessionPatch, Validate, parse,
};
use teleclay_proto::join::{JoinReply, JoinRequest, LoopParameters, RefusalCode};
use teleclay_proto::watch::{ClientText, Level, Switch};

fn read<T>(body: &Value) -> Result<T, FieldError>
where
    T: DeserializeOwned + Serialize + Validate,
{
    parse(body.to_string().as_bytes()).map_err(|error| match error {
        BodyError::Field(error) => error,
        BodyError::Syntax { .. } => panic!("{body}: {error}"),
    })
}

fn refused<T>(body: &Value) -> FieldError
where
    T: DeserializeOwned + Serialize + Validate + std::fmt::Debug,
{
    match read::<T>(body) {
        Ok(value) => panic!("{body} is read as {value:?}"),
        Err(error) => error,
    }
}

/// What a word must not be read from, given the word.
fn disguises(word: &str) -> [Value; 7] {
    [
        json!({ word: null }),
        json!({ word: {} }),
        json!({ word: [] }),
        json!([word]),
        json!(0),
        json!(true),
        json!(format!("{word} ")),
    ]
}

#[test]
fn a_word_is_a_text_in_every_body() {
    for disguise in disguises("wave") {
        let body = json!({ "id": "a", "scheme": disguise });
        assert_eq!(refused::<NewSession>(&body).pointer, "/scheme", "{body}");
        let body = json!({ "scheme": disguise });
        assert_eq!(refused::<SessionPatch>(&body).pointer, "/scheme", "{body}");
        let body = json!({ "type": "patch", "session": { "scheme": disguise } });
        assert_eq!(refused::<ClientText>(&body).pointer, "/session/scheme");
    }
    for disguise in disguises("heavy_tailed") {
        let body = json!({ "network": { "up": { "jitter_distribution": disguise } } });
        let pointer = refused::<SessionPatch>(&body).pointer;
        assert_eq!(pointer, "/network/up/jitter_distribution", "{body}");
    }
    for disguise in disguises("block") {
        let body = json!({ "shape": { "kind": disguise } });
        assert_eq!(refused::<ClayReset>(&body).pointer, "/shape/kind", "{body}");
    }
    for disguise in disguises("ball") {
        let body = json!({ "id": "a", "tool": { "kind": disguise, "radius_m": 0.01 } });
        assert_eq!(refused::<NewSession>(&body).pointer, "/tool/kind", "{body}");
    }
    for disguise in disguises("on") {
        let body = json!({ "type": "subscribe", "telemetry": disguise, "bricks": "on" });
        assert_eq!(refused::<ClientText>(&body).pointer, "/telemetry", "{body}");
    }
    for disguise in disguises("ping") {
        let body = json!({ "type": disguise, "nonce": 1 });
        assert_eq!(refused::<ClientText>(&body).pointer, "/type", "{body}");
    }
    for disguise in disguises("muscles") {
        let mut body = cutting();
        body["hand_force_at"] = disguise;
        assert_eq!(refused::<CuttingRequest>(&body).pointer, "/hand_force_at");
    }
    for disguise in disguises("position_force") {
        let mut body = tuning();
        body["scheme"] = disguise;
        assert_eq!(refused::<TuningRequest>(&body).pointer, "/scheme", "{body}");
    }
}

/// Inside of an answer that is told apart by its `outcome`, where serde reads a copy of the text.
#[test]
fn a_word_is_a_text_in_the_answer_to_a_join() {
    let parameters = serde_json::to_value(LoopParameters::default()).expect("it prints");
    let granted = |scheme: Value, kind: Value, tool: Value| {
        let mut parameters = parameters.clone();
        parameters["scheme"] = scheme;
        parameters["tool"] = json!({ "kind": tool, "radius_m": 0.01 });
        json!({
            "outcome": "granted", "lease": 1, "ownership_epoch": 1, "node": "n", "tool": 1, "lease_s": 2, "parameters": parameters, "slow_endpoint": null,
            "clay": { "shape": { "kind": kind }, "voxel_size_m": 1e-3, "epoch": 0, "revision": 0 },
        })
    };
    let good = [json!("wave"), json!("block"), json!("ball")];
    let [scheme, kind, tool] = good.clone();
    read::<JoinReply>(&granted(scheme, kind, tool)).expect("the words are words");
    for at in 0..3 {
        for disguise in disguises(good[at].as_str().expect("it is a word")) {
            let mut words = good.clone();
            words[at] = disguise;
            let [scheme, kind, tool] = words;
            refused::<JoinReply>(&granted(scheme, kind, tool));
        }
    }
    for disguise in disguises("fault") {
        refused::<JoinReply>(&json!({ "outcome": "refused", "code": disguise, "reason": "r" }));
    }
}

/// Whoever reads a value without [`parse`] reads words alike.
#[test]
fn a_word_is_a_text_to_serde_itself() {
    fn check<T: DeserializeOwned + Serialize + PartialEq + std::fmt::Debug>(value: &T) {
        let word = serde_json::to_value(value).expect("it prints");
        let back: T = serde_json::from_value(word.clone()).expect("it is its word");
        assert_eq!(back, *value);
        for disguise in disguises(word.as_str().expect("it is a word")) {
            let read = serde_json::from_value::<T>(disguise.clone());
            assert!(read.is_err(), "{disguise} is read as {read:?}");
        }
    }
    for scheme in Scheme::ALL {
        check(scheme);
    }
    for state in CopyState::ALL {
        check(state);
    }
    check(&JitterDistribution::HeavyTailed);
    check(&RefusalCode::NoSuchSession);
    check(&Level::Warning);
    check(&Switch::On);
}

/// JSON Schema 2020-12: a number without a fraction is an integer, however it is written.
#[test]
fn a_whole_number_may_be_written_in_any_way() {
    for (two, minus_one) in [
        ("2", "-1"),
        ("2.0", "-1.0"),
        ("2e0", "-1E0"),
        ("0.2e1", "-10e-1"),
        ("20.00e-1", "-0.1e1"),
    ] {
        let body = format!(
            r#"{{"id":"a","axes":{two},"tools":{two},"network":{{"up":{{"seed":{two}}}}}}}"#
        );
        let session: NewSession = parse(body.as_bytes()).expect(two);
        assert_eq!(
            (session.axes, session.tools, session.network.up.seed),
            (Axes::Two, 2, 2)
        );
        let body = format!(r#"{{"type":"ping","nonce":{two}}}"#);
        assert_eq!(
            ClientText::parse(&body).expect(two),
            ClientText::Ping { nonce: 2 }
        );
        let body = format!(r#"{{"cells":[{two},1,{two}],"branch":[{minus_one},1,{minus_one}]}}"#);
        let request: WorkspaceRequest = parse(body.as_bytes()).expect(two);
        assert_eq!((request.cells, request.branch), ([2, 1, 2], [-1, 1, -1]));
        let body = format!(r#"{{"protocol":{two},"operator":"o","device":"d"}}"#);
        let request: JoinRequest = parse(body.as_bytes()).expect(two);
        assert_eq!(request.protocol, 2);
    }
    for (number, pointer) in [
        ("2.5", "/tools"),
        ("2.0000001", "/tools"),
        ("-2", "/tools"),
        ("-0.0", "/tools"),
        ("8.5", "/tools"),
        ("9.0", "/tools"),
        ("300", "/tools"),
        ("1e300", "/tools"),
        ("18446744073709551615", "/tools"),
        ("\"2\"", "/tools"),
    ] {
        let body = format!(r#"{{"id":"a","tools":{number}}}"#);
        let Err(BodyError::Field(error)) = parse::<NewSession>(body.as_bytes()) else {
            panic!("{body} is read");
        };
        assert_eq!(error.pointer, pointer, "{body}");
    }
    // A quantity may be written as a whole number, and stays what it was.
    let body = br#"{"network":{"up":{"delay_s":1,"loss":1.0,"seed":-0.0}}}"#;
    let patch: SessionPatch = parse(body).expect("they are in range");
    let up = patch
        .network
        .and_then(|network| network.up)
        .expect("it is there");
    assert_eq!(
        (up.delay_s, up.loss, up.seed),
        (Some(1.0), Some(1.0), Some(0))
    );
}

/// Rounding to the nanometre must not pull into a range what lies outside of it. Numbers have 15 digits, which arrive
/// as they left.
#[test]
fn a_length_just_out_of_range_is_refused() {
    let blade = |side: f64| json!({ "kind": "blade", "width_m": side, "height_m": 0.01, "thickness_m": 0.01 });
    for (body, pointer) in [
        (
            json!({ "id": "a", "tool": { "kind": "ball", "radius_m": 0.100_000_000_000_001 } }),
            "/tool/radius_m",
        ),
        (
            json!({ "id": "a", "tool": { "kind": "ball", "radius_m": 9.999_999_999_999e-5 } }),
            "/tool/radius_m",
        ),
        (
            json!({ "id": "a", "tool": blade(0.500_000_000_000_001) }),
            "/tool/width_m",
        ),
        (
            json!({ "id": "a", "clay": { "voxel_size_m": 0.100_000_000_000_001 } }),
            "/clay/voxel_size_m",
        ),
        (
            json!({ "id": "a", "clay": { "voxel_size_m": 9.999_999_9e-6 } }),
            "/clay/voxel_size_m",
        ),
        (
            json!({ "id": "a", "clay": { "shape": { "kind": "block", "size_m": [1, 10.000_000_000_000_1, 1] } } }),
            "/clay/shape/size_m/1",
        ),
        (
            json!({ "id": "a", "clay": { "shape": { "kind": "stepped", "base_m": 10.000_000_000_000_1 } } }),
            "/clay/shape/base_m",
        ),
        (
            json!({ "id": "a", "clay": { "shape": { "kind": "stepped", "base_m": -1e-12 } } }),
            "/clay/shape/base_m",
        ),
    ] {
        assert_eq!(refused::<NewSession>(&body).pointer, pointer, "{body}");
    }
}

/// Words of Rust and of serde that nobody outside of this program knows.
const FOREIGN: [&str; 17] = [
    "struct",
    "enum",
    "variant",
    "tuple",
    "newtype",
    "sequence",
    "map,",
    "boolean",
    "unit",
    "floating",
    "integer `",
    "u8",
    "u16",
    "u32",
    "u64",
    "i64",
    "f64",
];

#[test]
fn a_mistake_is_told_in_the_words_of_the_interface() {
    let values = [
        json!(null),
        json!(true),
        json!(7),
        json!(-7),
        json!(2.5),
        json!(1e300),
        json!("text"),
        json!([]),
        json!([1]),
        json!({}),
        json!({ "a": 1 }),
    ];
    let mut told = std::collections::BTreeSet::new();
    let mut look = |error: FieldError, body: &Value| {
        for word in FOREIGN {
            assert!(!error.detail.contains(word), "{body}: {}", error.detail);
        }
        // Types of ours have names of several capitals.
        let is_type = |word: &str| 1 < word.chars().filter(char::is_ascii_uppercase).count();
        let foreign = error
            .detail
            .split(|c: char| !c.is_alphanumeric())
            .find(|word| is_type(word));
        assert_eq!(foreign, None, "{body}: {}", error.detail);
        told.insert(error.detail);
    };
    for value in &values {
        for pointer in [
            "/id",
            "/axes",
            "/scheme",
            "/material",
            "/material/stiffness_pa",
            "/network/up",
            "/network/up/seed",
            "/network/up/burst",
            "/clay/shape",
            "/clay/shape/size_m",
            "/clay/shape/size_m/0",
            "/tool",
            "/tool/kind",
            "/tools",
            "/deadband",
        ] {
            let mut body = json!({
                "id": "a", "axes": 2, "scheme": "wave", "material": { "stiffness_pa": 0 }, "network": { "up": { "seed": 1, "burst": null } },
                "clay": { "shape": { "kind": "block", "size_m": [0.1, 0.1, 0.1] } }, "tool": { "kind": "ball", "radius_m": 0.01 },
                "tools": 1, "deadband": 0,
            });
            *body.pointer_mut(pointer).expect("it is there") = value.clone();
            if let Err(error) = read::<NewSession>(&body) {
                look(error, &body);
            }
        }
        for pointer in [
            "/geometry",
            "/geometry/arm_angles_deg",
            "/position_m",
            "/branch",
            "/branch/1",
        ] {
            let mut body =
                json!({ "geometry": geometry(), "position_m": [0, 0, 0.1], "branch": [1, 1, 1] });
            *body.pointer_mut(pointer).expect("it is there") = value.clone();
            if let Err(error) = read::<JacobianRequest>(&body) {
                look(error, &body);
            }
        }
        for pointer in ["/type", "/nonce"] {
            let mut body = json!({ "type": "ping", "nonce": 1 });
            *body.pointer_mut(pointer).expect("it is there") = value.clone();
            if let Err(error) = read::<ClientText>(&body) {
                look(error, &body);
            }
        }
    }
    for detail in [
        "7 came, wanted an object",
        "null came, wanted a number",
        "an object came, wanted a text",
        "2.5 came, wanted a whole number from 1 to 8",
        "an array of 1 came, wanted an array of 3",
        "a text came, wanted a whole number, 0 or above",
        "1e300 is larger than any whole number here may be",
        "-7 axes, wanted 2 or 3",
        "`text` is not a scheme, wanted one of [\"force_exchange\", \"position_force\", \"wave\", \"tdpa\", \"replica\"]",
    ] {
        assert!(told.contains(detail), "{detail}: {told:#?}");
    }
}

#[test]
fn a_change_of_an_outage_keeps_the_rest_of_it() {
    let before = Network {
        up: Impairment {
            outage: Some(Outage {
                every_s: 10.0,
                length_s: 1.0,
            }),
            ..Impairment::default()
        },
        ..Network::default()
    };
    let outcome = |body: Value| {
        let patch: SessionPatch = read(&body)?;
        patch.fits(before)?;
        Ok(patch.network.expect("it names the network").apply(before))
    };
    let refused = |body: Value| outcome(body).map_err(|error: FieldError| error.pointer);
    let up = |change: Value| json!({ "network": { "up": { "outage": change } } });
    let after = outcome(up(json!({ "length_s": 2 }))).expect("it fits");
    assert_eq!(
        after.up.outage,
        Some(Outage {
            every_s: 10.0,
            length_s: 2.0
        })
    );
    let after = outcome(up(json!({ "every_s": 20 }))).expect("it fits");
    assert_eq!(
        after.up.outage,
        Some(Outage {
            every_s: 20.0,
            length_s: 1.0
        })
    );
    assert_eq!(outcome(up(json!({}))), Ok(before));
    assert_eq!(outcome(up(json!(null))).expect("it fits").up.outage, None);
    // Each of the two is in its range; together they are not.
    assert_eq!(
        refused(up(json!({ "length_s": 10 }))),
        Err("/network/up/outage/length_s".to_owned())
    );
    assert_eq!(
        refused(up(json!({ "every_s": 1 }))),
        Err("/network/up/outage/length_s".to_owned())
    );
    assert_eq!(
        refused(up(json!({ "length_s": 61 }))),
        Err("/network/up/outage/length_s".to_owned())
    );
    // What begins has nothing to keep.
    let down = |name: &str, change: Value| json!({ "network": { "down": { name: change } } });
    let at = |name: &str| Err(format!("/network/down/{name}"));
    assert_eq!(
        refused(down("outage", json!({ "length_s": 2 }))),
        at("outage")
    );
    assert_eq!(refused(down("outage", json!({}))), at("outage"));
    assert_eq!(
        refused(down("burst", json!({ "enter": 0.1, "leave": 0.2 }))),
        at("burst")
    );
    let whole = json!({ "enter": 0.1, "leave": 0.2, "loss_in_burst": 1 });
    assert!(
        outcome(down("burst", whole))
            .expect("it is whole")
            .down
            .burst
            .is_some()
    );
    // A new session has nothing to keep either.
    let body = json!({ "id": "a", "network": { "up": { "outage": { "length_s": 2 } } } });
    assert!(read::<NewSession>(&body).is_err());
}

fn geometry() -> Value {
    json!({
        "base_radius_m": 0.12, "platform_radius_m": 0.04, "upper_link_m": 0.1, "lower_link_m": 0.2, "arm_angles_deg": [0, 120, 240],
    })
}

fn cutting() -> Value {
    json!({
        "virtual_mass_kg": 1, "virtual_damping_n_s_per_m": 20, "position_ratio": 1, "force_ratio": -1, "hand_force_n": 2,
        "edges_m": [0.03, 0.04], "clay_damping_n_s_per_m": [20],
    })
}

fn tuning() -> Value {
    let one = json!({ "numerator": [1], "denominator": [1] });
    json!({
        "g_h": one, "t_h": [1], "g_t": one, "position_ratio": 1, "force_ratio": -1, "clay_damping_n_s_per_m": [0, 1],
        "clay_stiffness_n_per_m": [0, 1], "round_trip_s": 0.1, "distance": 0.5, "heaviest_n_s_per_m": 10,
    })
}
