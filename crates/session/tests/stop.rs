//! A stop: whom it takes tools from, who gets none, how it ends, and that nothing keeps anybody from stopping.

mod bench;

use bench::{
    Bench, clear, cutting, join, kinds, new_session, patch, recovered, request, reset, stop,
    stopped, stroke,
};
use teleclay_proto::Scheme;
use teleclay_proto::http::{MAX_NAME, MAX_REASON, SessionPatch};
use teleclay_session::{EventKind, Prepared, Recovery, Refusal, Release, Rules, Session};

#[test]
fn a_stop_takes_every_tool_and_gives_none_until_it_is_cleared_and_then_only_to_those_who_join() {
    for scheme in Scheme::ALL {
        let mut bench = Bench::new(teleclay_proto::http::NewSession {
            tools: 3,
            ..cutting(*scheme)
        });
        let (mut ada, mut bob) = (bench.join("Ada").unwrap(), bench.join("Bob").unwrap());
        bench.run(300, &mut [&mut ada, &mut bob], stroke);
        assert!((0..2).all(|slot| bench.sent.iter().any(|(to, _)| *to == slot)));
        kinds(&mut bench);
        bench.command(&stop("Eve", "a hand in the way")).unwrap();
        let told = kinds(&mut bench);
        assert!(
            matches!(
                &told[..],
                [
                    EventKind::Stopped { by, reason },
                    EventKind::Released { slot: 0, lease: 1, because: Release::Stopped, .. },
                    EventKind::Released { slot: 1, lease: 2, because: Release::Stopped, .. },
                ] if **by == *"Eve" && **reason == *"a hand in the way"
            ),
            "{scheme}: {told:?}"
        );
        let removed = bench.session.clay().removed_units();
        for _ in 0..200 {
            bench.run(1, &mut [&mut ada, &mut bob], stroke);
            assert!(bench.sent.is_empty(), "{scheme}: a frame leaves");
            for slot in 0..3 {
                assert!(bench.session.side(slot).is_none());
                assert_eq!(bench.session.last_step(slot), Default::default());
            }
        }
        assert_eq!(bench.session.clay().removed_units(), removed);
        let refused = Err(stopped("Eve", "a hand in the way"));
        assert_eq!(bench.command(&join("Ada")), refused);
        assert_eq!(bench.command(&join("Joe")), refused);

        bench.command(&clear("Joe")).unwrap();
        let told = kinds(&mut bench);
        assert!(
            matches!(&told[..], [EventKind::StopCleared { by }] if **by == *"Joe"),
            "{told:?}"
        );
        assert_eq!(bench.command(&clear("Joe")), Err(Refusal::NotStopped));
        // Whoever was there sends on, and moves nothing.
        bench.run(200, &mut [&mut ada, &mut bob], stroke);
        assert_eq!(bench.session.clay().removed_units(), removed, "{scheme}");
        assert!(bench.sent.is_empty());
        let mut again = bench.join("Ada").unwrap();
        assert!(bob.lease() < again.lease());
        bench.run(300, &mut [&mut again], stroke);
        assert!(!bench.sent.is_empty());
    }
}

#[test]
fn clay_and_settings_of_a_stopped_session_can_be_changed_and_nobody_moves_by_it() {
    let mut bench = Bench::new(new_session(2));
    bench.join("Ada").unwrap();
    bench.command(&stop("Eve", "enough")).unwrap();
    assert_eq!(bench.command(&reset(None)).unwrap().clay_epoch, 2);
    let change = SessionPatch {
        scheme: Some(Scheme::Wave),
        paused: Some(true),
        ..SessionPatch::default()
    };
    bench.command(&patch(change)).unwrap();
    let exchanged = teleclay_session::ExchangedClay {
        clay: bench.session.clay().clone(),
        clay_epoch: 2,
        exchange: teleclay_session::Exchange::Undone { stroke: 0 },
        as_of_tick: bench.session.ticks(),
    };
    let mut prepared = Prepared::exchange(exchanged, bench.session.settings());
    let outcome = bench.session.handle_command(bench.now, &mut prepared);
    assert_eq!(outcome.unwrap().clay_epoch, 3);
    assert_eq!(bench.command(&join("Ada")), Err(stopped("Eve", "enough")));
    let snapshot = bench.session.snapshot();
    assert!(snapshot.stop.is_some() && snapshot.tools.iter().all(|tool| tool.holder.is_none()));
}

#[test]
fn a_join_that_was_prepared_before_a_stop_is_refused_after_it() {
    let mut bench = Bench::new(new_session(1));
    let mut prepared = Prepared::new(&join("Ada"), bench.session.settings()).unwrap();
    bench.command(&stop("Eve", "enough")).unwrap();
    let outcome = bench.session.handle_command(bench.now, &mut prepared);
    assert_eq!(outcome, Err(stopped("Eve", "enough")));
    assert!(bench.session.side(0).is_none());
    // It was not used up, and is as good as any other once the stop is over.
    bench.command(&clear("Eve")).unwrap();
    let outcome = bench.session.handle_command(bench.now, &mut prepared);
    assert!(outcome.unwrap().granted.is_some());
}

