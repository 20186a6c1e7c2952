//! A server that is killed while it cuts, by the process or by the power, and goes on from its journal: no cut that a
//! living handle made is lost, and both clays are one.

#[path = "rigs/mod.rs"]
mod rigs;

use std::time::Duration;

use rigs::{TICK, both_ways, carving, cutting, line, running};
use teleclay_bilateral::tool_shape;
use teleclay_clay::{Clay, Pose, Sweep, ToolShape};
use teleclay_history::{Fact, Ledger, Record, Recorder, Replay, State};
use teleclay_journal::memory::Memory;
use teleclay_journal::{Policy, Reader, Snapshot, Writer, write_snapshot};
use teleclay_proto::frame::CopyState;
use teleclay_proto::{Material, Scheme};
use teleclay_session::{Rules, Session};
use teleclay_sim::rig::{Halt, Rig};

const KILLS: u32 = 4;

/// Records wait for so long until they are written: as long as the thread of a server may take to look for them.
const COMMITTED_WITHIN: Duration = Duration::from_millis(8);

fn policy() -> Policy {
    Policy {
        commit_within: COMMITTED_WITHIN,
        ..Policy::default()
    }
}

/// The part of a server that keeps a journal.
struct Keeper {
    writer: Writer<Memory>,
    recorder: Recorder,
    ledger: Ledger,
}

/// The block with every cut that the hand has ever made in its copy, whatever became of it on the way.
struct Felt {
    clay: Clay,
    shape: ToolShape,
    next: u32,
}

impl Felt {
    fn new(rig: &Rig) -> Self {
        Self {
            clay: rig.block().clone(),
            shape: tool_shape(&rig.session().settings().parameters.tool).unwrap(),
            next: 1,
        }
    }

    fn watch(&mut self, rig: &Rig) {
        let Some(copy) = rig.clay_copy() else { return };
        while self.next <= copy.log().last() {
            let record = copy.log().record(self.next).unwrap();
            self.clay.carve(&Sweep {
                shape: self.shape,
                from: Pose::from_steps(record.from),
                to: Pose::from_steps(record.to),
            });
            self.next += 1;
        }
    }
}

impl Keeper {
    fn new(disk: &Memory, tools: usize) -> Self {
        let reader = Reader::open(disk.clone()).unwrap();
        Self {
            writer: Writer::go_on(reader, policy()).unwrap(),
            recorder: Recorder::new(tools),
            ledger: Ledger::new(),
        }
    }

    fn keep(&mut self, rig: &mut Rig) {
        let now = Duration::from_nanos(rig.now().as_nanos());
        let tick = rig.session().ticks();
        let record = self.recorder.record(rig.session(), rig.events().iter());
        if let Some(record) = record {
            let sequence = self.writer.push(now, record).unwrap();
            self.ledger.push(sequence, tick);
        }
        self.writer.step(now);
        let durable = self.ledger.durable_tick(self.writer.durable(), tick);
        rig.session_mut().set_durable(durable);
        let frame = rig.tool().frame();
        assert!(frame.sweeps_durable <= frame.sweeps_acknowledged);
    }

    fn push(&mut self, record: &[u8], rig: &Rig) {
        let now = Duration::from_nanos(rig.now().as_nanos());
        let sequence = self.writer.push(now, record).unwrap();
        self.ledger.push(sequence, rig.session().ticks());
    }
}

/// What the journal tells, from its newest snapshot on; from its beginning where it has none.
fn replayed(disk: &Memory, rig: &Rig) -> (Replay, u64) {
    let reader = Reader::verify(disk.clone()).unwrap();
    assert_eq!(reader.damage(), []);
    let given = vec![rig.block().clone()];
    let snapshot = reader.snapshot_before(reader.last()).unwrap();
    let from = snapshot
        .as_ref()
        .map_or(1, |snapshot| snapshot.sequence + 1);
    let mut records = reader.records_from(from).map(|record| record.unwrap());
    let mut replay = match snapshot {
        Some(snapshot) => Replay::from_state(State::decode(&snapshot.payload).unwrap(), given),
        None => Replay::begin(&records.next().unwrap().payload, given).unwrap(),
    };
    for record in records {
        replay.apply(&record.payload).unwrap();
    }
    (replay, reader.last())
}

