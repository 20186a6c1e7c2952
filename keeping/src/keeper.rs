//! One session's history, written tick by tick. It never waits, and touches no heap after it was made.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use teleclay_history::{Ledger, Recorder};
use teleclay_journal::Appender;
use teleclay_session::{Event, Session};

/// Events that wait for whoever is told of them, at most; then the session keeps further ones.
const EVENTS_WAITING: usize = 1024;

/// What a keeper tells everybody else.
#[derive(Debug, Default)]
pub(crate) struct Told {
    durable_revision: AtomicU64,
    /// A record was lost on the way to the thread that writes: nothing that follows can be told of this session.
    has_gap: AtomicBool,
}

impl Told {
    pub(crate) fn durable_revision(&self) -> u64 {
        self.durable_revision.load(Ordering::Relaxed)
    }

    pub(crate) fn has_gap(&self) -> bool {
        self.has_gap.load(Ordering::Relaxed)
    }
}

/// The tick's end of a session's history.
pub struct Keeper {
    recorder: Recorder,
    appender: Appender,
    ticks: Ledger,
    revisions: Ledger,
    /// As last recorded.
    revision: u64,
    told: Arc<Told>,
}

impl Keeper {
    pub(crate) fn new(
        recorder: Recorder,
        mut appender: Appender,
        first: &[u8],
        session: &Session,
    ) -> Self {
        let told = Arc::new(Told::default());
        let (mut ticks, mut revisions) = (Ledger::new(), Ledger::new());
        match appender.push(first) {
            Ok(sequence) => {
                ticks.push(sequence, session.ticks());
                revisions.push(sequence, session.revision());
            }
            Err(_) => told.has_gap.store(true, Ordering::Relaxed),
        }
        Self {
            recorder,
            appender,
            ticks,
            revisions,
            revision: session.revision(),
            told,
        }
    }

    pub(crate) fn told(&self) -> Arc<Told> {
        Arc::clone(&self.told)
    }

    /// Keeps what has happened since the last tick, with all events that the session has given since; and tells the
    /// session what is durable, and whether it may cut.
    pub fn on_tick<'a>(
        &mut self,
        session: &mut Session,
        events: impl Iterator<Item = &'a Event> + Clone,
    ) {
        if !self.told.has_gap()
            && let Some(record) = self.recorder.record(session, events)
        {
            match self.appender.push(record) {
                Ok(sequence) => self.on_pushed(sequence, session),
                Err(_) => self.told.has_gap.store(true, Ordering::Relaxed),
            }
        }
        if self.told.has_gap() {
            session.stop_cutting();
            return;
        }
        let durable = self.appender.durable();
        session.set_durable(self.ticks.durable_tick(durable, session.ticks()));
        let revision = self.revisions.durable_tick(durable, session.revision());
        let told = &self.told.durable_revision;
        told.store(revision, Ordering::Relaxed);
        if self.appender.must_pause() {
            session.stop_cutting();
        } else {
            session.resume_cutting();
        }
    }

    /// Whether all that has happened is durable, so that nothing is left to be told until something happens.
    pub fn is_settled(&self) -> bool {
        self.told.has_gap() || self.told.durable_revision() == self.revision
    }

    fn on_pushed(&mut self, sequence: u64, session: &Session) {
        self.ticks.push(sequence, session.ticks());
        if self.revision != session.revision() {
            // The first of those that this record has brought.
            self.revisions.push(sequence, self.revision + 1);
            self.revision = session.revision();
        }
    }
}

/// Events of a session on their way out: those of a tick are seen together, and leave as there is room for them.
#[derive(Debug)]
pub struct Outbox {
    waiting: VecDeque<Event>,
}

impl Default for Outbox {
    fn default() -> Self {
        Self {
            waiting: VecDeque::with_capacity(EVENTS_WAITING),
        }
    }
}

impl Outbox {
    /// Takes the session's events, and gives them.
    pub fn take_from<'a>(
        &'a mut self,
        session: &mut Session,
    ) -> impl Iterator<Item = &'a Event> + Clone + use<'a> {
        let known = self.waiting.len();
        while self.waiting.len() < EVENTS_WAITING
            && let Some(event) = session.poll_event()
        {
            self.waiting.push_back(event);
        }
        self.waiting.range(known..)
    }

    /// Whether none waits.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// The next one that is to leave.
    pub fn pop(&mut self) -> Option<Event> {
        self.waiting.pop_front()
    }
}
