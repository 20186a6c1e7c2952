//! As many sessions as a small machine may have, each with a hand that cuts: they keep their rate, or are refused.

use std::time::{Duration, Instant};

use serde_json::json;
use teleclay_proto::http::Session;
use teleclay_tests::process::{PATIENCE, wait_for};
use teleclay_tests::stage::{Handle, HandleOptions, Server};
use teleclay_tests::starved::live;

use super::endings::held;
use super::on_virtual_time;

const SESSIONS: usize = 8;
/// How long they are watched.
const WATCHED: Duration = Duration::from_secs(10);
/// Ticks that may start more than a whole tick late, in parts of all.
const MOST_LATE: f64 = 0.01;
/// The rate that is held, Hz.
const LEAST_HZ: f64 = 990.0;

#[test]
fn eight_sessions_keep_their_rate_or_are_refused_with_the_reason() {
    live(eight_sessions, on_virtual_time::eight_sessions_cut);
}

fn eight_sessions() {
    let server = Server::on_free_ports().unwrap();
    let client = &server.client;
    let mut refused = 0;
    let mut hands: Vec<(String, Handle)> = Vec::new();
    for number in 0..SESSIONS {
        let id = format!("table-{number}");
        let (status, answer) = client
            .post("/sessions", &json!({"id": id, "scheme": "force_exchange"}))
            .unwrap();
        if status == 503 {
            assert_eq!(answer["type"], "/problems/no_tick_time", "{answer}");
            refused += 1;
            continue;
        }
        assert_eq!(status, 201, "{answer}");
        let options = HandleOptions::new(&server.endpoint()).in_session(&id);
        let mut hand = Handle::start(&options).unwrap();
        let is_in = wait_for("a hand to be in or refused", PATIENCE, || {
            if hand.process.expect_alive().is_err() {
                return Some(false);
            }
            let session = client.session(&id).ok()?;
            session.tools[0].connected.then_some(true)
        });
        if is_in.unwrap() {
            hands.push((id, hand));
        } else {
            let said = hand.process.stderr();
            assert!(said.contains("more than a whole tick late") || said.contains("µs free"));
            refused += 1;
        }
    }
    let look = || -> (Instant, Vec<Session>) {
        let sessions = hands.iter().map(|(id, _)| client.session(id).unwrap());
        (Instant::now(), sessions.collect())
    };
    let (began, before) = look();
    let passed = (WATCHED.as_secs_f64() * 1000.0) as u64;
    client.let_pass(&hands[0].0, passed).unwrap();
    let (ended, after) = look();
    let watched_s = (ended - began).as_secs_f64();
    println!("{} sessions, {refused} refused", hands.len());
    for (before, after) in before.iter().zip(&after) {
        let (from, to) = (&before.control_loop, &after.control_loop);
        let ticks = (to.ticks - from.ticks) as f64;
        let late = (to.late_ticks - from.late_ticks) as f64;
        println!(
            "{}: {:.1} Hz, {late} of {ticks} late, own tick p99 {:.1} µs, thread {}",
            after.id,
            ticks / watched_s,
            to.own_tick_s.p99 * 1e6,
            to.thread
        );
        assert_eq!(held(after).len(), 1, "its hand holds on");
        assert!(LEAST_HZ < ticks / watched_s, "the rate is not held");
        assert!(late <= MOST_LATE * ticks, "late, and nobody was refused");
    }
}
