//! A million random commands and frames, good ones and bad ones: whatever comes, the session keeps its promises.
//!
//! A twin session gets the same frames at the same times, and only the commands that the first one carried out. The two
//! stay equal to the last bit, so a refused command has changed nothing.

mod bench;

use std::collections::BTreeSet;

use bench::{TICK, new_session, setup};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{
    CopyState, Engagement, HandleFrame, Header, MAX_FRAME, SweepRecord, ToolFrame,
};
use teleclay_proto::http::{
    ClayReset, ClayShape, ImpairmentPatch, MaterialPatch, NetworkPatch, Operation, SessionPatch,
};
use teleclay_session::{
    Command, Event, EventKind, Operator, Release, RequestEnd, Session, Snapshot,
};

const TOOLS: u8 = 3;
/// Cases, and what happens in each.
const CASES: u32 = 500;
const STEPS: usize = 500;

#[expect(clippy::large_enum_variant, reason = "plain data of a test")]
#[derive(Clone, Debug)]
enum Step {
    Command(Command),
    /// Leaves under the lease of whoever holds this slot.
    Leave(usize),
    /// A fresh block, asked for by whoever holds this slot.
    Fresh(usize),
    Frame {
        slot: usize,
        kind: FrameKind,
        position_m: [f64; 3],
    },
    Ticks(u16),
    /// Nobody says anything for so long, ms.
    Silence(u16),
}

#[derive(Clone, Copy, Debug)]
enum FrameKind {
    Good,
    Idle,
    Leaving,
    AnotherLease,
    AnotherOwner,
    AnotherEpoch,
    AnotherScheme,
    Late,
    Sweeping,
    NotANumber,
}

fn commands() -> impl Strategy<Value = Command> {
    let number = |good: std::ops::Range<f64>| {
        prop_oneof![
            6 => prop::option::of(good),
            1 => prop_oneof![Just(f64::NAN), Just(-1.0), Just(1e300)].prop_map(Some),
        ]
    };
    let impairment = (
        number(0.0..0.02),
        number(0.0..0.005),
        number(0.0..0.5),
        any::<u16>(),
    )
        .prop_map(|(delay_s, jitter_s, loss, seed)| ImpairmentPatch {
            delay_s,
            jitter_s,
            loss,
            seed: Some(seed.into()),
            ..ImpairmentPatch::default()
        });
    let patch = (
        prop::option::weighted(0.3, 0..Scheme::ALL.len()),
        prop::option::of(number(0.0..1e6)),
        prop::option::of((impairment.clone(), impairment)),
        number(0.0..0.5),
        prop::option::weighted(0.3, any::<bool>()),
        prop::option::weighted(0.3, 0..Operation::ALL.len()),
    )
        .prop_map(
            |(scheme, viscosity, lines, deadband, paused, operation)| SessionPatch {
                scheme: scheme.map(|index| Scheme::ALL[index]),
                material: viscosity.map(|viscosity_pa_s_per_m| MaterialPatch {
                    viscosity_pa_s_per_m,
                    ..MaterialPatch::default()
                }),
                network: lines.map(|(up, down)| NetworkPatch {
                    up: Some(up),
                    down: Some(down),
                }),
                deadband,
                operation: operation.map(|index| Operation::ALL[index]),
                paused,
            },
        );
    let size = prop_oneof![6 => 0.01..0.04_f64, 1 => Just(-1.0), 1 => Just(1e3)];
    let reset = (
        prop::option::of([size.clone(), size.clone(), size]),
        prop::option::weighted(0.2, any::<u32>()),
    )
        .prop_map(|(size_m, lease)| Command::Reset {
            reset: ClayReset {
                shape: size_m.map(|size_m| ClayShape::Block { size_m }),
                material: None,
                layers: None,
            },
            lease,
        });
    let join = (0..5_u8).prop_map(|number| Command::Join {
        operator: Operator {
            name: format!("operator {number}"),
            device: "none".to_owned(),
        },
    });
    prop_oneof![
        4 => patch.prop_map(|patch| Command::Patch { patch }),
        1 => reset,
        4 => join,
        1 => any::<u32>().prop_map(|lease| Command::Leave { lease }),
        4 => manners(),
    ]
}

