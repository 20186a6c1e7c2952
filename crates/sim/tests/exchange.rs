//! Strokes that are undone and redone under a tool: clay that comes back there is felt gently, brings no energy that
//! was not earned, and both clays are one again.

#[path = "rigs/mod.rs"]
mod rigs;

use rigs::{both_ways, carving, embedded, line, norm, running, shaking, viscous};
use teleclay_history::{Recorder, Replay, Whose};
use teleclay_link::replica::CorrectionLimits;
use teleclay_operator::Intent;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Material, Scheme};
use teleclay_session::{Event, Exchange, Prepared};
use teleclay_sim::rig::Rig;

/// A rig and its history.
struct Told {
    rig: Rig,
    recorder: Recorder,
    replay: Replay,
    waiting: Vec<Event>,
}

impl Told {
    fn new(rig: Rig) -> Self {
        let block = rig.block().clone();
        let hash = block.clone().hash();
        let mut recorder = Recorder::new(rig.session().tools());
        let first = recorder.begin(rig.session(), Some(hash));
        let replay = Replay::begin(first, vec![block]).unwrap();
        Self {
            rig,
            recorder,
            replay,
            waiting: Vec::new(),
        }
    }

    fn tick(&mut self) {
        self.rig.tick();
        self.waiting.extend_from_slice(self.rig.events());
        let record = self
            .recorder
            .record(self.rig.session(), self.waiting.iter());
        if let Some(record) = record {
            self.replay.apply(record).unwrap();
        }
        self.waiting.clear();
    }

    fn exchange(&mut self, exchange: Exchange) {
        let exchanged = self.replay.exchanged(exchange).unwrap();
        let session = self.rig.session();
        let mut prepared = Prepared::exchange(exchanged, session.settings());
        let now = self.rig.now();
        let session = self.rig.session_mut();
        session.handle_command(now, &mut prepared).unwrap();
    }

    fn undo(&mut self) {
        let stroke = self.replay.strokes().to_undo(Whose::Tools(0)).unwrap();
        self.exchange(Exchange::Undone { stroke });
    }

    fn assert_clay_is_one(&mut self) {
        let server = self.rig.session().clay().clone().hash();
        assert_eq!(self.replay.clay().hash(), server);
        for slot in 0..self.rig.session().tools() {
            let Some(replica) = self.rig.handle_of(slot).clay_copy() else {
                continue;
            };
            let copy = replica.copy().unwrap();
            assert_eq!(copy.clay().clone().hash(), server, "the copy of {slot}");
            assert_eq!(copy.epoch(), self.rig.session().clay_epoch());
        }
    }
}

fn at_device() -> CorrectionLimits {
    CorrectionLimits::for_range(LoopParameters::default().force_limit_n)
}

#[test]
#[allow(clippy::print_stdout, reason = "the figures are a result")]
fn a_copy_is_felt_and_cut_on_while_strokes_are_undone_under_it_and_becomes_the_servers_clay() {
    for (delay_ms, loss) in [(0, 0.0), (5, 0.1), (60, 0.1)] {
        let lines = both_ways(line(delay_ms, 0.3, loss), 3);
        let rig = embedded(running(Scheme::Replica), shaking(), viscous(2e5), lines);
        let mut told = Told::new(rig);
        let (mut largest_n, mut removed) = (0.0_f64, 0);
        for tick in 0..12_000 {
            told.tick();
            if tick % 2000 == 1999 {
                if tick % 4000 == 1999 {
                    removed += told.rig.session().clay().removed_units();
                    told.undo();
                } else {
                    let stroke = told.replay.strokes().to_redo(Whose::Anybodys).unwrap();
                    told.exchange(Exchange::Redone { stroke });
                }
            }
            let replica = told.rig.handle_of(0).clay_copy().unwrap();
            let copy = replica.copy().expect("it is never taken away");
            largest_n = largest_n.max(copy.limiter().step_n());
            assert!(copy.limiter().injected_j() <= copy.limiter().earned_j() + 1e-12);
        }
        let corrections = told
            .rig
            .handle_of(0)
            .clay_copy()
            .unwrap()
            .copy()
            .unwrap()
            .limiter()
            .corrections();
        println!("{delay_ms} ms: {corrections} corrections, steps of {largest_n:.3} N");
        assert!(0 < removed && 3 <= corrections);
        told.rig.hold_handles_fast();
        (0..5000).for_each(|_| told.tick());
        told.assert_clay_is_one();
        let log = told.rig.clay_copy().unwrap().log();
        assert_eq!((log.waiting(), log.kept()), (0, 0));
    }
}

/// Where the server's tool feels the clay itself.
#[test]
#[allow(clippy::print_stdout, reason = "the figures are a result")]
fn clay_that_comes_back_under_the_tool_steps_no_force() {
    for scheme in [Scheme::ForceExchange, Scheme::PositionForce] {
        let rig = embedded(
            running(scheme),
            shaking(),
            viscous(2e5),
            both_ways(line(1, 0.0, 0.0), 1),
        );
        let mut told = Told::new(rig);
        (0..2400).for_each(|_| told.tick());
        let force = |told: &Told| told.rig.tool().frame().force_n;
        let step_n = at_device().step_n;
        let (mut largest_n, mut grown_n) = (0.0_f64, 0.0_f64);
        for _ in 0..4 {
            let before_undo = force(&told);
            let at = told.rig.tool().frame().position_m;
            told.undo();
            told.tick();
            let moved = norm(std::array::from_fn(|axis| {
                told.rig.tool().frame().position_m[axis] - at[axis]
            }));
            assert!(moved < 1e-3, "the tool is not moved");
            let after = force(&told);
            largest_n = largest_n.max(norm(std::array::from_fn(|axis| {
                after[axis] - before_undo[axis]
            })));
            (0..300).for_each(|_| told.tick());
            grown_n = grown_n.max(norm(force(&told)));
            (0..301).for_each(|_| told.tick());
        }
        println!(
            "{scheme:?}: {largest_n:.3} N in the tick, {grown_n:.2} N later, a step is {step_n:.3} N"
        );
        assert!(largest_n < 2.0 * step_n && step_n < grown_n);
        let server = told.rig.session().clay().clone().hash();
        assert_eq!(told.replay.clay().hash(), server);
    }
}

/// What the other one cuts goes on coming.
#[test]
fn the_copy_of_an_operator_who_rests_follows_an_exchange_as_well() {
    let rest = Intent::sinusoid([0.0; 3], 1.0).unwrap();
    let rig = carving(
        running(Scheme::Replica),
        rest,
        Material::default(),
        both_ways(line(5, 0.3, 0.1), 3),
    );
    let mut told = Told::new(rig);
    (0..500).for_each(|_| told.tick());
    // Nobody has cut, so there is nothing to be undone; all strokes since the first are none.
    told.exchange(Exchange::UndoneSince { stroke: 1 });
    (0..3000).for_each(|_| told.tick());
    told.assert_clay_is_one();
}