struct Lot(u64);

impl Lot {
    fn draw(&mut self, below: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 33) % below
    }
}

/// A rig whose server is killed so often at random moments. Gives the rig, its disk, and how many sweeps the handle was
/// told to be merged that the next server did not have.
fn killed(scheme: Scheme, delay_ms: u32, seed: u64) -> (Rig, Keeper, Memory, Felt, u32) {
    let mut lot = Lot(seed);
    let lines = both_ways(line(delay_ms, 0.3, 0.1), seed);
    let mut rig = carving(running(scheme), cutting(), Material::default(), lines);
    let disk = Memory::new(seed);
    let mut keeper = Keeper::new(&disk, 1);
    rig.session_mut().keep_journal();
    let hash = rig.block().clone().hash();
    let first = keeper.recorder.begin(rig.session(), Some(hash)).to_vec();
    keeper.push(&first, &rig);
    let (mut felt, mut missing) = (Felt::new(&rig), 0);
    for kill in 0..KILLS {
        for _ in 0..500 + lot.draw(1500) {
            rig.tick();
            keeper.keep(&mut rig);
            felt.watch(&rig);
        }
        let told = *rig.tool().frame();
        rig.halt_session(Halt::Program, Duration::from_secs(9));
        if lot.draw(3) == 0 {
            disk.kill();
        } else {
            disk.crash();
        }
        rig.run_for(TICK * (100 + lot.draw(1500) as u32));
        felt.watch(&rig);
        let (mut replay, last) = replayed(&disk, &rig);
        let mut state = replay.state();
        assert!(
            told.sweeps_durable <= state.decided[0],
            "what was durable is there"
        );
        missing += told.sweeps_acknowledged.saturating_sub(state.decided[0]);
        if kill == 1 && seed % 2 == 1 {
            let snapshot = Snapshot {
                sequence: last,
                epoch: kill,
                payload: state.encode(),
            };
            // What was found counts as durable only when the next writer has written it.
            let mut writer = Writer::go_on(Reader::open(disk.clone()).unwrap(), policy()).unwrap();
            writer.flush(Duration::ZERO);
            assert_eq!(writer.durable(), last);
            write_snapshot(&mut disk.clone(), &snapshot).unwrap();
            disk.kill();
        }
        let recovery = state.into_recovery(Rules::default());
        let mut session = Session::recover(rig.now(), recovery).unwrap();
        session.keep_journal();
        rig.replace_session(session);
        keeper = Keeper::new(&disk, 1);
        let again = keeper.recorder.go_on(rig.session()).to_vec();
        keeper.push(&again, &rig);
        if kill % 2 == 1 {
            // A handle that is a program of its own joins anew, at once.
            rig.renew_lease(0).unwrap();
        }
    }
    (rig, keeper, disk, felt, missing)
}

fn run(rig: &mut Rig, keeper: &mut Keeper, ticks: u32) {
    for _ in 0..ticks {
        rig.tick();
        keeper.keep(rig);
    }
}