/// Stops, and what is asked of one tool; of tools that there are and that there are not.
fn manners() -> impl Strategy<Value = Command> {
    let name = || {
        prop_oneof![
            9 => (0..5_u8).prop_map(|number| format!("operator {number}")),
            1 => Just(String::new())
        ]
    };
    let tool = || 0..u32::from(TOOLS) + 2;
    let lease = || prop::option::weighted(0.1, any::<u32>());
    prop_oneof![
        1 => (name(), name()).prop_map(|(by, reason)| Command::Stop { by, reason }),
        4 => name().prop_map(|by| Command::ClearStop { by }),
        8 => (tool(), name()).prop_map(|(tool, operator)| Command::Request { tool, operator }),
        2 => (tool(), name()).prop_map(|(tool, operator)| Command::Withdraw { tool, operator }),
        6 => (tool(), name(), lease())
            .prop_map(|(tool, operator, lease)| Command::Grant { tool, operator, lease }),
        2 => (tool(), name(), name(), lease()).prop_map(
            |(tool, operator, reason, lease)| Command::Deny { tool, operator, reason, lease }
        ),
        1 => (tool(), lease()).prop_map(|(tool, lease)| Command::Release { tool, lease }),
    ]
}

fn steps() -> impl Strategy<Value = Step> {
    use FrameKind as Kind;
    let slot = 0..usize::from(TOOLS) + 1;
    let kind = prop_oneof![
        20 => Just(Kind::Good),
        12 => Just(Kind::Sweeping),
        2 => Just(Kind::Idle),
        1 => Just(Kind::Leaving),
        2 => Just(Kind::AnotherLease),
        2 => Just(Kind::AnotherOwner),
        2 => Just(Kind::AnotherEpoch),
        2 => Just(Kind::AnotherScheme),
        4 => Just(Kind::Late),
        1 => Just(Kind::NotANumber),
    ];
    prop_oneof![
        3 => commands().prop_map(Step::Command),
        1 => slot.clone().prop_map(Step::Leave),
        1 => slot.clone().prop_map(Step::Fresh),
        40 => (slot, kind, [-0.02..0.02_f64, -0.02..0.02_f64, -0.01..0.0_f64])
            .prop_map(|(slot, kind, position_m)| Step::Frame { slot, kind, position_m }),
        12 => (1..6_u16).prop_map(Step::Ticks),
        1 => prop_oneof![8 => 50..400_u16, 1 => 9_000..11_000_u16].prop_map(Step::Silence),
    ]
}

/// A session, what it told, and what its events have come to.
struct Told {
    session: Session,
    folded: Snapshot,
    events: Vec<Event>,
    frames: Vec<u8>,
}

impl Told {
    fn new() -> Self {
        let session = Session::new(setup(new_session(TOOLS)));
        Self {
            folded: session.snapshot(),
            session,
            events: Vec::new(),
            frames: Vec::new(),
        }
    }

    /// Takes everything that waits.
    fn poll(&mut self) {
        let mut buffer = [0; MAX_FRAME];
        while let Some((_, frame)) = self.session.poll_transmit() {
            assert_is_finite(frame);
            self.frames.extend_from_slice(frame.encode(&mut buffer));
        }
        while let Some(event) = self.session.poll_event() {
            self.folded.apply(&event);
            self.events.push(event);
        }
        while self.session.poll_retired().is_some() {}
    }
}

fn assert_is_finite(frame: &ToolFrame) {
    let numbers = [
        frame.position_m,
        frame.velocity_m_s,
        frame.force_n,
        frame.wave,
        frame.energy_in_j,
    ];
    assert!(numbers.iter().flatten().all(|number| number.is_finite()));
}

/// What handles send, with the numbers that go with the lease of each slot.
struct World {
    first: Told,
    twin: Told,
    now: Timestamp,
    sequences: [u32; TOOLS as usize + 1],
    sweeps: [u32; TOOLS as usize + 1],
    leases: BTreeSet<u32>,
    carried_out: Counts,
    refused: u64,
    initial_units: u64,
    remaining_units: u64,
    /// Whether tools added at the last check.
    added: bool,
}

