//! A session that lives, what it told, and what it was at some points.

#![allow(dead_code, reason = "each test uses a part")]

use teleclay_clay::Clay;
use teleclay_history::{Recorder, Replay, ReplayError, State, Whose};
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{CopyState, Engagement, HandleFrame, Header, SweepRecord};
use teleclay_proto::http::{ClayReset, ClayShape, MaterialPatch, Operation, SessionPatch};
use teleclay_session::{
    Command, Event, Exchange, Operator, Prepared, Refusal, Rules, Session, Snapshot, ToolCuts,
};

use crate::bench::{TICK, new_session, setup};

const TOOLS: u8 = 3;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Counts {
    pub(crate) points: u64,
    pub(crate) points_from_snapshots: u64,
    pub(crate) restarts: u64,
    pub(crate) exchanges: u64,
    pub(crate) fresh_blocks: u64,
    pub(crate) earlier_bases: u64,
    pub(crate) removing_ticks: u64,
    pub(crate) adding_ticks: u64,
    pub(crate) smoothing_ticks: u64,
    pub(crate) records: u64,
    pub(crate) bytes: u64,
    pub(crate) stops: u64,
    pub(crate) grants: u64,
    pub(crate) other_manners: u64,
    pub(crate) points_stopped: u64,
    pub(crate) points_reserved: u64,
}

impl Counts {
    pub(crate) fn add(&mut self, other: &Self) {
        self.points += other.points;
        self.points_from_snapshots += other.points_from_snapshots;
        self.restarts += other.restarts;
        self.exchanges += other.exchanges;
        self.fresh_blocks += other.fresh_blocks;
        self.earlier_bases += other.earlier_bases;
        self.removing_ticks += other.removing_ticks;
        self.adding_ticks += other.adding_ticks;
        self.smoothing_ticks += other.smoothing_ticks;
        self.records += other.records;
        self.bytes += other.bytes;
        self.stops += other.stops;
        self.grants += other.grants;
        self.other_manners += other.other_manners;
        self.points_stopped += other.points_stopped;
        self.points_reserved += other.points_reserved;
    }
}

/// What a session was after so many records.
pub(crate) struct Point {
    pub(crate) records: usize,
    session: Snapshot,
    next_lease: u32,
    decided: Vec<u32>,
    clay: Clay,
}

/// A session and its records.
pub(crate) struct Live {
    pub(crate) session: Session,
    recorder: Recorder,
    /// What a server would have read by now.
    replay: Replay,
    events: Vec<Event>,
    pub(crate) records: Vec<Vec<u8>>,
    pub(crate) points: Vec<Point>,
}

pub(crate) struct World {
    pub(crate) live: Live,
    pub(crate) counts: Counts,
    now: Timestamp,
    lot: u64,
    sequences: [u32; TOOLS as usize],
    sweeps: [u32; TOOLS as usize],
}

/// What is to outlive the process: who asks for a tool is not.
pub(crate) fn kept(mut session: Snapshot) -> Snapshot {
    for tool in &mut session.tools {
        tool.requests.clear();
    }
    session
}

/// The replayed state is the session's, to the last bit.
pub(crate) fn assert_same(state: &mut State, point: &Point) {
    let told = Snapshot {
        tick: state.session.tick,
        ..point.session.clone()
    };
    assert_eq!(state.session, told);
    assert_eq!(state.session.tick, point.session.tick);
    assert_eq!(state.next_lease, point.next_lease);
    assert_eq!(state.decided, point.decided);
    assert_same_clay(&state.clay, &point.clay);
}

pub(crate) fn assert_same_clay(one: &Clay, other: &Clay) {
    assert_eq!(one.grid(), other.grid());
    assert_eq!(one.initial_units(), other.initial_units());
    assert_eq!(one.removed_units(), other.removed_units());
    for dense in 0..one.grid().brick_count() as u32 {
        let brick = one.grid().brick_index(dense).unwrap();
        assert!(one.brick(brick) == other.brick(brick), "brick {dense}");
    }
}

impl Live {
    pub(crate) fn new(session: Session) -> Self {
        let mut recorder = Recorder::new(session.tools());
        let first = recorder.begin(&session, None).to_vec();
        Self {
            replay: Replay::begin(&first, Vec::new()).unwrap(),
            session,
            recorder,
            events: Vec::new(),
            records: vec![first],
            points: Vec::new(),
        }
    }

