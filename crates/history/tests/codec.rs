//! Bytes of every kind: what was written is read, and whatever comes, nothing panics.

#[path = "../../session/tests/bench/mod.rs"]
mod bench;

use std::sync::Arc;

use bench::{new_session, setup};
use proptest::prelude::*;
use teleclay_clay::{Operation, Pose, Sweep, ToolShape};
use teleclay_history::{Fact, Record, Recorder, Replay, State, content};
use teleclay_link::replica::Cut;
use teleclay_link::safety::{Flaw, Implausible};
use teleclay_link::time::Timestamp;
use teleclay_proto::http::{self, NewSession};
use teleclay_proto::{Scheme, ToolDescription};
use teleclay_session::{
    EventKind, Exchange, Operator, Release, Rules, Session, Settings, StopSnapshot, ToolSnapshot,
};

fn operator() -> impl Strategy<Value = Arc<Operator>> {
    (".{1,64}", ".{0,20}").prop_map(|(name, device)| Arc::new(Operator { name, device }))
}

fn text() -> impl Strategy<Value = Arc<str>> {
    ".{0,64}".prop_map(Arc::from)
}

fn settings() -> impl Strategy<Value = Arc<Settings>> {
    (1..=8_u8, any::<u64>(), any::<bool>(), 0.0..0.5_f64).prop_map(
        |(tools, revision, is_paused, deadband)| {
            let mut settings = Settings::new(new_session(tools)).unwrap();
            settings.revision = revision;
            settings.is_paused = is_paused;
            settings.spec.deadband = deadband;
            if tools % 2 == 0 {
                settings.spec.tool = ToolDescription::Loop {
                    ring_radius_m: 0.004 + 0.01 * deadband,
                    wire_diameter_m: 0.002,
                };
            }
            Arc::new(settings)
        },
    )
}

fn kinds() -> impl Strategy<Value = EventKind> {
    let slot = || 0..8_usize;
    let exchange = (0..3_u8, any::<u64>()).prop_map(|(kind, stroke)| match kind {
        0 => Exchange::Undone { stroke },
        1 => Exchange::UndoneSince { stroke },
        _ => Exchange::Redone { stroke },
    });
    let because = prop_oneof![
        Just(Release::Left),
        Just(Release::RanOut),
        Just(Release::TakenOver),
        Just(Release::Stopped),
        Just(Release::TakenAway),
        text().prop_map(|to| Release::HandedOver { to }),
    ];
    prop_oneof![
        settings().prop_map(|settings| EventKind::Changed { settings }),
        (settings(), any::<u32>(), any::<Option<u64>>()).prop_map(
            |(settings, clay_epoch, given)| EventKind::FreshBlock {
                settings,
                clay_epoch,
                given
            }
        ),
        (any::<u32>(), exchange, any::<u64>()).prop_map(|(clay_epoch, exchange, as_of_tick)| {
            EventKind::Exchanged {
                clay_epoch,
                exchange,
                as_of_tick,
            }
        }),
        (slot(), any::<u32>(), operator()).prop_map(|(slot, lease, operator)| EventKind::Taken {
            slot,
            lease,
            operator
        }),
        (slot(), any::<u32>(), operator(), because).prop_map(|(slot, lease, operator, because)| {
            EventKind::Released {
                slot,
                lease,
                operator,
                because,
            }
        }),
        (text(), text()).prop_map(|(by, reason)| EventKind::Stopped { by, reason }),
        text().prop_map(|by| EventKind::StopCleared { by }),
        (slot(), text())
            .prop_map(|(slot, operator)| EventKind::ReservationEnded { slot, operator }),
        slot().prop_map(|slot| EventKind::Connected { slot }),
        slot().prop_map(|slot| EventKind::Disconnected { slot }),
        slot().prop_map(|slot| EventKind::Fault {
            slot,
            fault: Implausible {
                field: "hand_force_n",
                flaw: Flaw::TooLarge,
            },
        }),
    ]
}

fn operation() -> impl Strategy<Value = Operation> {
    prop_oneof![
        Just(Operation::Cut),
        Just(Operation::Add),
        Just(Operation::Smooth)
    ]
}