#[test]
#[allow(clippy::print_stdout, reason = "the counts are a result")]
fn no_cut_of_a_living_handle_is_lost_when_the_server_is_killed_while_it_cuts() {
    let (mut sweeps, mut cuts, mut missing) = (0, 0, 0);
    for seed in 0..12 {
        let delay_ms = [0, 5, 25, 60][seed as usize % 4];
        let (mut rig, mut keeper, disk, mut felt, lacked) = killed(Scheme::Replica, delay_ms, seed);
        run(&mut rig, &mut keeper, 1500);
        felt.watch(&rig);
        rig.hold_handles_fast();
        run(&mut rig, &mut keeper, 6000);
        felt.watch(&rig);
        let replica = rig.clay_copy().unwrap();
        assert_eq!(replica.state(), CopyState::Live, "seed {seed}");
        let log = replica.log();
        assert_eq!((log.waiting(), log.kept()), (0, 0), "seed {seed}");
        let at_handle = replica.copy().unwrap().clay().clone().hash();
        assert_eq!(
            at_handle,
            rig.session().clay().clone().hash(),
            "seed {seed}"
        );
        assert_eq!(at_handle, felt.clay.hash(), "seed {seed}: a cut is lost");
        let (mut replay, _) = replayed(&disk, &rig);
        assert_eq!(replay.clay().hash(), at_handle, "seed {seed}");
        if seed.is_multiple_of(2) {
            // The journal goes back to the beginning.
            sweeps += log.last();
            cuts += cuts_in(&disk);
        }
        missing += lacked;
    }
    println!(
        "{sweeps} sweeps, {cuts} merged; next servers lacked {missing} that were acknowledged"
    );
    assert!(0 < missing, "no kill came between merge and journal");
    // Those that came behind a gap are asked for again, and remove nothing.
    assert!(sweeps <= cuts && cuts < sweeps + sweeps / 100);
}

/// Sweeps that the journal says were merged.
fn cuts_in(disk: &Memory) -> u32 {
    let reader = Reader::open(disk.clone()).unwrap();
    let records = reader.records_from(1);
    let facts = records.flat_map(|record| Record::decode(&record.unwrap().payload).unwrap().facts);
    let counts = facts.map(|fact| match fact {
        Fact::Cuts { cuts, .. } => cuts.len() as u32,
        _ => 0,
    });
    counts.sum()
}

#[test]
fn under_force_exchange_the_journal_is_the_servers_clay_and_the_tool_goes_on_cutting() {
    for seed in 0..8 {
        let (mut rig, mut keeper, disk, ..) = killed(Scheme::ForceExchange, 5, seed);
        let before = rig.session().clay().removed_units();
        run(&mut rig, &mut keeper, 1500);
        assert!(before < rig.session().clay().removed_units(), "seed {seed}");
        rig.hold_handles_fast();
        run(&mut rig, &mut keeper, 1000);
        let (mut replay, _) = replayed(&disk, &rig);
        let hash = rig.session().clay().clone().hash();
        assert_eq!(replay.clay().hash(), hash, "seed {seed}");
        assert_eq!(rig.session().ownership_epoch(), 1 + KILLS);
    }
}

/// When nothing becomes durable for long, cutting pauses before the handle has to forget anything.
#[test]
fn a_handle_whose_cuts_do_not_become_durable_stops_cutting_and_loses_none() {
    let lines = both_ways(line(5, 0.0, 0.0), 1);
    let mut rig = carving(
        running(Scheme::Replica),
        cutting(),
        Material::default(),
        lines,
    );
    rig.session_mut().keep_journal();
    rig.run_for(Duration::from_secs(12));
    let replica = rig.clay_copy().unwrap();
    assert_eq!(replica.state(), CopyState::Stale);
    let kept = replica.log().kept();
    assert!((6_500..7_000).contains(&kept), "{kept}");
    assert!(replica.log().waiting() < 100, "all is merged");
    rig.run_for(Duration::from_secs(2));
    assert_eq!(rig.clay_copy().unwrap().log().kept(), kept);
    let tick = rig.session().ticks();
    rig.session_mut().set_durable(tick);
    rig.run_for(Duration::from_millis(100));
    let replica = rig.clay_copy().unwrap();
    assert_eq!(replica.state(), CopyState::Live);
    assert!(kept < replica.log().last() as usize && replica.log().kept() < 200);
}
