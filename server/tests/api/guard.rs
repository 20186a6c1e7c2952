//! Host, origin, token: who is let in.

use crate::rig::{Rig, shared};
use crate::wire::{Answer, Ask, Site};

const TOKEN: &str = "correct-horse.battery~staple";

fn refusal(answer: &Answer) -> Option<(u16, String)> {
    (400 <= answer.status).then(|| (answer.status, answer.word()))
}

fn refused(status: u16, word: &str) -> Option<(u16, String)> {
    Some((status, word.to_owned()))
}

/// One of every sort of request, none of which changes anything when it is let in.
fn asks() -> [Ask; 7] {
    [
        Ask::new("GET", "/"),
        Ask::new("GET", "/healthz"),
        Ask::new("GET", "/metrics"),
        Ask::new("GET", "/api/docs/"),
        Ask::new("GET", "/api/v1/openapi.json"),
        Ask::new("GET", "/api/v1/sessions"),
        Ask::new("POST", "/api/v1/sessions").json("{"),
    ]
}

fn is_let_in(answer: &Answer) -> bool {
    answer.status == 200 || refusal(answer) == refused(400, "syntax")
}

#[test]
fn without_a_token_only_this_machine_goes_by_a_name() {
    let site = shared().site();
    let port = site.address.port();
    for ask in asks() {
        for host in [
            format!("127.0.0.1:{port}"),
            format!("localhost:{port}"),
            "LOCALHOST".to_owned(),
            "127.0.0.53".to_owned(),
            format!("[::1]:{port}"),
            // Somebody forwards another port to here.
            "localhost:1".to_owned(),
        ] {
            let answer = site.send(&ask.clone().with("Host", &host));
            assert!(is_let_in(&answer), "{host}: {answer:?}");
        }
        for host in [
            "evil.example".to_owned(),
            format!("evil.example:{port}"),
            format!("localhost.evil.example:{port}"),
            format!("127.0.0.1.evil.example:{port}"),
            "0.0.0.0".to_owned(),
            "169.254.169.254".to_owned(),
            "192.168.0.1".to_owned(),
            "2130706433".to_owned(),
            "localhos".to_owned(),
        ] {
            let answer = site.send(&ask.clone().with("Host", &host));
            assert_eq!(refusal(&answer), refused(421, "host"), "{host}: {ask:?}");
        }
    }
}

#[test]
fn a_request_says_once_for_whom_it_is() {
    let site = shared().site();
    let own = site.address.to_string();
    for ask in asks() {
        for broken in [
            ask.clone().with("Host", ""),
            ask.clone().with("Host", &own).with("Host", &own),
            ask.clone().with("Host", "user@localhost"),
            ask.clone().with("Host", "local host"),
            ask.clone().with("Host", "localhost:port"),
            ask.clone().with("Host", "localhost/path"),
        ] {
            let answer = site.send(&broken);
            assert_eq!(refusal(&answer), refused(400, "host-missing"), "{broken:?}");
        }
    }
    // A request target with a host of its own is for that one, whatever the header says.
    let answer = site.send(&Ask::new("GET", "http://evil.example/healthz").with("Host", &own));
    assert_eq!(refusal(&answer), refused(421, "host"));
    let answer = site.send(&Ask::new("GET", &format!("http://{own}/healthz")));
    assert_eq!(answer.status, 200);
}

fn try_every_change(site: &Site, session: &str, origin: &str) -> Vec<Option<(u16, String)>> {
    let one = format!("/api/v1/sessions/{session}");
    let stream = Ask::new("GET", &format!("{one}/stream"))
        .with("Connection", "Upgrade")
        .with("Upgrade", "websocket");
    [
        Ask::new("POST", "/api/v1/sessions").json("{"),
        Ask::new("PATCH", &one).json("{"),
        Ask::new("POST", &format!("{one}/clay/reset")).json("{"),
        Ask::new("DELETE", "/api/v1/sessions/none"),
        stream,
    ]
    .into_iter()
    .map(|ask| refusal(&site.send(&ask.with("Origin", origin))))
    .collect()
}

