//! The rules of a session, each at its boundary, on virtual time.

mod bench;

use bench::{Bench, Hand, cutting, engaged_at, join, kinds, new_session, patch, reset, stroke};
use teleclay_proto::Scheme;
use teleclay_proto::frame::{Engagement, HandleFrame, LoopStatus, SweepRecord, SweepRefusal};
use teleclay_proto::http::{ClayReset, ClayShape, SessionPatch};
use teleclay_session::{Command, EventKind, Refusal, Release};

#[test]
fn an_operator_takes_a_tool_is_heard_and_leaves_and_each_is_told_once() {
    let mut bench = Bench::new(new_session(2));
    let mut ada = bench.join("Ada").unwrap();
    bench.run(5, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    let told = kinds(&mut bench);
    assert!(
        matches!(&told[..], [
            EventKind::Taken { slot: 0, lease: 1, operator },
            EventKind::Connected { slot: 0 },
        ] if operator.name == "Ada"),
        "{told:?}"
    );
    bench.command(&Command::Leave { lease: 1 }).unwrap();
    let told = kinds(&mut bench);
    assert!(
        matches!(
            &told[..],
            [EventKind::Released {
                slot: 0,
                lease: 1,
                because: Release::Left,
                ..
            }]
        ),
        "{told:?}"
    );
    assert_eq!(
        bench.command(&Command::Leave { lease: 1 }),
        Err(Refusal::NoSuchLease { lease: 1 })
    );
}

#[test]
fn a_tool_is_taken_over_just_after_150_ms_of_silence_and_not_before() {
    for (silent_ms, is_taken) in [(149, false), (152, true)] {
        let mut bench = Bench::new(new_session(1));
        let mut ada = bench.join("Ada").unwrap();
        // Its first second is over.
        bench.run(1100, &mut [&mut ada], |_| engaged_at([0.0; 3]));
        bench.run(silent_ms, &mut [], |_| HandleFrame::default());
        kinds(&mut bench);
        let joined = bench.join("Bob");
        assert_eq!(joined.is_ok(), is_taken, "after {silent_ms} ms");
        let told = kinds(&mut bench);
        if is_taken {
            assert!(
                matches!(
                    &told[..],
                    [
                        EventKind::Released {
                            lease: 1,
                            because: Release::TakenOver,
                            ..
                        },
                        EventKind::Taken { lease: 2, .. },
                    ]
                ),
                "{told:?}"
            );
        } else {
            assert_eq!(joined.unwrap_err(), Refusal::NoFreeTool { tools: 1 });
            assert!(told.is_empty(), "{told:?}");
        }
    }
}

#[test]
fn a_new_holder_that_was_not_heard_yet_keeps_the_tool_for_a_second() {
    let mut bench = Bench::new(new_session(1));
    bench.join("Ada").unwrap();
    bench.run(999, &mut [], |_| HandleFrame::default());
    assert!(bench.join("Bob").is_err());
    bench.run(3, &mut [], |_| HandleFrame::default());
    assert!(bench.join("Bob").is_ok());
}

#[test]
fn a_lease_runs_out_ten_seconds_after_the_last_frame() {
    let mut bench = Bench::new(new_session(1));
    let mut ada = bench.join("Ada").unwrap();
    bench.run(100, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    bench.run(9_990, &mut [], |_| HandleFrame::default());
    let told = kinds(&mut bench);
    assert!(matches!(
        told.last(),
        Some(EventKind::Disconnected { slot: 0 })
    ));
    bench.run(20, &mut [], |_| HandleFrame::default());
    let told = kinds(&mut bench);
    assert!(
        matches!(
            &told[..],
            [EventKind::Released {
                because: Release::RanOut,
                ..
            }]
        ),
        "{told:?}"
    );
}

/// A lost operator who comes back gets the tool that stands where it was left, not the first free one.
#[test]
fn who_comes_back_gets_the_own_tool() {
    let mut bench = Bench::new(new_session(3));
    let first = bench.join("Bob").unwrap();
    let own = bench.join("Ada").unwrap();
    bench.run(1_200, &mut [], |_| HandleFrame::default());
    bench
        .command(&Command::Leave {
            lease: first.lease(),
        })
        .unwrap();
    let again = bench.join("Ada").unwrap();
    assert_eq!(again.slot, own.slot);
    assert_ne!(again.lease(), own.lease());
}

#[test]
fn only_who_holds_a_tool_may_ask_for_a_fresh_block_under_a_lease() {
    let mut bench = Bench::new(new_session(1));
    let ada = bench.join("Ada").unwrap();
    assert_eq!(
        bench.command(&reset(Some(9))),
        Err(Refusal::NoSuchLease { lease: 9 })
    );
    assert_eq!(bench.session.clay_epoch(), 1);
    assert_eq!(
        bench.command(&reset(Some(ada.lease()))).unwrap().clay_epoch,
        2
    );
    // Whoever may change the session needs none.
    assert_eq!(bench.command(&reset(None)).unwrap().clay_epoch, 3);
}

#[test]
fn an_idle_hand_does_not_drive_and_the_first_engaged_frame_puts_the_tool_there_without_a_cut() {
    let mut bench = Bench::new(cutting(Scheme::PositionForce));
    let mut ada = bench.join("Ada").unwrap();
    let idle = |tick| HandleFrame {
        engagement: Engagement::Idle,
        ..stroke(tick)
    };
    // The ball touches the block where it stands.
    bench.run(1, &mut [&mut ada], idle);
    let touched = bench.session.clay().removed_units();
    bench.run(500, &mut [&mut ada], idle);
    assert_eq!(bench.session.clay().removed_units(), touched);
    assert!(matches!(
        kinds(&mut bench)[..],
        [EventKind::Taken { .. }, EventKind::Connected { slot: 0 }]
    ));
    assert_eq!(bench.sent[0].1.status, LoopStatus::Idle);
    bench.run(1, &mut [&mut ada], |_| stroke(0));
    let home_m = bench.session.settings().parameters.home_m;
    assert!((bench.sent[0].1.position_m[2] - (home_m[2] - 0.004)).abs() < 1e-12);
    bench.run(500, &mut [&mut ada], stroke);
    assert!(touched < bench.session.clay().removed_units());
    assert_eq!(bench.sent[0].1.status, LoopStatus::Running);
}

#[test]
fn a_hand_that_is_idle_or_leaving_stops_its_tool_within_the_ramp() {
    for engagement in [Engagement::Idle, Engagement::Leaving] {
        let mut bench = Bench::new(cutting(Scheme::PositionForce));
        let mut ada = bench.join("Ada").unwrap();
        bench.run(300, &mut [&mut ada], stroke);
        let stopping = |tick| HandleFrame {
            engagement,
            ..stroke(300 + tick)
        };
        bench.run(51, &mut [&mut ada], stopping);
        let removed = bench.session.clay().removed_units();
        assert!(0 < removed);
        bench.run(300, &mut [&mut ada], stopping);
        assert_eq!(
            bench.session.clay().removed_units(),
            removed,
            "{engagement}"
        );
    }
}

/// What a leaving holder has cut is merged before the tool is free.
#[test]
fn a_tool_is_free_once_its_leaving_holder_has_nothing_left_to_merge() {
    let mut bench = Bench::new(cutting(Scheme::Replica));
    let mut ada = bench.join("Ada").unwrap();
    let sweep = |sequence: u32| SweepRecord {
        sequence,
        from: [0, 0, sequence as i32],
        to: [0, 0, sequence as i32 + 1],
    };
    let carrying = |numbers: &[u32], oldest| {
        let mut frame = HandleFrame {
            engagement: Engagement::Leaving,
            copy: teleclay_proto::frame::CopyState::Live,
            ..HandleFrame::default()
        };
        frame.sweeps.oldest_unacknowledged = oldest;
        for number in numbers {
            frame.sweeps.push(sweep(*number)).unwrap();
        }
        frame
    };
    // Numbers 1 and 3 have come, 2 is under way.
    bench.run(20, &mut [&mut ada], |_| carrying(&[1, 3], 1));
    assert!(bench.session.side(0).is_some());
    bench.run(1, &mut [&mut ada], |_| carrying(&[2], 2));
    bench.run(1, &mut [&mut ada], |_| carrying(&[], 4));
    assert!(bench.session.side(0).is_none());
    // A gap that is never filled is waited for half a second.
    let mut bob = bench.join("Bob").unwrap();
    bench.run(499, &mut [&mut bob], |_| carrying(&[2], 1));
    assert!(bench.session.side(0).is_some());
    bench.run(5, &mut [&mut bob], |_| carrying(&[2], 1));
    assert!(bench.session.side(0).is_none());
}

fn a_sweep(hand: &Hand, epoch: u32) -> HandleFrame {
    let mut frame = HandleFrame {
        engagement: Engagement::Engaged,
        copy: teleclay_proto::frame::CopyState::Live,
        ..HandleFrame::default()
    };
    frame.header = hand.header;
    frame.header.clay_epoch = epoch;
    let pushed = frame.sweeps.push(SweepRecord {
        sequence: 1,
        from: [0; 3],
        to: [1; 3],
    });
    pushed.unwrap();
    frame.sweeps.oldest_unacknowledged = 1;
    frame
}

#[test]
fn a_sweep_of_a_block_that_is_gone_is_refused_once_and_by_its_reason() {
    let mut bench = Bench::new(cutting(Scheme::Replica));
    let mut ada = bench.join("Ada").unwrap();
    bench.run(1, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    bench.command(&reset(None)).unwrap();
    bench.tick();
    let touched = bench.session.clay().removed_units();
    // On its way when the block was exchanged, and repeated.
    for _ in 0..5 {
        let carried = a_sweep(&ada, 1);
        let mut frame = ada.frame(bench.now, carried);
        frame.header.clay_epoch = 1;
        bench.session.handle_frame(bench.now, 0, &frame);
        bench.tick();
    }
    let (_, told) = bench.sent[0];
    assert_eq!(told.refusal, SweepRefusal::WrongEpoch);
    assert_eq!((told.sweeps_refused, told.sweeps_acknowledged), (1, 1));
    assert_eq!(bench.session.clay().removed_units(), touched);
    assert_eq!(
        bench.session.side(0).unwrap().view().refusal,
        SweepRefusal::WrongEpoch
    );
}

#[test]
fn a_frame_meant_for_an_earlier_server_of_the_session_is_not_acted_on_and_its_sweeps_are_not_decided()
 {
    let mut bench = Bench::new(cutting(Scheme::Replica));
    let mut ada = bench.join("Ada").unwrap();
    bench.run(3, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    let mut foreign = ada.clone();
    foreign.header.ownership_epoch += 1;
    let sweep = a_sweep(&ada, 1);
    bench.run(3, &mut [&mut foreign], |_| sweep.clone());
    let (_, told) = bench.sent[0];
    assert_eq!(told.refusal, SweepRefusal::WrongOwner);
    assert_eq!((told.sweeps_refused, told.sweeps_acknowledged), (0, 0));
    ada.header.sequence += 3;
    bench.run(2, &mut [&mut ada], |_| sweep.clone());
    let (_, told) = bench.sent[0];
    assert_eq!(told.refusal, SweepRefusal::None);
    assert_eq!((told.sweeps_refused, told.sweeps_acknowledged), (0, 1));
}

#[test]
fn a_fault_is_one_tools_and_ends_with_its_holder_or_a_fresh_block() {
    let mut bench = Bench::new(new_session(3));
    let mut ada = bench.join("Ada").unwrap();
    bench.run(110, &mut [&mut ada], |_| engaged_at([f64::NAN, 0.0, 0.0]));
    let told = kinds(&mut bench);
    let faults = told
        .iter()
        .filter(|kind| matches!(kind, EventKind::Fault { slot: 0, .. }));
    assert_eq!(faults.count(), 1, "{told:?}");
    assert_eq!(bench.session.fault(0).unwrap().field, "position_m");

    let mut bob = bench.join("Bob").unwrap();
    bench.run(10, &mut [&mut bob], |_| engaged_at([0.0; 3]));
    let status = |bench: &Bench, slot| {
        let mut sent = bench.sent.iter().rev();
        sent.find(|(to, _)| *to == slot).unwrap().1.status
    };
    assert_eq!(status(&bench, 0), LoopStatus::Fault);
    assert_eq!(status(&bench, 1), LoopStatus::Running);
    let of = |bench: &Bench| bench.session.snapshot().tools.clone();
    assert_eq!(
        of(&bench)[0].holder.as_ref().unwrap().fault,
        bench.session.fault(0)
    );
    assert_eq!(of(&bench)[1].holder.as_ref().unwrap().fault, None);

    // Good numbers again do not set it going by themselves: a person takes the tool again.
    bench.run(500, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    assert!(bench.session.fault(0).is_some());
    let lease = ada.lease();
    bench.command(&Command::Leave { lease }).unwrap();
    let mut ada = bench.join("Ada").unwrap();
    assert_eq!(bench.session.fault(0), None);

    bench.run(110, &mut [&mut ada], |_| engaged_at([f64::NAN, 0.0, 0.0]));
    assert!(bench.session.fault(0).is_some());
    bench.command(&reset(None)).unwrap();
    assert_eq!(bench.session.fault(0), None);
    bench.run(10, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    assert_eq!(status(&bench, 0), LoopStatus::Running);
}

#[test]
fn counts_of_those_who_left_stay_in_the_sessions_counts() {
    let mut bench = Bench::new(new_session(1));
    let mut ada = bench.join("Ada").unwrap();
    bench.run(300, &mut [&mut ada], |tick| {
        let mut frame = engaged_at([0.0; 3]);
        frame.header.sequence = tick;
        frame
    });
    ada.header.sequence += 50;
    bench.run(200, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    let before = bench.session.arrivals();
    assert_eq!((before.received, before.lost), (500, 50));
    bench
        .command(&Command::Leave { lease: ada.lease() })
        .unwrap();
    assert_eq!(bench.session.arrivals(), before);
    let mut bob = bench.join("Bob").unwrap();
    bench.run(1, &mut [&mut bob], |_| engaged_at([0.0; 3]));
    assert_eq!(bench.session.arrivals().received, 501);
}

/// Nobody takes events away: commands are refused, and nothing is lost that was told.
#[test]
fn a_session_whose_events_nobody_takes_refuses_commands_and_loses_none_of_them() {
    let mut bench = Bench::new(new_session(1));
    let nothing = patch(SessionPatch::default());
    let carried_out = (0..1_000)
        .take_while(|_| bench.command(&nothing).is_ok())
        .count();
    assert_eq!(bench.command(&nothing), Err(Refusal::Busy));
    assert_eq!(bench.command(&join("Ada")), Err(Refusal::Busy));
    assert_eq!(bench.take_events().len(), carried_out);
    assert!(bench.command(&join("Ada")).is_ok());
}

#[test]
fn a_fresh_block_of_another_shape_moves_home_and_reach_with_it() {
    let mut bench = Bench::new(new_session(1));
    bench.join("Ada").unwrap();
    let shape = ClayShape::Block {
        size_m: [0.064, 0.016, 0.032],
    };
    bench
        .command(&Command::Reset {
            reset: ClayReset {
                shape: Some(shape),
                material: None,
                layers: None,
            },
            lease: None,
        })
        .unwrap();
    let parameters = &bench.session.settings().parameters;
    let expected = [0.032, 0.008, 0.032 + 0.0064];
    for axis in 0..3 {
        assert!((parameters.home_m[axis] - expected[axis]).abs() < 1e-12);
    }
    bench.tick();
    assert!((bench.sent[0].1.position_m[0] - 0.032).abs() < 1e-6);
}
