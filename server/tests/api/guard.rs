//! Host, origin, token: who is let in.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use teleclay_doors::Invites;
use teleclay_doors::audit::Audit;
use teleclay_proto::SessionId;
use teleclay_proto::invite::Role;
use teleclay_server::doors::Doors;

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
    rig.serve(|config| config.doors = Arc::new(Doors::with_token(TOKEN)))
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
    let site = shared()
        .serve(|config| config.doors = Arc::new(Doors::with_token("the right token, long")));
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

/// Invites to `session`, one for each role, as a command beside a running server makes them.
pub(crate) struct Guests {
    pub(crate) data: PathBuf,
    pub(crate) invites: Invites,
    /// Of a spectator, an operator and an admin.
    pub(crate) tokens: Vec<String>,
}

impl Guests {
    pub(crate) fn of(session: &str) -> Self {
        let data = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
        let data = data.join(format!("guests-{}-{session}", std::process::id()));
        std::fs::create_dir_all(&data).unwrap();
        let invites = Invites::open(&data).unwrap();
        let session = SessionId::new(session).unwrap();
        let invite = |role: Role| {
            let made = invites.make(SystemTime::now(), session.clone(), role, None);
            made.unwrap().to_string()
        };
        let tokens = [Role::Spectator, Role::Operator, Role::Admin].map(invite);
        Self {
            tokens: tokens.to_vec(),
            data,
            invites,
        }
    }

    pub(crate) fn site(&self) -> Site {
        let invites = Invites::open(&self.data).unwrap();
        let audit = Audit::open(&self.data).unwrap();
        let doors = Doors::with_token(TOKEN).and_guests(invites).watched(audit);
        shared().serve(|config| config.doors = Arc::new(doors))
    }
}

#[test]
fn a_guest_does_what_the_invite_says_in_its_session_and_nowhere_else() {
    let open = shared().site();
    let (own, other) = (shared().session(&open), shared().session(&open));
    let guests = Guests::of(&own);
    let site = guests.site();
    let one = |name: &str| format!("/api/v1/sessions/{name}");
    let patch = r#"{"deadband": 0.05}"#;
    // Method, path, body; what a spectator, an operator and an admin are answered with.
    for (method, path, body, statuses) in [
        ("GET", one(&own), "", [200, 200, 200]),
        (
            "GET",
            format!("{}/clay.stl", one(&own)),
            "",
            [200, 200, 200],
        ),
        (
            "POST",
            "/api/v1/kinematics/forward".to_owned(),
            "{",
            [400, 400, 400],
        ),
        ("PATCH", one(&own), patch, [403, 403, 200]),
        (
            "POST",
            format!("{}/clay/reset", one(&own)),
            "{}",
            [403, 403, 200],
        ),
        (
            "GET",
            format!("{}/recordings", one(&own)),
            "",
            [200, 200, 200],
        ),
        (
            "POST",
            format!("{}/recordings", one(&own)),
            r#"{"rate_hz": 0}"#,
            [403, 422, 422],
        ),
        (
            "POST",
            format!("{}/recordings/none/stop", one(&own)),
            "",
            [403, 404, 404],
        ),
        (
            "DELETE",
            format!("{}/recordings/none", one(&own)),
            "",
            [403, 403, 404],
        ),
        ("GET", one(&other), "", [403, 403, 403]),
        ("PATCH", one(&other), patch, [403, 403, 403]),
        ("DELETE", one(&other), "", [403, 403, 403]),
        ("POST", "/api/v1/sessions".to_owned(), "{", [403, 403, 403]),
        ("GET", "/metrics".to_owned(), "", [403, 403, 403]),
        ("GET", one("there-is-none"), "", [403, 403, 403]),
        ("DELETE", one(&own), "", [403, 403, 204]),
    ] {
        for (token, status) in guests.tokens.iter().zip(statuses) {
            let ask = Ask::new(method, &path).with("Authorization", &format!("Bearer {token}"));
            let ask = if body.is_empty() { ask } else { ask.json(body) };
            let answer = site.send(&ask);
            assert_eq!(answer.status, status, "{method} {path}: {answer:?}");
            if status == 403 {
                assert_eq!(answer.word(), "not-allowed");
            }
        }
    }
    let listed = site.send(
        &Ask::new("GET", "/api/v1/sessions")
            .with("Authorization", &format!("Bearer {}", guests.tokens[0])),
    );
    assert_eq!(
        listed.json::<Vec<serde_json::Value>>(),
        [] as [serde_json::Value; 0],
        "its session is gone, others are not told"
    );
    open.delete(&one(&other));
    std::fs::remove_dir_all(&guests.data).unwrap();
}

