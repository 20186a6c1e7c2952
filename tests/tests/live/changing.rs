//! Changes of a running session: many at once, and its end.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use teleclay_channel::TRAILER;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{LoopStatus, ToolFrame};
use teleclay_proto::keys::SessionKeys;
use teleclay_proto::{RealmName, SessionId};
use teleclay_shell::network::{Endpoints, open};
use teleclay_tests::client::Client;
use teleclay_tests::process::PATIENCE;
use teleclay_tests::recording::greatest_force_step_n;
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Server};

use super::endings::{FORCE_STEP_N, cuts};

/// Changes of each of two clients, at this pace.
const CHANGES: u32 = 2000;
const PACE: Duration = Duration::from_millis(5);

/// What the tool frames said under each revision.
type Told = Arc<Mutex<BTreeMap<u32, (Scheme, LoopStatus)>>>;

/// Listens to the frames of tool 1.
async fn listen(endpoint: &str, told: Told) -> zenoh::Session {
    let endpoints = Endpoints::connecting(endpoint.parse().unwrap());
    let session = open(&endpoints).await.unwrap();
    let keys = SessionKeys::new(
        RealmName::new("local").unwrap(),
        SessionId::new(DEMO).unwrap(),
    );
    session
        .declare_subscriber(keys.tool_down(1))
        .callback(move |sample| {
            // Frames stay readable: only the trailer is the handle's alone to check.
            let sealed = sample.payload().to_bytes();
            let frame = ToolFrame::decode(&sealed[..sealed.len() - TRAILER]).unwrap();
            let said = (frame.header.scheme, frame.status);
            let before = told.lock().unwrap().insert(frame.header.revision, said);
            assert!(
                before.is_none_or(|before| before == said),
                "one revision, two settings"
            );
        })
        .background()
        .await
        .unwrap();
    session
}

/// The `number`th change of client `who`.
fn change(who: u32, number: u32) -> Value {
    let schemes = Scheme::ALL;
    let scheme = schemes[(number as usize + who as usize) % schemes.len()];
    match number % 6 {
        0 => json!({ "scheme": scheme }),
        1 => json!({ "material": { "viscosity_pa_s_per_m": 1e5 + f64::from(number) } }),
        2 => json!({ "scheme": scheme, "deadband": 0.01, "paused": number % 12 == 2 }),
        3 => {
            json!({ "network": { "up": { "delay_s": f64::from(number % 7) * 1e-3 } }, "paused": false })
        }
        4 => {
            json!({ "deadband": 0.0, "scheme": scheme, "material": { "yield_stress_pa": f64::from(number % 100) } })
        }
        // All that is good about it counts for nothing.
        _ => json!({ "scheme": scheme, "paused": true, "network": { "down": { "loss": 2.0 } } }),
    }
}

/// Makes its changes, and gives what each answer said: status and session.
fn make_changes(client: &Client, who: u32) -> Vec<(Value, u16, Value)> {
    let began = Instant::now();
    (0..CHANGES)
        .map(|number| {
            thread::sleep((PACE * number).saturating_sub(began.elapsed()));
            let change = change(who, number);
            let (status, answer) = client.try_to_patch(DEMO, &change).unwrap();
            if status == 200 {
                // What GET says is never older than what was answered.
                let seen = client.session(DEMO).unwrap();
                assert!(answer["revision"].as_u64().unwrap() <= seen.revision);
            }
            (change, status, answer)
        })
        .collect()
}

/// Every answer is a session or a named refusal, every change has a revision of its own, and the tool frames say of
/// each revision what its answer said.
#[tokio::test(flavor = "multi_thread")]
async fn two_clients_change_a_running_session_400_times_a_second_and_everybody_agrees_on_it() {
    let server = Server::on_free_ports().unwrap();
    let client = server.client.clone();
    let mut handle = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    let told = Told::default();
    let listening = listen(&server.endpoint(), Arc::clone(&told)).await;

    let began = Instant::now();
    let clients = [0, 1].map(|who| {
        let client = client.clone();
        thread::spawn(move || make_changes(&client, who))
    });
    let answers: Vec<_> = clients
        .into_iter()
        .flat_map(|client| client.join().unwrap())
        .collect();
    let took_s = began.elapsed().as_secs_f64();
    let after = client.session(DEMO).unwrap();
    client.let_pass(DEMO, 100).unwrap();
    listening.close().await.unwrap();
    let told = told.lock().unwrap();

    let mut by_revision = BTreeMap::new();
    let mut compared = 0;
    for (change, status, answer) in &answers {
        if *status != 200 {
            assert_eq!(*status, 422, "{change}: {answer}");
            assert_eq!(answer["pointer"], "/network/down/loss");
            continue;
        }
        let revision = answer["revision"].as_u64().unwrap();
        assert!(
            by_revision.insert(revision, answer).is_none(),
            "revision {revision} twice"
        );
        if let Some(scheme) = change["scheme"].as_str() {
            assert_eq!(answer["scheme"], scheme);
        }
        if let Some((scheme, status)) = told.get(&(revision as u32)) {
            compared += 1;
            assert_eq!(answer["scheme"], scheme.word(), "revision {revision}");
            let is_paused = *status == LoopStatus::Paused;
            assert_eq!(
                answer["state"] == "paused",
                is_paused,
                "revision {revision}"
            );
        }
    }
    println!(
        "{} changes in {took_s:.1} s: {} carried out, {compared} of them compared with tool frames",
        answers.len(),
        by_revision.len()
    );
    assert_eq!(by_revision.len(), answers.len() / 6 * 5 + answers.len() % 6);
    // A frame is lost now and then; a revision that no frame named is one that lasted for less than a tick, or whose
    // frames were.
    assert!(by_revision.len() * 9 / 10 < compared, "{compared}");
    let (last, answer) = by_revision.last_key_value().unwrap();
    assert_eq!(after.revision, *last);
    assert_eq!(answer["scheme"], after.scheme.word());

    assert!(handle.process.end().unwrap().success());
    let step_n = greatest_force_step_n(&handle.ticks().unwrap());
    assert!(step_n <= FORCE_STEP_N, "{step_n} N in a tick");
}

/// Under the replica a hand needs no frames, so silence alone would let it feel its copy of a session that is gone.
#[test]
fn a_session_that_is_deleted_lets_go_of_a_hand_on_its_copy_within_a_fifth_of_a_second() {
    let server = Server::on_free_ports().unwrap();
    let client = &server.client;
    let mut handle = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    client.delete(DEMO).unwrap();
    handle
        .process
        .logs("the server has gone: force released", PATIENCE)
        .unwrap();
    // It asks for the session until somebody ends it.
    let waited = handle.status_when("a rest", PATIENCE, |status| status["state"] == "joining");
    waited.unwrap();
    handle.process.end().unwrap();
    let rows = handle.ticks().unwrap();
    let last_heard = rows
        .iter()
        .rposition(|row| row.link_state == "live")
        .unwrap();
    let felt: Vec<f64> = rows[last_heard..].iter().map(|row| row.felt_n()).collect();
    let released = felt.iter().position(|force_n| *force_n <= 0.0).unwrap();
    println!("released {released} ticks after the last live one");
    assert!(released < 200, "{released} ticks");
    assert!(felt[released..].iter().all(|force_n| *force_n <= 0.0));
    let step_n = greatest_force_step_n(&rows);
    assert!(step_n <= FORCE_STEP_N, "{step_n} N in a tick");
}
