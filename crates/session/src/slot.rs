//! One tool's slot: the line up, the line down, and the tool side while somebody holds it.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use teleclay_bilateral::{ToolSide, ToolStep};
use teleclay_link::conditioner::Conditioner;
use teleclay_link::safety::Implausible;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{HandleFrame, ToolFrame};

use crate::command::Operator;
use crate::event::{HolderSnapshot, ToolSnapshot};
use crate::requests::Requests;
use crate::rules::{Held, Place};
use crate::settings::Lines;

/// Frames in flight on one line at most: two seconds of delay at 1 kHz, every one of them doubled.
const LINE_CAPACITY: usize = 4096;

/// Ticks in which sweeps were decided and that are not durable: a second of them, fifty times what a journal takes.
const UNDURABLE: usize = 1024;

/// Who holds a tool.
pub(crate) struct Holder {
    pub(crate) lease: u32,
    pub(crate) operator: Arc<Operator>,
    pub(crate) since: Timestamp,
    /// Held the tool under an earlier server of the session.
    pub(crate) is_recovered: bool,
    pub(crate) side: Box<ToolSide>,
    /// As last told.
    pub(crate) was_connected: bool,
    /// As last told, if the tool is in fault.
    pub(crate) fault: Option<Implausible>,
}

/// For whom a tool is kept that nobody holds.
pub(crate) struct Reservation {
    pub(crate) operator: Arc<str>,
    pub(crate) since: Timestamp,
}

pub(crate) struct ToolSlot {
    pub(crate) holder: Option<Holder>,
    /// Who has asked the holder for it; empty where there is none.
    pub(crate) requests: Requests,
    /// Nobody holds it then.
    pub(crate) reserved: Option<Reservation>,
    pub(crate) up: Conditioner<HandleFrame>,
    pub(crate) down: Conditioner<ToolFrame>,
    pub(crate) last: ToolStep,
    /// Sweeps decided by tick, that are not known to be durable.
    pub(crate) undurable: VecDeque<(u64, u32)>,
}

impl ToolSlot {
    /// Slot number `number`, free. Every line has random numbers of its own.
    pub(crate) fn new(number: usize, lines: &Lines) -> Self {
        let number = number as u64;
        Self {
            holder: None,
            requests: Requests::new(),
            reserved: None,
            up: Conditioner::new(lines.up, lines.up_seed.wrapping_add(number), LINE_CAPACITY),
            down: Conditioner::new(
                lines.down,
                lines.down_seed.wrapping_add(number),
                LINE_CAPACITY,
            ),
            last: ToolStep::default(),
            undurable: VecDeque::with_capacity(UNDURABLE),
        }
    }

    /// Notes up to which number sweeps were decided in a tick. Without room, what is noted becomes durable later.
    pub(crate) fn note_decided(&mut self, tick: u64, decided: u32) {
        if self
            .undurable
            .back()
            .is_some_and(|(_, last)| *last == decided)
        {
            return;
        }
        if UNDURABLE <= self.undurable.len() {
            self.undurable.pop_back();
        }
        self.undurable.push_back((tick, decided));
    }

    /// What was decided up to a tick is durable.
    pub(crate) fn set_durable(&mut self, tick: u64) {
        while let Some((decided_at, decided)) = self.undurable.front().copied()
            && decided_at <= tick
        {
            self.undurable.pop_front();
            if let Some(side) = self.side_mut() {
                side.set_durable(decided);
            }
        }
    }

    /// Changes what the lines do, from the next frame on.
    pub(crate) fn impair(&mut self, number: usize, lines: &Lines) {
        let number = number as u64;
        self.up.impair(lines.up);
        self.up.reseed(lines.up_seed.wrapping_add(number));
        self.down.impair(lines.down);
        self.down.reseed(lines.down_seed.wrapping_add(number));
    }

    /// Nothing that an earlier holder sent, or was sent, reaches anybody.
    pub(crate) fn clear_lines(&mut self) {
        self.up.clear();
        self.down.clear();
        self.last = ToolStep::default();
        self.undurable.clear();
    }

    /// Whether it stays as it is, however long nobody does anything.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.holder.is_none()
            && self.reserved.is_none()
            && self.requests.is_empty()
            && self.up.in_flight() == 0
            && self.down.in_flight() == 0
    }

    pub(crate) fn side(&self) -> Option<&ToolSide> {
        self.holder.as_ref().map(|holder| &*holder.side)
    }

    pub(crate) fn side_mut(&mut self) -> Option<&mut ToolSide> {
        self.holder.as_mut().map(|holder| &mut *holder.side)
    }

    pub(crate) fn held(&self, now: Timestamp) -> Option<Held<'_>> {
        self.holder.as_ref().map(|holder| Held {
            operator: &holder.operator.name,
            is_connected: holder.side.is_connected(now),
            silence: Duration::from_secs_f64(holder.side.unheard_s(now)),
            held_for: now.since(holder.since),
            is_awaited: holder.is_recovered && !holder.side.is_heard(),
        })
    }

    /// As the rules see it.
    pub(crate) fn place(&self, now: Timestamp) -> Place<'_> {
        match (self.held(now), &self.reserved) {
            (Some(held), _) => Place::Held(held),
            (None, Some(reserved)) => Place::ReservedFor(&reserved.operator),
            (None, None) => Place::Free,
        }
    }

    pub(crate) fn snapshot(&self) -> ToolSnapshot {
        ToolSnapshot {
            requests: self.requests.names().cloned().collect(),
            ..self.snapshot_but_for_requests()
        }
    }

    /// Touches no heap.
    pub(crate) fn snapshot_but_for_requests(&self) -> ToolSnapshot {
        let holder = self.holder.as_ref().map(|holder| HolderSnapshot {
            lease: holder.lease,
            operator: Arc::clone(&holder.operator),
            is_connected: holder.was_connected,
            fault: holder.fault,
        });
        let reserved = self.reserved.as_ref();
        ToolSnapshot {
            holder,
            requests: Vec::new(),
            reserved_for: reserved.map(|reserved| Arc::clone(&reserved.operator)),
        }
    }
}