#[test]
fn a_page_from_elsewhere_changes_nothing_and_opens_no_stream() {
    let rig = shared();
    let site = rig.serve(|config| config.allowed_origins = vec!["https://lab.example".to_owned()]);
    let session = rig.session(&site);
    let port = site.address.port();
    let past = vec![
        refused(400, "syntax"),
        refused(400, "syntax"),
        refused(400, "syntax"),
        refused(404, "no-such-session"),
        refused(400, "handshake"),
    ];
    for origin in [
        format!("http://127.0.0.1:{port}"),
        "https://lab.example".to_owned(),
        // Not a browser.
        String::new(),
    ] {
        assert_eq!(try_every_change(&site, &session, &origin), past, "{origin}");
    }
    for origin in [
        "null",
        "http://evil.example",
        "http://lab.example",
        "https://lab.example:444",
        "https://lab.example.evil.example",
        "https://lab.example/",
        "http://127.0.0.1",
        &format!("http://localhost:{port}"),
        &format!("http://127.0.0.1:{port}0"),
        &format!("http://127.0.0.1:{port}, https://lab.example"),
        "\u{fc}",
    ] {
        for refusal in try_every_change(&site, &session, origin) {
            assert_eq!(refusal, refused(403, "origin"), "{origin}");
        }
    }
    site.delete(&format!("/api/v1/sessions/{session}"));
}

#[test]
fn pages_of_a_configured_origin_may_read_answers_and_others_may_not() {
    let rig = shared();
    let site = rig.serve(|config| config.allowed_origins = vec!["https://lab.example".to_owned()]);
    let read = |origin| site.send(&Ask::new("GET", "/api/v1/sessions").with("Origin", origin));
    let allowed = |answer: &Answer| {
        answer
            .header("access-control-allow-origin")
            .map(str::to_owned)
    };
    assert_eq!(
        allowed(&read("https://lab.example")),
        Some("https://lab.example".to_owned())
    );
    assert_eq!(allowed(&read("https://evil.example")), None);

    let preflight = site.send(
        &Ask::new("OPTIONS", "/api/v1/sessions/any")
            .with("Origin", "https://lab.example")
            .with("Access-Control-Request-Method", "PATCH")
            .with(
                "Access-Control-Request-Headers",
                "authorization,content-type",
            ),
    );
    assert_eq!(preflight.status, 200);
    let methods = preflight.header("access-control-allow-methods").unwrap();
    assert!(methods.contains("PATCH") && methods.contains("DELETE"));
    assert!(
        preflight
            .header("access-control-allow-headers")
            .unwrap()
            .contains("authorization")
    );

    let plain = rig.site();
    let answer =
        plain.send(&Ask::new("GET", "/api/v1/sessions").with("Origin", "https://lab.example"));
    assert_eq!(allowed(&answer), None, "nobody was configured");
}

fn guarded(rig: &Rig) -> Site {
    rig.serve(|config| config.token = Some(TOKEN.to_owned()))
}

