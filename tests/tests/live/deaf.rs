//! Somebody who asks again and again and reads no answer.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use teleclay_tests::process::PATIENCE;
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Server};

use super::endings::cuts;
use super::strangers::{connected_to, keys};

/// As often as questions came that once kept every operator waiting for seconds.
const QUESTIONS_AT_ONCE: usize = 60;
const EVERY: Duration = Duration::from_millis(100);
const LASTS: Duration = Duration::from_secs(5);
/// Zenoh waits a second for a reader before it gives a connection up.
const SILENT_AT_MOST_S: f64 = 1.5;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_asker_who_reads_nothing_silences_nobody() {
    let server = Server::on_free_ports().unwrap();
    let client = &server.client;
    let mut handle = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    let deaf = connected_to(&server.slow_endpoint()).await;
    // Whoever waits for this reads nothing more.
    let is_over = Arc::new(AtomicBool::new(false));
    let (began, mut asked) = (Instant::now(), 0);
    {
        let mut next = tokio::time::interval(EVERY);
        while began.elapsed() < LASTS {
            next.tick().await;
            for _ in 0..QUESTIONS_AT_ONCE {
                let is_over = Arc::clone(&is_over);
                let asking = deaf.get(keys().clay_snapshot()).callback(move |_| {
                    while !is_over.load(Ordering::Relaxed) {
                        std::thread::park_timeout(EVERY);
                    }
                });
                // Its own line may be full by then.
                let within = Duration::from_millis(50);
                asked += usize::from(tokio::time::timeout(within, asking).await.is_ok());
            }
        }
    }
    is_over.store(true, Ordering::Relaxed);
    assert!(200 < asked, "{asked} questions were asked");
    assert!(handle.process.end().unwrap().success());
    let rows = handle.ticks().unwrap();
    let heard = rows.iter().skip_while(|row| row.link_state == "not_yet");
    let silent_s = heard.map(|row| row.silence_s).fold(0.0, f64::max);
    println!("{asked} questions; longest silence {silent_s:.3} s");
    assert!(silent_s < SILENT_AT_MOST_S, "{silent_s} s without a frame");
}