#[derive(Debug, Default, PartialEq, Eq)]
struct Counts {
    patches: u64,
    resets: u64,
    joins: u64,
    leaves: u64,
    stops: u64,
    clears: u64,
    requests: u64,
    ended_requests: u64,
    grants: u64,
    taken_away: u64,
}

impl World {
    fn new() -> Self {
        let first = Told::new();
        let initial_units = first.session.clay().initial_units();
        Self {
            twin: Told::new(),
            first,
            now: Timestamp::ZERO.after(TICK),
            sequences: [0; TOOLS as usize + 1],
            sweeps: [0; TOOLS as usize + 1],
            leases: BTreeSet::new(),
            carried_out: Counts::default(),
            refused: 0,
            initial_units,
            remaining_units: initial_units,
            added: false,
        }
    }

    fn lease_of(&self, slot: usize) -> Option<u32> {
        self.first.session.side(slot).map(|side| side.lease())
    }

    fn step(&mut self, step: &Step) {
        match step {
            Step::Command(command) => self.command(command),
            Step::Leave(slot) => {
                let lease = self.lease_of(*slot).unwrap_or(0);
                self.command(&Command::Leave { lease });
            }
            Step::Fresh(slot) => {
                let lease = self.lease_of(*slot);
                self.command(&Command::Reset {
                    reset: ClayReset::default(),
                    lease,
                });
            }
            Step::Frame {
                slot,
                kind,
                position_m,
            } => {
                let frame = self.frame(*slot, *kind, *position_m);
                self.first.session.handle_frame(self.now, *slot, &frame);
                self.twin.session.handle_frame(self.now, *slot, &frame);
            }
            Step::Ticks(ticks) => (0..*ticks).for_each(|_| self.tick()),
            Step::Silence(ms) => {
                // The loop ticks, with a long step of time now and then to save work.
                let skipped = u32::from(*ms).saturating_sub(60);
                self.now = self.now.after(TICK * skipped);
                (0..60).for_each(|_| self.tick());
            }
        }
        self.check();
    }

    fn command(&mut self, command: &Command) {
        let before = self.first.session.revision();
        let was_stopped = self.first.session.snapshot().stop.is_some();
        let outcome = self.first.session.carry_out(self.now, command);
        let after = self.first.session.revision();
        let Ok(outcome) = outcome else {
            assert_eq!(before, after);
            assert_eq!(self.first.session.poll_event(), None);
            assert!(!matches!(command, Command::Stop { .. }), "stopping fails");
            self.refused += 1;
            return;
        };
        // Of two stops the second changes nothing.
        let is_told = !(was_stopped && matches!(command, Command::Stop { .. }));
        assert_eq!((before < after, outcome.revision), (is_told, after));
        let twins = self.twin.session.carry_out(self.now, command);
        assert_eq!(twins.as_ref(), Ok(&outcome));
        match command {
            Command::Patch { .. } => self.carried_out.patches += 1,
            Command::Reset { .. } => {
                self.carried_out.resets += 1;
                self.initial_units = self.first.session.clay().initial_units();
                self.remaining_units = self.initial_units;
            }
            Command::Join { .. } => {
                self.carried_out.joins += 1;
                let granted = outcome.granted.unwrap();
                assert!(0 < granted.lease && self.leases.insert(granted.lease));
                self.sweeps[granted.slot] = 0;
            }
            Command::Leave { .. } => self.carried_out.leaves += 1,
            Command::Stop { .. } => self.carried_out.stops += u64::from(is_told),
            Command::ClearStop { .. } => self.carried_out.clears += 1,
            Command::Request { .. } => self.carried_out.requests += 1,
            Command::Withdraw { .. } | Command::Deny { .. } => {
                self.carried_out.ended_requests += 1;
            }
            Command::Grant { .. } => self.carried_out.grants += 1,
            Command::Release { .. } => self.carried_out.taken_away += 1,
        }
    }

