//! Undo and redo of strokes of two operators who cut across each other, on virtual time.

#[path = "../../session/tests/bench/mod.rs"]
mod bench;
mod world;

use bench::{Hand, TICK, cutting, engaged_at, join, setup};
use teleclay_clay::{Clay, Pose, Sweep};
use teleclay_history::{Record, Whose};
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{CopyState, Header, SweepRecord};
use teleclay_proto::http::{ClaySpec, NewSession};
use teleclay_session::{Exchange, Refusal, Session};
use world::{Live, assert_same_clay};

const STROKES: u64 = 50;
/// Sweeps of a stroke.
const SWEEPS: u32 = 20;

fn new_session() -> NewSession {
    let spec = cutting(Scheme::Replica);
    NewSession {
        clay: ClaySpec {
            voxel_size_m: 1e-3,
            ..spec.clay
        },
        tools: 2,
        ..spec
    }
}

/// Two operators, the time, and every sweep that was sent, with the number that the test gives its stroke.
struct Bench {
    live: Live,
    now: Timestamp,
    hands: Vec<Hand>,
    sent: Vec<(u64, Sweep)>,
    sequences: [u32; 2],
}

impl Bench {
    fn new() -> Self {
        let mut live = Live::new(Session::new(setup(new_session())));
        let now = Timestamp::ZERO.after(TICK);
        let hands = ["Ada", "Ben"].map(|name| {
            let outcome = live.session.carry_out(now, &join(name)).unwrap();
            let granted = outcome.granted.unwrap();
            Hand {
                slot: granted.slot,
                header: Header {
                    lease: granted.lease,
                    ownership_epoch: 1,
                    revision: outcome.revision as u32 + 1,
                    clay_epoch: outcome.clay_epoch,
                    scheme: Scheme::Replica,
                    ..Header::default()
                },
            }
        });
        Self {
            live,
            now,
            hands: hands.to_vec(),
            sent: Vec::new(),
            sequences: [0; 2],
        }
    }

    /// A tick in which each hand sends a sweep of a stroke, or none.
    fn tick(&mut self, sweeps: [Option<(u64, Sweep)>; 2]) {
        for (slot, sweep) in sweeps.into_iter().enumerate() {
            let mut frame = engaged_at([0.0; 3]);
            frame.copy = CopyState::Live;
            frame.sweeps.oldest_unacknowledged = 1;
            if let Some((stroke, sweep)) = sweep {
                self.sequences[slot] += 1;
                let record = SweepRecord {
                    sequence: self.sequences[slot],
                    from: sweep.from.steps(),
                    to: sweep.to.steps(),
                };
                frame.sweeps.push(record).unwrap();
                self.sent.push((stroke, sweep));
            }
            let frame = self.hands[slot].frame(self.now, frame);
            self.live.session.handle_frame(self.now, slot, &frame);
        }
        self.live.tick(self.now);
        self.now = self.now.after(TICK);
    }

    fn rest(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| self.tick([None, None]));
    }

    /// Every sweep that was sent but those of the strokes left out.
    fn clay_without(&self, left_out: impl Fn(u64) -> bool) -> Clay {
        let mut clay = self.live.session.settings().fresh_block().unwrap();
        for (stroke, sweep) in &self.sent {
            if !left_out(*stroke) {
                clay.carve(sweep);
            }
        }
        clay
    }

    fn assert_clay_is_without(&self, left_out: impl Fn(u64) -> bool) {
        assert_same_clay(self.live.session.clay(), &self.clay_without(left_out));
    }
}

/// A piece of a groove across the block, Ada's along x and Ben's along y, so that each crosses the other's.
fn sweep(stroke: u64, step: u32) -> Sweep {
    let across_m = 0.004 + 0.0005 * stroke as f64;
    let along = |step: u32| 0.006 + 0.0009 * f64::from(step);
    let pose = |step: u32| {
        let [x, y] = if stroke.is_multiple_of(2) {
            [along(step), across_m]
        } else {
            [across_m, along(step)]
        };
        Pose::quantise([x, y, 0.018 - 0.0001 * stroke as f64]).unwrap()
    };
    Sweep {
        shape: teleclay_clay::ToolShape::ball(0.0064).unwrap(),
        from: pose(step),
        to: pose(step + 1),
    }
}