#[test]
fn a_second_stop_keeps_the_words_of_the_first_and_succeeds() {
    let mut bench = Bench::new(new_session(1));
    let first = bench.command(&stop("Eve", "enough")).unwrap();
    kinds(&mut bench);
    let second = bench.command(&stop("Joe", "me too")).unwrap();
    assert_eq!(second, first);
    assert!(kinds(&mut bench).is_empty());
    assert_eq!(bench.command(&join("Ada")), Err(stopped("Eve", "enough")));
}

/// Nobody takes events away, and every tool is held: nothing is carried out any more but a stop, and it is told whole.
#[test]
fn a_stop_finds_room_where_nothing_else_does() {
    let mut bench = Bench::new(new_session(8));
    for round in 0..3 {
        for number in 0..8 {
            bench.join(&format!("operator {number}")).unwrap();
        }
        bench.take_events();
        let nothing = patch(SessionPatch::default());
        while bench.command(&nothing).is_ok() {}
        assert_eq!(bench.command(&nothing), Err(Refusal::Busy));
        bench.command(&stop("Eve", "enough")).unwrap();
        assert_eq!(bench.command(&clear("Eve")), Err(Refusal::Busy), "{round}");
        bench.command(&stop("Joe", "me too")).unwrap();
        assert!((0..8).all(|slot| bench.session.side(slot).is_none()));
        let told = kinds(&mut bench);
        let (stopped, released) = told.split_at(told.len() - 8);
        assert!(matches!(stopped.last(), Some(EventKind::Stopped { .. })));
        assert!(released.iter().all(|kind| matches!(
            kind,
            EventKind::Released {
                because: Release::Stopped,
                ..
            }
        )));
        bench.command(&clear("Eve")).unwrap();
    }
}

/// A stop that depends on settings would be overtaken by a change of them.
#[test]
fn no_change_of_settings_overtakes_a_stop() {
    let mut bench = Bench::new(new_session(1));
    bench.join("Ada").unwrap();
    let mut prepared = Prepared::new(&stop("Eve", "enough"), bench.session.settings()).unwrap();
    bench.command(&patch(SessionPatch::default())).unwrap();
    bench.command(&reset(None)).unwrap();
    let outcome = bench.session.handle_command(bench.now, &mut prepared);
    assert!(outcome.is_ok() && bench.session.side(0).is_none());
}

#[test]
fn the_words_of_a_stop_are_made_to_fit_and_never_a_reason_not_to_stop() {
    let long = "ä".repeat(1000);
    for (by, reason, shown_by, shown_reason) in [
        ("", "", "somebody", "no reason given"),
        ("E\nve", "a\u{7}b", "E ve", "a b"),
        (
            "\u{202e}Eve\u{200b}",
            "\u{3164}\u{a0}",
            "Eve",
            "no reason given",
        ),
        (&long, &long, &long[..2 * MAX_NAME], &long[..2 * MAX_REASON]),
    ] {
        let mut bench = Bench::new(new_session(1));
        bench.command(&stop(by, reason)).unwrap();
        assert_eq!(
            bench.command(&join("Ada")),
            Err(stopped(shown_by, shown_reason))
        );
    }
    // To clear a stop is not urgent: who does it has a name.
    let mut bench = Bench::new(new_session(1));
    bench.command(&stop("Eve", "enough")).unwrap();
    for by in ["", "E\nve", "Eve\u{200b}", &long] {
        let refusal = bench.command(&clear(by)).unwrap_err();
        assert!(matches!(&refusal, Refusal::Field(error) if error.pointer == "/by"));
    }
    assert!(bench.session.snapshot().stop.is_some());
}

#[test]
fn a_stop_outlives_the_process_and_a_request_does_not() {
    let mut bench = Bench::new(new_session(2));
    let ada = bench.join("Ada").unwrap();
    bench.command(&request(1, "Bob")).unwrap();
    assert!(recovered(&bench).snapshot().tools[0].requests.is_empty());
    bench.command(&stop("Eve", "enough")).unwrap();
    let stop = bench.session.snapshot().stop;
    bench.session = recovered(&bench);
    assert_eq!(bench.session.snapshot().stop, stop);
    assert_eq!(bench.command(&join("Ada")), Err(stopped("Eve", "enough")));
    bench.command(&clear("Eve")).unwrap();
    assert!(ada.lease() < bench.join("Ada").unwrap().lease());
}

/// Of a stop whose releases were not kept any more nothing but the stop is known.
#[test]
fn a_recovered_session_that_is_stopped_has_no_holders_whatever_its_state_says() {
    let mut bench = Bench::new(new_session(1));
    bench.join("Ada").unwrap();
    let held = bench.session.snapshot().tools;
    bench.command(&stop("Eve", "enough")).unwrap();
    let mut state = bench.session.snapshot();
    state.tools = held;
    let recovery = Recovery {
        state,
        clay: bench.session.clay().clone(),
        next_lease: 2,
        decided: vec![0],
        rules: Rules::default(),
    };
    let session = Session::recover(bench.now, recovery).unwrap();
    assert!(session.side(0).is_none());
    assert_eq!(session.snapshot().tools[0].holder, None);
}
