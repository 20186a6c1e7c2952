//! Coming in, being kept out, and leaving.

use std::time::Duration;

use teleclay_handle::JoinError;
use teleclay_handle::device::DeviceError;
use teleclay_handle::event::Event;
use teleclay_handle::run::Failure;
use teleclay_handle::status::State;
use teleclay_proto::PROTOCOL;
use teleclay_proto::join::{FreshReply, JoinReply, JoinRequest, LoopParameters, RefusalCode};
use teleclay_proto::keys::Leaf;

use super::PATIENCE;
use super::holder::{Holder, Quirks};
use super::server::{Door, PUSH_N, Seen, Server, Speech, free_endpoint, keys, parameters};

#[tokio::test(flavor = "multi_thread")]
async fn a_handle_joins_feels_and_leaves() {
    let endpoint = free_endpoint();
    let mut server = Server::start(&endpoint, &["lab"], 7).await;
    let presence = server
        .slow
        .liveliness()
        .declare_subscriber(keys().key(Leaf::Operator(7)))
        .await
        .unwrap();
    let mut holder = Holder::start(&endpoint, Quirks::default());

    let request = server
        .sees("a join", |seen| {
            if let Seen::Join(request) = seen {
                Some(request)
            } else {
                None
            }
        })
        .await;
    let wanted = JoinRequest {
        protocol: PROTOCOL,
        operator: "Ada".to_owned(),
        device: "recorder".to_owned(),
    };
    assert_eq!(request, wanted);
    assert_eq!(holder.joins().await, 7);
    assert_eq!(holder.goes_live().await, None);
    let token = tokio::time::timeout(PATIENCE, presence.recv_async())
        .await
        .expect("it shows")
        .unwrap();
    assert_eq!(token.key_expr().as_str(), keys().operator(7));
    holder
        .feels("the whole push", |status| {
            (status.felt_force_n[0] + PUSH_N).abs() < 1e-9
        })
        .await;

    let ending = holder.ends().await;
    ending.outcome.unwrap();
    assert_eq!(ending.summary.state, State::Leaving);
    assert_eq!((ending.summary.joins, ending.summary.lease), (1, 7));
    assert!(
        100 < ending.summary.ticks && 50 < ending.summary.received,
        "{}",
        ending.summary
    );
    assert!(
        0.0 < ending.summary.rtt_s.p50 && ending.summary.rtt_s.p50 <= ending.summary.reaction_s.max
    );
    server
        .sees("a goodbye", |seen| (seen == Seen::Goodbye(7)).then_some(()))
        .await;
    server
        .sees("the lease back", |seen| {
            (seen == Seen::Leave(7)).then_some(())
        })
        .await;
    let gone = tokio::time::timeout(PATIENCE, presence.recv_async())
        .await
        .expect("it goes")
        .unwrap();
    assert_eq!(gone.kind(), zenoh::sample::SampleKind::Delete);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_handle_that_is_refused_says_why() {
    let endpoint = free_endpoint();
    let server = Server::start(&endpoint, &["lab"], 1).await;
    let reason = "the only tool of session `demo` is held by Bob".to_owned();
    let refusal = JoinReply::Refused {
        code: RefusalCode::NoFreeTool,
        reason: reason.clone(),
        holder: None,
    };
    *server.mood.door.lock().unwrap() = Door::Says(serde_json::to_vec(&refusal).unwrap());
    let failure = Holder::start(&endpoint, Quirks::default())
        .ended()
        .await
        .outcome
        .unwrap_err();
    assert_eq!(failure.exit_code(), 2);
    let text = failure.to_string();
    assert!(
        matches!(
            &failure,
            Failure::Join {
                source: JoinError::Refused {
                    code: RefusalCode::NoFreeTool,
                    ..
                },
                ..
            }
        ),
        "{text}"
    );
    let said = std::error::Error::source(&failure).unwrap().to_string();
    assert!(said.contains(&reason), "{said}");
}

/// A server that is about to stop may be followed by one that is not.
#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_about_to_stop_is_asked_again() {
    let endpoint = free_endpoint();
    let mut server = Server::start(&endpoint, &["lab"], 1).await;
    let refusal = JoinReply::Refused {
        code: RefusalCode::ShuttingDown,
        reason: "stopping".to_owned(),
        holder: None,
    };
    *server.mood.door.lock().unwrap() = Door::Says(serde_json::to_vec(&refusal).unwrap());
    let mut holder = Holder::start(&endpoint, Quirks::default());
    for _ in 0..3 {
        server
            .sees("a join", |seen| matches!(seen, Seen::Join(_)).then_some(()))
            .await;
    }
    *server.mood.door.lock().unwrap() = Door::Open(Box::new(parameters()));
    holder.joins().await;
    holder.ends().await.outcome.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_cannot_be_used_is_named_and_nothing_is_built_from_it() {
    let impossible = LoopParameters {
        force_limit_n: 1e9,
        ..parameters()
    };
    let granted = {
        let mut granted = serde_json::to_value(impossible).unwrap();
        granted["force_limit_n"] = 1e9.into();
        let clay = serde_json::json!({
            "shape": {"kind": "block", "size_m": [0.128, 0.064, 0.064]}, "voxel_size_m": 5e-4, "epoch": 1, "revision": 0,
        });
        serde_json::json!({
            "outcome": "granted", "lease": 1, "ownership_epoch": 1, "node": "lab", "tool": 1, "lease_s": 5.0, "parameters": granted, "clay": clay, "slow_endpoint": null,
        })
    };
    for (answer, complaint) in [
        (b"come in".to_vec(), "line 1"),
        (br#"{"outcome":"granted"}"#.to_vec(), "lease"),
        (
            granted.to_string().into_bytes(),
            "/parameters/force_limit_n",
        ),
        (vec![b' '; 100_000], "100000 bytes"),
    ] {
        let endpoint = free_endpoint();
        let server = Server::start(&endpoint, &["lab"], 1).await;
        *server.mood.door.lock().unwrap() = match answer.len() {
            100_000 => Door::Shouts(answer),
            _ => Door::Says(answer),
        };
        let holder = Holder::start(&endpoint, Quirks::default());
        let opened = std::sync::Arc::clone(&holder.opened);
        let failure = holder.ended().await.outcome.unwrap_err();
        assert_eq!(failure.exit_code(), 2);
        let said = std::error::Error::source(&failure).unwrap().to_string();
        assert!(said.contains(complaint), "{said}");
        assert!(opened.lock().unwrap().is_empty());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lease_without_a_device_is_given_back() {
    let endpoint = free_endpoint();
    let mut server = Server::start(&endpoint, &["lab"], 3).await;
    let unplugged = || DeviceError::Lost {
        device: "omega".to_owned(),
        reason: "not found".to_owned(),
    };
    let holder = Holder::start_with(&endpoint, Box::new(move |_| Err(unplugged())));
    let failure = holder.ended().await.outcome.unwrap_err();
    assert_eq!(
        (failure.exit_code(), failure.to_string().as_str()),
        (1, "the device: omega is lost: not found")
    );
    server
        .sees("the lease back", |seen| {
            (seen == Seen::Leave(3)).then_some(())
        })
        .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_handle_waits_for_its_server() {
    let endpoint = free_endpoint();
    let mut holder = Holder::start(&endpoint, Quirks::default());
    holder
        .tells("waiting", |event| {
            matches!(event, Event::Waiting { others, .. } if others.is_empty()).then_some(())
        })
        .await;
    let _server = Server::start(&endpoint, &["lab"], 1).await;
    holder.joins().await;
    holder.goes_live().await;
    holder.ends().await.outcome.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_handle_gives_up_when_its_time_is_over() {
    let ending = Holder::start_for(&free_endpoint(), Duration::from_millis(700))
        .ended()
        .await;
    let failure = ending.outcome.unwrap_err();
    assert_eq!(failure.exit_code(), 4);
    assert!(
        failure
            .to_string()
            .contains("no server answers on tcp/127.0.0.1:"),
        "{failure}"
    );
    assert_eq!(
        (ending.summary.ticks, ending.summary.state),
        (0, State::Joining)
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn of_two_servers_one_is_taken_and_the_other_gets_its_lease_back() {
    let endpoint = free_endpoint();
    let mut server = Server::start(&endpoint, &["here", "there"], 1).await;
    let mut holder = Holder::start(&endpoint, Quirks::default());
    let lease = holder.joins().await;
    let left = server
        .sees("a lease back", |seen| {
            if let Seen::Leave(lease) = seen {
                Some(lease)
            } else {
                None
            }
        })
        .await;
    assert_eq!(left, 3 - lease, "leases 1 and 2 were given");
    holder.goes_live().await;
    holder.ends().await.outcome.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn garbage_reaches_no_hand() {
    let endpoint = free_endpoint();
    let server = Server::start(&endpoint, &["lab"], 1).await;
    server.speak(Speech::FramesAmidGarbage);
    let mut holder = Holder::start(&endpoint, Quirks::default());
    holder
        .feels("garbage and frames", |status| {
            300 < status.rejected && 50 < status.received
        })
        .await;
    let told = std::sync::Arc::clone(&holder.told);
    let ending = holder.ends().await;
    ending.outcome.unwrap();
    assert_eq!(ending.summary.joins, 1);
    let most = told
        .lock()
        .unwrap()
        .iter()
        .map(|told| told.command.force_n[0].abs())
        .fold(0.0, f64::max);
    assert!(most <= PUSH_N, "{most} N");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_operator_who_is_through_gets_fresh_clay_or_the_reason_why_not() {
    let refused = FreshReply::Refused {
        reason: "the session is paused".to_owned(),
    };
    for (reply, said) in [
        (FreshReply::Fresh { epoch: 9 }, "fresh clay, block 9"),
        (refused, "no fresh clay: the session is paused"),
    ] {
        let endpoint = free_endpoint();
        let mut server = Server::start(&endpoint, &["lab"], 5).await;
        *server.mood.fresh.lock().unwrap() = reply;
        let mut holder = Holder::start(
            &endpoint,
            Quirks {
                asks_at: Some(50),
                ..Quirks::default()
            },
        );
        server
            .sees("the request", |seen| (seen == Seen::Fresh(5)).then_some(()))
            .await;
        holder
            .tells("the answer", |event| {
                matches!(event, Event::FreshClay { .. } | Event::NoFreshClay { .. })
                    .then(|| event.to_string())
            })
            .await
            .eq(said)
            .then_some(())
            .expect("it says what was answered");
        let ending = holder.ends().await;
        ending.outcome.unwrap();
        assert_eq!(ending.summary.rounds, 1);
    }
}