fn facts() -> impl Strategy<Value = Fact> {
    let pose = || any::<[i32; 3]>().prop_map(Pose::from_steps);
    let cuts = prop::collection::vec((pose(), pose(), any::<bool>()), 0..20).prop_map(|cuts| {
        let mut row: Vec<Cut> = Vec::new();
        for (from, to, follows) in cuts {
            let before = row.last().map(|cut| cut.to).filter(|_| follows);
            row.push(Cut {
                from: before.unwrap_or(from),
                to,
            });
        }
        row
    });
    prop_oneof![
        (
            0..8_usize,
            any::<[u32; 2]>(),
            operation(),
            any::<u64>(),
            cuts
        )
            .prop_map(|(slot, [lease, decided], operation, moved_units, cuts)| {
                Fact::Cuts {
                    slot,
                    lease,
                    decided,
                    operation,
                    moved_units,
                    cuts,
                }
            }),
        (settings(), any::<[u32; 3]>(), any::<Option<u64>>()).prop_map(
            |(settings, [clay_epoch, ownership_epoch, next_lease], given)| Fact::Begun {
                settings,
                clay_epoch,
                given,
                ownership_epoch,
                next_lease
            }
        ),
        any::<u32>().prop_map(|ownership_epoch| Fact::GoneOn { ownership_epoch }),
        any::<u64>().prop_map(|revision| Fact::Passed { revision }),
        (any::<u64>(), kinds()).prop_map(|(revision, kind)| Fact::Told { revision, kind }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read(tick: u64, facts in prop::collection::vec(facts(), 0..6)) {
        let record = Record { tick, facts };
        prop_assert_eq!(Record::tick_of(&record.encode()), Ok(tick));
        prop_assert_eq!(Record::decode(&record.encode()), Ok(record));
    }

    #[test]
    fn no_bytes_make_a_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = Record::decode(&bytes);
        let _ = content::decode(&bytes);
        let _ = State::decode(&bytes);
        let mut known = vec![1, 7];
        known.extend(&bytes);
        let _ = Record::decode(&known);
    }

    /// Nor a replay, whatever the records say.
    #[test]
    fn no_record_makes_a_replay_panic(
        records in prop::collection::vec((any::<u64>(), prop::collection::vec(facts(), 1..4)), 1..8),
    ) {
        let session = Session::new(setup(new_session(3)));
        let first = Recorder::new(3).begin(&session, None).to_vec();
        let mut replay = Replay::begin(&first, Vec::new()).unwrap();
        for (tick, facts) in records {
            // A record that was damaged in a sensible place.
            if replay.apply(&Record { tick, facts }.encode()).is_err() {
                break;
            }
            replay.clay();
        }
    }
}

/// A server that ends in the middle of a stop has kept nothing but the stop: that is enough.
#[test]
fn a_stop_whose_releases_were_not_kept_leaves_nobody_with_a_tool_and_nothing_decided() {
    let session = Session::new(setup(new_session(2)));
    let first = Recorder::new(2).begin(&session, None).to_vec();
    let mut replay = Replay::begin(&first, Vec::new()).unwrap();
    let operator = Arc::new(Operator {
        name: "Ada".to_owned(),
        device: "none".to_owned(),
    });
    let (slot, lease) = (1, 1);
    let told = |revision, kind| Fact::Told { revision, kind };
    let mut apply = |tick, facts| replay.apply(&Record { tick, facts }.encode()).unwrap();
    let taken = EventKind::Taken {
        slot,
        lease,
        operator,
    };
    let cuts = Fact::Cuts {
        slot,
        lease,
        decided: 7,
        operation: Operation::Cut,
        moved_units: 0,
        cuts: Vec::new(),
    };
    apply(1, vec![told(1, taken), cuts]);
    let stopped = EventKind::Stopped {
        by: "Eve".into(),
        reason: "enough".into(),
    };
    apply(2, vec![told(2, stopped)]);
    let mut state = replay.into_state();
    let tools = &state.session.tools;
    assert!(tools.iter().all(|tool| tool.holder.is_none()));
    assert_eq!((&state.decided[..], state.next_lease), (&[0, 0][..], 2));
    // And so its snapshot says, of a tool that is kept for somebody too.
    state.session.tools[0].reserved_for = Some("Bob".into());
    let again = State::decode(&state.encode()).unwrap();
    assert_eq!(again.session, state.session);
    let recovered = Session::recover(Timestamp::ZERO, again.into_recovery(Rules::default()));
    let recovered = recovered.unwrap().snapshot();
    assert_eq!(recovered.stop, state.session.stop);
    assert!(
        recovered
            .tools
            .iter()
            .all(|tool| *tool == ToolSnapshot::default())
    );
}

/// A program that knows ball and blade alone says of a session with another tool, or one that does not cut, that a
/// later one wrote it; what it can read is written as it writes it.
#[test]
fn only_what_names_a_later_tool_or_operation_has_a_later_version() {
    let ball = ToolDescription::Ball { radius_m: 0.004 };
    let blade = ToolDescription::Blade {
        width_m: 0.01,
        height_m: 0.02,
        thickness_m: 0.004,
    };
    let cylinder = ToolDescription::Cylinder {
        radius_m: 0.004,
        height_m: 0.02,
    };
    let wire = ToolDescription::Loop {
        ring_radius_m: 0.006,
        wire_diameter_m: 0.004,
    };
    let (cut, add, smooth) = (
        http::Operation::Cut,
        http::Operation::Add,
        http::Operation::Smooth,
    );
    let versions = [
        (ball, cut, 1, 2),
        (blade, cut, 1, 2),
        (cylinder, cut, 2, 3),
        (wire, cut, 2, 3),
        (ball, add, 3, 4),
        (wire, smooth, 3, 4),
    ];
    for (tool, operation, of_record, of_snapshot) in versions {
        let session = Session::new(setup(NewSession {
            tool,
            operation,
            scheme: Scheme::Tdpa,
            ..new_session(1)
        }));
        let mut recorder = Recorder::new(1);
        let first = recorder.begin(&session, None).to_vec();
        assert_eq!(first[0], of_record, "{tool:?}");
        assert_eq!(Record::decode(&first).unwrap().encode(), first);
        let mut state = Replay::begin(&first, Vec::new()).unwrap().state();
        assert_eq!(state.session.settings.spec.tool, tool);
        let bytes = state.encode();
        assert_eq!(bytes[0], of_snapshot, "{tool:?}");
        assert_eq!(State::decode(&bytes).unwrap().encode(), bytes);
        // Records that name no settings are what they were.
        assert_eq!(recorder.go_on(&session)[0], 1);
    }
}

#[test]
fn a_damaged_snapshot_is_refused_or_is_another_state_and_never_panics() {
    let session = Session::new(setup(new_session(2)));
    let first = Recorder::new(2).begin(&session, None).to_vec();
    let mut state = Replay::begin(&first, Vec::new()).unwrap().state();
    let at = Pose::quantise([0.016, 0.016, 0.016]).unwrap();
    state.clay.carve(&Sweep {
        shape: ToolShape::ball(0.0064).unwrap(),
        from: at,
        to: at,
    });
    state.session.stop = Some(StopSnapshot {
        by: "Eve".into(),
        reason: "enough".into(),
    });
    state.session.tools[1].reserved_for = Some("Bob".into());
    let bytes = state.encode();
    let mut again = State::decode(&bytes).unwrap();
    assert_eq!(again.clay.hash(), state.clay.hash());
    assert_eq!(again.session, state.session);
    assert_eq!(again.encode(), bytes);
    for at in 0..bytes.len() {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            let _ = State::decode(&damaged);
        }
        assert!(State::decode(&bytes[..at]).is_err());
    }
    let newer = [&[5_u8][..], &bytes[1..]].concat();
    let refusal = State::decode(&newer).unwrap_err().to_string();
    assert_eq!(
        refusal,
        "version 5 is newer than 4, the newest that this program reads"
    );
}
