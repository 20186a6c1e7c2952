//! Losing the server, the device, or trust in a number.

#![allow(
    clippy::float_cmp,
    reason = "a force that is released is zero, not nearly so"
)]

use std::sync::Arc;
use std::time::{Duration, Instant};

use teleclay_handle::device::DeviceCommand;
use teleclay_handle::event::Event;
use teleclay_handle::status::Status;
use teleclay_proto::frame::LoopStatus;
use teleclay_proto::join::{JoinReply, LoopParameters, RefusalCode};

use super::holder::{Holder, Quirks, Told};
use super::server::{
    Door, PUSH_N, Progress, Seen, Server, Speech, free_endpoint, keys, parameters,
};

/// Two ramps of 50 ticks run at once at most, the watchdog's and the status's: 2/50 of the push in a tick.
const FORCE_STEP_N: f64 = PUSH_N * 2.0 / 50.0 + 1e-9;
/// 1.1 N on the virtual mass of 1 kg give 1.1 mm/s in a tick; the brake takes a thirtieth of a speed that stays below
/// 0.06 m/s; and a handle that is taken over stands within a few micrometres of where it was sent.
const VELOCITY_STEP_M_S: f64 = 0.005;
/// A frame that was sent before the silence may still be on its way for this long.
const FLIGHT: Duration = Duration::from_millis(50);

/// No force and no speed steps, whatever happened.
fn assert_smooth(told: &[Told]) {
    let force = |command: &DeviceCommand| command.force_n[0];
    for pair in told.windows(2) {
        let step_n = (force(&pair[1].command) - force(&pair[0].command)).abs();
        assert!(step_n <= FORCE_STEP_N, "{step_n} N in a tick");
    }
    let x = |told: &Told| told.command.position_m[0];
    for three in told.windows(3) {
        let step_m_s = ((x(&three[2]) - x(&three[1])) - (x(&three[1]) - x(&three[0]))).abs() / 1e-3;
        assert!(step_m_s <= VELOCITY_STEP_M_S, "{step_m_s} m/s in a tick");
    }
}

/// Between the allowed silence and the return the force is there for no more than the 50 ticks of its ramp.
fn assert_released(told: &[Told], silent_since: Instant, back_at: Instant) {
    let from = silent_since + Duration::from_millis(100) + FLIGHT;
    let between: Vec<&Told> = told
        .iter()
        .filter(|told| from < told.at && told.at < back_at)
        .collect();
    let pressed = between
        .iter()
        .filter(|told| told.command.force_n != [0.0; 3])
        .count();
    assert!(
        pressed <= 51,
        "{pressed} ticks with force after the silence"
    );
    assert!(
        2 * pressed < between.len(),
        "{} ticks are too few to tell",
        between.len()
    );
}

async fn felt(holder: &mut Holder) {
    holder
        .feels("the whole push", |status| {
            (status.felt_force_n[0] + PUSH_N).abs() < 1e-9
        })
        .await;
}