    /// One tick, and the record of it if there is one.
    pub(crate) fn tick(&mut self, now: Timestamp) -> bool {
        self.session.tick(now);
        self.record()
    }

    /// The record of what happened since the last one, if anything did.
    pub(crate) fn record(&mut self) -> bool {
        while self.session.poll_transmit().is_some() {}
        while let Some(event) = self.session.poll_event() {
            self.events.push(event);
        }
        while self.session.poll_retired().is_some() {}
        let record = self.recorder.record(&self.session, self.events.iter());
        let record = record.map(<[u8]>::to_vec);
        self.events.clear();
        let Some(record) = record else { return false };
        self.replay.apply(&record).unwrap();
        self.records.push(record);
        true
    }

    pub(crate) fn note(&mut self) {
        let session = &self.session;
        let decided = (0..session.tools())
            .map(|slot| session.side(slot).map_or(0, |side| side.sweeps_decided()));
        self.points.push(Point {
            records: self.records.len(),
            session: kept(session.snapshot()),
            next_lease: session.next_lease(),
            decided: decided.collect(),
            clay: session.clay().clone(),
        });
    }

    /// Another server goes on.
    pub(crate) fn restart(&mut self, now: Timestamp) {
        let before = self.session.snapshot();
        let state = self.replay.state();
        self.session = Session::recover(now, state.into_recovery(Rules::default())).unwrap();
        let after = self.session.snapshot();
        assert_eq!(after.ownership_epoch, before.ownership_epoch + 1);
        assert_eq!(after.stop, before.stop);
        for (after, before) in after.tools.iter().zip(&before.tools) {
            assert_eq!(after.reserved_for, before.reserved_for);
            assert!(after.requests.is_empty());
        }
        assert_eq!(
            (after.revision, after.clay_epoch, &after.settings),
            (before.revision, before.clay_epoch, &before.settings)
        );
        let record = self.recorder.go_on(&self.session).to_vec();
        self.replay.apply(&record).unwrap();
        self.records.push(record);
    }

    /// Gives the session clay without a stroke, or with one again.
    pub(crate) fn exchange(&mut self, now: Timestamp, exchange: Exchange) -> Result<(), Refusal> {
        let prepared = self.prepare(exchange);
        self.carry_out(now, prepared)
    }

    pub(crate) fn carry_out(
        &mut self,
        now: Timestamp,
        mut prepared: Prepared,
    ) -> Result<(), Refusal> {
        self.session.handle_command(now, &mut prepared).map(|_| ())
    }

    /// The records are the session.
    pub(crate) fn assert_replay_is_live(&mut self) {
        assert_same_clay(self.replay.clay(), self.session.clay());
    }

    /// Clay without a stroke, or with one again, as of the last record.
    pub(crate) fn prepare(&self, exchange: Exchange) -> Prepared {
        let exchanged = match self.replay.exchanged(exchange) {
            Ok(exchanged) => exchanged,
            Err(ReplayError::EarlierBaseNeeded { .. }) => panic!("it began at the beginning"),
            Err(error) => panic!("{error}"),
        };
        Prepared::exchange(exchanged, self.session.settings())
    }

    pub(crate) fn strokes(&self) -> &teleclay_history::Strokes {
        self.replay.strokes()
    }
}