    fn frame(&mut self, slot: usize, kind: FrameKind, position_m: [f64; 3]) -> HandleFrame {
        let session = &self.first.session;
        self.sequences[slot] += 1;
        let mut frame = HandleFrame {
            header: Header {
                lease: self.lease_of(slot).unwrap_or(77),
                sequence: self.sequences[slot],
                sent_ns: self.now.as_nanos(),
                scheme: session.settings().spec.scheme,
                revision: session.revision() as u32,
                clay_epoch: session.clay_epoch(),
                ownership_epoch: session.ownership_epoch(),
                ..Header::default()
            },
            engagement: Engagement::Engaged,
            position_m,
            velocity_m_s: position_m,
            hand_force_n: position_m.map(|x| 100.0 * x),
            ..HandleFrame::default()
        };
        match kind {
            FrameKind::Good => {}
            FrameKind::Idle => frame.engagement = Engagement::Idle,
            FrameKind::Leaving => frame.engagement = Engagement::Leaving,
            FrameKind::AnotherLease => frame.header.lease ^= 1 << 20,
            FrameKind::AnotherOwner => frame.header.ownership_epoch += 1,
            FrameKind::AnotherEpoch => frame.header.clay_epoch ^= 1,
            FrameKind::AnotherScheme => frame.header.scheme = Scheme::Replica,
            FrameKind::Late => frame.header.sequence = frame.header.sequence.saturating_sub(3),
            FrameKind::NotANumber => frame.hand_force_n[1] = f64::NAN,
            FrameKind::Sweeping => {}
        }
        if !matches!(kind, FrameKind::Good | FrameKind::NotANumber) {
            self.add_sweeps(slot, &mut frame, position_m);
        }
        frame
    }

    fn add_sweeps(&mut self, slot: usize, frame: &mut HandleFrame, position_m: [f64; 3]) {
        frame.copy = CopyState::Live;
        frame.sweeps.oldest_unacknowledged = 1;
        let home_m = self.first.session.settings().parameters.home_m;
        let at: [i32; 3] = std::array::from_fn(|axis| {
            ((home_m[axis] + position_m[axis]) * f64::from(1 << 24)) as i32
        });
        for _ in 0..2 {
            self.sweeps[slot] += 1;
            let record = SweepRecord {
                sequence: self.sweeps[slot],
                from: at,
                to: [at[0] + 20_000, at[1], at[2]],
            };
            frame.sweeps.push(record).unwrap();
        }
    }

    fn tick(&mut self) {
        for told in [&mut self.first, &mut self.twin] {
            told.session.tick(self.now);
            told.poll();
        }
        self.now = self.now.after(TICK);
    }

    fn check(&mut self) {
        for told in [&mut self.first, &mut self.twin] {
            told.poll();
        }
        let session = &self.first.session;
        let clay = session.clay();
        assert_eq!(clay.initial_units(), self.initial_units);
        assert_eq!(
            clay.removed_units() + clay.remaining_units(),
            clay.initial_units()
        );
        // What it is told now, or was until this step.
        let adds = session.settings().spec.operation == Operation::Add;
        assert!(
            clay.remaining_units() <= self.remaining_units || adds || self.added,
            "clay does not come back by itself"
        );
        self.added = adds;
        self.remaining_units = clay.remaining_units();
        // The fold of the events is the state, but for the tick, which goes on without events.
        let snapshot = Snapshot {
            tick: self.first.folded.tick,
            ..session.snapshot()
        };
        assert_eq!(self.first.folded, snapshot);
        if snapshot.stop.is_some() {
            assert!((0..TOOLS.into()).all(|slot| self.lease_of(slot).is_none()));
        }
        for tool in &snapshot.tools {
            let is_held = tool.holder.is_some();
            assert!(tool.requests.is_empty() || is_held, "asked of nobody");
            assert!(tool.reserved_for.is_none() || !is_held, "kept and held");
        }
        let held: Vec<u32> = (0..TOOLS.into())
            .filter_map(|slot| self.lease_of(slot))
            .collect();
        let distinct: BTreeSet<u32> = held.iter().copied().collect();
        assert_eq!(
            distinct.len(),
            held.len(),
            "one holder a tool, one tool a holder"
        );
        assert_eq!(self.first.events, self.twin.events);
        assert!(
            self.first.frames == self.twin.frames,
            "a refused command has changed something"
        );
    }