async fn silent(holder: &mut Holder) {
    let line = holder
        .tells("silence", |event| {
            matches!(event, Event::Silent { .. }).then(|| event.to_string())
        })
        .await;
    assert_eq!(
        line,
        "no frame from the server for 0.1 s: force released, joining again"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_short_silence_releases_the_force_and_mends_itself() {
    let endpoint = free_endpoint();
    let server = Server::start(&endpoint, &["lab"], 1).await;
    let mut holder = Holder::start(&endpoint, Quirks::default());
    felt(&mut holder).await;
    server.speak(Speech::Silence);
    silent(&mut holder).await;
    server.speak(Speech::Frames);
    assert!(holder.goes_live().await.is_some(), "under the same lease");
    felt(&mut holder).await;
    let told = Arc::clone(&holder.told);
    let until = told.lock().unwrap().len();
    let ending = holder.ends().await;
    ending.outcome.unwrap();
    assert_eq!(ending.summary.joins, 1);
    let told = told.lock().unwrap();
    assert_smooth(&told);
    let least_n = |told: &[Told]| {
        told.iter()
            .map(|told| told.command.force_n[0].abs())
            .fold(PUSH_N, f64::min)
    };
    let pressed = told
        .iter()
        .position(|told| PUSH_N - 1e-9 < told.command.force_n[0].abs())
        .expect("it was felt");
    assert!(
        least_n(&told[pressed..until]) < PUSH_N,
        "the force gave way"
    );
}

/// Queries are answered and frames are not: the lease is of no use, so it is given back and another one asked for.
#[tokio::test(flavor = "multi_thread")]
async fn a_lease_without_frames_is_exchanged_for_another() {
    let endpoint = free_endpoint();
    let mut server = Server::start(&endpoint, &["lab"], 1).await;
    let mut holder = Holder::start(&endpoint, Quirks::default());
    felt(&mut holder).await;
    let silent_since = server.speak(Speech::Silence);
    silent(&mut holder).await;
    server
        .sees("the old lease", |seen| {
            (seen == Seen::Leave(1)).then_some(())
        })
        .await;
    let [_, before] = *server.mood.numbers.lock().unwrap();
    assert_eq!(holder.joins().await, 2);
    let back_at = server.speak(Speech::Frames);
    assert_eq!(holder.goes_live().await, None, "another lease");
    let [first, _] = *server.mood.numbers.lock().unwrap();
    assert!(500 < before && before < first, "the same handle side");
    felt(&mut holder).await;
    let (told, opened) = (Arc::clone(&holder.told), Arc::clone(&holder.opened));
    let ending = holder.ends().await;
    ending.outcome.unwrap();
    assert_eq!((ending.summary.joins, ending.summary.lease), (2, 2));
    assert_eq!(opened.lock().unwrap().len(), 1, "the device stays open");
    assert_smooth(&told.lock().unwrap());
    assert_released(&told.lock().unwrap(), silent_since, back_at);
}

/// A server is killed, and one that has come so far serves the same endpoint. Gives the number of the last frame that
/// the first heard, and of the first that the second did.
async fn killed(next: Progress) -> [u32; 2] {
    let endpoint = free_endpoint();
    let server = Server::start(&endpoint, &["lab"], 1).await;
    let mood = Arc::clone(&server.mood);
    let mut holder = Holder::start(&endpoint, Quirks::default());
    felt(&mut holder).await;
    let silent_since = Instant::now();
    server.kill().await;
    silent(&mut holder).await;
    holder
        .feels("nothing", |status| status.felt_force_n == [0.0; 3])
        .await;
    let back_at = Instant::now();
    let mut server = Server::recover(&endpoint, &["lab"], 100, parameters(), next).await;
    assert_eq!(holder.joins().await, 100);
    server
        .sees("frames under the new lease", |seen| {
            (seen == Seen::FirstFrame(100)).then_some(())
        })
        .await;
    assert_eq!(holder.goes_live().await, None, "another lease");
    felt(&mut holder).await;
    let (told, opened) = (Arc::clone(&holder.told), Arc::clone(&holder.opened));
    holder.ends().await.outcome.unwrap();
    assert_eq!(opened.lock().unwrap().len(), 1, "the device stays open");
    assert_smooth(&told.lock().unwrap());
    assert_released(&told.lock().unwrap(), silent_since, back_at);
    let [_, last] = *mood.numbers.lock().unwrap();
    let [first, _] = *server.mood.numbers.lock().unwrap();
    [last, first]
}

/// The session of that name knows nothing of what the hand has done: its frames are numbered anew.
#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_comes_back_with_a_session_made_anew_is_joined_again_without_a_step() {
    let [last, first] = killed(Progress {
        ownership_epoch: 1,
        revision: 0,
    })
    .await;
    assert!(first < last, "frame {first} after {last}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_comes_back_with_the_session_finds_the_same_handle_side() {
    let [last, first] = killed(Progress {
        ownership_epoch: 2,
        revision: 0,
    })
    .await;
    // A second and more went by without anybody who heard.
    assert!(last + 100 < first, "frame {first} after {last}");
}

/// What was under a lease that the server itself has ended is over with it, though the session is the same.
#[tokio::test(flavor = "multi_thread")]
async fn after_a_lease_that_was_taken_back_the_handle_begins_anew() {
    let endpoint = free_endpoint();
    let mut server = Server::start(&endpoint, &["lab"], 1).await;
    let mut holder = Holder::start(&endpoint, Quirks::default());
    felt(&mut holder).await;
    server.take_back("the lesson is over").await;
    holder
        .tells("that the tool is taken back", |event| {
            matches!(event, Event::TakenBack { reason } if reason == "the lesson is over")
                .then_some(())
        })
        .await;
    let [_, last] = *server.mood.numbers.lock().unwrap();
    assert_eq!(holder.joins().await, 2);
    server
        .sees("frames under the new lease", |seen| {
            (seen == Seen::FirstFrame(2)).then_some(())
        })
        .await;
    let [first, _] = *server.mood.numbers.lock().unwrap();
    assert!(first < last, "frame {first} after {last}");
    felt(&mut holder).await;
    let told = Arc::clone(&holder.told);
    holder.ends().await.outcome.unwrap();
    assert_smooth(&told.lock().unwrap());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_comes_back_with_another_tick_finds_the_device_opened_anew() {
    let endpoint = free_endpoint();
    let server = Server::start(&endpoint, &["lab"], 1).await;
    let mut holder = Holder::start(&endpoint, Quirks::default());
    felt(&mut holder).await;
    server.kill().await;
    silent(&mut holder).await;
    let slower = LoopParameters {
        tick_s: 2e-3,
        ..parameters()
    };
    let _server = Server::start_with(&endpoint, &["other"], 100, slower).await;
    assert_eq!(holder.joins().await, 100);
    holder.goes_live().await;
    let opened = Arc::clone(&holder.opened);
    holder.ends().await.outcome.unwrap();
    let ticks: Vec<f64> = opened
        .lock()
        .unwrap()
        .iter()
        .map(|setup| setup.tick_s)
        .collect();
    assert_eq!(ticks, [1e-3, 2e-3]);
}

/// The place of a lease that was lost is free again only when the lease ends: until then a full session is no refusal.
#[tokio::test(flavor = "multi_thread")]
async fn a_place_that_the_lost_lease_still_holds_is_waited_for() {
    let endpoint = free_endpoint();
    let mut server = Server::start(&endpoint, &["lab"], 1).await;
    let mut holder = Holder::start(&endpoint, Quirks::default());
    holder.goes_live().await;
    let full = JoinReply::Refused {
        code: RefusalCode::NoFreeTool,
        reason: "held by Ada".to_owned(),
        holder: None,
    };
    *server.mood.door.lock().unwrap() = Door::Says(serde_json::to_vec(&full).unwrap());
    server.speak(Speech::Silence);
    silent(&mut holder).await;
    for _ in 0..3 {
        server
            .sees("a join", |seen| matches!(seen, Seen::Join(_)).then_some(()))
            .await;
    }
    *server.mood.door.lock().unwrap() = Door::Open(Box::new(parameters()));
    server.speak(Speech::Frames);
    assert_eq!(holder.joins().await, 2);
    holder.ends().await.outcome.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn time_that_runs_out_without_a_server_is_a_failure() {
    let endpoint = free_endpoint();
    let server = Server::start(&endpoint, &["lab"], 1).await;
    let mut holder = Holder::start_for(&endpoint, Duration::from_secs(8));
    holder.goes_live().await;
    server.kill().await;
    silent(&mut holder).await;
    let failure = holder.ended().await.outcome.unwrap_err();
    assert_eq!(failure.exit_code(), 4, "{failure}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_paused_session_and_one_in_fault_release_the_force_until_they_go_on() {
    let endpoint = free_endpoint();
    let server = Server::start(&endpoint, &["lab"], 1).await;
    let mut holder = Holder::start(&endpoint, Quirks::default());
    felt(&mut holder).await;
    for (status, is_told) in [
        (
            LoopStatus::Paused,
            (|event| matches!(event, Event::Paused)) as fn(&Event) -> bool,
        ),
        (LoopStatus::Fault, |event| {
            matches!(event, Event::SessionFault)
        }),
    ] {
        *server.mood.status.lock().unwrap() = status;
        holder
            .tells("a release", |event| is_told(event).then_some(()))
            .await;
        holder
            .feels("no force", |status| status.felt_force_n == [0.0; 3])
            .await;
        *server.mood.status.lock().unwrap() = LoopStatus::Running;
        assert!(holder.goes_live().await.is_some());
        felt(&mut holder).await;
    }
    let told = Arc::clone(&holder.told);
    holder.ends().await.outcome.unwrap();
    assert_smooth(&told.lock().unwrap());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_number_that_is_none_ends_in_a_fault_without_force() {
    let endpoint = free_endpoint();
    let mut server = Server::start(&endpoint, &["lab"], 1).await;
    let mut holder = Holder::start(&endpoint, Quirks::default());
    felt(&mut holder).await;
    server.speak(Speech::NotANumber);
    let told = Arc::clone(&holder.told);
    let failure = holder.ended().await.outcome.unwrap_err();
    assert_eq!(failure.exit_code(), 3);
    assert_eq!(
        failure.to_string(),
        "fault: force_n is not finite; force released"
    );
    server
        .sees("a goodbye", |seen| (seen == Seen::Goodbye(1)).then_some(()))
        .await;
    server
        .sees("the lease back", |seen| {
            (seen == Seen::Leave(1)).then_some(())
        })
        .await;
    assert_eq!(
        told.lock().unwrap().last().unwrap().command.force_n,
        [0.0; 3]
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sensor_that_gives_no_number_ends_in_a_fault_without_force() {
    let endpoint = free_endpoint();
    let mut server = Server::start(&endpoint, &["lab"], 1).await;
    let holder = Holder::start(
        &endpoint,
        Quirks {
            blind_from: Some(500),
            ..Quirks::default()
        },
    );
    let told = Arc::clone(&holder.told);
    let failure = holder.ended().await.outcome.unwrap_err();
    assert_eq!(failure.exit_code(), 3);
    assert!(
        failure
            .to_string()
            .contains("device velocity_m_s is not finite"),
        "{failure}"
    );
    server
        .sees("the lease back", |seen| {
            (seen == Seen::Leave(1)).then_some(())
        })
        .await;
    let told = told.lock().unwrap();
    assert_eq!(told.last().unwrap().command.force_n, [0.0; 3]);
    assert!(
        told.iter()
            .all(|told| told.command.position_m.iter().all(|x| x.is_finite()))
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_device_that_is_lost_ends_the_run_and_gives_the_lease_back() {
    let endpoint = free_endpoint();
    let mut server = Server::start(&endpoint, &["lab"], 1).await;
    let holder = Holder::start(
        &endpoint,
        Quirks {
            lost_at: Some(300),
            ..Quirks::default()
        },
    );
    let failure = holder.ended().await.outcome.unwrap_err();
    assert_eq!(
        (failure.exit_code(), failure.to_string().as_str()),
        (3, "recorder is lost: unplugged; force released")
    );
    server
        .sees("the lease back", |seen| {
            (seen == Seen::Leave(1)).then_some(())
        })
        .await;
}

/// Anybody can show the session's sign of life and take it away. What is true shows in the frames.
#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_said_to_be_gone_is_believed_once_it_is_silent() {
    let endpoint = free_endpoint();
    let server = Server::start(&endpoint, &["lab"], 1).await;
    let mut holder = Holder::start(&endpoint, Quirks::default());
    felt(&mut holder).await;
    for _ in 0..3 {
        let sign = server.slow.liveliness().declare_token(keys().alive());
        let sign = sign.await.unwrap();
        let received = |least: u64| move |status: &Status| least <= status.received;
        let so_far = holder.feels("frames", received(1)).await.received;
        holder.feels("more", received(so_far + 1)).await;
        sign.undeclare().await.unwrap();
        let status = holder.feels("and more", received(so_far + 1500)).await;
        assert_eq!(status.joins, 1, "it was let go of");
    }
    let sign = server.slow.liveliness().declare_token(keys().alive());
    let sign = sign.await.unwrap();
    let received = |status: &Status| 0 < status.received;
    holder.feels("frames", received).await;
    server.speak(Speech::Silence);
    sign.undeclare().await.unwrap();
    holder
        .tells("that the server has gone", |event| {
            matches!(event, Event::ServerGone).then_some(())
        })
        .await;
    server.speak(Speech::Frames);
    holder.ends().await.outcome.unwrap();
}
