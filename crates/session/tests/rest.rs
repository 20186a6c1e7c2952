//! Rest is as many ticks, to the last bit: whatever was done before, and whatever is done after it.

mod bench;

use bench::{Bench, Hand, cutting, engaged_at, grant, new_session, patch, request, reset, stroke};
use teleclay_proto::Scheme;
use teleclay_proto::frame::{HandleFrame, ToolFrame};
use teleclay_proto::http::SessionPatch;
use teleclay_session::{Command, Event, Session, Snapshot};

/// Everything that can be told from outside.
#[derive(Debug, PartialEq)]
struct Whole {
    snapshot: Snapshot,
    events: Vec<Event>,
    hash: u64,
    remaining_units: u64,
    frames: Vec<(usize, ToolFrame)>,
}

fn whole(bench: &mut Bench) -> Whole {
    Whole {
        events: bench.take_events(),
        snapshot: bench.session.snapshot(),
        hash: bench.session.clay_mut().hash(),
        remaining_units: bench.session.clay().remaining_units(),
        frames: bench.sent.clone(),
    }
}

/// Lets ticks pass one by one.
fn ticked(bench: &mut Bench, ticks: u64) {
    for _ in 0..ticks {
        bench.tick();
        assert!(bench.sent.is_empty(), "nobody is there to send to");
    }
}

/// Lets them pass at once; the last is when it would have been.
fn rested(bench: &mut Bench, ticks: u64) {
    let last = bench.now.after(bench::TICK * (ticks as u32 - 1));
    bench.session.rest(last, ticks);
    assert_eq!(bench.session.cuts().count(), 0);
    assert_eq!(bench.session.poll_transmit(), None);
    assert!(bench.session.is_at_rest());
    bench.now = last.after(bench::TICK);
}

fn until_rest(bench: &mut Bench) {
    for _ in 0..20_000 {
        if bench.session.is_at_rest() {
            return;
        }
        bench.tick();
    }
    panic!("it comes to no rest: {:?}", bench.session.snapshot());
}

/// Cuts for a while and leaves.
fn visit(bench: &mut Bench, name: &str) {
    let mut hand = bench.join(name).unwrap();
    bench.run(400, &mut [&mut hand], stroke);
    let lease = hand.lease();
    bench.command(&Command::Leave { lease }).unwrap();
}

#[test]
fn a_rest_is_as_many_ticks_under_every_scheme() {
    for scheme in Scheme::ALL {
        let run = |pass: fn(&mut Bench, u64)| {
            let mut bench = Bench::new(cutting(*scheme));
            let mut seen = Vec::new();
            for (visitor, ticks) in [("Ada", 1), ("Bob", 49), ("Eve", 12_345)] {
                visit(&mut bench, visitor);
                until_rest(&mut bench);
                seen.push(whole(&mut bench));
                pass(&mut bench, ticks);
                seen.push(whole(&mut bench));
                let deadband = SessionPatch {
                    deadband: Some(0.01 * f64::from(seen.len() as u32)),
                    ..SessionPatch::default()
                };
                bench.command(&patch(deadband)).unwrap();
                bench.tick();
                until_rest(&mut bench);
                pass(&mut bench, 3);
                seen.push(whole(&mut bench));
            }
            bench.command(&reset(None)).unwrap();
            visit(&mut bench, "Ada");
            seen.push(whole(&mut bench));
            seen
        };
        let (one_by_one, at_once) = (run(ticked), run(rested));
        assert_eq!(one_by_one, at_once, "{scheme:?}");
        let initial_units = Bench::new(cutting(*scheme)).session.clay().initial_units();
        assert!(
            one_by_one[0].remaining_units < initial_units,
            "{scheme:?} was to cut"
        );
    }
}

/// Whatever may still change by itself keeps a session from rest: a holder, heard or not, somebody for whom a tool is
/// kept, words that nobody has taken.
#[test]
fn what_may_change_by_itself_does_not_rest() {
    let mut bench = Bench::new(new_session(1));
    until_rest(&mut bench);
    let mut ada = bench.join("Ada").unwrap();
    let moves = |bench: &Bench, why: &str| assert!(!bench.session.is_at_rest(), "{why}");
    moves(&bench, "an event waits");
    bench.take_events();
    moves(&bench, "somebody holds a tool");
    bench.run(1100, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    bench.command(&request(1, "Bob")).unwrap();
    bench.command(&grant(1, "Bob", Some(ada.lease()))).unwrap();
    bench.tick();
    bench.take_events();
    assert!(holders(&bench.session) == 0 && bench.session.side(0).is_none());
    moves(&bench, "the tool is kept for Bob");
    until_rest(&mut bench);
    let ended = bench.take_events();
    assert_eq!(ended.len(), 1, "the reservation has ended: {ended:?}");
    // A holder who is silent is let go of by and by, and only then there is rest.
    let _silent: Hand = bench.join("Eve").unwrap();
    bench.run(10, &mut [], |_| HandleFrame::default());
    bench.take_events();
    moves(&bench, "a silent holder");
    until_rest(&mut bench);
    assert_eq!(holders(&bench.session), 0);
}

fn holders(session: &Session) -> usize {
    let snapshot = session.snapshot();
    let tools = snapshot.tools.iter();
    tools.filter(|tool| tool.holder.is_some()).count()
}