    /// Every change was told exactly once.
    fn check_events(&mut self) {
        let mut told = Counts::default();
        let mut released = 0;
        let mut connected = [false; TOOLS as usize];
        let mut revision = 0;
        for event in &self.first.events {
            assert!(revision <= event.revision, "revisions do not fall");
            let is_change = !matches!(
                event.kind,
                EventKind::Connected { .. } | EventKind::Disconnected { .. }
            );
            assert!(
                !is_change || revision < event.revision,
                "a change is a revision"
            );
            revision = event.revision;
            match &event.kind {
                EventKind::Changed { .. } => told.patches += 1,
                EventKind::FreshBlock { .. } => told.resets += 1,
                EventKind::Taken { .. } => told.joins += 1,
                EventKind::Released { slot, because, .. } => {
                    released += 1;
                    match because {
                        Release::HandedOver { .. } => told.grants += 1,
                        Release::TakenAway => told.taken_away += 1,
                        _ => {}
                    }
                    connected[*slot] = false;
                }
                EventKind::Connected { slot } => {
                    assert!(!std::mem::replace(&mut connected[*slot], true));
                }
                EventKind::Disconnected { slot } => {
                    assert!(std::mem::replace(&mut connected[*slot], false));
                }
                EventKind::Stopped { .. } => told.stops += 1,
                EventKind::StopCleared { .. } => told.clears += 1,
                EventKind::Requested { .. } => told.requests += 1,
                EventKind::RequestEnded { because, .. } => {
                    told.ended_requests += u64::from(*because != RequestEnd::RanOut);
                }
                EventKind::Fault { .. }
                | EventKind::Exchanged { .. }
                | EventKind::ReservationEnded { .. } => {}
            }
        }
        told.leaves = self.carried_out.leaves;
        assert_eq!(told, self.carried_out);
        let held = (0..TOOLS.into())
            .filter(|slot| self.lease_of(*slot).is_some())
            .count();
        assert_eq!(told.joins, released + held as u64);
        assert_eq!(
            self.first.session.clay_mut().hash(),
            self.twin.session.clay_mut().hash()
        );
    }
}

#[test]
#[allow(clippy::print_stdout, reason = "the counts are a result")]
fn a_million_commands_and_frames_break_no_promise() {
    // Four parts that run beside one another, each with draws of its own.
    let parts: Vec<_> = (0..4_u8)
        .map(|part| std::thread::spawn(move || run_part(part)))
        .collect();
    let mut totals = [0; 4];
    for part in parts {
        let counts = part.join().unwrap();
        for (total, count) in totals.iter_mut().zip(counts) {
            *total += count;
        }
    }
    let [steps, carried_out, refused, removed] = totals;
    println!(
        "{steps} commands, frames and pauses: {carried_out} commands carried out, {refused} refused; {removed} units of clay removed"
    );
    assert!(1_000_000 <= steps);
    assert!(10_000 < carried_out && 1_000 < refused && 0 < removed);
}

fn run_part(part: u8) -> [u64; 4] {
    let mut seed = [0; 32];
    seed[0] = part;
    let config = Config {
        cases: CASES,
        failure_persistence: None,
        ..Config::default()
    };
    let random = proptest::test_runner::TestRng::from_seed(
        proptest::test_runner::RngAlgorithm::ChaCha,
        &seed,
    );
    let mut runner = TestRunner::new_with_rng(config, random);
    let counts = std::cell::Cell::new([0; 4]);
    let outcome = runner.run(&prop::collection::vec(steps(), STEPS), |steps| {
        let mut world = World::new();
        for step in &steps {
            world.step(step);
        }
        world.check_events();
        let mut sum = counts.get();
        let carried_out = &world.carried_out;
        let manners = carried_out.stops + carried_out.grants + carried_out.requests;
        let all = carried_out.patches + carried_out.resets + carried_out.joins + carried_out.leaves;
        let all = all + manners;
        let removed = world.first.session.clay().removed_units();
        for (total, count) in sum
            .iter_mut()
            .zip([steps.len() as u64, all, world.refused, removed])
        {
            *total += count;
        }
        counts.set(sum);
        Ok(())
    });
    outcome.unwrap();
    counts.get()
}
