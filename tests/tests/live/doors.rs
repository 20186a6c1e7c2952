//! Invites, roles and certificates, with the programs as people start them; and what Zenoh itself keeps strangers from.

use std::net::Ipv4Addr;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::json;
use teleclay_proto::Scheme;
use teleclay_proto::keys::every_tool_up_in;
use teleclay_tests::process::PATIENCE;
use teleclay_tests::recording::greatest_force_step_n;
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Server, TOKEN};
use zenoh::qos::CongestionControl;
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

use super::endings::{FORCE_STEP_N, cuts};
use super::strangers::{ada, ask, connected_to, keys};

/// The line for a handle.
fn line(printed: &[String]) -> &str {
    let line = printed.iter().find(|line| line.starts_with("teleclay:"));
    line.expect("an operator gets one")
}

/// The token in the link for a browser.
fn token(printed: &[String]) -> &str {
    let link = printed.iter().find(|line| line.contains("://"));
    let (_, token) = link.and_then(|link| link.split_once("token=")).unwrap();
    token
}

fn number(printed: &[String]) -> &str {
    token(printed).split_once('.').unwrap().0
}

/// Under every scheme: what holds the hand when its invite ends is let go of by the ramp, and said.
#[test]
fn an_operator_with_an_invite_cuts_until_it_is_taken_back_and_is_let_go_of_then() {
    for &scheme in Scheme::ALL {
        let server = Server::secure(Ipv4Addr::LOCALHOST).unwrap();
        let client = &server.client;
        client.patch(DEMO, &json!({ "scheme": scheme })).unwrap();
        let printed = server
            .invite(&["--role", "operator", "--for", "2h"])
            .unwrap();
        let mut handle = Handle::start(&HandleOptions::invited(line(&printed))).unwrap();
        let cutting = client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
        assert_eq!(cutting.tools[0].operator, "Ada");

        server.revoke(number(&printed)).unwrap();
        assert_eq!(handle.process.ends().unwrap().code(), Some(2));
        let said = handle.process.stderr();
        assert!(
            said.contains("taken the tool back: the invite has ended"),
            "{said}"
        );
        assert!(said.contains("has ended, was taken back"), "{said}");
        client
            .session_when(DEMO, "the tool to be free", PATIENCE, |session| {
                session.tools[0].operator.is_empty()
            })
            .unwrap();
        let ticks = handle.ticks().unwrap();
        let step_n = greatest_force_step_n(&ticks);
        assert!(step_n <= FORCE_STEP_N, "{scheme:?}: {step_n} N in a tick");
        // Frames stop with the lease. From the last one on it is the silence and the ramp at most.
        let last = ticks.iter().rposition(|tick| 0.0 < tick.felt_n());
        let silence_s = last.map_or(0.0, |last| ticks[last].silence_s);
        println!("{scheme:?}: the last force {silence_s:.3} s after the last frame");
        assert!(
            silence_s <= 0.15,
            "{scheme:?}: felt {silence_s} s after the last frame"
        );
        let log = std::fs::read_to_string(server.data().join("doors/audit.jsonl")).unwrap();
        let who = format!("invite {}", number(&printed));
        assert!(
            log.lines()
                .any(|line| line.contains(&who) && line.contains("join")),
            "{log}"
        );
        assert!(
            log.lines()
                .any(|line| line.contains("the invite has ended")),
            "{log}"
        );
    }
}

