//! What is brought to the tick, and what it replaces there.

use super::*;

/// A small block, as a snapshot of it comes from the server.
pub(super) fn snapshot(epoch: u32) -> Snapshot {
    let shape = teleclay_clay::Shape::Block {
        size_m: [0.032, 0.016, 0.016],
    };
    Snapshot {
        clay: Box::new(teleclay_clay::Clay::new(&shape, 1e-3).unwrap()),
        epoch,
    }
}

fn tool_setup() -> Arc<ToolSetup> {
    teleclay_bilateral::tool_setup(&LoopParameters::default()).unwrap()
}

/// What was discarded so far, by its kind.
pub(super) fn discarded(bench: &mut Bench) -> Vec<&'static str> {
    let mut kinds = Vec::new();
    while let Ok(done) = bench.ends.done.pop() {
        kinds.push(match done {
            Done::Order => continue,
            Done::Controller { .. } => "controller",
            Done::Attachment { .. } => "attachment",
            Done::Renewal { .. } => "renewal",
            Done::ToolSetup { .. } => "tool setup",
            Done::Snapshot { .. } => "snapshot",
            Done::Retired { .. } => "retired",
        });
    }
    kinds
}

#[test]
fn under_the_replica_a_snapshot_is_wanted_until_it_is_there_and_is_felt_from_then_on() {
    let mut bench = Bench::new(Intent::Idle);
    bench.tool.frame.header.scheme = Scheme::Replica;
    bench.tool.frame.header.clay_epoch = 3;
    let record = bench.couple_for(5);
    assert_eq!(record.scheme, Scheme::Replica);
    assert_eq!(record.copy, CopyState::None);
    let wanted = record.wanted.snapshot.expect("it lacks the clay");
    assert_eq!(wanted.epoch, 3);

    // Another block is of no use, nor is one that belongs to another lease; the request stays.
    for (lease, epoch) in [(1, 2), (9, 3)] {
        let snapshot = snapshot(epoch);
        assert!(
            bench
                .ends
                .orders
                .push(Order::LoadSnapshot { lease, snapshot })
                .is_ok()
        );
        assert_eq!(bench.couple_for(1).wanted.snapshot, Some(wanted));
    }
    assert!(
        bench
            .ends
            .orders
            .push(Order::LoadSnapshot {
                lease: 1,
                snapshot: snapshot(3),
            })
            .is_ok()
    );
    let record = bench.couple_for(2);
    assert_eq!(record.wanted.snapshot, None);
    assert_eq!(record.copy, CopyState::Live);
    let kinds = discarded(&mut bench);
    assert!(kinds.contains(&"snapshot"), "{kinds:?}");
}

/// A scheme changes in one tick, with the controller that waited for it; until another one is brought, that scheme
/// cannot take over again.
#[test]
fn a_controller_is_wanted_once_a_scheme_has_taken_over_and_is_used_once_it_is_there() {
    let mut bench = Bench::new(Intent::Idle);
    assert_eq!(bench.couple_for(5).wanted.controller, None);
    let context = bench.realtime.machine().attachment.side.context().clone();
    bench.tool.frame.header.scheme = Scheme::Wave;
    let record = bench.couple_for(2);
    assert_eq!(record.scheme, Scheme::Wave);
    assert_eq!(record.wanted.controller, Some(Scheme::ForceExchange));
    assert_eq!(discarded(&mut bench), ["retired"]);
    bench.tool.frame.header.scheme = Scheme::ForceExchange;
    assert_eq!(bench.couple_for(20).scheme, Scheme::Wave, "none waits");
    for (lease, left) in [(9, "controller"), (1, "retired")] {
        let provide = Order::Provide {
            lease,
            scheme: Scheme::ForceExchange,
            controller: teleclay_link::scheme::handle_controller(Scheme::ForceExchange, &context),
        };
        assert!(bench.ends.orders.push(provide).is_ok());
        bench.couple_for(2);
        assert_eq!(discarded(&mut bench), [left]);
    }
    assert_eq!(bench.couple_for(1).scheme, Scheme::ForceExchange);
}

#[test]
fn a_new_revision_is_wanted_and_what_it_replaces_is_dropped_elsewhere() {
    let mut bench = Bench::new(Intent::Idle);
    assert_eq!(bench.couple_for(2).wanted.revision, 0);
    bench.tool.frame.header.revision = 7;
    assert_eq!(bench.couple_for(2).wanted.revision, 7);
    for lease in [1, 9] {
        let setup = tool_setup();
        assert!(
            bench
                .ends
                .orders
                .push(Order::Move {
                    lease,
                    setup,
                    deadband: 0.07
                })
                .is_ok()
        );
    }
    bench.couple_for(1);
    assert_eq!(discarded(&mut bench), ["tool setup", "tool setup"]);
}
