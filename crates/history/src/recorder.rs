//! Writes records from a session, tick by tick. Nothing here allocates after it was made, so it may stand on the tick.

use teleclay_session::{Event, EventKind, Session};

use crate::record::{put_begun, put_cuts, put_event, put_gone_on, put_head};

/// Room for a record: settings take 3 KiB, the cuts of eight tools that merge all they can 16 KiB.
const ROOM: usize = 1 << 17;
/// Without anything to tell, a record says every so many ticks that time passes.
const TICKS_BETWEEN: u64 = 1000;

/// The recorder of one session.
pub struct Recorder {
    record: Vec<u8>,
    last_tick: u64,
    /// As last written, by slot.
    decided: Vec<u32>,
}

impl Recorder {
    /// For a session of so many tools.
    #[must_use]
    pub fn new(tools: usize) -> Self {
        Self {
            record: Vec::with_capacity(ROOM),
            last_tick: 0,
            decided: vec![0; tools],
        }
    }

    /// The first record of a session that begins: before its first tick, its tools free. `given` is the hash of a block
    /// that its settings do not describe.
    pub fn begin(&mut self, session: &Session, given: Option<u64>) -> &[u8] {
        self.start(session.ticks());
        let counts = [session.ownership_epoch(), session.next_lease()];
        let settings = session.settings();
        put_begun(
            &mut self.record,
            settings,
            session.clay_epoch(),
            given,
            counts,
        );
        &self.record
    }

    /// The first record of a session that was [recovered](Session::recover).
    pub fn go_on(&mut self, session: &Session) -> &[u8] {
        self.start(session.ticks());
        put_gone_on(&mut self.record, session.ownership_epoch());
        &self.record
    }

    /// What happened since the last record, if anything did: after a [tick](Session::tick), with all events that the
    /// session has given since, in their order.
    pub fn record<'a>(
        &mut self,
        session: &Session,
        events: impl Iterator<Item = &'a Event> + Clone,
    ) -> Option<&[u8]> {
        let tick = session.ticks();
        let last_tick = self.last_tick;
        self.start(tick);
        let empty = self.record.len();
        // What was told in an earlier tick came before this one's cuts.
        for event in events.clone().filter(|event| event.tick < tick) {
            self.put(event);
        }
        for made in session.cuts() {
            let before = self.decided.get_mut(made.slot);
            let is_decided = before
                .is_some_and(|before| std::mem::replace(before, made.decided) != made.decided);
            if is_decided || !made.cuts.is_empty() {
                put_cuts(&mut self.record, &made);
            }
        }
        for event in events.filter(|event| tick <= event.tick) {
            self.put(event);
        }
        if self.record.len() == empty && tick < last_tick + TICKS_BETWEEN {
            self.last_tick = last_tick;
            return None;
        }
        Some(&self.record)
    }

    /// What commands have changed since the last tick, as a record of that tick: of `events` those that were told
    /// before this one. Whoever writes it gives [`record`](Self::record) the others, and can tell then what came before
    /// the tick from what came in it.
    pub fn between<'a>(
        &mut self,
        session: &Session,
        events: impl Iterator<Item = &'a Event>,
    ) -> Option<&[u8]> {
        let tick = session.ticks();
        let last_tick = self.last_tick;
        self.start(tick.saturating_sub(1));
        self.last_tick = last_tick;
        let empty = self.record.len();
        for event in events.filter(|event| event.tick < tick) {
            self.put(event);
        }
        (empty < self.record.len()).then_some(&*self.record)
    }

    fn put(&mut self, event: &Event) {
        if let EventKind::Taken { slot, .. } | EventKind::Released { slot, .. } = &event.kind
            && let Some(decided) = self.decided.get_mut(*slot)
        {
            // Another handle numbers its sweeps anew.
            *decided = 0;
        }
        put_event(&mut self.record, event);
    }

    fn start(&mut self, tick: u64) {
        self.record.clear();
        self.last_tick = tick;
        put_head(&mut self.record, tick);
    }
}