#[test]
fn each_of_fifty_strokes_of_two_operators_is_undone_as_if_it_had_not_been_and_redone() {
    let mut bench = Bench::new();
    bench.rest(5);
    // Two strokes at a time, one of each operator.
    for pair in 0..STROKES / 2 {
        for step in 0..SWEEPS {
            let of = |stroke: u64| Some((stroke + 1, sweep(stroke, step)));
            bench.tick([of(2 * pair), of(2 * pair + 1)]);
        }
        bench.rest(300);
    }
    let strokes = bench.live.strokes().list().to_vec();
    assert_eq!(strokes.len() as u64, STROKES);
    assert!(strokes.iter().all(|stroke| 0 < stroke.removed_units));
    let removed: u64 = strokes.iter().map(|stroke| stroke.removed_units).sum();
    assert_eq!(removed, bench.live.session.clay().removed_units());
    bench.assert_clay_is_without(|_| false);
    let faults = bench.live.session.fault(0);
    for number in 1..=STROKES {
        let epoch = bench.live.session.clay_epoch();
        let places: Vec<_> = (0..2).map(|slot| place(&bench, slot)).collect();
        let undone = Exchange::Undone { stroke: number };
        bench.live.exchange(bench.now, undone).unwrap();
        bench.assert_clay_is_without(|stroke| stroke == number);
        bench.rest(1);
        assert_eq!(bench.live.strokes().to_redo(Whose::Anybodys), Some(number));
        let redone = Exchange::Redone { stroke: number };
        bench.live.exchange(bench.now, redone).unwrap();
        bench.assert_clay_is_without(|_| false);
        bench.rest(1);
        assert_eq!(bench.live.session.clay_epoch(), epoch + 2);
        assert_eq!(bench.live.session.fault(0), faults);
        let after: Vec<_> = (0..2).map(|slot| place(&bench, slot)).collect();
        assert_eq!(places, after, "no tool was moved");
    }
    // One operator's last ones, one after the other; the other's stay.
    for pair in (STROKES / 2 - 3..STROKES / 2).rev() {
        let last = bench.live.strokes().to_undo(Whose::Operators("Ada"));
        let stroke = 2 * pair + 1;
        assert_eq!(last, Some(stroke));
        let undone = Exchange::Undone { stroke };
        bench.live.exchange(bench.now, undone).unwrap();
        bench.rest(1);
        bench.assert_clay_is_without(|sent| stroke <= sent && sent % 2 == 1);
    }
    let since = Exchange::UndoneSince { stroke: 31 };
    bench.live.exchange(bench.now, since).unwrap();
    bench.assert_clay_is_without(|sent| 31 <= sent);
}

fn place(bench: &Bench, slot: usize) -> [f64; 3] {
    let side = bench.live.session.side(slot).unwrap();
    side.frame().position_m
}

/// What was cut since the clay was made is in it, also of the stroke that was undone, which ends there.
#[test]
fn a_stroke_is_undone_while_it_is_being_cut_as_of_the_tick_that_was_seen() {
    let mut bench = Bench::new();
    bench.rest(5);
    for step in 0..10 {
        bench.tick([Some((1, sweep(4, step))), Some((2, sweep(5, step)))]);
    }
    let last = bench.live.strokes().to_undo(Whose::Tools(0)).unwrap();
    let undone = Exchange::Undone { stroke: last };
    let prepared = bench.live.prepare(undone);
    for step in 10..15 {
        // Of what follows of the first stroke the test thinks as of a third.
        bench.tick([Some((3, sweep(4, step))), Some((2, sweep(5, step)))]);
    }
    bench.live.carry_out(bench.now, prepared).unwrap();
    bench.assert_clay_is_without(|stroke| stroke == 1);
    for step in 15..20 {
        bench.tick([Some((3, sweep(4, step))), Some((2, sweep(5, step)))]);
    }
    bench.assert_clay_is_without(|stroke| stroke == 1);
    let list = bench.live.strokes().list();
    assert_eq!(list.len(), 3);
    assert_eq!((list[0].is_undone, list[2].is_undone), (true, false));
    assert!(list[0].to_tick < list[2].from_tick && list[1].to_tick == list[2].to_tick);
    bench.live.assert_replay_is_live();
    // A little that was cut since is made up for; much is not, and it has to be made again.
    let prepared = bench.live.prepare(Exchange::Undone { stroke: 3 });
    for step in 0..60 {
        bench.tick([None, Some((2, sweep(5, step % 18)))]);
    }
    bench.live.carry_out(bench.now, prepared).unwrap();
    bench.rest(1);
    bench.assert_clay_is_without(|stroke| stroke != 2);
    let prepared = bench.live.prepare(Exchange::Redone { stroke: 3 });
    for step in 0..120 {
        bench.tick([None, Some((2, sweep(5, step % 18)))]);
    }
    let refusal = bench.live.carry_out(bench.now, prepared).unwrap_err();
    assert!(matches!(refusal, Refusal::CutMeanwhile { .. }));
    bench.assert_clay_is_without(|stroke| stroke != 2);
}