#[test]
fn with_a_token_every_call_needs_it_and_any_name_will_do() {
    let bearer = format!("Bearer {TOKEN}");
    let calls = [
        Ask::new("GET", "/metrics"),
        Ask::new("GET", "/api/v1/sessions"),
        Ask::new("POST", "/api/v1/sessions").json("{"),
        Ask::new("GET", "/api/v1/sessions/none"),
        Ask::new("PATCH", "/api/v1/sessions/none").json("{"),
        Ask::new("DELETE", "/api/v1/sessions/none"),
        Ask::new("POST", "/api/v1/sessions/none/clay/reset").json("{"),
        Ask::new("GET", "/api/v1/sessions/none/stream"),
        // Not even which methods there are.
        Ask::new("PUT", "/api/v1/sessions").json("{"),
    ];
    for ask in calls {
        // Each has tries of its own.
        let site = guarded(shared());
        for shown in [
            "",
            "Bearer",
            "Bearer ",
            "Bearer wrong",
            "Basic dXNlcjpwYXNz",
            TOKEN,
            &bearer[..bearer.len() - 1],
            &format!("{bearer}x"),
            &bearer.to_uppercase(),
        ] {
            let answer = site.send(&ask.clone().with("Authorization", shown));
            assert_eq!(refusal(&answer), refused(401, "token"), "{shown}: {ask:?}");
            assert!(
                answer
                    .header("www-authenticate")
                    .unwrap()
                    .starts_with("Bearer")
            );
        }
        for host in [site.address.to_string(), "lab.example".to_owned()] {
            let answer = site.send(
                &ask.clone()
                    .with("Authorization", &bearer)
                    .with("Host", &host),
            );
            assert_ne!(answer.status, 401, "{ask:?}");
            assert_ne!(answer.status, 421, "{ask:?}");
        }
    }
    // What tells nothing of anybody's session is for everybody: supervisors, and the pages that ask for the token.
    for path in [
        "/",
        "/healthz",
        "/readyz",
        "/api/docs/",
        "/api/v1/openapi.json",
        "/problems",
    ] {
        assert_eq!(guarded(shared()).get(path).status, 200, "{path}");
    }
}

/// With a token, too, a page from elsewhere must not use the one that a browser remembers.
#[test]
fn a_token_does_not_excuse_a_foreign_origin() {
    let site = guarded(shared());
    let ask = Ask::new("POST", "/api/v1/sessions")
        .json("{")
        .with("Authorization", &format!("Bearer {TOKEN}"))
        .with("Origin", "https://evil.example");
    assert_eq!(refusal(&site.send(&ask)), refused(403, "origin"));
}

#[test]
fn a_stream_takes_its_token_from_the_second_subprotocol() {
    let rig = shared();
    let site = guarded(rig);
    let open = rig.site();
    let session = rig.session(&open);
    let handshake = |offered: &str| {
        site.send(
            &Ask::new("GET", &format!("/api/v1/sessions/{session}/stream"))
                .with("Connection", "Upgrade")
                .with("Upgrade", "websocket")
                .with("Sec-WebSocket-Protocol", offered),
        )
    };
    for offered in [
        "",
        "teleclay.v1",
        "teleclay.v1, bearer.wrong",
        "teleclay.v1, bearer.",
        &format!("teleclay.v1, {TOKEN}"),
        &format!("teleclay.v1, Bearer.{TOKEN}"),
    ] {
        let answer = handshake(offered);
        assert_eq!(refusal(&answer), refused(401, "token"), "{offered}");
    }
    // Past the token, the handshake lacks its key.
    let answer = handshake(&format!("teleclay.v1, bearer.{TOKEN}"));
    assert_eq!(refusal(&answer), refused(400, "handshake"));
    open.delete(&format!("/api/v1/sessions/{session}"));
}

/// Twenty at once, then one a second; and nothing is told of a token that comes sooner, not even of the right one.
#[test]
fn wrong_tokens_are_looked_at_twenty_times_and_then_one_a_second() {
    let site = shared().serve(|config| config.token = Some("the right token, long".to_owned()));
    let ask = |token: &str| {
        let ask = Ask::new("GET", "/api/v1/sessions");
        site.send(&ask.with("Authorization", &format!("Bearer {token}")))
    };
    assert_eq!(ask("the right token, long").status, 200);
    let statuses: Vec<u16> = (0..40)
        .map(|number| ask(&format!("guess {number}")).status)
        .collect();
    let looked_at = statuses.iter().filter(|status| **status == 401).count();
    let refused = statuses.iter().filter(|status| **status == 429).count();
    assert_eq!(looked_at + refused, 40, "{statuses:?}");
    // The machine may take a few seconds over them.
    assert!((20..30).contains(&looked_at), "{statuses:?}");
    let mut sooner = ask("the right token, long");
    if sooner.status == 200 {
        // A second had just passed.
        assert_eq!(ask("one more guess").status, 401);
        sooner = ask("the right token, long");
    }
    assert_eq!((sooner.status, &*sooner.word()), (429, "too-many-tries"));
    assert_eq!(sooner.header("retry-after"), Some("1"));
}
