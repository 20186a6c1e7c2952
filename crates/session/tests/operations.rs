//! Tools that add and smooth, in a session: live, in the order of its ticks, and refused where a copy of the clay would
//! be ahead of them.

mod bench;

use bench::{Bench, cutting, kinds, patch, stroke};
use teleclay_proto::Scheme;
use teleclay_proto::http::{NewSession, Operation, SessionPatch};
use teleclay_session::{EventKind, Refusal, Settings};

/// Schemes under which the server's tool does what the handle asks.
const OTHERS: [Scheme; 4] = [
    Scheme::ForceExchange,
    Scheme::PositionForce,
    Scheme::Wave,
    Scheme::Tdpa,
];

fn told(operation: Operation) -> SessionPatch {
    SessionPatch {
        operation: Some(operation),
        ..SessionPatch::default()
    }
}

fn refused_at(refusal: Option<Refusal>) -> &'static str {
    match refusal {
        Some(Refusal::Field(error)) => error.pointer.leak(),
        other => panic!("{other:?}"),
    }
}

/// What was cut is put back, and smoothed, by the same hand; the settings say so, and the events.
#[test]
fn a_tool_cuts_adds_and_smooths_as_it_is_told() {
    // It needs nothing but positions, and these frames have nothing else.
    let scheme = Scheme::PositionForce;
    let mut bench = Bench::new(cutting(scheme));
    let mut ada = bench.join("Ada").unwrap();
    bench.run(600, &mut [&mut ada], stroke);
    let removed = bench.session.clay().removed_units();
    assert!(0 < removed, "{scheme}");
    kinds(&mut bench);

    bench.command(&patch(told(Operation::Add))).unwrap();
    let changed = |kind: &EventKind| matches!(kind, EventKind::Changed { settings } if settings.spec.operation == Operation::Add);
    assert!(kinds(&mut bench).iter().any(changed), "{scheme}");
    bench.run(600, &mut [&mut ada], stroke);
    let after_adding = bench.session.clay().removed_units();
    assert!(
        after_adding < removed,
        "{scheme}: {after_adding} of {removed}"
    );

    bench.command(&patch(told(Operation::Smooth))).unwrap();
    let hash = bench.session.clay().clone().hash();
    let mut moved = 0;
    for tick in 0..600 {
        bench.run(1, &mut [&mut ada], |_| stroke(tick));
        for made in bench.session.cuts() {
            assert_eq!(made.operation, teleclay_clay::Operation::Smooth);
            moved += made.moved_units;
        }
    }
    assert!(0 < moved, "{scheme}");
    assert_eq!(
        bench.session.clay().removed_units(),
        after_adding,
        "{scheme}"
    );
    assert_ne!(bench.session.clay().clone().hash(), hash);

    bench.command(&patch(told(Operation::Cut))).unwrap();
    bench.run(600, &mut [&mut ada], stroke);
    assert!(
        after_adding < bench.session.clay().removed_units(),
        "{scheme}"
    );
}

/// Copies of the clay may be ahead of the authority where sweeps commute: so under the replica nothing else is done.
#[test]
fn the_replica_is_not_told_to_add_or_smooth() {
    for operation in [Operation::Add, Operation::Smooth] {
        let spec = |scheme| NewSession {
            operation,
            ..cutting(scheme)
        };
        let refusal = Settings::new(spec(Scheme::Replica)).unwrap_err();
        assert_eq!(refusal.pointer, "/operation");
        assert!(refusal.detail.contains("replica"), "{}", refusal.detail);

        let mut bench = Bench::new(cutting(Scheme::Replica));
        let before = bench.session.snapshot();
        let refused = bench.command(&patch(told(operation))).err();
        assert_eq!(refused_at(refused), "/operation");
        assert_eq!(bench.session.snapshot(), before);

        // The other way round it is the scheme that is at fault; both at once are fine.
        for scheme in OTHERS {
            let mut bench = Bench::new(spec(scheme));
            let to_replica = SessionPatch {
                scheme: Some(Scheme::Replica),
                ..SessionPatch::default()
            };
            let refused = bench.command(&patch(to_replica)).err();
            assert_eq!(refused_at(refused), "/scheme");
            let both = SessionPatch {
                operation: Some(Operation::Cut),
                ..to_replica
            };
            bench.command(&patch(both)).unwrap();
            assert_eq!(bench.session.settings().spec.scheme, Scheme::Replica);
        }
    }
}