#[test]
fn an_invite_that_has_ended_or_was_never_made_is_no_token() {
    let open = shared().site();
    let own = shared().session(&open);
    let guests = Guests::of(&own);
    let site = guests.site();
    let ask = |token: &str| {
        let ask = Ask::new("GET", "/api/v1/sessions");
        site.send(&ask.with("Authorization", &format!("Bearer {token}")))
    };
    let status = |token: &str| ask(token).status;
    let [spectator, operator, admin] = &guests.tokens[..] else {
        panic!("three were made");
    };
    let listed = ask(spectator).json::<serde_json::Value>();
    assert_eq!(listed[0]["id"], own.as_str());
    // One's number with another's secret, and a digit that was changed.
    let (number, _) = spectator.split_once('.').unwrap();
    let (_, secret) = operator.split_once('.').unwrap();
    assert_eq!(status(&format!("{number}.{secret}")), 401);
    let last = if operator.ends_with('0') { '1' } else { '0' };
    assert_eq!(
        status(&format!("{}{last}", &operator[..operator.len() - 1])),
        401
    );
    assert_eq!(status(operator), 200);
    // Taken back beside the running server.
    let id = operator
        .parse::<teleclay_proto::invite::InviteToken>()
        .unwrap()
        .id();
    guests.invites.revoke(SystemTime::now(), id).unwrap();
    assert_eq!(status(operator), 401);
    assert_eq!(status(admin), 200);
    let past = SystemTime::now() - Duration::from_secs(7200);
    let session = SessionId::new(&*own).unwrap();
    let hour = Some(Duration::from_secs(3600));
    let over = guests
        .invites
        .make(past, session, Role::Admin, hour)
        .unwrap();
    assert_eq!(status(&over.to_string()), 401);
    open.delete(&format!("/api/v1/sessions/{own}"));
    std::fs::remove_dir_all(&guests.data).unwrap();
}

#[test]
fn the_audit_log_says_who_did_what_and_who_was_kept_from_it() {
    let open = shared().site();
    let own = shared().session(&open);
    let guests = Guests::of(&own);
    let site = guests.site();
    let path = format!("/api/v1/sessions/{own}");
    for token in [&guests.tokens[0], &guests.tokens[2], "wrong"] {
        let ask = Ask::new("PATCH", &path).json(r#"{"deadband": 0.05}"#);
        site.send(&ask.with("Authorization", &format!("Bearer {token}")));
    }
    let log = guests.data.join("doors/audit.jsonl");
    let mut lines = Vec::new();
    crate::rig::eventually("three lines", || {
        let text = std::fs::read_to_string(&log).unwrap();
        lines = text
            .lines()
            .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap())
            .collect();
        lines.len() == 3
    });
    let told: Vec<(&str, &str)> = lines
        .iter()
        .map(|line| {
            (
                line["who"].as_str().unwrap(),
                line["outcome"].as_str().unwrap(),
            )
        })
        .collect();
    let who = |token: &str| format!("invite {}", token.split_once('.').unwrap().0);
    let (spectator, admin) = (who(&guests.tokens[0]), who(&guests.tokens[2]));
    assert_eq!(
        told,
        [(&*spectator, "403"), (&*admin, "200"), ("nobody", "401")]
    );
    assert!(lines.iter().all(|line| line["session"] == *own));
    assert!(
        lines
            .iter()
            .all(|line| line["did"] == format!("PATCH {path}"))
    );
    assert!(lines.iter().all(|line| line["from"] == "127.0.0.1"));
    open.delete(&path);
    std::fs::remove_dir_all(&guests.data).unwrap();
}