/// A pass through its own groove goes with the groove, though it removed nothing.
#[test]
fn what_a_tool_passes_through_after_a_stroke_is_undone_with_it() {
    let mut bench = Bench::new();
    bench.rest(5);
    for passes in 0..3 {
        for step in 0..10 {
            bench.tick([Some((1, sweep(4, step))), None]);
        }
        bench.rest(100 * passes);
    }
    assert_eq!(bench.live.strokes().list().len(), 1);
    let undone = Exchange::Undone { stroke: 1 };
    bench.live.exchange(bench.now, undone).unwrap();
    bench.assert_clay_is_without(|stroke| stroke == 1);
    assert_eq!(bench.live.session.clay().removed_units(), 0);
}

/// Whoever polls after the command that follows a tick gets both at once.
#[test]
fn a_fresh_block_that_came_after_a_tick_has_none_of_its_cuts() {
    let mut bench = Bench::new();
    bench.rest(5);
    for step in 0..10 {
        bench.tick([Some((1, sweep(4, step))), None]);
    }
    let session = &mut bench.live.session;
    let mut frame = engaged_at([0.0; 3]);
    frame.copy = CopyState::Live;
    let cut = sweep(4, 12);
    let record = SweepRecord {
        sequence: 11,
        from: cut.from.steps(),
        to: cut.to.steps(),
    };
    frame.sweeps.push(record).unwrap();
    let frame = bench.hands[0].frame(bench.now, frame);
    session.handle_frame(bench.now, 0, &frame);
    session.tick(bench.now);
    assert!(session.cuts().any(|made| 0 < made.moved_units));
    session.carry_out(bench.now, &bench::reset(None)).unwrap();
    bench.live.record();
    assert_eq!(bench.live.session.clay().removed_units(), 0);
    bench.live.assert_replay_is_live();
}

/// On disk a record has 20 bytes more.
#[test]
#[allow(clippy::print_stdout, reason = "the figures are a result")]
fn a_sweep_takes_less_than_64_bytes() {
    for scheme in [Scheme::Replica, Scheme::ForceExchange] {
        let mut live = Live::new(Session::new(setup(cutting(scheme))));
        let mut now = Timestamp::ZERO.after(TICK);
        let outcome = live.session.carry_out(now, &join("Ada")).unwrap();
        let granted = outcome.granted.unwrap();
        let mut sequence = 0;
        for tick in 0..10_000 {
            let mut frame = bench::stroke(tick);
            frame.hand_force_n = [3.0 * (f64::from(tick) * 0.01).sin(), 0.5, -2.0];
            frame.header = Header {
                lease: granted.lease,
                ownership_epoch: 1,
                revision: outcome.revision as u32,
                clay_epoch: 1,
                scheme,
                sequence: tick + 1,
                sent_ns: now.as_nanos(),
                ..Header::default()
            };
            if scheme == Scheme::Replica {
                sequence += 1;
                frame.copy = CopyState::Live;
                frame.sweeps.oldest_unacknowledged = sequence;
                let at = |tick: u32| {
                    let phase = f64::from(tick) * 0.01;
                    let place = [0.016 + 0.008 * phase.sin(), 0.016 + 0.002 * phase, 0.014];
                    Pose::quantise(place.map(|m| m + 1e-4 * phase.cos()))
                        .unwrap()
                        .steps()
                };
                let (from, to) = (at(tick % 600), at(tick % 600 + 1));
                frame
                    .sweeps
                    .push(SweepRecord { sequence, from, to })
                    .unwrap();
            }
            live.session.handle_frame(now, granted.slot, &frame);
            live.tick(now);
            now = now.after(TICK);
        }
        let (mut bytes, mut sweeps) = (0, 0);
        for record in &live.records[1..] {
            bytes += record.len() + 20;
            for fact in Record::decode(record).unwrap().facts {
                if let teleclay_history::Fact::Cuts { cuts, .. } = fact {
                    sweeps += cuts.len();
                }
            }
        }
        println!(
            "{scheme:?}: {sweeps} sweeps, {:.1} bytes each",
            bytes as f64 / sweeps as f64
        );
        assert!(5_000 < sweeps && bytes < 64 * sweeps);
    }
}