impl World {
    pub(crate) fn new(seed: u64) -> Self {
        let session = Session::new(setup(new_session(TOOLS)));
        Self {
            live: Live::new(session),
            counts: Counts::default(),
            now: Timestamp::ZERO.after(TICK),
            lot: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15),
            sequences: [0; TOOLS as usize],
            sweeps: [0; TOOLS as usize],
        }
    }

    fn draw(&mut self, below: u64) -> u64 {
        self.lot = self
            .lot
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.lot >> 33) % below
    }

    fn share(&mut self) -> f64 {
        self.draw(1 << 30) as f64 / f64::from(1 << 30)
    }

    pub(crate) fn step(&mut self) {
        match self.draw(100) {
            0..4 => self.command(),
            4..8 => self.manners(),
            8..10 => self.exchange(),
            10 => {
                let skipped = [100, 300, 2000, 11_000][self.draw(4) as usize];
                self.now = self.now.after(TICK * skipped);
                self.ticks(30);
            }
            11 if self.draw(3) == 0 => {
                // What is not recorded yet is lost: so nothing is.
                self.tick();
                self.live.restart(self.now);
                self.counts.restarts += 1;
            }
            12..40 => {
                let ticks = 1 + self.draw(5);
                self.ticks(ticks);
            }
            _ => self.frames(),
        }
    }

    fn ticks(&mut self, ticks: u64) {
        (0..ticks).for_each(|_| self.tick());
    }

    fn tick(&mut self) {
        let before = self.live.session.clay().removed_units();
        if self.live.tick(self.now) {
            self.counts.records += 1;
            self.counts.bytes += self.live.records.last().unwrap().len() as u64;
            if self.draw(8) == 0 {
                self.live.note();
                let noted = self.live.session.snapshot();
                let is_reserved = noted.tools.iter().any(|tool| tool.reserved_for.is_some());
                self.counts.points_stopped += u64::from(noted.stop.is_some());
                self.counts.points_reserved += u64::from(is_reserved);
            }
        }
        let after = self.live.session.clay().removed_units();
        self.counts.removing_ticks += u64::from(before < after);
        self.counts.adding_ticks += u64::from(after < before);
        let smooths = |made: ToolCuts<'_>| {
            made.operation == teleclay_clay::Operation::Smooth && 0 < made.moved_units
        };
        let smoothed = self.live.session.cuts().any(smooths);
        self.counts.smoothing_ticks += u64::from(smoothed);
        self.now = self.now.after(TICK);
    }

    /// Somebody stops, clears the stop, asks for a tool or hands one over.
    fn manners(&mut self) {
        let tool = 1 + self.draw(TOOLS.into()) as u32;
        let asked = self.live.session.snapshot().tools[tool as usize - 1]
            .requests
            .first()
            .map(ToString::to_string);
        let operator = format!("operator {}", self.draw(4));
        let lease = None;
        let command = match self.draw(16) {
            0 if self.draw(2) == 0 => Command::Stop {
                by: operator,
                reason: "a hand in the way".to_owned(),
            },
            0..4 => Command::ClearStop { by: operator },
            4..10 => Command::Request { tool, operator },
            10 => Command::Withdraw { tool, operator },
            11 => Command::Deny {
                tool,
                operator,
                reason: "not now".to_owned(),
                lease,
            },
            12 => Command::Release { tool, lease },
            _ => Command::Grant {
                tool,
                operator: asked.unwrap_or(operator),
                lease,
            },
        };
        if self.live.session.carry_out(self.now, &command).is_err() {
            return;
        }
        match command {
            Command::Stop { .. } => self.counts.stops += 1,
            Command::Grant { .. } => self.counts.grants += 1,
            _ => self.counts.other_manners += 1,
        }
    }

    fn command(&mut self) {
        let slot = self.draw(TOOLS.into()) as usize;
        let lease = self.live.session.side(slot).map_or(9, |side| side.lease());
        let command = match self.draw(10) {
            0..5 => Command::Join {
                operator: Operator {
                    name: format!("operator {}", self.draw(4)),
                    device: "none".to_owned(),
                },
            },
            5 => Command::Leave { lease },
            6 | 7 => {
                let size_m = [0.02 + 0.02 * self.share(), 0.03, 0.016];
                let shape = (self.draw(2) == 0).then_some(ClayShape::Block { size_m });
                Command::Reset {
                    reset: ClayReset {
                        shape,
                        material: None,
                        layers: None,
                    },
                    lease: None,
                }
            }
            8 => {
                let scheme = Scheme::ALL[self.draw(Scheme::ALL.len() as u64) as usize];
                let operation = if scheme == Scheme::Replica {
                    Operation::Cut
                } else {
                    Operation::ALL[self.draw(Operation::ALL.len() as u64) as usize]
                };
                Command::Patch {
                    patch: SessionPatch {
                        scheme: Some(scheme),
                        operation: Some(operation),
                        ..SessionPatch::default()
                    },
                }
            }
            _ => Command::Patch {
                patch: SessionPatch {
                    paused: Some(self.draw(4) == 0),
                    material: Some(MaterialPatch {
                        viscosity_pa_s_per_m: Some(1e5 * self.share()),
                        ..MaterialPatch::default()
                    }),
                    ..SessionPatch::default()
                },
            },
        };
        let outcome = self.live.session.carry_out(self.now, &command);
        if let (Ok(outcome), Command::Reset { .. }) = (&outcome, &command) {
            assert!(outcome.granted.is_none());
            self.counts.fresh_blocks += 1;
        }
        if let Some(granted) = outcome.ok().and_then(|outcome| outcome.granted) {
            self.sweeps[granted.slot] = 0;
        }
    }

    fn exchange(&mut self) {
        let name = format!("operator {}", self.draw(4));
        let whose = match self.draw(3) {
            0 => Whose::Anybodys,
            1 => Whose::Tools(self.draw(TOOLS.into()) as usize),
            _ => Whose::Operators(&name),
        };
        let strokes = self.live.strokes();
        let exchange = match self.lot % 4 {
            0 => strokes
                .to_redo(whose)
                .map(|stroke| Exchange::Redone { stroke }),
            1 if self.lot % 16 == 1 => strokes
                .to_undo(whose)
                .map(|stroke| Exchange::UndoneSince { stroke }),
            _ => strokes
                .to_undo(whose)
                .map(|stroke| Exchange::Undone { stroke }),
        };
        let Some(exchange) = exchange else { return };
        let units = |session: &Session| {
            let clay = session.clay();
            assert_eq!(
                clay.removed_units() + clay.remaining_units(),
                clay.initial_units()
            );
        };
        let was = self.live.session.clay_epoch();
        match self.live.exchange(self.now, exchange) {
            Ok(()) => {
                self.counts.exchanges += 1;
                assert_eq!(self.live.session.clay_epoch(), was + 1);
            }
            // A command since the last record has put in a fresh block.
            Err(Refusal::OtherClay { .. }) => {}
            Err(refusal) => panic!("{refusal}"),
        }
        units(&self.live.session);
        // Its record has to come before the next exchange is made.
        let cutting = self.draw(2);
        if 0 < cutting {
            self.frames();
        }
        self.tick();
    }

    /// Every tool's holder sends, mostly what cuts.
    fn frames(&mut self) {
        for slot in 0..TOOLS.into() {
            if self.live.session.side(slot).is_none() || self.draw(6) == 0 {
                continue;
            }
            let frame = self.frame(slot);
            self.live.session.handle_frame(self.now, slot, &frame);
        }
        self.tick();
    }

    fn frame(&mut self, slot: usize) -> HandleFrame {
        self.sequences[slot] += 1;
        let position_m = [
            0.03 * (self.share() - 0.5),
            0.02 * (self.share() - 0.5),
            -0.012 * self.share(),
        ];
        let session = &self.live.session;
        let mut frame = HandleFrame {
            header: Header {
                lease: session.side(slot).map_or(9, |side| side.lease()),
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
            hand_force_n: position_m.map(|x| 300.0 * x),
            ..HandleFrame::default()
        };
        match self.draw(60) {
            0 => frame.engagement = Engagement::Leaving,
            1 => frame.header.clay_epoch ^= 1,
            2 => frame.hand_force_n[1] = f64::NAN,
            3 => frame.engagement = Engagement::Idle,
            _ => {}
        }
        if self.draw(3) != 0 {
            self.add_sweeps(slot, &mut frame);
        }
        frame
    }

    fn add_sweeps(&mut self, slot: usize, frame: &mut HandleFrame) {
        frame.copy = CopyState::Live;
        frame.sweeps.oldest_unacknowledged = 1;
        let home_m = self.live.session.settings().parameters.home_m;
        let at: [i32; 3] = std::array::from_fn(|axis| {
            ((home_m[axis] + frame.position_m[axis]) * f64::from(1 << 24)) as i32
        });
        let mut from = at;
        for _ in 0..1 + self.draw(3) {
            // Some never come, and some are too fast.
            self.sweeps[slot] += 1 + u32::from(self.draw(20) == 0);
            let to = [from[0] + self.draw(30_000) as i32, from[1] - 9_000, from[2]];
            let sequence = self.sweeps[slot];
            let record = SweepRecord { sequence, from, to };
            frame.sweeps.push(record).unwrap();
            from = to;
        }
    }
}
