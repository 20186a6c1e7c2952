//! What is where, and what is not.

use serde_json::{Value, json};
use teleclay_proto::http::{Health, Readiness, Session};

use crate::rig::{eventually, shared, small};
use crate::wire::Ask;

#[test]
fn a_session_lives_from_its_making_to_its_end() {
    let site = shared().site();
    let made = site.post("/api/v1/sessions", &small("life"));
    assert_eq!(made.status, 201);
    assert_eq!(made.header("location"), Some("/api/v1/sessions/life"));
    let session: Session = made.json();
    assert_eq!(session.id.as_str(), "life");
    assert_eq!(
        session.clay.initial_units,
        session.clay.remaining_units + session.clay.removed_units
    );

    let listed: Vec<Session> = site.get("/api/v1/sessions").json();
    assert!(listed.iter().any(|session| session.id.as_str() == "life"));
    let names: Vec<_> = listed.iter().map(|session| session.id.clone()).collect();
    assert!(names.is_sorted(), "{names:?}");

    let path = "/api/v1/sessions/life";
    let patched: Session = site
        .patch(
            path,
            &json!({ "network": { "up": { "delay_s": 0.08 } }, "paused": true }),
        )
        .json();
    assert_eq!(patched.network.up.delay_s.to_bits(), 0.08_f64.to_bits());
    assert_eq!(patched.network.down, session.network.down);
    let shown: Value = site.get(path).json();
    assert_eq!(shown["state"], "paused");

    let reset: Session = site
        .post(
            &format!("{path}/clay/reset"),
            &json!({ "shape": { "kind": "block", "size_m": [0.02, 0.02, 0.02] } }),
        )
        .json();
    assert_ne!(reset.clay.epoch, session.clay.epoch);
    assert!((reset.clay.initial_volume_m3 - 8e-6).abs() < 1e-12);

    assert_eq!(site.delete(path).status, 204);
    for answer in [
        site.get(path),
        site.delete(path),
        site.patch(path, &json!({})),
    ] {
        assert_eq!((answer.status, &*answer.word()), (404, "no-such-session"));
    }
}

#[test]
fn probes_answer() {
    let site = shared().site();
    let health: Health = site.get("/healthz").json();
    assert_eq!(health.version, "9.8.7");
    assert!(0.0 <= health.uptime_s);
    // A server that has just begun has not ticked yet, and says so.
    eventually("a tick", || site.get("/readyz").status == 200);
    let ready: Readiness = site.get("/readyz").json();
    assert!(ready.ready && ready.loop_running && ready.zenoh_up);
}

#[test]
fn nothing_is_where_nothing_should_be() {
    let site = shared().site();
    for path in [
        "/api",
        "/api/",
        "/api/v1",
        "/api/v1/",
        "/api/v2/sessions",
        "/api/v1/session",
        "/api/v1/sessions/",
        "/api/v1/sessions/x/y",
        "//api/v1/sessions",
        "/api/v1/../v1/sessions",
        "/api/docs/none.js",
        "/api/docs/../../etc/passwd",
        "/problems/none",
        "/problems/%ff",
        "/metrics/",
        "/healthz/x",
        "/.git/config",
        "/..%2f..%2fetc/passwd",
        "/index.html/",
        "/assets/",
        "/%00",
        "/%zz",
    ] {
        let answer = site.get(path);
        assert_eq!(
            (answer.status, &*answer.word()),
            (404, "no-such-path"),
            "{path}"
        );
        let detail = answer.problem().detail;
        assert!(detail.contains(path), "{path}: {detail}");
        let answer = site.send(&Ask::new("POST", path).json("{}"));
        let is_refused = matches!(
            (answer.status, &*answer.word()),
            (404, "no-such-path") | (405, "method")
        );
        assert!(is_refused, "{path}: {answer:?}");
    }
}

#[test]
fn names_in_paths_are_names_or_name_nothing() {
    let site = shared().site();
    let long = "a".repeat(5000);
    for name in [
        "none", "UPPER", "a%20b", "a%2Fb", "..%2f", "%00", "%C3%BC", "a;b", "*", &long,
    ] {
        for (method, rest) in [
            ("GET", ""),
            ("DELETE", ""),
            ("PATCH", ""),
            ("POST", "/clay/reset"),
            ("GET", "/stream"),
        ] {
            let path = format!("/api/v1/sessions/{name}{rest}");
            let answer = site.send(&Ask::new(method, &path).json("{}"));
            assert_eq!(
                (answer.status, &*answer.word()),
                (404, "no-such-session"),
                "{method} {path}"
            );
            let detail = answer.problem().detail;
            let (named, _) = path.split_at(path.len().min(200));
            assert!(detail.starts_with(named), "{method} {path}: {detail}");
            assert!(detail.len() < 400, "a detail repeats all of a long path");
        }
    }
    for name in ["%ff", "a%80", "%ed%a0%80"] {
        let answer = site.get(&format!("/api/v1/sessions/{name}"));
        assert_eq!((answer.status, &*answer.word()), (400, "path"), "{name}");
    }
}

#[test]
fn a_method_that_is_not_offered_is_told_which_are() {
    let site = shared().site();
    let session = shared().session(&site);
    let one = format!("/api/v1/sessions/{session}");
    for (path, offered) in [
        ("/api/v1/sessions".to_owned(), &["GET", "HEAD", "POST"][..]),
        (one.clone(), &["DELETE", "GET", "HEAD", "PATCH"]),
        (format!("{one}/clay/reset"), &["POST"]),
        (format!("{one}/stream"), &["GET", "HEAD"]),
        ("/api/v1/openapi.json".to_owned(), &["GET", "HEAD"]),
        ("/healthz".to_owned(), &["GET", "HEAD"]),
        ("/readyz".to_owned(), &["GET", "HEAD"]),
        ("/metrics".to_owned(), &["GET", "HEAD"]),
        ("/problems".to_owned(), &["GET", "HEAD"]),
        ("/problems/field".to_owned(), &["GET", "HEAD"]),
        ("/api/docs".to_owned(), &["GET", "HEAD"]),
        ("/api/docs/".to_owned(), &["GET", "HEAD"]),
        ("/".to_owned(), &["GET", "HEAD"]),
    ] {
        for method in [
            "GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "QUERY", "GET2",
        ] {
            if offered.contains(&method) {
                continue;
            }
            let answer = site.send(&Ask::new(method, &path).json("{}"));
            assert_eq!(answer.status, 405, "{method} {path}: {answer:?}");
            let allow = answer.header("allow").unwrap();
            let mut allowed: Vec<_> = allow.split(',').map(str::trim).collect();
            allowed.sort_unstable();
            assert_eq!(allowed, offered, "{path}");
            // What answers a HEAD has no body to look at.
            if method != "HEAD" {
                assert_eq!(answer.word(), "method");
                let detail = answer.problem().detail;
                let wanted = format!("{path} does not offer {method}");
                assert_eq!(detail, wanted, "{method} {path}");
            }
        }
    }
    site.delete(&one);
}

#[test]
fn head_answers_as_get_does_without_its_body() {
    let site = shared().site();
    for path in [
        "/",
        "/healthz",
        "/api/v1/sessions",
        "/api/docs/",
        "/metrics",
    ] {
        let answer = site.send(&Ask::new("HEAD", path));
        assert_eq!(answer.status, 200, "{path}");
        assert!(answer.body.is_empty(), "{path}");
    }
    let answer = site.send(&Ask::new("HEAD", "/api/v1/sessions/none"));
    assert_eq!(answer.status, 404);
}