#[test]
fn a_spectator_holds_no_tool_and_a_guest_of_one_session_none_of_another() {
    let server = Server::secure(Ipv4Addr::LOCALHOST).unwrap();
    server.client.create(&json!({ "id": "other" })).unwrap();
    let operator = server.invite(&["--role", "operator"]).unwrap();
    let spectator = server.invite(&[]).unwrap();
    assert!(spectator.iter().all(|line| !line.starts_with("teleclay:")));
    let as_spectator = line(&operator).replace(token(&operator), token(&spectator));
    let elsewhere = line(&operator).replace(",demo,", ",other,");
    let one_wrong = if line(&operator).ends_with('0') {
        "1"
    } else {
        "0"
    };
    let mut guess = line(&operator).to_owned();
    guess.replace_range(guess.len() - 1.., one_wrong);
    for (line, words) in [
        (as_spectator, "does not let anybody hold a tool"),
        (
            elsewhere,
            "does not let anybody hold a tool of session `other`",
        ),
        (guess, "the token is not that of the invite"),
    ] {
        let mut handle = Handle::start(&HandleOptions::invited(&line)).unwrap();
        assert_eq!(handle.process.ends().unwrap().code(), Some(2));
        let said = handle.process.stderr();
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn an_invite_means_nothing_where_anybody_may_come_and_the_command_says_so() {
    let open = Server::on_free_ports().unwrap();
    let said = open.invite(&[]).unwrap_err().to_string();
    assert!(said.contains("TELECLAY_TOKEN"), "{said}");
    let server = Server::secure(Ipv4Addr::LOCALHOST).unwrap();
    let said = server.revoke("0000abcd").unwrap_err().to_string();
    assert!(said.contains("there is no invite 0000abcd"), "{said}");
}

/// A foreign certificate is said at once, on both ends.
#[test]
fn a_server_that_is_another_than_the_invites_is_not_spoken_to() {
    let (server, other) = (
        Server::secure(Ipv4Addr::LOCALHOST).unwrap(),
        Server::secure(Ipv4Addr::LOCALHOST).unwrap(),
    );
    let printed = server.invite(&["--role", "operator"]).unwrap();
    let astray = line(&printed).replace(&server.endpoint(), &other.endpoint());
    let began = Instant::now();
    let mut handle = Handle::start(&HandleOptions::invited(&astray)).unwrap();
    assert_eq!(handle.process.ends().unwrap().code(), Some(2));
    assert!(began.elapsed() < Duration::from_secs(5), "it was said late");
    let said = handle.process.stderr();
    assert!(
        said.contains("another server's than the fingerprint names"),
        "{said}"
    );
    let heard = || other.process.stderr().contains("QUIC acceptor failed");
    teleclay_tests::process::wait_for("the other server to say so", PATIENCE, || {
        heard().then_some(())
    })
    .unwrap();
    // Nobody vouches for a private authority, either.
    let options = HandleOptions::new(&server.endpoint()).with(&["--token", TOKEN]);
    let mut handle = Handle::start(&options).unwrap();
    assert_eq!(handle.process.ends().unwrap().code(), Some(2));
    assert!(handle.process.stderr().contains("--fingerprint"));
}

/// The server comes back as another one, on the same ports: the handle says so instead of trying for ever.
#[test]
fn a_server_that_comes_back_with_another_authority_is_told_from_the_one_that_was_joined() {
    let server = Server::secure(Ipv4Addr::LOCALHOST).unwrap();
    let printed = server.invite(&["--role", "operator"]).unwrap();
    let mut handle = Handle::start(&HandleOptions::invited(line(&printed))).unwrap();
    server
        .client
        .session_when(DEMO, "a cut", PATIENCE, cuts)
        .unwrap();
    let ports = server.kill().unwrap();
    let _other = Server::secure_at(Ipv4Addr::LOCALHOST, ports).unwrap();
    assert_eq!(handle.process.ends().unwrap().code(), Some(2));
    let said = handle.process.stderr();
    assert!(
        said.contains("another server's than the fingerprint names"),
        "{said}"
    );
}

/// What somebody sees who subscribes.
async fn listen(session: &Session, key: String) -> Arc<Mutex<Vec<Vec<u8>>>> {
    let seen: Arc<Mutex<Vec<Vec<u8>>>> = Arc::default();
    let saw = Arc::clone(&seen);
    session
        .declare_subscriber(key)
        .callback(move |sample| {
            saw.lock()
                .unwrap()
                .push(sample.payload().to_bytes().to_vec())
        })
        .background()
        .await
        .unwrap();
    seen
}

/// Two strangers, both connected to the server, which passes on between its clients: each of its rules, from outside.
#[tokio::test(flavor = "multi_thread")]
async fn strangers_reach_nobody_through_the_server() {
    const LIE: &[u8] = b"a lie";
    let server = Server::with_token().unwrap();
    let client = server.client.clone();
    for endpoint in [server.endpoint(), server.slow_endpoint()] {
        let (one, other) = (connected_to(&endpoint).await, connected_to(&endpoint).await);
        // Who answers in the server's place is not asked.
        let asked = Arc::new(Mutex::new(0));
        for key in [
            keys().challenge(),
            keys().join(),
            keys().leave(),
            keys().clay_snapshot(),
            "teleclay/**".to_owned(),
        ] {
            let count = Arc::clone(&asked);
            let answer = key.replace("/**", "/answer");
            one.declare_queryable(key)
                .callback(move |query| {
                    *count.lock().unwrap() += 1;
                    let _ = query.reply(answer.clone(), LIE).wait();
                })
                .background()
                .await
                .unwrap();
        }
        // Nobody says anything in another's place.
        let keys = keys();
        let heard = [
            keys.tool_up(1),
            keys.tool_down(1),
            keys.tool_farewell(1),
            keys.state(),
            keys.clay_bricks(),
            "teleclay/**".to_owned(),
            "else/where".to_owned(),
        ];
        let mut all = Vec::new();
        for key in &heard {
            all.push(listen(&other, key.clone()).await);
        }
        let gone = Arc::new(Mutex::new(Vec::new()));
        let saw = Arc::clone(&gone);
        other
            .liveliness()
            .declare_subscriber(keys.alive())
            .history(true)
            .callback(move |sample| saw.lock().unwrap().push(sample.kind()))
            .background()
            .await
            .unwrap();
        let shown = one.liveliness().declare_token(keys.alive()).await.unwrap();
        client.let_pass(DEMO, 200).unwrap();
        for _ in 0..20 {
            for key in heard.iter().filter(|key| !key.contains('*')) {
                one.put(key, LIE).await.unwrap();
            }
            client.let_pass(DEMO, 10).unwrap();
        }
        shown.undeclare().await.unwrap();
        for key in [
            keys.challenge(),
            keys.join(),
            keys.clay_snapshot(),
            "teleclay/**".to_owned(),
        ] {
            let answers = ask(&other, key.clone(), b"{}".to_vec()).await;
            assert!(
                !answers.iter().any(|answer| answer == LIE),
                "{endpoint}: {key}"
            );
        }
        client.let_pass(DEMO, 200).unwrap();
        assert_eq!(
            *asked.lock().unwrap(),
            0,
            "{endpoint}: the stranger was asked"
        );
        for (key, seen) in heard.iter().zip(&all) {
            let seen = seen.lock().unwrap();
            assert!(
                !seen.iter().any(|said| said == LIE),
                "{endpoint}: {key} carries lies"
            );
        }
        let gone = gone.lock().unwrap().clone();
        assert!(!gone.contains(&SampleKind::Delete), "{endpoint}: {gone:?}");
    }
    // What may be done can be done.
    let mut handle = Handle::start(&ada(&server)).unwrap();
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    assert!(handle.process.end().unwrap().success());
}

/// A server with a token publishes nothing for whoever subscribes; one without does.
#[tokio::test(flavor = "multi_thread")]
async fn where_a_token_is_needed_state_and_clay_are_not_published() {
    for (server, is_public) in [
        (Server::with_token().unwrap(), false),
        (Server::on_free_ports().unwrap(), true),
    ] {
        let stranger = connected_to(&server.slow_endpoint()).await;
        let state = listen(&stranger, keys().state()).await;
        let bricks = listen(&stranger, keys().clay_bricks()).await;
        let options = if is_public {
            HandleOptions::new(&server.endpoint())
        } else {
            ada(&server)
        };
        let mut handle = Handle::start(&options).unwrap();
        server
            .client
            .session_when(DEMO, "a cut", PATIENCE, cuts)
            .unwrap();
        server.client.let_pass(DEMO, 1200).unwrap();
        assert!(handle.process.end().unwrap().success());
        for seen in [state, bricks] {
            assert_eq!(!seen.lock().unwrap().is_empty(), is_public);
        }
    }
}

/// The server listens on the key of each tool. What is put on a wildcard matches all of them; taken as it comes, one
/// message would cost as much as one for every tool of every session.
#[tokio::test(flavor = "multi_thread")]
async fn a_message_on_a_wildcard_is_for_no_tool() {
    const MESSAGES: u64 = 100;
    let server = Server::with_token().unwrap();
    let stranger = connected_to(&server.endpoint()).await;
    let put = async |key: String| {
        stranger
            .put(key, vec![1_u8; 100])
            .congestion_control(CongestionControl::Block)
            .await
            .unwrap();
    };
    let unheard = || server.client.session(DEMO).unwrap().control_loop.unheard;
    // Until the server's own subscriptions have come here.
    let started = Instant::now();
    while unheard() == 0 {
        assert!(started.elapsed() < PATIENCE, "the server hears nothing");
        put(keys().tool_up(1)).await;
        server.client.let_pass(DEMO, 20).unwrap();
    }
    let before = unheard();
    for _ in 0..MESSAGES {
        put(every_tool_up_in(keys().realm())).await;
    }
    // One after another on one connection: when these are counted, those have come.
    for _ in 0..MESSAGES {
        put(keys().tool_up(1)).await;
    }
    server
        .client
        .session_when(DEMO, "the last message to come", PATIENCE, |session| {
            before + MESSAGES <= session.control_loop.unheard
        })
        .unwrap();
    server.client.let_pass(DEMO, 100).unwrap();
    assert_eq!(unheard(), before + MESSAGES);
}
