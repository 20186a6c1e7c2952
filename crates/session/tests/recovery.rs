//! A session that goes on where another server of it has ended.

mod bench;

use bench::{Bench, Hand, TICK, cutting, engaged_at, join, new_session};
use teleclay_link::safety::{Flaw, Implausible};
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{CopyState, LoopStatus, SweepRecord};
use teleclay_session::{Command, EventKind, Recovery, Release, Rules, Session};

/// The same session under another server.
fn recovered(bench: &Bench, decided: u32, now: Timestamp) -> Session {
    let recovery = Recovery {
        state: bench.session.snapshot(),
        clay: bench.session.clay().clone(),
        next_lease: bench.session.next_lease(),
        decided: vec![decided],
        rules: Rules::default(),
    };
    Session::recover(now, recovery).unwrap()
}

fn with_ada(scheme: Scheme) -> (Bench, Hand) {
    let mut bench = Bench::new(cutting(scheme));
    let mut ada = bench.join("Ada").unwrap();
    bench.run(50, &mut [&mut ada], bench::stroke);
    (bench, ada)
}

#[test]
fn the_holder_goes_on_under_the_same_lease_and_the_next_owner() {
    let (mut bench, mut ada) = with_ada(Scheme::ForceExchange);
    let (before, hash) = (bench.session.snapshot(), bench.session.clay_mut().hash());
    // Clocks begin anew.
    let now = Timestamp::ZERO.after(TICK);
    bench.session = recovered(&bench, 0, now);
    bench.now = now;
    bench.take_events();
    let after = bench.session.snapshot();
    assert_eq!(after.ownership_epoch, before.ownership_epoch + 1);
    assert_eq!((after.tick, after.revision), (before.tick, before.revision));
    assert_eq!(bench.session.clay_mut().hash(), hash);
    ada.header.ownership_epoch += 1;
    bench.run(100, &mut [&mut ada], bench::stroke);
    let (_, frame) = bench.sent[0];
    assert_eq!(frame.header.lease, ada.lease());
    assert_eq!(
        (frame.status, frame.header.ownership_epoch),
        (LoopStatus::Running, 2)
    );
    let again = bench.command(&join("Ben"));
    assert!(again.is_err(), "the tool is held");
    bench
        .command(&Command::Leave { lease: ada.lease() })
        .unwrap();
    let ben = bench.join("Ben").unwrap();
    assert!(ada.lease() < ben.lease(), "no lease is given twice");
}

#[test]
fn who_does_not_come_back_loses_the_tool_by_the_rules() {
    let (mut bench, ada) = with_ada(Scheme::ForceExchange);
    bench.session = recovered(&bench, 0, bench.now);
    bench.take_events();
    for _ in 0..900 {
        bench.tick();
    }
    assert!(
        bench.command(&join("Ben")).is_err(),
        "a holder has a second to be heard"
    );
    for _ in 0..9_200 {
        bench.tick();
    }
    let told = bench.take_events();
    assert!(told.iter().any(|event| matches!(
        event.kind,
        EventKind::Released { lease, because: Release::RanOut, .. } if lease == ada.lease()
    )));
}

#[test]
fn who_comes_back_under_another_lease_gets_the_own_tool() {
    let mut bench = Bench::new(new_session(3));
    let [_, mut ben] = ["Ada", "Ben"].map(|name| bench.join(name).unwrap());
    bench.run(5, &mut [&mut ben], |_| engaged_at([0.0; 3]));
    bench.session = recovered(&bench, 0, bench.now);
    // At once: this server has not heard of anybody yet.
    let again = bench.join("Ben").unwrap();
    assert_eq!(again.slot, ben.slot);
    assert!(ben.lease() < again.lease());
    // Who is heard keeps the tool.
    bench.session = recovered(&bench, 0, bench.now);
    ben = again;
    ben.header.ownership_epoch += 1;
    bench.run(5, &mut [&mut ben], |_| engaged_at([0.0; 3]));
    let third = bench.join("Ben").unwrap();
    assert_ne!(third.slot, ben.slot, "the third tool was free");
}

#[test]
fn what_was_decided_need_not_come_again_and_a_fault_is_not_forgotten() {
    let (mut bench, _) = with_ada(Scheme::Replica);
    bench.session = recovered(&bench, 57, bench.now);
    bench.tick();
    let (_, frame) = bench.sent[0];
    assert_eq!(frame.sweeps_acknowledged, 57);
    assert_eq!(bench.session.cuts().next().unwrap().decided, 57);
    let mut state = bench.session.snapshot();
    let fault = Implausible {
        field: "hand_force_n",
        flaw: Flaw::NotFinite,
    };
    state.tools[0].holder.as_mut().unwrap().fault = Some(fault);
    let recovery = Recovery {
        state,
        clay: bench.session.clay().clone(),
        next_lease: 9,
        decided: Vec::new(),
        rules: Rules::default(),
    };
    bench.session = Session::recover(bench.now, recovery).unwrap();
    bench.tick();
    assert_eq!(bench.session.fault(0), Some(fault));
    assert_eq!(bench.sent[0].1.status, LoopStatus::Fault);
    let told = bench.take_events();
    assert!(
        !told
            .iter()
            .any(|event| matches!(event.kind, EventKind::Fault { .. }))
    );
}

/// A sweep that was noted and waits for its tick would be lost with the process: it is not in what is kept.
#[test]
fn what_is_noted_and_not_yet_merged_is_not_decided_and_so_never_durable() {
    let mut bench = Bench::new(cutting(Scheme::Replica));
    bench.session.keep_journal();
    let mut ada = bench.join("Ada").unwrap();
    ada.header.revision += 1;
    let mut frame = engaged_at([0.0; 3]);
    frame.copy = CopyState::Live;
    for sequence in 1..=100 {
        let at = |number: u32| [250_000 + 100 * number as i32, 250_000, 250_000];
        let record = SweepRecord {
            sequence,
            from: at(sequence),
            to: at(sequence + 1),
        };
        frame.sweeps.push(record).unwrap();
    }
    bench.run(1, &mut [&mut ada], |_| frame.clone());
    assert_eq!(bench.sent[0].1.sweeps_acknowledged, 100);
    assert_eq!(bench.session.cuts().next().unwrap().decided, 64);
    let tick = bench.session.ticks();
    bench.session.set_durable(tick);
    bench.tick();
    let (_, told) = bench.sent[0];
    assert_eq!((told.sweeps_acknowledged, told.sweeps_durable), (100, 64));
    assert_eq!(bench.session.cuts().next().unwrap().decided, 100);
}

#[test]
fn what_could_not_be_kept_is_not_cut() {
    let (mut bench, mut ada) = with_ada(Scheme::PositionForce);
    bench.session.stop_cutting();
    bench.run(300, &mut [&mut ada], bench::stroke);
    let rested = bench.session.clay().removed_units();
    bench.run(300, &mut [&mut ada], bench::stroke);
    assert_eq!(bench.session.clay().removed_units(), rested);
    assert_eq!(bench.sent[0].1.status, LoopStatus::Paused);
    bench.session.resume_cutting();
    let elsewhere = |tick: u32| engaged_at([0.008 * (f64::from(tick) * 0.01).sin(), 0.005, -0.006]);
    bench.run(600, &mut [&mut ada], elsewhere);
    assert!(rested < bench.session.clay().removed_units());
    assert_eq!(bench.sent[0].1.status, LoopStatus::Running);
}
